//! Places that a scene offers to cameras.

use glam::DVec3;

/// A place and direction that the scene itself offers to a camera.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CameraPlace {
    /// Position in world coordinates.
    pub eye: DVec3,
    /// Direction of view.
    pub forward: DVec3,
    /// Roll and lens, where the file states them.
    pub view: Option<PlaceView>,
}

/// Roll and lens of a camera place.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PlaceView {
    /// Direction that is up in the image.
    pub up: DVec3,
    /// Full vertical angle of view in degrees; `None` where the view is parallel.
    pub fovy_deg: Option<f64>,
    /// Height of a parallel view in world units.
    pub ortho_height: Option<f64>,
    /// Width / height, if stated.
    pub aspect: Option<f64>,
    /// Distance of the near plane.
    pub near: f64,
    /// Distance of the far plane; `None` is infinite.
    pub far: Option<f64>,
}
