//! Slides, turns, orbits and zooms, by the lecture's formulas.

use super::*;

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
