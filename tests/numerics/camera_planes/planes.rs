//! Every named plane, probed on both sides.

use super::*;

/// The most that the default epsilon may move a plane outward.
fn most_moved(view: &View, reach: DVec3, c: f64) -> f64 {
    let d = view.eye.abs().element_sum() + view.near.abs() + view.far.unwrap_or(0.0);
    c * U * 2.0 * (reach.element_sum() + d) + 1e-30
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

/// Counts of probes, per method and face.
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
                        // Exactly the point that the f32 plane tests.
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
