//! No culling test drops what the exact truth says a camera sees, each sees no
//! more than the coarser ones, and `exact` sees nothing else.

use cullbench::camera::{Camera, Frame, Lens, PLANE_METHODS, PlaneMethod, Surroundings};
use cullbench::culling::{ARITHMETICS, Arithmetic, Culling, CullingTest};
use cullbench::geometry::Aabb;
use cullbench::oracle::{Oracle, Pose, Verdict};
use glam::{DVec3, Vec3};
use proptest::prelude::*;

prop_compose! {
    fn a_camera()(
        eye in [-50.0..50.0, -50.0..50.0, -50.0..50.0f64],
        forward in [-1.0..1.0, -1.0..1.0, -1.0..1.0f64],
        fovy in prop_oneof![Just(90.0), 0.01..179.0f64],
        aspect in 0.1..10.0f64,
        near in prop_oneof![Just(1e-4), Just(1.0), Just(40.0)],
        kind in 0..4,
    ) -> Option<Camera> {
        let frame = Frame::looking_along(DVec3::from(eye), DVec3::from(forward), DVec3::Z).ok()?;
        let far = Some(near + 60.0);
        let lens = match kind {
            0 => Lens::perspective(fovy, aspect, near, far),
            1 => Lens::perspective(fovy, aspect, near, None),
            2 => Lens::orthographic(30.0, aspect, -near, 60.0),
            _ => Lens::off_axis([-near, near * 0.3, near * 0.1, near * aspect], near, far),
        };
        Some(Camera { frame, lens: lens.ok()? })
    }
}

prop_compose! {
    /// Near the volume, from specks to boxes much larger than it.
    fn a_box()(
        centre in [-90.0..90.0, -90.0..90.0, -90.0..90.0f32],
        half in [0.0..1.0, 0.0..1.0, 0.0..1.0f32],
        size in prop_oneof![Just(0.0f32), Just(1.0), Just(20.0), Just(300.0)],
    ) -> Aabb {
        Aabb::around(Vec3::from(centre), Vec3::from(half) * size)
    }
}

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

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]
    #[test]
    fn no_test_drops_what_the_camera_sees_and_exact_returns_nothing_else(
        camera in a_camera(),
        boxes in prop::collection::vec(a_box(), 40),
    ) {
        let Some(camera) = camera else { return Ok(()) };
        let oracle = Oracle::of_camera(&Pose::of(&camera), &camera.lens, AROUND.origin).unwrap();
        for (arithmetic, name, _) in ARITHMETICS {
            let mut seen_by_coarser = [true; 40];
            for test in [CullingTest::Sphere, CullingTest::SixPlane, CullingTest::SixBox, CullingTest::Exact] {
                let Ok(view) = of(test, arithmetic).view(&camera, &AROUND) else {
                    prop_assert!(test == CullingTest::Sphere && arithmetic != Arithmetic::F32);
                    continue;
                };
                let items = test.items(&boxes);
                for (i, (item, b)) in items.iter().zip(&boxes).enumerate() {
                    let seen = view.as_any().sees(item);
                    let depth = oracle.depth(b);
                    if oracle.verdict(b) == Verdict::In && (arithmetic != Arithmetic::F64 || depth > 1e-9) {
                        prop_assert!(seen, "{} {name} drops {b:?}, {depth} deep", test.name());
                    }
                    // Each test sees no more than the coarser one before.
                    prop_assert!(!seen || seen_by_coarser[i], "{} {name}", test.name());
                    seen_by_coarser[i] = seen;
                    if test == CullingTest::Exact && seen {
                        prop_assert!(depth > -1e-3, "{name} {b:?} {depth}");
                    }
                }
            }
        }
    }
}

prop_compose! {
    /// A wide view, and boxes at places of it: its sides are at -1 and 1, its far
    /// plane is at 1.
    fn a_wide_view()(
        direction in [-1.0..1.0, -1.0..1.0, -1.0..1.0f64],
        offset in prop_oneof![Just(0.0), Just(1e3), Just(1e5)],
        fovy in prop_oneof![Just(60.0), Just(178.0), Just(179.9), Just(179.99), 170.0..179.99f64],
        aspect in prop_oneof![Just(16.0 / 9.0), 0.2..5.0f64],
        places in prop::collection::vec(([-1.1..1.1, -1.1..1.1, 0.0..1.1f64], 0.0..5.0f64), 60),
    ) -> Option<(Camera, Vec<Aabb>)> {
        let eye = DVec3::from(direction).map(|c| c.signum() * offset + 10.0 * c);
        let frame = Frame::looking_along(eye, DVec3::from(direction), DVec3::Z).ok()?;
        let lens = Lens::perspective(fovy, aspect, 0.1, Some(100.0)).ok()?;
        let slope = (fovy / 2.0).to_radians().tan();
        let boxes = places.into_iter().map(|([x, y, ahead], power)| {
            let ahead = 100.0 * ahead;
            let at = frame.u() * (x * slope * aspect * ahead) + frame.v() * (y * slope * ahead);
            let size = 100.0 * slope * 10f64.powf(-power);
            let at = (eye + at - frame.n() * ahead).as_vec3();
            Aabb::around(at, Vec3::new(1.0, 0.1, 0.01) * size as f32)
        });
        Some((Camera { frame, lens }, boxes.collect()))
    }
}

proptest! {
    /// `six-box` and `exact` keep every visible box, whatever derives the six planes.
    ///
    /// No margin is proven for the sums of planes that these tests add.
    #[test]
    fn planes_that_a_test_adds_lose_nothing_whatever_the_derivation(view in a_wide_view()) {
        let Some((camera, boxes)) = view else { return Ok(()) };
        let oracle = Oracle::of_camera(&Pose::of(&camera), &camera.lens, DVec3::ZERO).unwrap();
        let around = Surroundings {
            origin: DVec3::ZERO,
            reach: Aabb::union_of(&boxes).reach(),
        };
        for (method, name, _) in PLANE_METHODS {
            let sees = |test| {
                let mut culling = of(test, Arithmetic::F32);
                culling.planes.method = method;
                let view = culling.view(&camera, &around).ok()?;
                Some(boxes.iter().map(|b| view.as_any().sees(b)).collect::<Vec<_>>())
            };
            let Some(by_six) = sees(CullingTest::SixPlane) else { continue };
            for test in [CullingTest::SixBox, CullingTest::Exact] {
                let found = sees(test).unwrap();
                for ((b, &six), &seen) in boxes.iter().zip(&by_six).zip(&found) {
                    let kept = six || method == PlaneMethod::Frame;
                    prop_assert!(
                        !kept || seen || oracle.verdict(b) != Verdict::In,
                        "{} {name} drops {b:?}, {} deep", test.name(), oracle.depth(b)
                    );
                }
            }
        }
    }
}
