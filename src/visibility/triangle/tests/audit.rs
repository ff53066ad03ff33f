//! Search for lost triangles.
//!
//! Eyes are next to the boundary of a cluster's cone; clusters are flat, thin or far away. Compares
//! what a back end removes with the exact test.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::super::clusters::Clusters;
use super::super::exact::{Eye, faces, normal};
use super::super::{Selection, TriangleRow};
use crate::kernel::Kernel;
use crate::scene::{SeededRng, SurfaceKind, Surfaces};

named! {
    /// Kind of eyes in a search.
    #[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
    pub enum EyeKind {
        /// Points in f32: only the test itself rounds.
        Single = "f32",
        /// Points in f64: the eye is rounded too.
        Double = "f64",
        /// Eyes at infinity: directions of a parallel lens.
        Direction = "direction",
    }
}

/// Result of a search.
#[derive(Clone, PartialEq, Debug)]
pub struct Audit {
    /// Number of pairs of a cluster and an eye.
    pub pairs: usize,
    /// Pairs for which the back end removed a triangle.
    pub rejected: usize,
    /// Pairs for which it removed a triangle that faces the eye.
    pub false_negatives: usize,
    /// Largest sine by which a lost triangle faces the eye, rounded.
    ///
    /// This is the sine of the angle between its plane and the line from the eye to its first
    /// corner.
    pub worst_sine: f64,
    /// Eye and corners of the first lost triangle.
    pub witness: Option<(DVec3, [Vec3; 3])>,
}

/// Number of clusters per world; each is tried with `EYES` eyes.
const WORLD: usize = 16;
const EYES: usize = 64;

/// Tries at least `pairs` pairs, the same for every back end and machine.
pub fn audit(row: &TriangleRow, pairs: usize, seed: u64, eyes: EyeKind) -> Audit {
    let mut rng = SeededRng::new(seed);
    let mut found = Audit {
        pairs: 0,
        rejected: 0,
        false_negatives: 0,
        worst_sine: 0.0,
        witness: None,
    };
    while found.pairs < pairs {
        let mut surfaces = Surfaces::about(DVec3::ZERO);
        for _ in 0..WORLD {
            let (points, triangles) = patch(&mut rng);
            surfaces.push(SurfaceKind::Opaque, false, &points, &triangles);
        }
        let clusters = Arc::new(Clusters::of(Arc::new(surfaces), 64));
        let back_end = (row.build)(&clusters);
        let all = Selection::all(&clusters);
        for cluster in 0..clusters.len() {
            for _ in 0..EYES {
                let [eye, way] = boundary(&clusters, cluster, &mut rng);
                let eye = match eyes {
                    EyeKind::Single => Eye::local(eye.as_vec3().as_dvec3()),
                    EyeKind::Double => Eye::local(eye),
                    EyeKind::Direction => Eye::along(-way),
                };
                let mut kept = all.clone();
                back_end.cull(&eye, Kernel::best(), &mut kept);
                found.pairs += 1;
                let removed = all.words()[cluster] & !kept.words()[cluster];
                found.rejected += usize::from(removed != 0);
                let mut is_lost = false;
                for (bit, corners) in clusters.corners_of(cluster).enumerate() {
                    if removed >> bit & 1 == 1 && faces(&eye, corners) {
                        is_lost = true;
                        found.worst_sine = found.worst_sine.max(sine(&eye, corners));
                        found.witness.get_or_insert((eye.high, corners));
                    }
                }
                found.false_negatives += usize::from(is_lost);
            }
        }
    }
    found
}

fn sine(eye: &Eye, corners: [Vec3; 3]) -> f64 {
    let way = eye.high - corners[0].as_dvec3() * f64::from(eye.weight);
    way.normalize_or_zero().dot(normal(corners).normalize())
}

/// A few triangles around a point: flat, bent or thin; near the origin or far away.
fn patch(rng: &mut SeededRng) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let size = libm::exp2(rng.between(-8.0, 8.0));
    let offset = match rng.below(3) {
        0 => 0.0,
        _ => size * libm::exp2(rng.between(0.0, 16.0)),
    };
    let centre = rng.normal3() * offset;
    let (up, u) = (rng.normal3().normalize(), rng.normal3());
    let u = up.cross(u).normalize();
    let v = up.cross(u) * [1.0, 1.0, 1e-3, 1e-5][rng.below(4)];
    let bend = [0.0, 0.0, 0.05, 0.5][rng.below(4)];
    let count = 1 + rng.below(6);
    // A fan around the centre.
    let points = (0..=count + 1).map(|i| {
        let angle = std::f64::consts::TAU * i as f64 / (count + 2) as f64;
        let (sin, cos) = libm::sincos(angle);
        let at = match i {
            0 => DVec3::ZERO,
            _ => u * cos + v * sin - up * (bend * rng.unit()),
        };
        (centre + at * size).as_vec3()
    });
    let points: Vec<Vec3> = points.collect();
    let triangles = (1..=count as u32).map(|i| [0, i, i + 1]).collect();
    (points, triangles)
}

/// An eye near the boundary, and the direction to it.
///
/// Up to some ulps the eye is in the plane of a triangle, where the cluster's cone touches that
/// plane or anywhere else in it; the direction is perturbed by some ulps too.
fn boundary(clusters: &Clusters, cluster: usize, rng: &mut SeededRng) -> [DVec3; 2] {
    let triangles: Vec<[Vec3; 3]> = clusters.corners_of(cluster).collect();
    let normals: Vec<DVec3> = triangles
        .iter()
        .map(|corners| normal(*corners).normalize_or_zero())
        .collect();
    let axis = normals.iter().sum::<DVec3>().normalize_or(DVec3::Z);
    let chosen = rng.below(triangles.len());
    let [a, b, c] = triangles[chosen].map(Vec3::as_dvec3);
    let n = normals[chosen];
    let size = (b - a).length().max((c - a).length());
    let far = size * libm::exp2(rng.between(-6.0, 18.0));
    let way = match rng.below(2) {
        0 => (n * axis.dot(n) - axis).normalize_or((b - a).normalize_or(DVec3::X)),
        _ => ((b - a) * rng.between(-1.0, 1.0) + (c - a) * rng.between(-1.0, 1.0))
            .normalize_or(DVec3::X),
    };
    // Some ulps of f32 or of f64 in either direction.
    let ulp = [f64::from(f32::EPSILON), f64::EPSILON][rng.below(2)];
    let mut off = |size: DVec3| {
        let step = |k: usize| size[k] * ulp * (rng.below(9) as f64 - 4.0) / 2.0;
        DVec3::from([0, 1, 2].map(step))
    };
    let eye = a + way * far;
    [
        eye + off(eye.abs() + far * 1e-3),
        way + off(DVec3::splat(1.0)),
    ]
}
