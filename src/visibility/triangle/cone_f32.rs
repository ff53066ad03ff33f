//! One cone per cluster as meshoptimizer computes and tests it, in f32 without a
//! term for rounding: a stand-in, written from the formulas in the documentation of
//! `meshopt_computeClusterBounds`, one cluster at a time.

use std::sync::Arc;

use glam::Vec3;

use super::super::guarantee::Guarantee;
use super::clusters::Clusters;
use super::contract::{Criterion, TriangleCull, TriangleRow};
use super::selection::Selection;
use super::view::View;
use crate::kernel::Kernel;

/// The row of this file.
pub const ROW: TriangleRow = TriangleRow {
    name: "cone-f32",
    summary: "One normal cone per cluster as meshoptimizer tests it (stand-in, scalar)",
    guarantee: Guarantee::Unproven,
    criterion: Criterion::Facing,
    build: |clusters| Box::new(PlainCones::of(clusters)),
};

/// Below this cosine a cone is taken for useless.
const LEAST_COSINE: f32 = 0.1;

#[derive(Clone, Copy, Debug)]
struct PlainCone {
    apex: Vec3,
    axis: Vec3,
    cutoff: f32,
}

/// The cones of clusters.
#[derive(Clone, Debug)]
pub struct PlainCones {
    cones: Vec<PlainCone>,
}

impl PlainCones {
    /// One cone per cluster. O(t).
    pub fn of(clusters: &Arc<Clusters>) -> PlainCones {
        let cone = |cluster| {
            let triangles: Vec<[Vec3; 3]> = clusters.corners_of(cluster).collect();
            let never = PlainCone {
                apex: Vec3::ZERO,
                axis: Vec3::ZERO,
                cutoff: 1.0,
            };
            match clusters.is_two_sided(cluster) {
                true => never,
                false => PlainCone::of(&triangles).unwrap_or(never),
            }
        };
        PlainCones {
            cones: (0..clusters.len()).map(cone).collect(),
        }
    }

    /// The test alone, one bool per cluster. `out` is overwritten.
    pub fn reject(&self, eye: Vec3, out: &mut Vec<bool>) {
        out.clear();
        out.extend(self.cones.iter().map(|cone| cone.rejects(eye)));
    }
}

impl PlainCone {
    fn of(triangles: &[[Vec3; 3]]) -> Option<PlainCone> {
        let planes: Vec<(Vec3, Vec3)> = triangles
            .iter()
            .filter_map(|[a, b, c]| {
                let n = (*b - *a).cross(*c - *a);
                let length = n.length();
                (length > 0.0).then(|| (*a, n / length))
            })
            .collect();
        let (centre, _) = ball(triangles.iter().flatten().copied())?;
        let (axis, _) = ball(planes.iter().map(|(_, n)| *n))?;
        let axis = axis.try_normalize()?;
        let cosine = planes.iter().map(|(_, n)| n.dot(axis)).fold(1.0, f32::min);
        if cosine <= LEAST_COSINE {
            return None;
        }
        let distances = planes
            .iter()
            .map(|(a, n)| (centre - *a).dot(*n) / axis.dot(*n));
        let back = distances.fold(0.0, f32::max);
        Some(PlainCone {
            apex: centre - axis * back,
            axis,
            cutoff: (1.0 - cosine * cosine).sqrt(),
        })
    }

    #[inline(always)]
    fn rejects(&self, eye: Vec3) -> bool {
        let way = self.apex - eye;
        (way * (1.0 / way.length())).dot(self.axis) >= self.cutoff
    }
}

/// A small ball about points (Ritter 1990, "An efficient bounding sphere").
fn ball(points: impl Iterator<Item = Vec3> + Clone) -> Option<(Vec3, f32)> {
    // The pair of extreme points that is farthest apart, of three axes.
    let extremes = |k: usize| {
        let low = points.clone().min_by(|a, b| a[k].total_cmp(&b[k]))?;
        let high = points.clone().max_by(|a, b| a[k].total_cmp(&b[k]))?;
        Some((low, high))
    };
    let pairs = [extremes(0)?, extremes(1)?, extremes(2)?];
    let apart = |(low, high): &(Vec3, Vec3)| low.distance_squared(*high);
    let widest = pairs.iter().max_by(|a, b| apart(a).total_cmp(&apart(b)));
    let (low, high) = widest.copied()?;
    let (mut centre, mut radius) = ((low + high) / 2.0, low.distance(high) / 2.0);
    for p in points {
        let distance = p.distance(centre);
        if distance > radius {
            let k = 0.5 + radius / distance / 2.0;
            centre = centre * k + p * (1.0 - k);
            radius = (radius + distance) / 2.0;
        }
    }
    Some((centre, radius))
}

impl TriangleCull for PlainCones {
    fn cull(&self, view: &View, _: Kernel, kept: &mut Selection) {
        // The documented test for a parallel lens: the direction of view instead.
        if view.eye.weight == 0.0 {
            let forward = -view.eye.nearest;
            for (cone, word) in self.cones.iter().zip(kept.words_mut()) {
                if forward.dot(cone.axis) >= cone.cutoff {
                    *word = 0;
                }
            }
            return;
        }
        for (cone, word) in self.cones.iter().zip(kept.words_mut()) {
            if cone.rejects(view.eye.nearest) {
                *word = 0;
            }
        }
    }

    fn bytes(&self) -> usize {
        size_of_val(&self.cones[..])
    }
}
