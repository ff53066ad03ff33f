//! Small worlds and eyes in them.

use glam::DVec3;

use super::super::{Opening, OpeningPlane, RegionGraph, rectangle};
use crate::camera::{Camera, Frame, Lens};
use crate::scene::{self, Scene, SeededRng, WorldBox};
use crate::visibility::{Ray, Rays};

pub fn rooms(spec: &str) -> (Scene, RegionGraph) {
    let scene = scene::load(spec, &Default::default()).unwrap();
    let graph = RegionGraph::of_scene(&scene).unwrap();
    (scene, graph)
}

/// A camera in a random region, 1.7 above the floor, looking about level.
///
/// In a low region the eye is just below the ceiling instead.
pub fn eye_in(graph: &RegionGraph, rng: &mut SeededRng) -> Rays {
    let b = graph.parts[rng.below(graph.len())][0];
    let size = b.max - b.min;
    let mut eye = b.min + size * DVec3::new(rng.unit(), rng.unit(), 0.5) * 0.999;
    eye.z = (b.min.z + 1.7).min(b.max.z - 0.01);
    looking(eye, rng)
}

pub fn looking(eye: DVec3, rng: &mut SeededRng) -> Rays {
    let forward = DVec3::new(
        rng.between(-1.0, 1.0),
        rng.between(-1.0, 1.0),
        rng.between(-0.2, 0.2),
    );
    let frame = Frame::looking_along(eye, forward, DVec3::Z).unwrap();
    let lens = Lens::perspective(60.0, 16.0 / 9.0, 0.05, None).unwrap();
    Rays::of(&Camera { frame, lens }).unwrap()
}

/// First solid that a ray enters, or none.
pub fn first_hit(solids: &[WorldBox], ray: &Ray) -> Option<u32> {
    let enters = |b: &WorldBox| {
        let inverse = ray.direction.recip();
        let (a, b) = (
            (b.min - ray.origin) * inverse,
            (b.max - ray.origin) * inverse,
        );
        let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
        (near <= far && near >= ray.near && near <= ray.far).then_some(near)
    };
    let hits = (0..)
        .zip(solids)
        .filter_map(|(id, b)| Some((enters(b)?, id)));
    hits.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, id)| id)
}

/// A block of cubes, with openings of all sizes and heights between most of them.
pub fn cubes(count: [usize; 3], rng: &mut SeededRng) -> RegionGraph {
    let number = |i: [usize; 3]| ((i[2] * count[1] + i[1]) * count[0] + i[0]) as u32;
    let (mut boxes, mut openings) = (Vec::new(), Vec::new());
    for z in 0..count[2] {
        for y in 0..count[1] {
            for x in 0..count[0] {
                let here = [x, y, z];
                let low = DVec3::from_array(here.map(|i| i as f64 * 3.0));
                boxes.push(WorldBox::new(low, low + 3.0));
                for axis in 0..3 {
                    if here[axis] == 0 || rng.unit() < 0.2 {
                        continue;
                    }
                    let (a, b) = (low + rng.point() * 3.0, low + rng.point() * 3.0);
                    let (mut min, mut max) = (a.min(b), a.max(b));
                    (min[axis], max[axis]) = (low[axis], low[axis]);
                    let mut before = here;
                    before[axis] -= 1;
                    openings.push(Opening {
                        sides: [number(here), number(before)],
                        corners: rectangle(axis, min, max),
                        plane: OpeningPlane::Axis {
                            axis,
                            at: low[axis],
                        },
                    });
                }
            }
        }
    }
    RegionGraph::of_boxes(boxes, openings)
}

/// A graph that lacks one opening: it must be detected as wrong.
pub fn without_opening(graph: &RegionGraph, index: usize) -> RegionGraph {
    let mut openings = graph.openings.to_vec();
    openings.remove(index);
    let regions = (0..graph.len() as u32).map(|r| graph.parts[r as usize].to_vec());
    RegionGraph::new(regions.collect(), openings, graph.locator.clone())
}
