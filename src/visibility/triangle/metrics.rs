//! What a back end delivered, held against the exact truth.

use super::clusters::Clusters;
use super::exact::faces;
use super::eye::Eye;
use super::selection::Selection;

/// The truth of this stage: triangles of `candidates` whose front the eye sees,
/// and all two-sided ones. Exact; one predicate per triangle, no shared structure.
pub fn facing(clusters: &Clusters, eye: &Eye, candidates: &Selection) -> Selection {
    let mut truth = candidates.clone();
    truth.retain(|cluster, bit| {
        let triangle = clusters.triangles_of(cluster)[bit];
        clusters.is_two_sided(cluster) || faces(eye, clusters.surfaces.corners(triangle))
    });
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
