//! The count pass, which compares every answer with the reference, and the oracle.
//!
//! [`count_pass`]: every subject answers every query twice, with the counting recorder and as it
//! will be timed. [`judge`] compares the right answers with the exact truth.

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::key::Pass;
use super::{Built, Notice, Status, Subject, Verdict, Workload, guarded};
use crate::culling::CullingTest;
use crate::geometry::Aabb;
use crate::index::Kind;
use crate::path::evenly;
use crate::query::{ItemId, Located, QueryCost};
use crate::scene::mix64;
use crate::shown::significant;
use crate::statistics::{Estimate, rate_of};
use crate::verify::{
    ErrorCount, Fault, Trial, Truth, explain_containment, explain_visibility, scan,
};

/// A set of ids, reduced to the data that answers are compared by.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Answer {
    /// Number of ids.
    pub count: u64,
    /// Sum over the ids of a hash of each: independent of their order.
    pub digest: u64,
}

impl Answer {
    /// The answer that consists of these ids, in any order.
    pub fn of(ids: &[ItemId]) -> Answer {
        let mixed = |id: ItemId| mix64(id.into());
        Answer {
            count: ids.len() as u64,
            digest: ids.iter().fold(0, |all, &id| all.wrapping_add(mixed(id))),
        }
    }
}

/// Answers of one subject, and their cost.
#[derive(Clone, Default, Debug)]
pub struct Counted {
    /// Ok if every answer equals that of the reference scan.
    pub verdict: Verdict,
    /// Frustum queries, one per camera, and region searches, one per eye.
    pub answers: [Vec<Answer>; 2],
    /// Counters summed over all frustum queries, and over all region searches.
    pub costs: [QueryCost; 2],
}

impl Counted {
    /// Lower bound of the time of a query of a pass, ns, from counters alone.
    ///
    /// Deterministic, and far below the real time of most structures.
    pub(super) fn least_ns(&self, pass: Pass) -> f64 {
        let queries = self.answers[pass as usize].len().max(1) as f64;
        20.0 + 0.1 * self.costs[pass as usize].comparisons() as f64 / queries
    }
}

/// Most verdicts of the oracle per group; one takes about 50 ns.
pub(super) const MOST_JUDGED: usize = 400_000;
/// Time limit of the whole count pass of a subject.
const PATIENCE: Duration = Duration::from_secs(120);

/// Counts and verifies all queries of all subjects.
///
/// All subjects share one reference answer. A subject that fails once, or was not built, is
/// skipped.
pub fn count_pass(workload: &Workload, subjects: &[Subject], notice: Notice) -> Vec<Counted> {
    let fresh = |subject: &Subject| Counted {
        verdict: subject.built.as_ref().err().cloned().unwrap_or_default(),
        ..Counted::default()
    };
    let mut all: Vec<Counted> = subjects.iter().map(fresh).collect();
    let mut spent = vec![Duration::ZERO; subjects.len()];
    let scene = workload.scene;
    let boxes = scene.regions.boxes(&scene.items);
    for pass in Pass::ALL {
        let (mut trial, queries) = match pass {
            Pass::Queries => (Trial::new(workload.items.len()), workload.views.len()),
            Pass::Searches => (Trial::new(boxes.len()), workload.points.len()),
        };
        for n in 0..queries {
            match pass {
                Pass::Queries => trial.set_view(&workload.items, workload.views[n].as_any()),
                Pass::Searches => trial.set_expected(scene.holding(&workload.sought[n])),
            }
            for (i, subject) in subjects.iter().enumerate() {
                let counted = &mut all[i];
                let (true, Ok(built)) = (counted.verdict.is_ok(), &subject.built) else {
                    continue;
                };
                // Twins too, under the same name: if either ends the process, neither is tried
                // again.
                notice(Some(&subjects[i].spec.label), "counting");
                let start = Instant::now();
                let cost = &mut counted.costs[pass as usize];
                let counting = trial.run(|out| built.count(workload, pass, n, out, cost));
                // The timed traversal is compiled without the recorder: checked as well.
                let timed = |out: &mut Vec<ItemId>| built.answer(workload, pass, n, out);
                let answered = counting.map(drop);
                let answered = answered.and_then(|()| trial.run(timed).map(drop));
                spent[i] += start.elapsed();
                let explain = |id: usize| match pass {
                    Pass::Queries => {
                        let item = workload.items.get(id)?;
                        Some(explain_visibility(item, workload.views[n].as_any()))
                    }
                    Pass::Searches => Some(explain_containment(boxes.get(id)?, workload.points[n])),
                };
                let question = format!("{} {n}: ", pass.name());
                counted.verdict = match answered {
                    Err(fault @ Fault::Panicked(_)) => Verdict::of(&fault, "", explain),
                    Err(fault) => Verdict::of(&fault, &question, explain),
                    Ok(()) if spent[i] > PATIENCE => {
                        let limit = PATIENCE.as_secs();
                        let reason = format!("the count pass took longer than {limit} s");
                        Verdict::new(Status::TimedOut, reason)
                    }
                    Ok(()) => Verdict::default(),
                };
                counted.answers[pass as usize].push(Answer::of(&trial.answer));
            }
        }
    }
    for (counted, subject) in all.iter_mut().zip(subjects) {
        if let (true, Ok(built)) = (counted.verdict.is_ok(), &subject.built) {
            notice(Some(&subject.spec.label), "counting");
            counted.verdict = compare_batch(workload, built).err().unwrap_or_default();
            if subject.spec.info().kind != Kind::Scan {
                note_scan(counted, workload.items.len());
            }
        }
    }
    all
}

/// Compares the batched answers of all points with those of single points.
///
/// The latter were compared with the reference.
fn compare_batch(workload: &Workload, subject: &Built) -> Result<(), Verdict> {
    let (mut many, mut alone) = (Located::default(), Vec::new());
    let index = subject.regions();
    guarded(|| index.query_many(&workload.points, &mut many))?;
    for (n, &p) in workload.points.iter().enumerate() {
        alone.clear();
        index.locate(p, &mut alone);
        if many.len() != workload.points.len() || many.of(n) != alone {
            let reason = format!("point {n} has another answer in a batch than alone");
            return Err(Verdict::new(Status::Wrong, reason));
        }
    }
    Ok(())
}

/// Difference of the answers of a workload from the truth at camera level.
#[derive(Clone, Copy, Default, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Judged {
    /// Number of cameras checked, evenly spread over the path.
    pub judged_queries: usize,
    /// Sums over those cameras.
    #[serde(flatten)]
    pub errors: ErrorCount,
    /// The 95 % interval of the false positives per visible item, by camera.
    pub excess_interval: Option<[f64; 2]>,
}

/// Checks the reference answers, which all right structures share, with the oracle.
///
/// Checks as many cameras as `most` verdicts of the oracle allow, from 1 to 16.
pub fn judge(workload: &Workload, most: usize) -> Judged {
    let scene = workload.scene;
    let judged = spread(scene.items.len(), most, workload.cameras.len());
    let found = judged.filter_map(|n| {
        let truth = Truth::of_scene(&workload.cameras[n], scene)?;
        Some(errors(workload, n, &truth, &scene.items, &workload.items))
    });
    Judged::of(found.collect())
}

/// The queries to check, evenly spread.
///
/// Their number is from 1 to 16, as `most` verdicts allow.
pub fn spread(items: usize, most: usize, queries: usize) -> impl Iterator<Item = usize> {
    evenly(queries, (most / items.max(1)).clamp(1, 16))
}

/// Errors of the answer about `items`; `held` are their boxes in the test.
pub(super) fn errors(
    workload: &Workload,
    camera: usize,
    truth: &Truth,
    items: &[Aabb],
    held: &[Aabb],
) -> ErrorCount {
    let view = workload.views[camera].as_any();
    let answer: Vec<ItemId> = scan(held, |b| view.sees(b)).collect();
    blamed(workload.culling.test, truth.errors(items, &answer))
}

impl Judged {
    /// The errors of the checked queries.
    pub(super) fn of(found: Vec<ErrorCount>) -> Judged {
        let excess = rate_of(&found, |e| [e.false_positives, e.visible]);
        Judged {
            judged_queries: found.len(),
            errors: found.into_iter().sum(),
            excess_interval: excess.and_then(Estimate::ends),
        }
    }

    /// The verdict of every structure, if visible items are missed.
    pub(super) fn unsafe_verdict(&self) -> Option<Verdict> {
        let errors = &self.errors;
        (errors.false_negatives > 0).then(|| {
            let reason = format!(
                "{} of {} visible items are missed at camera level, the deepest by {}",
                errors.false_negatives,
                errors.visible,
                significant(errors.worst_miss)
            );
            Verdict::new(Status::Unsafe, reason)
        })
    }
}

/// Errors with their false positives attributed to the planes or to the test.
///
/// The sphere test causes all of its own. The exact test causes none: those that are not due to the
/// stored boxes are due to its planes.
pub fn blamed(test: CullingTest, mut errors: ErrorCount) -> ErrorCount {
    errors.by_planes = match test {
        CullingTest::Sphere => 0,
        CullingTest::Exact => errors.false_positives - errors.by_storage,
        CullingTest::SixPlane | CullingTest::SixBox => errors.by_planes,
    };
    errors
}

/// Adds a note to a structure that does not declare a scan, but works like one.
///
/// It tests at least 90 % of the items while at most 0.1 % are visible.
fn note_scan(counted: &mut Counted, items: usize) {
    let answers = &counted.answers[Pass::Queries as usize];
    let queries = answers.len().max(1) as u64;
    let visible: u64 = answers.iter().map(|f| f.count).sum();
    let is_sliver = visible * 1000 <= queries * items as u64;
    let compared = counted.costs[Pass::Queries as usize].comparisons() / queries;
    if counted.verdict.is_ok() && items >= 1000 && is_sliver && compared * 10 >= 9 * items as u64 {
        counted.verdict.reason = Some(format!(
            "tests {compared} bounds per query for {items} items, as a scan does"
        ));
    }
}
