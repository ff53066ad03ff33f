//! A test vector: boxes, cameras or planes, and what is declared of them.

use std::collections::BTreeSet;

use glam::DVec3;

use crate::camera::{Camera, CameraError, Lens, look_at};
use crate::geometry::{Aabb, Plane};

/// Names of boxes; sorted, so that they print alike every time.
pub type Names = BTreeSet<String>;

/// One test vector. What a file does not state is absent; nothing is checked
/// against what is absent.
#[derive(Clone, Debug)]
pub struct Vector {
    /// Unique in its file.
    pub id: String,
    /// The section of results that it belongs to.
    pub category: String,
    /// Bit for bit.
    pub planes: Option<Vec<Plane>>,
    /// Camera that the boxes are culled for.
    pub camera: Option<VectorCamera>,
    /// Boxes by name.
    pub boxes: Vec<(String, Aabb)>,
    /// Points to be located among the boxes.
    pub points: Vec<VectorPoint>,
    /// Exact verdicts; what touches is among the visible.
    pub visible_planes: Option<Names>,
    /// Boxes that touch the volume of the planes and do not reach into it.
    pub touch_planes: Option<Names>,
    /// Boxes that reach into the camera's view or touch it.
    pub visible_camera: Option<Names>,
    /// Boxes that touch the camera's view and do not reach into it.
    pub touch_camera: Option<Names>,
    /// What the f32 six-plane test returns; where a file does not say, what
    /// the exact one does.
    pub six_plane: Option<Names>,
    /// What the six-plane test returns without any rounding.
    pub six_plane_exact: Option<Names>,
    /// Why the camera must be refused.
    pub camera_error: Option<String>,
    /// Why the planes must be refused.
    pub planes_error: Option<String>,
    /// Boxes that must be refused: a bound is not finite.
    pub rejected_at_load: Names,
    /// Boxes that must never be returned: a lower bound is above its upper one.
    pub empty_boxes: Names,
}

/// A camera as a file states it: it may be impossible.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct VectorCamera {
    /// Position of the camera.
    pub eye: DVec3,
    /// The point looked at.
    pub look: DVec3,
    /// The vector that is up in the image.
    pub up: DVec3,
    /// Full vertical angle of view.
    pub fovy_deg: f64,
    /// Width / height.
    pub aspect: f64,
    /// Distance of the near plane.
    pub near: f64,
    /// `None` is infinite.
    pub far: Option<f64>,
}

/// A point and the boxes that hold it.
#[derive(Clone, Debug)]
pub struct VectorPoint {
    /// Name of the point.
    pub id: String,
    /// The point in scene coordinates, as written.
    pub p: DVec3,
    /// Names of the boxes that hold it, bounds included.
    pub containing: Names,
}

impl VectorCamera {
    /// # Errors
    /// No such camera.
    pub fn camera(&self) -> Result<Camera, CameraError> {
        let frame = look_at(self.eye, self.look, self.up)?;
        let lens = Lens::perspective(self.fovy_deg, self.aspect, self.near, self.far)?;
        Ok(Camera { frame, lens })
    }
}

impl Vector {
    /// The boxes that a scene may hold, and their names.
    pub fn sound_boxes(&self) -> (Vec<String>, Vec<Aabb>) {
        let sound = self.boxes.iter();
        sound
            .filter(|(name, _)| !self.rejected_at_load.contains(name))
            .cloned()
            .unzip()
    }
}
