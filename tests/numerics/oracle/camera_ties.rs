//! Camera level: cameras with whole-number frames, whose planes and ties are
//! known exactly, and boxes a hair beside a tie.

use cullbench::camera::Lens;
use cullbench::geometry::Aabb;
use cullbench::oracle::{Oracle, Pose, Verdict};
use glam::{DVec3, Vec3};

use super::cases;
use super::draw::{SeededRng, grid_box};
use super::simplex::{self, ExactPlane};
use super::wide::Dyadic;

/// Three whole-number vectors at right angles, all of the same whole length
/// (Euler and Rodrigues: a rotation by a whole quaternion).
fn whole_frame(rng: &mut SeededRng) -> ([DVec3; 3], f64) {
    loop {
        let [w, x, y, z] = [0; 4].map(|_| rng.whole(2) as f64);
        let length = w * w + x * x + y * y + z * z;
        if length == 0.0 {
            continue;
        }
        let frame = [
            [
                w * w + x * x - y * y - z * z,
                2.0 * (x * y + w * z),
                2.0 * (x * z - w * y),
            ],
            [
                2.0 * (x * y - w * z),
                w * w - x * x + y * y - z * z,
                2.0 * (y * z + w * x),
            ],
            [
                2.0 * (x * z + w * y),
                2.0 * (y * z - w * x),
                w * w - x * x - y * y + z * z,
            ],
        ];
        break (frame.map(DVec3::from_array), length);
    }
}

/// Pose and lens in whole numbers and quarters, the origin of the boxes, the
/// very planes, and points of the volume's edges, eye first.
fn whole_camera(rng: &mut SeededRng) -> (Pose, Lens, DVec3, Vec<ExactPlane>, Vec<Vec3>) {
    let ([right, up, back], length) = whole_frame(rng);
    let forward = -back;
    let eye = rng.whole3(4).as_dvec3();
    let origin = rng.whole3(1).as_dvec3() * 1e6;
    // Depths in lengths of the frame's vectors, whose sums stay whole.
    let (near, far) = (1.0, rng.chance(0.7).then(|| 2.0 + rng.below(3) as f64));
    let quarters = |rng: &mut SeededRng, most: usize| 0.25 * (1 + rng.below(most)) as f64;
    let (width, height) = (quarters(rng, 12), quarters(rng, 12));
    let low = [0; 2].map(|_| 0.25 * rng.whole(8) as f64);
    let kind = rng.below(3);
    let slopes = match kind {
        0 => [-width, width, -1.0, 1.0],
        1 => [low[0], low[0] + width, low[1], low[1] + height],
        _ => [-width, width, -0.5, 0.5],
    };
    let far = if kind == 2 { far.or(Some(3.0)) } else { far };
    let mut tips = vec![eye];
    for depth in [Some(near), far].into_iter().flatten() {
        let spread = if kind == 2 { 1.0 } else { depth };
        for x in [slopes[0], slopes[1], slopes[0] / 2.0 + slopes[1] / 2.0] {
            for y in [slopes[2], slopes[3], 0.25 * slopes[2] + 0.75 * slopes[3]] {
                tips.push(eye + forward * depth + (right * x + up * y) * spread);
            }
        }
    }
    let tips = tips.into_iter().map(DVec3::as_vec3).collect();
    let (near, far) = (near * length, far.map(|far| far * length));
    let window = slopes.map(|slope| slope * length);
    let lens = match kind {
        0 => Lens::perspective(90.0, width, near, far),
        1 => Lens::off_axis(window, near, far),
        _ => Lens::orthographic(length, 2.0 * width, near, far.expect("finite")),
    };
    let lens = lens.expect("a lens");
    // Inside: right.q >= left * depth / near, times near and length; all
    // numbers are far below 2^50, so f64 is exact.
    let seen_from = eye + origin;
    let mut planes: Vec<(DVec3, f64)> = Vec::new();
    for (axis, edge, sign) in [
        (right, window[0], 1.0),
        (right, window[1], -1.0),
        (up, window[2], 1.0),
        (up, window[3], -1.0),
    ] {
        planes.push(match lens.is_orthographic() {
            true => (axis * sign, -edge * length * sign),
            _ => ((axis * near - forward * edge) * sign, 0.0),
        });
    }
    planes.push((forward, -near * length));
    if let Some(far) = lens.far() {
        planes.push((-forward, far * length));
    }
    let exact = planes
        .iter()
        .map(|(n, offset)| [n.x, n.y, n.z, offset - n.dot(eye)].map(Dyadic::from));
    let scale = libm::exp2(rng.whole(100) as f64);
    let pose = if rng.chance(0.5) {
        Pose::Forward {
            eye: seen_from,
            forward: forward * scale,
            up: up + forward * 2.0,
        }
    } else {
        Pose::LookAt {
            eye: seen_from,
            look: seen_from + forward,
            up: up * scale - forward * scale,
        }
    };
    (pose, lens, origin, exact.collect(), tips)
}

#[test]
fn whole_number_cameras_whose_ties_are_exact() {
    let mut verdicts = [0; 3];
    for seed in 0..(cases(4000) / 8) as u64 {
        let mut rng = SeededRng::new(seed);
        let (pose, lens, origin, planes, tips) = whole_camera(&mut rng);
        let oracle = Oracle::of_camera(&pose, &lens, origin).expect("a camera");
        for _ in 0..8 {
            let tip = tips[rng.below(tips.len())];
            let mut b = grid_box(&mut rng, tip);
            if rng.chance(0.4) {
                // A little beside the tie.
                let by = rng.whole3(1) / 1024.0;
                (b.min, b.max) = (b.min + by, b.max + by);
            }
            let wanted = simplex::verdict(&planes, &b);
            let found = oracle.classify(&b);
            // A tie of real numbers cannot be proved by any finite precision.
            assert!(
                found.verdict == wanted && found.undecided == (wanted == Verdict::Touch),
                "seed {seed}: {found:?}, wanted {wanted:?}, {b:?}, {pose:?}, {lens:?}"
            );
            verdicts[wanted as usize] += 1;
        }
    }
    println!("whole-number cameras: {verdicts:?}");
    let all: usize = verdicts.iter().sum();
    assert!(verdicts.iter().all(|&n| n * 25 > all), "{verdicts:?}");
}

#[test]
fn lengths_far_beyond_f32_make_the_same_camera() {
    let b = |x: f32| Aabb::new(Vec3::new(x, -1.0, -4.0), Vec3::new(x + 1.0, 1.0, -3.0));
    for length in [1e-250, 1e-80, 1.0, 1e80, 1e250] {
        let pose = Pose::LookAt {
            eye: DVec3::ZERO,
            look: -DVec3::Z * length,
            up: (DVec3::Y - DVec3::Z) * length,
        };
        let near = 1e-100 * length.clamp(1e-200, 1e80);
        let edge = 0.5 * near;
        let off_axis = Lens::off_axis([-edge, edge, -edge, edge], near, None);
        let oracle = Oracle::of_camera(&pose, &off_axis.expect("a lens"), DVec3::ZERO);
        let oracle = oracle.expect("a camera");
        let verdicts = [2.0, 2.0f32.next_up(), 1.5].map(|x| oracle.classify(&b(x)));
        let wanted = [
            (Verdict::Touch, true),
            (Verdict::Out, false),
            (Verdict::In, false),
        ];
        assert_eq!(
            verdicts.map(|j| (j.verdict, j.undecided)),
            wanted,
            "{length}"
        );
    }
}

#[test]
fn what_is_2_to_the_minus_100_beside_a_tie_is_decided() {
    let lens = Lens::perspective(90.0, 1.0, 1.0, Some(8.0)).expect("a lens");
    let b = Aabb::new(Vec3::new(4.0, -1.0, -4.0), Vec3::new(5.0, 1.0, -3.0));
    let judge = |x: f64| {
        let pose = Pose::Forward {
            eye: DVec3::X * x,
            forward: -DVec3::Z,
            up: DVec3::Y,
        };
        let oracle = Oracle::of_camera(&pose, &lens, DVec3::ZERO).expect("a camera");
        let found = oracle.classify(&b);
        (found.verdict, found.undecided)
    };
    let near = libm::exp2(-100.0);
    assert_eq!(judge(near), (Verdict::In, false));
    assert_eq!(judge(-near), (Verdict::Out, false));
    for beyond in [-libm::exp2(-200.0), 0.0, libm::exp2(-200.0)] {
        assert_eq!(judge(beyond), (Verdict::Touch, true));
    }
}
