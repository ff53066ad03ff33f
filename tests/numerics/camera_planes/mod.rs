//! Positions of the planes and matrices of a camera.
//!
//! Every named plane is tested with probe points on both sides, in every convention,
//! against a camera written out by hand. The matrices of glam and the look-at matrix of
//! the lecture must agree with ours; the controls must turn and slide as in the lecture.

mod controls;
mod matrices;
mod planes;

use std::cell::RefCell;
use std::collections::BTreeMap;

use super::by_hand::{Kind, Setup, View};
use cullbench::camera::{
    Camera, ClipSpace, Frame, PLANE_METHODS, PlaneMethod, PlaneOptions, Surroundings, look_at,
};
use cullbench::geometry::{ConvexVolume, FrustumPlane};
use glam::dcamera::rh::{proj, view};
use glam::{DMat4, DQuat, DVec3, DVec4, Vec4Swizzles};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed, TestRunner};

/// Half an ulp of 1 in f32.
const U: f64 = 1.0 / (1u64 << 24) as f64;
/// Depth at which an infinite volume is probed, as a multiple of the near distance.
const DEEP: f64 = 1000.0;

/// Always the same cameras, and no files of failures.
fn seeded(cases: u32) -> Config {
    Config {
        cases,
        rng_seed: RngSeed::Fixed(0x6361_6d65_7261),
        failure_persistence: None,
        ..Config::default()
    }
}

/// Perspective, its infinite far plane, orthographic, off-axis, and its
/// infinite far plane, about as large as each other.
fn lenses(
    fovy_deg: f64,
    aspect: f64,
    shift: f64,
    near: f64,
    far: f64,
) -> [(Kind, f64, Option<f64>); 5] {
    let y = near * (fovy_deg.to_radians() / 2.0).tan();
    let (x, dx, dy) = (y * aspect, 1.7 * shift * y * aspect, -shift * y);
    let window = [dx - x, dx + x, dy - y, dy + y];
    let (perspective, off_axis) = (
        Kind::Perspective { fovy_deg, aspect },
        Kind::OffAxis { window },
    );
    let height = 2.0 * y / near * far.min(50.0 * near);
    [
        (perspective, near, Some(far)),
        (perspective, near, None),
        // Behind the eye as well: an orthographic lens has no centre.
        (Kind::Orthographic { height, aspect }, -0.5 * far, Some(far)),
        (off_axis, near, Some(far)),
        (off_axis, near, None),
    ]
}

fn setups(eye: DVec3, look: DVec3, up: DVec3, lens: [f64; 5]) -> Vec<Setup> {
    let [fovy_deg, aspect, shift, near, far] = lens;
    let lenses = lenses(fovy_deg, aspect, shift, near, far);
    let with = |(kind, near, far)| Setup {
        eye,
        look,
        up,
        kind,
        near,
        far,
    };
    lenses.map(with).to_vec()
}

/// Cameras that a person would think of: along axes, up on any side, far off,
/// upside down, nearly looking along up.
fn hand_picked() -> Vec<Setup> {
    let v = DVec3::new;
    let frames = [
        (DVec3::ZERO, v(0.0, 0.0, -1.0), DVec3::Y),
        (v(0.0, 0.0, 1.0), DVec3::ZERO, DVec3::Y),
        (v(1.0, 2.0, 3.0), v(4.0, 3.0, -2.0), DVec3::Y),
        (DVec3::ZERO, DVec3::X, DVec3::Z),
        (DVec3::ZERO, DVec3::Y, -DVec3::X),
        (v(5.0, -7.0, 2.0), v(5.0, 1.0, 2.0), v(0.1, 0.0, -20.0)),
        (v(-3.0, 0.5, 8.0), v(2.0, -4.0, 1.0), v(0.0, -1.0, 0.0)),
        (v(1e4, -2e4, 500.0), v(1e4 + 3.0, -2e4, 501.0), DVec3::Z),
        (v(-1e5, 1e5, 1e5), v(-1e5, 1e5 + 1.0, 1e5 + 1.0), DVec3::X),
        (v(0.2, 0.3, 0.4), v(0.2, -0.7, 0.4 - 1e-3), v(0.0, 1e3, 0.0)),
        (DVec3::ZERO, v(1e-9, 1e-9, -1e-9), v(1e-6, 2e-6, 0.0)),
    ];
    let lens = [
        [60.0, 1.5, 0.0, 0.5, 100.0],
        [90.0, 1.0, 0.3, 1.0, 8.0],
        [20.0, 2.5, -2.0, 0.1, 100.0],
        [130.0, 0.5, 0.9, 2.0, 5.0],
    ];
    let all = frames
        .iter()
        .flat_map(|&(eye, look, up)| lens.iter().flat_map(move |&l| setups(eye, look, up, l)));
    all.collect()
}

fn vector(lowest: i32, highest: i32) -> impl Strategy<Value = DVec3> {
    let component = -1.0f64..1.0;
    let size = f64::from(lowest)..f64::from(highest);
    ([component.clone(), component.clone(), component], size)
        .prop_map(|(c, size)| DVec3::from_array(c) * 10f64.powf(size))
}

/// Any camera; far/near up to 10^`depth`.
fn any_setups(depth: f64) -> impl Strategy<Value = Vec<Setup>> {
    let lens = (
        2.0f64..150.0,
        0.2f64..4.0,
        -3.0f64..3.0,
        -2.0f64..1.0,
        0.1..depth,
    );
    (vector(-2, 5), vector(-3, 3), vector(-3, 3), lens)
        .prop_filter("an up vector off the view", |(_, forward, up, _)| {
            let sine = forward.cross(*up).length() / (forward.length() * up.length());
            sine > 1e-3
        })
        .prop_map(|(eye, forward, up, (fovy, aspect, shift, near, depth))| {
            let near = 10f64.powf(near);
            let lens = [fovy, aspect, shift, near, near * 10f64.powf(depth)];
            setups(eye, eye + forward, up, lens)
        })
}

/// How far the plane of a method may be misplaced at `p`, rounding of the
/// evaluation included.
fn tolerance(method: PlaneMethod, face: FrustumPlane, view: &View, p: DVec3) -> f64 {
    let sum = |v: DVec3| v.abs().element_sum();
    let size = sum(p) + sum(view.eye) + view.near.abs() + view.far.unwrap_or(0.0);
    let steep = view
        .window
        .into_iter()
        .fold(1.0, |s: f64, w| s.max(w.abs()));
    let steep = if view.parallel { 1.0 } else { 1.0 + steep };
    let per_unit = match method {
        PlaneMethod::Frame
        | PlaneMethod::GhGlF64
        | PlaneMethod::GhD3dF64
        | PlaneMethod::GhRevzF64 => 8.0,
        PlaneMethod::FrameF32 | PlaneMethod::GhRevzF32 => 32.0 * steep,
        // w - z is all but cancelled at the far plane.
        PlaneMethod::GhGlF32 | PlaneMethod::GhD3dF32 => match (face, view.far) {
            (FrustumPlane::Far, Some(far)) if !view.parallel => 32.0 * steep * far / view.near,
            _ => 32.0 * steep,
        },
    };
    per_unit * U * size
}

/// Bounds for the volume of an infinite lens, which contain every probe.
fn surroundings(view: &View) -> Surroundings {
    let corners = view.corners(view.far_or(DEEP));
    let reach = corners
        .iter()
        .fold(DVec3::ZERO, |reach, c| reach.max(c.abs()));
    Surroundings {
        origin: DVec3::ZERO,
        reach: (reach * 2.0).as_vec3(),
    }
}

fn volume(setup: &Setup, view: &View, method: PlaneMethod, epsilon: f64) -> ConvexVolume {
    let options = PlaneOptions { method, epsilon };
    let made = setup.camera().volume(&options, &surroundings(view));
    made.unwrap_or_else(|error| panic!("{method:?} of {setup:?}: {error}"))
}

fn close(a: DMat4, b: DMat4, eye: DVec3) -> bool {
    let tolerance = 1e-12 * (1.0 + eye.abs().element_sum());
    let differences = (a - b).to_cols_array().map(f64::abs);
    let rotation = |i: usize| if i < 12 { 1e-12 } else { tolerance };
    (0..16).all(|i| differences[i] <= rotation(i))
}
