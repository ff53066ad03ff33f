//! The timed pass: rounds in balanced random order over all contenders, each
//! warmed up, several queries per clock reading where one is short, and the
//! caches streamed over between queries when it is to be cold.

use std::ops::Range;
use std::time::{Duration, Instant};

use glam::Vec3;

use super::clock::Stopwatch;
use super::{Built, Counted, Status, Verdict, Workload};
use crate::geometry::{Aabb, ConvexVolume};
use crate::index::{DynIndex, MemoryUsage};
use crate::query::{AnyView, ItemId, QueryCost};
use crate::scene::{Dice, Regions, Scene};

/// How long and how often to measure.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Protocol {
    pub min_rounds: usize,
    pub max_rounds: usize,
    /// After `min_rounds`, no new round begins past this time.
    pub budget: Duration,
    /// Longest a single pass of the slowest contender may take; frames are
    /// thinned out evenly to keep to it.
    pub pass: Duration,
    /// Stream over the caches before every query.
    pub cold: bool,
    pub seed: u64,
    /// Cost of one clock reading and its loop, from [`harness_overhead_ns`].
    pub overhead_ns: f64,
    /// Bytes to stream over for a cold query.
    pub cache_bytes: usize,
}

/// Queries are batched until the harness takes at most this share of a lap.
pub const MOST_OVERHEAD: f64 = 0.02;
/// Longest warm-up before each contender's pass.
const WARM_UP: Duration = Duration::from_millis(20);
/// Cold queries cost a sweep over memory each: fewer of them.
const COLD_FRAMES: usize = 24;

/// Which of the two questions is asked.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Task {
    /// What does the camera see?
    Query,
    /// Where is the camera?
    Locate,
}

impl Task {
    pub fn name(self) -> &'static str {
        match self {
            Task::Query => "query",
            Task::Locate => "locate",
        }
    }
}

/// One clock reading: `queries` consecutive queries from `frame` on.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Sample {
    pub round: u32,
    pub frame: u32,
    pub queries: u32,
    /// Per query.
    pub cpu_ns: f64,
    pub wall_ns: f64,
    /// Ids returned by all queries of the sample: each sample is a test too.
    pub returned: u64,
}

/// The samples of one contender, rounds in order, frames in order.
#[derive(Clone, Default, Debug)]
pub struct Timed {
    pub samples: Vec<Sample>,
    pub rounds: usize,
}

/// The queries of a task that are timed: places in the path.
struct Queries<'a> {
    task: Task,
    workload: &'a Workload<'a>,
    places: Vec<usize>,
}

impl Queries<'_> {
    /// Asks the queries of a range; the number of ids returned.
    #[inline]
    fn ask(&self, index: &dyn DynIndex, range: Range<usize>, out: &mut Vec<ItemId>) -> u64 {
        let mut returned = 0;
        for &place in &self.places[range] {
            out.clear();
            match self.task {
                Task::Query => index.visible(&self.workload.volumes[place], out),
                Task::Locate => {
                    let p = self.workload.points[place];
                    index.locate(p, out);
                    self.workload.refine(p, out);
                }
            }
            returned += std::hint::black_box(&*out).len() as u64;
        }
        returned
    }

    fn index<'b>(&self, built: &'b Built) -> &'b dyn DynIndex {
        match self.task {
            Task::Query => built.items.as_ref(),
            Task::Locate => built.regions(),
        }
    }

    fn expected(&self, counted: &Counted, range: Range<usize>) -> u64 {
        let places = self.places[range].iter();
        match self.task {
            Task::Query => places.map(|&place| counted.frames[place].visible).sum(),
            Task::Locate => places.map(|&place| counted.locate.found[place]).sum(),
        }
    }
}

/// Times all contenders that counted right. `stop` ends the pass early (its
/// samples are then worthless and the result is `None`).
///
/// A sample whose number of ids differs from the count pass makes its
/// contender `wrong`.
pub fn timed_pass(
    task: Task,
    workload: &Workload,
    contenders: &[(&Built, &Counted)],
    protocol: &Protocol,
    stop: &dyn Fn() -> bool,
) -> Option<Vec<Result<Timed, Verdict>>> {
    let queries = Queries {
        task,
        workload,
        places: places(workload, contenders, protocol),
    };
    let count = queries.places.len();
    let mut results: Vec<Result<Timed, Verdict>> =
        contenders.iter().map(|_| Ok(Timed::default())).collect();
    if count == 0 {
        return Some(results);
    }
    let mut out = Vec::new();
    let mut sweep = Sweep::new(if protocol.cold {
        protocol.cache_bytes
    } else {
        0
    });
    let mut batches = Vec::with_capacity(contenders.len());
    for (built, _) in contenders {
        batches.push(if protocol.cold {
            1
        } else {
            batch_size(
                &queries,
                queries.index(built),
                protocol.overhead_ns,
                &mut out,
            )
        });
    }
    let mut dice = Dice::new(protocol.seed);
    let mut order: Vec<usize> = (0..contenders.len()).collect();
    let start = Instant::now();
    for round in 0..protocol.max_rounds {
        if round >= protocol.min_rounds && start.elapsed() > protocol.budget {
            break;
        }
        // A Latin square in random order: within every block of rounds each
        // contender takes every place once.
        if round % order.len().max(1) == 0 {
            for i in (1..order.len()).rev() {
                order.swap(i, dice.below(i + 1));
            }
        } else {
            order.rotate_left(1);
        }
        for &c in &order {
            if stop() {
                return None;
            }
            let (built, counted) = contenders[c];
            let index = queries.index(built);
            let Ok(timed) = &mut results[c] else { continue };
            if !protocol.cold {
                warm_up(&queries, index, batches[c], &mut out);
            }
            let mut wrong = None;
            for first in (0..count).step_by(batches[c]) {
                let range = first..(first + batches[c]).min(count);
                sweep.over_caches();
                let watch = Stopwatch::start();
                let returned = queries.ask(index, range.clone(), &mut out);
                let lap = watch.lap();
                let asked = range.len() as f64;
                let expected = queries.expected(counted, range.clone());
                if returned != expected {
                    wrong = Some(format!(
                        "the timed pass returned {returned} ids from camera {first} on, the count pass {expected}"
                    ));
                    break;
                }
                timed.samples.push(Sample {
                    round: round as u32,
                    frame: queries.places[first] as u32,
                    queries: range.len() as u32,
                    cpu_ns: lap.cpu_ns / asked,
                    wall_ns: lap.wall_ns / asked,
                    returned,
                });
            }
            timed.rounds = round + 1;
            if let Some(reason) = wrong {
                results[c] = Err(Verdict::new(Status::Wrong, reason));
            }
        }
    }
    Some(results)
}

/// The places along the path that are timed: all, or evenly thinned out so
/// that the slowest contender keeps to the length of a pass.
fn places(
    workload: &Workload,
    contenders: &[(&Built, &Counted)],
    protocol: &Protocol,
) -> Vec<usize> {
    let count = workload.volumes.len();
    let slowest = contenders
        .iter()
        .map(|(_, c)| c.slowest)
        .max()
        .unwrap_or_default();
    let whole = slowest.as_secs_f64() * count as f64;
    let mut stride = (whole / protocol.pass.as_secs_f64()).ceil().max(1.0) as usize;
    if protocol.cold {
        stride = stride.max(count.div_ceil(COLD_FRAMES));
    }
    // Never so few that a path is one view.
    let stride = stride.min((count / 8).max(1));
    (0..count).step_by(stride).collect()
}

/// The smallest power of two of queries that makes the harness negligible.
fn batch_size(
    queries: &Queries,
    index: &dyn DynIndex,
    overhead_ns: f64,
    out: &mut Vec<ItemId>,
) -> usize {
    let count = queries.places.len();
    let watch = Stopwatch::start();
    let (mut asked, started) = (0, Instant::now());
    while asked < count && (asked < 4 || started.elapsed() < WARM_UP) {
        queries.ask(index, asked..asked + 1, out);
        asked += 1;
    }
    let each = (watch.lap().cpu_ns / asked as f64).max(1.0);
    let needed = overhead_ns / (MOST_OVERHEAD * each);
    (needed.ceil().max(1.0) as usize)
        .next_power_of_two()
        .min(count)
}

fn warm_up(queries: &Queries, index: &dyn DynIndex, batch: usize, out: &mut Vec<ItemId>) {
    let started = Instant::now();
    for first in (0..queries.places.len()).step_by(batch) {
        queries.ask(index, first..(first + batch).min(queries.places.len()), out);
        if started.elapsed() > WARM_UP {
            break;
        }
    }
}

/// Something larger than the last cache, to be read between cold queries.
struct Sweep(Vec<u64>);

impl Sweep {
    fn new(bytes: usize) -> Self {
        Sweep(vec![1; bytes / size_of::<u64>()])
    }

    fn over_caches(&mut self) {
        // Written, not only read: shared zero pages would stay in one line.
        for line in self.0.chunks_mut(8) {
            line[0] = line[0].wrapping_add(1);
        }
        std::hint::black_box(&self.0);
    }
}

/// What the harness itself costs per clock reading: the very same loop over a
/// structure that does nothing. Nanoseconds of thread CPU time, median.
pub fn harness_overhead_ns() -> f64 {
    struct Nothing;
    impl DynIndex for Nothing {
        fn memory(&self) -> MemoryUsage {
            MemoryUsage::default()
        }
        fn see(&self, _: AnyView<'_>, _: &mut Vec<ItemId>) {}
        fn see_counted(&self, _: AnyView<'_>, _: &mut Vec<ItemId>, _: &mut QueryCost) {}
        fn locate(&self, _: Vec3, _: &mut Vec<ItemId>) {}
        fn locate_counted(&self, _: Vec3, _: &mut Vec<ItemId>, _: &mut QueryCost) {}
        fn refit(&mut self, _: &[Aabb], _: &[ItemId]) -> bool {
            false
        }
    }
    let Ok(volume) = ConvexVolume::from_planes(&[]) else {
        return 0.0;
    };
    let scene = Scene {
        name: String::new(),
        origin: glam::DVec3::ZERO,
        items: Vec::new(),
        bounds: Aabb::EMPTY,
        regions: Regions::Items,
        labels: Vec::new(),
        places: Vec::new(),
        skipped_items: 0,
        own_tree: None,
    };
    let workload = Workload {
        scene: &scene,
        path: String::new(),
        volumes: vec![volume],
        points: vec![Vec3::ZERO],
    };
    let queries = Queries {
        task: Task::Query,
        workload: &workload,
        places: vec![0],
    };
    let index: Box<dyn DynIndex> = Box::new(Nothing);
    let mut out = Vec::new();
    let laps: Vec<f64> = (0..4096)
        .map(|_| {
            let watch = Stopwatch::start();
            queries.ask(std::hint::black_box(index.as_ref()), 0..1, &mut out);
            watch.lap().cpu_ns
        })
        .collect();
    crate::statistics::median(&laps).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::PlaneOptions;
    use crate::index::StructureSpec;
    use crate::measure::{Contender, count_pass};
    use crate::path::{self, LensDefaults};
    use crate::scene;

    fn protocol() -> Protocol {
        Protocol {
            min_rounds: 3,
            max_rounds: 3,
            budget: Duration::ZERO,
            pass: Duration::from_millis(50),
            cold: false,
            seed: 1,
            overhead_ns: 200.0,
            cache_bytes: 1 << 20,
        }
    }

    /// Runs `check` on the timed pass of both structures over a small scene.
    fn timed(protocol: Protocol, tamper: bool) -> Vec<Result<Timed, Verdict>> {
        let scene = scene::load("city:n=500", &Default::default()).unwrap();
        let path = path::load("orbit:frames=40", &scene, &LensDefaults::default()).unwrap();
        let workload = Workload::new(&scene, &path, &PlaneOptions::default()).unwrap();
        let built: Vec<Built> = ["linear", "bvh"]
            .iter()
            .map(|name| {
                let spec = StructureSpec::parse(name).unwrap();
                Contender::build(spec, false, &scene).built.unwrap()
            })
            .collect();
        let mut counted = count_pass(&workload, &built.iter().collect::<Vec<_>>());
        assert!(counted.iter().all(|c| c.verdict == Verdict::ok()));
        if tamper {
            counted[1].frames[20].visible += 1;
        }
        let contenders: Vec<_> = built.iter().zip(&counted).collect();
        timed_pass(Task::Query, &workload, &contenders, &protocol, &|| false).unwrap()
    }

    #[test]
    fn every_round_covers_every_frame_once() {
        for cold in [false, true] {
            for timed in timed(Protocol { cold, ..protocol() }, false) {
                let timed = timed.unwrap();
                assert_eq!(timed.rounds, 3);
                for round in 0..3 {
                    let samples = timed.samples.iter().filter(|s| s.round == round);
                    let asked: u32 = samples.map(|s| s.queries).sum();
                    assert_eq!(asked, if cold { 20 } else { 40 });
                }
            }
        }
    }

    #[test]
    fn a_sample_that_disagrees_with_the_count_pass_is_wrong() {
        let results = timed(protocol(), true);
        assert!(results[0].is_ok());
        let verdict = results[1].as_ref().unwrap_err();
        assert_eq!(verdict.status, Status::Wrong);
    }

    #[test]
    fn short_queries_are_batched_until_the_harness_is_negligible() {
        let dear = Protocol {
            overhead_ns: 1e6,
            ..protocol()
        };
        let samples = &timed(dear, false)[1].as_ref().unwrap().samples.clone();
        assert!(
            samples.iter().all(|s| s.queries == 40),
            "one lap for the whole pass"
        );
        let free = Protocol {
            overhead_ns: 0.0,
            ..protocol()
        };
        let samples = &timed(free, false)[1].as_ref().unwrap().samples.clone();
        assert!(samples.iter().all(|s| s.queries == 1));
    }

    #[test]
    fn the_overhead_is_a_clock_reading() {
        let overhead = harness_overhead_ns();
        assert!(overhead > 0.0 && overhead < 100_000.0, "{overhead}");
    }
}
