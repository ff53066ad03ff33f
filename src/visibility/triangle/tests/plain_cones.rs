//! One cone per cluster without a term for rounding: a row that loses triangles.
//!
//! After the documentation of `meshopt_computeClusterBounds` (Kapoulkine's meshoptimizer).

use std::sync::Arc;

use glam::Vec3;

use super::super::{Clusters, Eye, Selection, TriangleCull, TriangleRow};
use crate::kernel::Kernel;
use crate::visibility::Guarantee;

pub const ROW: TriangleRow = TriangleRow {
    name: "cone-f32",
    summary: "One normal cone per cluster as meshoptimizer tests it",
    guarantee: Guarantee::Unproven,
    build: |clusters| Box::new(PlainCones::of(clusters)),
};

/// Cosine below which a cone counts as useless.
const LEAST_COSINE: f32 = 0.1;

/// A cone as the library documents it.
#[derive(Clone, Copy, Debug)]
struct PlainCone {
    apex: Vec3,
    axis: Vec3,
    cutoff: f32,
}

/// Back end with the cones of clusters.
#[derive(Clone, Debug)]
pub struct PlainCones {
    cones: Vec<PlainCone>,
}

impl PlainCones {
    /// Fits one cone per cluster. O(t).
    pub fn of(clusters: &Arc<Clusters>) -> PlainCones {
        let cone = |cluster| {
            let triangles: Vec<[Vec3; 3]> = clusters.corners_of(cluster).collect();
            let is_fitted = !clusters.is_two_sided(cluster);
            let fitted = is_fitted.then(|| PlainCone::of(&triangles)).flatten();
            fitted.unwrap_or(PlainCone::NEVER)
        };
        PlainCones {
            cones: (0..clusters.len()).map(cone).collect(),
        }
    }
}

impl PlainCone {
    /// Cone of a cluster that is always kept, as the library defines it.
    const NEVER: PlainCone = PlainCone {
        apex: Vec3::ZERO,
        axis: Vec3::ZERO,
        cutoff: 1.0,
    };

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

    /// Tests `dot(normalize(cone_apex - camera_position), cone_axis) >= cone_cutoff`.
    #[inline(always)]
    fn rejects(&self, eye: Vec3) -> bool {
        let way = self.apex - eye;
        (way * (1.0 / way.length())).dot(self.axis) >= self.cutoff
    }
}

/// A small enclosing ball of points (Ritter 1990, "An efficient bounding sphere").
fn ball(points: impl Iterator<Item = Vec3> + Clone) -> Option<(Vec3, f32)> {
    // The farthest pair among the extreme points of the three axes.
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
    fn cull(&self, eye: &Eye, _: Kernel, kept: &mut Selection) {
        let each = self.cones.iter().zip(kept.words_mut());
        if eye.weight == 0.0 {
            // `dot(view, cone_axis) >= cone_cutoff` for a parallel lens.
            let gone =
                each.filter(|(cone, _)| (-eye.nearest).normalize().dot(cone.axis) >= cone.cutoff);
            gone.for_each(|(_, word)| *word = 0);
        } else {
            let gone = each.filter(|(cone, _)| cone.rejects(eye.nearest));
            gone.for_each(|(_, word)| *word = 0);
        }
    }
}
