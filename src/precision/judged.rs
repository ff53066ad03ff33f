//! Answers of a culling to every camera by the plain loop, and their errors. No
//! structure and no clock.

use std::ops::Add;

use glam::DVec3;
use serde::ser::Error as _;
use serde::{Serialize, Serializer};

use super::point::{Dimension, Point};
use crate::camera::Camera;
use crate::culling::{CameraView, Culling};
use crate::measure::{Status, blamed};
use crate::path::{CameraPath, evenly};
use crate::query::ItemId;
use crate::scene::{Scene, WorldBox};
use crate::statistics::{Rate, rate_of};
use crate::verify::{ErrorCount, Truth, scan};

/// Names of a culling: test, arithmetic, planes and epsilon.
#[derive(Clone, Copy, Default, PartialEq, Debug, Serialize)]
pub struct Names {
    /// Name of the culling test.
    pub test: &'static str,
    /// Name of the arithmetic.
    pub arithmetic: &'static str,
    /// Name of the derivation of the planes.
    pub planes: &'static str,
    /// Factor c of the planes' epsilon.
    pub epsilon: f64,
}

impl Names {
    pub(super) fn of(culling: &Culling) -> Names {
        Names {
            test: culling.test.name(),
            arithmetic: culling.arithmetic.name(),
            planes: culling.planes.method.name(),
            epsilon: culling.epsilon(),
        }
    }
}

/// Errors of a culling over all cameras, and what it costs per item.
#[derive(Clone, Default, Debug, Serialize)]
pub struct CullingErrors {
    /// Test, arithmetic and planes.
    #[serde(flatten)]
    pub names: Names,
    /// False positives / visible items, by camera.
    pub excess: Option<Rate>,
    /// Visible items that were not returned, in millionths.
    pub false_negative_ppm: Option<Rate>,
    /// Items that change from a camera to its neighbour on the path while their
    /// truth does not / visible items; null for a path of one camera.
    pub flicker: Option<Rate>,
    /// The same as counts; null for what is refused.
    #[serde(flatten, serialize_with = "counts_or_null")]
    pub counts: Option<ErrorCount>,
    /// How deep the deepest false negative reaches into the view, in pixels of a
    /// view 1080 pixels high.
    pub worst_miss_px: Option<f64>,
    /// `query_ns` / number of items.
    pub ns_per_item: Option<f64>,
    /// Memory of nodes and items / number of items.
    pub memory_bytes_per_item: f64,
}

/// Every count by its name, null where there are none.
pub(super) fn counts_or_null<S: Serializer>(
    errors: &Option<ErrorCount>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let counts = serde_json::to_value(errors.unwrap_or_default()).map_err(S::Error::custom)?;
    let named = counts.as_object().into_iter().flatten();
    serializer.collect_map(named.map(|(name, count)| (name, errors.map(|_| count))))
}

/// Cameras to test, evenly spread over a path, each with its successor on the path.
///
/// The successors show changes from frame to frame.
pub(super) struct Shots {
    pub cameras: Vec<Camera>,
    /// In the same order; the last camera of the path has none.
    neighbours: Vec<Camera>,
}

impl Shots {
    pub fn of(path: &CameraPath, most: usize) -> Shots {
        let count = path.cameras.len();
        let chosen = evenly(count, most.max(1));
        let next = chosen.clone().map(|i| i + 1).filter(|i| *i < count);
        Shots {
            cameras: chosen.map(|i| path.cameras[i]).collect(),
            neighbours: next.map(|i| path.cameras[i]).collect(),
        }
    }

    /// O(cameras * items) verdicts of some 50 ns. A frame always makes a pose.
    pub fn truths(&self, scene: &Scene) -> Truths {
        [&self.cameras, &self.neighbours].map(|cameras| {
            let truths = cameras.iter().filter_map(|c| Truth::of_scene(c, scene));
            truths.collect()
        })
    }
}

/// The truth about each camera, and about each neighbour.
pub(super) type Truths = [Vec<Truth>; 2];

/// Errors of the answer to one camera.
#[derive(Clone, Copy, Default)]
struct CameraErrors {
    counts: ErrorCount,
    /// How deep the deepest false negative reaches into the view, in pixels of
    /// 1080p; 0 if there is none, `None` for a matrix without rays.
    worst_miss_px: Option<f64>,
    /// Items whose answer changes to the neighbour while their truth does not.
    flicker: Option<u64>,
}

/// Answers of one culling to every camera, and their errors.
#[derive(Default)]
pub(super) struct Judged {
    pub culling: Culling,
    pub views: Vec<CameraView>,
    /// Ids of each camera; empty without a truth.
    pub answers: Vec<Vec<ItemId>>,
    by_camera: Vec<CameraErrors>,
    /// Why there are no such views.
    pub refused: Option<String>,
}

impl Judged {
    /// Answers judged by the truth; the views alone where there is none.
    pub fn new(scene: &Scene, shots: &Shots, truths: Option<&Truths>, culling: Culling) -> Judged {
        let mut judged = Judged {
            culling,
            ..Judged::default()
        };
        judged.refused = judged.judge(scene, shots, truths).err();
        judged
    }

    fn judge(
        &mut self,
        scene: &Scene,
        shots: &Shots,
        truths: Option<&Truths>,
    ) -> Result<(), String> {
        let around = scene.surroundings();
        let culling = self.culling;
        let items = culling.test.items(&scene.items);
        let view_of = |camera: &Camera| culling.view(camera, &around).map_err(|e| e.to_string());
        let answer = |view: &CameraView| -> Vec<ItemId> {
            let view = view.as_any();
            scan(&items, |b| view.sees(b)).collect()
        };
        for camera in &shots.cameras {
            self.views.push(view_of(camera)?);
        }
        let Some([truths, beside]) = truths else {
            return Ok(());
        };
        for (i, (camera, truth)) in shots.cameras.iter().zip(truths).enumerate() {
            let own = answer(&self.views[i]);
            let pair = shots.neighbours.get(i).zip(beside.get(i));
            let flicker = pair.and_then(|(neighbour, then)| {
                let answer_then = answer(&view_of(neighbour).ok()?);
                Some(flicker(items.len(), [truth, then], [&own, &answer_then]))
            });
            self.by_camera.push(CameraErrors {
                counts: blamed(culling.test, truth.errors(&scene.items, &own)),
                worst_miss_px: worst_miss_px(camera, scene, truth, &own),
                flicker,
            });
            self.answers.push(own);
        }
        Ok(())
    }

    /// The culling's errors as a point of a structure, without a time.
    pub fn point(&self, structure: &str, memory_bytes_per_item: f64) -> Point {
        let is_judged = self.refused.is_none();
        let judged = if is_judged { &self.by_camera[..] } else { &[] };
        let known = || judged.iter();
        let counts: ErrorCount = known().map(|camera| camera.counts).sum();
        let pairs = known().filter_map(|c| Some([c.flicker?, c.counts.visible]));
        let missed = rate_of(judged, |c| [c.counts.false_negatives, c.counts.visible]);
        let in_pixels = || known().filter_map(|c| c.worst_miss_px);
        let errors = CullingErrors {
            names: Names::of(&self.culling),
            excess: rate_of(judged, |c| [c.counts.false_positives, c.counts.visible]),
            false_negative_ppm: missed.map(|share| share.of_share().per(1e6)),
            flicker: rate_of(&pairs.collect::<Vec<_>>(), |pair| *pair),
            counts: is_judged.then_some(counts),
            worst_miss_px: in_pixels().reduce(f64::max),
            ns_per_item: None,
            memory_bytes_per_item,
        };
        let dimensions = vec![
            Dimension::of(known().map(|c| c.counts.false_negatives as f64), f64::add),
            Dimension::of(known().map(|c| c.counts.touch_dropped as f64), f64::add),
            Dimension::of(known().map(|c| c.counts.false_positives as f64), f64::add),
            Dimension::of(in_pixels(), f64::max),
            Dimension::fixed(memory_bytes_per_item),
        ];
        let mut point = Point::new(structure, errors, dimensions);
        point.reason = self.refused.clone();
        point.status = match is_judged {
            false => Status::Refused,
            true if counts.false_negatives > 0 => Status::Unsafe,
            true => Status::Ok,
        };
        point
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
/// where the item is nearest. `None` for a matrix without rays, which has no height.
fn worst_miss_px(camera: &Camera, scene: &Scene, truth: &Truth, answer: &[ItemId]) -> Option<f64> {
    const PIXELS: f64 = 1080.0;
    let camera = camera.unprojected().unwrap_or(*camera);
    camera.lens.height_at(camera.lens.near())?;
    let misses = truth.misses(&scene.items, answer);
    let in_pixels = misses.into_iter().filter_map(|(id, depth)| {
        let stored = WorldBox::of(&scene.items[id as usize], scene.origin);
        let b = truth.original(id as usize).unwrap_or(&stored);
        let forward = camera.frame.forward();
        let near = DVec3::select(forward.cmpgt(DVec3::ZERO), b.min, b.max);
        let nearest = (near - camera.frame.eye).dot(forward);
        let height = camera.lens.height_at(nearest.max(camera.lens.near()))?;
        Some(depth / height * PIXELS)
    });
    Some(in_pixels.fold(0.0, f64::max))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{ClipSpace, Lens, MatrixConvention, look_at};
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
        let worst = |camera: &Camera, of: &[ItemId]| worst_miss_px(camera, &scene, &truth, of);
        assert_eq!(worst(&camera, &[0, 2]), Some(0.0));
        let px = worst(&camera, &[2]).unwrap();
        // At the far face, 12 ahead, the view is 12 high: 2 less 0 units deep.
        assert!((100.0..220.0).contains(&px), "{px}");
        // The same camera as a matrix.
        let matrix = camera.lens.projection(ClipSpace::D3d) * camera.frame.world_to_eye();
        let rows = matrix.transpose().to_cols_array_2d();
        let matrix = Camera::of_matrix(rows, MatrixConvention::ColumnD3d).unwrap();
        let of_matrix = worst(&matrix, &[2]).unwrap();
        assert!((of_matrix / px - 1.0).abs() < 1e-9, "{of_matrix}");
        // A sheared one has no rays, and so no pixels.
        let mut sheared = rows;
        sheared[0][2] += 0.01;
        let sheared = Camera::of_matrix(sheared, MatrixConvention::ColumnD3d).unwrap();
        assert_eq!(worst(&sheared, &[2]), None);
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
