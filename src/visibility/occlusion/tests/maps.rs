//! Items of Doom maps behind occluder boxes in their solid space.
//!
//! No item that a ray meets first may be missing.

use glam::DVec3;

use super::super::{MaskedInner, OccluderTree};
use super::by_rays::{Ready, missing, with_view};
use super::kept;
use crate::camera::{Camera, Frame, Lens};
use crate::geometry::Aabb;
use crate::kernel::Kernel;
use crate::scene::{SeededRng, WorldBox, load};
use crate::visibility::region::doom::DoomMap;
use crate::visibility::truth::{SurfaceIndex, visible_by_random_rays};
use crate::visibility::{SampleGrid, Solids};

/// Counts the items of a map that were removed, and those of them that are visible.
///
/// `change` is applied to each occluder box first.
fn removed_and_lost(name: &str, change: impl Fn(&mut WorldBox)) -> [usize; 2] {
    let scene = load(name, &Default::default()).unwrap();
    let map = DoomMap::of_scene(&scene).unwrap();
    let graph = map.graph().unwrap();
    let mut blocks = map.solid_boxes([-512.0, 1024.0]);
    blocks.iter_mut().for_each(change);
    let about = |corner: DVec3| (corner - scene.origin).as_vec3();
    let blocks = blocks.iter().map(|b| Aabb::new(about(b.min), about(b.max)));
    let blocks: Vec<Aabb> = blocks.collect();
    let ready = Ready {
        solids: Solids::of(&scene),
        occluders: OccluderTree::with_inner_boxes(&scene, &[], &blocks),
        scene,
    };
    let index = SurfaceIndex::build(&map.surfaces(&ready.scene));
    let (mut removed, mut lost, mut rng) = (0, 0, SeededRng::new(4));
    let own = ready.scene.items.len() as u32;
    for number in 0..120 {
        let place = ready.scene.places[rng.below(ready.scene.places.len())].eye;
        let beside = DVec3::new(rng.normal(), rng.normal(), rng.normal() * 0.1) * 100.0;
        let forward = DVec3::new(rng.normal(), rng.normal(), rng.normal() * 0.3);
        let near = [0.1, 1.0, 8.0][rng.below(3)];
        let lens = Lens::perspective(rng.between(30.0, 100.0), 1.6, near, None);
        let camera = Camera {
            frame: Frame::looking_along(place + beside, forward, DVec3::Z).unwrap(),
            lens: lens.unwrap(),
        };
        with_view(&ready, &camera, SampleGrid::new(160, 100), |view, rays| {
            if !graph.homes(rays, &mut Vec::new()) {
                return;
            }
            let in_view = ready.in_view(view.volume);
            let mut seen = visible_by_random_rays(&index, rays, 4000, number, 1);
            seen.retain(|&item| item < own);
            assert!(missing(&seen, &in_view).is_empty());
            for kept in kept::<MaskedInner>(&ready, view, Kernel::best()) {
                lost += missing(&seen, &kept).len();
                removed += in_view.len() - kept.len();
            }
        });
    }
    [removed, lost]
}

#[test]
fn boxes_in_the_solid_of_a_map_hide_nothing_that_is_visible() {
    for name in ["freedm-map12", "freedm-map20"] {
        let [removed, lost] = removed_and_lost(name, |_| {});
        assert_eq!(lost, 0, "{name}");
        assert!(removed > 1000, "{name}: {removed}");
    }
}

#[test]
fn boxes_that_reach_into_the_rooms_lose_items() {
    let larger = |b: &mut WorldBox| {
        b.min -= 24.0;
        b.max += 24.0;
    };
    let [_, lost] = removed_and_lost("freedm-map12", larger);
    assert!(lost > 0);
}
