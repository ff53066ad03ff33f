//! A test vector: boxes, cameras or planes, and what is declared of them.

use std::collections::BTreeSet;

use glam::{DVec3, Vec3};

use crate::camera::{Camera, CameraError, Lens, look_at};
use crate::geometry::{Aabb, Plane};

/// Names of boxes; sorted, so that they print alike every time.
pub type Names = BTreeSet<String>;

/// One test vector. What a file does not state is absent; nothing is checked
/// against what is absent.
#[derive(Clone, Debug)]
pub struct Vector {
    pub id: String,
    pub category: String,
    /// Bit for bit.
    pub planes: Option<Vec<Plane>>,
    pub camera: Option<VectorCamera>,
    pub boxes: Vec<(String, Aabb)>,
    pub points: Vec<VectorPoint>,
    /// Exact verdicts; what touches is among the visible.
    pub visible_planes: Option<Names>,
    pub touch_planes: Option<Names>,
    pub visible_camera: Option<Names>,
    pub touch_camera: Option<Names>,
    /// What the f32 six-plane test returns; where a file does not say, what
    /// the exact one does.
    pub six_plane: Option<Names>,
    /// What the six-plane test returns without any rounding.
    pub six_plane_exact: Option<Names>,
    pub camera_error: Option<String>,
    pub planes_error: Option<String>,
    pub rejected_at_load: Names,
    pub empty_boxes: Names,
}

/// A camera as a file states it: it may be impossible.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct VectorCamera {
    pub eye: DVec3,
    pub look: DVec3,
    pub up: DVec3,
    pub fovy_deg: f64,
    pub aspect: f64,
    pub near: f64,
    /// `None` is infinite.
    pub far: Option<f64>,
}

/// A point and the boxes that hold it.
#[derive(Clone, Debug)]
pub struct VectorPoint {
    pub id: String,
    pub p: Vec3,
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
