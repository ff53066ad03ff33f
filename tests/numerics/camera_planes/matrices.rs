//! World to eye, and eye to clip space, against glam and the manual pages.

use super::*;

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
                frame.u().dot(frame.v()).abs(),
                frame.v().dot(frame.n()).abs(),
                frame.n().dot(frame.u()).abs(),
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
        assert!(
            frame
                .as_ref()
                .is_err_and(|e| e.to_string().starts_with("up is ")),
            "{look}: {frame:?}"
        );
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
