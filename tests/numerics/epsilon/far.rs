//! Planes beyond any scene: the others stay where they are.

use super::*;

/// Far planes, and orthographic near planes behind the eye, beyond any scene.
#[test]
fn a_plane_beyond_everything_moves_no_other_and_drops_nothing() {
    let mut rng = SeededRng::new(41);
    let mut checked = 0;
    for depth in [1e3, 1e15, 1e20, 1e30] {
        for kind in ["perspective", "orthographic", "off-axis"] {
            for offset in [0.0, 1e4] {
                for _ in 0..10 {
                    let scene = scene(&mut rng, kind, offset, 60);
                    let around = scene.surroundings();
                    let far = scene.setup.far.expect("a far plane") * depth;
                    let (deep, deeper) = match kind {
                        "orthographic" => ((-far, scene.setup.far), (-4.0 * far, scene.setup.far)),
                        _ => (
                            (scene.setup.near, Some(far)),
                            (scene.setup.near, Some(4.0 * far)),
                        ),
                    };
                    let camera = |(near, far)| {
                        Setup {
                            near,
                            far,
                            ..scene.setup
                        }
                        .camera()
                    };
                    let [camera, other] = [camera(deep), camera(deeper)];
                    let oracle = Oracle::of_camera(&Pose::of(&camera), &camera.lens, scene.origin);
                    let oracle = oracle.expect("a camera");
                    let planes = |camera: &Camera| {
                        let volume = camera.volume(&PlaneOptions::default(), &around);
                        volume.expect("a volume").planes().to_vec()
                    };
                    let idle = if kind == "orthographic" { 4 } else { 5 };
                    for (i, (a, b)) in planes(&camera).into_iter().zip(planes(&other)).enumerate() {
                        assert!(
                            i == idle || depth < 1e4 || a == b,
                            "{i}: {a:?}, {b:?}, {kind}"
                        );
                    }
                    for arithmetic in [Arithmetic::F32, Arithmetic::F32Relative] {
                        for test in [
                            CullingTest::SixPlane,
                            CullingTest::SixBox,
                            CullingTest::Exact,
                        ] {
                            let culling = Culling::new(test, arithmetic, PlaneOptions::default());
                            let view = culling.view(&camera, &around).expect("a view");
                            for b in &scene.boxes {
                                let is_lost = !view.as_any().sees(b);
                                assert!(oracle.verdict(b) != Verdict::Out, "{b:?}");
                                assert!(!is_lost, "{b:?}, {test:?} {arithmetic:?}, {camera:?}");
                                checked += 1;
                            }
                        }
                    }
                }
            }
        }
    }
    assert!(checked > 50_000, "{checked}");
}
