//! The points of the diagram for one scene and path: every structure with
//! every culling, checked, judged against the exact truth, and timed side by
//! side; which of them are dominated, and how many frames it takes until their
//! order stands.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use serde::{Serialize, Serializer};

use crate::camera::{Camera, PLANE_METHODS, PlaneMethod, PlaneOptions};
use crate::culling::{ARITHMETICS, Arithmetic, CameraView, Culling, CullingTest, TESTS};
use crate::geometry::Aabb;
use crate::index::{
    BuildError, DynIndex, GridScope, MemoryUsage, Quantised, QuantisedParams, RegionIndex,
    StructureSpec,
};
use crate::measure::{Competitor, Protocol, Status, Timed, Verdict, timed_rounds};
use crate::path::CameraPath;
use crate::query::ItemId;
use crate::scene::Scene;
use crate::statistics::{Estimate, bootstrap_median, median};
use crate::verify::{ErrorCount, Reference, Truth};

/// One way to answer, with its error and its time.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    pub structure: String,
    pub test: &'static str,
    pub arithmetic: &'static str,
    pub planes: &'static str,
    pub epsilon: f64,
    #[serde(serialize_with = "by_name")]
    pub status: Status,
    pub reason: Option<String>,
    /// False positives / visible items.
    pub excess: Option<f64>,
    pub false_negative_ppm: Option<f64>,
    #[serde(flatten)]
    pub errors: ErrorCount,
    /// Mean over the cameras, median over the rounds, thread CPU time.
    pub query_ns: Option<f64>,
    pub query_ns_lower: Option<f64>,
    pub query_ns_upper: Option<f64>,
    pub ns_per_item: Option<f64>,
    pub memory_bytes_per_item: Option<f64>,
    /// Index of a point that is no worse in anything and better in something.
    pub dominated_by: Option<usize>,
    pub on_front: bool,
}

fn by_name<S: Serializer>(status: &Status, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(status.name())
}

/// How well the order of all points by time, taken from a number of cameras,
/// agrees with the order from all of them.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct StableAfter {
    pub cameras: usize,
    /// Share of pairs of points that come in the same order.
    pub pairs_in_order: f64,
    /// CPU time that measuring this many took, all points and rounds.
    pub seconds: f64,
}

/// The diagram of a scene and path.
#[derive(Clone, Debug, Serialize)]
pub struct Precision {
    pub scene: String,
    pub path: String,
    pub items: usize,
    pub cameras: usize,
    pub rounds: usize,
    /// Largest |ratio - 1| of a structure entered twice with the default
    /// culling: smaller differences of time are ties.
    pub noise_floor: f64,
    /// Fastest first; what could not be measured comes last.
    pub points: Vec<Point>,
    /// Indices of the points that nothing dominates, fastest first.
    pub front: Vec<usize>,
    pub stability: Vec<StableAfter>,
}

/// Every test with every arithmetic, with and without epsilon; every
/// derivation of the planes for the six-plane test.
fn cullings() -> Vec<Culling> {
    let with = |epsilon: f64, method: PlaneMethod| PlaneOptions { method, epsilon };
    let standard = PlaneOptions::default();
    let mut all = Vec::new();
    for (test, ..) in TESTS {
        for (arithmetic, ..) in ARITHMETICS {
            let epsilons: &[f64] = match arithmetic {
                Arithmetic::F64 => &[0.0],
                _ => &[0.0, standard.epsilon],
            };
            for &epsilon in epsilons {
                let planes = with(epsilon, standard.method);
                all.push(Culling {
                    test,
                    arithmetic,
                    planes,
                });
            }
        }
    }
    for (method, ..) in PLANE_METHODS {
        if method != standard.method {
            all.push(Culling {
                planes: with(0.0, method),
                ..Culling::default()
            });
        }
    }
    all.retain(|culling| culling.check().is_ok());
    all
}

/// What one culling answers to every camera, and how wrong that is.
struct Judged {
    culling: Culling,
    views: Vec<CameraView>,
    answers: Vec<Vec<ItemId>>,
    errors: ErrorCount,
    refused: Option<String>,
}

impl Judged {
    fn refused(culling: Culling, error: &BuildError) -> Judged {
        Judged {
            culling,
            views: Vec::new(),
            answers: Vec::new(),
            errors: ErrorCount::default(),
            refused: Some(error.to_string()),
        }
    }

    /// Answers from `items`, judged by the truth about the scene's own.
    fn new(
        scene: &Scene,
        items: &[Aabb],
        cameras: &[Camera],
        truths: &[Truth],
        culling: Culling,
    ) -> Judged {
        let mut judged = Judged {
            culling,
            views: Vec::new(),
            answers: Vec::new(),
            errors: ErrorCount::default(),
            refused: None,
        };
        let around = scene.surroundings();
        for (camera, truth) in cameras.iter().zip(truths) {
            let view = match culling.view(camera, &around) {
                Ok(view) => view,
                Err(error) => {
                    judged.refused = Some(error.to_string());
                    return judged;
                }
            };
            let seen = items.iter().zip(0..).filter(|(b, _)| view.as_any().sees(b));
            let answer: Vec<ItemId> = seen.map(|(_, id)| id).collect();
            judged.errors += truth.errors(&scene.items, &answer);
            judged.views.push(view);
            judged.answers.push(answer);
        }
        judged
    }
}

/// A structure over the boxes and over the cubes of the sphere test.
struct Indexes {
    boxes: Box<dyn DynIndex>,
    cubes: Box<dyn DynIndex>,
}

impl Indexes {
    fn new(spec: &StructureSpec, scene: &Scene) -> Result<Indexes, BuildError> {
        let over = |test: CullingTest| {
            let items = test.items(&scene.items);
            spec.build_with(&items, scene.own_tree.as_ref())
        };
        Ok(Indexes {
            boxes: over(CullingTest::SixPlane)?,
            cubes: over(CullingTest::Sphere)?,
        })
    }

    fn of(&self, test: CullingTest) -> &dyn DynIndex {
        match test {
            CullingTest::Sphere => self.cubes.as_ref(),
            _ => self.boxes.as_ref(),
        }
    }
}

/// The experiment with items in few bits: an index, or none if the scene does
/// not fit.
struct Stored {
    label: String,
    index: Option<Box<dyn DynIndex>>,
    judged: Vec<Judged>,
}

/// u8 and u16 codes, on one grid or on one for each block, with the default
/// view and with the exact test.
fn quantised(scene: &Scene, cameras: &[Camera], truths: &[Truth]) -> Vec<Stored> {
    let cullings = [CullingTest::SixPlane, CullingTest::Exact].map(|test| Culling {
        test,
        ..Culling::default()
    });
    let mut all = Vec::new();
    for bits in [8, 16] {
        for grid in [GridScope::World, GridScope::Block] {
            let scope = match grid {
                GridScope::World => "world",
                GridScope::Block => "block",
            };
            let label = format!("{}:bits={bits},grid={scope}", Quantised::NAME);
            let params = QuantisedParams { bits, grid };
            let stored = match Quantised::build(&scene.items, None, &params) {
                Ok(index) => {
                    let items = index.decoded(scene.items.len());
                    let judged = cullings
                        .map(|culling| Judged::new(scene, &items, cameras, truths, culling));
                    Stored {
                        label,
                        index: Some(Box::new(index)),
                        judged: judged.into(),
                    }
                }
                Err(error) => Stored {
                    label,
                    index: None,
                    judged: cullings.map(|c| Judged::refused(c, &error)).into(),
                },
            };
            all.push(stored);
        }
    }
    all
}

/// The cameras that are looked at: at most `most`, evenly spread.
fn cameras_of(path: &CameraPath, most: usize) -> Vec<Camera> {
    let count = path.cameras.len();
    let wanted = most.max(1).min(count);
    let chosen = (0..wanted).map(|i| path.cameras[i * count / wanted]);
    chosen.collect()
}

/// Measures all points; `None` if stopped.
///
/// Every answer is compared with the plain loop before it is timed, and the
/// plain loop with the exact truth: O(cameras * items) verdicts of some 50 ns
/// and as many plain tests for each culling.
///
/// # Errors
/// A structure that refuses the scene.
pub fn measure_points(
    scene: &Scene,
    path: &CameraPath,
    structures: &[StructureSpec],
    most_cameras: usize,
    protocol: &Protocol,
    stop: &dyn Fn() -> bool,
) -> Result<Option<Precision>, BuildError> {
    let cameras = cameras_of(path, most_cameras);
    let truths = cameras.iter().filter_map(|camera| {
        // A frame always makes a pose.
        Truth::of_camera(camera, scene.origin, &scene.items)
    });
    let truths: Vec<Truth> = truths.collect();
    let mut judged = Vec::new();
    for culling in cullings() {
        if stop() {
            return Ok(None);
        }
        let items = culling.test.items(&scene.items);
        judged.push(Judged::new(scene, &items, &cameras, &truths, culling));
    }
    let quantised = quantised(scene, &cameras, &truths);
    drop(truths);
    let mut indexes = Vec::with_capacity(structures.len());
    for spec in structures {
        indexes.push(Indexes::new(spec, scene)?);
    }
    let mut points = Vec::new();
    // Which of the points are timed, in the order of the competitors.
    let mut timed_points = Vec::new();
    let mut competitors = Vec::new();
    for (spec, indexes) in structures.iter().zip(&indexes) {
        for judged in &judged {
            let index = indexes.of(judged.culling.test);
            let mut point = Point::new(&spec.label, judged);
            point.memory(index.memory(), scene.items.len());
            if judged.refused.is_none() {
                match checked(index, judged, scene.items.len()) {
                    Ok(slowest) => {
                        timed_points.push(points.len());
                        competitors.push(competitor(index, judged, slowest));
                    }
                    Err(wrong) => (point.status, point.reason) = (wrong.status, wrong.reason),
                }
            }
            points.push(point);
        }
    }
    for Stored {
        label,
        index,
        judged,
    } in &quantised
    {
        for judged in judged {
            let mut point = Point::new(label, judged);
            if let Some(index) = index {
                point.memory(index.memory(), scene.items.len());
                match checked(index.as_ref(), judged, scene.items.len()) {
                    Ok(slowest) => {
                        timed_points.push(points.len());
                        competitors.push(competitor(index.as_ref(), judged, slowest));
                    }
                    Err(wrong) => (point.status, point.reason) = (wrong.status, wrong.reason),
                }
            }
            points.push(point);
        }
    }
    // The default culling of every structure once more: what equal work looks
    // like in this run.
    let mut twins = Vec::new();
    for indexes in &indexes {
        let standard = judged.iter().find(|j| j.culling == Culling::default());
        if let Some(judged) = standard.filter(|j| j.refused.is_none()) {
            let index = indexes.of(judged.culling.test);
            twins.push(competitors.len());
            competitors.push(competitor(index, judged, Duration::ZERO));
        }
    }
    let Some(mut timed) = timed_rounds(cameras.len(), &competitors, protocol, stop) else {
        return Ok(None);
    };
    let competitor_count = competitors.len();
    drop(competitors);
    let twins = timed.split_off(competitor_count - twins.len());
    let mut rounds = 0;
    let mut series = Vec::new();
    for (&place, timed) in timed_points.iter().zip(&timed) {
        match timed {
            Ok(timed) => {
                rounds = rounds.max(timed.rounds);
                points[place].time(timed, scene.items.len());
                series.push(timed);
            }
            Err(wrong) => {
                points[place].status = wrong.status;
                points[place].reason = wrong.reason.clone();
            }
        }
    }
    let stability = stability(&series, cameras.len());
    let noise_floor = noise_floor(&points, &twins);
    points.sort_by(|a, b| {
        let key = |p: &Point| p.query_ns.unwrap_or(f64::INFINITY);
        key(a).total_cmp(&key(b))
    });
    mark_dominated(&mut points, noise_floor);
    Ok(Some(Precision {
        scene: scene.name.clone(),
        path: path.name.clone(),
        items: scene.items.len(),
        cameras: cameras.len(),
        rounds,
        noise_floor,
        front: (0..points.len()).filter(|&i| points[i].on_front).collect(),
        points,
        stability,
    }))
}

fn competitor<'a>(
    index: &'a dyn DynIndex,
    judged: &'a Judged,
    slowest: Duration,
) -> Competitor<'a> {
    Competitor {
        ask: Box::new(move |n, out| index.see(judged.views[n].as_any(), out)),
        expected: judged.answers.iter().map(|a| a.len() as u64).collect(),
        slowest,
    }
}

/// Asks every query once; the slowest one's wall time, or what was wrong.
fn checked(index: &dyn DynIndex, judged: &Judged, items: usize) -> Result<Duration, Verdict> {
    let mut reference = Reference::new(items);
    let (mut out, mut slowest) = (Vec::new(), Duration::ZERO);
    for (view, answer) in judged.views.iter().zip(&judged.answers) {
        reference.expect(answer.iter().copied());
        out.clear();
        let start = Instant::now();
        index.see(view.as_any(), &mut out);
        slowest = slowest.max(start.elapsed());
        let difference = reference.compare(&out);
        if !difference.is_none() {
            return Err(Verdict::new(Status::Wrong, difference.to_string()));
        }
    }
    Ok(slowest)
}

impl Point {
    fn new(structure: &str, judged: &Judged) -> Point {
        let (culling, errors) = (&judged.culling, judged.errors);
        let refused = judged.refused.is_some();
        Point {
            structure: structure.to_owned(),
            test: culling.test.name(),
            arithmetic: culling.arithmetic.name(),
            planes: culling.planes.method.name(),
            epsilon: culling.planes.epsilon,
            status: match refused {
                true => Status::Refused,
                false if errors.false_negatives > 0 => Status::Unsafe,
                false => Status::Ok,
            },
            reason: judged.refused.clone(),
            excess: errors.excess().filter(|_| !refused),
            false_negative_ppm: errors.false_negative_ppm().filter(|_| !refused),
            errors,
            query_ns: None,
            query_ns_lower: None,
            query_ns_upper: None,
            ns_per_item: None,
            memory_bytes_per_item: None,
            dominated_by: None,
            on_front: false,
        }
    }

    fn memory(&mut self, usage: MemoryUsage, items: usize) {
        self.memory_bytes_per_item = (items > 0).then(|| usage.total() as f64 / items as f64);
    }

    fn time(&mut self, timed: &Timed, items: usize) {
        let Some(Estimate {
            value,
            lower,
            upper,
        }) = bootstrap_median(&timed.round_means(), 1)
        else {
            return;
        };
        self.query_ns = Some(value);
        self.query_ns_lower = Some(lower);
        self.query_ns_upper = Some(upper);
        self.ns_per_item = (items > 0).then(|| value / items as f64);
    }

    /// No worse in any error and no slower, and better in one of them. Times
    /// whose intervals come within the noise floor of each other are equal:
    /// what noise decides is no advantage.
    fn dominates(&self, other: &Point, floor: f64) -> bool {
        let (Some(upper), Some(other_lower)) = (self.query_ns_upper, other.query_ns_lower) else {
            return false;
        };
        let (Some(lower), Some(other_upper)) = (self.query_ns_lower, other.query_ns_upper) else {
            return false;
        };
        let of = |p: &Point| {
            let e = p.errors;
            [e.false_negatives, e.touch_dropped, e.false_positives]
        };
        let (mine, others) = (of(self), of(other));
        let no_worse = mine.iter().zip(&others).all(|(a, b)| a <= b);
        let faster = upper * (1.0 + floor) < other_lower;
        let not_slower = lower <= other_upper * (1.0 + floor);
        no_worse && not_slower && (faster || mine != others)
    }
}

/// How far apart a structure and its twin lie at most.
fn noise_floor(points: &[Point], twins: &[Result<Timed, Verdict>]) -> f64 {
    let standard = Culling::default();
    let originals = points.iter().filter(|p| {
        p.test == standard.test.name()
            && p.arithmetic == standard.arithmetic.name()
            && p.planes == standard.planes.method.name()
            && p.epsilon == standard.planes.epsilon
    });
    let mut floor = 0.0f64;
    for (original, twin) in originals.zip(twins) {
        let again = twin.as_ref().ok().and_then(|t| median(&t.round_means()));
        if let (Some(first), Some(again)) = (original.query_ns, again) {
            floor = floor.max((again / first - 1.0).abs());
        }
    }
    floor
}

fn mark_dominated(points: &mut [Point], floor: f64) {
    for i in 0..points.len() {
        let better = (0..points.len()).find(|&k| points[k].dominates(&points[i], floor));
        points[i].on_front = better.is_none() && points[i].query_ns.is_some();
        points[i].dominated_by = better;
    }
}

/// The order of the points by time from the first 1, 2, 4, .. cameras of an
/// evenly spread order, against the order from all.
fn stability(series: &[&Timed], cameras: usize) -> Vec<StableAfter> {
    // Per point and camera: median over the rounds.
    let by_camera: Vec<BTreeMap<u32, f64>> = series
        .iter()
        .map(|timed| {
            let mut laps: BTreeMap<u32, Vec<f64>> = BTreeMap::new();
            for (i, sample) in timed.samples.iter().enumerate() {
                // A sample is the mean over its batch and stands for all
                // cameras up to the next: points have batches of their own.
                let next = timed.samples.get(i + 1);
                let next = next.filter(|next| next.round == sample.round);
                let end = next.map_or(cameras as u32, |next| next.frame);
                for camera in sample.frame..end {
                    laps.entry(camera).or_default().push(sample.cpu_ns);
                }
            }
            let medians = laps
                .into_iter()
                .filter_map(|(c, ns)| Some((c, median(&ns)?)));
            medians.collect()
        })
        .collect();
    let spent = |of: &BTreeMap<u32, f64>, wanted: &dyn Fn(u32) -> bool| -> f64 {
        of.iter()
            .filter(|(c, _)| wanted(**c))
            .map(|(_, ns)| ns)
            .sum()
    };
    let all: Vec<f64> = by_camera.iter().map(|of| spent(of, &|_| true)).collect();
    let rounds = series.iter().map(|t| t.rounds).max().unwrap_or(0);
    let mut rows = Vec::new();
    let mut count = 1;
    while count < 2 * cameras {
        let used = count.min(cameras);
        let chosen = |camera: u32| (camera as usize * used) % cameras < used;
        let some: Vec<f64> = by_camera.iter().map(|of| spent(of, &chosen)).collect();
        let pairs = (0..all.len()).flat_map(|i| (i + 1..all.len()).map(move |k| (i, k)));
        let (mut same, mut total) = (0u64, 0u64);
        for (i, k) in pairs {
            total += 1;
            same += u64::from((some[i] < some[k]) == (all[i] < all[k]));
        }
        rows.push(StableAfter {
            cameras: used,
            pairs_in_order: if total == 0 {
                1.0
            } else {
                same as f64 / total as f64
            },
            seconds: some.iter().sum::<f64>() * rounds as f64 / 1e9,
        });
        count *= 2;
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::Sample;

    /// A point with false negatives, dropped touches and false positives, and
    /// the interval of its time.
    fn point(errors: [u64; 3], time: [f64; 2]) -> Point {
        let [false_negatives, touch_dropped, false_positives] = errors;
        Point {
            structure: "linear".to_owned(),
            test: "six-plane",
            arithmetic: "f32",
            planes: "frame",
            epsilon: 0.0,
            status: Status::Ok,
            reason: None,
            excess: None,
            false_negative_ppm: None,
            errors: ErrorCount {
                false_negatives,
                touch_dropped,
                false_positives,
                ..ErrorCount::default()
            },
            query_ns: Some((time[0] + time[1]) / 2.0),
            query_ns_lower: Some(time[0]),
            query_ns_upper: Some(time[1]),
            ns_per_item: None,
            dominated_by: None,
            on_front: false,
        }
    }

    #[test]
    fn times_that_overlap_are_equal_and_errors_are_not_traded() {
        let (none, some) = ([0, 0, 5], [0, 0, 9]);
        let cases = [
            // Equal errors: only what is clearly faster dominates.
            (none, [1.0, 2.0], none, [3.0, 4.0], [true, false]),
            (none, [1.0, 3.0], none, [2.0, 4.0], [false, false]),
            (none, [1.0, 2.0], none, [2.0, 4.0], [false, false]),
            // A tie in time is decided by the errors.
            (none, [1.0, 3.0], some, [2.0, 4.0], [true, false]),
            (none, [2.0, 4.0], some, [1.0, 3.0], [true, false]),
            // Fewer errors for more time: both stay.
            (none, [5.0, 6.0], some, [1.0, 2.0], [false, false]),
            // One error more, another one fewer: both stay, however fast.
            ([1, 0, 0], [1.0, 2.0], [0, 0, 9], [5.0, 6.0], [false, false]),
            ([0, 1, 0], [1.0, 2.0], [0, 0, 9], [5.0, 6.0], [false, false]),
            ([0, 1, 9], [5.0, 6.0], [0, 1, 8], [1.0, 2.0], [false, true]),
        ];
        for (errors_a, time_a, errors_b, time_b, wanted) in cases {
            let (a, b) = (point(errors_a, time_a), point(errors_b, time_b));
            let found = [a.dominates(&b), b.dominates(&a)];
            assert_eq!(found, wanted, "{:?}", (errors_a, time_a, errors_b, time_b));
        }
    }

    #[test]
    fn the_front_is_what_nothing_dominates() {
        let mut points = [
            point([0, 0, 9], [1.0, 2.0]),
            point([0, 0, 9], [1.5, 2.5]),
            point([0, 0, 9], [3.0, 4.0]),
            point([0, 0, 0], [5.0, 6.0]),
            point([0, 0, 1], [5.0, 6.0]),
            point([0, 0, 0], [0.0, 0.0]),
        ];
        // One that was never timed has no say and no place.
        let untimed = &mut points[5];
        (untimed.query_ns, untimed.query_ns_lower) = (None, None);
        untimed.query_ns_upper = None;
        mark_dominated(&mut points);
        assert_eq!(
            points.each_ref().map(|p| p.dominated_by),
            [None, None, Some(0), None, Some(3), None]
        );
        assert_eq!(
            points.each_ref().map(|p| p.on_front),
            [true, true, false, true, false, false]
        );
    }

    /// Two rounds; each number is the mean of a batch of so many cameras.
    fn timed(batches: &[f64], queries: u32) -> Timed {
        let sample = |round: u32, i: usize| Sample {
            round,
            frame: i as u32 * queries,
            queries,
            cpu_ns: batches[i],
            wall_ns: batches[i],
            returned: 0,
        };
        let all = (0..2).flat_map(|round| (0..batches.len()).map(move |i| sample(round, i)));
        Timed {
            samples: all.collect(),
            rounds: 2,
        }
    }

    #[test]
    fn the_order_is_compared_with_the_one_from_all_cameras() {
        // The first is slower from the first camera (0), even from two (0 and
        // 2), and faster from all.
        let (a, b) = (timed(&[10.0, 1.0, 1.0, 1.0], 1), timed(&[5.0; 4], 1));
        let rows = stability(&[&a, &b], 4);
        let shares: Vec<_> = rows.iter().map(|r| (r.cameras, r.pairs_in_order)).collect();
        assert_eq!(shares, [(1, 0.0), (2, 0.0), (4, 1.0)]);
        let spent: Vec<f64> = rows.iter().map(|r| (r.seconds * 1e9).round()).collect();
        assert_eq!(spent, [30.0, 42.0, 66.0]);
        // Not a power of two: the last row is all of them.
        let c = timed(&[3.0, 2.0, 1.0], 1);
        let counts: Vec<_> = stability(&[&c], 3).iter().map(|r| r.cameras).collect();
        assert_eq!(counts, [1, 2, 3]);
    }

    #[test]
    fn points_with_batches_of_their_own_are_compared_camera_by_camera() {
        // All in one lap: the mean is 6 a camera, 24 in all, against 20.
        let (batched, single) = (timed(&[6.0], 4), timed(&[5.0; 4], 1));
        let rows = stability(&[&batched, &single], 4);
        assert!(rows.iter().all(|r| r.pairs_in_order == 1.0), "{rows:?}");
        assert_eq!((rows[2].seconds * 1e9).round(), 88.0);
    }
}
