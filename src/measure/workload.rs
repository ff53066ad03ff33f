//! The queries along one camera path: views for frustums, points for region search.
//!
//! Made before the first clock starts, and the same for all structures.

use std::borrow::Cow;

use glam::Vec3;

use crate::camera::{Camera, Surroundings};
use crate::culling::{CameraView, Culling, CullingError, CullingTest};
use crate::geometry::Aabb;
use crate::index::Input;
use crate::motion::Motion;
use crate::path::CameraPath;
use crate::query::ItemId;
use crate::scene::{Scene, SearchPoint};

/// Input of a structure: `items` and the scene's own partition.
///
/// The items are the scene's, or in the form that a culling test indexes.
pub fn input_of<'a>(scene: &'a Scene, items: &'a [Aabb]) -> Input<'a> {
    Input::new(items).own_tree(scene.own_tree.as_ref())
}

/// [`input_of`] with spheres, if the test uses them.
pub(crate) fn input_for<'a>(test: CullingTest, scene: &'a Scene, items: &'a [Aabb]) -> Input<'a> {
    input_of(scene, items).spheres(test == CullingTest::Sphere)
}

/// A scene with the queries along one path.
#[derive(Debug)]
pub struct Workload<'a> {
    /// Items, regions and origin.
    pub scene: &'a Scene,
    /// Name of the path, parameters included.
    pub path: String,
    /// Test, arithmetic and planes.
    pub culling: Culling,
    /// The scene's items in the form that the culling test indexes.
    pub items: Cow<'a, [Aabb]>,
    /// The cameras of the path; the truth refers to them.
    pub cameras: Vec<Camera>,
    /// Origin of the scene and reach of its items, moved ones included.
    pub around: Surroundings,
    /// Views that structures are queried with, one per camera.
    pub views: Vec<CameraView>,
    /// Scale of the lens, if the path requests a visible share.
    pub lens_scale: Option<f64>,
    /// Eyes of the cameras in f32, for region search.
    pub points: Vec<Vec3>,
    /// The same eyes in f64 too, for the exact test of an index's candidates.
    pub sought: Vec<SearchPoint>,
    /// New bounds of the items, frame by frame; `None` for a still scene.
    pub motion: Option<Motion>,
    /// Number of queries per frame; the frames take the views in turn.
    pub views_per_frame: usize,
}

/// A camera of a path without such a view.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
#[error("{place}: {error}")]
pub struct WorkloadError {
    /// Place in the path ([`CameraPath::place`]), or the motion that moves too far.
    pub place: String,
    /// Reason.
    pub error: CullingError,
}

impl<'a> Workload<'a> {
    /// Makes the queries of all cameras of a path.
    ///
    /// # Errors
    /// A camera whose view cannot be made (its planes do not fit f32, or the choices conflict); its
    /// place in the path is named.
    pub fn new(
        scene: &'a Scene,
        path: &CameraPath,
        culling: &Culling,
    ) -> Result<Workload<'a>, WorkloadError> {
        Workload::moving(scene, path, culling, None, 1)
    }

    /// [`Workload::new`] with items that move, and `views` queries after each frame.
    ///
    /// Recorded moves follow the times of recorded cameras ([`Motion::seen_by`]).
    ///
    /// # Errors
    /// The errors of [`Workload::new`].
    pub fn moving(
        scene: &'a Scene,
        path: &CameraPath,
        culling: &Culling,
        motion: Option<Motion>,
        views: usize,
    ) -> Result<Workload<'a>, WorkloadError> {
        let views_per_frame = views.max(1);
        let motion = motion.map(|motion| motion.seen_by(path, views_per_frame));
        let mut around = scene.surroundings();
        let moved = motion.iter().map(Motion::reach);
        around.reach = moved.fold(around.reach, Vec3::max);
        let views = path.cameras.iter().enumerate().map(|(index, camera)| {
            let refused = |error| {
                let is_motions = culling.view(camera, &scene.surroundings()).is_ok();
                let motion = motion.as_ref().filter(|_| is_motions);
                let place = motion.map(|motion| format!("motion '{}'", motion.name));
                let place = place.unwrap_or_else(|| path.place(index));
                WorkloadError { place, error }
            };
            culling.view(camera, &around).map_err(refused)
        });
        let views = views.collect::<Result<_, _>>()?;
        let eyes = path.cameras.iter().map(|camera| camera.frame.eye);
        let sought: Vec<SearchPoint> = eyes.map(|eye| scene.search_point(eye)).collect();
        Ok(Workload {
            scene,
            path: path.name.clone(),
            culling: *culling,
            items: culling.test.items(&scene.items),
            around,
            views,
            points: sought.iter().map(|point| point.local).collect(),
            sought,
            cameras: path.cameras.clone(),
            lens_scale: path.lens_scale,
            motion,
            views_per_frame,
        })
    }

    /// Input of a structure over items in the form that the culling test indexes.
    pub(super) fn input<'i>(&'i self, items: &'i [Aabb]) -> Input<'i> {
        let input = input_for(self.culling.test, self.scene, items);
        input.come_and_go(self.motion.is_some())
    }

    /// Region search at the eye of a camera.
    ///
    /// The answer of `ask`, made exact by [`Scene::search`].
    #[inline]
    pub fn search(
        &self,
        camera: usize,
        out: &mut Vec<ItemId>,
        ask: impl FnOnce(Vec3, &mut Vec<ItemId>),
    ) {
        self.scene.search(&self.sought[camera], out, ask);
    }
}
