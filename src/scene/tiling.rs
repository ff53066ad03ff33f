//! Boxes that tile a volume, joined by portals: the rooms of a generated world.

use glam::DVec3;

use super::{Originals, WorldBox};
use crate::geometry::Aabb;
use crate::query::ItemId;

/// Boxes that tile a volume.
#[derive(Clone, Default, Debug)]
pub struct Tiling {
    /// Boxes in scene coordinates; the id is the index.
    pub boxes: Vec<Aabb>,
    /// The boxes as they were made, where f32 holds any of them otherwise.
    pub originals: Originals,
    /// Openings between neighbours.
    pub portals: Vec<Portal>,
}

/// An opening between two regions of a tiling.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Portal {
    /// Ids of the two regions.
    pub between: [ItemId; 2],
    /// Box through which one sees from one into the other, in scene coordinates.
    pub opening: Aabb,
}

/// A generated world, in world coordinates: boxes, and the rooms that they enclose.
#[derive(Default)]
pub struct World {
    pub boxes: Vec<WorldBox>,
    /// Regions of the scene; none if the regions are the items.
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

    /// The rooms and doors about the origin of a scene.
    pub fn tiling(&self, origin: DVec3) -> Tiling {
        let local = |b: &WorldBox| Aabb::rounded_outward(b.min, b.max, origin);
        let boxes: Vec<Aabb> = self.rooms.iter().map(local).collect();
        let portal = |(between, opening): &([ItemId; 2], WorldBox)| Portal {
            between: *between,
            opening: local(opening),
        };
        Tiling {
            originals: Originals::of(&self.rooms, &boxes, origin),
            boxes,
            portals: self.doors.iter().map(portal).collect(),
        }
    }
}
