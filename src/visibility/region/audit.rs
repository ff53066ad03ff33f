//! A stored set of visible regions is a claim: this says where it is wrong.

use serde::Serialize;

use super::answer::RegionId;
use super::graph::RegionGraph;
use super::pvs::Pvs;
use super::witness::{ProvenPvs, Witness};

/// What an audit found. Visibility is symmetric, so of each asymmetric pair one side
/// is wrong, whichever.
#[derive(Clone, PartialEq, Default, Debug, Serialize)]
#[non_exhaustive]
pub struct Audit {
    /// Unordered pairs of two different regions.
    pub pairs: u64,
    /// Ordered pairs that the claim calls visible, of two different regions.
    pub claimed: u64,
    /// Ordered pairs that are proven visible, or undecided, of two different regions.
    pub visible: u64,
    /// Pairs that are visible in one direction only, the smaller number first.
    pub asymmetric: Vec<[RegionId; 2]>,
    /// Pairs called invisible, from the first to the second region, that are proven
    /// visible: each with its line of sight, which [`RegionGraph::check_witness`]
    /// has accepted.
    pub false_negatives: Vec<Witness>,
    /// Ordered pairs called invisible that the search calls visible, but for which no
    /// line of sight was found.
    pub unproven: Vec<[RegionId; 2]>,
    /// Ordered pairs called visible that are proven invisible.
    pub false_positives: u64,
}

/// Two sets of different numbers of regions.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error(
    "the claim of what is seen from where is of {claimed} regions; expected the scene's {regions}"
)]
pub struct OtherRegions {
    /// Regions of the claim.
    pub claimed: usize,
    /// Regions of the graph.
    pub regions: usize,
}

/// Compares a claim with what is proven. O(n^2) and one search for each false
/// negative.
///
/// # Errors
/// A claim about another number of regions.
pub fn audit(
    claim: &Pvs,
    truth: &dyn ProvenPvs,
    graph: &RegionGraph,
) -> Result<Audit, OtherRegions> {
    let regions = graph.len();
    if claim.len() != regions {
        return Err(OtherRegions {
            claimed: claim.len(),
            regions,
        });
    }
    let n = regions as u32;
    let mut audit = Audit {
        pairs: u64::from(n) * u64::from(n.saturating_sub(1)) / 2,
        ..Audit::default()
    };
    for from in 0..n {
        for to in 0..n {
            if from == to {
                continue;
            }
            let (claimed, visible) = (claim.sees(from, to), truth.pvs().sees(from, to));
            audit.claimed += u64::from(claimed);
            audit.visible += u64::from(visible);
            audit.false_positives += u64::from(claimed && !visible);
            if from < to && claimed != claim.sees(to, from) {
                audit.asymmetric.push([from, to]);
            }
            if visible && !claimed {
                let witness = truth.witness(from, to);
                match witness.filter(|w| graph.check_witness(w).is_ok()) {
                    Some(witness) => audit.false_negatives.push(witness),
                    None => audit.unproven.push([from, to]),
                }
            }
        }
    }
    Ok(audit)
}
