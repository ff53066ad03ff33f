//! A walk through doors at constant eye height.
//!
//! Doors are the portals of rooms and the two-sided linedefs of a Doom map. Furniture and steps are
//! no obstacles.

use glam::{DVec2, DVec3};

use super::{Pose, Stage, unfit};
use crate::input::Result;
use crate::scene::{Regions, SeededRng, Tiling, WadMap};
use crate::spec::Spec;

/// Doors drawn for each step of the walk.
const DRAWN: usize = 16;
/// Least height of an opening that a Doom player fits through, map units.
const FITTING: f64 = 56.0;

/// A door in a floor plan.
struct Door {
    at: DVec2,
    sides: [u32; 2],
    /// Index of its line among the walls, if it is one.
    wall: Option<usize>,
}

/// Floors connected by doors.
struct Plan<'s> {
    doors: Vec<Door>,
    /// Height of the floor of each region.
    floors: Vec<f64>,
    /// Doors of each region.
    exits: Vec<Vec<usize>>,
    /// Lines that a step must not cross; none if regions are convex.
    walls: Vec<[DVec2; 2]>,
    map: Option<&'s WadMap>,
}

pub(super) fn frames(stage: &Stage, spec: &mut Spec) -> Result<Vec<Pose>> {
    let (plan, natural) = match &stage.scene.regions {
        Regions::Tiling(tiling) => (Plan::of_rooms(stage, tiling), 1.7),
        Regions::Bsp(map) => (Plan::of_map(map), 41.0),
        _ => (Plan::new(Vec::new(), Vec::new()), 1.7),
    };
    let height = spec.number_between("height", natural, 0.0, 1e6)?;
    let doors = spec.whole("doors", 32, 1..=100_000)? as usize;
    if plan.doors.is_empty() {
        let wanted = "expected rooms or a Doom map (the path 'street' needs none)";
        let reason = format_args!("scene '{}' has no doors; {wanted}", stage.scene.name);
        return Err(unfit("walk", reason));
    }
    let way = plan.way(doors, height, &mut stage.rng());
    let mut lengths = vec![0.0];
    lengths.extend(way.windows(2).scan(0.0, |total, step| {
        // Steps up or down do not add to the length.
        *total += step[0].truncate().distance(step[1].truncate());
        Some(*total)
    }));
    let at = |length: f64| {
        let next = lengths.partition_point(|&l| l <= length).min(way.len() - 1);
        let from = next.saturating_sub(1);
        let step = lengths[next] - lengths[from];
        // NaN if both are the same point: either will do.
        let share = (length - lengths[from]) / step;
        way[from].lerp(way[next], share.min(1.0))
    };
    // Towards the point a few steps ahead.
    let total = lengths[way.len() - 1];
    let ahead = |eye: DVec3, length: f64| {
        let along = (at(length + 2.0 * height) - eye).with_z(0.0);
        (along.length() > 1e-6 * height).then_some(along)
    };
    let mut forward = DVec3::X;
    let poses = stage.turns().map(|turn| {
        let eye = at(turn * total);
        forward = ahead(eye, turn * total).unwrap_or(forward);
        Pose::new(eye, forward)
    });
    Ok(poses.collect())
}

impl<'s> Plan<'s> {
    fn new(doors: Vec<Door>, floors: Vec<f64>) -> Self {
        let mut exits = vec![Vec::new(); floors.len()];
        for (i, door) in doors.iter().enumerate() {
            for side in door.sides {
                exits[side as usize].push(i);
            }
        }
        Plan {
            doors,
            floors,
            exits,
            walls: Vec::new(),
            map: None,
        }
    }

    fn of_rooms(stage: &Stage, tiling: &Tiling) -> Self {
        let floors = tiling.boxes.iter().map(|room| stage.in_world(room).0.z);
        let doors = tiling.portals.iter().map(|portal| {
            let (min, max) = stage.in_world(&portal.opening);
            Door {
                at: (min / 2.0 + max / 2.0).truncate(),
                sides: portal.between,
                wall: None,
            }
        });
        Plan::new(doors.collect(), floors.collect())
    }

    fn of_map(map: &'s WadMap) -> Self {
        let floors = map.sectors.iter().map(|sector| sector.heights[0]);
        let lines = map.lines.iter();
        let walls = lines.map(|line| line.ends.map(|end| DVec2::from(end.map(f64::from))));
        let walls: Vec<[DVec2; 2]> = walls.collect();
        let doors = map.lines.iter().enumerate().filter_map(|(i, line)| {
            let sides = [line.sectors[0]?, line.sectors[1]?];
            let [a, b] = sides.map(|side| map.sectors[side as usize].heights);
            let opening = a[1].min(b[1]) - a[0].max(b[0]);
            let [from, to] = walls[i];
            // A line with an action may open.
            let is_way = sides[0] != sides[1] && (opening >= FITTING || line.action != 0);
            is_way.then_some(Door {
                at: (from + to) / 2.0,
                sides,
                wall: Some(i),
            })
        });
        Plan {
            map: Some(map),
            walls: walls.clone(),
            ..Plan::new(doors.collect(), floors.collect())
        }
    }

    /// Corners of a walk through `count` doors, eyes `height` above the floors.
    fn way(&self, count: usize, height: f64, rng: &mut SeededRng) -> Vec<DVec3> {
        let mut here = rng.below(self.doors.len());
        let mut side = self.doors[here].sides[rng.below(2)];
        let mut way = Vec::with_capacity(2 * count);
        for _ in 0..count {
            let eye = |door: usize| {
                let floor = self.floors[side as usize];
                self.doors[door].at.extend(floor + height)
            };
            way.push(eye(here));
            let exits = &self.exits[side as usize];
            let mut drawn = (0..DRAWN).map(|_| exits[rng.below(exits.len())]);
            // Back through the same door if no other is reachable.
            let free = drawn.find(|&next| self.is_free(side, here, next));
            here = free.unwrap_or(here);
            way.push(eye(here));
            let [a, b] = self.doors[here].sides;
            side = if side == a { b } else { a };
        }
        way
    }

    /// Tests whether the segment between two doors stays in the region, off walls.
    fn is_free(&self, region: u32, from: usize, to: usize) -> bool {
        let [a, b] = [from, to].map(|door| &self.doors[door]);
        let (p, q) = (a.at, b.at);
        let side = |u: DVec2, v: DVec2, w: DVec2| (v - u).perp_dot(w - u);
        let meets = |&[u, v]: &[DVec2; 2]| {
            side(p, q, u) * side(p, q, v) <= 0.0 && side(u, v, p) * side(u, v, q) <= 0.0
        };
        // On one line all sides are 0: such walls count as met if they lie between.
        let is_near =
            |&[u, v]: &[DVec2; 2]| u.min(v).cmple(p.max(q)).all() && p.min(q).cmple(u.max(v)).all();
        let own = [a.wall, b.wall];
        let mut walls = self.walls.iter().enumerate();
        // If no line is met, the whole segment is where its midpoint is: between two edges of a
        // platform it crosses that.
        let is_within = self.map.is_none_or(|map| {
            let leaf = map.tree.descend((p + q) / 2.0);
            leaf.is_some_and(|leaf| map.leaf_sectors[leaf as usize] == region)
        });
        from != to
            && is_within
            && !walls.any(|(i, w)| !own.contains(&Some(i)) && is_near(w) && meets(w))
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use crate::path::{self, LensDefaults};
    use crate::scene::{self, Regions, Scene};

    fn eyes(scene: &Scene, spec: &str) -> Vec<DVec3> {
        let path = path::load(spec, scene, &LensDefaults::default()).unwrap();
        let level = path.cameras.iter().all(|c| c.frame.forward().z == 0.0);
        assert!(level);
        path.cameras.iter().map(|c| c.frame.eye).collect()
    }

    fn rooms_at(scene: &Scene, eye: DVec3) -> Vec<u32> {
        let local = (eye - scene.origin).as_vec3();
        scene.regions.holding(local, &scene.items)
    }

    #[test]
    fn rooms_are_left_through_doors_at_eye_height() {
        let scene = scene::load("rooms:n=4000,offset=1e6", &Default::default()).unwrap();
        let Regions::Tiling(tiling) = &scene.regions else {
            panic!("no rooms");
        };
        let eyes = eyes(&scene, "walk:frames=4000,doors=40");
        let mut changes = 0;
        for pair in eyes.windows(2) {
            let rooms = [rooms_at(&scene, pair[0]), rooms_at(&scene, pair[1])];
            assert!(rooms.iter().all(|ids| !ids.is_empty()), "{pair:?}");
            if rooms[0].iter().any(|room| rooms[1].contains(room)) {
                continue;
            }
            changes += 1;
            let joins = |p: &&scene::Portal| {
                let between = |[a, b]: [u32; 2]| rooms[0].contains(&a) && rooms[1].contains(&b);
                let [a, b] = p.between;
                between([a, b]) || between([b, a])
            };
            assert!(tiling.portals.iter().any(|p| joins(&p)), "{pair:?}");
            let low = |room: u32| tiling.boxes[room as usize].in_world(scene.origin).0.z;
            let above = pair[1].z - low(rooms[1][0]);
            assert!((0.0..3.0 + 1e-3).contains(&above), "{above}");
        }
        assert!(changes >= 10, "{changes} doors");
    }

    #[test]
    fn a_walk_through_a_map_meets_no_solid_line() {
        for (name, least) in [("freedm-map12", 3), ("freedm-map20", 5)] {
            let scene = scene::load(name, &Default::default()).unwrap();
            let Regions::Bsp(map) = &scene.regions else {
                panic!("no map");
            };
            let eyes = eyes(&scene, "walk:frames=512,seed=2");
            let solid = map.lines.iter().filter(|l| l.sectors.contains(&None));
            let solid: Vec<[DVec3; 2]> = solid
                .map(|l| l.ends.map(|[x, y]| DVec3::new(x.into(), y.into(), 0.0)))
                .collect();
            let sector = |eye: DVec3| {
                let leaf = map.tree.descend(eye.truncate()).unwrap();
                map.leaf_sectors[leaf as usize]
            };
            let mut sectors: Vec<u32> = eyes.iter().map(|&eye| sector(eye)).collect();
            // Planes of the tree are rounded: close to a line its sector is uncertain.
            let is_below = |eye: &&DVec3| {
                let off = map.lines.iter().all(|line| {
                    let [u, v] = line.ends.map(|end| glam::DVec2::from(end.map(f64::from)));
                    (v - u).perp_dot(eye.truncate() - u).abs() > (v - u).length()
                });
                let floor = map.sectors[sector(**eye) as usize].heights[0];
                off && (eye.z - floor - 41.0).abs() > 1e-9
            };
            let below: Vec<&DVec3> = eyes.iter().filter(is_below).collect();
            assert!(below.is_empty(), "{name}: {below:?}");
            for pair in eyes.windows(2) {
                let [p, q] = [pair[0].truncate(), pair[1].truncate()];
                for line in &solid {
                    let [u, v] = line.map(|end| end.truncate());
                    let side = |a: glam::DVec2, b: glam::DVec2, c| (b - a).perp_dot(c - a);
                    let is_cut =
                        side(p, q, u) * side(p, q, v) < 0.0 && side(u, v, p) * side(u, v, q) < 0.0;
                    assert!(!is_cut, "{name}: {p} to {q} through {u} to {v}");
                }
            }
            sectors.sort_unstable();
            sectors.dedup();
            assert!(sectors.len() >= least, "{name}: {} sectors", sectors.len());
        }
    }
}
