//! Culling tests and arithmetics: from a camera to the volume that queries use.

mod extended;

use std::borrow::Cow;

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use crate::camera::{
    Camera, CameraError, DEFAULT_EPSILON, PlaneMethod, PlaneOptions, Surroundings, check_sums,
};
use crate::geometry::{
    Aabb, ConvexVolume, ConvexVolumeF64, PlaneF64, RelativeVolume, Spheres, sphere_cube,
};
use crate::query::AnyVolume;

use extended::farthest_corner;
pub(crate) use extended::{bounds, extended};

named! {
    /// The test of a box against the volume.
    #[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    #[non_exhaustive]
    pub enum CullingTest, TESTS {
        Sphere = "sphere", "outside if one plane has the item's bounding sphere on its outer side";
        #[default]
        SixPlane = "six-plane", "outside if one plane has the whole box on its outer side (p-vertex)";
        SixBox = "six-box", "six-plane, and the box must meet the volume's own axis-parallel bounds";
        Exact = "exact", "six-box, and the volume's silhouettes along the axes: no box too many";
    }
}

impl CullingTest {
    /// The items in the form that an index for this test holds.
    ///
    /// The boxes, or for `sphere` the cubes about their bounding spheres.
    pub fn items<'a>(self, items: &'a [Aabb]) -> Cow<'a, [Aabb]> {
        match self {
            CullingTest::Sphere => Cow::Owned(items.iter().map(sphere_cube).collect()),
            _ => Cow::Borrowed(items),
        }
    }
}

named! {
    /// Precision and coordinates of the test.
    #[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    #[non_exhaustive]
    pub enum Arithmetic, ARITHMETICS {
        ///
        /// Moved outward by epsilon by default.
        #[default]
        F32 = "f32", "f32 planes in scene coordinates (default)";
        F64 = "f64", "f64 planes, no epsilon";
        F32Relative = "f32-relative", "f32 planes about the eye, boxes moved there first";
    }
}

/// All choices: one point of the error-against-time diagram.
#[derive(Clone, Copy, PartialEq, Default, Debug)]
pub struct Culling {
    /// The test of boxes.
    pub test: CullingTest,
    /// Its precision and coordinates.
    pub arithmetic: Arithmetic,
    /// Derivation of its planes, and their epsilon.
    pub planes: PlaneOptions,
}

/// The failure to derive a volume.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CullingError {
    /// The camera's planes or lens do not allow it.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// Only f32 planes in scene coordinates have several derivations.
    #[error(
        "{arithmetic} planes come from the frame only, not from '{method}'; expected --planes frame"
    )]
    Method {
        /// Name of the arithmetic.
        arithmetic: &'static str,
        /// Name of the derivation.
        method: &'static str,
    },
    /// Spheres are tested in f32 only.
    #[error("the sphere test is made in f32 scene coordinates; expected --arithmetic f32")]
    Sphere,
}

/// A view made for one camera.
#[derive(Clone, Debug)]
pub enum CameraView {
    /// Planes in f32.
    Volume(ConvexVolume),
    /// Planes and a sphere per box, in f32.
    Spheres(Box<Spheres>),
    /// Planes in f64.
    PlanesF64(Box<ConvexVolumeF64>),
    /// Planes in f32 about the eye.
    Relative(RelativeVolume),
}

impl CameraView {
    /// The view as a query volume.
    pub fn as_any(&self) -> AnyVolume<'_> {
        match self {
            CameraView::Volume(view) => view.into(),
            CameraView::Spheres(view) => view.as_ref().into(),
            CameraView::PlanesF64(view) => view.as_ref().into(),
            CameraView::Relative(view) => view.into(),
        }
    }
}

impl Culling {
    /// A test in this arithmetic with planes derived in this way.
    pub fn new(test: CullingTest, arithmetic: Arithmetic, planes: PlaneOptions) -> Culling {
        Culling {
            test,
            arithmetic,
            planes,
        }
    }

    /// Every test in every arithmetic it supports, with planes derived in this way.
    pub fn all(planes: PlaneOptions) -> impl Iterator<Item = Culling> {
        let of_test = move |(test, ..): (CullingTest, &str, &str)| {
            ARITHMETICS.map(|(numbers, ..)| Culling::new(test, numbers, planes))
        };
        let all = TESTS.into_iter().flat_map(of_test);
        all.filter(|culling| culling.check().is_ok())
    }

    /// The view of a camera in a scene's local coordinates.
    ///
    /// The same view serves every structure. O(m^3) for the m planes of the lens, a few
    /// microseconds for `exact`.
    ///
    /// # Errors
    /// Planes that do not fit f32; invalid combinations.
    pub fn view(&self, camera: &Camera, around: &Surroundings) -> Result<CameraView, CullingError> {
        self.check()?;
        let local_eye = camera.frame.eye - around.origin;
        let more = self.more(camera, local_eye, around)?;
        let about_scene = more.iter().map(|plane| plane.about(-local_eye));
        match self.arithmetic {
            Arithmetic::F32 => {
                let more: Vec<PlaneF64> = about_scene.collect();
                let volume = camera.volume_with(&more, &self.planes, around)?;
                if self.test != CullingTest::Sphere {
                    return Ok(CameraView::Volume(volume));
                }
                // The index holds the cubes about the items' spheres.
                let reach = around.reach.as_dvec3();
                check_sums(&volume, reach + reach.length())?;
                Ok(CameraView::Spheres(Box::new(Spheres::new(&volume))))
            }
            Arithmetic::F64 => {
                let mut planes = camera.convex_volume_f64(around)?.planes().to_vec();
                planes.extend(about_scene);
                let volume = ConvexVolumeF64::from_planes(&planes).map_err(CameraError::from)?;
                Ok(CameraView::PlanesF64(Box::new(volume)))
            }
            Arithmetic::F32Relative => {
                let volume = camera.relative_volume(&more, self.planes.epsilon, around)?;
                Ok(CameraView::Relative(volume))
            }
        }
    }

    /// Checks that the choices can be combined.
    ///
    /// # Errors
    /// Names the conflicting choices.
    pub fn check(&self) -> Result<(), CullingError> {
        if self.arithmetic != Arithmetic::F32 {
            if self.planes.method != PlaneMethod::Frame {
                let (arithmetic, method) = (self.arithmetic.name(), self.planes.method.name());
                return Err(CullingError::Method { arithmetic, method });
            }
            if self.test == CullingTest::Sphere {
                return Err(CullingError::Sphere);
            }
        }
        Ok(())
    }

    /// Factor c of the planes' margin; 0 in f64, which has none.
    pub fn epsilon(&self) -> f64 {
        match self.arithmetic {
            Arithmetic::F64 => 0.0,
            _ => self.planes.epsilon,
        }
    }

    /// The reason why the planes may lose visible items.
    ///
    /// `None` if their margin is proven to suffice.
    pub fn unproven(&self) -> Option<String> {
        let epsilon = self.epsilon();
        let found = match self.planes.method {
            PlaneMethod::Frame if epsilon >= DEFAULT_EPSILON => return None,
            PlaneMethod::Frame if self.arithmetic == Arithmetic::F64 => "f64".to_owned(),
            // No negative zero; small numbers in exponential form.
            PlaneMethod::Frame => {
                let c = format!("{:?}", epsilon + 0.0);
                format!("c = {}", c.trim_end_matches(".0"))
            }
            method => format!("planes by {}", method.name()),
        };
        Some(format!(
            "the margin is proven for f32 planes of the frame with c = {DEFAULT_EPSILON} or more, \
             not for {found}: visible items may be lost"
        ))
    }

    /// Planes of the test besides the faces, relative to the eye.
    ///
    /// Derived in f64 from the planes of the camera basis, for every plane method: rounding can
    /// turn sums of rounded planes by more than the margin covers.
    fn more(
        &self,
        camera: &Camera,
        local_eye: DVec3,
        around: &Surroundings,
    ) -> Result<Vec<PlaneF64>, CameraError> {
        let of_test: fn(&[PlaneF64], f64) -> Vec<PlaneF64> = match self.test {
            CullingTest::Sphere | CullingTest::SixPlane => return Ok(Vec::new()),
            CullingTest::SixBox => bounds,
            CullingTest::Exact => extended,
        };
        let about_eye = Surroundings {
            origin: camera.frame.eye,
            ..Surroundings::default()
        };
        let faces = camera.convex_volume_f64(&about_eye)?;
        // Reach of the items relative to the eye, or of the volume if the items are unknown.
        let reach = match around.reach {
            Vec3::ZERO => farthest_corner(faces.planes()),
            of_scene => (of_scene.as_dvec3() + local_eye.abs()).length(),
        };
        Ok(of_test(faces.planes(), reach))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Frame, Lens, MatrixConvention, PLANE_METHODS};

    const AROUND: Surroundings = Surroundings {
        origin: DVec3::ZERO,
        reach: Vec3::splat(400.0),
    };

    fn of(test: CullingTest, arithmetic: Arithmetic) -> Culling {
        Culling {
            test,
            arithmetic,
            ..Culling::default()
        }
    }

    #[test]
    fn a_frustum_has_at_most_thirty_extended_planes() {
        let frame =
            Frame::looking_along(DVec3::ZERO, DVec3::new(3.0, 2.0, -1.0), DVec3::Z).unwrap();
        let lens = Lens::perspective(60.0, 1.5, 0.1, Some(100.0)).unwrap();
        let camera = Camera { frame, lens };
        let planes = |test| match of(test, Arithmetic::F32).view(&camera, &AROUND).unwrap() {
            CameraView::Volume(volume) => volume.planes().len(),
            other => panic!("{other:?}"),
        };
        assert_eq!(planes(CullingTest::SixPlane), 6);
        assert_eq!(planes(CullingTest::SixBox), 12);
        let exact = planes(CullingTest::Exact);
        assert!((24..=30).contains(&exact), "{exact}");
    }

    /// A view 1e8 times as high as wide.
    ///
    /// Weights of its planes' sums are as small as their rounding. Boxes are at least a tenth of
    /// the half-width away from its sides.
    #[test]
    fn nothing_in_the_middle_of_a_needle_is_lost_in_any_arithmetic() {
        let frame = Frame::looking_along(DVec3::ZERO, -DVec3::Z, DVec3::Y).unwrap();
        let around = Surroundings {
            origin: DVec3::ZERO,
            reach: Vec3::splat(500.0),
        };
        for (fovy, aspect) in [(1e-6, 1e-8), (1e-5, 1e-7), (1e-9, 1e-8), (1e-3, 1e-4)] {
            let lens = Lens::perspective(fovy, aspect, 1.0, Some(1000.0)).unwrap();
            let camera = Camera { frame, lens };
            let half = 500.0 * libm::tan(f64::to_radians(fovy) / 2.0) * aspect;
            for (test, name, _) in TESTS {
                for (arithmetic, number, _) in ARITHMETICS {
                    let culling = of(test, arithmetic);
                    if culling.check().is_err() {
                        continue;
                    }
                    let view = culling.view(&camera, &around).unwrap();
                    for share in [-0.9, -0.5, 0.0, 0.1, 0.5, 0.9] {
                        let at = Vec3::new((half * share) as f32, 0.0, -500.0);
                        assert!(
                            view.as_any().sees(&Aabb::new(at, at)),
                            "{name} {number}, {fovy} by {aspect}: {share} is lost"
                        );
                    }
                }
            }
        }
    }

    /// A box that sums of rounded planes cut off, in a view of 178 degrees.
    #[test]
    fn every_derivation_keeps_what_sums_of_its_own_planes_would_lose() {
        let (forward, up) = (DVec3::new(0.16, 0.88, 0.45), DVec3::new(-0.17, 0.47, -0.87));
        let frame = Frame::looking_along(DVec3::new(8.5, -10.0, 1.0), forward, up).unwrap();
        let lens = Lens::perspective(178.0, 16.0 / 9.0, 0.1, Some(100.0)).unwrap();
        let corner = Vec3::new(8_964.66, 2_146.831_8, -7_189.876_5);
        let item = Aabb::new(corner, Vec3::new(15_958.212, 2_261.151_9, -7_187.773_4));
        let around = Surroundings {
            origin: DVec3::ZERO,
            reach: item.reach(),
        };
        for (method, planes, _) in PLANE_METHODS {
            for (test, name, _) in TESTS {
                let mut culling = of(test, Arithmetic::F32);
                culling.planes.method = method;
                let view = culling.view(&Camera { frame, lens }, &around).unwrap();
                let sees = view.as_any().sees(&test.items(&[item])[0]);
                assert!(sees, "{name} {planes}");
                assert_eq!(culling.unproven().is_some(), planes != "frame");
            }
        }
        let with = |epsilon| {
            let mut culling = Culling::default();
            culling.planes.epsilon = epsilon;
            culling.unproven().is_some()
        };
        assert_eq!([0.0, 7.9, 8.0].map(with), [true, true, false]);
        let f64 = of(CullingTest::SixPlane, Arithmetic::F64);
        assert!(f64.unproven().is_some() && f64.epsilon() == 0.0);
    }

    /// A window of 40 by 40 seen from far away: its planes are 20 from zero.
    #[test]
    fn an_eye_far_away_widens_no_plane_of_a_matrix() {
        let cube = |x: f32| Aabb::new(Vec3::new(x, 0.0, 0.0), Vec3::new(x + 1.0, 1.0, 1.0));
        for power in [6, 15, 18, 38, 60] {
            let far = 10f64.powi(power);
            let rows = [
                [far / 20.0, 0.0, 0.0, 0.0],
                [0.0, far / 20.0, 0.0, 0.0],
                [0.0, 0.0, -far / 50.0, 0.0],
                [0.0, 0.0, -1.0, far],
            ];
            let camera = Camera::of_matrix(rows, MatrixConvention::ColumnGl).unwrap();
            for (test, name, _) in TESTS {
                let view = of(test, Arithmetic::F32).view(&camera, &AROUND).unwrap();
                let sees = |b| view.as_any().sees(&test.items(&[b])[0]);
                assert!(sees(cube(0.0)) && !sees(cube(50.0)), "{name} 1e{power}");
            }
        }
    }

    /// Only the test's own planes are too large for f32.
    #[test]
    fn further_planes_that_f32_cannot_hold_are_left_out() {
        let frame = Frame::looking_along(DVec3::ZERO, DVec3::new(0.6, 0.0, -0.8), DVec3::Y);
        let lens = Lens::perspective(90.0, 1.0, 1e-3, Some(1.6e38)).unwrap();
        let frame = frame.unwrap();
        let around = Surroundings {
            origin: DVec3::ZERO,
            reach: Vec3::splat(1e30),
        };
        let view = |test, arithmetic| of(test, arithmetic).view(&Camera { frame, lens }, &around);
        for arithmetic in [Arithmetic::F32, Arithmetic::F32Relative] {
            assert!(view(CullingTest::SixPlane, arithmetic).is_ok());
            for test in [CullingTest::SixBox, CullingTest::Exact] {
                view(test, arithmetic).unwrap();
            }
        }
    }

    #[test]
    fn combinations_that_make_no_sense_are_refused() {
        let frame = Frame::looking_along(DVec3::ZERO, DVec3::X, DVec3::Z).unwrap();
        let lens = Lens::perspective(60.0, 1.5, 0.1, Some(100.0)).unwrap();
        let camera = Camera { frame, lens };
        for arithmetic in [Arithmetic::F64, Arithmetic::F32Relative] {
            let sphere = of(CullingTest::Sphere, arithmetic);
            assert!(matches!(
                sphere.view(&camera, &AROUND),
                Err(CullingError::Sphere)
            ));
            let mut matrix = of(CullingTest::SixPlane, arithmetic);
            matrix.planes.method = PlaneMethod::GhGlF32;
            let error = matrix.view(&camera, &AROUND).unwrap_err();
            assert!(error.to_string().contains("--planes frame"), "{error}");
        }
    }

    #[test]
    fn cameras_whose_planes_f32_cannot_hold_are_refused() {
        let frame = Frame::looking_along(DVec3::ZERO, -DVec3::Z, DVec3::Y).unwrap();
        let lens = Lens::perspective(60.0, 1.5, 1.0, Some(9.0)).unwrap();
        for power in [130.0, 200.0, 1000.0] {
            let beyond = libm::exp2(power);
            let mut away = Camera { frame, lens };
            away.frame.eye.z = beyond;
            for (test, name, _) in TESTS {
                let view = of(test, Arithmetic::F32).view(&away, &Surroundings::default());
                let error = view.err();
                assert!(
                    matches!(error, Some(CullingError::Camera(CameraError::Volume(_)))),
                    "{name} 2^{power}: {error:?}"
                );
            }
            // A far plane that distant is omitted.
            assert_eq!(lens.with_far(Some(beyond)).unwrap().far(), None);
        }
    }
}
