//! The triangles of a scene as picking takes them.
//!
//! Every item is taken for solid, what has holes as well; a one-sided triangle is met
//! from its front only. What is no item (floors and ceilings of a map) ends a ray's
//! search for the first item, and is passed by the one for the nearest few.

use glam::{DVec3, Vec3};

use crate::geometry::Aabb;
use crate::query::ItemId;
use crate::scene::Surfaces;

/// A triangle of an item.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Facet {
    /// About the scene's origin, counter-clockwise from the front.
    pub corners: [Vec3; 3],
    /// Whose it is.
    pub item: ItemId,
    /// Whether it is met from behind too.
    pub two_sided: bool,
}

/// All triangles of a scene.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Facets {
    /// Item by item.
    pub all: Vec<Facet>,
    /// Where the zero of their corners is.
    pub origin: DVec3,
    /// So many items count, the first ones.
    pub items: usize,
}

impl Facets {
    /// Of which the first so many items count.
    pub fn of(surfaces: &Surfaces, items: usize) -> Facets {
        let of_item = |item: usize| {
            surfaces.of(item).map(move |corners| Facet {
                corners,
                item: item as ItemId,
                two_sided: surfaces.two_sided[item],
            })
        };
        Facets {
            all: (0..surfaces.items()).flat_map(of_item).collect(),
            origin: surfaces.origin,
            items,
        }
    }

    /// The box of each.
    pub(super) fn bounds(&self) -> Vec<Aabb> {
        let bounds = |facet: &Facet| {
            let [a, b, c] = facet.corners;
            Aabb::new(a.min(b).min(c), a.max(b).max(c))
        };
        self.all.iter().map(bounds).collect()
    }
}
