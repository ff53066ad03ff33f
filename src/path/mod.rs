//! Camera paths: generated, recorded, or taken from the places of a scene.
//!
//! Generated families are in `families`, the longer ones in `street` and `walk`.

mod calibrate;
mod facts;
mod families;
mod recorded;
mod street;
mod walk;

use std::fmt::Display;
use std::path::Path;

use glam::DVec3;

use crate::camera::{Camera, CameraError, FARTHEST, Frame, Lens, LensKind, Surroundings};
use crate::geometry::Aabb;
use crate::input::{InputError, Result, names_file, read_file, warn};
use crate::scene::{self, PlaceView, Scene, SeededRng, WorldBox, memory, mix64};
use crate::shown::counted;
use crate::spec::{Spec, SpecError};

pub use facts::{CameraFacts, MatrixFacts};
pub(crate) use facts::{decomposed, is_downward, warnings};
pub use recorded::{LensDefaults, read_cameras_csv, read_points_csv};

/// The path through a scene if none is named.
pub(crate) const DEFAULT_PATH: &str = "flythrough";

/// A named sequence of cameras.
#[derive(Clone, Default, Debug)]
pub struct CameraPath {
    /// The file or the spec, such as `orbit:frames=512`.
    pub name: String,
    /// Cameras, in the order of the path.
    pub cameras: Vec<Camera>,
    /// Line of each camera in its file; empty for a spec.
    pub lines: Vec<u64>,
    /// Times of all cameras in seconds, ascending; empty if one has none.
    pub times: Vec<f64>,
    /// Scale of far that `visible=` has found.
    pub lens_scale: Option<f64>,
    /// Number of cameras of the whole path that are not among these.
    pub left_out: usize,
}

impl CameraPath {
    /// At most `most` of the cameras, evenly spread from the first on.
    pub fn at_most(mut self, most: usize) -> CameraPath {
        let all = self.cameras.len();
        thin(&mut self.cameras, most);
        self.left_out += all - self.cameras.len();
        thin(&mut self.lines, most);
        thin(&mut self.times, most);
        self
    }

    /// The path with far planes scaled so that a share of the items is visible.
    ///
    /// A known `scale` is used instead of a search.
    ///
    /// # Errors
    /// A share that no scale reaches.
    pub fn seeing(mut self, scene: &Scene, share: f64, scale: Option<f64>) -> Result<CameraPath> {
        let find = || calibrate::for_visible_share(&self.name, scene, &self.cameras, share);
        let scale = scale.map_or_else(find, Ok)?;
        self.cameras = calibrate::scaled(&self.name, &self.cameras, scale)?;
        self.lens_scale = Some(scale);
        Ok(self)
    }

    /// Label of a camera in messages: its line in the file, or its index.
    pub fn place(&self, index: usize) -> String {
        match self.lines.get(index) {
            Some(line) => format!("{}, line {line}", self.name),
            None => format!("path '{}', camera {index}", self.name),
        }
    }
}

/// At most `most` of `count` indices, evenly spread from the first on.
pub(crate) fn evenly(count: usize, most: usize) -> impl Iterator<Item = usize> + Clone {
    let chosen = count.min(most);
    (0..chosen).map(move |n| n * count / chosen)
}

/// At most `most` of `count` indices, one at a hashed position in each equal part.
///
/// Any prefix is spread over all indices, too.
pub(crate) fn scattered(count: usize, most: usize) -> impl Iterator<Item = usize> {
    let chosen = count.min(most);
    (0..chosen as u64).map(move |n| {
        // A prime, about 0.62 * 2^32.
        let part = (n * 0x9E37_79B1 % chosen as u64) as usize;
        let [begin, end] = [part, part + 1].map(|part| part * count / chosen);
        begin + mix64(part as u64) as usize % (end - begin)
    })
}

/// Keeps `most` elements, evenly spread.
fn thin<T: Copy>(all: &mut Vec<T>, most: usize) {
    *all = evenly(all.len(), most).map(|n| all[n]).collect();
}

/// SHA-256 over frames and lenses. O(n).
///
/// Paths with equal digests have equal answers in a scene.
pub fn digest(cameras: &[Camera]) -> String {
    let mut hash = hmac_sha256::Hash::new();
    let mut add = |value: f64| hash.update(value.to_bits().to_le_bytes());
    for Camera { frame, lens } in cameras {
        for axis in [frame.eye, frame.u(), frame.v(), frame.n()] {
            axis.to_array().into_iter().for_each(&mut add);
        }
        // The kind of the lens first. An infinite distance stands for no far plane; no lens can
        // have it otherwise.
        let depths = [lens.near(), lens.far().unwrap_or(f64::INFINITY)];
        let lens = match *lens.kind() {
            LensKind::Perspective { fovy_deg, aspect } => {
                [&[0.0, fovy_deg, aspect][..], &depths].concat()
            }
            LensKind::Orthographic { height, aspect } => {
                [&[1.0, height, aspect][..], &depths].concat()
            }
            LensKind::OffAxis { window } => [&[2.0][..], &window, &depths].concat(),
            LensKind::Matrix(matrix) => {
                let kind = if matrix.is_from_zero() { 4.0 } else { 3.0 };
                [&[kind], matrix.rows().as_flattened()].concat()
            }
        };
        lens.into_iter().for_each(&mut add);
    }
    scene::hex(&hash.finalize())
}

/// A kind of path.
pub struct PathFamily {
    /// Name on the command line.
    pub name: &'static str,
    /// One line for `cullbench list`.
    pub summary: &'static str,
    /// Parameters beyond [`PATH_PARAMS`], for the help.
    pub params: &'static str,
    frames: fn(&Stage, &mut Spec) -> Result<Vec<Pose>>,
}

/// All generated families, in the order of the help.
pub static PATHS: &[PathFamily] = rows! { PathFamily { name, summary, params, frames }
    "orbit", "a full circle about the scene, looking at its centre",
        "radius=0.6 (of half the scene's diagonal), height=0.35 (of the radius)", families::orbit;
    "flythrough", "a closed spline through seeded way points, looking ahead",
        "waypoints=8 (at least 4)", families::flythrough;
    "spin", "a full turn in place above the centre, at 0.3 of the height (yaw)", "", families::spin;
    "zoom", "a dolly towards the centre, then a zoom by field of view",
        "power=8 (magnification of the last view)", families::zoom;
    "teleport", "a new random place and direction every frame: no coherence", "", families::teleport;
    "outside", "the whole scene from outside, from all around", "", families::outside;
    "street", "eyes outside of every item, above the ground, looking level",
        "height=1.7 (above the ground), near=0.1", street::frames;
    "walk", "through the doors of rooms or a Doom map at constant height; posts and furniture are no obstacle",
        "height=1.7 (above a room's lower face; 41 above the floor in a Doom map), doors=32 (passed)", walk::frames;
    "places", "the scene's own camera places (things of a Doom map, cameras of glTF)",
        "frames=1000 (at most as many, evenly spread; all without it)", families::places;
    "animation", "the camera that the animation of a glTF file moves, at even times", "", families::animation;
};

/// Parameters that every generated path takes.
pub const PATH_PARAMS: &str = "frames=256, seed=1 (of random choices), fovy=60 (degrees), aspect=1.778 (16 by 9), near=far/1000 (at most the default far / 1000), \
     far=from the farthest eye to the centre and half the diagonal more (or inf), visible (choose far so that the six-plane test returns this share of the items on average, \
     false positives included, e.g. visible=2%, or this many of them, e.g. visible=2000)";

/// The error of a path that a scene cannot have: found and expected.
fn unfit(path: &str, reason: impl Display) -> InputError {
    InputError::new(format_args!("path '{path}': {reason}"))
}

/// Scene, length and seed of a path.
///
/// Coordinates, those of poses included, have z up: [`UpAxis::to_z_up`].
pub(crate) struct Stage<'a> {
    scene: &'a Scene,
    bounds: WorldBox,
    count: usize,
    seed: u64,
}

/// A camera whose far plane is not decided yet.
///
/// `magnification` divides the window (zoom by field of view).
#[derive(Clone, Copy)]
pub(crate) struct Pose {
    eye: DVec3,
    forward: DVec3,
    magnification: f64,
    view: Option<PlaceView>,
    /// Time in the scene's animation, if it moves the camera.
    time_s: Option<f64>,
}

impl Pose {
    fn new(eye: DVec3, forward: DVec3) -> Pose {
        Pose {
            eye,
            forward,
            magnification: 1.0,
            view: None,
            time_s: None,
        }
    }
}

impl Stage<'_> {
    /// Corners of an item or a room.
    fn in_world(&self, b: &Aabb) -> (DVec3, DVec3) {
        let (min, max) = b.in_world(self.scene.origin);
        (self.scene.up.to_z_up(min), self.scene.up.to_z_up(max))
    }

    fn centre(&self) -> DVec3 {
        self.bounds.min / 2.0 + self.bounds.max / 2.0
    }

    fn extent(&self) -> DVec3 {
        self.bounds.max - self.bounds.min
    }

    /// Half the diagonal; never zero.
    fn radius(&self) -> f64 {
        let half = self.extent().length() / 2.0;
        if half > 0.0 { half } else { 1.0 }
    }

    /// A height to fly at: inside the scene, or above it if it is flat.
    fn flight_level(&self, share: f64) -> f64 {
        let width = self.extent().x.max(self.extent().y);
        self.bounds.min.z + share * self.extent().z.max(0.1 * width)
    }

    fn rng(&self) -> SeededRng {
        SeededRng::new(self.seed)
    }

    /// `0/count, 1/count, ...`: positions on a closed path.
    fn turns(&self) -> impl Iterator<Item = f64> + use<> {
        let count = self.count;
        (0..count).map(move |i| i as f64 / count as f64)
    }
}

impl Scene {
    /// Origin and extent of this scene, for camera planes.
    pub fn surroundings(&self) -> Surroundings {
        let (origin, reach) = (self.origin, self.bounds.reach());
        Surroundings { origin, reach }
    }
}

/// Generates or reads a path: `orbit:frames=512`, or a cameras CSV.
///
/// An existing file takes precedence over a name.
///
/// # Errors
/// One line that names what was found and what was expected.
pub fn load(source: &str, scene: &Scene, defaults: &LensDefaults) -> Result<CameraPath> {
    load_scaled(source, scene, defaults, None)
}

/// [`load`] with a known scale of the lens.
///
/// The scale that an earlier load of this path has found ([`CameraPath::lens_scale`]); no new
/// search.
///
/// # Errors
/// The errors of [`load`].
pub fn load_scaled(
    source: &str,
    scene: &Scene,
    defaults: &LensDefaults,
    scale: Option<f64>,
) -> Result<CameraPath> {
    let path = read(source, scene, defaults, scale)?;
    let doubts = warnings(scene, &path.name, &path.cameras);
    doubts.iter().for_each(|text| warn(text));
    defaults.note_unused(&path);
    Ok(path)
}

fn read(
    source: &str,
    scene: &Scene,
    defaults: &LensDefaults,
    scale: Option<f64>,
) -> Result<CameraPath> {
    if names_file(source) {
        let bytes = read_file(Path::new(source))?;
        let rows = bytes.iter().filter(|byte| **byte == b'\n').count();
        fits(source, rows as u64)?;
        return read_cameras_csv(&bytes[..], source, &defaults.of_scene(scene));
    }
    let mut spec = Spec::parse(source)?;
    let Some(family) = PATHS.iter().find(|p| p.name == spec.name()) else {
        let known = PATHS.iter().map(|p| p.name);
        return Err(SpecError::unknown("path", spec.name(), known).into());
    };
    let WorldBox { min, max } = scene.world_bounds();
    let stage = Stage {
        scene,
        bounds: WorldBox::new(scene.up.to_z_up(min), scene.up.to_z_up(max)),
        count: spec.whole("frames", 256, 1..=1_000_000)? as usize,
        seed: spec.whole("seed", 1, 0..=u64::MAX)?,
    };
    fits(source, stage.count as u64)?;
    let poses = (family.frames)(&stage, &mut spec)?;
    let (cameras, visible) = cameras_at(source, &mut spec, defaults, &stage, &poses)?;
    let path = CameraPath {
        name: source.to_owned(),
        cameras,
        times: poses.iter().filter_map(|pose| pose.time_s).collect(),
        ..CameraPath::default()
    };
    match visible {
        Some(share) => path.seeing(scene, share, scale),
        None => Ok(path),
    }
}

/// Refuses more cameras than fit in memory.
fn fits(source: &str, cameras: u64) -> Result<()> {
    /// Bytes of a camera with its views and answers: 2,800 measured.
    const PER_CAMERA: u64 = 3000;
    let label = format!("path '{source}', {cameras} cameras");
    memory::check_fits(&label, cameras.saturating_mul(PER_CAMERA), 0, cameras)
}

/// Cameras at poses with the lens of a spec, and the requested visible share.
fn cameras_at(
    path: &str,
    spec: &mut Spec,
    defaults: &LensDefaults,
    stage: &Stage,
    poses: &[Pose],
) -> Result<(Vec<Camera>, Option<f64>)> {
    // Far enough to reach the far side of the scene from the farthest eye.
    let farthest = poses.iter().map(|p| (p.eye - stage.centre()).length());
    let natural = farthest.fold(0.0, f64::max) + stage.radius();
    let visible = spec.text("visible");
    let far = match (spec.text("far").as_deref(), &visible) {
        (Some(far), Some(visible)) => {
            let found = format_args!("far={far} beside visible={visible}; expected one of them");
            return Err(SpecError::new(found).into());
        }
        (Some("inf"), _) => None,
        (Some(_), _) => Some(spec.number("far", natural)?),
        (None, None) => defaults.far.unwrap_or(Some(natural)),
        (None, Some(_)) => Some(natural),
    };
    let far = far.filter(|far| *far <= FARTHEST);
    let near = match spec.text("near") {
        Some(_) => Some(spec.number("near", 0.0)?),
        // Items may be at arm's length from an eye between them.
        None if spec.name() == "street" => defaults.near.or(Some(0.1)),
        None => defaults.near,
    };
    // Otherwise the error would name the near plane that follows from far.
    if let Some(far) = far.filter(|far| near.is_none() && far / 1000.0 <= 0.0) {
        return Err(SpecError::new(format_args!(
            "in '{}': far is {far:?}; expected a number above 0 (or inf)",
            spec.name()
        ))
        .into());
    }
    let names = ["fovy", "aspect", "near", "far"];
    let [has_fovy, has_aspect, has_near, has_far] = names.map(|name| spec.text(name).is_some());
    let visible = visible.map(|text| visible_share(spec, &text, stage.scene.items.len()));
    let [fovy_deg, aspect] = defaults.shape();
    let fovy_deg = spec.number("fovy", fovy_deg)?;
    let aspect = spec.number("aspect", aspect)?;
    let near = near.unwrap_or(far.unwrap_or(natural).min(natural) / 1000.0);
    let visible = visible.transpose()?;
    spec.finish()?;
    // The lens of the place, unless parameters replace it; a requested share replaces far.
    let lens = |own: Option<PlaceView>| -> Result<Lens, CameraError> {
        let Some(own) = own else {
            return Lens::perspective(fovy_deg, aspect, near, far);
        };
        let aspect = own.aspect.filter(|_| !has_aspect).unwrap_or(aspect);
        let fovy_deg = own.fovy_deg.filter(|_| !has_fovy).unwrap_or(fovy_deg);
        let kind = match own.ortho_height.filter(|_| !has_fovy) {
            Some(height) => LensKind::Orthographic { height, aspect },
            None => LensKind::Perspective { fovy_deg, aspect },
        };
        let near = if has_near { near } else { own.near };
        let is_named = has_far || visible.is_some();
        let far = if is_named { far } else { own.far };
        Lens::new(kind, near, far.filter(|far| *far <= FARTHEST))
    };
    let up = stage.scene.up;
    let camera = |pose: &Pose| -> Result<Camera, CameraError> {
        let (ahead, own) = (pose.forward, pose.view.map(|view| view.up));
        let has_level = ahead.x.abs() + ahead.y.abs() > 1e-6 * ahead.z.abs();
        // y is up for a camera that looks straight up or down.
        let upward = own.unwrap_or(if has_level { DVec3::Z } else { DVec3::Y });
        let axes = [pose.eye, pose.forward, upward];
        let [eye, forward, upward] = axes.map(|v| up.from_z_up(v));
        let frame = Frame::looking_along(eye, forward, upward)?;
        let lens = lens(pose.view)?;
        let mut camera = Camera { frame, lens };
        if pose.magnification != 1.0 {
            camera.zoom(pose.magnification)?;
        }
        Ok(camera)
    };
    let numbered = poses.iter().enumerate().map(|(index, pose)| {
        camera(pose).map_err(|error| {
            InputError::new(format_args!("path '{path}', camera {index}: {error}"))
        })
    });
    Ok((numbered.collect::<Result<_>>()?, visible))
}

/// Parses `visible=2%`, a share of the items, or `visible=2000`, a count of them.
///
/// 1 would be ambiguous and is refused.
fn visible_share(spec: &mut Spec, text: &str, items: usize) -> Result<f64, SpecError> {
    let value = spec.number("visible", 0.0)?;
    if value > 0.0 && value < 1.0 && items > 0 {
        return Ok(value);
    }
    // 200 % is neither a valid share nor two items. All items cannot be calibrated for: there is a
    // path for that.
    if !text.ends_with('%') && value > 1.0 && value.fract() == 0.0 && value < items as f64 {
        return Ok(value / items as f64);
    }
    let count = match items {
        0 => " of at least one item".to_owned(),
        1..=2 => format!("; no count is possible of {}", counted(items, "item")),
        3 => " or a count of 2".to_owned(),
        _ => format!(" or a count from 2 to {}", items - 1),
    };
    Err(SpecError::new(format_args!(
        "visible={text}; expected a share between 0 and 1 (2%){count}"
    )))
}

#[cfg(test)]
mod tests;
