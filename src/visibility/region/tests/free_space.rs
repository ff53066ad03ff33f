//! The flood over a grid against the truth of solids.

use std::sync::Arc;

use super::super::*;
use super::from_eye::rows;
use super::worlds::*;
use crate::scene::{self, SeededRng, WorldBox};
use crate::visibility::{Rays, Solids};

fn street_eyes(solids: &Solids, scene: &crate::scene::Scene, rng: &mut SeededRng) -> Vec<Rays> {
    let bounds = scene.world_bounds();
    let mut eyes = Vec::new();
    while eyes.len() < 20 {
        let at = bounds.min + (bounds.max - bounds.min) * rng.point();
        let eye = at.with_z(bounds.min.z + 1.7);
        let inside = |b: &WorldBox| eye.cmpge(b.min - 0.2).all() && eye.cmple(b.max + 0.2).all();
        if !solids.boxes.iter().any(inside) {
            eyes.push(looking(eye, rng));
        }
    }
    eyes
}

#[test]
fn the_first_solid_on_a_ray_lies_in_a_listed_cell() {
    for (spec, cells) in [
        ("city:n=1500,seed=3", 3000),
        ("rooms:n=1500,seed=3", 20_000),
    ] {
        let scene = scene::load(spec, &Default::default()).unwrap();
        let solids = Solids::of(&scene);
        let graph = Arc::new(RegionGraph::of_free_space(&solids, cells));
        let all = 3 * graph.len();
        assert!(
            graph.openings().len() < all * 99 / 100,
            "{spec}: no face is closed"
        );
        let items = RegionItems::of(&graph, &scene);
        let mut rng = SeededRng::new(2);
        let (mut scratch, mut regions) = (Scratch::default(), Vec::new());
        let (mut marks, mut list) = (Marks::default(), Vec::new());
        for rays in street_eyes(&solids, &scene, &mut rng) {
            for row in &rows(&graph)[..2] {
                assert_eq!(
                    row.from_eye(&rays, &mut scratch, &mut regions),
                    EyePlace::Inside
                );
                items.of_regions(&regions, &mut marks, &mut list);
                assert!(list.is_sorted());
                for _ in 0..60 {
                    let ray = rays.through(rng.unit(), rng.unit());
                    if let Some(hit) = first_hit(&solids.boxes, &ray) {
                        assert!(
                            list.binary_search(&hit).is_ok(),
                            "{spec} {}",
                            row.about().name
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn an_eye_in_a_solid_or_outside_of_the_bounds_is_nowhere() {
    let scene = scene::load("city:n=300,seed=3", &Default::default()).unwrap();
    let solids = Solids::of(&scene);
    let graph = Arc::new(RegionGraph::of_free_space(&solids, 500));
    let mut rng = SeededRng::new(2);
    let within = (solids.boxes[7].min + solids.boxes[7].max) * 0.5;
    for eye in [within, scene.world_bounds().max + 1.0] {
        let rays = looking(eye, &mut rng);
        for row in rows(&graph) {
            let mut out = Vec::new();
            let place = row.from_eye(&rays, &mut Scratch::default(), &mut out);
            assert_eq!((place, out.len()), (EyePlace::Outside, graph.len()));
        }
    }
    // Without items there are no cells.
    let empty = RegionGraph::of_free_space(
        &Solids {
            boxes: Vec::new(),
            ..solids
        },
        10,
    );
    assert!(empty.is_empty());
}
