//! A map as surfaces compared with the same map as sectors.
//!
//! Two independent computations of visibility, which share only the lumps.

use std::sync::Arc;

use super::super::doom::DoomMap;
use super::super::*;
use super::follow;
use super::worlds::*;
use crate::query::ItemId;
use crate::scene::{Scene, SeededRng, SurfaceKind, Surfaces};
use crate::visibility::SampleGrid;
use crate::visibility::truth::{SampleTruth, SurfaceIndex};

const MAPS: [&str; 2] = ["freedm-map12", "freedm-map20"];

struct World {
    scene: Scene,
    map: Arc<DoomMap>,
    graph: RegionGraph,
    surfaces: Surfaces,
}

fn world(name: &str) -> World {
    let scene = crate::scene::load(name, &Default::default()).unwrap();
    let map = DoomMap::of_scene(&scene).unwrap();
    World {
        graph: map.graph().unwrap(),
        surfaces: map.surfaces(&scene),
        scene,
        map,
    }
}

/// Number of visible items, and of those missing in the search's answer.
fn visible_and_lost(world: &World, graph: &RegionGraph, eyes: usize) -> (usize, usize) {
    let index = SurfaceIndex::build(&world.surfaces);
    let items = RegionItems::of(graph, &world.scene);
    let mut rng = SeededRng::new(12);
    let (mut scratch, mut regions) = (Scratch::default(), Vec::new());
    let (mut marks, mut list) = (IdSet::default(), Vec::new());
    let (mut visible, mut lost) = (0, 0);
    for place in world.scene.places.iter().cycle().take(eyes) {
        let rays = looking(place.eye, &mut rng);
        let truth = SampleTruth::of(&index, &rays, SampleGrid::new(64, 36), 2);
        let own = (world.scene.items.len()) as ItemId;
        let seen: Vec<ItemId> = truth.visible.into_iter().filter(|&id| id < own).collect();
        visible += seen.len();
        graph.seen_by(&rays, None, &mut scratch, &mut regions);
        items.of_regions(&regions, &mut marks, &mut list);
        let missing = seen.iter().filter(|id| list.binary_search(id).is_err());
        lost += missing.count();
    }
    (visible, lost)
}

#[test]
fn items_have_the_numbers_of_the_scene_and_lie_in_their_boxes() {
    for name in MAPS {
        let world = world(name);
        let (scene, surfaces) = (&world.scene, &world.surfaces);
        assert_eq!(surfaces.items(), scene.items.len() + world.graph.len());
        assert!(world.map.unclosed().is_empty(), "{name}");
        let kinds = &scene.labels[0];
        let mut whole = 0;
        for (item, b) in scene.items.iter().enumerate() {
            if kinds.get(item) != "linedef" {
                assert_eq!(surfaces.bounds(item), *b);
                assert_eq!(
                    surfaces.kinds[surfaces.range(item).start],
                    SurfaceKind::CutOut
                );
            } else if !surfaces.of_item[item].is_empty() {
                let bounds = surfaces.bounds(item);
                assert!(bounds.min.cmpge(b.min).all() && bounds.max.cmple(b.max).all());
                whole += usize::from(bounds == *b);
            }
        }
        // At least the one-sided walls, from floor to ceiling.
        println!("{name}: {whole} of {} items", scene.items.len());
        assert!(whole > scene.items.len() / 3, "{whole}");
    }
}

#[test]
fn what_is_visible_lies_in_sectors_that_are_listed() {
    for name in MAPS {
        let world = world(name);
        let (visible, lost) = visible_and_lost(&world, &world.graph, 40);
        println!("{name}: {visible} visible");
        assert_eq!(lost, 0, "{name}");
        assert!(visible > 500, "{visible}");
    }
}

#[test]
fn a_graph_that_lacks_openings_is_caught() {
    let world = world("freedm-map12");
    let openings = world.graph.openings.len();
    let caught = |opening: &usize| {
        let graph = without_opening(&world.graph, *opening);
        let (_, lost) = visible_and_lost(&world, &graph, 12);
        lost > 0
    };
    let caught = (0..openings).step_by(16).filter(caught).count();
    println!("{caught} of {}", openings.div_ceil(16));
    assert!(caught > 0);
}

/// A ray ends at a surface of the last sector that it passes.
///
/// It ends there neither earlier nor later. Rays through a corner of the map, up to rounding, might
/// fail; there is none among these.
#[test]
fn rays_end_where_rays_through_sectors_end() {
    for name in MAPS {
        let world = world(name);
        let index = SurfaceIndex::build(&world.surfaces);
        let own = world.scene.items.len() as ItemId;
        let items = RegionItems::of(&world.graph, &world.scene);
        let mut rng = SeededRng::new(13);
        let (mut whole, mut part) = (IdSet::default(), IdSet::default());
        let (mut ended, mut escaped) = (0, 0);
        for place in world.scene.places.iter().take(40) {
            let rays = looking(place.eye, &mut rng);
            for _ in 0..100 {
                let ray = rays.through(rng.unit(), rng.unit());
                let sight = index.front_of(&ray);
                whole.clear(world.graph.len());
                follow::sectors(&world.map, &world.graph, &ray, &mut whole);
                let (mut all, mut until) = (Vec::new(), Vec::new());
                whole.list(&mut all);
                let Some(hit) = sight.hit else {
                    escaped += 1;
                    continue;
                };
                let front = sight.front[0];
                let near = |sector: &u32| match front < own {
                    true => items.of_region(*sector).binary_search(&front).is_ok(),
                    false => *sector == front - own,
                };
                assert!(all.iter().any(near), "{name} {ray:?}: {front} in {all:?}");
                let shorter = crate::visibility::Ray {
                    far: hit.depth * (1.0 - 1e-9),
                    ..ray
                };
                part.clear(world.graph.len());
                follow::sectors(&world.map, &world.graph, &shorter, &mut part);
                part.list(&mut until);
                assert_eq!(all, until, "{name} {ray:?}");
                ended += 1;
            }
        }
        println!("{name}: {ended} end, {escaped} meet nothing");
        assert!(ended > 1500 && escaped == 0);
    }
}
