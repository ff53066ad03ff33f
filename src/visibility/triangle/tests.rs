//! Comparison of every row of the table with the exact truth.

mod audit;
mod plain_cones;

use std::sync::Arc;

use audit::{EyeKind, audit};
use glam::DVec3;

use super::super::Guarantee;
use super::*;
use crate::camera::{Camera, Lens, look_at};
use crate::kernel::Kernel;
use crate::scene::{Family, MESHES, SeededRng, Surfaces, load};

/// Numbers of triangles before and after the stage.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
struct Counts {
    /// Candidates of the stage.
    candidates: usize,
    /// Triangles that the stage returned.
    delivered: usize,
    /// Triangles that the stage should have returned.
    truth: usize,
    /// Returned, but not in the truth.
    false_positives: usize,
    /// In the truth, but not returned.
    false_negatives: usize,
}

impl Counts {
    /// Compares two selections of the same candidates.
    fn of(candidates: &Selection, delivered: &Selection, truth: &Selection) -> Counts {
        Counts {
            candidates: candidates.triangles(),
            delivered: delivered.triangles(),
            truth: truth.triangles(),
            false_positives: delivered.without(truth),
            false_negatives: truth.without(delivered),
        }
    }
}

/// Scenes of some thousand triangles: all meshes, and boxes far from the origin.
fn scenes() -> Vec<(String, Arc<Clusters>)> {
    let mesh = |mesh: &Family| (mesh.name.to_string(), mesh.mesh(6000, 5));
    let boxes = ["city:n=200", "rooms:n=200", "uniform:n=100,offset=1e7"].map(|name| {
        let scene = load(name, &Default::default()).unwrap();
        (name.to_string(), Surfaces::from_boxes(&scene))
    });
    let all = MESHES.iter().map(mesh).chain(boxes);
    all.map(|(name, surfaces)| (name, Arc::new(Clusters::of(Arc::new(surfaces), 64))))
        .collect()
}

/// Cameras in and around a scene, with three lenses in turn.
fn cameras(clusters: &Clusters, count: usize, seed: u64) -> Vec<Camera> {
    let surfaces = Surfaces::clone(&clusters.surfaces);
    let scene = surfaces.into_scene("cameras").unwrap();
    let bounds = scene.world_bounds();
    let (centre, size) = ((bounds.min + bounds.max) / 2.0, bounds.max - bounds.min);
    let mut rng = SeededRng::new(seed);
    let mut point =
        |scale: f64| centre + (rng.point() - 0.5) * (size + size.max_element() * 0.1) * scale;
    let pairs: Vec<(DVec3, DVec3)> = (0..count).map(|_| (point(1.5), point(0.8))).collect();
    let lenses = [
        Lens::perspective(70.0, 1.5, 0.1, None).unwrap(),
        Lens::off_axis([-0.1, 0.4, -0.2, 0.3], 0.5, Some(200.0)).unwrap(),
        Lens::orthographic(20.0, 1.5, 0.1, 500.0).unwrap(),
    ];
    let camera = |(i, (eye, look)): (usize, &(DVec3, DVec3))| Camera {
        frame: look_at(*eye, *look, DVec3::Z).unwrap(),
        lens: lenses[i % 3],
    };
    pairs.iter().enumerate().map(camera).collect()
}

fn eye(camera: &Camera, clusters: &Clusters) -> Eye {
    Eye::of(camera, clusters.surfaces.origin)
}

#[test]
fn rows_keep_their_promises_and_kernels_agree() {
    for (name, clusters) in scenes() {
        let all = Selection::all(&clusters);
        let cameras = cameras(&clusters, 12, 9);
        for row in TRIANGLE_ROWS {
            let back_end = (row.build)(&clusters);
            let mut sum = Counts::default();
            for camera in &cameras {
                let eye = eye(camera, &clusters);
                let mut kept = all.clone();
                back_end.cull(&eye, Kernel::Portable, &mut kept);
                for kernel in Kernel::available() {
                    let mut other = all.clone();
                    back_end.cull(&eye, kernel, &mut other);
                    assert_eq!(other, kept, "{name} {} {kernel}", row.name);
                }
                assert_eq!(kept.without(&all), 0);
                // Triangles removed beforehand stay removed, and change nothing else.
                let items = (0..clusters.surfaces.items() as u32).step_by(2);
                let half = Selection::of_items(&clusters, items);
                let mut rest = half.clone();
                back_end.cull(&eye, Kernel::best(), &mut rest);
                let both = half.words().iter().zip(kept.words()).map(|(a, b)| a & b);
                assert!(rest.words().iter().copied().eq(both), "{name} {}", row.name);
                let truth = facing(&clusters, &eye, &all);
                let counts = Counts::of(&all, &kept, &truth);
                sum.candidates += counts.candidates;
                sum.delivered += counts.delivered;
                sum.false_positives += counts.false_positives;
                sum.false_negatives += counts.false_negatives;
            }
            match row.guarantee {
                Guarantee::Exact => {
                    assert_eq!((sum.false_positives, sum.false_negatives), (0, 0), "{name}");
                }
                Guarantee::Conservative => {
                    assert_eq!(sum.false_negatives, 0, "{name} {}", row.name);
                }
                _ => {}
            }
            // If clusters are nearly flat, each row removes something.
            let removed = 1.0 - sum.delivered as f64 / sum.candidates as f64;
            let is_smooth = name == "mesh:spheres" || name == "mesh:statue";
            assert!(
                !is_smooth || removed > 0.05,
                "{name} {}: {removed:.3}",
                row.name
            );
        }
    }
}

#[test]
fn adversarial_eyes_find_what_the_unsafe_rows_lose_and_nothing_else() {
    for row in TRIANGLE_ROWS.iter().chain([&plain_cones::ROW]) {
        for eyes in EyeKind::ALL {
            let found = audit(row, 20_000, 1, eyes);
            let what = format!("{} {}: {found:?}", row.name, eyes.name());
            if row.guarantee <= Guarantee::Conservative {
                assert_eq!(found.false_negatives, 0, "{what}");
            } else {
                assert!(found.false_negatives > 10, "{what}");
            }
            // A search that rejects nothing proves nothing.
            assert!(found.rejected > 200, "{what}");
        }
    }
}

#[test]
fn two_sided_triangles_are_kept_and_flat_ones_without_area_are_not() {
    let clusters = scenes()
        .into_iter()
        .find(|(name, _)| name == "mesh:forest")
        .unwrap()
        .1;
    let all = Selection::all(&clusters);
    let two_sided = |c: &usize| clusters.is_two_sided(*c);
    assert!((0..clusters.len()).filter(two_sided).count() > 20);
    for camera in cameras(&clusters, 6, 3) {
        let eye = eye(&camera, &clusters);
        for row in TRIANGLE_ROWS {
            let mut kept = all.clone();
            (row.build)(&clusters).cull(&eye, Kernel::best(), &mut kept);
            for cluster in (0..clusters.len()).filter(two_sided) {
                assert_eq!(
                    kept.words()[cluster],
                    clusters.word(cluster),
                    "{}",
                    row.name
                );
            }
        }
    }
}

#[test]
fn the_proven_margin_costs_next_to_nothing() {
    for (name, clusters) in scenes() {
        let all = Selection::all(&clusters);
        let removed = |wanted: &str| {
            let mut rows = TRIANGLE_ROWS.iter().chain([&plain_cones::ROW]);
            let row = rows.find(|row| row.name == wanted).unwrap();
            let back_end = (row.build)(&clusters);
            let views = cameras(&clusters, 16, 8);
            let of = |camera: &Camera| {
                let mut kept = all.clone();
                back_end.cull(&eye(camera, &clusters), Kernel::best(), &mut kept);
                all.without(&kept)
            };
            views.iter().map(of).sum::<usize>() as f64
        };
        let unsafe_one = removed("cone-f32");
        assert!(removed("cone-f32-safe") >= 0.99 * unsafe_one, "{name}");
    }
}
