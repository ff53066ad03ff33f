//! Depths of the oracle: boxes worked by hand; no shorter move changes a verdict.

use cullbench::geometry::{Aabb, ConvexVolume, Plane};
use cullbench::oracle::{Oracle, Verdict};
use cullbench::verify::RandomCase;
use glam::{DVec3, Vec3};

use super::draw::SeededRng;

fn oracle(planes: &[(Vec3, f32)]) -> Oracle {
    let planes: Vec<Plane> = planes.iter().map(|&(n, d)| Plane::new(n, d)).collect();
    Oracle::of_volume(&ConvexVolume::from_planes(&planes).expect("finite"))
}

#[test]
fn depths_worked_by_hand() {
    // The cube [0, 4]^3; lengths of normals do not matter.
    let cube = oracle(&[
        (Vec3::X * 2.0, 0.0),
        (-Vec3::X, 4.0),
        (Vec3::Y, 0.0),
        (-Vec3::Y * 8.0, 32.0),
        (Vec3::Z, 0.0),
        (-Vec3::Z, 4.0),
    ]);
    let depth = |low: [f32; 3], high: [f32; 3]| {
        cube.depth(&Aabb::new(Vec3::from_array(low), Vec3::from_array(high)))
    };
    assert_eq!(depth([5.0, 1.0, 1.0], [6.0, 2.0, 2.0]), -1.0);
    assert_eq!(
        depth([5.0, 7.0, 1.0], [6.0, 8.0, 2.0]),
        -3.0,
        "the widest gap"
    );
    assert_eq!(depth([4.0, 1.0, 1.0], [6.0, 2.0, 2.0]), 0.0);
    assert_eq!(depth([3.5, 1.0, 1.0], [6.0, 2.0, 2.0]), 0.5);
    assert_eq!(depth([1.0, 1.0, 1.0], [2.0, 2.0, 2.0]), 2.0);
    assert_eq!(depth([-9.0, -9.0, -9.0], [8.5, 9.0, 9.0]), 8.5);
    assert_eq!(depth([2.0, 2.0, 2.0], [1.0, 1.0, 1.0]), f64::NEG_INFINITY);

    // |x| <= -z: a point beside a face, and a box that only its edge parts.
    let wedge = oracle(&[(Vec3::new(1.0, 0.0, -1.0), 0.0), (-Vec3::X - Vec3::Z, 0.0)]);
    let beside = Vec3::new(7.0, 0.0, -4.0);
    let found = wedge.depth(&Aabb::new(beside, beside));
    assert!((found + 3.0 / 2f64.sqrt()).abs() < 1e-12, "{found}");
    let behind = Aabb::new(Vec3::new(-9.0, 0.0, 0.5), Vec3::new(9.0, 1.0, 2.0));
    assert_eq!(wedge.depth(&behind), -0.5);
    assert_eq!(oracle(&[]).depth(&behind), f64::INFINITY);
    let nothing = oracle(&[(Vec3::X, -1.0), (-Vec3::X, -1.0)]);
    assert_eq!(nothing.depth(&behind), f64::NEG_INFINITY);
}

/// A sum that f64 loses between two products of 48 bits.
#[test]
fn a_depth_below_the_rounding_of_f64_keeps_its_digits() {
    let normal = Vec3::new(16_777_213.0, 1.0, -16_777_213.0);
    for height in [2f32.powi(-20), -2f32.powi(-20), 0.0] {
        let point = Vec3::new(16_777_183.0, height, 16_777_183.0);
        let found = oracle(&[(normal, 0.0)]).depth(&Aabb::new(point, point));
        let wanted = f64::from(height) / normal.as_dvec3().length();
        assert!(
            (found - wanted).abs() <= 1e-12 * wanted.abs(),
            "{found:e}, {wanted:e}"
        );
    }
}

#[test]
fn no_move_shorter_than_the_depth_changes_the_verdict() {
    let (mut ins, mut outs) = (0, 0);
    for seed in 0..1500 {
        let case = RandomCase::new(seed);
        let oracle = Oracle::of_volume(&case.volume);
        let mut rng = SeededRng::new(seed);
        for b in case.items.iter().take(6) {
            let verdict = oracle.verdict(b);
            let depth = oracle.depth(b);
            if b.is_empty() || !depth.is_finite() {
                continue;
            }
            let reach = f64::from(b.reach().max_element());
            // Within rounding of a tie the sign means nothing.
            if depth.abs() <= 1e-5 * reach {
                continue;
            }
            let wanted = if depth > 0.0 {
                Verdict::In
            } else {
                Verdict::Out
            };
            assert_eq!(verdict, wanted, "seed {seed}: {depth} for {b:?}");
            for _ in 0..8 {
                let direction = DVec3::from_array([0; 3].map(|_| rng.between(-1.0, 1.0)));
                let step = direction.normalize() * depth * 0.9;
                let by = step.clamp_length_max(1e30).as_vec3();
                let moved = Aabb::new(b.min + by, b.max + by);
                assert_eq!(
                    oracle.verdict(&moved),
                    wanted,
                    "seed {seed}: {depth}, {b:?} by {by}"
                );
            }
            *(if depth > 0.0 { &mut ins } else { &mut outs }) += 1;
        }
    }
    assert!(ins > 500 && outs > 1000, "{ins} in, {outs} out");
}
