//! The scan of a game engine, after the visibility system of Bevy.
//!
//! One record per entity with its flags and bounds; each is tested in turn, its flag set, and
//! visible ones are listed. A stand-in, not Bevy's own code: `bevy_camera` pulls in two hundred
//! crates, and its test (centre and half-extents, a sphere first) rounds differently, so its
//! answers could not be compared.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::geometry::Aabb;
use crate::index::box_test::{BoxQuery, BoxTest, BoxTested};
use crate::index::items::{Positions, Record};
use crate::index::{BuildError, Info, Kind, MemoryUsage, NoParams, Origin};
use crate::query::{Context, ItemId};

/// The components of an entity that the visibility system reads and writes.
struct Entity {
    item: Record,
    /// Bit mask of the entity's render layers.
    layers: u32,
    inherited_visibility: bool,
    no_frustum_culling: bool,
    /// Set by the last query: visible in some view.
    view_visibility: AtomicBool,
}

/// All entities in the order of the scene.
pub struct PeerBevyStyle {
    entities: Vec<Entity>,
    positions: Positions,
}

impl From<Record> for Entity {
    fn from(item: Record) -> Entity {
        Entity {
            item,
            layers: LAYER,
            inherited_visibility: !item.bounds.is_empty(),
            no_frustum_culling: false,
            view_visibility: AtomicBool::new(false),
        }
    }
}

/// The layer of every view.
const LAYER: u32 = 1;

impl BoxTested for PeerBevyStyle {
    const ABOUT: Info = Info::new(
        "peer-bevy-style",
        "a stand-in for Bevy's visibility system: flags and bounds of every entity, one by one",
        Kind::Scan,
        Origin::StandIn("Bevy"),
    )
    .refits();
    type Params = NoParams;

    fn of(items: Vec<Record>, _: &NoParams) -> Result<Self, BuildError> {
        let mut entities = Vec::with_capacity(items.len());
        entities.extend(items.into_iter().map(Entity::from));
        Ok(PeerBevyStyle {
            entities,
            positions: Positions::default(),
        })
    }

    /// Overwrites the bounds; hides entities that are gone, spawns new ones.
    fn follow(&mut self, items: &[Aabb], moved: &[ItemId]) -> Option<()> {
        let ids = self.entities.iter().map(|entity| &entity.item.id);
        self.positions.prepare(ids, items.len());
        for &id in moved {
            let bounds = items[id as usize];
            if let Some(at) = self.positions.of(id) {
                let entity = &mut self.entities[at];
                entity.item.bounds = bounds;
                entity.inherited_visibility = !bounds.is_empty();
            } else {
                self.positions.set(id, self.entities.len() as u32);
                self.entities.push(Record { bounds, id }.into());
            }
        }
        Some(())
    }

    fn used(&self) -> MemoryUsage {
        MemoryUsage {
            node_bytes: 0,
            item_bytes: size_of_val(&self.entities[..]) + self.positions.bytes(),
        }
    }

    #[inline(always)]
    fn search<T: BoxTest + ?Sized, C: Context>(&self, ask: &mut BoxQuery<T, C>) -> ControlFlow<()> {
        for entity in &self.entities {
            if !entity.inherited_visibility || entity.layers & LAYER == 0 {
                continue;
            }
            let seen = entity.no_frustum_culling || ask.admits(&entity.item.bounds);
            entity.view_visibility.store(seen, Ordering::Relaxed);
            if seen {
                ask.cx.accept(std::slice::from_ref(&entity.item.id))?;
            }
        }
        ControlFlow::Continue(())
    }
}
