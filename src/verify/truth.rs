//! Truth about a scene and a camera, item by item.
//!
//! Also measures how an answer differs from it: false negatives, dropped touches, false positives.
//! The verdicts come from the oracle; nothing is timed here.

use crate::camera::Camera;
use crate::geometry::Aabb;
use crate::oracle::{Oracle, Pose, Verdict};
use crate::query::ItemId;
use crate::scene::{Scene, WorldBox, WrittenBoxes};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Verdicts about all items of a scene, for one camera.
pub struct Truth {
    /// Oracle about the items as stored.
    oracle: Oracle,
    /// Oracle about the boxes as written, in world coordinates.
    ///
    /// `None` if the stored boxes are the same.
    written: Option<(Oracle, WrittenBoxes)>,
    /// Verdicts by item id.
    pub verdicts: Vec<Verdict>,
    /// Counts of the visible items, without errors.
    pub visible: ErrorCount,
}

/// How answers differ from the truth: sums over items and cameras.
///
/// Visible is what is in or touches; a touch that is dropped is counted apart
/// from a false negative.
#[derive(Clone, Copy, Default, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct ErrorCount {
    /// Items that are in or touch.
    #[serde(rename = "visible_count")]
    pub visible: u64,
    /// Items called a touch because the truth is not known more finely.
    #[serde(rename = "undecided_count")]
    pub undecided: u64,
    /// In, but not returned.
    #[serde(rename = "false_negative_count")]
    pub false_negatives: u64,
    /// Touching, but not returned.
    #[serde(rename = "touch_dropped_count")]
    pub touch_dropped: u64,
    /// Out, but returned.
    #[serde(rename = "false_positive_count")]
    pub false_positives: u64,
    /// False positives whose stored box is truly visible.
    ///
    /// The stored box is rounded outward to f32.
    #[serde(rename = "excess_by_storage_count", default)]
    pub by_storage: u64,
    /// Other false positives, due to the rounding and the moving of the planes.
    ///
    /// The six-plane test would drop them if the camera's planes were neither rounded nor
    /// moved; of the exact test all. The rest is the test's own.
    #[serde(rename = "excess_by_planes_count", default)]
    pub by_planes: u64,
    /// Depth of the deepest false negative in the volume, world units.
    ///
    /// 0 if there is none.
    pub worst_miss: f64,
    /// How far the farthest false positive stays away from it.
    pub worst_excess: f64,
}

impl ErrorCount {
    /// False positives per visible item; `None` if nothing is visible.
    pub fn excess(&self) -> Option<f64> {
        (self.visible > 0).then(|| self.false_positives as f64 / self.visible as f64)
    }

    /// Number of visible items that were not returned.
    pub fn dropped(&self) -> u64 {
        self.false_negatives + self.touch_dropped
    }

    /// False positives caused neither by storage nor by the planes.
    pub fn by_test(&self) -> u64 {
        let others = self.by_storage.saturating_add(self.by_planes);
        self.false_positives.saturating_sub(others)
    }

    /// False negatives per million visible items.
    pub fn false_negative_ppm(&self) -> Option<f64> {
        (self.visible > 0).then(|| self.false_negatives as f64 / self.visible as f64 * 1e6)
    }
}

impl std::ops::AddAssign for ErrorCount {
    fn add_assign(&mut self, other: ErrorCount) {
        self.visible += other.visible;
        self.undecided += other.undecided;
        self.false_negatives += other.false_negatives;
        self.touch_dropped += other.touch_dropped;
        self.false_positives += other.false_positives;
        self.by_storage += other.by_storage;
        self.by_planes += other.by_planes;
        self.worst_miss = self.worst_miss.max(other.worst_miss);
        self.worst_excess = self.worst_excess.max(other.worst_excess);
    }
}

impl std::iter::Sum for ErrorCount {
    fn sum<I: Iterator<Item = ErrorCount>>(all: I) -> ErrorCount {
        let mut sum = ErrorCount::default();
        all.for_each(|own| sum += own);
        sum
    }
}

impl Truth {
    /// Truth at camera level: exact camera, items as boxes relative to `origin`.
    ///
    /// O(items), some 50 ns each. `None` if the pose has no frame.
    pub fn of_camera(camera: &Camera, origin: DVec3, items: &[Aabb]) -> Option<Truth> {
        Truth::of_written(camera, origin, items, &WrittenBoxes::default())
    }

    /// Truth at camera level about the boxes of a scene as written.
    ///
    /// O(items). `None` if the pose has no frame.
    pub fn of_scene(camera: &Camera, scene: &Scene) -> Option<Truth> {
        Truth::of_written(camera, scene.origin, &scene.items, &scene.originals)
    }

    /// Truth about items that may have moved, as written; `items` are about `origin`.
    pub fn of_written(
        camera: &Camera,
        origin: DVec3,
        items: &[Aabb],
        originals: &WrittenBoxes,
    ) -> Option<Truth> {
        let of = |origin| Oracle::of_camera(&Pose::of(camera), &camera.lens, origin);
        let stored = of(origin)?;
        let written = match originals.boxes() {
            Some(_) => Some((of(DVec3::ZERO)?, originals.clone())),
            None => None,
        };
        Some(Truth::new(stored, written, items))
    }

    fn new(oracle: Oracle, written: Option<(Oracle, WrittenBoxes)>, items: &[Aabb]) -> Truth {
        let mut truth = Truth {
            oracle,
            written,
            verdicts: Vec::with_capacity(items.len()),
            visible: ErrorCount::default(),
        };
        for (id, item) in items.iter().enumerate() {
            let found = match truth.as_written(id) {
                Some((world, b)) => world.classify_f64(b.min, b.max),
                None => truth.oracle.classify(item),
            };
            truth.visible.visible += u64::from(found.verdict != Verdict::Out);
            truth.visible.undecided += u64::from(found.undecided);
            truth.verdicts.push(found.verdict);
        }
        truth
    }

    /// Depth of item `id`, as written, in the volume.
    pub fn depth(&self, id: usize, item: &Aabb) -> f64 {
        match self.as_written(id) {
            Some((world, b)) => world.depth_f64(b.min, b.max),
            None => self.oracle.depth(item),
        }
    }

    /// Box of an item as written, with the oracle for such boxes.
    ///
    /// `None` if f32 represents the box exactly.
    fn as_written(&self, id: usize) -> Option<(&Oracle, &WorldBox)> {
        let (world, originals) = self.written.as_ref()?;
        Some((world, originals.of_item(id)?))
    }

    /// Box of item `id` as written; `None` if f32 represents it exactly.
    pub fn original(&self, id: usize) -> Option<&WorldBox> {
        Some(self.as_written(id)?.1)
    }

    /// All items: id, verdict, and whether the answer contains the item.
    pub fn answered(&self, answer: &[ItemId]) -> impl Iterator<Item = (usize, Verdict, bool)> {
        let mut returned = vec![false; self.verdicts.len()];
        answer.iter().for_each(|&id| returned[id as usize] = true);
        let items = self.verdicts.iter().zip(returned).enumerate();
        items.map(|(id, (&verdict, returned))| (id, verdict, returned))
    }

    /// Items that are in but missing in the answer, with their depths in the volume.
    ///
    /// World units. O(items).
    pub fn misses(&self, items: &[Aabb], answer: &[ItemId]) -> Vec<(ItemId, f64)> {
        let answered = self.answered(answer);
        let missed = answered.filter(|(_, verdict, returned)| *verdict == Verdict::In && !returned);
        let deep = missed.map(|(id, ..)| (id as ItemId, self.depth(id, &items[id])));
        deep.collect()
    }

    /// Errors of an answer about the same items as the truth.
    ///
    /// The answer may be in any order, but without duplicates. O(items).
    pub fn errors(&self, items: &[Aabb], answer: &[ItemId]) -> ErrorCount {
        let mut count = self.visible;
        for (id, verdict, returned) in self.answered(answer) {
            let item = &items[id];
            match (verdict, returned) {
                (Verdict::In, false) => {
                    count.false_negatives += 1;
                    count.worst_miss = count.worst_miss.max(self.depth(id, item));
                }
                (Verdict::Touch, false) => count.touch_dropped += 1,
                (Verdict::Out, true) => {
                    count.false_positives += 1;
                    count.worst_excess = count.worst_excess.max(-self.depth(id, item));
                    if self.written.is_some() && self.oracle.verdict(item) != Verdict::Out {
                        count.by_storage += 1;
                    } else if self.oracle.faces_exclude(item) {
                        count.by_planes += 1;
                    }
                }
                _ => {}
            }
        }
        count
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Lens, MatrixConvention, look_at};
    use crate::geometry::{ConvexVolume, Plane};
    use crate::scene::WorldBox;
    use glam::Vec3;

    #[test]
    fn each_kind_of_error_is_told_apart() {
        let half = ConvexVolume::from_planes(&[Plane::new(Vec3::X, 0.0)]).unwrap();
        let cube = |x: f32| Aabb::around(Vec3::new(x, 0.0, 0.0), Vec3::ONE);
        // In, in, touching, out by one, out by four.
        let items = [cube(0.5), cube(5.0), cube(-1.0), cube(-2.0), cube(-5.0)];
        let truth = Truth::new(Oracle::of_volume(&half), None, &items);
        let wanted = [
            Verdict::In,
            Verdict::In,
            Verdict::Touch,
            Verdict::Out,
            Verdict::Out,
        ];
        assert_eq!(truth.verdicts, wanted);
        let perfect = truth.errors(&items, &[2, 1, 0]);
        assert_eq!((perfect.visible, perfect.excess()), (3, Some(0.0)));
        let poor = truth.errors(&items, &[0, 3, 4]);
        assert_eq!(poor.false_negatives, 1);
        assert_eq!((poor.touch_dropped, poor.false_positives), (1, 2));
        assert_eq!((poor.worst_miss, poor.worst_excess), (6.0, 4.0));
        // This volume's only plane excludes both.
        assert_eq!((poor.by_storage, poor.by_planes, poor.by_test()), (0, 2, 0));
        assert!((poor.false_negative_ppm().unwrap() - 1e6 / 3.0).abs() < 1e-6);
    }

    /// The first box lies outside a plane by less than f64 resolves.
    #[test]
    fn excess_is_put_down_to_planes_by_exact_sums() {
        let rows = [
            [0.0, 0.0, 0.001001001001001001, -1.0],
            [-0.9742785792574936, 0.0, 0.0, 0.0],
            [0.0, 1.7320508075688774, 0.0, 0.0],
            [0.0, 0.0, 0.10010010010010009, 0.0],
        ];
        let camera = Camera::of_matrix(rows, MatrixConvention::RowD3d).unwrap();
        let beside = WorldBox::new(
            DVec3::new(-100.00002523352248, -102.64636042094048, -839.8455706186825),
            DVec3::new(-100.00000000000001, -102.64004785593343, 1389.0507383728436),
        );
        let around = WorldBox::new(DVec3::splat(-1000.0), DVec3::splat(1000.0));
        let scene = Scene::about("two", &[beside, around], DVec3::ZERO).unwrap();
        let truth = Truth::of_scene(&camera, &scene).unwrap();
        let all = truth.errors(&scene.items, &[0, 1]);
        assert_eq!((all.visible, all.false_positives), (1, 1));
        assert_eq!((all.by_storage, all.by_planes), (0, 1));
    }

    /// Boxes of some metres near a camera 1e11 m from the origin.
    ///
    /// There f32 has steps of 8 km: the stored boxes are visible, the written ones are not.
    #[test]
    fn storage_is_an_error_of_its_own() {
        let far_away = DVec3::new(1e11, 0.0, 0.0);
        let beside = |y: f64| {
            let at = far_away + DVec3::new(5.0, y, 0.3);
            WorldBox::new(at, at + 0.7)
        };
        let boxes = [beside(-40.1), beside(30.2), beside(0.1)];
        let scene = Scene::about("far", &boxes, DVec3::ZERO).unwrap();
        let camera = Camera {
            frame: look_at(far_away, far_away + DVec3::X, DVec3::Z).unwrap(),
            lens: Lens::perspective(60.0, 1.0, 1.0, Some(100.0)).unwrap(),
        };
        let truth = Truth::of_scene(&camera, &scene).unwrap();
        assert_eq!(truth.verdicts, [Verdict::Out, Verdict::Out, Verdict::In]);
        let all = truth.errors(&scene.items, &[0, 1, 2]);
        assert_eq!((all.visible, all.false_positives), (1, 2));
        assert_eq!((all.by_storage, all.by_planes), (2, 0));
        assert!(
            all.worst_excess > 20.0 && all.worst_excess < 60.0,
            "{all:?}"
        );
        // As stored, all three boxes are visible, unlike the written ones.
        let stored = Truth::of_camera(&camera, scene.origin, &scene.items).unwrap();
        assert_eq!(stored.errors(&scene.items, &[0, 1, 2]).false_positives, 0);
    }
}
