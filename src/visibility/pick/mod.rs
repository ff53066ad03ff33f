//! Picking: selection under the cursor. One file per back end.
//!
//! Queries are the first item that a ray meets, and everything in the cursor's frustum.

mod exact;
mod wide_ray;

use crate::camera::{Camera, CameraError, Lens, PlaneOptions, Surroundings};
use crate::geometry::ConvexVolume;
use crate::kernel::Kernel;
use crate::query::ItemId;
use crate::visibility::truth::{Bodies, Body};
use crate::visibility::{Guarantee, Ray, Rays, Row};

pub use exact::LinearScan;
pub use wide_ray::WideRay;

#[cfg(test)]
mod tests;

impl<B: Body> Bodies<B> {
    /// All back ends of picking, the reference first.
    ///
    /// [Exact](Guarantee::Exact) answers are those of exact arithmetic, ties included.
    pub const BACK_ENDS: &'static [BackEnd<B>] = rows! { BackEnd { name, guarantee, summary, build }
        "linear", Guarantee::Exact, "every box or triangle, in exact arithmetic: the reference",
            |bodies, _| Box::new(LinearScan(bodies.clone()));
        "wide-ray", Guarantee::Exact,
            "16-wide tree, sixteen slab tests at once, the last step exact",
            |bodies, kernel| Box::new(WideRay::of(bodies, kernel));
    };
}

/// Items of a scene, to be picked by rays.
///
/// Solid boxes are met as [`Solids`](crate::visibility::Solids) defines, triangles as
/// [`Facets::solid`](crate::visibility::truth::Facets::solid) does.
pub trait Pick: Send + Sync {
    /// First item that the ray meets; the lowest id of several at the same depth.
    fn first(&self, ray: &Ray) -> Option<ItemId>;
}

/// Exact answers along rays, with which back ends are compared.
pub trait PickTruth: Pick {
    /// Items that the ray meets, in any order; an item may appear several times.
    fn met(&self, ray: &Ray) -> Vec<ItemId>;
}

/// Row of the table of back ends; builds one for an instruction set.
pub type BackEnd<B> = Row<fn(&Bodies<B>, Kernel) -> Box<dyn Pick>>;

/// Closed rectangle of the image.
///
/// (0, 0) is the image's upper left corner, (1, 1) its lower right one.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CursorRectangle {
    /// Upper left corner, across and down.
    pub min: [f64; 2],
    /// Lower right corner; larger than `min` on both axes.
    pub max: [f64; 2],
}

impl CursorRectangle {
    /// Rectangle that extends `half` pixels to each side of a cursor.
    ///
    /// The cursor is at (`x`, `y`), in pixels of an image of `width` x `height`.
    pub fn around([x, y]: [f64; 2], half: f64, [width, height]: [f64; 2]) -> CursorRectangle {
        let [min, max] = [-half, half].map(|by| [(x + by) / width, (y + by) / height]);
        CursorRectangle { min, max }
    }

    /// Frustum of everything that rays through the rectangle meet.
    ///
    /// In the f32 coordinates of a scene, for a camera with the same eye (shifted for an
    /// orthographic lens), near and far. Planes are moved outward by their error bounds.
    ///
    /// # Errors
    /// An empty rectangle; one that f64 cannot distinguish from a point; the errors of
    /// [`Camera::volume`].
    pub fn volume(&self, rays: &Rays, around: &Surroundings) -> Result<ConvexVolume, CameraError> {
        let camera = &rays.camera;
        let [[left, top], [right, bottom]] = [self.min, self.max].map(|p| rays.in_window(p));
        let (near, far) = (camera.lens.near(), camera.lens.far());
        let mut frame = camera.frame;
        let lens = match camera.lens.is_orthographic() {
            true => {
                let (middle, middle_up) = ((left + right) / 2.0, (bottom + top) / 2.0);
                frame.eye += frame.u() * middle + frame.v() * middle_up;
                let (width, height) = (right - left, top - bottom);
                let far = far.unwrap_or(f64::INFINITY);
                Lens::orthographic(height, width / height, near, far)?
            }
            false => {
                let window = [left, right, bottom, top].map(|slope| slope * near);
                Lens::off_axis(window, near, far)?
            }
        };
        Camera { frame, lens }.volume(&PlaneOptions::default(), around)
    }
}
