//! What an audit of a claim found, as it is written to a file and checked by a program
//! that does not search.

use serde::{Deserialize, Serialize};

use super::answer::RegionId;
use super::audit::Audit;
use super::graph::RegionGraph;
use super::pvs::Pvs;
use super::witness::Witness;

/// What is wrong with a claim, each with what shows it.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ClaimErrors {
    /// The scene whose regions it is about, as it is typed.
    pub scene: String,
    /// The back end that reads the claim: `reject` or `stored-pvs`.
    pub claim: String,
    /// Number of regions.
    pub regions: usize,
    /// Pairs that the claim calls visible in one direction only.
    pub asymmetric: Vec<[RegionId; 2]>,
    /// Lines of sight between regions of which the claim says that the first does not
    /// see the second.
    pub false_negatives: Vec<Witness>,
}

/// The first entry that shows nothing.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("regions {} and {}: {reason}", regions[0], regions[1])]
#[non_exhaustive]
pub struct NoError {
    /// Of which pair.
    pub regions: [RegionId; 2],
    /// Why.
    pub reason: String,
}

impl ClaimErrors {
    /// Of an audit.
    pub fn of(audit: &Audit, scene: &str, claim: &str, regions: usize) -> ClaimErrors {
        ClaimErrors {
            scene: scene.to_owned(),
            claim: claim.to_owned(),
            regions,
            asymmetric: audit.asymmetric.clone(),
            false_negatives: audit.false_negatives.clone(),
        }
    }

    /// Verifies each entry: the claim says what it is said to say, and every line of
    /// sight leads through openings, exactly.
    ///
    /// # Errors
    /// The first entry that shows no error of the claim.
    pub fn check(&self, claim: &Pvs, graph: &RegionGraph) -> Result<(), NoError> {
        let no = |regions: [RegionId; 2], reason: &str| NoError {
            regions,
            reason: reason.to_owned(),
        };
        let is_there = |regions: &[RegionId; 2]| {
            let least = claim.len().min(graph.len());
            regions.iter().all(|&region| (region as usize) < least)
        };
        for pair in &self.asymmetric {
            let [a, b] = *pair;
            match () {
                () if !is_there(pair) => return Err(no(*pair, "a region that is not there")),
                () if claim.sees(a, b) == claim.sees(b, a) => {
                    return Err(no(*pair, "the claim says the same in both directions"));
                }
                () => {}
            }
        }
        for witness in &self.false_negatives {
            let [from, to] = witness.regions;
            match () {
                () if !is_there(&witness.regions) => {
                    return Err(no(witness.regions, "a region that is not there"));
                }
                () if claim.sees(from, to) => {
                    return Err(no(
                        witness.regions,
                        "the claim calls the second one visible",
                    ));
                }
                () => graph
                    .check_witness(witness)
                    .map_err(|rejected| no(witness.regions, &rejected.to_string()))?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::tests::worlds::remove;
    use super::super::{ProvenPvs, RoomsPvs, audit};
    use super::*;
    use crate::scene::load;

    #[test]
    fn errors_of_a_claim_are_accepted_and_made_up_ones_are_not() {
        let scene = load("rooms:n=300", &Default::default()).unwrap();
        let graph = Arc::new(RegionGraph::of_scene(&scene).unwrap());
        let exact = RoomsPvs::of(graph.clone()).unwrap();
        let mut claim = exact.pvs().clone();
        let sees = |a: RegionId| (0..claim.len() as RegionId).filter(move |b| *b != a);
        let first = sees(3).find(|b| claim.sees(3, *b)).unwrap();
        let hidden = sees(3).find(|b| !claim.sees(3, *b)).unwrap();
        remove(&mut claim, [3, first]);
        let found = audit(&claim, &exact, &graph).unwrap();
        let errors = ClaimErrors::of(&found, "rooms:n=300", "stored-pvs", graph.len());
        assert_eq!(errors.asymmetric, [[first.min(3), first.max(3)]]);
        assert_eq!(errors.false_negatives.len(), 1);
        errors.check(&claim, &graph).unwrap();
        // As it is read back, number by number.
        let text = serde_json::to_string(&errors).unwrap();
        assert_eq!(serde_json::from_str::<ClaimErrors>(&text).unwrap(), errors);

        let refused = |change: &dyn Fn(&mut ClaimErrors)| {
            let mut doctored = errors.clone();
            change(&mut doctored);
            doctored.check(&claim, &graph).unwrap_err().to_string()
        };
        type Change<'c> = &'c dyn Fn(&mut ClaimErrors);
        let cases: [(Change, &str); 6] = [
            (
                &|e| e.false_negatives[0].ends[1] += 1e4,
                "not strictly within",
            ),
            (
                &|e| e.false_negatives[0].regions[1] = hidden,
                "not strictly within",
            ),
            (
                &|e| e.false_negatives[0].regions.reverse(),
                "calls the second one visible",
            ),
            (&|e| e.false_negatives[0].regions[0] = 1 << 20, "not there"),
            (&|e| e.asymmetric[0] = [3, hidden], "the same in both"),
            (&|e| e.asymmetric[0][1] = 1 << 20, "not there"),
        ];
        for (change, wanted) in cases {
            let told = refused(change);
            assert!(told.contains(wanted), "{told}; expected {wanted}");
        }
        // A line between two regions that the claim hides, with a wall in between.
        let mut wall = errors.clone();
        let middle = |region: RegionId| {
            let part = graph.parts(region)[0];
            (part.min + part.max) / 2.0
        };
        wall.asymmetric.clear();
        wall.false_negatives[0] = Witness {
            regions: [3, hidden],
            ends: [middle(3), middle(hidden)],
        };
        let told = wall.check(&claim, &graph).unwrap_err().to_string();
        assert!(told.contains("no opening"), "{told}");
    }
}
