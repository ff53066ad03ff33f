//! Everything within a rectangle of the image: the cursor's own frustum.
//!
//! The frustum is that of a camera with an off-axis lens, for which any index of boxes can be
//! queried.

use crate::camera::{Camera, CameraError, Lens, PlaneOptions, Surroundings};
use crate::geometry::ConvexVolume;
use crate::visibility::Rays;

/// A rectangle of the image: (0, 0) is its upper left corner, (1, 1) its lower
/// right one. Closed.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CursorRectangle {
    /// Upper left corner, across and down.
    pub min: [f64; 2],
    /// Lower right corner; beyond `min` on both axes.
    pub max: [f64; 2],
}

impl CursorRectangle {
    /// The rectangle that reaches `half` pixels to each side of a cursor at
    /// (`x`, `y`), in pixels of an image of that size.
    pub fn around([x, y]: [f64; 2], half: f64, [width, height]: [f64; 2]) -> CursorRectangle {
        CursorRectangle {
            min: [(x - half) / width, (y - half) / height],
            max: [(x + half) / width, (y + half) / height],
        }
    }

    /// The camera that sees what the rays through the rectangle see: the same eye
    /// (moved aside for an orthographic lens), near and far.
    ///
    /// # Errors
    /// An empty rectangle; one that f64 cannot tell from a point.
    pub fn camera(&self, rays: &Rays) -> Result<Camera, CameraError> {
        let camera = rays.camera();
        let [left, right, bottom, top] = rays.window();
        let across = |x: f64| left + (right - left) * x;
        let up = |y: f64| top + (bottom - top) * y;
        let window = [
            across(self.min[0]),
            across(self.max[0]),
            up(self.max[1]),
            up(self.min[1]),
        ];
        let (near, far) = (camera.lens.near(), camera.lens.far());
        let mut frame = camera.frame;
        let lens = match camera.lens.is_orthographic() {
            true => {
                let [left, right, bottom, top] = window;
                let (middle, middle_up) = ((left + right) / 2.0, (bottom + top) / 2.0);
                frame.eye += frame.u() * middle + frame.v() * middle_up;
                let (width, height) = (right - left, top - bottom);
                let far = far.unwrap_or(f64::INFINITY);
                Lens::orthographic(height, width / height, near, far)?
            }
            false => Lens::off_axis(window.map(|slope| slope * near), near, far)?,
        };
        Ok(Camera { frame, lens })
    }

    /// Its planes in the f32 of a scene, moved outward by what they may be off.
    ///
    /// # Errors
    /// As [`CursorRectangle::camera`] and [`Camera::volume`].
    pub fn volume(&self, rays: &Rays, around: &Surroundings) -> Result<ConvexVolume, CameraError> {
        self.camera(rays)?.volume(&PlaneOptions::default(), around)
    }
}
