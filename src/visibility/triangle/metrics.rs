//! The exact truth of the stage, and the answer of a back end compared with it.

use super::clusters::Clusters;
use super::eye::Eye;
use super::selection::Selection;

/// The truth of this stage: triangles of `candidates` whose front the eye sees,
/// and all two-sided ones. Exact; one predicate per triangle, no shared structure.
pub fn facing(clusters: &Clusters, eye: &Eye, candidates: &Selection) -> Selection {
    let mut truth = candidates.clone();
    truth.retain(|cluster, bit| clusters.is_seen(eye, cluster, bit));
    truth
}

/// Triangles in and out of a stage.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
#[non_exhaustive]
pub struct Counts {
    /// Triangles that the stage was given.
    pub candidates: usize,
    /// Triangles that it delivered.
    pub delivered: usize,
    /// Triangles that it should have delivered.
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
