//! Where the planes and matrices of a camera lie. Every named plane is tested
//! with probe points on both sides, in every convention, against a camera
//! written out by hand; glam's own matrices and the lecture's look-at must
//! agree with ours, and the controls must turn and slide as the lecture says.

mod by_hand;

use std::cell::RefCell;
use std::collections::BTreeMap;

use by_hand::{Kind, Setup, View};
use cullbench::camera::{
    Camera, CameraError, ClipSpace, Frame, PLANE_METHODS, PlaneMethod, PlaneOptions, Surroundings,
    look_at,
};
use cullbench::geometry::{ConvexVolume, FrustumPlane};
use glam::dcamera::rh::{proj, view};
use glam::{DMat4, DQuat, DVec3, DVec4, Vec4Swizzles};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed, TestRunner};

/// Half an ulp of 1 in f32.
const U: f64 = 1.0 / (1u64 << 24) as f64;
/// Where an infinite volume is probed: so many times near.
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

/// The most that the default epsilon may move a plane outward.
fn most_moved(view: &View, reach: DVec3, c: f64) -> f64 {
    let d = view.eye.abs().element_sum() + view.near.abs() + view.far.unwrap_or(0.0);
    c * U * 2.0 * (reach.element_sum() + d) + 1e-30
}

/// What the volume of an infinite lens must know: everything probed here lies
/// within.
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

/// Points on a face: window coordinates and depth of a 3 x 3 grid.
fn on_face(view: &View, face: FrustumPlane) -> Vec<DVec3> {
    let far = view.far_or(DEEP);
    let mut points = Vec::new();
    for s in [0.1, 0.5, 0.9] {
        for t in [0.1, 0.5, 0.9] {
            let depth = view.near + (far - view.near) * t;
            points.push(match face {
                FrustumPlane::Left => view.point(0.0, s, depth),
                FrustumPlane::Right => view.point(1.0, s, depth),
                FrustumPlane::Bottom => view.point(s, 0.0, depth),
                FrustumPlane::Top => view.point(s, 1.0, depth),
                FrustumPlane::Near => view.point(s, t, view.near),
                FrustumPlane::Far => view.point(s, t, far),
            });
        }
    }
    points
}

/// What probing a camera came to, per method and face.
#[derive(Default, Debug)]
struct Tally {
    /// Probes just inside this face that no other face was in doubt about.
    inside: u32,
    /// Probes just outside this face and certainly inside all others.
    alone: u32,
    /// Probes that the method is too coarse to place.
    lost: u32,
}

type Tallies = BTreeMap<(&'static str, &'static str), Tally>;

/// Probes every named plane a little inside and a little outside, as near as
/// the method's precision allows, and half way into the volume.
fn probe(setup: &Setup, tallies: &mut Tallies) -> Result<(), String> {
    let view = setup.view();
    let reach = surroundings(&view).reach.as_dvec3();
    for (method, method_name, _) in PLANE_METHODS {
        for epsilon in [0.0, PlaneOptions::default().epsilon] {
            let volume = volume(setup, &view, method, epsilon);
            let planes = volume.planes().len();
            if planes != view.faces().len() {
                return Err(format!("{method_name}: {planes} planes, {setup:?}"));
            }
            let moved = if epsilon > 0.0 {
                most_moved(&view, reach, epsilon)
            } else {
                0.0
            };
            for &face in view.faces() {
                let tally = tallies.entry((method_name, face.name())).or_default();
                for on in on_face(&view, face) {
                    let inward = view.inward(face);
                    let little = 2.0 * tolerance(method, face, &view, on);
                    let middle = view.point(0.5, 0.5, (view.near + view.far_or(DEEP)) / 2.0);
                    let probes = [
                        on + inward * little,
                        on - inward * (little + moved),
                        (on + middle) / 2.0,
                        on + (on - middle) / 2.0,
                    ];
                    for (i, p) in probes.into_iter().enumerate() {
                        // Exactly the point that the f32 plane is asked about.
                        let p32 = p.as_vec3();
                        let p = p32.as_dvec3();
                        let mut doubtful = false;
                        let mut outside = Vec::new();
                        for &other in view.faces() {
                            let distance = view.inside(other, p);
                            let tolerance = tolerance(method, other, &view, p);
                            let Some(plane) = volume.plane(other) else {
                                return Err(format!("no plane {} in {setup:?}", other.name()));
                            };
                            let wanted = if distance > tolerance {
                                true
                            } else if distance < -tolerance - moved {
                                outside.push(other);
                                false
                            } else {
                                doubtful = true;
                                tally.lost += u32::from(other == face && i < 2);
                                continue;
                            };
                            if plane.contains_point(p32) != wanted {
                                return Err(format!(
                                    "{method_name}, epsilon {epsilon}: {p32} lies {distance:e} \
                                     inside {}, the plane {plane:?} has {:e}; probe {i} of {}, \
                                     {setup:?}",
                                    other.name(),
                                    plane.value_at(p32),
                                    face.name(),
                                ));
                            }
                        }
                        if !doubtful {
                            match i {
                                0 => tally.inside += u32::from(outside.is_empty()),
                                1 => tally.alone += u32::from(outside == [face]),
                                _ => {}
                            }
                        }
                    }
                }
            }
        }
    }
    Ok(())
}

/// Every method and face must really have been probed, and on both sides.
fn check_tallies(tallies: &Tallies, cameras: usize) {
    assert_eq!(tallies.len(), PLANE_METHODS.len() * 6);
    for (at, tally) in tallies {
        let with_face = if at.1 == "far" { 3 } else { 5 };
        let probes = cameras as u32 / 5 * with_face * 2 * 9;
        assert_eq!(tally.lost, 0, "{at:?}: the probes stood too near");
        // An eye far off leaves no room between near and the eye; most probes
        // must be beyond doubt for all the other faces too.
        for sure in [tally.inside, tally.alone] {
            assert!(sure > probes / 2, "{at:?}: {tally:?} of {probes}");
        }
    }
}

#[test]
fn every_named_plane_of_hand_picked_cameras_has_its_probes_on_the_right_side() {
    let mut tallies = Tallies::new();
    let setups = hand_picked();
    for setup in &setups {
        probe(setup, &mut tallies).unwrap();
    }
    check_tallies(&tallies, setups.len());
}

#[test]
fn every_named_plane_of_random_cameras_has_its_probes_on_the_right_side() {
    let tallies = RefCell::new(Tallies::new());
    let cases = 120;
    let outcome = TestRunner::new(seeded(cases)).run(&any_setups(3.0), |setups| {
        for setup in &setups {
            probe(setup, &mut tallies.borrow_mut()).map_err(TestCaseError::fail)?;
        }
        Ok(())
    });
    outcome.unwrap_or_else(|error| panic!("{error}"));
    check_tallies(&tallies.into_inner(), cases as usize * 5);
}

#[test]
fn a_far_plane_a_million_times_as_far_as_near_is_lost_by_two_methods_only() {
    let lens = [60.0, 1.5, 0.2, 0.01, 1e4];
    let mut tallies = Tallies::new();
    for setup in setups(DVec3::new(1.0, 2.0, 3.0), DVec3::ZERO, DVec3::Y, lens) {
        probe(&setup, &mut tallies).unwrap();
    }
    for (at, tally) in &tallies {
        let coarse = matches!(*at, ("gh-gl-f32" | "gh-d3d-f32", "far"));
        assert_eq!(tally.lost > 0, coarse, "{at:?}: {tally:?}");
    }
}

#[test]
fn an_infinite_far_plane_is_an_absent_one() {
    for setup in hand_picked().into_iter().filter(|s| s.far.is_none()) {
        let view = setup.view();
        for (method, name, _) in PLANE_METHODS {
            let volume = volume(&setup, &view, method, 0.0);
            assert_eq!(volume.planes().len(), 5, "{name}");
            assert!(volume.plane(FrustumPlane::Far).is_none(), "{name}");
            let horizon = view.point(0.5, 0.5, 1e20);
            assert!(volume.contains_point(horizon.as_vec3()), "{name}");
        }
    }
}

fn close(a: DMat4, b: DMat4, eye: DVec3) -> bool {
    let tolerance = 1e-12 * (1.0 + eye.abs().element_sum());
    let differences = (a - b).to_cols_array().map(f64::abs);
    let rotation = |i: usize| if i < 12 { 1e-12 } else { tolerance };
    (0..16).all(|i| differences[i] <= rotation(i))
}

fn from_rows(rows: [[f64; 4]; 4]) -> DMat4 {
    DMat4::from_cols_array_2d(&rows).transpose()
}

/// The lecture's rotation times its translation.
fn rotation_times_translation(view: &View) -> DMat4 {
    let (u, v, n, e) = (view.u, view.v, view.n, view.eye);
    let rotation = from_rows([
        [u.x, u.y, u.z, 0.0],
        [v.x, v.y, v.z, 0.0],
        [n.x, n.y, n.z, 0.0],
        [0.0, 0.0, 0.0, 1.0],
    ]);
    let translation = from_rows([
        [1.0, 0.0, 0.0, -e.x],
        [0.0, 1.0, 0.0, -e.y],
        [0.0, 0.0, 1.0, -e.z],
        [0.0, 0.0, 0.0, 1.0],
    ]);
    rotation * translation
}

/// The lecture's `setModelViewMatrix`, line by line.
#[rustfmt::skip]
fn model_view_matrix(view: &View) -> [f64; 16] {
    let (u, v, n, e) = (view.u, view.v, view.n, view.eye);
    let mut m = [f64::NAN; 16];
    m[0] = u.x; m[4] = u.y; m[8] = u.z;  m[12] = -e.dot(u);
    m[1] = v.x; m[5] = v.y; m[9] = v.z;  m[13] = -e.dot(v);
    m[2] = n.x; m[6] = n.y; m[10] = n.z; m[14] = -e.dot(n);
    m[3] = 0.0; m[7] = 0.0; m[11] = 0.0; m[15] = 1.0;
    m
}

fn check_world_to_eye(setup: &Setup) -> Result<(), String> {
    let frame = setup.camera().frame;
    let (ours, view) = (frame.world_to_eye(), setup.view());
    let glam = view::look_at_mat4(setup.eye, setup.look, setup.up.normalize());
    let lecture = model_view_matrix(&view);
    for (other, what) in [
        (glam, "glam's look_at_mat4"),
        (
            rotation_times_translation(&view),
            "rotation times translation",
        ),
        (
            DMat4::from_cols_array(&lecture),
            "the lecture's column-major m[16]",
        ),
    ] {
        if !close(ours, other, setup.eye) {
            return Err(format!("{what}: {other} is not {ours} for {setup:?}"));
        }
    }
    let look = ours.transform_point3(setup.look);
    let distance = (setup.look - setup.eye).length();
    let aimed = (look + DVec3::Z * distance).length();
    if aimed > 1e-12 * (distance + setup.eye.abs().element_sum()) {
        return Err(format!("look comes to {look} for {setup:?}"));
    }
    Ok(())
}

#[test]
fn the_world_to_eye_matrix_is_glams_and_the_lectures() {
    for setup in hand_picked() {
        check_world_to_eye(&setup).unwrap();
    }
    let outcome = TestRunner::new(seeded(1000)).run(&any_setups(3.0), |setups| {
        check_world_to_eye(&setups[0]).map_err(TestCaseError::fail)
    });
    outcome.unwrap_or_else(|error| panic!("{error}"));
}

#[test]
fn the_lectures_look_at_call_moves_the_world_back_by_one() {
    // gluLookAt(0,0,1, 0,0,0, 0,1,0)
    let frame = look_at(DVec3::Z, DVec3::ZERO, DVec3::Y).unwrap();
    let moved = DMat4::from_translation(-DVec3::Z);
    assert_eq!(frame.world_to_eye(), moved);
}

#[test]
fn an_up_vector_nearly_along_the_view_neither_tilts_the_view_nor_loses_u() {
    // Integers, so that u is known exactly: up = 2^k forward + s, and
    // therefore up x n points along forward x s.
    let s = DVec3::new(3.0, -1.0, 2.0);
    for forward in [
        DVec3::new(4.0, 3.0, -2.0),
        DVec3::new(-7.0, 11.0, 13.0),
        DVec3::new(101.0, 3.0, -57.0),
    ] {
        for k in 0..44 {
            let up = forward * 2f64.powi(k) + s;
            let frame = look_at(DVec3::ZERO, forward, up).unwrap();
            let (u, n) = (forward.cross(s).normalize(), -forward.normalize());
            let wrong = [
                (frame.u() - u).length(),
                (frame.v() - n.cross(u)).length(),
                (frame.n() - n).length(),
                frame.orthogonality_error(),
            ];
            assert!(
                wrong.iter().all(|&w| w < 1e-14),
                "up = 2^{k} {forward} + {s}: u, v, n, orthogonality {wrong:?}"
            );
        }
    }
}

#[test]
fn an_up_vector_parallel_but_for_its_decimals_is_refused() {
    // 3 * 0.1 is not 0.3 in binary: the cross product is not quite zero.
    let up = DVec3::new(0.1, 0.2, 0.7);
    for factor in [3.0, -0.3, 1e-30, 7e30] {
        let look = up * factor;
        let frame = look_at(DVec3::ZERO, look, up);
        assert_eq!(frame, Err(CameraError::UpParallel), "{look}");
    }
}

const CLIP_SPACES: [(ClipSpace, f64, f64); 3] = [
    (ClipSpace::OpenGl, -1.0, 1.0),
    (ClipSpace::D3d, 0.0, 1.0),
    (ClipSpace::ReversedZ, 1.0, 0.0),
];

/// The corners of the near and far window in eye space must come to the
/// corners that the convention promises.
fn check_clip_corners(setup: &Setup) -> Result<(), String> {
    let (camera, view) = (setup.camera(), setup.view());
    let to_eye = rotation_times_translation(&view);
    // Eye coordinates of corners far from the origin lose digits to the eye's.
    let lost = 1e-15 * (1.0 + view.eye.length() / view.near.abs());
    for (clip, near_z, far_z) in CLIP_SPACES {
        let projection = camera.lens.projection(clip);
        let fail = |what: String| Err(format!("{clip:?}: {what}; {setup:?}"));
        let ndc = |p: DVec3| {
            let c = projection * to_eye * p.extend(1.0);
            (c.xyz() / c.w, c.w)
        };
        let far = view.far_or(DEEP);
        for (i, corner) in view.corners(far).into_iter().enumerate() {
            let (depth, z) = if i < 4 {
                (view.near, near_z)
            } else if view.far.is_some() {
                (far, far_z)
            } else {
                // near/depth short of the limit, twice that in OpenGL.
                (far, far_z + (near_z - far_z) * view.near / far)
            };
            let side = |bit: usize| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
            let wanted = DVec3::new(side(0), side(1), z);
            let (found, w) = ndc(corner);
            let wide = view
                .window
                .into_iter()
                .fold(1.0, |s: f64, x| s.max(x.abs()));
            let tolerance = 1e-9 + 100.0 * lost * wide;
            if (found - wanted).abs().max_element() > tolerance {
                return fail(format!("corner {i} comes to {found}, not {wanted}"));
            }
            let wanted_w = if view.parallel { 1.0 } else { depth };
            if (w / wanted_w - 1.0).abs() > tolerance {
                return fail(format!("corner {i} has w = {w}, not {wanted_w}"));
            }
        }
        if view.far.is_none() {
            // A point at infinity, straight ahead.
            let c = projection * DVec4::new(0.0, 0.0, -1.0, 0.0);
            if c.z / c.w != far_z {
                return fail(format!("infinity comes to {} / {}", c.z, c.w));
            }
        }
    }
    Ok(())
}

#[test]
fn window_corners_come_to_the_clip_corners_of_each_convention() {
    for setup in hand_picked() {
        check_clip_corners(&setup).unwrap();
    }
    let outcome = TestRunner::new(seeded(500)).run(&any_setups(5.0), |setups| {
        let each = setups.iter().map(check_clip_corners);
        each.collect::<Result<(), _>>().map_err(TestCaseError::fail)
    });
    outcome.unwrap_or_else(|error| panic!("{error}"));
}

/// `glFrustum` and `glOrtho` as their manual pages print them.
fn manual_page(kind: Kind, near: f64, far: f64) -> DMat4 {
    let (n, f) = (near, far);
    match kind {
        Kind::OffAxis {
            window: [l, r, b, t],
        } => from_rows([
            [2.0 * n / (r - l), 0.0, (r + l) / (r - l), 0.0],
            [0.0, 2.0 * n / (t - b), (t + b) / (t - b), 0.0],
            [0.0, 0.0, -(f + n) / (f - n), -2.0 * f * n / (f - n)],
            [0.0, 0.0, -1.0, 0.0],
        ]),
        Kind::Orthographic { height, aspect } => from_rows([
            [2.0 / (height * aspect), 0.0, 0.0, 0.0],
            [0.0, 2.0 / height, 0.0, 0.0],
            [0.0, 0.0, -2.0 / (f - n), -(f + n) / (f - n)],
            [0.0, 0.0, 0.0, 1.0],
        ]),
        Kind::Perspective { fovy_deg, aspect } => {
            let cot = 1.0 / (fovy_deg.to_radians() / 2.0).tan();
            from_rows([
                [cot / aspect, 0.0, 0.0, 0.0],
                [0.0, cot, 0.0, 0.0],
                [0.0, 0.0, (f + n) / (n - f), 2.0 * f * n / (n - f)],
                [0.0, 0.0, -1.0, 0.0],
            ])
        }
    }
}

fn check_projection(setup: &Setup) -> Result<(), String> {
    use ClipSpace::{D3d, OpenGl, ReversedZ};
    let lens = setup.camera().lens;
    let (n, far) = (setup.near, setup.far);
    let mut others = Vec::new();
    if let Some(f) = far {
        others.push((OpenGl, manual_page(setup.kind, n, f), "the manual page"));
    }
    match (setup.kind, far) {
        (Kind::Perspective { fovy_deg, aspect }, far) => {
            let fovy = fovy_deg.to_radians();
            if let Some(f) = far {
                let gl = proj::opengl::perspective(fovy, aspect, n, f);
                others.push((OpenGl, gl, "glam's opengl::perspective"));
                let d3d = proj::directx::perspective(fovy, aspect, n, f);
                others.push((D3d, d3d, "glam's directx::perspective"));
            } else {
                let d3d = proj::directx::perspective_infinite(fovy, aspect, n);
                others.push((D3d, d3d, "glam's perspective_infinite"));
                let reversed = proj::directx::perspective_infinite_reverse(fovy, aspect, n);
                others.push((ReversedZ, reversed, "glam's perspective_infinite_reverse"));
                // So far away that f64 cannot tell it from infinity.
                let gl = proj::opengl::perspective(fovy, aspect, n, n * 1e18);
                others.push((OpenGl, gl, "glam's opengl::perspective, far away"));
            }
        }
        (Kind::Orthographic { height, aspect }, Some(f)) => {
            let (x, y) = (height * aspect / 2.0, height / 2.0);
            let gl = proj::opengl::orthographic(-x, x, -y, y, n, f);
            others.push((OpenGl, gl, "glam's opengl::orthographic"));
            let d3d = proj::directx::orthographic(-x, x, -y, y, n, f);
            others.push((D3d, d3d, "glam's directx::orthographic"));
        }
        (
            Kind::OffAxis {
                window: [l, r, b, t],
            },
            far,
        ) => {
            let f = far.unwrap_or(n * 1e18);
            let gl = proj::opengl::frustum(l, r, b, t, n, f);
            others.push((OpenGl, gl, "glam's opengl::frustum"));
            let d3d = proj::directx::frustum(l, r, b, t, n, f);
            others.push((D3d, d3d, "glam's directx::frustum"));
        }
        (Kind::Orthographic { .. }, None) => {}
    }
    for (clip, other, what) in others {
        let ours = lens.projection(clip);
        let scale = ours.abs().to_cols_array().into_iter().fold(1.0, f64::max);
        if !ours.abs_diff_eq(other, 1e-13 * scale) {
            return Err(format!("{clip:?}: {what} {other}, ours {ours}; {setup:?}"));
        }
    }
    Ok(())
}

#[test]
fn projection_matrices_are_glams_and_the_manual_pages() {
    for setup in hand_picked() {
        check_projection(&setup).unwrap();
    }
    let outcome = TestRunner::new(seeded(500)).run(&any_setups(6.0), |setups| {
        let each = setups.iter().map(check_projection);
        each.collect::<Result<(), _>>().map_err(TestCaseError::fail)
    });
    outcome.unwrap_or_else(|error| panic!("{error}"));
}

fn in_clip_cube(c: DVec4, clip: ClipSpace) -> bool {
    let low = if clip == ClipSpace::OpenGl { -c.w } else { 0.0 };
    c.x.abs() <= c.w && c.y.abs() <= c.w && low <= c.z && c.z <= c.w
}

/// Away from the border the planes and the matrix agree about every point.
/// Adds up how many points were inside and how many outside.
fn compare_with_clip_cube(setup: &Setup, at: [f64; 3], tally: &mut [u32; 2]) -> Result<(), String> {
    let (camera, view) = (setup.camera(), setup.view());
    let span = view.far_or(DEEP) - view.near;
    let p = view.point(at[0], at[1], view.near + span * at[2]).as_vec3();
    let exact = p.as_dvec3();
    for (method, name, _) in PLANE_METHODS {
        let sure = |&face: &FrustumPlane| {
            view.inside(face, exact).abs() > tolerance(method, face, &view, exact)
        };
        if !view.faces().iter().all(sure) {
            continue;
        }
        let by_planes = volume(setup, &view, method, 0.0).contains_point(p);
        for (clip, ..) in CLIP_SPACES {
            let matrix = camera.lens.projection(clip) * camera.frame.world_to_eye();
            let by_matrix = in_clip_cube(matrix * exact.extend(1.0), clip);
            if by_planes != by_matrix {
                return Err(format!(
                    "{p}: {by_planes} by the planes of {name}, {by_matrix} by {clip:?}; {setup:?}"
                ));
            }
        }
        tally[usize::from(by_planes)] += 1;
    }
    Ok(())
}

#[test]
fn points_inside_the_planes_are_the_points_inside_the_clip_cube() {
    let tally = RefCell::new([0; 2]);
    // Window coordinates and depth, from a quarter outside on every side;
    // negative depths reach behind the eye.
    let point = prop::array::uniform3(-0.25f64..1.25);
    let cameras = (any_setups(3.0), prop::collection::vec(point, 20));
    let outcome = TestRunner::new(seeded(100)).run(&cameras, |(setups, points)| {
        for (setup, &at) in setups
            .iter()
            .flat_map(|s| points.iter().map(move |p| (s, p)))
        {
            compare_with_clip_cube(setup, at, &mut tally.borrow_mut())
                .map_err(TestCaseError::fail)?;
        }
        Ok(())
    });
    outcome.unwrap_or_else(|error| panic!("{error}"));
    let [outside, inside] = tally.into_inner();
    assert!(inside > 10_000 && outside > 20_000, "{inside} {outside}");
}

fn any_frame() -> impl Strategy<Value = Frame> {
    any_setups(1.0).prop_map(|setups| setups[0].camera().frame)
}

/// How far apart two frames are: axes absolutely, eyes by their size.
fn apart(a: &Frame, eye: DVec3, [u, v, n]: [DVec3; 3]) -> f64 {
    let axes = (a.u() - u).length() + (a.v() - v).length() + (a.n() - n).length();
    axes + (a.eye - eye).length() / (1.0 + eye.length())
}

proptest! {
    #![proptest_config(seeded(500))]

    #[test]
    fn sliding_adds_delu_u_delv_v_deln_n_to_the_eye(
        frame in any_frame(),
        by in prop::array::uniform3(-1e3f64..1e3),
    ) {
        let [du, dv, dn] = by;
        let (u, v, n, e) = (frame.u(), frame.v(), frame.n(), frame.eye);
        let mut slid = frame;
        slid.slide(du, dv, dn);
        // Written as the lecture writes it, one coordinate at a time.
        let eye = DVec3::new(
            e.x + (du * u.x + dv * v.x + dn * n.x),
            e.y + (du * u.y + dv * v.y + dn * n.y),
            e.z + (du * u.z + dv * v.z + dn * n.z),
        );
        prop_assert!(apart(&slid, eye, [u, v, n]) < 1e-12);
        // cam.slide(-1, 0, -2): "slide camera forward and left".
        let mut slid = frame;
        slid.slide(-1.0, 0.0, -2.0);
        let moved = slid.eye - e;
        let rounding = 1e-15 * (1.0 + e.length());
        prop_assert!((moved.dot(frame.forward()) - 2.0).abs() < 2.0 * rounding + 1e-12);
        prop_assert!((moved.dot(-u) - 1.0).abs() < 2.0 * rounding + 1e-12);
        // Camera::Move: along the direction of view.
        let mut moved = frame;
        moved.advance(du);
        prop_assert!(apart(&moved, e + (-n) * du, [u, v, n]) < 1e-12);
    }

    #[test]
    fn rolling_follows_the_lectures_formula(frame in any_frame(), degrees in -720.0f64..720.0) {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let (u, v) = (frame.u(), frame.v());
        let mut rolled = frame;
        rolled.roll(degrees);
        let wanted = [cos * u + sin * v, -sin * u + cos * v, frame.n()];
        prop_assert!(apart(&rolled, frame.eye, wanted) < 1e-13);
    }

    #[test]
    fn turns_are_rotations_about_the_axis_they_name(
        frame in any_frame(),
        degrees in -720.0f64..720.0,
    ) {
        let (u, v, n) = (frame.u(), frame.v(), frame.n());
        let turns: [fn(&mut Frame, f64); 3] = [Frame::yaw, Frame::pitch, Frame::roll];
        for (turn, (axis, what)) in turns.into_iter().zip([(v, "yaw"), (u, "pitch"), (n, "roll")])
        {
            let mut turned = frame;
            turn(&mut turned, degrees);
            let q = DQuat::from_axis_angle(axis, degrees.to_radians());
            let wanted = [u, v, n].map(|axis| q * axis);
            prop_assert!(apart(&turned, frame.eye, wanted) < 1e-12, "{what}");
        }
    }

    #[test]
    fn in_eye_space_the_world_moves_the_other_way(
        frame in any_frame(),
        angle in -180.0f64..180.0,
        by in prop::array::uniform3(-10.0f64..10.0),
    ) {
        // The lecture's calls: slide, roll, yaw, pitch. Each one multiplies
        // the world-to-eye matrix from the left by its inverse.
        let back = (-angle).to_radians();
        let [x, y, z] = by;
        let mut flown = frame;
        let check = |flown: &Frame, before: DMat4, inverse: DMat4| {
            let size = (flown.eye.abs() + DVec3::from(by).abs()) * 10.0;
            close(flown.world_to_eye(), inverse * before, size)
        };
        let before = flown.world_to_eye();
        flown.slide(x, y, z);
        prop_assert!(check(&flown, before, DMat4::from_translation(-DVec3::from(by))));
        let before = flown.world_to_eye();
        flown.roll(angle);
        prop_assert!(check(&flown, before, DMat4::from_rotation_z(back)));
        let before = flown.world_to_eye();
        flown.yaw(angle);
        prop_assert!(check(&flown, before, DMat4::from_rotation_y(back)));
        let before = flown.world_to_eye();
        flown.pitch(angle);
        prop_assert!(check(&flown, before, DMat4::from_rotation_x(back)));
    }

    #[test]
    fn an_orbit_is_a_rotation_about_the_centre(
        frame in any_frame(),
        centre in vector(-1, 3),
        axis in vector(-3, 3).prop_filter("an axis", |axis| axis.length() > 1e-6),
        around in -360.0f64..360.0,
        over in -360.0f64..360.0,
    ) {
        let mut swung = frame;
        swung.orbit(centre, axis, around, over).unwrap();
        let first = DQuat::from_axis_angle(axis.normalize(), around.to_radians());
        let second = DQuat::from_axis_angle(first * frame.u(), over.to_radians());
        let q = second * first;
        let wanted = [frame.u(), frame.v(), frame.n()].map(|axis| q * axis);
        let size = 1.0 + centre.length() + frame.eye.length();
        let eye = centre + q * (frame.eye - centre);
        prop_assert!((swung.eye - eye).length() < 1e-12 * size);
        prop_assert!(apart(&swung, swung.eye, wanted) < 1e-11);
    }

    #[test]
    fn zooming_magnifies_by_the_factor(setups in any_setups(2.0), factor in 0.5f64..20.0) {
        for setup in setups {
            let camera = setup.camera();
            let mut zoomed = camera;
            zoomed.zoom(factor).unwrap();
            prop_assert_eq!(zoomed.frame, camera.frame);
            let p = DVec4::new(0.3, -0.2, -setup.near.abs() * 2.0, 1.0);
            let clip = |c: &Camera| c.lens.projection(ClipSpace::OpenGl) * p;
            let (before, after) = (clip(&camera), clip(&zoomed));
            // Magnified about the axis, which an off-axis window does not
            // have in its middle: the shift of the window stays as it is.
            let shift = camera.lens.projection(ClipSpace::OpenGl).z_axis.xy() * p.z;
            let wanted = (before.xy() - shift) * factor + shift;
            prop_assert!((after.xy() - wanted).length() < 1e-9 * (1.0 + wanted.length()));
            prop_assert_eq!((before.z, before.w), (after.z, after.w));
        }
    }
}

#[test]
fn a_full_turn_in_single_degrees_comes_back() {
    // With the lecture's 3.142/180 the camera is 8e-4 radians off.
    let mut frame = look_at(DVec3::ZERO, -DVec3::Z, DVec3::Y).unwrap();
    for turn in [Frame::yaw, Frame::pitch, Frame::roll] {
        for _ in 0..360 {
            turn(&mut frame, 1.0);
        }
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        assert!(apart(&frame, DVec3::ZERO, axes) < 1e-13);
    }
}
