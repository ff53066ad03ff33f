//! Those that take part in a timed pass: the questions there are, and how a
//! structure answers them. Clocks and rounds are the pass's own.

use std::cell::RefCell;
use std::time::Duration;

use super::{Built, Counted, Workload};
use crate::query::{ItemId, Located};

/// Which of the two questions is asked.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Task {
    /// What does the camera see?
    Query,
    /// Where is the camera?
    Locate,
    /// Where are all the cameras of the path? Asked at once.
    LocateBatched,
}

impl Task {
    pub fn name(self) -> &'static str {
        match self {
            Task::Query => "query",
            Task::Locate => "locate",
            Task::LocateBatched => "locate_batched",
        }
    }
}

/// Answers query number n: appends ids to an empty output.
pub type Ask<'a> = Box<dyn Fn(usize, &mut Vec<ItemId>) + 'a>;

/// Answers several queries at once; the number of ids of them all.
pub type AskMany<'a> = Box<dyn Fn(&[usize]) -> u64 + 'a>;

/// One that takes part in a timed pass: how it answers query `place`
/// (appending to an empty output), and what it must return.
pub struct Competitor<'a> {
    pub ask: Ask<'a>,
    /// Takes the place of `ask`, and a whole pass is one batch.
    pub ask_many: Option<AskMany<'a>>,
    /// Number of ids of every query.
    pub expected: Vec<u64>,
    /// Wall time of its slowest query so far: bounds the length of a pass.
    pub slowest: Duration,
}

impl<'a> Competitor<'a> {
    /// A structure that counted right, asked a task of a workload.
    pub(super) fn of(
        task: Task,
        workload: &'a Workload,
        built: &'a Built,
        counted: &Counted,
    ) -> Self {
        let ask: Ask = match task {
            Task::Query => {
                let index = built.items.as_ref();
                Box::new(move |place, out| index.see(workload.views[place].as_any(), out))
            }
            Task::Locate | Task::LocateBatched => {
                let index = built.regions();
                Box::new(move |place, out| {
                    let p = workload.points[place];
                    index.locate(p, out);
                    workload.refine(p, out);
                })
            }
        };
        let ask_many = (task == Task::LocateBatched).then(|| located_at_once(workload, built));
        Competitor {
            ask,
            ask_many,
            expected: match task {
                Task::Query => counted.frames.iter().map(|f| f.visible).collect(),
                Task::Locate | Task::LocateBatched => counted.locate.found.clone(),
            },
            slowest: counted.slowest,
        }
    }

    /// Asks the queries of some places; the number of ids returned.
    #[inline]
    pub(super) fn ask_all(&self, places: &[usize], out: &mut Vec<ItemId>) -> u64 {
        if let Some(ask_many) = &self.ask_many {
            return ask_many(places);
        }
        let mut returned = 0;
        for &place in places {
            out.clear();
            (self.ask)(place, out);
            returned += std::hint::black_box(&*out).len() as u64;
        }
        returned
    }
}

/// Region search for several points of the path in one call. The memory for
/// points and answers is kept from call to call.
fn located_at_once<'a>(workload: &'a Workload, built: &'a Built) -> AskMany<'a> {
    let index = built.regions();
    let kept = RefCell::new((Vec::new(), Located::default(), Vec::new()));
    Box::new(move |places| {
        let (points, located, region) = &mut *kept.borrow_mut();
        points.clear();
        points.extend(places.iter().map(|&place| workload.points[place]));
        index.locate_many(points, located);
        if workload.scene.regions.are_boxes() {
            return std::hint::black_box(&*located).ids().len() as u64;
        }
        let mut found = 0;
        for (&p, ids) in points.iter().zip(located.iter()) {
            region.clear();
            region.extend_from_slice(ids);
            workload.refine(p, region);
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
    use crate::measure::Contender;
    use crate::path::{self, LensDefaults};
    use crate::scene;

    /// On a map each answer is refined by its own point.
    #[test]
    fn points_asked_at_once_get_their_own_answers() {
        let scene = scene::load("freedm-map12", &Default::default()).unwrap();
        let path = path::load("orbit:frames=12", &scene, &LensDefaults::default()).unwrap();
        let workload = Workload::new(&scene, &path, &Culling::default()).unwrap();
        let spec = StructureSpec::parse("bsp").unwrap();
        let built = Contender::build(spec, false, &scene, CullingTest::SixPlane).built;
        let built = built.unwrap();
        let alone: Vec<u64> = (0..workload.points.len())
            .map(|place| {
                let mut out = Vec::new();
                built.regions().locate(workload.points[place], &mut out);
                workload.refine(workload.points[place], &mut out);
                out.len() as u64
            })
            .collect();
        assert!(alone.iter().sum::<u64>() > 0, "{alone:?}");
        let ask_many = located_at_once(&workload, &built);
        for places in [(0..alone.len()).collect(), vec![7], vec![], vec![9, 2]] {
            let wanted: u64 = places.iter().map(|&place: &usize| alone[place]).sum();
            assert_eq!(ask_many(&places), wanted, "{places:?}");
        }
    }
}
