//! Items of regions compared with the items that rays meet.

use super::super::*;
use super::worlds::*;
use crate::camera::{Camera, Frame, Lens};
use crate::scene::SeededRng;
use crate::visibility::{Rays, Solids};

/// Number of first hits of rays that are not among the items of the listed regions.
///
/// Eyes are anywhere, also in walls; the near plane is sometimes behind a wall.
fn lost_hits(world: &str, graph_of: fn(&crate::scene::Scene) -> RegionGraph) -> usize {
    let (scene, _) = rooms(world);
    let graph = graph_of(&scene);
    let solids = Solids::of(&scene);
    let items = RegionItems::of(&graph, &scene);
    let mut rng = SeededRng::new(21);
    let (mut scratch, mut regions) = (Scratch::default(), Vec::new());
    let (mut marks, mut list) = (IdSet::default(), Vec::new());
    let mut lost = 0;
    for _ in 0..250 {
        let b = graph.parts[rng.below(graph.len())][0];
        let eye = b.min + (b.max - b.min) * rng.point();
        let frame = Frame::looking_along(eye, rng.normal3(), rng.normal3()).unwrap();
        let near = [0.01, 0.1, 0.5][rng.below(3)];
        let lens = Lens::perspective(70.0, 1.5, near, None).unwrap();
        let rays = Rays::of(&Camera { frame, lens }).unwrap();
        let hits: Vec<u32> = (0..30)
            .filter_map(|_| first_hit(&solids.boxes, &rays.through(rng.unit(), rng.unit())))
            .collect();
        graph.seen_by(&rays, None, &mut scratch, &mut regions);
        items.of_regions(&regions, &mut marks, &mut list);
        lost += hits
            .iter()
            .filter(|h| list.binary_search(h).is_err())
            .count();
    }
    lost
}

#[test]
fn the_first_solid_on_a_ray_is_an_item_of_a_listed_room() {
    for world in ["rooms:n=1500,seed=1", "rooms:n=900,seed=2,storeys=5"] {
        let lost = lost_hits(world, |scene| RegionGraph::of_scene(scene).unwrap());
        assert_eq!(lost, 0, "{world}");
    }
}

#[test]
fn who_forgets_that_an_eye_can_be_in_a_wall_is_caught() {
    let lost = lost_hits("rooms:n=1500,seed=1", |scene| match &scene.regions {
        crate::scene::Regions::Tiling(tiling) => RegionGraph::of_tiling(tiling, scene.origin),
        _ => unreachable!("rooms are a tiling"),
    });
    assert!(lost > 0);
}

#[test]
fn items_of_regions_are_those_that_meet_them() {
    let (scene, graph) = rooms("rooms:n=900,seed=2,storeys=5");
    let items = RegionItems::of(&graph, &scene);
    let (mut marks, mut list) = (IdSet::default(), Vec::new());
    for region in 0..graph.len() as u32 {
        let room = graph.parts[region as usize][0];
        let meets = |b: &crate::geometry::Aabb| {
            let (min, max) = b.in_world(scene.origin);
            min.cmple(room.max).all() && room.min.cmple(max).all()
        };
        let wanted = (0..).zip(&scene.items).filter(|(_, b)| meets(b));
        let wanted: Vec<u32> = wanted.map(|(id, _)| id).collect();
        items.of_regions(&[region], &mut marks, &mut list);
        assert_eq!(list, wanted);
    }
    let all: Vec<u32> = (0..graph.len() as u32).collect();
    items.of_regions(&all, &mut marks, &mut list);
    assert_eq!(list.len(), scene.items.len());
}
