//! View-projection matrices as a frame and a lens.

use glam::DVec3;

use super::matrix::{about, unprojected};
use super::{Camera, FARTHEST, Lens, Pose, Result, ViewProjection, require};
use crate::geometry::FrustumPlane;

/// Depth of a view / its distance from the eye, below which it is orthographic.
///
/// Below that, f64 resolves parallel lines of sight better than an eye.
const PARALLEL: f64 = 1e-8;

/// Largest shear and tilt of a camera with rays; f32 rounding causes about 1e-7.
const STRAIGHT: f64 = 1e-5;

/// Most difference of opposite edges of a symmetric lens, relative to its window.
const SYMMETRIC: f64 = 1e-6;

/// A view-projection matrix as a frame and a lens, rounded.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Unprojected {
    /// The camera without a matrix.
    ///
    /// The eye of an orthographic lens is the centre of the near plane.
    pub camera: Camera,
    /// True if the image is mirrored.
    ///
    /// y points down (Vulkan), or the world is left-handed.
    pub is_mirrored: bool,
    /// Directions of clip-space x and y in the world, of unit length.
    pub image: [DVec3; 2],
    /// Cosine of the angle between the image's axes; 0 for a camera.
    pub shear: f64,
    /// Change of clip-space depth across the axis of view.
    ///
    /// Relative to the change of w (of depth itself for an orthographic lens) along it; 0
    /// for a camera, larger for an oblique near plane.
    pub tilt: f64,
}

impl Unprojected {
    /// Returns whether the image is sheared, or depth lies off the axis of view.
    pub fn is_sheared(&self) -> bool {
        self.shear > STRAIGHT || self.tilt > STRAIGHT
    }
}

impl ViewProjection {
    /// The frame and the lens that this matrix was made from.
    ///
    /// # Errors
    /// A view that no lens describes, such as one with coincident near and far planes.
    pub fn unprojected(&self) -> Result<Unprojected> {
        let along = |row: usize| DVec3::from_slice(&self.rows[row]);
        let [x, y, z, w] = [0, 1, 2, 3].map(along);
        // The exact inverse is not needed if far is clearly farther from an eye than near.
        let is_eye = !self.is_parallel && self.near < FARTHEST;
        let is_clear = is_eye && self.far.is_none_or(|far| far > 2.0 * self.near);
        let axis = if is_clear { None } else { self.axis() };
        let is_short = |[near, ahead]: [DVec3; 2]| {
            ahead.length() < PARALLEL * near.distance(self.eye) || self.is_parallel
        };
        let parallel = axis.filter(|axis| is_short(*axis));
        let (eye, forward) = match parallel {
            Some([near, ahead]) => (near, ahead.normalize()),
            None => (self.eye, w.normalize()),
        };
        let aside = |row: DVec3| row - forward * row.dot(forward);
        let (across, upward) = (aside(x), aside(y));
        let is_mirrored = across.cross(upward).dot(forward) > 0.0;
        let image = [across, upward].map(DVec3::normalize);
        // Of all clip spaces only Vulkan's has y downward.
        let is_of_vulkan = self.convention().name().starts_with("column-d3d");
        let up = match is_mirrored && is_of_vulkan {
            true => -upward,
            false => upward,
        };
        let frame = Pose::Forward { eye, forward, up }.frame()?;
        let axes = [(x, frame.u()), (y, frame.v())];
        let lens = match parallel {
            Some([near, ahead]) => {
                let scale = w.dot(near) + self.rows[3][3];
                let [width, height] = axes.map(|(row, axis)| 2.0 * scale / row.dot(axis).abs());
                Lens::orthographic(height, width / height, 0.0, ahead.length())?
            }
            None => self.perspective(forward, axes)?,
        };
        let change = if parallel.is_some() { z } else { w };
        Ok(Unprojected {
            camera: Camera { frame, lens },
            is_mirrored,
            image,
            shear: image[0].dot(image[1]).abs(),
            tilt: aside(z).length() / change.length(),
        })
    }

    /// Returns whether the matrix is a view alone: unit axes, and w is 1 everywhere.
    pub fn is_view_only(&self) -> bool {
        let is_unit = |row: &[f64; 4]| (DVec3::from_slice(row).length() - 1.0).abs() < STRAIGHT;
        self.rows[..3].iter().all(is_unit) && self.rows[3] == [0.0, 0.0, 0.0, 1.0]
    }

    /// Returns whether it is a projection alone: the eye at 0, axes of the world.
    pub fn is_lens_only(&self) -> bool {
        let [x, y, z, w] = self.rows;
        [x[1], x[3], y[0], y[3], z[0], z[1], w[0], w[1], w[3]] == [0.0; 9]
    }

    /// Clip-space depths of the near and the far plane: -1, 0 or 1.
    pub fn depths(&self) -> [f64; 2] {
        let lowest = if self.is_from_zero() { 0.0 } else { -1.0 };
        match self.is_reversed {
            false => [lowest, 1.0],
            true => [1.0, lowest],
        }
    }

    /// The centre of the near plane, and the vector from there to the far plane's.
    ///
    /// `None` if that is at infinity.
    pub(super) fn axis(&self) -> Option<[DVec3; 2]> {
        let inverse = self.inverse()?;
        let of_depth = |z| unprojected(&inverse, [0.0, 0.0, z, 1.0]);
        let [near, far] = self.depths().map(of_depth);
        let near = about(&near, &[])?;
        Some([near, about(&far, &[near])?])
    }

    /// The lens of a matrix with an eye.
    ///
    /// `axes` are the rows of x and y, each with its axis of the frame.
    fn perspective(&self, forward: DVec3, axes: [(DVec3, DVec3); 2]) -> Result<Lens> {
        let scale = DVec3::from_slice(&self.rows[3]).length();
        let [[left, right], [bottom, top]] = axes.map(|(row, axis)| {
            let edge = |clip: f64| (clip * scale - row.dot(forward)) / row.dot(axis);
            let (a, b) = (edge(-1.0), edge(1.0));
            [a.min(b), a.max(b)]
        });
        let planes = self.planes_about(&[self.eye]);
        let depth_of = |wanted| {
            let (_, plane) = planes.iter().find(|(name, _)| *name == wanted)?;
            let depth = -plane.d / plane.normal.dot(forward);
            (depth > 0.0).then_some(depth)
        };
        let near = depth_of(FrustumPlane::Near).unwrap_or(self.near);
        let far = self.far.and_then(|_| depth_of(FrustumPlane::Far));
        let is_centred = |low: f64, high: f64| (low + high).abs() < SYMMETRIC * (high - low);
        if is_centred(left, right) && is_centred(bottom, top) {
            let (width, height) = (right - left, top - bottom);
            let fovy_deg = 2.0 * libm::atan(height / 2.0).to_degrees();
            return Lens::perspective(fovy_deg, width / height, near, far);
        }
        let window = [left, right, bottom, top].map(|slope| slope * near);
        Lens::off_axis(window, near, far)
    }
}

impl Camera {
    /// This camera with its own frame and a lens whose rays are known.
    ///
    /// # Errors
    /// A matrix whose image is sheared or whose near plane is oblique.
    pub fn unprojected(&self) -> Result<Camera> {
        let Some(matrix) = self.lens.matrix() else {
            return Ok(*self);
        };
        let found = matrix.unprojected()?;
        for (name, value) in [
            ("image of the matrix is sheared", found.shear),
            ("near plane of the matrix is oblique", found.tilt),
        ] {
            let found = format_args!("the {name} by {value:.1e}");
            let rule = "at most 1e-5 where rays are needed, or another --matrix-convention";
            require(value <= STRAIGHT, found, rule)?;
        }
        Ok(found.camera)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::ClipSpace::{D3d, OpenGl, ReversedZ};
    use crate::camera::MatrixConvention::{self, ColumnD3d, ColumnGl, RowD3d};
    use crate::camera::{Frame, LensKind, look_at};
    use glam::{DMat4, DVec4};

    const EYE: DVec3 = DVec3::new(3.0, -2.0, 5.0);

    /// Reads a matrix in a convention: by columns or, transposed, by rows.
    fn read(matrix: DMat4, convention: MatrixConvention) -> Camera {
        let rows = matrix.transpose().to_cols_array_2d();
        Camera::of_matrix(convention.in_columns(rows), convention).expect("a camera")
    }

    fn decomposed(camera: &Camera) -> Unprojected {
        let matrix = camera.lens.matrix().expect("a matrix stays one");
        matrix.unprojected().expect("a lens")
    }

    fn lenses() -> [Lens; 6] {
        [
            Lens::perspective(60.0, 1.5, 0.5, Some(400.0)),
            Lens::perspective(60.0, 1.5, 0.5, None),
            Lens::perspective(0.01, 1.0, 9.0, Some(10.0)),
            Lens::off_axis([-0.1, 0.4, -0.2, 0.3], 0.5, Some(40.0)),
            Lens::orthographic(8.0, 1.5, 0.5, 40.0),
            Lens::orthographic(8.0, 1.5, -30.0, 40.0),
        ]
        .map(|lens| lens.expect("a lens"))
    }

    /// Largest relative difference of edges, near and far.
    fn difference(a: &Lens, b: &Lens) -> f64 {
        let relative = |(a, b): (f64, f64)| (a - b).abs() / a.abs().max(b.abs());
        let edges = a.window().into_iter().zip(b.window());
        let range = |lens: &Lens| lens.far().map(|far| far - lens.near());
        let depth = match [a, b].map(range) {
            [Some(a), Some(b)] => relative((a, b)),
            [None, None] => relative((a.near(), b.near())),
            _ => f64::INFINITY,
        };
        edges.map(relative).fold(depth, f64::max)
    }

    /// Every lens, handedness of the world (x mirrored is left) and clip space.
    ///
    /// Each under its own convention and under the one with reversed depth.
    #[test]
    fn a_matrix_is_the_camera_that_it_was_made_of() {
        let frame = look_at(EYE, DVec3::ZERO, DVec3::Z).unwrap();
        let clips = [
            (ColumnGl, OpenGl, 1.0, [-1.0, 1.0]),
            (ColumnGl.reversed(), OpenGl, -1.0, [1.0, -1.0]),
            (ColumnD3d, D3d, 1.0, [0.0, 1.0]),
            (ColumnD3d.reversed(), ReversedZ, 1.0, [1.0, 0.0]),
        ];
        for (lens, hand) in lenses().into_iter().flat_map(|l| [(l, 1.0), (l, -1.0)]) {
            for (name, clip, turned, depths) in clips {
                let change = DMat4::from_scale(DVec3::new(hand, 1.0, turned));
                let matrix = change * lens.projection(clip) * frame.world_to_eye();
                let rounded = matrix.to_cols_array().map(|entry| f64::from(entry as f32));
                let rounded = DMat4::from_cols_array(&rounded);
                for (matrix, slack) in [(matrix, 1e-11), (matrix * 7.0, 1e-11), (rounded, 1e-3)] {
                    let other = name.reversed();
                    for named in [name, name.transposed(), other, other.transposed()] {
                        let read = read(matrix, named);
                        let what = format!("{lens:?} {hand} {named:?} {slack}: {read:?}");
                        check(&read, &lens, &frame, slack, &what);
                        // Without an eye the name of the convention decides.
                        let parallel = lens.is_orthographic();
                        let is_swapped = parallel && ![name, name.transposed()].contains(&named);
                        let found = decomposed(&read);
                        let side = if is_swapped { -1.0 } else { 1.0 };
                        let [near, far] = depths;
                        let wanted = if is_swapped { [far, near] } else { depths };
                        assert_eq!(read.lens.matrix().unwrap().depths(), wanted, "{what}");
                        assert_eq!(found.is_mirrored, hand * side < 0.0, "{what}");
                        let along = found.camera.frame.forward() - frame.forward() * side;
                        assert!(along.length() < slack, "{what}");
                        let eye = match (parallel, is_swapped) {
                            (false, _) => 0.0,
                            (true, false) => lens.near(),
                            (true, true) => lens.far().expect("an end"),
                        };
                        let eye = frame.eye + frame.forward() * eye;
                        let off = found.camera.frame.eye.distance(eye);
                        assert!(off < slack * 40.0, "{what}");
                    }
                }
            }
        }
    }

    /// Checks the image's axes up to their signs, the lens, and the camera of the rays.
    fn check(read: &Camera, lens: &Lens, frame: &Frame, slack: f64, what: &str) {
        let found = decomposed(read);
        assert!(found.shear < 1e-5 && found.tilt < 1e-5, "{what}");
        assert_eq!(
            read.lens.is_orthographic(),
            lens.is_orthographic(),
            "{what}"
        );
        let camera = read.unprojected().expect("rays");
        assert_eq!(camera, found.camera);
        let Camera {
            frame: own,
            lens: found,
        } = camera;
        let across = own.u().dot(frame.u());
        for dot in [across, own.v().dot(frame.v()), own.n().dot(frame.n())] {
            assert!((dot.abs() - 1.0).abs() < slack, "{what}");
        }
        let is_turned = across < 0.0 && matches!(lens.kind(), LensKind::OffAxis { .. });
        let off = difference(&found, lens);
        assert!(off < slack || is_turned, "{what}: {off:e}");
    }

    #[test]
    fn a_mirrored_image_is_said_and_keeps_its_rays() {
        let frame = look_at(EYE, DVec3::ZERO, DVec3::Z).unwrap();
        let [lens, ..] = lenses();
        let flip = DMat4::from_scale(DVec3::new(1.0, -1.0, 1.0));
        let names = [
            (D3d, ColumnD3d, 1.0),
            (D3d, RowD3d, -1.0),
            (OpenGl, ColumnGl, -1.0),
        ];
        for (clip, convention, up) in names {
            let matrix = flip * lens.projection(clip) * frame.world_to_eye();
            let camera = read(matrix, convention);
            let found = decomposed(&camera);
            assert!(found.is_mirrored);
            assert!((found.camera.frame.v() - frame.v() * up).length() < 1e-12);
            assert!(difference(&found.camera.lens, &lens) < 1e-12);
        }
    }

    #[test]
    fn an_eye_too_far_for_f64_is_an_orthographic_lens() {
        for far in [1e12, 1e18, 1e60] {
            let rows = [
                DVec4::new(far / 20.0, 0.0, 0.0, 0.0),
                DVec4::new(0.0, far / 20.0, 0.0, 0.0),
                DVec4::new(0.0, 0.0, -far / 50.0, 0.0),
                DVec4::new(0.0, 0.0, -1.0, far),
            ];
            let [x, y, z, w] = rows;
            let matrix = DMat4::from_cols(x, y, z, w).transpose();
            let camera = read(matrix, ColumnGl).unprojected().unwrap();
            let wanted = Lens::orthographic(40.0, 1.0, 0.0, 100.0).unwrap();
            assert!(camera.lens.is_orthographic(), "{far:e}");
            assert!(
                difference(&camera.lens, &wanted) < 1e-9,
                "{far:e}: {camera:?}"
            );
            assert!(camera.frame.eye.distance(DVec3::Z * 50.0) < 1e-6, "{far:e}");
        }
    }

    #[test]
    fn what_no_lens_holds_is_refused_by_name() {
        let frame = look_at(EYE, DVec3::ZERO, DVec3::Z).unwrap();
        let [lens, ..] = lenses();
        let projection = lens.projection(OpenGl);
        let mut sheared = projection;
        sheared.y_axis.x = 0.01;
        // An oblique near plane in place of the lens's (Lengyel 2005).
        let mut oblique = projection;
        oblique.x_axis.z = 0.2;
        for (matrix, wanted) in [
            (sheared, "sheared by 8.7e-3; expected"),
            (oblique, "oblique by 2.0e-1; expected"),
        ] {
            let camera = read(matrix * frame.world_to_eye(), ColumnGl);
            let error = camera.unprojected().unwrap_err().to_string();
            assert!(error.contains(wanted), "{error}");
        }
    }
}
