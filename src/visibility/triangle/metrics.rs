//! What a back end delivered, held against the exact truth.

use glam::Vec3;

use super::clusters::Clusters;
use super::contract::Criterion;
use super::exact::faces;
use super::image::Image;
use super::selection::Selection;
use super::view::View;

/// The truth of the facing rows: triangles of `candidates` whose front the eye sees,
/// and all two-sided ones. Exact; one predicate per triangle, no shared structure.
pub fn facing(clusters: &Clusters, view: &View, candidates: &Selection) -> Selection {
    let mut truth = candidates.clone();
    truth.retain(|cluster, bit| {
        let triangle = clusters.triangles_of(cluster)[bit];
        clusters.is_two_sided(cluster) || faces(&view.eye, clusters.surfaces.corners(triangle))
    });
    truth
}

/// What a row that decides by `criterion` must hand on of `candidates`: the triangles that
/// face the eye; those of which some point is surely within the window; those that the ray
/// of some sample meets, whatever is in front of them. A view without a window takes in
/// everything.
pub fn truth(
    criterion: Criterion,
    clusters: &Clusters,
    view: &View,
    candidates: &Selection,
) -> Selection {
    let holds: fn(&Image, [Vec3; 3]) -> bool = match criterion {
        Criterion::Facing => return facing(clusters, view, candidates),
        Criterion::Window => Image::surely_holds,
        Criterion::Samples => Image::is_sampled,
    };
    let mut truth = candidates.clone();
    if let Some(image) = Image::of(view) {
        truth.retain(|cluster, bit| {
            let triangle = clusters.triangles_of(cluster)[bit];
            holds(&image, clusters.surfaces.corners(triangle))
        });
    }
    truth
}

/// Triangles in and out of a stage.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
#[non_exhaustive]
pub struct Counts {
    /// What the stage was given.
    pub candidates: usize,
    /// What it delivered.
    pub delivered: usize,
    /// What it should have delivered.
    pub truth: usize,
    /// Delivered, but not in the truth.
    pub false_positives: usize,
    /// In the truth, but not delivered.
    pub false_negatives: usize,
}

impl Counts {
    /// Compares two selections of the same candidates.
    pub fn of(candidates: &Selection, delivered: &Selection, truth: &Selection) -> Counts {
        Counts {
            candidates: candidates.triangles(),
            delivered: delivered.triangles(),
            truth: truth.triangles(),
            false_positives: delivered.without(truth),
            false_negatives: truth.without(delivered),
        }
    }
}
