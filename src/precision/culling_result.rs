//! Answers of a culling to every camera by linear scan, and their errors.
//!
//! No structure and no clock.

use glam::DVec3;
use serde::ser::Error as _;
use serde::{Serialize, Serializer};

use crate::camera::Camera;
use crate::culling::{CameraView, Culling};
use crate::measure::blamed;
use crate::query::ItemId;
use crate::scene::{Scene, WorldBox};
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
    /// Factor c of the planes' error margin (epsilon).
    pub epsilon: f64,
}

impl Names {
    pub(crate) fn of(culling: &Culling) -> Names {
        Names {
            test: culling.test.name(),
            arithmetic: culling.arithmetic.name(),
            planes: culling.planes.method.name(),
            epsilon: culling.epsilon(),
        }
    }
}

/// Serializes every count by its name, as null if there are none.
pub(super) fn counts_or_null<S: Serializer>(
    errors: &Option<ErrorCount>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let counts = serde_json::to_value(errors.unwrap_or_default()).map_err(S::Error::custom)?;
    let named = counts.as_object().into_iter().flatten();
    serializer.collect_map(named.map(|(name, count)| (name, errors.map(|_| count))))
}

/// Answers of one culling to every camera, and their errors.
#[derive(Default)]
pub(super) struct CullingResult {
    pub culling: Culling,
    pub views: Vec<CameraView>,
    /// Ids for each camera that has a truth.
    pub answers: Vec<Vec<ItemId>>,
    /// Errors of each camera.
    pub errors: Vec<ErrorCount>,
    /// Depth of each camera's deepest false negative in the view, in pixels at 1080p.
    ///
    /// 0 if there is none. A matrix without rays has no entry.
    pub worst_miss_px: Vec<f64>,
    /// Reason why the views cannot be made.
    pub refused: Option<String>,
}

impl CullingResult {
    /// Computes the answers and compares them with the truth about each camera.
    ///
    /// Without truths only the views are made.
    pub fn new(scene: &Scene, cameras: &[Camera], truths: &[Truth], culling: Culling) -> Self {
        let around = scene.surroundings();
        let mut result = CullingResult {
            culling,
            ..CullingResult::default()
        };
        let views = cameras.iter().map(|camera| culling.view(camera, &around));
        match views.collect::<Result<_, _>>() {
            Ok(views) => result.views = views,
            Err(error) => result.refused = Some(error.to_string()),
        }
        let items = culling.test.items(&scene.items);
        for ((camera, view), truth) in cameras.iter().zip(&result.views).zip(truths) {
            let view = view.as_any();
            let answer: Vec<ItemId> = scan(&items, |b| view.sees(b)).collect();
            let errors = truth.errors(&scene.items, &answer);
            result.errors.push(blamed(culling.test, errors));
            let worst = worst_miss_px(camera, scene, truth, &answer);
            result.worst_miss_px.extend(worst);
            result.answers.push(answer);
        }
        result
    }
}

/// Depth of the deepest false negative in the view, in pixels of a 1080-pixel view.
///
/// This is the depth in world units over the height that the view has where the item is nearest.
/// `None` for a matrix without rays, which has no height.
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
    fn a_miss_has_pixels() {
        // The view is ten high at a depth of ten: 108 pixels per unit there.
        let lens = Lens::perspective(2.0 * 0.5f64.atan().to_degrees(), 1.0, 1.0, Some(100.0));
        let camera = Camera {
            frame: look_at(DVec3::ZERO, DVec3::X, DVec3::Z).unwrap(),
            lens: lens.unwrap(),
        };
        // In the view, reaching one unit in from the left where it is nearest; out; in.
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
        // At the far face, at depth 12, the view is 12 high: 2 less 0 units deep.
        assert!((100.0..220.0).contains(&px), "{px}");
        // The same camera as a matrix.
        let matrix = camera.lens.projection(ClipSpace::D3d) * camera.frame.world_to_eye();
        let rows = matrix.transpose().to_cols_array_2d();
        let matrix = Camera::of_matrix(rows, MatrixConvention::ColumnD3d).unwrap();
        let of_matrix = worst(&matrix, &[2]).unwrap();
        assert!((of_matrix / px - 1.0).abs() < 1e-9, "{of_matrix}");
        // A sheared matrix has no rays, and so no pixels.
        let mut sheared = rows;
        sheared[0][2] += 0.01;
        let sheared = Camera::of_matrix(sheared, MatrixConvention::ColumnD3d).unwrap();
        assert_eq!(worst(&sheared, &[2]), None);
    }
}
