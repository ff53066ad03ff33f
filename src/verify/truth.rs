//! The truth about a scene and a camera, item by item, and how an answer
//! differs from it: false negatives, dropped touches, false positives. The
//! verdicts are the oracle's; nothing is timed here.

use crate::camera::Camera;
use crate::geometry::Aabb;
use crate::oracle::{Oracle, Pose, Verdict};
use crate::query::ItemId;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// The verdict about every item of a scene, for one camera.
pub struct Truth {
    oracle: Oracle,
    verdicts: Vec<Verdict>,
    /// Items that touch, or come nearer than the truth is known.
    undecided: u64,
    visible: u64,
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
    /// How deep the deepest false negative reaches into the volume, world
    /// units; 0 if there is none.
    pub worst_miss: f64,
    /// How far the farthest false positive stays away from it.
    pub worst_excess: f64,
}

impl ErrorCount {
    /// False positives per visible item; `None` if nothing is visible.
    pub fn excess(&self) -> Option<f64> {
        (self.visible > 0).then(|| self.false_positives as f64 / self.visible as f64)
    }

    /// False negatives in a million visible items.
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
        self.worst_miss = self.worst_miss.max(other.worst_miss);
        self.worst_excess = self.worst_excess.max(other.worst_excess);
    }
}

impl Truth {
    /// Camera level: the camera's numbers are exact, items are boxes about
    /// `origin`. O(items), some 50 ns each. `None` if the pose makes no frame.
    pub fn of_camera(camera: &Camera, origin: DVec3, items: &[Aabb]) -> Option<Truth> {
        let oracle = Oracle::of_camera(&Pose::of(camera), &camera.lens, origin)?;
        Some(Truth::new(oracle, items))
    }

    /// The truth as an oracle has it.
    pub fn new(oracle: Oracle, items: &[Aabb]) -> Truth {
        let (mut undecided, mut visible) = (0, 0);
        let verdicts = items.iter().map(|item| {
            let judgement = oracle.judge(item);
            undecided += u64::from(judgement.undecided);
            visible += u64::from(judgement.verdict != Verdict::Out);
            judgement.verdict
        });
        Truth {
            verdicts: verdicts.collect(),
            oracle,
            undecided,
            visible,
        }
    }

    pub fn verdicts(&self) -> &[Verdict] {
        &self.verdicts
    }

    /// The errors of an answer (any order, no id twice) about the very items
    /// the truth was made of. O(items).
    pub fn errors(&self, items: &[Aabb], answer: &[ItemId]) -> ErrorCount {
        let mut count = ErrorCount {
            visible: self.visible,
            undecided: self.undecided,
            ..ErrorCount::default()
        };
        let mut returned = vec![false; items.len()];
        for &id in answer {
            returned[id as usize] = true;
        }
        for ((verdict, returned), item) in self.verdicts.iter().zip(returned).zip(items) {
            match (verdict, returned) {
                (Verdict::In, false) => {
                    count.false_negatives += 1;
                    count.worst_miss = count.worst_miss.max(self.oracle.depth(item));
                }
                (Verdict::Touch, false) => count.touch_dropped += 1,
                (Verdict::Out, true) => {
                    count.false_positives += 1;
                    count.worst_excess = count.worst_excess.max(-self.oracle.depth(item));
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
    use crate::geometry::{ConvexVolume, Plane};
    use glam::Vec3;

    #[test]
    fn each_kind_of_error_is_told_apart() {
        let half = ConvexVolume::from_planes(&[Plane::new(Vec3::X, 0.0)]).unwrap();
        let cube = |x: f32| Aabb::around(Vec3::new(x, 0.0, 0.0), Vec3::ONE);
        // In, in, touching, out by one, out by four.
        let items = [cube(0.5), cube(5.0), cube(-1.0), cube(-2.0), cube(-5.0)];
        let truth = Truth::new(Oracle::of_volume(&half), &items);
        let wanted = [
            Verdict::In,
            Verdict::In,
            Verdict::Touch,
            Verdict::Out,
            Verdict::Out,
        ];
        assert_eq!(truth.verdicts(), wanted);
        let perfect = truth.errors(&items, &[2, 1, 0]);
        assert_eq!((perfect.visible, perfect.excess()), (3, Some(0.0)));
        let poor = truth.errors(&items, &[0, 3, 4]);
        assert_eq!(poor.false_negatives, 1);
        assert_eq!((poor.touch_dropped, poor.false_positives), (1, 2));
        assert_eq!((poor.worst_miss, poor.worst_excess), (6.0, 4.0));
        assert!((poor.false_negative_ppm().unwrap() - 1e6 / 3.0).abs() < 1e-6);
    }
}
