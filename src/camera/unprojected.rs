//! View-projection matrices as a frame and a lens.

use glam::DVec3;

use super::matrix::{about, unprojected};
use super::{Camera, CameraError, Lens, MatrixConvention, Pose, Result, ViewProjection, require};
use crate::geometry::FrustumPlane;

/// A view whose depth is a smaller share of its distance from the eye counts as
/// orthographic: f64 has more digits for parallel lines of sight than for an eye.
const PARALLEL: f64 = 1e-8;

/// Largest shear and tilt of a camera with rays; f32 rounding makes some 1e-7.
const STRAIGHT: f64 = 1e-5;

/// Opposite edges of a window are this much alike, relative to its size, where its
/// lens is symmetric.
const SYMMETRIC: f64 = 1e-6;

/// A view-projection matrix as a frame and a lens, rounded.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Unprojected {
    /// The camera without a matrix. The eye of an orthographic lens is the centre of
    /// the near plane.
    pub camera: Camera,
    /// Clip-space depths of the near and the far plane: -1, 0 or 1.
    pub depths: [f64; 2],
    /// True if the image is mirrored: y points down (Vulkan), or the world is
    /// left-handed.
    pub is_mirrored: bool,
    /// Directions of clip-space x and y in the world, of unit length.
    pub image: [DVec3; 2],
    /// Cosine of the angle between the image's axes; 0 for a camera.
    pub shear: f64,
    /// Change of clip-space depth across the axis of view, relative to the change of w
    /// (of depth itself for an orthographic lens) along it; 0 for a camera, larger for
    /// an oblique near plane.
    pub tilt: f64,
}

impl ViewProjection {
    /// The frame and the lens that this matrix was made of.
    ///
    /// # Errors
    /// A view that no lens holds, such as one with near and far plane in one place.
    pub fn unprojected(&self) -> Result<Unprojected> {
        let depths = self.depths();
        let along = |row: usize| DVec3::from_slice(&self.rows[row]);
        let [x, y, z, w] = [0, 1, 2, 3].map(along);
        let axis = self.axis();
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
        // Only Vulkan's clip space has y downward.
        let up = match is_mirrored && self.convention() == MatrixConvention::ColumnD3d {
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
            depths,
            is_mirrored,
            image,
            shear: image[0].dot(image[1]).abs(),
            tilt: aside(z).length() / change.length(),
        })
    }

    /// Returns whether the image is sheared, or depth lies off the axis of view.
    ///
    /// `None` without a lens.
    pub fn is_sheared(&self) -> Option<bool> {
        let found = self.unprojected().ok()?;
        Some(found.shear > STRAIGHT || found.tilt > STRAIGHT)
    }

    /// Returns whether it has no lens: axes of unit length, and w is 1 everywhere.
    pub fn is_bare(&self) -> bool {
        let is_unit = |row: &[f64; 4]| (DVec3::from_slice(row).length() - 1.0).abs() < STRAIGHT;
        self.rows[..3].iter().all(is_unit) && self.rows[3] == [0.0, 0.0, 0.0, 1.0]
    }

    /// Clip-space depths of the near and the far plane.
    fn depths(&self) -> [f64; 2] {
        let lowest = if self.is_from_zero() { 0.0 } else { -1.0 };
        match self.is_reversed {
            false => [lowest, 1.0],
            true => [1.0, lowest],
        }
    }

    /// The centre of the near plane, and the way from there to that of the far plane;
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
    /// Returns `true` for an orthographic matrix, mirrored or with reversed depth.
    pub fn may_be_reversed(&self) -> bool {
        let is_doubtful = |matrix: &ViewProjection| {
            matrix.is_parallel && matrix.unprojected().is_ok_and(|found| found.is_mirrored)
        };
        self.lens.matrix().is_some_and(is_doubtful)
    }

    /// This camera with a frame and a lens of its own, whose rays are known.
    ///
    /// # Errors
    /// A matrix whose image is sheared or whose near plane is oblique; an orthographic
    /// one that does not say which end is near.
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
        if matrix.is_from_zero() && self.may_be_reversed() {
            return Err(CameraError::invalid(
                "the orthographic matrix has reversed depth or a mirrored image, so either end may be near",
                "eye_x.., look_x.. and ortho_height in its place",
            ));
        }
        Ok(found.camera)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::ClipSpace::{self, D3d, OpenGl, ReversedZ};
    use crate::camera::{MatrixConvention, look_at};
    use glam::{DMat4, DVec4};

    const EYE: DVec3 = DVec3::new(3.0, -2.0, 5.0);

    /// Reads a matrix as its user names it: by columns or, transposed, by rows.
    fn read(matrix: DMat4, clip: ClipSpace, by_rows: bool) -> Camera {
        let columns = matrix.to_cols_array_2d();
        let (entries, convention) = match (by_rows, clip) {
            (true, OpenGl) => (columns, MatrixConvention::RowGl),
            (true, _) => (columns, MatrixConvention::RowD3d),
            (false, clip) => {
                let rows = matrix.transpose().to_cols_array_2d();
                let is_gl = clip == OpenGl;
                let names = [MatrixConvention::ColumnD3d, MatrixConvention::ColumnGl];
                (rows, names[usize::from(is_gl)])
            }
        };
        Camera::of_matrix(entries, convention).expect("a camera")
    }

    fn taken_apart(camera: &Camera) -> Unprojected {
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

    /// Largest difference of edges, near and far, relative to the larger.
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

    #[test]
    fn a_matrix_is_the_camera_that_it_was_made_of() {
        let frame = look_at(EYE, DVec3::ZERO, DVec3::Z).unwrap();
        for lens in lenses() {
            for (clip, depths) in [
                (OpenGl, [-1.0, 1.0]),
                (D3d, [0.0, 1.0]),
                (ReversedZ, [1.0, 0.0]),
            ] {
                let parallel = lens.is_orthographic();
                if parallel && clip == ReversedZ {
                    continue;
                }
                let matrix = lens.projection(clip) * frame.world_to_eye();
                let rounded = matrix.to_cols_array().map(|entry| f64::from(entry as f32));
                for (matrix, slack) in [
                    (matrix, 1e-11),
                    (matrix * 7.0, 1e-11),
                    (DMat4::from_cols_array(&rounded), 1e-3),
                ] {
                    for by_rows in [false, true] {
                        let read = read(matrix, clip, by_rows);
                        let what = || format!("{lens:?} {clip:?} {slack}: {read:?}");
                        assert_eq!(read.lens.is_orthographic(), parallel, "{}", what());
                        let found = taken_apart(&read);
                        assert_eq!(found.depths, depths, "{}", what());
                        assert!(!found.is_mirrored && found.shear < 1e-5 && found.tilt < 1e-5);
                        let camera = read.unprojected().expect("rays");
                        assert_eq!(camera, found.camera);
                        let own = &camera.frame;
                        // The near plane's centre, of a lens that has no eye.
                        let at = if parallel { lens.near() } else { 0.0 };
                        let eye = frame.eye + frame.forward() * at;
                        assert!(own.eye.distance(eye) < slack * 40.0, "{}", what());
                        for (a, b) in [(own.u(), frame.u()), (own.n(), frame.n())] {
                            assert!(a.distance(b) < slack, "{}", what());
                        }
                        let off = difference(&camera.lens, &lens);
                        assert!(off < slack, "{}: {off:e}", what());
                    }
                }
            }
        }
    }

    #[test]
    fn a_mirrored_image_is_said_and_keeps_its_rays() {
        let frame = look_at(EYE, DVec3::ZERO, DVec3::Z).unwrap();
        let [lens, .., parallel, _] = lenses();
        let flip = DMat4::from_scale(DVec3::new(1.0, -1.0, 1.0));
        for (clip, by_rows, up) in [(D3d, false, 1.0), (D3d, true, -1.0), (OpenGl, false, -1.0)] {
            let camera = read(
                flip * lens.projection(clip) * frame.world_to_eye(),
                clip,
                by_rows,
            );
            let found = taken_apart(&camera);
            assert!(found.is_mirrored);
            assert!((found.camera.frame.v() - frame.v() * up).length() < 1e-12);
            assert!(difference(&found.camera.lens, &lens) < 1e-12);
        }
        // Reversed depth and a mirrored image make the same matrix.
        let unclear = read(
            parallel.projection(ReversedZ) * frame.world_to_eye(),
            ReversedZ,
            false,
        );
        let error = unclear.unprojected().unwrap_err().to_string();
        assert!(
            error.contains("either end") && error.contains("ortho_height"),
            "{error}"
        );
        // From -1 on there are rays, and a doubt.
        let turned = DMat4::from_scale(DVec3::new(1.0, 1.0, -1.0));
        for (change, is_doubtful) in [(DMat4::IDENTITY, false), (turned, true)] {
            let matrix = change * parallel.projection(OpenGl) * frame.world_to_eye();
            let camera = read(matrix, OpenGl, false);
            assert_eq!(camera.may_be_reversed(), is_doubtful);
            assert!(camera.unprojected().is_ok());
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
            let camera = read(matrix, OpenGl, false).unprojected().unwrap();
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
        // An oblique near plane in place of the lens's own (Lengyel 2005).
        let mut oblique = projection;
        oblique.x_axis.z = 0.2;
        for (matrix, wanted) in [
            (sheared, "sheared by 8.7e-3; expected"),
            (oblique, "oblique by 2.0e-1; expected"),
        ] {
            let camera = read(matrix * frame.world_to_eye(), OpenGl, false);
            let error = camera.unprojected().unwrap_err().to_string();
            assert!(error.contains(wanted), "{error}");
        }
    }
}
