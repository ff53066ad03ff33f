//! [`TimedTask`], a participant of a timed pass: a closure that answers queries.
//!
//! Made from a structure and a [`TaskKind`]; lower bounds and other studies make their own
//! with [`TimedTask::new`].

use std::cell::RefCell;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use super::{Answer, Built, TaskKind, Workload};
use crate::index::StructureSpec;
use crate::query::{ItemId, Located};
use crate::threads::Workers;

/// Answers the query of the camera with this index: appends ids to an empty output.
pub type QueryFn<'a> = Box<dyn Fn(usize, &mut Vec<ItemId>) + 'a>;

/// Answers the queries of several cameras at once; returns the total number of ids.
pub type BatchFn<'a> = Box<dyn Fn(&[u32]) -> u64 + 'a>;

/// A participant of a timed pass: its queries and the right sizes of their answers.
pub struct TimedTask<'a> {
    /// Answers one query.
    pub ask: QueryFn<'a>,
    /// Answers all queries of a pass in one batch; used instead of `ask` if present.
    pub ask_many: Option<BatchFn<'a>>,
    /// True if threads share a query: the CPU time of all threads counts.
    pub all_threads: bool,
    /// Number of ids that each query must return.
    pub expected: Vec<u64>,
    /// Lower bound of the time of a query, ns; `None` if nothing was counted.
    ///
    /// From counters, so it is the same in every run.
    pub least_ns: Option<f64>,
}

impl<'a> TimedTask<'a> {
    /// A task of single queries, without counters.
    pub fn new(expected: Vec<u64>, ask: impl Fn(usize, &mut Vec<ItemId>) + 'a) -> Self {
        TimedTask {
            ask: Box::new(ask),
            ask_many: None,
            all_threads: false,
            expected,
            least_ns: None,
        }
    }

    /// The task of a structure for a kind of query on a workload.
    pub(super) fn of(
        task: TaskKind,
        spec: &StructureSpec,
        workload: &'a Workload,
        built: &'a Built,
        answers: &[Answer],
        least_ns: Option<f64>,
    ) -> Self {
        let ask: QueryFn = match task {
            TaskKind::Locate | TaskKind::LocateBatched => {
                let index = built.regions();
                Box::new(move |camera, out| {
                    workload.search(camera, out, |p, out| index.locate(p, out));
                })
            }
            _ => {
                let index = built.items.as_ref();
                Box::new(move |camera, out| {
                    index.query(workload.views[camera].as_any(), out);
                })
            }
        };
        let ask_many = match task {
            TaskKind::LocateBatched => Some(located_at_once(workload, built)),
            TaskKind::Views => seen_at_once(workload, built, spec.execution.threads),
            _ => None,
        };
        TimedTask {
            ask,
            all_threads: spec.query_threads() > 1 || task == TaskKind::Views,
            ask_many,
            expected: answers.iter().map(|a| a.count).collect(),
            least_ns,
        }
    }

    /// Answers the queries of some cameras; returns the number of ids.
    #[inline]
    pub(super) fn ask_all(&self, cameras: &[u32], out: &mut Vec<ItemId>) -> u64 {
        if let Some(ask_many) = &self.ask_many {
            return ask_many(cameras);
        }
        let mut returned = 0;
        for &camera in cameras {
            out.clear();
            (self.ask)(camera as usize, out);
            returned += std::hint::black_box(&*out).len() as u64;
        }
        returned
    }
}

/// Frustum queries of several cameras, shared among threads.
///
/// `None` if the system creates no threads. A thread answers one camera after another into its own
/// list.
fn seen_at_once<'a>(
    workload: &'a Workload,
    built: &'a Built,
    threads: usize,
) -> Option<BatchFn<'a>> {
    let workers = Workers::new(threads).ok()?;
    let (index, lists) = (built.items.as_ref(), RefCell::new(Vec::new()));
    Some(Box::new(move |cameras| {
        let lists: &mut Vec<Vec<ItemId>> = &mut lists.borrow_mut();
        lists.resize_with(threads * SHARES, Vec::new);
        let returned = AtomicU64::new(0);
        let shares = cameras.chunks(cameras.len().div_ceil(lists.len()).max(1));
        workers.share(shares.zip(lists), |(cameras, out)| {
            for &camera in cameras {
                out.clear();
                index.query(workload.views[camera as usize].as_any(), out);
                returned.fetch_add(std::hint::black_box(&*out).len() as u64, Relaxed);
            }
        });
        returned.into_inner()
    }))
}

/// Shares of cameras per thread, so that an interrupted thread gets fewer.
const SHARES: usize = 8;

/// Region search at the eyes of several cameras in one call.
///
/// The memory for points and answers is reused from call to call.
fn located_at_once<'a>(workload: &'a Workload, built: &'a Built) -> BatchFn<'a> {
    let index = built.regions();
    let kept = RefCell::new((Vec::new(), Located::default(), Vec::new()));
    Box::new(move |cameras| {
        let (points, located, region) = &mut *kept.borrow_mut();
        points.clear();
        let mut is_refined = false;
        points.extend(cameras.iter().map(|&camera| {
            let sought = &workload.sought[camera as usize];
            is_refined |= workload.scene.is_refined(sought);
            sought.local
        }));
        index.query_many(points, located);
        if !is_refined {
            return std::hint::black_box(&*located).ids().len() as u64;
        }
        let mut found = 0;
        for (&camera, ids) in cameras.iter().zip(located.iter()) {
            region.clear();
            region.extend_from_slice(ids);
            let sought = &workload.sought[camera as usize];
            workload.scene.refine(sought, region, 0);
            found += std::hint::black_box(&*region).len() as u64;
        }
        found
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::culling::{Culling, CullingTest};
    use crate::index::StructureSpec;
    use crate::measure::Subject;
    use crate::path::{self, LensDefaults};
    use crate::scene;

    /// On a map each answer is refined with its own point.
    #[test]
    fn points_asked_at_once_get_their_own_answers() {
        let scene = scene::load("freedm-map12", &Default::default()).unwrap();
        let path = path::load("orbit:frames=12", &scene, &LensDefaults::default()).unwrap();
        let workload = Workload::new(&scene, &path, &Culling::default()).unwrap();
        let spec = StructureSpec::parse("bsp").unwrap();
        let built = Subject::build(spec, false, &scene, CullingTest::SixPlane).built;
        let built = built.unwrap();
        let alone: Vec<u64> = (0..workload.points.len())
            .map(|place| {
                let mut out = Vec::new();
                let index = built.regions();
                workload.search(place, &mut out, |p, out| index.locate(p, out));
                out.len() as u64
            })
            .collect();
        assert!(alone.iter().sum::<u64>() > 0, "{alone:?}");
        let ask_many = located_at_once(&workload, &built);
        for places in [
            (0..alone.len() as u32).collect(),
            vec![7],
            vec![],
            vec![9, 2],
        ] {
            let wanted: u64 = places
                .iter()
                .map(|&place: &u32| alone[place as usize])
                .sum();
            assert_eq!(ask_many(&places), wanted, "{places:?}");
        }
    }
}
