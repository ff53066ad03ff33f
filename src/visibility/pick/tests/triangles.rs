//! Back ends over triangles.

use glam::{DVec3, Vec3};

use super::*;
use crate::geometry::Aabb;
use crate::scene::Surfaces;
use crate::visibility::region::doom::DoomMap;
use crate::visibility::truth::{Facet, Facets, SurfaceIndex};

fn ray(origin: DVec3, direction: DVec3) -> Ray {
    Ray {
        origin,
        direction,
        near: 0.5,
        far: 1e4,
    }
}

/// Every back end over triangles.
fn triangle_back_ends(facets: &Facets) -> Vec<(&'static str, Box<dyn Pick>)> {
    let rows = Facets::BACK_ENDS.iter();
    let built = rows.map(|row| (row.name, (row.build)(facets, Kernel::best())));
    built.collect()
}

#[test]
fn boxes_as_triangles_are_picked_as_boxes_are() {
    let scene = load("city:n=300", &Default::default()).unwrap();
    let reference = LinearScan(Boxes::of(&Solids::of(&scene)));
    let facets = Facets::solid(&Surfaces::from_boxes(&scene), scene.items.len());
    let bounds = scene.bounds;
    let (min, max) = bounds.in_world(scene.origin);
    let built = triangle_back_ends(&facets);
    assert!(built.len() >= 2);
    let mut rng = SeededRng::new(11);
    let mut met = 0;
    for _ in 0..3000 {
        let origin = min + (max - min) * rng.point();
        let direction = DVec3::new(rng.normal(), rng.normal(), rng.normal() * 0.2);
        let ray = ray(origin, direction);
        let first = reference.first(&ray);
        met += usize::from(first.is_some());
        for (name, pick) in &built {
            assert_eq!(pick.first(&ray), first, "{name}: {ray:?}");
        }
    }
    assert!(met > 400, "{met}");
}

#[test]
fn floors_and_ceilings_end_the_search_for_the_first_item_only() {
    let scene = load("freedm-map12", &Default::default()).unwrap();
    let map = DoomMap::of_scene(&scene).unwrap();
    let surfaces = map.surfaces(&scene);
    let count = scene.items.len();
    let truth = SurfaceIndex::of(&Facets::solid(&surfaces, count), Kernel::best());
    let built = triangle_back_ends(&Facets::solid(&surfaces, count));
    let mut rng = SeededRng::new(5);
    let mut hidden = 0;
    for _ in 0..600 {
        let eye = scene.places[rng.below(scene.places.len())].eye;
        let direction = DVec3::new(rng.normal(), rng.normal(), rng.normal() * 0.5);
        let ray = ray(eye, direction);
        let (first, met) = (truth.first(&ray), truth.met(&ray));
        assert!(met.iter().all(|&item| (item as usize) < count));
        hidden += usize::from(first.is_none() && !met.is_empty());
        for (name, pick) in &built {
            assert_eq!(pick.first(&ray), first, "{name}: {ray:?}");
        }
    }
    assert!(hidden > 0, "{hidden}");
}

fn grid(rng: &mut SeededRng, most: usize) -> Vec3 {
    let mut along = || rng.below(most) as f32 - (most / 2) as f32;
    Vec3::new(along(), along(), along())
}

/// Corners on a grid: equal depths, rays in planes, triangles without area.
///
/// Directions hardly move along an axis, and origins lie outside the error analysis.
#[test]
fn every_instruction_set_finds_what_testing_all_finds() {
    let mut rng = SeededRng::new(17);
    let sizes = [0.0, 1e-30, -6e-17, 0.25, -1.0, 1.0, 3000.0];
    let mut met = 0;
    for n in [0, 1, 15, 300] {
        let mut facet = |i: usize| {
            let at = grid(&mut rng, 12);
            Facet {
                corners: [at, at + grid(&mut rng, 5), at + grid(&mut rng, 5)],
                item: (i / 2) as ItemId,
                two_sided: i % 3 != 1,
                hides: true,
            }
        };
        let all: Vec<Facet> = (0..n).map(&mut facet).collect();
        let facets = Facets {
            bounds: all.iter().map(|of| Aabb::of_points(of.corners)).collect(),
            all,
            origin: DVec3::new(3.0, -7.0, 0.5),
            // The last few triangles belong to no item.
            items: n * 2 / 5,
        };
        let wide = Kernel::available().map(|kernel| (kernel, WideRay::of(&facets, kernel)));
        let wide: Vec<_> = wide.collect();
        let linear = LinearScan(facets.clone());
        for _ in 0..1200 {
            let mut ray = Ray {
                origin: facets.origin + grid(&mut rng, 20).as_dvec3() * 0.5,
                direction: grid(&mut rng, 7).as_dvec3(),
                near: 0.25,
                far: 40.0,
            };
            if rng.below(4) == 0 {
                ray.direction = DVec3::from([(); 3].map(|()| sizes[rng.below(sizes.len())]));
                ray.origin *= [1.0, -1e12][rng.below(2)];
            }
            let first = linear.first(&ray);
            met += usize::from(first.is_some());
            for (kernel, wide) in &wide {
                assert_eq!(wide.first(&ray), first, "{kernel} {ray:?}");
            }
        }
    }
    assert!(met > 300, "the premise: {met}");
}
