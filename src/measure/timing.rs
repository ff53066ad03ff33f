//! The timed pass: rounds in balanced random order over all contenders, each
//! warmed up, several queries per clock reading where one is short. When it is
//! to be cold, the caches are streamed over before every camera's queries.

use std::time::{Duration, Instant};

use super::clock::Stopwatch;
use super::cold::Cold;
use super::competitor::Competitor;
use super::contender::guarded;
use super::orders::Orders;
use super::{Status, Verdict};
use crate::query::ItemId;

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

impl Timed {
    /// The samples of a round.
    pub fn of_round(&self, round: usize) -> impl Iterator<Item = &Sample> {
        let of_round = move |s: &&Sample| s.round as usize == round;
        self.samples.iter().filter(of_round)
    }

    /// Mean CPU time of a query in each round, ns.
    pub fn round_means(&self) -> Vec<f64> {
        (0..self.rounds)
            .map(|round| {
                let (mut spent, mut queries) = (0.0, 0.0);
                for s in self.of_round(round) {
                    spent += s.cpu_ns * f64::from(s.queries);
                    queries += f64::from(s.queries);
                }
                spent / queries
            })
            .filter(|mean| mean.is_finite())
            .collect()
    }
}

/// Times all competitors on `count` queries each. `stop` ends the pass early
/// (its samples are then worthless and the result is `None`).
///
/// A sample whose number of ids differs from what was expected makes its
/// competitor `wrong`.
pub fn timed_rounds(
    count: usize,
    competitors: &[Competitor],
    protocol: &Protocol,
    stop: &dyn Fn() -> bool,
) -> Option<Vec<Result<Timed, Verdict>>> {
    let places = places(count, competitors, protocol);
    let count = places.len();
    let results: Vec<Result<Timed, Verdict>> =
        competitors.iter().map(|_| Ok(Timed::default())).collect();
    if count == 0 {
        return Some(results);
    }
    let mut pass = Pass {
        places: &places,
        competitors,
        results,
    };
    let mut out = Vec::new();
    let batches: Vec<usize> = competitors
        .iter()
        .map(|c| match (&c.ask_many, protocol.cold) {
            (Some(_), _) => count,
            (None, true) => 1,
            // A panic is its verdict when its pass comes.
            (None, false) => {
                guarded(|| batch_size(c, &places, protocol.overhead_ns, &mut out)).unwrap_or(1)
            }
        })
        .collect();
    let mut cold = protocol.cold.then(|| Cold::new(protocol, competitors));
    let mut orders = Orders::new(competitors.len(), protocol.seed);
    let start = Instant::now();
    for round in 0..protocol.max_rounds {
        if round >= protocol.min_rounds && start.elapsed() > protocol.budget {
            break;
        }
        if let Some(cold) = &mut cold {
            for first in 0..count {
                if stop() {
                    return None;
                }
                cold.sweep.over_caches();
                // Whoever is first after the sweep finds the view cold as well:
                // a new order for each camera.
                for c in orders.next() {
                    let out = &mut cold.outs[c];
                    // Points that are asked at once come once a round.
                    if first % batches[c] == 0 {
                        pass.guarded(c, |pass| pass.time(c, round, first, batches[c], out));
                    }
                }
            }
        } else {
            for c in orders.next() {
                if stop() {
                    return None;
                }
                let competitor = &competitors[c];
                pass.guarded(c, |pass| {
                    warm_up(competitor, &places, batches[c], &mut out);
                    for first in (0..count).step_by(batches[c]) {
                        pass.time(c, round, first, batches[c], &mut out);
                    }
                });
            }
        }
    }
    Some(pass.results)
}

/// What the rounds of a pass fill in.
struct Pass<'p, 'a> {
    places: &'p [usize],
    competitors: &'p [Competitor<'a>],
    results: Vec<Result<Timed, Verdict>>,
}

impl Pass<'_, '_> {
    /// Does something for a competitor that has not failed yet; a panic on the
    /// way is its verdict.
    fn guarded(&mut self, c: usize, work: impl FnOnce(&mut Self)) {
        if self.results[c].is_err() {
            return;
        }
        if let Err(verdict) = guarded(|| work(self)) {
            self.results[c] = Err(verdict);
        }
    }

    /// Times competitor `c` on a batch of places from the `first` on, unless it
    /// has answered wrongly before.
    fn time(&mut self, c: usize, round: usize, first: usize, batch: usize, out: &mut Vec<ItemId>) {
        let competitor = &self.competitors[c];
        let Ok(timed) = &mut self.results[c] else {
            return;
        };
        let asked = &self.places[first..(first + batch).min(self.places.len())];
        let watch = Stopwatch::start();
        let returned = competitor.ask_all(asked, out);
        let lap = watch.lap();
        let queries = asked.len() as f64;
        let expected: u64 = asked.iter().map(|&place| competitor.expected[place]).sum();
        if returned != expected {
            self.results[c] = Err(Verdict::new(
                Status::Wrong,
                format!(
                    "the timed pass returned {returned} ids from camera {first} on, the count pass {expected}"
                ),
            ));
            return;
        }
        timed.samples.push(Sample {
            round: round as u32,
            frame: asked[0] as u32,
            queries: asked.len() as u32,
            cpu_ns: lap.cpu_ns / queries,
            wall_ns: lap.wall_ns / queries,
            returned,
        });
        timed.rounds = round + 1;
    }
}

/// The places along the path that are timed: all, or evenly thinned out so
/// that the slowest competitor keeps to the length of a pass.
fn places(count: usize, competitors: &[Competitor], protocol: &Protocol) -> Vec<usize> {
    let slowest = competitors
        .iter()
        .map(|c| c.slowest)
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
    competitor: &Competitor,
    places: &[usize],
    overhead_ns: f64,
    out: &mut Vec<ItemId>,
) -> usize {
    let count = places.len();
    let watch = Stopwatch::start();
    let (mut asked, started) = (0, Instant::now());
    while asked < count && (asked < 4 || started.elapsed() < WARM_UP) {
        competitor.ask_all(&places[asked..=asked], out);
        asked += 1;
    }
    let each = (watch.lap().cpu_ns / asked as f64).max(1.0);
    let needed = overhead_ns / (MOST_OVERHEAD * each);
    (needed.ceil().max(1.0) as usize)
        .next_power_of_two()
        .min(count)
}

fn warm_up(competitor: &Competitor, places: &[usize], batch: usize, out: &mut Vec<ItemId>) {
    let started = Instant::now();
    for places in places.chunks(batch) {
        competitor.ask_all(places, out);
        if started.elapsed() > WARM_UP {
            break;
        }
    }
}

/// What the harness itself costs per clock reading: the very same loop over a
/// competitor that does nothing. Nanoseconds of thread CPU time, median.
pub fn harness_overhead_ns() -> f64 {
    let nothing = Competitor {
        ask: Box::new(|_, _| ()),
        ask_many: None,
        expected: vec![0],
        slowest: Duration::ZERO,
    };
    let mut out = Vec::new();
    let laps: Vec<f64> = (0..4096)
        .map(|_| {
            let watch = Stopwatch::start();
            std::hint::black_box(&nothing).ask_all(&[0], &mut out);
            watch.lap().cpu_ns
        })
        .collect();
    crate::statistics::median(&laps).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::culling::{Culling, CullingTest};
    use crate::index::StructureSpec;
    use crate::measure::competitor::Task;
    use crate::measure::{Built, Contender, Workload, count_pass};
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
        let workload = Workload::new(&scene, &path, &Culling::default()).unwrap();
        let built: Vec<Built> = ["linear", "bvh"]
            .iter()
            .map(|name| {
                let spec = StructureSpec::parse(name).unwrap();
                Contender::build(spec, false, &scene, CullingTest::SixPlane)
                    .built
                    .unwrap()
            })
            .collect();
        let mut counted = count_pass(&workload, &built.iter().collect::<Vec<_>>());
        assert!(counted.iter().all(|c| c.verdict == Verdict::ok()));
        // Not what a loaded machine needed: how much is thinned out follows
        // from it.
        for counted in &mut counted {
            counted.slowest = Duration::from_micros(10);
        }
        if tamper {
            counted[1].frames[20].visible += 1;
        }
        let contenders: Vec<_> = built.iter().zip(&counted).collect();
        let tasks = [Task::Query, Task::LocateBatched];
        let competitors: Vec<Competitor> = tasks
            .iter()
            .flat_map(|&task| {
                let contenders = contenders.iter();
                let workload = &workload;
                contenders
                    .map(move |(built, counted)| Competitor::of(task, workload, built, counted))
            })
            .collect();
        let count = workload.views.len();
        let mut timed = timed_rounds(count, &competitors, &protocol, &|| false).unwrap();
        // A pass of the second task is one batch.
        for batched in timed.split_off(contenders.len()) {
            let batched = batched.unwrap();
            assert_eq!(batched.samples.len(), batched.rounds);
        }
        timed
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
    fn a_pass_that_would_take_too_long_is_thinned_out_for_all() {
        let slow = |slowest: Duration| Competitor {
            ask: Box::new(|_, _| ()),
            ask_many: None,
            expected: vec![0; 40],
            slowest,
        };
        let places = |slowest: [u64; 2]| {
            let competitors = slowest.map(|us| slow(Duration::from_micros(us)));
            places(40, &competitors, &protocol())
        };
        // 50 ms for 40 queries: 1250 us each.
        assert_eq!(places([10, 1250]), (0..40).collect::<Vec<_>>());
        assert_eq!(places([10, 1251]), (0..40).step_by(2).collect::<Vec<_>>());
        // However slow, a path is never fewer than eight views.
        assert_eq!(
            places([1_000_000, 10]),
            (0..40).step_by(5).collect::<Vec<_>>()
        );
    }

    #[test]
    fn a_sample_that_disagrees_with_the_count_pass_is_wrong() {
        let results = timed(protocol(), true);
        assert!(results[0].is_ok());
        let verdict = results[1].as_ref().unwrap_err();
        assert_eq!(verdict.status, Status::Wrong);
    }

    #[test]
    fn a_panic_is_the_verdict_of_its_competitor_alone() {
        let competitor = |panics_at: usize| Competitor {
            ask: Box::new(move |place, _| assert!(place < panics_at, "deep in a peer's code")),
            ask_many: None,
            expected: vec![0; 40],
            slowest: Duration::ZERO,
        };
        // In the pass itself, and before it, when the batch size is found.
        for panics_at in [39, 0] {
            let competitors = [competitor(40), competitor(panics_at)];
            let results = timed_rounds(40, &competitors, &protocol(), &|| false).unwrap();
            assert_eq!(results[0].as_ref().unwrap().rounds, 3);
            let verdict = results[1].as_ref().unwrap_err();
            assert_eq!(verdict.status, Status::Panicked);
            let reason = verdict.reason.as_deref().unwrap_or_default();
            assert!(reason.contains("deep in a peer's code"), "{reason}");
        }
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
