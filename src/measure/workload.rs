//! What is asked of every contender: the volumes of a camera path and the
//! points to locate, made before the first clock starts and the same for all.

use glam::Vec3;

use crate::camera::PlaneOptions;
use crate::geometry::ConvexVolume;
use crate::path::{CameraPath, PathError};
use crate::query::ItemId;
use crate::scene::Scene;

/// A scene with the queries along one path.
pub struct Workload<'a> {
    pub scene: &'a Scene,
    pub path: String,
    pub volumes: Vec<ConvexVolume>,
    /// The eyes of the path, to be located among the scene's regions.
    pub points: Vec<Vec3>,
}

impl<'a> Workload<'a> {
    /// # Errors
    /// A camera whose planes do not fit f32; its place in the path is named.
    pub fn new(
        scene: &'a Scene,
        path: &CameraPath,
        options: &PlaneOptions,
    ) -> Result<Workload<'a>, PathError> {
        let around = scene.surroundings();
        let volumes = path.cameras.iter().enumerate().map(|(index, camera)| {
            camera
                .volume(options, &around)
                .map_err(|error| PathError::Camera {
                    path: path.name.clone(),
                    index,
                    error,
                })
        });
        let eyes = path.cameras.iter().map(|camera| camera.frame.eye);
        Ok(Workload {
            scene,
            path: path.name.clone(),
            volumes: volumes.collect::<Result<_, _>>()?,
            points: eyes
                .map(|eye| scene.regions.local_point(eye, scene.origin))
                .collect(),
        })
    }

    /// Region search as every contender is asked to do it: the index finds
    /// boxes, the scene's regions decide. Appends to `out`, which must be
    /// empty.
    pub fn refine(&self, p: Vec3, out: &mut Vec<ItemId>) {
        self.scene.regions.refine(p, out);
    }
}
