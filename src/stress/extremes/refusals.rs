//! What must be refused, each with the typed error that is owed: impossible
//! cameras and lenses, planes and items that are no numbers, volumes beyond
//! f32. Accepting one of them is a failure.

use glam::{DVec3, Vec3};

use super::{ALL_STRUCTURES, Row};
use crate::camera::{Camera, CameraError, Frame, Lens, PlaneMethod, Surroundings, look_at};
use crate::culling::{Arithmetic, Culling, CullingError, CullingTest, TESTS};
use crate::geometry::{Aabb, ConvexVolume, Plane, VolumeError};
use crate::index::{BuildError, StructureSpec};
use crate::stress::{Level, Section, Status};

/// All refusals: a section of their own.
pub fn refusals(structures: &[StructureSpec]) -> Section {
    let mut section = Section::new("generated refusals");
    let mut owed = Owed(&mut section);
    owed.frames();
    owed.lenses();
    owed.planes();
    owed.views();
    owed.items(structures);
    section
}

struct Owed<'a>(&'a mut Section);

/// An attempt, the error it owes and whether that is the one it gave.
macro_rules! owed {
    ($owed:expr, $level:expr, $test:expr, $id:expr, $attempt:expr, $error:pat) => {{
        let outcome = $attempt.map(|_| ());
        let right = matches!(outcome, Err($error));
        let got = match outcome {
            Ok(()) => "accepted".to_owned(),
            Err(error) => error.to_string(),
        };
        let expected = stringify!($error).replace(" { .. }", "").replace("(_)", "");
        $owed.row($id, $level, ALL_STRUCTURES, $test, right, &expected, got);
    }};
}

impl Owed<'_> {
    #[expect(clippy::too_many_arguments, reason = "the fields of a row")]
    fn row(
        &mut self,
        id: String,
        level: Level,
        structure: &str,
        test: &str,
        right: bool,
        expected: &str,
        got: String,
    ) {
        self.0.cases += 1;
        self.0.rows.push(Row {
            id: format!("refusals/{id}"),
            level,
            structure: structure.to_owned(),
            test: test.to_owned(),
            status: match right {
                true => Status::Refused,
                false => Status::Fail,
            },
            expected: expected.into(),
            got: got.into(),
        });
    }

    fn frames(&mut self) {
        let (zero, ahead, up) = (DVec3::ZERO, -DVec3::Z, DVec3::Y);
        let at = |eye, look, up| look_at(eye, look, up);
        for length in [1.0, 1e-300, 1e300] {
            let id = |what: &str| format!("{what}/{length:e}");
            let same = DVec3::splat(length);
            owed!(
                self,
                Level::Camera,
                "camera",
                id("eye is look"),
                at(same, same, up),
                CameraError::EyeIsLook
            );
            let parallel = at(zero, up * length, up);
            owed!(
                self,
                Level::Camera,
                "camera",
                id("up parallel"),
                parallel,
                CameraError::UpParallel
            );
            let oblique = DVec3::new(1.0, 2.0, 2.0);
            let parallel = at(zero, oblique * length, -oblique);
            owed!(
                self,
                Level::Camera,
                "camera",
                id("up opposite"),
                parallel,
                CameraError::UpParallel
            );
        }
        owed!(
            self,
            Level::Camera,
            "camera",
            "up zero".into(),
            at(zero, ahead, zero),
            CameraError::UpParallel
        );
        for (word, bad) in NO_NUMBERS {
            for axis in 0..3 {
                let mut broken = DVec3::ONE;
                broken[axis] = bad;
                let id = |what: &str| format!("{what} {word}/axis {axis}");
                owed!(
                    self,
                    Level::Camera,
                    "camera",
                    id("eye"),
                    at(broken, ahead, up),
                    CameraError::NotFinite { .. }
                );
                owed!(
                    self,
                    Level::Camera,
                    "camera",
                    id("look"),
                    at(zero, broken, up),
                    CameraError::NotFinite { .. }
                );
                owed!(
                    self,
                    Level::Camera,
                    "camera",
                    id("up"),
                    at(zero, ahead, broken),
                    CameraError::NotFinite { .. }
                );
            }
        }
    }

    fn lenses(&mut self) {
        let lens = Lens::perspective;
        for fov in [
            0.0,
            -0.0,
            -1.0,
            180.0,
            180.00001,
            360.0,
            f64::NAN,
            f64::INFINITY,
        ] {
            let made = lens(fov, 1.5, 1.0, Some(9.0));
            owed!(
                self,
                Level::Camera,
                "camera",
                format!("fov/{fov}"),
                made,
                CameraError::FieldOfView { .. }
            );
        }
        for aspect in [0.0, -1.5, f64::NAN, f64::INFINITY] {
            let made = lens(60.0, aspect, 1.0, Some(9.0));
            owed!(
                self,
                Level::Camera,
                "camera",
                format!("aspect/{aspect}"),
                made,
                CameraError::Aspect { .. }
            );
        }
        for near in [0.0, -0.0, -1.0, -1e-300] {
            for far in [Some(9.0), None] {
                let id = format!("near/{near}, far {far:?}");
                owed!(
                    self,
                    Level::Camera,
                    "camera",
                    id,
                    lens(60.0, 1.5, near, far),
                    CameraError::Near { .. }
                );
            }
        }
        for (near, far) in [(8.0, 8.0), (8.0, 4.0), (1e-300, 0.0), (1.0, -9.0)] {
            let id = format!("near and far/{near}, {far}");
            owed!(
                self,
                Level::Camera,
                "camera",
                id,
                lens(60.0, 1.5, near, Some(far)),
                CameraError::NearFar { .. }
            );
        }
        for (word, bad) in NO_NUMBERS {
            let near = lens(60.0, 1.5, bad, None);
            owed!(
                self,
                Level::Camera,
                "camera",
                format!("near {word}"),
                near,
                CameraError::NotFinite { .. }
            );
            let far = lens(60.0, 1.5, 1.0, Some(bad));
            owed!(
                self,
                Level::Camera,
                "camera",
                format!("far {word}"),
                far,
                CameraError::NotFinite { .. }
            );
        }
        let window = |window| Lens::off_axis(window, 1.0, None);
        let flat = window([1.0, 1.0, 0.0, 1.0]);
        owed!(
            self,
            Level::Camera,
            "camera",
            "window/flat".into(),
            flat,
            CameraError::Window { .. }
        );
        let inverted = window([0.0, 1.0, 1.0, 0.0]);
        owed!(
            self,
            Level::Camera,
            "camera",
            "window/inverted".into(),
            inverted,
            CameraError::Window { .. }
        );
    }

    fn planes(&mut self) {
        let sound = Plane::new(Vec3::X, 1.0);
        for (word, bad) in NO_NUMBERS {
            for place in 0..4 {
                let mut numbers = [1.0, 2.0, 3.0, 4.0f32];
                numbers[place] = bad as f32;
                let [x, y, z, d] = numbers;
                let broken = Plane::new(Vec3::new(x, y, z), d);
                let made = ConvexVolume::from_planes(&[sound, broken, sound]);
                let id = format!("plane {word}/number {place}");
                owed!(
                    self,
                    Level::Planes,
                    "planes",
                    id,
                    made,
                    VolumeError::NonFinitePlane { index: 1, .. }
                );
            }
        }
        let many = ConvexVolume::from_planes(&[sound; 33]);
        owed!(
            self,
            Level::Planes,
            "planes",
            "planes/33".into(),
            many,
            VolumeError::TooManyPlanes { count: 33 }
        );
    }

    /// Cameras that are sound but whose planes f32 cannot hold, and choices
    /// that make no sense together.
    fn views(&mut self) {
        let frame = Frame::looking_along(DVec3::ZERO, -DVec3::Z, DVec3::Y);
        let lens = Lens::perspective(60.0, 1.5, 1.0, Some(9.0));
        let (Ok(frame), Ok(lens)) = (frame, lens) else {
            let text = "the camera of this test".to_owned();
            self.row(
                "camera".into(),
                Level::Camera,
                ALL_STRUCTURES,
                "camera",
                false,
                "made",
                text,
            );
            return;
        };
        let around = Surroundings::default();
        let deep = |far: f64| lens.with_far(Some(far)).unwrap_or(lens);
        for (test, name, _) in TESTS {
            let culling = Culling {
                test,
                ..Culling::default()
            };
            for power in [130.0, 200.0, 1000.0] {
                let beyond = libm::exp2(power);
                let mut away = Camera { frame, lens };
                away.frame.eye = DVec3::new(0.0, 0.0, beyond);
                let id = format!("beyond f32/eye 2^{power}");
                let view = culling.view(&away, &around);
                owed!(
                    self,
                    Level::Camera,
                    name,
                    id,
                    view,
                    CullingError::Camera(CameraError::Volume(_))
                );
                let view = culling.view(
                    &Camera {
                        frame,
                        lens: deep(beyond),
                    },
                    &around,
                );
                let id = format!("beyond f32/far 2^{power}");
                owed!(
                    self,
                    Level::Camera,
                    name,
                    id,
                    view,
                    CullingError::Camera(CameraError::Volume(_))
                );
            }
        }
        let camera = Camera { frame, lens };
        for arithmetic in [Arithmetic::F64, Arithmetic::F32Relative] {
            let mut culling = Culling {
                test: CullingTest::Sphere,
                arithmetic,
                ..Culling::default()
            };
            let id = format!("sphere/{}", arithmetic.name());
            owed!(
                self,
                Level::Camera,
                "sphere",
                id,
                culling.view(&camera, &around),
                CullingError::Sphere
            );
            culling.test = CullingTest::SixPlane;
            culling.planes.method = PlaneMethod::GhGlF32;
            let id = format!("matrix planes/{}", arithmetic.name());
            owed!(
                self,
                Level::Camera,
                "six-plane",
                id,
                culling.view(&camera, &around),
                CullingError::Method { .. }
            );
        }
    }

    /// Each bound of an item in turn, in each structure.
    fn items(&mut self, structures: &[StructureSpec]) {
        let sound = Aabb::new(Vec3::ZERO, Vec3::ONE);
        for spec in structures {
            for (word, bad) in NO_NUMBERS {
                for bound in 0..6 {
                    let mut broken = sound;
                    let corner = if bound < 3 {
                        &mut broken.min
                    } else {
                        &mut broken.max
                    };
                    corner[bound % 3] = bad as f32;
                    let built = spec.build(&[sound, sound, broken, sound]);
                    let right = matches!(built, Err(BuildError::NonFiniteItem { item: 2, .. }));
                    let got = match built {
                        Ok(_) => "accepted".to_owned(),
                        Err(error) => error.to_string(),
                    };
                    let id = format!("item {word}/bound {bound}");
                    let expected = "BuildError::NonFiniteItem: item 2";
                    self.row(
                        id,
                        Level::Planes,
                        &spec.label,
                        "build",
                        right,
                        expected,
                        got,
                    );
                }
            }
        }
    }
}

const NO_NUMBERS: [(&str, f64); 3] = [
    ("NaN", f64::NAN),
    ("infinite", f64::INFINITY),
    ("minus infinite", f64::NEG_INFINITY),
];
