//! One structure during a replay of a motion.
//!
//! Updates, queries, checks of answers, clock readings; queries of old trees and new ones.

use std::collections::BTreeMap;

use super::clock::{Lap, Stopwatch};
use super::count::{MOST_JUDGED, errors, spread};
use super::process_result::ReferenceResults;
use super::{
    Answer, Judged, Notice, Protocol, Schedule, Status, TaskKind, TimedTask, Verdict, Workload,
    compare_with_scan, guarded, timed,
};
use crate::culling::CameraView;
use crate::geometry::Aabb;
use crate::index::{DynIndex, StructureSpec, UpdatePolicy};
use crate::motion::{Motion, Replay};
use crate::query::ItemId;
use crate::scene::WrittenBoxes;
use crate::verify::{Truth, scan};

/// Most timed cameras.
const CAMERAS: usize = 24;
/// Number of rounds.
const ROUNDS: usize = 7;
/// Frames after which the query time is compared with that of a fresh build.
pub(super) const AGES: [usize; 4] = [1, 10, 100, 1000];

/// The queries along one path while items move, and their right answers.
pub(super) struct Frames<'w> {
    pub(super) workload: &'w Workload<'w>,
    pub(super) motion: &'w Motion,
    /// Answers of all queries, frame by frame.
    pub(super) right: Vec<Answer>,
    /// Errors of the first answers of some frames, against the boxes of these frames.
    pub(super) judged: Option<Judged>,
}

impl<'w> Frames<'w> {
    /// The right answers by a scan, unless they are known.
    pub(super) fn new(
        workload: &'w Workload<'w>,
        motion: &'w Motion,
        known: Option<&ReferenceResults>,
        notice: Notice,
    ) -> Frames<'w> {
        let mut frames = Frames {
            workload,
            motion,
            right: known.map(|known| known.visible.clone()).unwrap_or_default(),
            judged: None,
        };
        if known.is_some() {
            return frames;
        }
        let (mut items, mut replay) = (workload.items.to_vec(), motion.replay());
        let (scene, mut judging) = (workload.scene, Vec::new());
        let (mut boxes, mut shown) = (scene.items.to_vec(), motion.replay());
        let mut written = scene.originals.or_stored(boxes.len());
        let due = spread(items.len(), MOST_JUDGED, motion.frames);
        let (mut due, views) = (due.enumerate().peekable(), workload.views_per_frame);
        for frame in 0..motion.frames {
            notice(None, "scanning the frames");
            advance(&mut replay, workload, &mut items);
            if due.peek().is_some() {
                shown.advance_written(&mut boxes, &mut written);
            }
            if let Some((n, _)) = due.next_if(|(_, due)| *due == frame) {
                // The views of a frame in turn.
                let camera = (frame * views + n % views) % workload.cameras.len();
                let written = WrittenBoxes::listed(&written);
                let seen = &workload.cameras[camera];
                let truth = Truth::of_written(seen, scene.origin, &boxes, &written);
                let errors = truth.map(|truth| errors(workload, camera, &truth, &boxes, &items));
                judging.extend(errors);
            }
            for (_, view) in frames.views(frame) {
                let ids: Vec<ItemId> = scan(&items, |b| view.as_any().sees(b)).collect();
                frames.right.push(Answer::of(&ids));
            }
        }
        frames.judged = Some(Judged::of(judging));
        frames
    }

    /// Queries of a frame with their numbers; frames repeat the path.
    pub(super) fn views(
        &self,
        frame: usize,
    ) -> impl Iterator<Item = (usize, &'w CameraView)> + use<'w> {
        let (views, views_per_frame) = (&self.workload.views, self.workload.views_per_frame);
        let queries = (0..views_per_frame).map(move |n| frame * views_per_frame + n);
        queries.map(|query| (query, &views[query % views.len()]))
    }

    /// Compares an answer with the scan's.
    pub(super) fn check(
        &self,
        moving: &Moving,
        query: usize,
        out: &[ItemId],
    ) -> Result<(), Verdict> {
        if self.right.get(query) == Some(&Answer::of(out)) {
            return Ok(());
        }
        let (views, per_frame) = (&self.workload.views, self.workload.views_per_frame);
        let camera = query % views.len();
        let view = views[camera].as_any();
        let place = format!("frame {}, camera {camera}", query / per_frame + 1);
        compare_with_scan(&moving.items, view, &place, |ids| ids.extend(out))?;
        let reason = format!("{place}: another set than in the first process of the run");
        Err(Verdict::new(Status::Wrong, reason))
    }
}

/// A structure with its own items, at some frame of the motion.
pub(super) struct Moving<'w> {
    workload: &'w Workload<'w>,
    spec: &'w StructureSpec,
    replay: Replay<'w>,
    /// Bounds in the form that the culling test indexes.
    items: Vec<Aabb>,
    moved: Vec<ItemId>,
    frame: u32,
    /// Number of updates that became rebuilds because the structure refused a refit.
    pub(super) refused: usize,
    pub(super) index: Box<dyn DynIndex>,
}

impl<'w> Moving<'w> {
    pub(super) fn build(frames: &Frames<'w>, spec: &'w StructureSpec) -> Result<Self, Verdict> {
        let (workload, motion) = (frames.workload, frames.motion);
        let items = workload.items.to_vec();
        let mut index = spec.build(workload.input(&items))?;
        if spec.info().refits && spec.policy != UpdatePolicy::Rebuild {
            // Tables of positions are not part of the first frame.
            index.refit(&items, &[]);
        }
        Ok(Moving {
            frame: 0,
            refused: 0,
            workload,
            spec,
            replay: motion.replay(),
            moved: Vec::new(),
            index,
            items,
        })
    }

    /// Takes the moves of the next frame and returns its number, from 0.
    ///
    /// `None` after the last frame.
    pub(super) fn take_moves(&mut self) -> Option<usize> {
        let moved = advance(&mut self.replay, self.workload, &mut self.items)?;
        self.moved.clear();
        self.moved.extend(moved);
        self.frame += 1;
        Some(self.frame as usize - 1)
    }

    /// Brings the index up to date.
    pub(super) fn update(&mut self) -> Result<(), Verdict> {
        let is_rebuilt = match self.spec.policy {
            UpdatePolicy::Rebuild => true,
            UpdatePolicy::Every(frames) => self.frame.is_multiple_of(frames),
            UpdatePolicy::Refit => false,
        };
        if is_rebuilt {
            let refits_later = self.spec.policy != UpdatePolicy::Rebuild;
            let input = self.workload.input(&self.items).come_and_go(refits_later);
            self.index = self.spec.build(input)?;
            return Ok(());
        }
        if !self.moved.is_empty() {
            let input = self.workload.input(&self.items);
            let is_refitted = self.spec.update(&mut self.index, input, &self.moved)?;
            self.refused += usize::from(!is_refitted);
        }
        Ok(())
    }
}

/// Writes the next frame in the form of the culling test; returns the movers.
fn advance<'r>(
    replay: &'r mut Replay<'_>,
    workload: &Workload,
    items: &mut [Aabb],
) -> Option<&'r [ItemId]> {
    let ids = replay.advance(items)?;
    let boxes: Vec<Aabb> = ids.iter().map(|&id| items[id as usize]).collect();
    for (&id, b) in ids.iter().zip(&*workload.culling.test.items(&boxes)) {
        items[id as usize] = *b;
    }
    Some(ids)
}

/// Update, first query and further queries of a frame.
pub(super) type Laps = [Lap; 3];

/// CPU and wall ns of a kind; for further queries their mean. Positive.
pub(super) fn times_of(laps: &Laps, kind: TaskKind, workload: &Workload) -> [f64; 2] {
    let further = workload.views_per_frame.saturating_sub(1).max(1) as f64;
    [|lap: &Lap| lap.cpu_ns, |lap: &Lap| lap.wall_ns].map(|clock| {
        let ns = laps.each_ref().map(clock);
        let ns = match kind {
            TaskKind::Update => ns[0],
            TaskKind::Query => ns[1],
            TaskKind::Further => ns[2] / further,
            _ => ns.iter().sum(),
        };
        ns.max(1.0)
    })
}

/// Times and returned items of each frame of a replay.
pub(super) fn replay(
    spec: &StructureSpec,
    frames: &Frames,
    compares_sets: bool,
    turn: &dyn Fn(),
) -> Result<Vec<(Laps, u64)>, Verdict> {
    turn();
    let mut moving = Moving::build(frames, spec)?;
    let mut outs = vec![Vec::new(); frames.workload.views_per_frame];
    let mut all = Vec::with_capacity(frames.motion.frames);
    let all_threads = spec.is_threaded();
    let clock = Stopwatch::empty_lap(all_threads);
    // Memory of answers and traversals is not part of the first frame.
    for ((_, view), out) in frames.views(0).zip(&mut outs) {
        moving.index.query(view.as_any(), out);
    }
    while let Some(frame) = moving.take_moves() {
        turn();
        outs.iter_mut().for_each(Vec::clear);
        let watch = Stopwatch::start_for(all_threads);
        moving.update()?;
        let updated = watch.lap().less(clock);
        let mut views = frames.views(frame).zip(&mut outs);
        let watch = Stopwatch::start_for(all_threads);
        if let Some(((_, view), out)) = views.next() {
            moving.index.query(view.as_any(), out);
        }
        let first = watch.lap().less(clock);
        let watch = Stopwatch::start_for(all_threads);
        for ((_, view), out) in views {
            moving.index.query(view.as_any(), out);
        }
        let further = (outs.len() > 1).then(|| watch.lap().less(clock));
        let returned = outs.iter().map(|out| out.len() as u64).sum();
        all.push(([updated, first, further.unwrap_or_default()], returned));
        for ((query, _), out) in frames.views(frame).zip(&outs) {
            let right = frames.right.get(query);
            let is_right = right.is_some_and(|r| r.count == out.len() as u64);
            if compares_sets || !is_right {
                frames.check(&moving, query, out)?;
            }
        }
    }
    Ok(all)
}

/// ln of (query time / query time on a fresh build of the same boxes), by frame.
///
/// # Errors
/// An answer that differs from the reference scan's.
pub(super) fn ageing(
    spec: &StructureSpec,
    frames: &Frames,
    protocol: &Protocol,
    notice: Notice,
) -> Result<BTreeMap<usize, f64>, Verdict> {
    notice(Some(&spec.label), "ageing");
    let (mut ages, mut out) = (BTreeMap::new(), Vec::new());
    let mut moving = Moving::build(frames, spec)?;
    let last = AGES.into_iter().rfind(|age| *age <= frames.motion.frames);
    for frame in 1..=last.unwrap_or(0) {
        moving.take_moves();
        notice(Some(&spec.label), "ageing");
        moving.update()?;
        if moving.refused > 0 {
            break;
        }
        // The choice of an adaptive structure depends on its queries, too.
        if moving.index.chose().is_some() {
            for (_, view) in frames.views(frame) {
                out.clear();
                guarded(|| moving.index.query(view.as_any(), &mut out))?;
            }
        }
        if AGES.contains(&frame) {
            let aged = moving.index.as_ref();
            let found = over_fresh(aged, spec, frames.workload, &moving.items, protocol)?;
            ages.extend(found.map(|ln| (frame, ln)));
        }
    }
    Ok(ages)
}

/// ln of (query time / query time on a fresh build of the same boxes).
///
/// All views of the path, timed side by side.
fn over_fresh(
    aged: &dyn DynIndex,
    spec: &StructureSpec,
    workload: &Workload,
    items: &[Aabb],
    protocol: &Protocol,
) -> Result<Option<f64>, Verdict> {
    let Ok(rebuilt) = spec.build(workload.input(items)) else {
        return Ok(None);
    };
    let mut expected = Vec::with_capacity(workload.views.len());
    for (n, view) in workload.views.iter().enumerate() {
        let mut outs = [Vec::new(), Vec::new()];
        for (index, out) in [aged, rebuilt.as_ref()].into_iter().zip(&mut outs) {
            guarded(|| index.query(view.as_any(), out))?;
        }
        if Answer::of(&outs[0]) != Answer::of(&outs[1]) {
            let place = format!("camera {n}, a refit differs from a fresh build");
            for out in &outs {
                compare_with_scan(items, view.as_any(), &place, |ids| ids.extend(out))?;
            }
        }
        expected.push(Answer::of(&outs[1]));
    }
    let tasks = [aged, rebuilt.as_ref()].map(|index| {
        let counts = expected.iter().map(|answer| answer.count).collect();
        TimedTask::new(counts, |camera, out| {
            index.query(workload.views[camera].as_any(), out);
        })
    });
    let mut few = *protocol;
    few.rounds = [ROUNDS, ROUNDS];
    few.cameras = protocol.cameras.min(CAMERAS);
    let schedule = Schedule::new(workload.views.len(), &tasks, &few);
    let timed = timed(&tasks, &schedule, &few, &|_| ());
    Ok(match &timed[..] {
        [Ok(refitted), Ok(rebuilt)] => refitted.over(rebuilt).map(f64::ln),
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::culling::Culling;
    use crate::path::{self, LensDefaults};
    use crate::scene;

    #[test]
    fn times_of_a_frame_are_those_of_its_laps() {
        let scene = scene::load("uniform:n=20", &Default::default()).unwrap();
        let way = path::load("orbit:frames=8", &scene, &LensDefaults::default()).unwrap();
        let mut workload = Workload::new(&scene, &way, &Culling::default()).unwrap();
        workload.views_per_frame = 3;
        let laps = [(50.0, 80.0), (20.0, 21.0), (30.0, 90.0)];
        let laps = laps.map(|(cpu_ns, wall_ns)| Lap { cpu_ns, wall_ns });
        let of = |kind| times_of(&laps, kind, &workload);
        assert_eq!(of(TaskKind::Update), [50.0, 80.0]);
        assert_eq!(of(TaskKind::Query), [20.0, 21.0]);
        assert_eq!(of(TaskKind::Further), [15.0, 45.0]);
        assert_eq!(of(TaskKind::Frame), [100.0, 191.0]);
    }

    #[test]
    fn a_refit_that_differs_from_a_fresh_build_is_no_right_answer() {
        let scene = scene::load("uniform:n=500", &Default::default()).unwrap();
        let way = path::load("orbit:frames=8", &scene, &LensDefaults::default()).unwrap();
        let workload = Workload::new(&scene, &way, &Culling::default()).unwrap();
        let spec = StructureSpec::parse("linear").unwrap();
        let aged = spec.build(workload.input(&scene.items)).unwrap();
        let mut items = scene.items.clone();
        let far = glam::Vec3::splat(1e4);
        items[7] = Aabb::new(items[7].min + far, items[7].max + far);
        let found = over_fresh(aged.as_ref(), &spec, &workload, &items, &protocol());
        let verdict = found.unwrap_err();
        assert_eq!(verdict.status, Status::Wrong);
        let reason = verdict.reason.unwrap_or_default();
        assert!(
            reason.contains("a refit differs from a fresh build: "),
            "{reason}"
        );
    }

    fn protocol() -> Protocol {
        Protocol {
            rounds: [3, 3],
            task_ns: 1e5,
            cameras: 8,
            cold: false,
            seed: 1,
            cache_bytes: 0,
        }
    }
}
