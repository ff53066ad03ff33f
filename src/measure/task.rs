//! Those that take part in a timed pass: the questions there are, and how a
//! structure answers them. Clocks and rounds are the pass's own.

use std::cell::{Cell, RefCell};

use super::{Answer, Built, TaskKind, Workload};
use crate::query::{ItemId, Located};

/// Answers query number n: appends ids to an empty output.
pub type Ask<'a> = Box<dyn Fn(usize, &mut Vec<ItemId>) + 'a>;

/// Answers several queries at once; the number of ids of them all.
pub type AskMany<'a> = Box<dyn Fn(&[u32]) -> u64 + 'a>;

/// One that takes part in a timed pass: how it answers query `place`
/// (appending to an empty output), and what it must return.
pub struct TimedTask<'a> {
    /// Answers one query.
    pub ask: Ask<'a>,
    /// Takes the place of `ask`, and a whole pass is one batch.
    pub ask_many: Option<AskMany<'a>>,
    /// Number of ids of every query.
    pub expected: Vec<u64>,
    /// Lower bound of the time of a query, ns, from counters: the same in every run.
    /// `None` where nothing was counted.
    pub least_ns: Option<f64>,
}

impl<'a> TimedTask<'a> {
    /// A task of single queries, without counters.
    pub fn new(expected: Vec<u64>, ask: impl Fn(usize, &mut Vec<ItemId>) + 'a) -> Self {
        TimedTask {
            ask: Box::new(ask),
            ask_many: None,
            expected,
            least_ns: None,
        }
    }

    /// A structure that counted right, asked a task of a workload.
    pub(super) fn of(
        task: TaskKind,
        label: &str,
        workload: &'a Workload,
        built: &'a Built,
        answers: &[Answer],
        least_ns: Option<f64>,
    ) -> Self {
        let ask: Ask = match task {
            TaskKind::Query => {
                let index = built.items.as_ref();
                let ask = move |place: usize, out: &mut Vec<ItemId>| {
                    index.query(workload.views[place].as_any(), out);
                };
                match slowed(label) {
                    Some(every) => twice_in(every, ask),
                    None => Box::new(ask),
                }
            }
            TaskKind::Locate | TaskKind::LocateBatched => {
                let index = built.regions();
                Box::new(move |place, out| {
                    workload.search(place, out, |p, out| index.locate(p, out));
                })
            }
        };
        let ask_many = (task == TaskKind::LocateBatched).then(|| located_at_once(workload, built));
        TimedTask {
            ask,
            ask_many,
            expected: answers.iter().map(|a| a.count).collect(),
            least_ns,
        }
    }

    /// Asks the queries of some places; the number of ids returned.
    #[inline]
    pub(super) fn ask_all(&self, places: &[u32], out: &mut Vec<ItemId>) -> u64 {
        if let Some(ask_many) = &self.ask_many {
            return ask_many(places);
        }
        let mut returned = 0;
        for &place in places {
            out.clear();
            (self.ask)(place as usize, out);
            returned += std::hint::black_box(&*out).len() as u64;
        }
        returned
    }
}

/// In a test build (`CULLBENCH_TEST_BUILD=1 cargo build`) a file `PROGRAM.slowed`
/// beside the program that says `octree:20` makes its octree answer every 20th
/// query twice, 5 % more work: scripts/check-compare.sh shows with it what
/// `compare --against` finds. Two copies of one file differ by nothing else; two
/// builds would, by some percent, by how they were laid out.
fn slowed(label: &str) -> Option<usize> {
    option_env!("CULLBENCH_TEST_BUILD")?;
    let mut file = std::env::current_exe().ok()?.into_os_string();
    file.push(".slowed");
    let text = std::fs::read_to_string(file).ok()?;
    let (name, every) = text.trim().split_once(':')?;
    every.parse().ok().filter(|_| name == label)
}

fn twice_in<'a>(every: usize, ask: impl Fn(usize, &mut Vec<ItemId>) + 'a) -> Ask<'a> {
    let asked = Cell::new(0_usize);
    Box::new(move |place, out| {
        asked.set(asked.get() + 1);
        if asked.get().is_multiple_of(every) {
            ask(place, out);
            out.clear();
        }
        ask(place, out);
    })
}

/// Region search for several points of the path in one call. The memory for
/// points and answers is kept from call to call.
fn located_at_once<'a>(workload: &'a Workload, built: &'a Built) -> AskMany<'a> {
    let index = built.regions();
    let kept = RefCell::new((Vec::new(), Located::default(), Vec::new()));
    Box::new(move |places| {
        let (points, located, region) = &mut *kept.borrow_mut();
        points.clear();
        let mut is_refined = false;
        points.extend(places.iter().map(|&place| {
            let sought = &workload.sought[place as usize];
            is_refined |= workload.scene.is_refined(sought);
            sought.local
        }));
        index.query_many(points, located);
        if !is_refined {
            return std::hint::black_box(&*located).ids().len() as u64;
        }
        let mut found = 0;
        for (&place, ids) in places.iter().zip(located.iter()) {
            region.clear();
            region.extend_from_slice(ids);
            let sought = &workload.sought[place as usize];
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

    /// On a map each answer is refined by its own point.
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
