//! Bodies that rays meet: solid boxes and triangles.

use std::fmt::Debug;

use glam::{DVec3, Vec3};

use super::ray_box::Probe;
use super::ray_triangle::TriangleProbe;
use crate::geometry::Aabb;
use crate::query::ItemId;
use crate::scene::{SurfaceKind, Surfaces, WorldBox};
use crate::visibility::{Ray, RayProbe, Solids};

/// A body that rays meet.
pub trait Body: Copy + Debug + Send + Sync + 'static {
    /// Ray prepared for bodies of this kind.
    type Probe: RayProbe<Hit = Self::Hit> + Debug;
    /// Point where a ray meets the surface of a body.
    type Hit: Copy + Debug;

    /// Prepares a ray for bodies whose local coordinates are relative to `origin`.
    fn probe(ray: &Ray, origin: DVec3) -> Self::Probe;

    /// Item that the body belongs to.
    fn item(&self) -> ItemId;

    /// Returns `true` if the body hides what is behind it.
    fn hides(&self) -> bool;

    /// Exact meeting from near to far; may be `None` if it lies beyond `limit`.
    fn hit(&self, probe: &Self::Probe, limit: f64) -> Option<Self::Hit>;
}

/// An item as a solid box.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SolidBox {
    /// Box as written in the scene.
    pub b: WorldBox,
    /// Id of the item.
    pub item: ItemId,
}

impl SolidBox {
    /// Bodies of some of these boxes, given by item.
    pub fn some<'a>(
        boxes: &'a [WorldBox],
        items: &'a [ItemId],
    ) -> impl Iterator<Item = SolidBox> + 'a {
        let body = |&item: &ItemId| SolidBox {
            b: boxes[item as usize],
            item,
        };
        items.iter().map(body)
    }
}

impl Body for SolidBox {
    type Probe = Probe;
    type Hit = <Probe as RayProbe>::Hit;

    #[inline(always)]
    fn probe(ray: &Ray, _: DVec3) -> Probe {
        Probe::new(*ray)
    }

    #[inline(always)]
    fn item(&self) -> ItemId {
        self.item
    }

    #[inline(always)]
    fn hides(&self) -> bool {
        true
    }

    #[inline(always)]
    fn hit(&self, probe: &Probe, limit: f64) -> Option<Self::Hit> {
        probe.enter(&self.b, limit)
    }
}

/// A triangle of an item.
///
/// A one-sided triangle is met from its front only.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Facet {
    /// Scene-local corners, counter-clockwise seen from the front.
    pub corners: [Vec3; 3],
    /// Id of the item.
    pub item: ItemId,
    /// `true` if rays meet the triangle from behind too.
    pub two_sided: bool,
    /// `true` if the triangle hides what is behind it.
    pub hides: bool,
}

impl Facet {
    /// Triangle of an item of surfaces; it hides if it is opaque.
    pub fn of(surfaces: &Surfaces, item: usize, triangle: u32) -> Facet {
        Facet {
            corners: surfaces.corners(triangle),
            item: item as ItemId,
            two_sided: surfaces.two_sided[triangle as usize],
            hides: surfaces.kinds[triangle as usize] == SurfaceKind::Opaque,
        }
    }
}

impl Body for Facet {
    type Probe = TriangleProbe;
    type Hit = <TriangleProbe as RayProbe>::Hit;

    #[inline(always)]
    fn probe(ray: &Ray, origin: DVec3) -> TriangleProbe {
        TriangleProbe::new(*ray, origin)
    }

    #[inline(always)]
    fn item(&self) -> ItemId {
        self.item
    }

    #[inline(always)]
    fn hides(&self) -> bool {
        self.hides
    }

    #[inline(always)]
    fn hit(&self, probe: &TriangleProbe, limit: f64) -> Option<Self::Hit> {
        probe.hit(self.corners, self.two_sided, limit)
    }
}

/// Bodies of a scene, over which ray indexes are built.
#[derive(Clone, Debug)]
pub struct Bodies<B> {
    /// All bodies, item by item.
    pub all: Vec<B>,
    /// Bounds of each body, f32 relative to `origin`.
    pub bounds: Vec<Aabb>,
    /// World position of the local origin.
    pub origin: DVec3,
    /// Number of items.
    ///
    /// Bodies of higher ids (floors and ceilings of a map) end the search for a ray's first item;
    /// picking ignores them otherwise.
    pub items: usize,
}

/// Items of a scene as solid boxes.
pub type Boxes = Bodies<SolidBox>;

/// Triangles of a scene.
pub type Facets = Bodies<Facet>;

impl Boxes {
    /// Bodies of all solids.
    pub fn of(solids: &Solids) -> Boxes {
        let numbered = solids.boxes.iter().zip(0..);
        let all = numbered.map(|(&b, item)| SolidBox { b, item });
        Boxes::some(solids, all.collect())
    }

    /// Bodies of some of the solids.
    pub fn some(solids: &Solids, all: Vec<SolidBox>) -> Boxes {
        let bounds = all.iter().map(|body| solids.outer[body.item as usize]);
        Bodies {
            bounds: bounds.collect(),
            all,
            origin: solids.origin,
            items: solids.boxes.len(),
        }
    }
}

impl Facets {
    /// All triangles of surfaces; the opaque ones hide what is behind them.
    pub fn of(surfaces: &Surfaces) -> Facets {
        let of_item = |item: usize| {
            let own = surfaces.of_item[item].clone();
            own.map(move |triangle| Facet::of(surfaces, item, triangle))
        };
        let all: Vec<Facet> = (0..surfaces.items()).flat_map(of_item).collect();
        let bounds = all.iter().map(|facet| Aabb::of_points(facet.corners));
        Bodies {
            bounds: bounds.collect(),
            all,
            origin: surfaces.origin,
            items: surfaces.items(),
        }
    }

    /// Triangles as picking treats them: all of them hide, cut-outs too.
    ///
    /// Only the first `items` of the surfaces' items can be picked.
    pub fn solid(surfaces: &Surfaces, items: usize) -> Facets {
        let mut facets = Facets::of(surfaces);
        facets.all.iter_mut().for_each(|facet| facet.hides = true);
        Bodies { items, ..facets }
    }
}
