//! Picking in scenes of triangles: meshes, and the walls of maps.
//!
//! Every item is taken for solid, what has holes as well; a one-sided triangle is met
//! from its front only. What is no item (floors and ceilings of a map) ends a ray's
//! search for the first item, and is passed by the one for the nearest few.

use ::obvhs::bvh2::Bvh2;
use ::obvhs::ray::{Ray as TheirRay, RayHit};
use ::obvhs::triangle::Triangle as TheirTriangle;
use glam::{DVec3, Vec3};

use super::contract::{Hit, NotBuilt, Pick, keep_nearest, refuse_stacks};
use super::obvhs;
use super::rounded::RoundedRay;
use crate::geometry::Aabb;
use crate::query::ItemId;
use crate::scene::{SurfaceKind, Surfaces};
use crate::visibility::truth::{Meeting, SurfaceIndex, TriangleProbe};
use crate::visibility::{Guarantee, Ray};

/// Builds a back end over triangles, of which the first so many items count.
type Build = fn(&Surfaces, usize) -> Result<Box<dyn Pick>, NotBuilt>;

/// A row of the table of back ends for triangles.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct SurfaceBackEnd {
    /// As in reports.
    pub name: &'static str,
    /// One line for tables and help.
    pub summary: &'static str,
    /// What it promises of its answers.
    pub guarantee: Guarantee,
    /// Builds it over triangles, of which the first so many items count. Deterministic.
    ///
    /// # Errors
    /// As [`NotBuilt`] says.
    pub build: Build,
}

/// All back ends for triangles, the reference first.
pub const SURFACE_BACK_ENDS: &[SurfaceBackEnd] = &[
    SurfaceBackEnd {
        name: "linear",
        summary: "every triangle, in exact arithmetic: the reference",
        guarantee: Guarantee::Exact,
        build: |surfaces, items| Ok(Box::new(EveryTriangle::of(surfaces, items))),
    },
    SurfaceBackEnd {
        name: "ray-tree",
        summary: "binary tree of triangles, exact where f64 does not decide",
        guarantee: Guarantee::Exact,
        build: |surfaces, items| Ok(Box::new(SolidSurfaces::of(surfaces, items))),
    },
    SurfaceBackEnd {
        name: "obvhs",
        summary: "crate obvhs, binary tree, its ray_traverse and Triangle::intersect",
        // Rays, nodes and triangles are rounded to f32.
        guarantee: Guarantee::Unproven,
        build: |surfaces, items| Ok(Box::new(ObvhsTriangles::of(surfaces, items)?)),
    },
];

/// The triangles of a scene with every item solid: the exact answers.
pub struct SolidSurfaces {
    index: SurfaceIndex,
    origin: DVec3,
    items: usize,
}

impl SolidSurfaces {
    /// Of which the first so many items count.
    pub fn of(surfaces: &Surfaces, items: usize) -> SolidSurfaces {
        let mut solid = surfaces.clone();
        solid.kinds.fill(SurfaceKind::Opaque);
        SolidSurfaces {
            index: SurfaceIndex::build(&solid),
            origin: surfaces.origin,
            items,
        }
    }

    /// Every item that the ray meets, ascending.
    pub fn met(&self, ray: &Ray) -> Vec<ItemId> {
        let mut met: Vec<ItemId> = self.along(ray).map(|(item, _)| item).collect();
        met.sort_unstable();
        met.dedup();
        met
    }

    fn along(&self, ray: &Ray) -> impl Iterator<Item = (ItemId, Meeting)> {
        let all = self.index.all_along(ray).into_iter();
        all.filter(|(item, _)| (*item as usize) < self.items)
    }
}

impl Pick for SolidSurfaces {
    fn first(&self, ray: &Ray) -> Option<Hit> {
        let found = self.index.front_of(ray);
        let item = *found.front.first()?;
        let depth = found.meeting?.depth;
        ((item as usize) < self.items).then_some(Hit { item, depth })
    }

    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        let probe = TriangleProbe::new(*ray, self.origin);
        nearest_of(&probe, self.along(ray).collect(), count, hits);
    }
}

/// The first meeting of each item, the first `count` of these and all that are as deep as the
/// last of them.
fn nearest_of(
    probe: &TriangleProbe,
    mut met: Vec<(ItemId, Meeting)>,
    count: usize,
    hits: &mut Vec<Hit>,
) {
    hits.clear();
    met.sort_unstable_by(|(a, at_a), (b, at_b)| a.cmp(b).then(probe.compare(at_a, at_b)));
    met.dedup_by_key(|(item, _)| *item);
    met.sort_by(|(_, a), (_, b)| probe.compare(a, b));
    if let Some((_, last)) = count.checked_sub(1).and_then(|last| met.get(last)).copied() {
        let kept = met.partition_point(|(_, at)| probe.compare(at, &last).is_le());
        met.truncate(kept);
    } else if count == 0 {
        met.clear();
    }
    let hit = |&(item, at): &(ItemId, Meeting)| Hit {
        item,
        depth: at.depth,
    };
    hits.extend(met.iter().map(hit));
}

/// A triangle of an item.
#[derive(Clone, Copy, Debug)]
struct Facet {
    corners: [Vec3; 3],
    item: ItemId,
    two_sided: bool,
}

fn facets(surfaces: &Surfaces) -> Vec<Facet> {
    let of_item = |item: usize| {
        surfaces.of(item).map(move |corners| Facet {
            corners,
            item: item as ItemId,
            two_sided: surfaces.two_sided[item],
        })
    };
    (0..surfaces.items()).flat_map(of_item).collect()
}

/// Every triangle asked, exactly.
struct EveryTriangle {
    facets: Vec<Facet>,
    origin: DVec3,
    items: usize,
}

impl EveryTriangle {
    fn of(surfaces: &Surfaces, items: usize) -> EveryTriangle {
        EveryTriangle {
            facets: facets(surfaces),
            origin: surfaces.origin,
            items,
        }
    }

    fn met(&self, probe: &TriangleProbe) -> Vec<(ItemId, Meeting)> {
        let meet = |facet: &Facet| {
            let at = probe.meet(facet.corners, facet.two_sided, f64::INFINITY)?;
            Some((facet.item, at))
        };
        self.facets.iter().filter_map(meet).collect()
    }
}

impl Pick for EveryTriangle {
    /// O(triangles).
    fn first(&self, ray: &Ray) -> Option<Hit> {
        let probe = TriangleProbe::new(*ray, self.origin);
        let met = self.met(&probe).into_iter();
        let order = |a: &(ItemId, Meeting), b: &(ItemId, Meeting)| {
            probe.compare(&a.1, &b.1).then(a.0.cmp(&b.0))
        };
        let (item, at) = met.min_by(order)?;
        let depth = at.depth;
        ((item as usize) < self.items).then_some(Hit { item, depth })
    }

    /// O(triangles), and sorting what the ray meets.
    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        let probe = TriangleProbe::new(*ray, self.origin);
        let mut met = self.met(&probe);
        met.retain(|(item, _)| (*item as usize) < self.items);
        nearest_of(&probe, met, count, hits);
    }
}

/// The crate's tree over triangles.
struct ObvhsTriangles {
    tree: Bvh2,
    /// In the order of its primitives, as it takes them.
    triangles: Vec<(TheirTriangle, bool, ItemId)>,
    zero: DVec3,
    items: usize,
}

impl ObvhsTriangles {
    fn of(surfaces: &Surfaces, items: usize) -> Result<ObvhsTriangles, NotBuilt> {
        let facets = facets(surfaces);
        let bounds = |facet: &Facet| {
            let [a, b, c] = facet.corners;
            Aabb::new(a.min(b).min(c), a.max(b).max(c))
        };
        let boxes: Vec<Aabb> = facets.iter().map(bounds).collect();
        refuse_stacks("obvhs", &boxes)?;
        let tree = obvhs::binary_tree(&boxes);
        let placed = tree.primitive_indices.iter().map(|&place| {
            let facet = &facets[place as usize];
            let [v0, v1, v2] = facet.corners.map(Into::into);
            (TheirTriangle { v0, v1, v2 }, facet.two_sided, facet.item)
        });
        Ok(ObvhsTriangles {
            triangles: placed.collect(),
            zero: surfaces.origin,
            items,
            tree,
        })
    }

    /// Depth at which a triangle is met, infinite if it is not.
    #[inline(always)]
    fn depth(&self, ray: &TheirRay, near: f32, place: usize) -> f32 {
        let (triangle, two_sided, _) = &self.triangles[place];
        let [u, v] = [triangle.v1 - triangle.v0, triangle.v2 - triangle.v0];
        let is_behind = u.cross(v).dot(ray.direction) >= 0.0;
        let depth = triangle.intersect(ray);
        match depth >= near && (*two_sided || !is_behind) {
            true => depth,
            false => f32::INFINITY,
        }
    }
}

impl Pick for ObvhsTriangles {
    fn first(&self, ray: &Ray) -> Option<Hit> {
        let rounded = RoundedRay::of(ray, self.zero);
        let mut found = RayHit::none();
        let entry = |ray: &TheirRay, place: usize| self.depth(ray, rounded.near, place);
        self.tree
            .ray_traverse(obvhs::their_ray(&rounded), &mut found, entry);
        let (_, _, item) = *self.triangles.get(found.primitive_id as usize)?;
        let depth = f64::from(found.t);
        ((item as usize) < self.items).then_some(Hit { item, depth })
    }

    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        let rounded = RoundedRay::of(ray, self.zero);
        hits.clear();
        let visit = |ray: &TheirRay, place: usize| {
            let depth = self.depth(ray, rounded.near, place);
            let item = self.triangles[place].2;
            if depth <= rounded.far && (item as usize) < self.items {
                let depth = f64::from(depth);
                hits.push(Hit { item, depth });
            }
        };
        self.tree
            .ray_traverse_anyhit(obvhs::their_ray(&rounded), visit);
        // Of each item where it is met first.
        hits.sort_unstable_by(|a, b| a.item.cmp(&b.item).then(Hit::order(a, b)));
        hits.dedup_by_key(|hit| hit.item);
        keep_nearest(hits, count);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::Linear;
    use super::*;
    use crate::scene::{Sample, SeededRng, load};
    use crate::visibility::Solids;
    use crate::visibility::region::doom::DoomMap;

    fn ray(origin: DVec3, direction: DVec3) -> Ray {
        Ray {
            origin,
            direction,
            near: 0.5,
            far: 1e4,
        }
    }

    fn items(hits: &[Hit]) -> Vec<ItemId> {
        hits.iter().map(|hit| hit.item).collect()
    }

    #[test]
    fn boxes_as_triangles_are_picked_as_boxes_are() {
        let scene = load("city:n=300", &Default::default()).unwrap();
        let reference = Linear::of(&Solids::of(&scene));
        let surfaces = Surfaces::from_boxes(&scene);
        let bounds = scene.bounds;
        let (min, max) = bounds.in_world(scene.origin);
        let built = SURFACE_BACK_ENDS.iter().map(|row| {
            let pick = (row.build)(&surfaces, scene.items.len()).unwrap();
            (row, pick)
        });
        let built: Vec<_> = built.collect();
        let mut rng = SeededRng::new(11);
        let (mut met, mut differ) = (0, 0);
        let mut hits = Vec::new();
        for _ in 0..3000 {
            let origin = min + (max - min) * rng.point();
            let direction = DVec3::new(rng.normal(), rng.normal(), rng.normal() * 0.2);
            let ray = ray(origin, direction);
            let first = reference.first(&ray).map(|hit| hit.item);
            reference.nearest(&ray, 4, &mut hits);
            let nearest = items(&hits);
            met += usize::from(first.is_some());
            for (row, pick) in &built {
                pick.nearest(&ray, 4, &mut hits);
                let same = pick.first(&ray).map(|hit| hit.item) == first && items(&hits) == nearest;
                match row.guarantee {
                    Guarantee::Exact => assert!(same, "{}: {ray:?}", row.name),
                    _ => differ += usize::from(!same),
                }
            }
        }
        assert!(met > 400 && differ < 30, "{met} {differ}");
    }

    #[test]
    fn floors_and_ceilings_end_the_search_for_the_first_item_only() {
        let sample = Sample::named("freedm-map12").unwrap();
        let map = Arc::new(DoomMap::read(sample.bytes, sample.file, None).unwrap());
        let scene = load("freedm-map12", &Default::default()).unwrap();
        let surfaces = map.surfaces(&scene);
        let count = scene.items.len();
        let [every, tree, crates] = [0, 1, 2].map(|row: usize| {
            let build = SURFACE_BACK_ENDS[row].build;
            build(&surfaces, count).unwrap()
        });
        let mut rng = SeededRng::new(5);
        let (mut hidden, mut differ) = (0, 0);
        let [mut own, mut other] = [Vec::new(), Vec::new()];
        for _ in 0..600 {
            let eye = scene.places[rng.below(scene.places.len())].eye;
            let direction = DVec3::new(rng.normal(), rng.normal(), rng.normal() * 0.5);
            let ray = ray(eye, direction);
            let first = every.first(&ray);
            every.nearest(&ray, 8, &mut own);
            assert_eq!(
                tree.first(&ray).map(|hit| hit.item),
                first.map(|hit| hit.item)
            );
            tree.nearest(&ray, 8, &mut other);
            assert_eq!(items(&own), items(&other));
            assert!(own.iter().all(|hit| (hit.item as usize) < count));
            hidden += usize::from(first.is_none() && !own.is_empty());
            differ +=
                usize::from(crates.first(&ray).map(|hit| hit.item) != first.map(|hit| hit.item));
        }
        assert!(hidden > 0 && differ < 60, "{hidden} {differ}");
    }
}
