//! Every back end of picking returns the answer of a plain loop.

use cullbench::kernel::Kernel;
use cullbench::scene::{self, Scene, SeededRng, WorldBox};
use cullbench::visibility::pick::{LinearScan, Pick};
use cullbench::visibility::truth::{Boxes, Facets};
use cullbench::visibility::{Ray, Solids};
use glam::DVec3;

#[test]
fn back_ends_pick_what_the_reference_picks() {
    let mut rng = SeededRng::new(5);
    let mut random = |_| WorldBox::around(rng.point() * 100.0, rng.point() * 8.0);
    let boxes = (0..300).map(&mut random).collect::<Vec<_>>();
    let solids = Solids::of(&Scene::from_boxes("random", &boxes).unwrap());
    let boxes = Boxes::of(&solids);
    let reference = LinearScan(boxes.clone());
    for row in Boxes::BACK_ENDS {
        let back_end = (row.build)(&boxes, Kernel::best());
        let mut met = 0;
        for _ in 0..300 {
            let ray = Ray {
                origin: rng.point() * 20.0,
                direction: DVec3::splat(50.0) - rng.point() * 20.0,
                near: 0.5,
                far: 200.0,
            };
            let (found, wanted) = (back_end.first(&ray), reference.first(&ray));
            assert_eq!(found, wanted, "{} {ray:?}", row.name);
            met += usize::from(wanted.is_some());
        }
        assert!(met > 100, "the premise: {met}");
    }
}

/// The same of triangles: of spheres, which no ray of these meets on an edge.
#[test]
fn back_ends_pick_the_triangles_that_the_reference_picks() {
    let scene = scene::load("mesh:spheres:n=26000", &Default::default()).unwrap();
    let surfaces = scene.surfaces.as_ref().expect("a mesh has triangles");
    let facets = Facets::solid(surfaces, scene.items.len());
    let bounds = scene.world_bounds();
    let rows = Facets::BACK_ENDS.iter();
    let built = rows.map(|row| (row, (row.build)(&facets, Kernel::best())));
    let built: Vec<_> = built.collect();
    let (_, reference) = &built[0];
    assert_eq!(built[0].0.name, "linear");
    let mut rng = SeededRng::new(6);
    let mut met = 0;
    for _ in 0..300 {
        let target = &scene.items[rng.below(scene.items.len())];
        let target = scene.origin + target.centre().as_dvec3() + rng.normal3();
        let origin = bounds.min + (bounds.max - bounds.min) * rng.point();
        let ray = Ray {
            origin,
            direction: (target - origin).normalize() * 2.0,
            near: 0.5,
            far: 500.0,
        };
        let wanted = reference.first(&ray);
        met += usize::from(wanted.is_some());
        for (row, back_end) in &built {
            let found = back_end.first(&ray);
            assert_eq!(found, wanted, "{} {ray:?}", row.name);
        }
    }
    assert!(met > 50, "the premise: {met}");
}
