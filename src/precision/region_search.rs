//! Errors and times of region search in four arithmetics.
//!
//! A point is compared with regions in f32, in f32 with an exact test of the hits, in f64,
//! and exactly.

use std::collections::BTreeSet;
use std::ops::Add;

use glam::DVec3;
use serde::Serialize;

use super::judged::Shots;
use super::point::{Dimension, Point};
use crate::index::DynIndex;
use crate::measure::Status;
use crate::query::ItemId;
use crate::scene::{Regions, Scene, SeededRng, Sought};
use crate::statistics::{Rate, rate};
use crate::verify::scan;

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
/// Points per camera before those near faces: the eye, and points anywhere in the
/// scene. The rest lie within an ulp of f32 of a region's face.
const ANYWHERE: usize = 5;
const SEED: u64 = 18;

/// Errors of a way to search, over all points.
#[derive(Clone, Debug, Serialize)]
pub struct RegionErrors {
    /// The numbers that points and regions are compared in.
    pub numbers: &'static str,
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
}

/// Numbers and index of a search; without an index it looks at every region.
pub(super) type By<'i> = (RegionNumbers, Option<&'i dyn DynIndex>);

/// The points of every camera.
pub(super) struct RegionQueries<'a> {
    scene: &'a Scene,
    by_camera: Vec<Vec<Sought>>,
    /// Boxes of the regions, in the world, rounded to f64.
    boxes: Vec<[DVec3; 2]>,
}

/// Answers in one kind of numbers, and their errors.
pub(super) struct RegionJudged {
    numbers: RegionNumbers,
    /// Slots of each camera, ascending.
    pub answers: Vec<Vec<ItemId>>,
    /// Wrong answers, false regions, missed regions and worst of each camera.
    by_camera: Vec<[f64; 4]>,
}

fn boxes_of(scene: &Scene) -> Vec<[DVec3; 2]> {
    let originals = scene.region_originals().boxes();
    if let (Regions::Items | Regions::Tiling(_), Some(written)) = (&scene.regions, originals) {
        return written.iter().map(|b| [b.min, b.max]).collect();
    }
    let stored = scene.regions.boxes(&scene.items).iter();
    let world = stored.map(|b| [b.min, b.max].map(|p| p.as_dvec3() + scene.origin));
    world.collect()
}

impl RegionQueries<'_> {
    pub fn new<'a>(scene: &'a Scene, shots: &Shots) -> RegionQueries<'a> {
        let boxes = boxes_of(scene);
        let mut rng = SeededRng::new(SEED);
        let corners = boxes.iter().copied();
        let bounds = corners.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
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
            scene,
            by_camera: eyes.map(&mut of_camera).collect(),
            boxes,
        }
    }

    /// Returns whether a search in these numbers may be compared with the exact one.
    ///
    /// Boxes of a map's leaves are candidates: in one and not in its leaf is no rounding.
    pub fn compares(&self, numbers: RegionNumbers) -> bool {
        let is_checked = matches!(numbers, RegionNumbers::Checked | RegionNumbers::Exact);
        is_checked || matches!(self.scene.regions, Regions::Items | Regions::Tiling(_))
    }

    /// Appends the regions that are found for a point.
    fn find(&self, by: By, p: &Sought, out: &mut Vec<ItemId>) {
        let scene = self.scene;
        match by {
            (RegionNumbers::F32, Some(index)) => index.locate(p.local, out),
            (RegionNumbers::F32, None) => out.extend(scene.regions.holding(p.local, &scene.items)),
            (RegionNumbers::Checked, Some(index)) => {
                scene.search(p, out, |p, out| index.locate(p, out));
            }
            (RegionNumbers::F64, _) => self.find_in_f64(p, out),
            _ => out.extend(scene.holding(p)),
        }
    }

    /// The point less the origin, rounded to f64, against the boxes as they are
    /// stored: a scan.
    fn find_in_f64(&self, p: &Sought, out: &mut Vec<ItemId>) {
        let scene = self.scene;
        let local = p.world - scene.origin;
        out.extend(scan(scene.regions.boxes(&scene.items), |b| {
            (local.cmpge(b.min.as_dvec3()) & local.cmple(b.max.as_dvec3())).all()
        }));
    }

    /// Appends the regions of all points of a camera.
    pub fn answer(&self, by: By, camera: usize, out: &mut Vec<ItemId>) {
        for p in &self.by_camera[camera] {
            self.find(by, p, out);
        }
    }

    /// Slots of a camera, ascending, one per point and region that it is found in.
    ///
    /// A slot is the id of the region plus the number of regions times the index of the
    /// point.
    fn slots(&self, by: By, camera: usize) -> Vec<ItemId> {
        let mut slots = Vec::new();
        for (n, p) in (0..).zip(&self.by_camera[camera]) {
            let first = slots.len();
            self.find(by, p, &mut slots);
            let regions = self.boxes.len() as ItemId;
            slots[first..].iter_mut().for_each(|id| *id += n * regions);
        }
        slots.sort_unstable();
        slots
    }

    /// Tests that an index returns the answers of the same numbers by a scan.
    pub fn agree(&self, judged: &RegionJudged, index: Option<&dyn DynIndex>) -> bool {
        let answers = (0..).zip(&judged.answers);
        let mut found = answers.map(|(n, own)| self.slots((judged.numbers, index), n) == *own);
        found.all(|is_same| is_same)
    }

    /// Answers in every kind of numbers, judged by the exact one. O(points * regions).
    pub fn judged(&self) -> Vec<RegionJudged> {
        let cameras = || 0..self.by_camera.len();
        let by_scan = |numbers| cameras().map(move |n| self.slots((numbers, None), n));
        let truth: Vec<Vec<ItemId>> = by_scan(RegionNumbers::Exact).collect();
        let of = |numbers| {
            let answers: Vec<Vec<ItemId>> = by_scan(numbers).collect();
            let errors = cameras().map(|n| self.errors(n, &answers[n], &truth[n]));
            RegionJudged {
                numbers,
                by_camera: errors.collect(),
                answers,
            }
        };
        RegionNumbers::ALL.map(of).into()
    }

    fn errors(&self, camera: usize, found: &[ItemId], truth: &[ItemId]) -> [f64; 4] {
        let apart = |a: &[ItemId], b: &[ItemId]| -> Vec<(usize, usize)> {
            let lone = a.iter().filter(|slot| b.binary_search(slot).is_err());
            let (slots, regions) = (lone.map(|&slot| slot as usize), self.boxes.len());
            slots.map(|s| (s / regions, s % regions)).collect()
        };
        let (extra, lost) = (apart(found, truth), apart(truth, found));
        let wrong: BTreeSet<usize> = extra.iter().chain(&lost).map(|slot| slot.0).collect();
        let outside = extra.iter().map(|&(point, region)| {
            let (p, [min, max]) = (self.by_camera[camera][point].world, self.boxes[region]);
            (min - p).max(p - max).max_element()
        });
        let counts = [wrong.len(), extra.len(), lost.len()].map(|count| count as f64);
        [counts[0], counts[1], counts[2], outside.fold(0.0, f64::max)]
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
    /// The errors of these numbers as a point of a structure, without a time.
    pub fn point(&self, structure: &str) -> Point<RegionErrors> {
        let column = |k: usize| self.by_camera.iter().map(move |c| c[k]);
        let (falsely, missed) = (column(1).sum::<f64>(), column(2).sum::<f64>());
        let worst_false = column(3).fold(0.0, f64::max);
        let wrong: Vec<[f64; 2]> = column(0).map(|n| [n, POINTS_PER_CAMERA as f64]).collect();
        let errors = RegionErrors {
            numbers: self.numbers.name(),
            wrong: rate(&wrong).map(Rate::of_share),
            points: (self.by_camera.len() * POINTS_PER_CAMERA) as u64,
            false_region_count: falsely as u64,
            missed_region_count: missed as u64,
            worst_false,
        };
        let dimensions = vec![
            Dimension::of(column(2), f64::add),
            Dimension::of(column(1), f64::add),
            Dimension::of(column(3), f64::max),
        ];
        let mut point = Point::new(structure, errors, dimensions);
        if missed > 0.0 {
            point.status = Status::Unsafe;
        }
        point
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
        let mut judged = queries.judged();
        let [f32s, checked, f64s, exact] = [0, 1, 2, 3].map(|i| judged[i].point("x").errors);
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
        for judged in &mut judged {
            assert_eq!(judged.point("x").errors.missed_region_count, 0);
            assert!(queries.agree(judged, None), "{:?}", judged.numbers);
            judged.answers[3].push(0);
            assert!(!queries.agree(judged, None));
        }
    }
}
