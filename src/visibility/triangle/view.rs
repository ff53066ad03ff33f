//! What this stage asks with: the eye, and the window and samples where a back end
//! needs them.

use glam::DVec3;

use super::super::rays::{NoRays, Rays, SampleGrid};
use super::eye::Eye;
use crate::camera::{Camera, Lens};

/// A view of surfaces.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct View {
    /// Where it is taken from, scene-local.
    pub eye: Eye,
    /// What it takes in; `None` if only sides matter.
    pub window: Option<Window>,
}

/// The image of a view.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Window {
    /// The rays, in world coordinates.
    pub rays: Rays,
    /// The zero of the surfaces, in world coordinates.
    pub origin: DVec3,
    /// The samples of the image.
    pub grid: SampleGrid,
}

impl View {
    /// The view of a camera on surfaces about an origin.
    ///
    /// # Errors
    /// A camera that was given as a matrix.
    pub fn of(camera: &Camera, origin: DVec3, grid: SampleGrid) -> Result<View, NoRays> {
        let rays = Rays::of(camera)?;
        let frame = &camera.frame;
        let eye = match camera.lens {
            Lens::Orthographic { .. } => Eye::along(frame.forward()),
            _ => Eye::at(frame.eye, origin),
        };
        let window = Some(Window { rays, origin, grid });
        Ok(View { eye, window })
    }
}
