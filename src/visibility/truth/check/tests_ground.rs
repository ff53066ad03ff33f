//! Proofs by boxes below the ground of a terrain, and every way to doctor them.

use glam::DVec3;

use super::*;
use crate::camera::{Camera, Lens, look_at};
use crate::scene::{Mesh, Scene, Surfaces};
use crate::visibility::hiders;
use crate::visibility::truth::{Ends, Prover, RayIndex, SampleTruth, SurfaceIndex, View, certify};
use crate::visibility::{Rays, SampleGrid, Solids};

fn terrain() -> Scene {
    let surfaces = (Mesh::named("mesh:terrain").unwrap().build)(60_000, 3);
    surfaces.into_scene("terrain").unwrap()
}

/// A little above the corner of the first tile, across the terrain.
fn camera(scene: &Scene, parallel: bool) -> Camera {
    let bounds = scene.world_bounds();
    let first = scene.surfaces.as_ref().unwrap().points[0].as_dvec3() + scene.origin;
    let eye = DVec3::new(first.x + 3.0, first.y + 3.0, first.z + 4.0);
    let middle = (bounds.min + bounds.max) / 2.0;
    let frame = look_at(eye, DVec3::new(middle.x, middle.y, eye.z), DVec3::Z).unwrap();
    let lens = match parallel {
        true => Lens::orthographic(1.0, 1.5, 0.1, 500.0),
        false => Lens::perspective(60.0, 1.5, 0.1, None),
    };
    Camera {
        frame,
        lens: lens.unwrap(),
    }
}

/// What is proven in a view of it by the boxes below the ground alone.
fn certified(scene: &Scene, camera: &Camera) -> Certificates {
    let surfaces = scene.surfaces.as_ref().unwrap();
    let ground = hiders::Ground::of(scene).unwrap();
    let rays = Rays::of(camera).unwrap();
    assert!(ground.is_below(&rays));
    let mut solids = Solids::of(scene);
    let items = solids.boxes.len() as ItemId;
    let below = ground
        .boxes
        .iter()
        .map(|b| WorldBox::within(b, scene.origin));
    let hide = below.map(|b| {
        solids.push(&b);
        (None, [b.min.to_array(), b.max.to_array()])
    });
    let hide = Hiders::Within(hide.collect());
    let numbers: Vec<ItemId> = (items..solids.boxes.len() as ItemId).collect();
    let index = RayIndex::build_of(&solids, &numbers);
    let prover = Prover::hidden_by(hide, &solids, &index, &rays);
    let ends = SurfaceIndex::build(surfaces);
    let truth = SampleTruth::of_surfaces(&ends, &rays, SampleGrid::new(48, 32), 1);
    let all: Vec<ItemId> = (0..items).collect();
    let ends = Ends::Triangles(&ends);
    certify("terrain", &prover, ends, &rays, &truth, &all, 1)
}

fn verify(
    certificates: &Certificates,
    scene: &Scene,
    surfaces: &Surfaces,
) -> Result<Counts, &'static str> {
    let boxes: Vec<WorldBox> = scene.written().collect();
    let facts = Facts::of_surfaces(&boxes, surfaces);
    check(certificates, &facts).map_err(|rejected| rejected.reason)
}

fn below(certificates: &mut Certificates) -> &mut [[f64; 3]; 2] {
    match &mut certificates.hiders {
        Hiders::Within(boxes) => &mut boxes[0].1,
        other => panic!("{other:?}"),
    }
}

#[test]
fn what_is_behind_hills_is_proven_hidden() {
    let scene = terrain();
    let surfaces = scene.surfaces.as_deref().unwrap();
    let certificates = certified(&scene, &camera(&scene, false));
    let counts = verify(&certificates, &scene, surfaces).unwrap();
    assert!(counts.hidden > 5 && counts.visible > 5, "{counts:?}");
    // From above, along parallel lines.
    let bounds = scene.world_bounds();
    let middle = (bounds.min + bounds.max) / 2.0;
    let eye = DVec3::new(middle.x - 60.0, middle.y, bounds.max.z + 20.0);
    let slanted = Camera {
        frame: look_at(eye, middle, DVec3::Z).unwrap(),
        lens: Lens::orthographic(30.0, 1.5, 0.1, 500.0).unwrap(),
    };
    let parallel = certified(&scene, &slanted);
    let counts = verify(&parallel, &scene, surfaces).unwrap();
    assert!(counts.visible > 5, "{counts:?}");
    // With the boxes first in the file, an item's behind them.
    let mut with_item = certificates.clone();
    if let Hiders::Within(boxes) = &mut with_item.hiders {
        let last = scene.items.len() as ItemId - 1;
        boxes.push((Some(last), boxes[0].1));
    }
    let open = Err("a box is not inside the triangles of its item");
    assert_eq!(verify(&with_item, &scene, surfaces), open);
}

#[test]
fn a_box_that_is_not_below_the_ground_is_rejected() {
    let scene = terrain();
    let surfaces = scene.surfaces.as_deref().unwrap();
    let certificates = certified(&scene, &camera(&scene, false));
    let with = |change: &dyn Fn(&mut Certificates)| {
        let mut changed = certificates.clone();
        change(&mut changed);
        verify(&changed, &scene, surfaces)
    };
    let above = Err("a box is not below the ground");
    assert_eq!(with(&|c| below(c)[1][2] += 20.0), above);
    assert_eq!(
        with(&|c| below(c)[0][0] = scene.world_bounds().min.x - 1.0),
        above
    );
    assert_eq!(
        with(&|c| below(c)[1][1] = scene.world_bounds().max.y + 1.0),
        above
    );
    assert_eq!(with(&|c| below(c)[0][2] = f64::NAN), above);
    let not_above = Err("the view does not begin above the ground");
    assert_eq!(with(&|c| c.view.eye[2] -= 20.0), not_above);
    assert_eq!(with(&|c| c.view.eye[0] -= 50.0), not_above);
    assert_eq!(with(&|c| c.view.hides_from = 60.0), not_above);
    let many = |c: &mut Certificates| match &mut c.hiders {
        Hiders::Within(boxes) => boxes.extend(vec![boxes[0]; 1024]),
        other => panic!("{other:?}"),
    };
    let disorder =
        Err("boxes are not by ascending item, those below the ground first, or too many of one");
    assert_eq!(with(&many), disorder);
}

#[test]
fn ground_with_a_hole_hides_nothing() {
    let scene = terrain();
    let surfaces = scene.surfaces.as_deref().unwrap();
    let certificates = certified(&scene, &camera(&scene, false));
    let with = |change: &dyn Fn(&mut Surfaces)| {
        let mut changed = surfaces.clone();
        change(&mut changed);
        verify(&certificates, &scene, &changed)
    };
    let none = Err("the scene has no ground");
    let middle = surfaces.triangles.len() / 2;
    let turned = |all: &mut Surfaces| all.triangles[middle].swap(0, 1);
    assert_eq!(with(&turned), none, "a tile that is no ground any more");
    let twice = |all: &mut Surfaces| all.triangles[middle] = all.triangles[middle + 2];
    assert_eq!(with(&twice), none, "a hole, and two layers");
    let corner = surfaces.of_item[surfaces.items() / 2].start as usize;
    let corner = surfaces.triangles[corner][0] as usize;
    let cracked = |all: &mut Surfaces| all.points[corner].z += 0.001;
    assert_eq!(with(&cracked), none, "a step between two tiles");
    let clear = |all: &mut Surfaces| all.kinds[7] = crate::scene::SurfaceKind::Clear;
    assert_eq!(with(&clear), none);
}

#[test]
fn the_view_is_the_same_to_both() {
    // What the search takes for a view above the ground, the second opinion does too.
    let scene = terrain();
    let surfaces = scene.surfaces.as_deref().unwrap();
    let found = hiders::Ground::of(&scene).unwrap();
    let own = ground::Ground::of(surfaces, scene.items.len()).unwrap();
    let mut counts = [0; 2];
    for step in 0..60 {
        for parallel in [false, true] {
            let mut camera = camera(&scene, parallel);
            camera.frame.eye.z += f64::from(step) * 0.25 - 8.0;
            let rays = Rays::of(&camera).unwrap();
            let is_below = found.is_below(&rays);
            counts[usize::from(is_below)] += 1;
            assert!(
                !is_below || own.is_below(&View::of(&rays)),
                "{step} {parallel}"
            );
            let deep = camera.frame.eye.z < scene.world_bounds().min.z;
            assert!(!deep || !own.is_below(&View::of(&rays)));
        }
    }
    assert!(counts.iter().all(|&count| count > 10), "{counts:?}");
}
