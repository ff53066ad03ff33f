//! What a generator makes, before it is a scene.

use glam::DVec3;

use super::{Originals, Portal, Tiling, WorldBox};
use crate::geometry::Aabb;
use crate::query::ItemId;

/// What a family makes, in world coordinates.
pub struct World {
    pub boxes: Vec<WorldBox>,
    /// Regions that are not the items, with their portals.
    pub rooms: Option<Plan>,
}

impl From<Vec<WorldBox>> for World {
    fn from(boxes: Vec<WorldBox>) -> Self {
        World { boxes, rooms: None }
    }
}

/// The rooms and doors in world coordinates.
#[derive(Default)]
pub struct Plan {
    pub(super) rooms: Vec<WorldBox>,
    pub(super) doors: Vec<([ItemId; 2], WorldBox)>,
}

impl Plan {
    pub fn shift(&mut self, by: DVec3) {
        let doors = self.doors.iter_mut().map(|(_, b)| b);
        for b in self.rooms.iter_mut().chain(doors) {
            *b = WorldBox::new(b.min + by, b.max + by);
        }
    }

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
