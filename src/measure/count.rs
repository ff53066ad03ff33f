//! The count pass: every subject answers every query, with the counting
//! recorder and as it will be timed, and every answer is compared with the
//! reference before anything is timed.

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::notice::Notice;
use super::{Answer, Built, Status, TaskKind, Verdict, Workload, guarded};
use crate::culling::CullingTest;
use crate::query::{ItemId, Located, QueryCost};
use crate::statistics::rate;
use crate::verify::{ErrorCount, Fault, Trial, Truth, explain_containment, explain_visibility};

/// What one subject answered and what it cost.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Counted {
    /// Whether every answer was that of the reference scan.
    pub verdict: Verdict,
    /// The frustum query of each camera.
    pub frames: Vec<Answer>,
    /// Counters summed over all frustum queries.
    pub cost: QueryCost,
    /// The region search of each eye.
    pub located: Vec<Answer>,
    /// Counters summed over all region searches.
    pub locate_cost: QueryCost,
}

impl Counted {
    fn new() -> Self {
        Counted {
            verdict: Verdict::ok(),
            frames: Vec::new(),
            cost: QueryCost::default(),
            located: Vec::new(),
            locate_cost: QueryCost::default(),
        }
    }

    /// What a query of this task surely takes, ns: from counters alone, and so
    /// the same in every run. Far below the real time of most structures.
    pub(super) fn least_ns(&self, task: TaskKind) -> f64 {
        let (cost, queries) = match task {
            TaskKind::Query => (&self.cost, self.frames.len()),
            TaskKind::Locate | TaskKind::LocateBatched => (&self.locate_cost, self.located.len()),
        };
        20.0 + 0.1 * cost.comparisons() as f64 / queries.max(1) as f64
    }
}

/// Longest a subject may take for its whole count pass.
const PATIENCE: Duration = Duration::from_secs(120);

/// Counts and verifies. One reference serves all subjects of a frame; a
/// subject that fails once is asked no more.
pub fn count_pass(
    workload: &Workload,
    subjects: &[(String, &Built)],
    notice: Notice,
) -> Vec<Counted> {
    let mut all: Vec<Counted> = subjects.iter().map(|_| Counted::new()).collect();
    let mut spent = vec![Duration::ZERO; subjects.len()];
    let items = &workload.items;
    let mut trial = Trial::new(items.len());
    for (frame, view) in workload.views.iter().enumerate() {
        let view = view.as_any();
        trial.see(items, view);
        for (i, (label, subject)) in subjects.iter().enumerate() {
            let counted = &mut all[i];
            if counted.verdict.status != Status::Ok {
                continue;
            }
            notice(Some(label), "counting");
            let start = Instant::now();
            let cost = &mut counted.cost;
            let index = subject.items.as_ref();
            let counting = trial.ask(|out| index.query_counted(view, out, cost));
            // What will be timed is another traversal.
            let asked = match counting.map(drop) {
                Ok(()) => trial.ask(|out| index.query(view, out)).map(drop),
                Err(fault) => Err(fault),
            };
            spent[i] += start.elapsed();
            counted.verdict = verdict(asked, spent[i], &format!("camera {frame}"), |id| {
                explain_visibility(&items[id], view)
            });
            counted.frames.push(Answer::of(trial.answer()));
        }
    }
    let regions = &workload.scene.regions;
    let boxes = regions.boxes(&workload.scene.items);
    let mut trial = Trial::new(boxes.len());
    for (n, &p) in workload.points.iter().enumerate() {
        trial.expect(workload.scene.holding(&workload.sought[n]));
        for (i, (label, subject)) in subjects.iter().enumerate() {
            let counted = &mut all[i];
            if counted.verdict.status != Status::Ok {
                continue;
            }
            notice(Some(label), "counting");
            let start = Instant::now();
            let cost = &mut counted.locate_cost;
            let index = subject.regions();
            let counting = trial.ask(|out| {
                workload.search(n, out, |p, out| index.query_counted(p.into(), out, cost));
            });
            let asked = match counting.map(drop) {
                Ok(()) => trial.ask(|out| workload.search(n, out, |p, out| index.locate(p, out))),
                Err(fault) => Err(fault),
            };
            spent[i] += start.elapsed();
            counted.verdict = verdict(asked.map(drop), spent[i], &format!("point {n}"), |id| {
                explain_containment(&boxes[id], p)
            });
            counted.located.push(Answer::of(trial.answer()));
        }
    }
    for (counted, (_, subject)) in all.iter_mut().zip(subjects) {
        if counted.verdict.status == Status::Ok {
            counted.verdict = batch_verdict(workload, subject);
        }
    }
    all
}

/// Whether all points of the path asked at once get what each got alone, which
/// has been compared with the reference.
fn batch_verdict(workload: &Workload, subject: &Built) -> Verdict {
    let (mut many, mut alone) = (Located::default(), Vec::new());
    let index = subject.regions();
    if let Err(panicked) = guarded(|| index.query_many(&workload.points, &mut many)) {
        return panicked;
    }
    for (n, &p) in workload.points.iter().enumerate() {
        alone.clear();
        index.locate(p, &mut alone);
        if many.len() != workload.points.len() || many.of(n) != alone {
            let reason = format!("point {n} of a batch is answered otherwise than alone");
            return Verdict::new(Status::Wrong, reason);
        }
    }
    Verdict::ok()
}

/// How the answers of a workload differ from the truth at camera level.
#[derive(Clone, Copy, Default, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct Judged {
    /// Cameras that were judged, evenly spread over the path.
    pub judged_queries: usize,
    /// Sums over those.
    #[serde(flatten)]
    pub errors: ErrorCount,
    /// The 95 % interval of the false positives per visible item, by camera.
    #[serde(default)]
    pub excess_interval: Option<[f64; 2]>,
}

/// Checks the reference's answers, which all right structures share, against the oracle.
/// As many cameras as `most` verdicts allow, at least one.
pub fn judge(workload: &Workload, most: usize) -> Judged {
    let scene = workload.scene;
    let count = workload.cameras.len();
    let wanted = (most / scene.items.len().max(1)).clamp(1, 16).min(count);
    let mut judged = Judged::default();
    let mut by_camera = Vec::with_capacity(wanted);
    for n in 0..wanted {
        let frame = n * count / wanted;
        let camera = &workload.cameras[frame];
        let Some(truth) = Truth::of_scene(camera, scene) else {
            continue;
        };
        let view = workload.views[frame].as_any();
        let seen = workload.items.iter().zip(0..).filter(|(b, _)| view.sees(b));
        let answer: Vec<ItemId> = seen.map(|(_, id)| id).collect();
        let errors = truth.errors(&scene.items, &answer);
        judged.errors += match workload.culling.test {
            CullingTest::Sphere => errors.of_spheres(),
            CullingTest::Exact => errors.of_exact_test(),
            CullingTest::SixPlane | CullingTest::SixBox => errors,
        };
        judged.judged_queries += 1;
        by_camera.push([errors.false_positives as f64, errors.visible as f64]);
    }
    let excess = rate(&by_camera);
    judged.excess_interval = excess.and_then(|found| Some([found.lower?, found.upper?]));
    judged
}

/// What an answer makes of a structure. A false negative is worse than anything
/// that is returned too much.
fn verdict(
    asked: Result<(), Fault>,
    spent: Duration,
    question: &str,
    explain: impl FnOnce(usize) -> String,
) -> Verdict {
    match asked {
        Err(fault) => {
            let status = Status::of(&fault);
            let told = fault.explained(|id| Some(explain(id)));
            match status {
                Status::Panicked => Verdict::new(status, told),
                _ => Verdict::new(status, format!("{question}: {told}")),
            }
        }
        Ok(()) if spent > PATIENCE => {
            let reason = format!("the count pass took longer than {} s", PATIENCE.as_secs());
            Verdict::new(Status::TimedOut, reason)
        }
        Ok(()) => Verdict::ok(),
    }
}

/// Counters must fit the structure: something that declares itself no scan but looks at
/// (almost) every item for a sliver of the scene is reported.
pub(super) fn note_scan(counted: &mut Counted, items: usize) {
    let queries = counted.frames.len().max(1) as u64;
    let visible: u64 = counted.frames.iter().map(|f| f.count).sum();
    let sliver = visible * 1000 <= queries * items as u64;
    let compared = counted.cost.comparisons() / queries;
    if counted.verdict.status == Status::Ok
        && items >= 1000
        && sliver
        && compared * 10 >= 9 * items as u64
    {
        counted.verdict.reason = Some(format!(
            "tests {compared} bounds per query for {items} items, as a scan does"
        ));
    }
}
