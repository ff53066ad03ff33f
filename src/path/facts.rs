//! Lenses of cameras as used, matrices as read, and warnings about cameras.
//!
//! Warnings are about another up axis, wrongly read matrices, eyes far outside, empty views.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::calibrate::{MOST_TESTS, every_nth};
use super::{CameraPath, LensDefaults};
use crate::camera::{Camera, FARTHEST, Lens, LensKind, PlaneOptions, Unprojected, ViewProjection};
use crate::input::note;
use crate::scene::{Scene, UpAxis};
use crate::shown::{counted, significant};

/// Lenses of all cameras; pairs are the smallest and the largest value.
#[derive(Clone, Default, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct CameraFacts {
    /// Vertical field of view, degrees; null if all lenses are orthographic.
    pub fovy_deg: Option<[f64; 2]>,
    /// Height of the view of orthographic lenses, world units.
    pub ortho_height: Option<[f64; 2]>,
    /// Width / height.
    pub aspect: Option<[f64; 2]>,
    /// Distance of the near plane; null without cameras.
    pub near: Option<[f64; 2]>,
    /// Distance of the far plane; null if infinite.
    pub far: [Option<f64>; 2],
    /// How matrices were read; null for cameras with an eye and a lens.
    pub matrix: Option<MatrixFacts>,
}

/// Decomposition of a path's first matrix.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct MatrixFacts {
    /// Name of the convention.
    pub convention: String,
    /// Clip-space depth of the near and the far plane.
    pub depth: [f64; 2],
    /// True for a matrix without an eye; the depths are those of the convention.
    #[serde(default)]
    pub is_orthographic: bool,
    /// Position of the camera, world coordinates.
    ///
    /// Without an eye the centre of the near plane.
    pub eye: [f64; 3],
    /// Direction to the right in the image.
    pub right: [f64; 3],
    /// Direction upward in the image.
    pub up: [f64; 3],
    /// Direction of view.
    pub forward: [f64; 3],
    /// True for a clip space with y downward or a left-handed world.
    pub is_mirrored: bool,
}

/// A camera and the decomposition of its matrix.
///
/// `None` for other cameras and for a matrix without a lens.
type Decomposed<'a> = (&'a Camera, Option<Box<Unprojected>>);

/// Decomposes matrices into frames and lenses, once for all facts and warnings.
///
/// Computed exactly.
pub fn decomposed(cameras: &[Camera]) -> Vec<Decomposed<'_>> {
    let of = |camera: &Camera| Some(Box::new(camera.lens.matrix()?.unprojected().ok()?));
    cameras.iter().map(|camera| (camera, of(camera))).collect()
}

impl CameraFacts {
    /// Facts of the cameras of a path, in a scene with an up axis.
    pub fn of(cameras: &[Camera], up: UpAxis) -> CameraFacts {
        let taken = decomposed(cameras);
        let one = |(camera, found): &Decomposed| {
            // For a matrix without a lens, the matrix itself.
            let own = |found: &Unprojected| found.camera.lens;
            let lens = found.as_deref().map_or(camera.lens, own);
            let height = lens.height_at(1.0).filter(|_| lens.is_orthographic());
            let [fovy_deg, aspect] = shape(&lens);
            let values = [fovy_deg, height, aspect, Some(lens.near())];
            let [fovy_deg, ortho_height, aspect, near] = values.map(|v| v.map(|v| [v; 2]));
            CameraFacts {
                fovy_deg,
                ortho_height,
                aspect,
                near,
                far: [lens.far(); 2],
                matrix: None,
            }
        };
        let all = taken.iter().map(one).reduce(CameraFacts::with);
        CameraFacts {
            matrix: MatrixFacts::of(&taken, up),
            ..all.unwrap_or_default()
        }
    }

    /// The facts of both; matrices of the first.
    pub fn with(self, other: CameraFacts) -> CameraFacts {
        let range = |[a, b]: [f64; 2], [c, d]: [f64; 2]| [a.min(c), b.max(d)];
        let both = |a: Option<_>, b| a.into_iter().chain(b).reduce(range);
        let [far, others] = [self.far, other.far].map(|f| f.map(|f| f.unwrap_or(f64::INFINITY)));
        CameraFacts {
            fovy_deg: both(self.fovy_deg, other.fovy_deg),
            ortho_height: both(self.ortho_height, other.ortho_height),
            aspect: both(self.aspect, other.aspect),
            near: both(self.near, other.near),
            far: range(far, others).map(|far| Some(far).filter(|far| far.is_finite())),
            matrix: self.matrix,
        }
    }
}

impl MatrixFacts {
    fn of(taken: &[Decomposed], up: UpAxis) -> Option<MatrixFacts> {
        let (camera, found) = taken.first()?;
        let (matrix, found) = (camera.lens.matrix()?, found.as_ref()?);
        let (frame, [x, y]) = (found.camera.frame, found.image);
        let y = if is_downward(taken, up) { -y } else { y };
        let along = |axis: DVec3, image: DVec3| axis * axis.dot(image).signum();
        let (right, up) = (along(frame.u(), x), along(frame.v(), y));
        let axes = [frame.eye, right, up, frame.forward()];
        let [eye, right, up, forward] = axes.map(|v| v.to_array());
        Some(MatrixFacts {
            convention: matrix.convention().name().to_owned(),
            depth: matrix.depths(),
            is_orthographic: found.camera.lens.is_orthographic(),
            eye,
            right,
            up,
            forward,
            is_mirrored: found.is_mirrored,
        })
    }
}

/// Returns whether y points down in the images of matrices (Vulkan).
///
/// The up axis of the scene decides, since an image is also mirrored in a left-handed world.
/// Cameras that look straight down prove neither, and OpenGL has y upward.
pub fn is_downward(taken: &[Decomposed], up: UpAxis) -> bool {
    let mut matrices = taken.iter().filter_map(|(camera, _)| camera.lens.matrix());
    matrices.all(ViewProjection::is_from_zero) && upward(taken, up) < -SLANTED
}

/// Mean of the y axes of mirrored images along the up axis; NaN without any.
fn upward(taken: &[Decomposed], up: UpAxis) -> f64 {
    let found = taken.iter().filter_map(|(_, found)| found.as_ref());
    let mirrored = found.filter(|found| found.is_mirrored);
    let along = mirrored.map(|found| found.image[1].dot(up.vector()));
    let [sum, count] = along.fold([0.0; 2], |[sum, count], along| [sum + along, count + 1.0]);
    sum / count
}

/// Sine of the least angle to straight up or down at which the up axis is clear.
const SLANTED: f64 = 0.1;

/// Vertical angle of view in degrees, and width / height.
fn shape(lens: &Lens) -> [Option<f64>; 2] {
    match *lens.kind() {
        LensKind::Perspective { fovy_deg, aspect } => [fovy_deg, aspect].map(Some),
        LensKind::Orthographic { aspect, .. } => [None, Some(aspect)],
        LensKind::OffAxis { window } => {
            let ([left, right, low, high], [_, _, bottom, top]) = (window, lens.window());
            let fovy = libm::atan(top) - libm::atan(bottom);
            [fovy.to_degrees(), (right - left) / (high - low)].map(Some)
        }
        LensKind::Matrix(_) => [None; 2],
    }
}

/// Distance, in scene diagonals, beyond which an eye is far outside.
const FAR_OUTSIDE: f64 = 3.0;

/// One line for each kind of warning about the cameras of a path.
pub fn warnings(scene: &Scene, path: &str, cameras: &[Camera]) -> Vec<String> {
    let (taken, told) = (decomposed(cameras), |doubt| format!("{path}: {doubt}"));
    // Axes and eye of a matrix that is read wrongly mean nothing.
    if let Some(only) = transposed(&taken) {
        return vec![told(only)];
    }
    let doubts = [
        bare(cameras),
        narrow(cameras),
        rolled(scene, &taken),
        sheared(&taken),
        left_handed(scene, &taken),
        shallow(&taken),
        upward_parallel(scene, cameras),
        far_outside(scene, cameras),
        blind(scene, cameras),
    ];
    doubts.into_iter().flatten().map(told).collect()
}

impl LensDefaults {
    /// Warns of options that have no effect on the cameras of a path.
    pub(super) fn note_unused(&self, path: &CameraPath) {
        let names = ["--fovy", "--aspect", "--near", "--far"];
        let endless = |far: Option<f64>| far.unwrap_or(f64::INFINITY);
        let of = |lens: &Lens| {
            let [fovy_deg, aspect] = shape(lens);
            let [near, far] = [lens.near(), endless(lens.far())].map(Some);
            [fovy_deg, aspect, near, far]
        };
        let far = self.far.map(|far| far.filter(|far| *far <= FARTHEST));
        let given = [self.fovy_deg, self.aspect, self.near, far.map(endless)];
        let has = |is: &dyn Fn(&Lens) -> bool| path.cameras.iter().any(|camera| is(&camera.lens));
        let is_unused =
            |at: &usize| given[*at].is_some() && !has(&|lens| of(lens)[*at] == given[*at]);
        let unused: Vec<&str> = (0..4).filter(is_unused).map(|at| names[at]).collect();
        if !unused.is_empty() {
            let what = "not used, its cameras have their own";
            note(&format!("{}: {what}: {}", path.name, unused.join(", ")));
        }
        if self.matrix.is_some() && !has(&|lens| lens.matrix().is_some()) {
            let what = "--matrix-convention is for cameras that are matrices";
            note(&format!("{}: {what}", path.name));
        }
    }
}

/// "2 of 8 cameras".
fn share<T>(part: usize, cameras: &[T]) -> String {
    format!("{part} of {}", counted(cameras.len(), "camera"))
}

/// The number of the cameras of a kind, if there are any.
fn share_of<T>(cameras: &[T], is_one: impl Fn(&&T) -> bool) -> Option<String> {
    let count = cameras.iter().filter(is_one).count();
    (count > 0).then(|| share(count, cameras))
}

/// View matrices without a projection, and projections without a view.
///
/// A view matrix alone sees two units of width and height.
fn bare(cameras: &[Camera]) -> Option<String> {
    let has =
        |camera: &Camera, kind: fn(&ViewProjection) -> bool| camera.lens.matrix().is_some_and(kind);
    let is_lens = |camera: &Camera| has(camera, ViewProjection::is_lens_only);
    if cameras.len() > 1 && cameras.iter().all(is_lens) {
        let what = "all matrices with the eye at 0 and the axes of the world, as without a view";
        return Some(format!("{what}; expected projection x view"));
    }
    let what = share_of(cameras, |camera| has(camera, ViewProjection::is_view_only))?;
    Some(format!(
        "{what} matrices without a lens (axes of length 1, w = 1); expected projection x view"
    ))
}

/// Perspectives so narrow that their angles may be in radians, if all are.
fn narrow(cameras: &[Camera]) -> Option<String> {
    let is_narrow = |camera: &Camera| shape(&camera.lens)[0].is_some_and(|fovy| fovy < 2.0);
    let is_doubtful = !cameras.is_empty() && cameras.iter().all(is_narrow);
    let what = "a field of view under 2 degrees in all cameras; fovy is in degrees, not in radians";
    is_doubtful.then(|| what.to_owned())
}

/// Orthographic matrices whose view would look down if near and far were swapped.
fn upward_parallel(scene: &Scene, cameras: &[Camera]) -> Option<String> {
    // Lights and maps look from above.
    let is_doubtful = |camera: &&Camera| {
        let is_matrix = camera.lens.matrix().is_some() && camera.lens.is_orthographic();
        is_matrix && camera.frame.forward().dot(scene.up.vector()) > -0.1
    };
    let first = cameras.iter().find(is_doubtful)?.lens.matrix()?;
    let what = share_of(cameras, is_doubtful)?;
    let other = first.convention().reversed().name();
    Some(format!(
        "{what} orthographic and not looking down; --matrix-convention {other} if near and far are \
         swapped"
    ))
}

/// Cameras whose up in the image is more than 45 degrees from the scene's.
fn rolled(scene: &Scene, taken: &[Decomposed]) -> Option<String> {
    let axes = |(camera, found): &Decomposed| {
        let own = camera.lens.matrix().is_none().then_some(camera.frame);
        let frame = found.as_ref().map(|found| found.camera.frame).or(own)?;
        // A mirrored image may have y downward.
        let is_mirrored = found.as_ref().is_some_and(|found| found.is_mirrored);
        Some((frame.u(), frame.v(), is_mirrored))
    };
    let all: Vec<(DVec3, DVec3, bool)> = taken.iter().filter_map(axes).collect();
    let against = |axis: UpAxis, (u, v, is_mirrored): &(DVec3, DVec3, bool)| {
        let [across, along] = [u, v].map(|own| own.dot(axis.vector()));
        // A view straight up or down has no roll.
        let is_known = across.hypot(along) > SLANTED;
        let along = if *is_mirrored { along.abs() } else { along };
        is_known.then_some((across.abs(), along))
    };
    let is_rolled = |axes: &&_| against(scene.up, axes).is_some_and(|(a, b)| b < a);
    // The horizon of a camera that is not rolled is level.
    let is_level = |axis, axes: &_| against(axis, axes).is_some_and(|(a, b)| a < 0.1 && b > 0.0);
    let rolled = || all.iter().filter(is_rolled);
    let (first, own) = (rolled().next()?.1, scene.up.name());
    let is_up = |axis: &UpAxis| rolled().filter(|axes| is_level(*axis, axes)).count();
    let mut others = UpAxis::ALL.into_iter().filter(|axis| *axis != scene.up);
    let Some(other) = others.find(|axis| 2 * is_up(axis) > rolled().count()) else {
        let (what, name) = (share(rolled().count(), taken), &scene.name);
        // -0 is 0.
        let [x, y, z] = first.to_array().map(|x| (x * 1e3).round() / 1e3 + 0.0);
        return Some(format!(
            "{what} rolled by more than 45 degrees, first with ({x:.3}, {y:.3}, {z:.3}) up; {own} \
             is up in {name}"
        ));
    };
    let count = all.iter().filter(|axes| is_level(other, axes)).count();
    let (what, other, name) = (share(count, taken), other.name(), &scene.name);
    // Formats that define an axis define a unit as well.
    let is_advised = scene.unit.is_none() && 2 * count >= taken.len();
    let advice = is_advised.then(|| format!("; --up {other} if it is the scene's"));
    let advice = advice.unwrap_or_default();
    Some(format!("{other} is up in {what}, {own} in {name}{advice}"))
}

/// Matrices that never reach depth -1: probably reversed, with depths from 0 to 1.
fn shallow(taken: &[Decomposed]) -> Option<String> {
    let is_shallow = |one: &&Decomposed| {
        let Camera { frame, lens } = one.0;
        // An oblique near plane has depth -1, and often no far plane.
        let is_read = lens.far().is_none() && !is_sheared(one);
        let matrix = lens.matrix().filter(|m| is_read && !m.is_from_zero());
        let along = |row: [f64; 4]| DVec3::from_slice(&row).dot(frame.forward());
        matrix.is_some_and(|m| (along(m.rows()[2]) / along(m.rows()[3])).abs() < 0.5)
    };
    let what = share_of(taken, is_shallow)?;
    Some(format!(
        "{what} read without a far plane, as depth -1 is never reached; --matrix-convention \
         column-d3d or row-d3d if depth is from 0 to 1"
    ))
}

/// Returns whether a matrix, as it is read, has no right angles.
fn is_sheared((_, found): &&Decomposed) -> bool {
    found.as_ref().is_some_and(|found| found.is_sheared())
}

/// Matrices that are no camera's, if all their transposes are.
fn transposed(taken: &[Decomposed]) -> Option<String> {
    let sheared = taken.iter().filter(is_sheared);
    let mut sheared = sheared.filter_map(|(camera, _)| camera.lens.matrix());
    let convention = sheared.clone().next()?.convention();
    let is_turned = |matrix: &ViewProjection| {
        let found = matrix.transposed().and_then(|m| m.unprojected().ok());
        found.is_some_and(|found| !found.is_sheared())
    };
    let are_all = sheared.all(is_turned);
    let what = share_of(taken, |one| are_all && is_sheared(one))?;
    Some(format!(
        "{what} read as {} sheared, their transposes are not; --matrix-convention {} if they are \
         transposed",
        convention.name(),
        convention.transposed().name()
    ))
}

/// Matrices that are no camera's.
fn sheared(taken: &[Decomposed]) -> Option<String> {
    let what = share_of(taken, is_sheared)?;
    Some(format!(
        "{what} sheared, or with an oblique near plane: image axes or depths at no right angles"
    ))
}

/// Matrices of a left-handed world with a scene whose format is right-handed.
fn left_handed(scene: &Scene, taken: &[Decomposed]) -> Option<String> {
    let is_right_handed = scene.unit.is_some() || scene.surfaces.is_some();
    // For parallel rays the near end of depth is unknown, and it decides this.
    let is_mirrored = |(camera, found): &Decomposed| {
        let found = found.as_ref().filter(|_| !camera.lens.is_orthographic());
        found.is_some_and(|found| found.is_mirrored)
    };
    let is_left_handed = taken.iter().all(is_mirrored) && upward(taken, scene.up) > SLANTED;
    let what = "all cameras mirrored, as in a left-handed world; capture its boxes instead of";
    (is_right_handed && is_left_handed).then(|| format!("{what} {}, its mirror image", scene.name))
}

/// Eyes many scene diagonals away.
fn far_outside(scene: &Scene, cameras: &[Camera]) -> Option<String> {
    let bounds = scene.world_bounds();
    let diagonal = (bounds.max - bounds.min).length();
    // Paths about a point treat its diagonal as 2.
    let diagonal = if diagonal > 0.0 { diagonal } else { 2.0 };
    let outside = |camera: &Camera| {
        let eye = camera.frame.eye;
        let away = eye - eye.clamp(bounds.min, bounds.max);
        // Squares may overflow f64.
        let distance = away.to_array().into_iter().fold(0.0, libm::hypot);
        // Parallel lines of sight may start anywhere.
        (distance > FAR_OUTSIDE * diagonal && !camera.lens.is_orthographic())
            .then_some(distance / diagonal)
    };
    let far: Vec<f64> = cameras.iter().filter_map(outside).collect();
    // A scene without items has no position.
    let farthest = far.iter().copied().reduce(f64::max);
    let farthest = farthest.filter(|_| !scene.items.is_empty())?;
    Some(format!(
        "{} more than {FAR_OUTSIDE} scene diagonals outside of {} as loaded, up to {}; expected the \
         scene's unit and axes",
        share(far.len(), cameras),
        scene.name,
        significant(farthest)
    ))
}

/// The warning that no view sees an item; samples views for large scenes.
fn blind(scene: &Scene, cameras: &[Camera]) -> Option<String> {
    let most = (MOST_TESTS / scene.items.len().max(1)).max(1);
    let sample = every_nth(cameras, most);
    let around = scene.surroundings();
    let sees_any = |camera: &Camera| {
        let volume = camera.volume(&PlaneOptions::default(), &around);
        // A camera without a view is an error elsewhere.
        volume.map_or(true, |volume| {
            volume.sees(&scene.bounds) && scene.items.iter().any(|b| volume.sees(b))
        })
    };
    let is_blind = !scene.items.is_empty() && !sample.is_empty() && !sample.iter().any(sees_any);
    is_blind.then(|| {
        let views = match (sample.len(), cameras.len()) {
            (_, 1) => "its view".to_owned(),
            (some, all) if some < all => format!("any of {some} of {all} views"),
            (_, all) => format!("any of {all} views"),
        };
        // Items may come into view once they move.
        let name = &scene.name;
        format!("nothing of {name} as loaded is visible in {views}")
    })
}
