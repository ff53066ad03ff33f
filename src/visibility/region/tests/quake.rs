//! Quake III map of two rooms; by its table the first does not see the second.

use glam::DVec3;

use super::follow;
use crate::camera::{Camera, Frame, Lens};
use crate::scene::{Regions, Scene, load};
use crate::visibility::Rays;
use crate::visibility::region::{IdSet, Pvs, RegionGraph, RegionItems, Scratch};

fn rays(eye: [f64; 3], forward: DVec3) -> Rays {
    let frame = Frame::looking_along(eye.into(), forward, DVec3::Z).unwrap();
    let lens = Lens::perspective(60.0, 1.5, 0.5, None).unwrap();
    Rays::of(&Camera { frame, lens }).unwrap()
}

fn two_rooms() -> (Scene, RegionGraph, Pvs) {
    let scene = load("tests/data/two_rooms.bsp", &Default::default()).unwrap();
    let Regions::Leaves(map) = &scene.regions else {
        panic!("no leaves");
    };
    let (graph, pvs) = (RegionGraph::of_quake(map), Pvs::of_quake(map).unwrap());
    (scene, graph, pvs)
}

#[test]
fn a_region_sees_what_the_table_of_the_map_has() {
    let (_, graph, pvs) = two_rooms();
    let seen_from = |eye| {
        let (rays, mut out) = (rays(eye, DVec3::X), Vec::new());
        let inside = graph.seen_by(&rays, Some(&pvs), &mut Scratch::default(), &mut out);
        (inside, out)
    };
    let inside = true;
    assert_eq!(seen_from([64.0, 64.0, 50.0]), (inside, vec![0, 1]));
    assert_eq!(seen_from([256.0, 64.0, 50.0]), (inside, vec![0, 1, 2]));
    // In a wall.
    let outside = (false, vec![0, 1, 2]);
    assert_eq!(seen_from([150.0, 10.0, 30.0]), outside);
}

#[test]
fn rays_tell_that_the_table_lacks_the_second_room() {
    let (scene, ..) = two_rooms();
    let Regions::Leaves(map) = &scene.regions else {
        panic!("no leaves");
    };
    let passed = |forward: DVec3| {
        let mut seen = IdSet::default();
        seen.clear(3);
        let rays = rays([64.0, 64.0, 30.0], forward);
        let ray = rays.through(0.5, 0.5);
        follow::leaves(map, &ray, &mut seen);
        let mut list = Vec::new();
        seen.list(&mut list);
        list
    };
    assert_eq!(passed(DVec3::X), [0, 1, 2]);
    assert_eq!(passed(DVec3::NEG_X), [0]);
    // Against the wall above the door.
    assert_eq!(passed(DVec3::new(1.0, 0.0, 0.7)), [0]);
}

#[test]
fn items_belong_to_the_regions_that_they_touch() {
    let (scene, graph, _) = two_rooms();
    let items = RegionItems::of(&graph, &scene);
    let regions_of = |label: &str| -> Vec<Vec<u32>> {
        let labelled = (0..scene.items.len()).filter(|&i| scene.labels[0].get(i) == label);
        let holds = |item: usize, region: u32| items.of_region(region).contains(&(item as u32));
        let of = |item| (0..3).filter(|&region| holds(item, region)).collect();
        labelled.map(of).collect()
    };
    assert_eq!(regions_of("mesh"), [vec![2]]);
    assert_eq!(regions_of("patch"), [vec![0]]);
    // The floors touch each other.
    assert_eq!(
        regions_of("polygon"),
        [vec![0, 1], vec![1, 2], vec![0, 1, 2]]
    );
}
