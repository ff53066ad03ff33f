//! What the points of the diagram are asked with: the toolkit's own cullings, and
//! the six-plane test in other numbers. From a camera to a view, and its names.

use serde::Serialize;

use super::other_numbers::{CentreExtent, DoubleDouble, Flushed, Formed, Fused, Interval};
use crate::camera::{Camera, CameraError, Frame, PlaneOptions, Pose, Surroundings};
use crate::culling::{CameraView, Culling, CullingError, CullingTest};
use crate::geometry::{Aabb, BoxBlocks};
use crate::index::MemoryUsage;
use crate::kernel::{Isa, Kernel, Work};
use crate::query::{AnyVolume, ItemId, Predicate as _, QueryVolume, each_volume};

named! {
    /// Numbers that a six-plane test can be carried out in beside the toolkit's
    /// own.
    #[derive(Clone, Copy, PartialEq, Eq, Debug)]
    pub enum OtherNumbers, OTHER_NUMBERS {
        Fused = "f32-fma", "f32 planes, products fused with sums";
        Flushed = "f32-flush", "f32 planes, subnormal numbers taken for zero (emulated, not timed)";
        CentreExtent = "f32-centre", "f32 planes, boxes as centre and half extent (a scan alone)";
        DoubleDouble = "double-double", "f64 planes, 106 bits, exact where those do not decide";
        Interval = "interval", "f64 planes, interval arithmetic, what is undecided is kept";
    }
}

/// A culling, or the six-plane test in other numbers with a factor of epsilon.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum PlaneTest {
    Culling(Culling),
    Other(OtherNumbers, f64),
    /// The default, with a frame whose axes are cross products in f64, rounded as
    /// they come: what a camera without the toolkit's care has.
    PlainFrame,
}

/// What a plane test is called: one each of test, arithmetic, planes and epsilon.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Names {
    /// Name of the culling test.
    pub test: &'static str,
    /// Name of the arithmetic.
    pub arithmetic: &'static str,
    /// Name of the derivation of the planes.
    pub planes: &'static str,
    /// Factor c of the planes' epsilon.
    pub epsilon: f64,
}

/// A view made for one camera.
#[derive(Clone, Debug)]
pub enum PointView {
    Camera(Box<CameraView>),
    Fused(Formed<Fused>),
    Flushed(Formed<Flushed>),
    CentreExtent(Formed<CentreExtent>),
    DoubleDouble(Formed<DoubleDouble>),
    Interval(Formed<Interval>),
}

/// Runs an expression with `view` bound to whatever view there is.
macro_rules! with_view {
    ($any:expr, $view:ident => $do:expr) => {
        match $any {
            PointView::Camera(camera) => each_volume!(camera.as_any(), $view => $do),
            PointView::Fused($view) => $do,
            PointView::Flushed($view) => $do,
            PointView::CentreExtent($view) => $do,
            PointView::DoubleDouble($view) => $do,
            PointView::Interval($view) => $do,
        }
    };
}

impl PointView {
    pub fn sees(&self, item: &Aabb) -> bool {
        with_view!(self, view => view.sees(item))
    }

    /// The toolkit's own view, which every structure can be asked with.
    pub fn as_any(&self) -> Option<AnyVolume<'_>> {
        match self {
            PointView::Camera(view) => Some(view.as_any()),
            _ => None,
        }
    }
}

impl PlaneTest {
    pub fn names(&self) -> Names {
        match self {
            PlaneTest::Culling(culling) => Names {
                test: culling.test.name(),
                arithmetic: culling.arithmetic.name(),
                planes: culling.planes.method.name(),
                epsilon: culling.planes.epsilon,
            },
            PlaneTest::Other(numbers, epsilon) => Names {
                arithmetic: numbers.name(),
                epsilon: *epsilon,
                ..PlaneTest::Culling(Culling::default()).names()
            },
            PlaneTest::PlainFrame => Names {
                planes: "frame-plain",
                ..PlaneTest::Culling(Culling::default()).names()
            },
        }
    }

    pub fn test(&self) -> CullingTest {
        match self {
            PlaneTest::Culling(culling) => culling.test,
            PlaneTest::Other(..) | PlaneTest::PlainFrame => CullingTest::SixPlane,
        }
    }

    /// Whether its time is that of such arithmetic, and not of an emulation.
    pub fn is_timed(&self) -> bool {
        !matches!(self, PlaneTest::Other(OtherNumbers::Flushed, _))
    }

    /// The six-plane test in every other numbers, f32 ones with and without
    /// epsilon.
    pub fn others() -> Vec<PlaneTest> {
        let epsilons = |numbers| -> &[f64] {
            match numbers {
                OtherNumbers::DoubleDouble | OtherNumbers::Interval => &[0.0],
                _ => &[0.0, crate::camera::DEFAULT_EPSILON],
            }
        };
        let all = OTHER_NUMBERS.iter().flat_map(|&(numbers, ..)| {
            let of = move |&epsilon: &f64| PlaneTest::Other(numbers, epsilon);
            epsilons(numbers).iter().map(of)
        });
        all.collect()
    }

    /// The view of a camera in a scene's local coordinates.
    ///
    /// # Errors
    /// Planes that do not fit their numbers.
    pub fn view(&self, camera: &Camera, around: &Surroundings) -> Result<PointView, CullingError> {
        let (numbers, epsilon) = match *self {
            PlaneTest::Culling(culling) => {
                let view = culling.view(camera, around)?;
                return Ok(PointView::Camera(Box::new(view)));
            }
            PlaneTest::PlainFrame => {
                let default = PlaneTest::Culling(Culling::default());
                return default.view(&with_plain_frame(camera)?, around);
            }
            PlaneTest::Other(numbers, epsilon) => (numbers, epsilon),
        };
        let options = PlaneOptions {
            epsilon,
            ..PlaneOptions::default()
        };
        let volume = || camera.volume(&options, around);
        let wide = || camera.convex_volume_f64(around);
        Ok(match numbers {
            OtherNumbers::Fused => PointView::Fused(Formed::of(volume()?.planes())),
            OtherNumbers::Flushed => PointView::Flushed(Formed::of(volume()?.planes())),
            OtherNumbers::CentreExtent => PointView::CentreExtent(Formed::of(volume()?.planes())),
            OtherNumbers::DoubleDouble => PointView::DoubleDouble(Formed::of(wide()?.planes())),
            OtherNumbers::Interval => PointView::Interval(intervals(camera, around)?),
        })
    }
}

/// The same camera with axes from the pose by rounded cross products.
fn with_plain_frame(camera: &Camera) -> Result<Camera, CameraError> {
    let (eye, forward, up) = match Pose::of(camera) {
        Pose::LookAt { eye, look, up } => (eye, look - eye, up),
        Pose::Forward { eye, forward, up } => (eye, forward, up),
    };
    let u = forward.cross(up).normalize();
    Ok(Camera {
        frame: Frame::looking_along(eye, forward, u.cross(forward))?,
        lens: camera.lens,
    })
}

/// The planes of a camera with what f64 leaves uncertain of them: docs/NUMERICS.md
/// ("No false negative") counts 8 units of 2^-53 of a normal, and 16 of all
/// magnitudes that its offset is the sum of.
fn intervals(camera: &Camera, around: &Surroundings) -> Result<Formed<Interval>, CameraError> {
    const UNIT: f64 = f64::EPSILON / 2.0;
    let local_eye = camera.frame.eye - around.origin;
    let eye = local_eye.abs() + camera.frame.eye.abs();
    let far = camera.lens.far().unwrap_or(0.0).abs();
    let size = eye.element_sum() + camera.lens.near().abs() + far;
    let wide = camera.convex_volume_f64(around)?;
    let interval = |plane| Interval::around(plane, 16.0 * UNIT, 16.0 * UNIT * size);
    Ok(Formed::new(wide.planes().iter().map(interval)))
}

/// The plain loop over blocks of sixteen boxes, by an instruction set.
pub struct Scan {
    boxes: BoxBlocks,
}

/// One query of a [`Scan`].
struct Scanned<'a, V> {
    boxes: &'a BoxBlocks,
    view: &'a V,
    out: &'a mut Vec<ItemId>,
}

impl<V: QueryVolume> Work for Scanned<'_, V> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let (mask, count) = (self.view.mask(), self.boxes.len());
        for (start, lanes, block) in self.boxes.range(0, count) {
            let mut kept = self.view.kept_lanes(isa, block, mask) & lanes;
            while kept != 0 {
                self.out.push((start as u32) + kept.trailing_zeros());
                kept &= kept - 1;
            }
        }
    }
}

impl Scan {
    /// Over items none of which may be empty: an empty box takes part as what it
    /// is not.
    pub fn new(items: &[Aabb]) -> Scan {
        let mut boxes = BoxBlocks::with_capacity(items.len());
        items.iter().for_each(|item| boxes.push(item));
        Scan { boxes }
    }

    /// Appends the ids of what is seen.
    pub fn see(&self, kernel: Kernel, view: &PointView, out: &mut Vec<ItemId>) {
        let boxes = &self.boxes;
        with_view!(view, view => kernel.run(Scanned { boxes, view, out }));
    }

    /// That of the boxes alone: ids are places.
    pub fn memory(&self) -> MemoryUsage {
        MemoryUsage {
            node_bytes: 0,
            item_bytes: self.boxes.bytes(),
        }
    }
}
