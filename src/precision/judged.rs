//! What a culling answers to every camera by the plain loop, and how wrong that
//! is. No structure and no clock.

use super::plane_test::{PlaneTest, PointView};
use crate::camera::Camera;
use crate::culling::CullingTest;
use crate::geometry::Aabb;
use crate::index::BuildError;
use crate::path::CameraPath;
use crate::query::ItemId;
use crate::scene::Scene;
use crate::statistics::{Rate, rate};
use crate::verify::{ErrorCount, Truth};

/// The cameras that are looked at, evenly spread over a path, and behind each of
/// them its neighbour on the path, for what changes from frame to frame.
pub(super) struct Shots {
    pub cameras: Vec<Camera>,
    /// As many, or none for a path of one camera.
    neighbours: Vec<Camera>,
}

impl Shots {
    pub fn of(path: &CameraPath, most: usize) -> Shots {
        let count = path.cameras.len();
        let wanted = most.max(1).min(count);
        let chosen = (0..wanted).map(|i| i * count / wanted);
        // The last one's is the one before it.
        let beside = |i: usize| {
            if i + 1 < count {
                Some(i + 1)
            } else {
                i.checked_sub(1)
            }
        };
        Shots {
            cameras: chosen.clone().map(|i| path.cameras[i]).collect(),
            neighbours: chosen.filter_map(beside).map(|i| path.cameras[i]).collect(),
        }
    }

    /// O(cameras * items) verdicts of some 50 ns. A frame always makes a pose.
    pub fn truths(&self, scene: &Scene) -> Truths {
        let of = |cameras: &[Camera]| {
            let truths = cameras.iter().filter_map(|c| Truth::of_scene(c, scene));
            truths.collect()
        };
        Truths {
            cameras: of(&self.cameras),
            neighbours: of(&self.neighbours),
        }
    }
}

/// The truth about each camera and its neighbour.
pub(super) struct Truths {
    cameras: Vec<Truth>,
    neighbours: Vec<Truth>,
}

/// What one camera's answer gets wrong.
#[derive(Clone, Copy, Default)]
pub(super) struct CameraErrors {
    pub errors: ErrorCount,
    /// How deep the deepest false negative reaches into the view, in pixels of
    /// 1080p; 0 if there is none.
    pub worst_miss_px: f64,
    /// Items whose answer changes to the neighbour while their truth does not.
    pub flicker: Option<u64>,
}

/// What one culling answers to every camera, and how wrong that is.
pub(super) struct Judged {
    pub test: PlaneTest,
    pub views: Vec<PointView>,
    pub answers: Vec<Vec<ItemId>>,
    /// By camera; nothing without a truth.
    pub by_camera: Vec<CameraErrors>,
    pub refused: Option<String>,
}

impl Judged {
    fn without_views(test: PlaneTest) -> Judged {
        Judged {
            test,
            views: Vec::new(),
            answers: Vec::new(),
            by_camera: Vec::new(),
            refused: None,
        }
    }

    pub fn refused(test: PlaneTest, error: &BuildError) -> Judged {
        Judged {
            refused: Some(error.to_string()),
            ..Judged::without_views(test)
        }
    }

    /// Answers from `items`, judged by the truth about the scene's own; the views
    /// alone where there is none.
    pub fn new(
        scene: &Scene,
        items: &[Aabb],
        shots: &Shots,
        truths: Option<&Truths>,
        test: PlaneTest,
    ) -> Judged {
        let mut judged = Judged::without_views(test);
        let around = scene.surroundings();
        let answered = |camera: &Camera| {
            let view = test.view(camera, &around).map_err(|e| e.to_string())?;
            let seen = items.iter().zip(0..).filter(|(b, _)| view.sees(b));
            let answer: Vec<ItemId> = match truths {
                Some(_) => seen.map(|(_, id)| id).collect(),
                None => Vec::new(),
            };
            Ok::<_, String>((view, answer))
        };
        for (i, camera) in shots.cameras.iter().enumerate() {
            let (view, answer) = match answered(camera) {
                Ok(found) => found,
                Err(error) => {
                    judged.refused = Some(error);
                    return judged;
                }
            };
            judged.views.push(view);
            let Some(truths) = truths else {
                continue;
            };
            if let Some(truth) = truths.cameras.get(i) {
                let pair = shots.neighbours.get(i).zip(truths.neighbours.get(i));
                let flicker = pair.and_then(|(neighbour, then)| {
                    let (_, answer_then) = answered(neighbour).ok()?;
                    Some(flicker(items.len(), [truth, then], [&answer, &answer_then]))
                });
                judged.by_camera.push(CameraErrors {
                    errors: blamed(test.test(), truth.errors(&scene.items, &answer)),
                    worst_miss_px: worst_miss_px(camera, scene, truth, &answer),
                    flicker,
                });
            }
            judged.answers.push(answer);
        }
        judged
    }

    /// Ids of every answer.
    pub fn counts(&self) -> Vec<u64> {
        self.answers.iter().map(|a| a.len() as u64).collect()
    }

    /// Of all cameras.
    pub fn errors(&self) -> ErrorCount {
        let mut sum = ErrorCount::default();
        self.by_camera
            .iter()
            .for_each(|camera| sum += camera.errors);
        sum
    }

    /// What a camera counts, per visible item.
    pub fn rate_of(&self, count: impl Fn(&CameraErrors) -> u64) -> Option<Rate> {
        let clusters = self.by_camera.iter();
        let clusters = clusters.map(|c| [count(c) as f64, c.errors.visible as f64]);
        rate(&clusters.collect::<Vec<_>>()).filter(|_| self.refused.is_none())
    }

    /// Null where no camera has a neighbour.
    pub fn flicker(&self) -> Option<Rate> {
        let is_known = self.by_camera.iter().any(|c| c.flicker.is_some());
        let rate = self.rate_of(|c| c.flicker.unwrap_or(0));
        rate.filter(|_| is_known)
    }

    pub fn worst_miss_px(&self) -> f64 {
        let depths = self.by_camera.iter().map(|c| c.worst_miss_px);
        depths.fold(0.0, f64::max)
    }
}

/// Items whose answer changes from one camera to another while the truth about
/// them stays what it is.
fn flicker(items: usize, truths: [&Truth; 2], answers: [&[ItemId]; 2]) -> u64 {
    let mut changed = vec![false; items];
    for &id in answers.into_iter().flatten() {
        let slot = &mut changed[id as usize];
        *slot = !*slot;
    }
    let [before, after] = truths.map(Truth::verdicts);
    let verdicts = before.iter().zip(after).zip(changed);
    let flickers = verdicts.filter(|((a, b), changed)| *changed && a == b);
    flickers.count() as u64
}

/// How deep the deepest false negative reaches into the view, in pixels of a view
/// 1080 pixels high: its depth in world units over the height that the view has
/// where the item is nearest. World units for a matrix, which has no such height.
fn worst_miss_px(camera: &Camera, scene: &Scene, truth: &Truth, answer: &[ItemId]) -> f64 {
    const PIXELS: f64 = 1080.0;
    let misses = truth.misses(&scene.items, answer);
    let in_pixels = misses.into_iter().map(|(id, depth)| {
        let item = &scene.items[id as usize];
        let ahead = |i| {
            let corner = item.corner(i).as_dvec3() + scene.origin;
            (corner - camera.frame.eye).dot(camera.frame.forward())
        };
        let nearest = (0..8).map(ahead).fold(f64::INFINITY, f64::min);
        let height = camera.lens.height_at(nearest.max(camera.lens.near()));
        height.map_or(depth, |height| depth / height * PIXELS)
    });
    in_pixels.fold(0.0, f64::max)
}

/// Errors with the excess put down to planes or to the test.
fn blamed(test: CullingTest, errors: ErrorCount) -> ErrorCount {
    match test {
        CullingTest::Sphere => errors.of_spheres(),
        CullingTest::Exact => errors.of_exact_test(),
        CullingTest::SixPlane | CullingTest::SixBox => errors,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Lens, look_at};
    use crate::scene::WorldBox;
    use glam::DVec3;

    #[test]
    fn a_miss_has_pixels_and_a_change_without_a_cause_is_flicker() {
        // Ten high at a depth of ten: 108 pixels per unit there.
        let lens = Lens::perspective(2.0 * 0.5f64.atan().to_degrees(), 1.0, 1.0, Some(100.0));
        let camera = Camera {
            frame: look_at(DVec3::ZERO, DVec3::X, DVec3::Z).unwrap(),
            lens: lens.unwrap(),
        };
        // In, reaching one unit in from the left where it is nearest; out; in.
        let cube = |at: DVec3| WorldBox::new(at, at + 2.0);
        let boxes = [
            cube(DVec3::new(10.0, -6.0, 0.0)),
            cube(DVec3::new(-30.0, 0.0, 0.0)),
            cube(DVec3::new(50.0, 0.0, 0.0)),
        ];
        let scene = Scene::about("three", &boxes, DVec3::ZERO).unwrap();
        let truth = Truth::of_scene(&camera, &scene).unwrap();
        assert_eq!(worst_miss_px(&camera, &scene, &truth, &[0, 2]), 0.0);
        let px = worst_miss_px(&camera, &scene, &truth, &[2]);
        // At the far face, 12 ahead, the view is 12 high: 2 less 0 units deep.
        assert!((100.0..220.0).contains(&px), "{px}");
        // The second changes and is out both times, the first changes as well.
        let count = |a: &[ItemId], b: &[ItemId]| flicker(3, [&truth, &truth], [a, b]);
        assert_eq!(count(&[0, 2], &[0, 2]), 0);
        assert_eq!(count(&[0, 1, 2], &[2]), 2);
        let turned = Camera {
            frame: look_at(DVec3::ZERO, -DVec3::X, DVec3::Z).unwrap(),
            ..camera
        };
        let after = Truth::of_scene(&turned, &scene).unwrap();
        // All truths change.
        assert_eq!(flicker(3, [&truth, &after], [&[0, 2], &[1]]), 0);
        assert_eq!(flicker(3, [&truth, &after], [&[0, 2], &[]]), 0);
    }
}
