//! An indoor block: storeys of box-shaped rooms connected by doors.
//!
//! The rooms tile the block and are the regions of region search; the doors are the portals between
//! them; slabs, walls and furniture are the items.

use glam::DVec3;

use super::rng::SeededRng;
use super::{WorldBox, WrittenBoxes};
use crate::geometry::Aabb;
use crate::query::ItemId;
use crate::spec::{Spec, SpecError};

/// Boxes that tile a volume.
#[derive(Clone, Default, Debug)]
pub struct Tiling {
    /// Boxes in scene coordinates; the id is the index.
    pub boxes: Vec<Aabb>,
    /// The boxes as written, if f32 changes any of them.
    pub originals: WrittenBoxes,
    /// Openings between neighbours.
    pub portals: Vec<Portal>,
}

/// An opening between two regions of a tiling.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Portal {
    /// Ids of the two regions.
    pub between: [ItemId; 2],
    /// Box of the opening between the two, in scene coordinates.
    pub opening: Aabb,
}

/// A generated world, in world coordinates: boxes, and the rooms they enclose.
#[derive(Default)]
pub struct World {
    pub boxes: Vec<WorldBox>,
    /// Regions of the scene; empty if the regions are the items.
    pub rooms: Vec<WorldBox>,
    /// Openings, each with the indices of its two rooms.
    pub doors: Vec<([ItemId; 2], WorldBox)>,
}

impl World {
    /// Moves everything by the same distance along all axes.
    pub fn shift(&mut self, by: f64) {
        let doors = self.doors.iter_mut().map(|(_, b)| b);
        for b in self.boxes.iter_mut().chain(&mut self.rooms).chain(doors) {
            *b = WorldBox::new(b.min + by, b.max + by);
        }
    }

    /// The rooms and doors relative to the origin of a scene.
    pub fn tiling(&self, origin: DVec3) -> Tiling {
        let local = |b: &WorldBox| Aabb::rounded_outward(b.min, b.max, origin);
        let boxes: Vec<Aabb> = self.rooms.iter().map(local).collect();
        let portal = |(between, opening): &([ItemId; 2], WorldBox)| Portal {
            between: *between,
            opening: local(opening),
        };
        Tiling {
            originals: WrittenBoxes::of(&self.rooms, &boxes, origin),
            boxes,
            portals: self.doors.iter().map(portal).collect(),
        }
    }
}

const STOREY_HEIGHT: f64 = 3.0;
const WALL: f64 = 0.2;
const DOOR_WIDTH: f64 = 1.0;
const DOOR_HEIGHT: f64 = 2.1;
/// Average number of items per room, furniture included.
const ITEMS_PER_ROOM: usize = 16;

pub fn build(spec: &mut Spec, n: usize, rng: &mut SeededRng) -> Result<World, SpecError> {
    let storeys = spec.whole("storeys", 3, 1..=1000)? as usize;
    let edge = spec.number_between("room", 6.0, 2.0 * DOOR_WIDTH, 1e6)?;
    let wanted = n.div_ceil(ITEMS_PER_ROOM).max(1);
    let storeys = storeys.min(wanted);
    let per_side = ((wanted / storeys) as f64).sqrt().floor().max(1.0) as usize;
    // Wall lines at jittered multiples of a quarter of a metre: doors fit, and walls of
    // neighbouring rooms share exact coordinates.
    let mut lines = || {
        let jitter = (edge - 2.0 * DOOR_WIDTH) / 2.0;
        let mut at = 0.0;
        let mut lines = vec![0.0];
        for _ in 0..per_side {
            let width: f64 = edge + rng.between(-jitter, jitter);
            at += (width * 4.0).round() / 4.0;
            lines.push(at);
        }
        lines
    };
    let (xs, ys) = (lines(), lines());
    let mut world = World::default();
    let boxes = &mut world.boxes;
    for storey in 0..storeys {
        for (j, y) in ys.windows(2).enumerate() {
            for (i, x) in xs.windows(2).enumerate() {
                let low = DVec3::new(x[0], y[0], storey as f64 * STOREY_HEIGHT);
                let high = DVec3::new(x[1], y[1], low.z + STOREY_HEIGHT);
                let id = world.rooms.len();
                let room = WorldBox::new(low, high);
                boxes.push(WorldBox::new(low, DVec3::new(high.x, high.y, low.z + WALL)));
                // The walls towards rooms with lower indices have the doors.
                for (axis, first, before) in [(0, i == 0, 1), (1, j == 0, per_side)] {
                    let door = door_in(&room, axis, rng);
                    push_wall(boxes, &room, axis, (!first).then_some(&door));
                    if !first {
                        let between = [(id - before) as ItemId, id as ItemId];
                        world.doors.push((between, door));
                    }
                }
                world.rooms.push(room);
            }
        }
    }
    boxes.truncate(n);
    while boxes.len() < n {
        let room = world.rooms[rng.below(world.rooms.len())];
        boxes.push(furniture(&room, rng));
    }
    // Storeys are connected by one stairwell: the first room of each.
    let per_storey = per_side * per_side;
    for storey in 1..storeys {
        let (below, above) = ((storey - 1) * per_storey, storey * per_storey);
        let room = world.rooms[above];
        let hole = DVec3::new(DOOR_WIDTH, DOOR_WIDTH, 0.0);
        let opening = WorldBox::new(room.min, room.min + hole);
        let between = [below as ItemId, above as ItemId];
        world.doors.push((between, opening));
    }
    Ok(world)
}

/// The door in the room's low wall across `axis`: flat on that axis.
fn door_in(room: &WorldBox, axis: usize, rng: &mut SeededRng) -> WorldBox {
    let along = 1 - axis;
    let free = room.max[along] - room.min[along] - 2.0 * WALL - DOOR_WIDTH;
    let (mut low, mut high) = (room.min, room.min);
    low[along] += WALL + rng.unit() * free;
    high[along] = low[along] + DOOR_WIDTH;
    low.z += WALL;
    high.z = low.z + DOOR_HEIGHT;
    WorldBox::new(low, high)
}

/// The low wall across `axis`: whole, or two pieces and a lintel around a door.
fn push_wall(boxes: &mut Vec<WorldBox>, room: &WorldBox, axis: usize, door: Option<&WorldBox>) {
    let along = 1 - axis;
    let mut wall = *room;
    wall.max[axis] = wall.min[axis] + WALL;
    let Some(door) = door else {
        boxes.push(wall);
        return;
    };
    let (mut left, mut right, mut lintel) = (wall, wall, wall);
    left.max[along] = door.min[along];
    right.min[along] = door.max[along];
    lintel.min[along] = door.min[along];
    lintel.max[along] = door.max[along];
    lintel.min.z = door.max.z;
    boxes.extend([left, right, lintel]);
}

/// A table, cupboard or trinket on the room's floor.
fn furniture(room: &WorldBox, rng: &mut SeededRng) -> WorldBox {
    let size = match rng.below(3) {
        0 => DVec3::new(rng.between(0.6, 1.6), rng.between(0.6, 1.0), 0.8),
        1 => DVec3::new(0.5, rng.between(0.5, 1.5), rng.between(1.2, 2.0)),
        _ => DVec3::splat(rng.between(0.05, 0.3)),
    };
    let free = room.max - room.min - size - 2.0 * WALL;
    let place = DVec3::new(rng.unit() * free.x, rng.unit() * free.y, 0.0);
    let low = room.min + WALL + place;
    WorldBox::new(low, low + size)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Aabb;

    fn world(text: &str, n: usize) -> World {
        build(&mut Spec::parse(text).unwrap(), n, &mut SeededRng::new(3)).unwrap()
    }

    #[test]
    fn rooms_tile_the_block_and_doors_join_them_all() {
        let tiling = world("rooms:storeys=2", 2000).tiling(DVec3::ZERO);
        let block = Aabb::union_of(&tiling.boxes);
        let volume =
            |b: &Aabb| f64::from(b.extent().x) * f64::from(b.extent().y) * f64::from(b.extent().z);
        let filled: f64 = tiling.boxes.iter().map(volume).sum();
        assert_eq!(filled, volume(&block), "no gap and no overlap");
        // Reachability: a portal touches both of its rooms, and every room can be reached from room
        // 0.
        let mut reached = vec![false; tiling.boxes.len()];
        reached[0] = true;
        for _ in 0..tiling.boxes.len() {
            for portal in &tiling.portals {
                let [a, b] = portal.between.map(|id| id as usize);
                assert!(tiling.boxes[a].intersects(&portal.opening));
                assert!(tiling.boxes[b].intersects(&portal.opening));
                let both = reached[a] || reached[b];
                (reached[a], reached[b]) = (both, both);
            }
        }
        assert!(reached.iter().all(|&r| r), "every room has a way out");
    }

    #[test]
    fn the_shell_fits_the_item_budget() {
        // Slab, two walls in two pieces each, and their lintels.
        const SHELL_ITEMS: usize = 7;
        let rooms = world("rooms", 5000).rooms.len();
        assert!(rooms * SHELL_ITEMS <= 5000, "{rooms} rooms");
    }
}
