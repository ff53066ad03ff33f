//! The count pass: every contender answers every query with the counting
//! recorder, and every answer is compared with the reference before anything
//! is timed.

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::contender::guarded;
use super::{Built, Status, Verdict, Workload};
use crate::query::{ItemId, Located, QueryCost};
use crate::verify::{
    Difference, ErrorCount, Reference, Truth, explain_containment, explain_visibility,
};

/// What one contender answered and what it cost.
#[derive(Clone, Debug)]
pub struct Counted {
    pub verdict: Verdict,
    pub frames: Vec<FrameCount>,
    pub cost: QueryCost,
    pub locate: LocateCount,
    /// Largest wall time of one counted query: bounds the timed pass.
    pub slowest: Duration,
}

/// One frustum query.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug)]
pub struct FrameCount {
    pub visible: u64,
    pub id_sum: u64,
}

/// All region searches of a path.
#[derive(Clone, Default, Debug)]
pub struct LocateCount {
    pub found: Vec<u64>,
    pub cost: QueryCost,
}

impl Counted {
    fn new() -> Self {
        Counted {
            verdict: Verdict::ok(),
            frames: Vec::new(),
            cost: QueryCost::default(),
            locate: LocateCount::default(),
            slowest: Duration::ZERO,
        }
    }
}

/// Longest a contender may take for its whole count pass.
const PATIENCE: Duration = Duration::from_secs(120);

/// Counts and verifies. One reference serves all contenders of a frame; a
/// contender that fails once is asked no more.
pub fn count_pass(workload: &Workload, contenders: &[&Built]) -> Vec<Counted> {
    let mut all: Vec<Counted> = contenders.iter().map(|_| Counted::new()).collect();
    let mut spent = vec![Duration::ZERO; contenders.len()];
    let items = &workload.items;
    let mut out = Vec::new();
    let mut reference = Reference::new(items.len());
    for (frame, view) in workload.views.iter().enumerate() {
        let view = view.as_any();
        reference.see(items, view);
        for (i, contender) in contenders.iter().enumerate() {
            let counted = &mut all[i];
            if counted.verdict.status != Status::Ok {
                continue;
            }
            out.clear();
            let start = Instant::now();
            let cost = &mut counted.cost;
            let asked = guarded(|| contender.items.see_counted(view, &mut out, cost));
            let took = start.elapsed();
            spent[i] += took;
            counted.slowest = counted.slowest.max(took);
            counted.frames.push(FrameCount {
                visible: out.len() as u64,
                id_sum: id_sum(&out),
            });
            let difference = reference.compare(&out);
            counted.verdict = verdict(asked, spent[i], difference, || {
                let what = format!("camera {frame}: {difference}");
                explained(what, difference, |id| explain_visibility(&items[id], view))
            });
        }
    }
    let regions = &workload.scene.regions;
    let boxes = regions.boxes(&workload.scene.items);
    let mut reference = Reference::new(boxes.len());
    for (n, &p) in workload.points.iter().enumerate() {
        reference.expect(regions.holding(p, &workload.scene.items).into_iter());
        for (i, contender) in contenders.iter().enumerate() {
            let counted = &mut all[i];
            if counted.verdict.status != Status::Ok {
                continue;
            }
            out.clear();
            let start = Instant::now();
            let cost = &mut counted.locate.cost;
            let asked = guarded(|| contender.regions().locate_counted(p, &mut out, cost));
            spent[i] += start.elapsed();
            workload.refine(p, &mut out);
            counted.locate.found.push(out.len() as u64);
            let difference = reference.compare(&out);
            counted.verdict = verdict(asked, spent[i], difference, || {
                let what = format!("point {n}: {difference}");
                explained(what, difference, |id| explain_containment(&boxes[id], p))
            });
        }
    }
    for (counted, contender) in all.iter_mut().zip(contenders) {
        if counted.verdict.status == Status::Ok {
            counted.verdict = batch_verdict(workload, contender);
        }
    }
    for counted in &mut all {
        note_scan(counted, items.len());
    }
    all
}

/// Whether all points of the path asked at once get what each got alone, which
/// has been compared with the reference.
fn batch_verdict(workload: &Workload, contender: &Built) -> Verdict {
    let (mut many, mut alone) = (Located::default(), Vec::new());
    let index = contender.regions();
    if let Err(panicked) = guarded(|| index.locate_many(&workload.points, &mut many)) {
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
pub struct Judged {
    /// Cameras that were judged, evenly spread over the path.
    pub judged_queries: usize,
    /// Sums over those.
    #[serde(flatten)]
    pub errors: ErrorCount,
}

/// Judges the reference's answers, which are everyone's who counted right.
/// As many cameras as `most` verdicts allow, at least one.
pub fn judge(workload: &Workload, most: usize) -> Judged {
    let scene = workload.scene;
    let count = workload.cameras.len();
    let wanted = (most / scene.items.len().max(1)).clamp(1, 16).min(count);
    let mut judged = Judged::default();
    for n in 0..wanted {
        let frame = n * count / wanted;
        let camera = &workload.cameras[frame];
        let Some(truth) = Truth::of_camera(camera, scene.origin, &scene.items) else {
            continue;
        };
        let view = workload.views[frame].as_any();
        let seen = workload.items.iter().zip(0..).filter(|(b, _)| view.sees(b));
        let answer: Vec<ItemId> = seen.map(|(_, id)| id).collect();
        judged.errors += truth.errors(&scene.items, &answer);
        judged.judged_queries += 1;
    }
    judged
}

fn explained(
    what: String,
    difference: Difference,
    explain: impl FnOnce(usize) -> String,
) -> String {
    match difference.first {
        Some(id) => format!("{what}: {}", explain(id as usize)),
        None => what,
    }
}

fn verdict(
    asked: Result<(), Verdict>,
    spent: Duration,
    difference: Difference,
    explain: impl FnOnce() -> String,
) -> Verdict {
    if let Err(panicked) = asked {
        return panicked;
    }
    if !difference.is_none() {
        let status = if difference.missing > 0 {
            Status::Unsafe
        } else {
            Status::Wrong
        };
        return Verdict::new(status, explain());
    }
    if spent > PATIENCE {
        let reason = format!("the count pass took longer than {} s", PATIENCE.as_secs());
        return Verdict::new(Status::TimedOut, reason);
    }
    Verdict::ok()
}

/// Counters must fit the structure: something that calls itself a structure
/// but looks at (almost) every item for a sliver of the scene is reported.
fn note_scan(counted: &mut Counted, items: usize) {
    let queries = counted.frames.len().max(1) as u64;
    let visible: u64 = counted.frames.iter().map(|f| f.visible).sum();
    let sliver = visible * 1000 <= queries * items as u64;
    let compared = counted.cost.comparisons() / queries;
    if counted.verdict.status == Status::Ok
        && items >= 1000
        && sliver
        && compared * 10 >= 9 * items as u64
    {
        counted.verdict.reason = Some(format!(
            "looks at {compared} bounds a query for {items} items: a scan"
        ));
    }
}

/// Sum of ids found: what `query` and `locate` print as a checksum.
pub fn id_sum(ids: &[ItemId]) -> u64 {
    ids.iter().map(|&id| u64::from(id)).sum()
}
