//! Items of meshes behind boxes inside other items.
//!
//! No item that a ray meets first may be missing.

use glam::DVec3;

use super::super::{MaskedInner, OccluderTree};
use super::by_rays::{Ready, missing, point_between, with_view};
use super::kept;
use crate::camera::{Camera, Frame, Lens};
use crate::kernel::Kernel;
use crate::scene::{Scene, SeededRng, Surfaces, WorldBox, load};
use crate::visibility::inner_boxes::inner_boxes;
use crate::visibility::occluders::SceneOccluders;
use crate::visibility::truth::{SurfaceIndex, visible_by_random_rays};
use crate::visibility::{Rays, SampleGrid, Solids};

/// A camera at a random point of the scene's bounds or of an item's box.
fn camera(scene: &Scene, rng: &mut SeededRng, parallel: bool) -> Camera {
    let b = match rng.below(2) {
        0 => scene.bounds,
        _ => scene.items[rng.below(scene.items.len())],
    };
    let (min, max) = b.in_world(scene.origin);
    let eye = point_between(min, max, rng);
    let forward = DVec3::new(rng.normal(), rng.normal(), rng.normal() * 0.2);
    let frame = Frame::looking_along(eye, forward, DVec3::Z).unwrap();
    let near = [0.01, 0.3, 2.0][rng.below(3)];
    let lens = match parallel {
        true => Lens::orthographic(20.0, 1.6, near, 300.0),
        false => Lens::perspective(rng.between(30.0, 90.0), 1.6, near, None),
    };
    Camera {
        frame,
        lens: lens.unwrap(),
    }
}

#[test]
fn boxes_inside_meshes_hide_nothing_that_is_visible() {
    let load = |name: &str| load(name, &Default::default()).unwrap();
    let buildings = Surfaces::from_boxes(&load("city:n=300,offset=1e6"));
    for (scene, least) in [
        (load("mesh:spheres:n=150k"), 50),
        (load("mesh:forest:n=20k"), 50),
        (buildings.into_scene("buildings").unwrap(), 1000),
    ] {
        let name = scene.name.clone();
        let mesh = scene.surfaces.clone().unwrap();
        let inner = inner_boxes(&mesh, 12, 4, 1).0;
        let ready = Ready {
            solids: Solids::of(&scene),
            occluders: OccluderTree::with_inner_boxes(&scene, &inner, &[]),
            scene,
        };
        let index = SurfaceIndex::build(&mesh);
        let (mut removed, mut rng) = (0, SeededRng::new(9));
        for number in 0..240 {
            let camera = camera(&ready.scene, &mut rng, number % 5 == 0);
            with_view(&ready, &camera, SampleGrid::new(96, 60), |view, rays| {
                let in_view = ready.in_view(view.volume);
                let seen = visible_by_random_rays(&index, rays, 1500, number, 1);
                assert!(missing(&seen, &in_view).is_empty());
                for kept in kept::<MaskedInner>(&ready, view, Kernel::best()) {
                    let lost = missing(&seen, &kept);
                    assert!(lost.is_empty(), "{name} {number}: {lost:?}, {camera:?}");
                    removed += in_view.len() - kept.len();
                }
            });
        }
        assert!(removed > least, "{name}: {removed}");
    }
}

#[test]
fn boxes_below_the_ground_hide_nothing_that_is_visible() {
    for name in ["mesh:terrain:n=20k", "mesh:forest:n=20k"] {
        let scene = load(name, &Default::default()).unwrap();
        let occluders = SceneOccluders::of(&scene, None, 2, 1);
        assert!(occluders.ground.as_ref().unwrap().row.box_count > 20);
        let index = SurfaceIndex::build(scene.surfaces.as_ref().unwrap());
        let [open, bare] = [true, false].map(|is_open| Ready {
            solids: Solids::of(&scene),
            occluders: occluders.from_eye(is_open).clone(),
            scene: scene.clone(),
        });
        let (mut removed, mut eyes, mut rng) = (0, [0, 0], SeededRng::new(5));
        for number in 0..600 {
            let camera = camera(&scene, &mut rng, number % 5 == 0);
            let rays = Rays::of(&camera).unwrap();
            let is_open = occluders.is_open(&rays, || true);
            eyes[usize::from(is_open)] += 1;
            let ready = if is_open { &open } else { &bare };
            with_view(ready, &camera, SampleGrid::new(96, 60), |view, rays| {
                let in_view = ready.in_view(view.volume);
                let seen = visible_by_random_rays(&index, rays, 1500, number, 1);
                for kept in kept::<MaskedInner>(ready, view, Kernel::best()) {
                    let lost = missing(&seen, &kept);
                    assert!(lost.is_empty(), "{name} {number}: {lost:?}, {camera:?}");
                    removed += in_view.len() - kept.len();
                }
            });
        }
        assert!(eyes.iter().all(|&count| count > 60), "{eyes:?}");
        assert!(removed > 80, "{name}: {removed}");
    }
}

#[test]
fn only_what_hides_goes_on_beyond_the_bounds_of_the_scene() {
    let unit =
        |x: f64, z: f64| WorldBox::new(DVec3::new(x, 0.0, z), DVec3::new(x + 1.0, 1.0, z + 1.0));
    let scene =
        Scene::from_boxes("three", &[unit(0.0, 0.0), unit(2.0, 0.0), unit(4.0, 1.0)]).unwrap();
    let mut inner: Vec<_> = (0..).zip(scene.items.iter().copied()).collect();
    let faces = |occluders: &OccluderTree, item| {
        let mut positions = 0..occluders.len();
        let position = positions.find(|&at| occluders.item(at) == Some(item));
        let [occluder] = occluders.occluders(position.expect("an item")) else {
            panic!("one each");
        };
        occluder.faces
    };
    let whole = OccluderTree::with_inner_boxes(&scene, &inner, &[]);
    let solid = OccluderTree::of(&Solids::of(&scene));
    for item in 0..3 {
        assert_eq!(faces(&whole, item), faces(&solid, item));
    }
    // The lower z of the first box is no longer at the floor.
    inner[0].1.min.z += 0.25;
    let less = OccluderTree::with_inner_boxes(&scene, &inner, &[]);
    assert_eq!(faces(&less, 0), faces(&solid, 0) & !(1 << 2));
    assert_eq!(faces(&less, 1), faces(&solid, 1));
    assert_ne!(faces(&solid, 0) & 1 << 2, 0);
}
