//! Region search as a diagram of its own: a point and a region compared in f32,
//! in f32 with an exact look at the hits, in f64, and exactly. Its points, what
//! each way finds for them, and how wrong that is.

use glam::DVec3;
use serde::Serialize;

use super::judged::Shots;
use super::point::Times;
use crate::index::DynIndex;
use crate::measure::{OverProcesses, Status};
use crate::query::ItemId;
use crate::scene::{Regions, Scene, SeededRng, Sought};
use crate::statistics::{ALPHA, Rate, dominance, rate, shows_less};

named! {
    /// In which numbers a point and a region are compared.
    #[derive(Clone, Copy, PartialEq, Eq, Debug)]
    pub enum RegionNumbers {
        F32 = "f32",
        Checked = "f32 + check",
        F64 = "f64",
        Exact = "exact",
    }
}

/// Points that are searched for at each camera, asked as one query.
pub const POINTS_PER_CAMERA: usize = 16;
/// Of them those that lie anywhere in the scene; one is the eye, and the rest lie
/// within an ulp of f32 of a region's face.
const ANYWHERE: usize = 5;
const SEED: u64 = 18;

/// One way to search, with its error and its time.
#[derive(Clone, Debug, Serialize)]
pub struct RegionPoint {
    /// Label of the structure.
    pub structure: String,
    /// The numbers that points and regions are compared in.
    pub numbers: &'static str,
    /// How building, searching and timing ended.
    pub status: Status,
    /// Why, where the status is not ok.
    pub reason: Option<String>,
    /// Share of the points whose answer is not the exact one.
    pub wrong: Option<Rate>,
    /// Points that were searched for.
    pub points: u64,
    /// Regions that were returned though they do not hold the point, over all points.
    pub false_region_count: u64,
    /// Regions that hold the point and were not returned, over all points.
    pub missed_region_count: u64,
    /// How far outside its farthest false region a point lies, world units.
    pub worst_false: f64,
    /// Per point.
    #[serde(flatten)]
    pub times: Times,
    /// Index of a row that is no worse in anything and better in something.
    pub dominated_by: Option<usize>,
    /// Whether it is dominated by the values alone, and the samples do not show it.
    pub is_tie: bool,
    /// Whether no row dominates it.
    pub on_front: bool,
}

/// The points of every camera.
pub(super) struct RegionQueries {
    by_camera: Vec<Vec<Sought>>,
    /// Of the regions, in the world, rounded to f64.
    boxes: Vec<[DVec3; 2]>,
}

/// What is found by one kind of numbers, by camera and point, and how wrong it is.
pub(super) struct RegionJudged {
    pub numbers: RegionNumbers,
    answers: Vec<Vec<Vec<ItemId>>>,
    /// By camera: wrong answers, false regions, missed regions, worst.
    by_camera: Vec<[f64; 4]>,
}

fn boxes_of(scene: &Scene) -> Vec<[DVec3; 2]> {
    let originals = match &scene.regions {
        Regions::Tiling(tiling) => &tiling.originals,
        _ => &scene.originals,
    };
    match (&scene.regions, originals.boxes()) {
        (Regions::Items | Regions::Tiling(_), Some(written)) => {
            written.iter().map(|b| [b.min, b.max]).collect()
        }
        _ => {
            let stored = scene.regions.boxes(&scene.items).iter();
            let world = stored.map(|b| [b.min, b.max].map(|p| p.as_dvec3() + scene.origin));
            world.collect()
        }
    }
}

impl RegionQueries {
    pub fn new(scene: &Scene, shots: &Shots) -> RegionQueries {
        let boxes = boxes_of(scene);
        let mut rng = SeededRng::new(SEED);
        let bounds = boxes
            .iter()
            .copied()
            .reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
        let [low, high] = bounds.unwrap_or_default();
        let mut of_camera = |eye: DVec3| {
            let mut points = vec![scene.sought(eye)];
            for n in 1..POINTS_PER_CAMERA {
                let at = match boxes.get(rng.below(boxes.len())) {
                    Some(&b) if n >= ANYWHERE => beside_a_face(&mut rng, scene.origin, b),
                    _ => low + (high - low) * rng.point(),
                };
                points.push(scene.sought(at));
            }
            points
        };
        let eyes = shots.cameras.iter().map(|camera| camera.frame.eye);
        RegionQueries {
            by_camera: eyes.map(&mut of_camera).collect(),
            boxes,
        }
    }

    /// What the numbers find for a point, by a look at every region.
    fn found(&self, scene: &Scene, numbers: RegionNumbers, p: &Sought) -> Vec<ItemId> {
        match numbers {
            RegionNumbers::F32 => scene.regions.holding(p.local, &scene.items),
            RegionNumbers::Checked | RegionNumbers::Exact => scene.holding(p),
            RegionNumbers::F64 => {
                let mut found = Vec::new();
                self.in_f64(scene, p, &mut found);
                found
            }
        }
    }

    /// The point less the origin, rounded to f64, against the boxes as they are
    /// stored: a scan.
    fn in_f64(&self, scene: &Scene, p: &Sought, out: &mut Vec<ItemId>) {
        let mut local = p.world - scene.origin;
        if let Regions::Bsp(_) = scene.regions {
            local.z = 0.0;
        }
        let boxes = scene.regions.boxes(&scene.items).iter().zip(0..);
        out.extend(boxes.filter_map(|(b, id)| {
            let within = local.cmpge(b.min.as_dvec3()) & local.cmple(b.max.as_dvec3());
            within.all().then_some(id)
        }));
    }

    /// Answers query `camera`: the regions of all its points, appended.
    pub fn ask(
        &self,
        scene: &Scene,
        numbers: RegionNumbers,
        index: Option<&dyn DynIndex>,
        camera: usize,
        out: &mut Vec<ItemId>,
    ) {
        for p in &self.by_camera[camera] {
            match (numbers, index) {
                (RegionNumbers::F32, Some(index)) => index.locate(p.local, out),
                (RegionNumbers::Checked, Some(index)) => {
                    scene.search(p, out, |p, out| index.locate(p, out));
                }
                (RegionNumbers::F64, _) => self.in_f64(scene, p, out),
                _ => out.extend(scene.holding(p)),
            }
        }
    }

    /// What each kind of numbers finds, judged by the exact answer. O(points *
    /// regions).
    pub fn judged(&self, scene: &Scene) -> Vec<RegionJudged> {
        let truth: Vec<Vec<Vec<ItemId>>> = self.answers(scene, RegionNumbers::Exact);
        let of = |numbers| {
            let answers = self.answers(scene, numbers);
            let by_camera = answers.iter().zip(&truth).zip(&self.by_camera);
            let by_camera = by_camera.map(|((found, truth), points)| {
                let points = found.iter().zip(truth).zip(points);
                points.fold([0.0; 4], |sum, ((found, truth), p)| {
                    self.plus_errors(sum, p, found, truth)
                })
            });
            RegionJudged {
                numbers,
                by_camera: by_camera.collect(),
                answers,
            }
        };
        RegionNumbers::ALL.into_iter().map(of).collect()
    }

    fn answers(&self, scene: &Scene, numbers: RegionNumbers) -> Vec<Vec<Vec<ItemId>>> {
        let of = |points: &Vec<Sought>| {
            points
                .iter()
                .map(|p| self.found(scene, numbers, p))
                .collect()
        };
        self.by_camera.iter().map(of).collect()
    }

    fn plus_errors(
        &self,
        sum: [f64; 4],
        p: &Sought,
        found: &[ItemId],
        truth: &[ItemId],
    ) -> [f64; 4] {
        let [wrong, falsely, missed, worst] = sum;
        let beyond = |id: &&ItemId| !truth.contains(id);
        let extra: Vec<&ItemId> = found.iter().filter(beyond).collect();
        let lost = truth.iter().filter(|id| !found.contains(id)).count();
        let outside = extra.iter().map(|&&id| {
            let [min, max] = self.boxes[id as usize];
            (min - p.world).max(p.world - max).max_element().max(0.0)
        });
        [
            wrong + f64::from(!extra.is_empty() || lost > 0),
            falsely + extra.len() as f64,
            missed + lost as f64,
            outside.fold(worst, f64::max),
        ]
    }
}

/// A point in a region but for one axis, where it lies within an ulp of f32 of a
/// face, on either side.
fn beside_a_face(rng: &mut SeededRng, origin: DVec3, [low, high]: [DVec3; 2]) -> DVec3 {
    let mut at = low + (high - low) * rng.point();
    let axis = rng.below(3);
    let face = if rng.below(2) == 0 { low } else { high }[axis];
    let local = ((face - origin[axis]) as f32).abs();
    let ulp = f64::from(local.next_up()) - f64::from(local);
    at[axis] = face + rng.between(-1.0, 1.0) * ulp;
    at
}

impl RegionJudged {
    /// Ids of every query.
    pub fn counts(&self) -> Vec<u64> {
        let count = |points: &Vec<Vec<ItemId>>| points.iter().map(|ids| ids.len() as u64).sum();
        self.answers.iter().map(count).collect()
    }

    /// Whether what was found for a query, points in their order, is this answer.
    pub fn is_right(&self, camera: usize, found: &[ItemId]) -> bool {
        let mut rest = found;
        self.answers[camera].iter().all(|answer| {
            let Some((own, others)) = rest.split_at_checked(answer.len()) else {
                return false;
            };
            rest = others;
            let mut own = own.to_vec();
            own.sort_unstable();
            own == *answer
        }) && rest.is_empty()
    }

    pub fn point(&self, structure: &str) -> RegionPoint {
        let sum = |k: usize| self.by_camera.iter().map(|c| c[k]).sum::<f64>();
        let points = POINTS_PER_CAMERA as f64;
        let wrong: Vec<[f64; 2]> = self.by_camera.iter().map(|c| [c[0], points]).collect();
        RegionPoint {
            structure: structure.to_owned(),
            numbers: self.numbers.name(),
            status: match sum(2) > 0.0 {
                true => Status::Unsafe,
                false => Status::Ok,
            },
            reason: None,
            wrong: rate(&wrong),
            points: (self.by_camera.len() * POINTS_PER_CAMERA) as u64,
            false_region_count: sum(1) as u64,
            missed_region_count: sum(2) as u64,
            worst_false: self.by_camera.iter().map(|c| c[3]).fold(0.0, f64::max),
            times: Times::default(),
            dominated_by: None,
            is_tie: false,
            on_front: false,
        }
    }
}

/// Sorts the points by time and marks what is dominated: missed and false regions,
/// how far off, and time.
pub(super) fn conclude(points: &mut [RegionPoint], judged: &[RegionJudged], times: &OverProcesses) {
    points.sort_by(|a, b| a.times.order().total_cmp(&b.times.order()));
    let timed: Vec<usize> = (0..points.len())
        .filter(|&i| points[i].times.task.is_some())
        .collect();
    let values: Vec<[f64; 4]> = timed
        .iter()
        .map(|&i| {
            let p = &points[i];
            let (missed, falsely) = (p.missed_region_count as f64, p.false_region_count as f64);
            [missed, falsely, p.worst_false, p.times.order()]
        })
        .collect();
    let samples = |i: usize, k: usize| -> Vec<f64> {
        let name = points[timed[i]].numbers;
        let own = judged.iter().find(|judged| judged.numbers.name() == name);
        own.map_or_else(Vec::new, |own| own.by_camera.iter().map(|c| c[k]).collect())
    };
    let is_less = |a: usize, b: usize, k: usize| match k {
        3 => points[timed[a]]
            .times
            .is_faster(&points[timed[b]].times, times),
        _ => {
            let column = [2, 1, 3][k];
            shows_less(&samples(a, column), &samples(b, column), ALPHA)
        }
    };
    let found = dominance(&values, &is_less);
    for (&i, found) in timed.iter().zip(found) {
        points[i].dominated_by = found.dominated_by.map(|by| timed[by]);
        points[i].on_front = found.dominated_by.is_none();
        points[i].is_tie = found.is_tie;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::{self, LensDefaults};
    use crate::scene::WorldBox;

    /// Regions a metre wide at ten million, where f32 has steps of one.
    #[test]
    fn f32_is_wrong_far_away_and_a_look_at_the_hits_puts_it_right() {
        let far = DVec3::splat(1e7 + 0.3);
        let cell = |i: usize| {
            let at = far + DVec3::new((i % 20) as f64, (i / 20) as f64, 0.0);
            WorldBox::new(at, at + 1.0)
        };
        let boxes: Vec<WorldBox> = (0..400).map(cell).collect();
        let scene = Scene::about("far", &boxes, DVec3::ZERO).unwrap();
        let path = path::load("orbit:frames=12", &scene, &LensDefaults::default()).unwrap();
        let queries = RegionQueries::new(&scene, &Shots::of(&path, 12));
        let judged = queries.judged(&scene);
        let [f32s, checked, f64s, exact] = [0, 1, 2, 3].map(|i| judged[i].point("x"));
        assert!(
            f32s.wrong.unwrap().value > 0.2 && f32s.worst_false > 0.1,
            "{f32s:?}"
        );
        // The stored boxes are wider than the written ones.
        assert!(f64s.false_region_count > 0, "{f64s:?}");
        for right in [checked, exact] {
            let found = (right.false_region_count, right.missed_region_count);
            assert_eq!((found, right.worst_false), ((0, 0), 0.0));
            assert_eq!(right.wrong.unwrap().value, 0.0);
        }
        for judged in &judged {
            assert_eq!(judged.point("x").missed_region_count, 0);
            let mut out = Vec::new();
            queries.ask(&scene, judged.numbers, None, 3, &mut out);
            let loops = judged.numbers != RegionNumbers::F32;
            assert!(judged.is_right(3, &out) || !loops, "{:?}", judged.numbers);
            out.push(0);
            assert!(!judged.is_right(3, &out));
        }
    }
}
