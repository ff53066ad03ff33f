//! Camera level: random cameras of every lens against planes derived here, by
//! other formulas and with 640 bits, and cameras with whole-number frames,
//! whose ties are known exactly.

use cullbench::camera::Lens;
use cullbench::geometry::Aabb;
use cullbench::oracle::{Oracle, Pose, Verdict};
use glam::{DVec3, Vec3};

use crate::cases;
use crate::draw::{Dice, grid_box};
use crate::simplex::{self, ExactPlane};
use crate::wide::{Dyadic, Vector, along, cross, dot, pi, tangent, unit, vector};

/// A camera with all that the expected planes are made from.
struct View {
    eye: Vector,
    forward: Vector,
    right: Vector,
    up: Vector,
    lens: Lens,
}

impl View {
    fn new(pose: &Pose, lens: Lens, origin: DVec3) -> View {
        let (eye, forward, up) = match *pose {
            Pose::LookAt { eye, look, up } => (eye, minus(&vector(look), &vector(eye)), up),
            Pose::Forward { eye, forward, up } => (eye, vector(forward), up),
        };
        let forward = unit(&forward);
        let up = vector(up);
        let right = unit(&cross(&forward, &up));
        // What is left of up without its part along the view.
        let up = unit(&along(&up, &forward, &dot(&up, &forward).negated()));
        View {
            eye: minus(&vector(eye), &vector(origin)),
            forward,
            right,
            up,
            lens,
        }
    }

    /// Left, right, bottom and top of the window at depth 1, or at any depth.
    fn window(&self) -> [Dyadic; 4] {
        let symmetric = |y: Dyadic, aspect: f64| {
            let x = y.times(&Dyadic::from(aspect));
            [x.negated(), x, y.negated(), y]
        };
        match self.lens {
            Lens::Perspective {
                fovy_deg, aspect, ..
            } => {
                let half = pi()
                    .times(&Dyadic::from(fovy_deg))
                    .over(&Dyadic::from(360.0));
                symmetric(tangent(&half), aspect)
            }
            Lens::Orthographic { height, aspect, .. } => {
                symmetric(Dyadic::from(height).scaled(-1), aspect)
            }
            Lens::OffAxis { window, near, .. } => {
                window.map(|edge| Dyadic::from(edge).over(&Dyadic::from(near)))
            }
        }
    }

    /// The planes through the corners of the window, and near and far.
    fn planes(&self) -> Vec<ExactPlane> {
        let [left, right, bottom, top] = self.window();
        let parallel = matches!(self.lens, Lens::Orthographic { .. });
        let corners = [
            (&left, &bottom),
            (&right, &bottom),
            (&right, &top),
            (&left, &top),
        ]
        .map(|(x, y)| {
            let across = along(&[0.0; 3].map(Dyadic::from), &self.right, x);
            along(&across, &self.up, y)
        });
        let mut planes = Vec::new();
        for i in 0..4 {
            // Two points of one edge: with the eye, or along the view.
            let [mut a, mut b] = [&corners[i], &corners[(i + 1) % 4]].map(Clone::clone);
            let point = if parallel {
                b = minus(&b, &a);
                std::mem::replace(&mut a, self.forward.clone())
            } else {
                (a, b) = (plus(&a, &self.forward), plus(&b, &self.forward));
                [0.0; 3].map(Dyadic::from)
            };
            let mut normal = cross(&a, &b).map(Dyadic::cut);
            // The opposite corner is inside.
            let opposite = plus(&corners[(i + 2) % 4], &self.forward);
            if dot(&normal, &minus(&opposite, &point)).is_negative() {
                normal = normal.map(|n| n.negated());
            }
            planes.push(self.plane(&normal, &plus(&self.eye, &point)));
        }
        let at = |depth: f64| along(&self.eye, &self.forward, &Dyadic::from(depth));
        planes.push(self.plane(&self.forward, &at(self.lens.near())));
        if let Some(far) = self.lens.far() {
            let back = self.forward.clone().map(|x| x.negated());
            planes.push(self.plane(&back, &at(far)));
        }
        planes
    }

    fn plane(&self, normal: &Vector, through: &Vector) -> ExactPlane {
        let [x, y, z] = normal.clone();
        [x, y, z, dot(normal, through).negated().cut()]
    }

    /// A point near the view's boundary, more often than not; in f64.
    fn point(&self, dice: &mut Dice) -> DVec3 {
        let near = self.lens.near();
        let depth = match (self.lens, self.lens.far()) {
            (Lens::Orthographic { far, .. }, _) => dice.between(near, far),
            (_, Some(far)) => near * (far / near).powf(dice.between(-0.05, 1.05)),
            (_, None) => near * dice.magnitude(-0.1, 6.0),
        };
        let spread = match self.lens {
            Lens::Orthographic { .. } => 1.0,
            _ => depth,
        };
        let [left, right, bottom, top] = self.window().map(|x| x.to_f64());
        let mut share = || match dice.below(4) {
            0 => -dice.magnitude(-6.0, 0.0),
            1 => 1.0 + dice.magnitude(-6.0, 0.0),
            2 => dice.between(-0.5, 1.5),
            _ => dice.unit(),
        };
        let x = (left + (right - left) * share()) * spread;
        let y = (bottom + (top - bottom) * share()) * spread;
        let vec = |v: &Vector| DVec3::from_array([0, 1, 2].map(|k| v[k].to_f64()));
        vec(&self.eye) + vec(&self.right) * x + vec(&self.up) * y + vec(&self.forward) * depth
    }
}

fn plus(a: &Vector, b: &Vector) -> Vector {
    along(a, b, &Dyadic::from(1.0))
}

fn minus(a: &Vector, b: &Vector) -> Vector {
    along(a, b, &Dyadic::from(-1.0))
}

/// The planes moved outward by `2^exponent` of the magnitudes that meet at the
/// box, inward if `inward`; to 400 bits.
fn moved(planes: &[ExactPlane], b: &Aabb, exponent: i64, inward: bool) -> Vec<ExactPlane> {
    let reach = b.reach().to_array().map(Dyadic::from);
    let moved = planes.iter().map(|plane| {
        let [x, y, z, d] = plane.clone().map(|c| c.cut_to(400));
        let size = (0..3).fold(d.abs(), |sum, k| sum.plus(&plane[k].abs().times(&reach[k])));
        let by = size.cut_to(8).scaled(exponent);
        let d = if inward { d.minus(&by) } else { d.plus(&by) };
        [x, y, z, d]
    });
    moved.collect()
}

/// The verdict if it stands however the planes err by `2^exponent`.
fn robust(planes: &[ExactPlane], b: &Aabb, exponent: i64) -> Option<Verdict> {
    let outer = simplex::verdict(&moved(planes, b, exponent, false), b);
    if outer == Verdict::Out {
        return Some(outer);
    }
    let inner = simplex::verdict(&moved(planes, b, exponent, true), b);
    (inner == Verdict::In).then_some(inner)
}

const LENSES: [&str; 5] = [
    "perspective",
    "infinite far",
    "off-axis",
    "off-axis, infinite far",
    "orthographic",
];

/// Angles, aspects and depths to the ends of what is usable.
fn lens(kind: usize, dice: &mut Dice) -> Lens {
    let near = dice.magnitude(-3.0, 3.0);
    let far = near * (1.0 + dice.magnitude(-3.0, 9.0));
    let aspect = match dice.below(3) {
        0 => dice.magnitude(-4.0, 4.0),
        _ => dice.between(0.3, 3.0),
    };
    let fovy = match dice.below(6) {
        0 => 1e-3,
        1 => 179.99,
        2 => dice.magnitude(-3.0, 0.0),
        _ => dice.between(1.0, 175.0),
    };
    let far = [Some(far), None, Some(far), None, Some(far)][kind];
    let lens = match kind {
        0 | 1 => Lens::perspective(fovy, aspect, near, far),
        2 | 3 => {
            let mut edges = || {
                let size = near * dice.magnitude(-2.0, 2.0);
                let low = dice.between(-2.0, 1.0) * size;
                [low, low + size]
            };
            let ([left, right], [bottom, top]) = (edges(), edges());
            Lens::off_axis([left, right, bottom, top], near, far)
        }
        _ => Lens::orthographic(
            dice.magnitude(-3.0, 3.0),
            aspect,
            near * dice.between(-1.0, 0.9),
            far.expect("finite"),
        ),
    };
    lens.expect("a lens")
}

/// A pose and the origin of the boxes' coordinates.
fn pose(dice: &mut Dice) -> (Pose, DVec3) {
    let direction = |dice: &mut Dice| loop {
        let v = DVec3::from_array([0; 3].map(|_| dice.between(-1.0, 1.0)));
        if v.length() > 0.1 {
            break v;
        }
    };
    let axis = |dice: &mut Dice| [DVec3::X, -DVec3::Y, DVec3::Z][dice.below(3)];
    let any = |dice: &mut Dice| {
        if dice.chance(0.2) {
            axis(dice)
        } else {
            direction(dice)
        }
    };
    let offset = match dice.below(3) {
        0 => 0.0,
        1 => dice.magnitude(0.0, 9.0),
        _ => dice.magnitude(-3.0, 3.0),
    };
    let eye = direction(dice) * offset;
    // Rounded: the rest stays in the boxes' coordinates.
    let origin = if dice.chance(0.5) {
        eye.round()
    } else {
        DVec3::ZERO
    };
    let forward = any(dice) * dice.magnitude(-30.0, 30.0);
    let up = any(dice) * dice.magnitude(-5.0, 5.0);
    let look = eye + forward;
    let pose = if dice.chance(0.5) && look != eye {
        Pose::LookAt { eye, look, up }
    } else {
        Pose::Forward { eye, forward, up }
    };
    (pose, origin)
}

#[test]
fn random_cameras_of_every_lens() {
    const BOXES: usize = 8;
    let (mut verdicts, mut undecided) = ([0; 3], 0);
    for seed in 0..(cases(3000) / BOXES) as u64 {
        let mut dice = Dice::new(seed);
        let kind = seed as usize % LENSES.len();
        let lens = lens(kind, &mut dice);
        let (pose, origin) = pose(&mut dice);
        let Some(oracle) = Oracle::of_camera(&pose, &lens, origin) else {
            continue;
        };
        let view = View::new(&pose, lens, origin);
        let planes = view.planes();
        for _ in 0..BOXES {
            let (a, b) = (view.point(&mut dice), view.point(&mut dice));
            let share = if dice.chance(0.15) {
                1.0
            } else {
                dice.magnitude(-6.0, 0.0)
            };
            let (a, b) = (a.as_vec3(), (a + (b - a) * share).as_vec3());
            let b = Aabb::new(a.min(b), a.max(b));
            if !b.is_finite() {
                continue;
            }
            let found = oracle.judge(&b);
            let name = || {
                format!(
                    "seed {seed} ({}): {found:?} for {b:?}, {pose:?}, {lens:?}",
                    LENSES[kind]
                )
            };
            // Far outside the camera's own uncertainty ...
            if let Some(wanted) = robust(&planes, &b, -140) {
                assert!(found.verdict == wanted && !found.undecided, "{}", name());
            } else {
                // ... or closer than rounding could come: a tie.
                let wanted = robust(&planes, &b, -170);
                assert!(
                    found.undecided && found.verdict == Verdict::Touch && wanted.is_none(),
                    "{}, wanted {wanted:?}",
                    name()
                );
                undecided += 1;
            }
            verdicts[found.verdict as usize] += 1;
        }
    }
    println!("random cameras: {verdicts:?}, {undecided} undecided");
    let all: usize = verdicts.iter().sum();
    assert!(
        verdicts[0] * 5 > all && verdicts[2] * 5 > all,
        "{verdicts:?}"
    );
}

/// Three whole-number vectors at right angles, all of the same whole length
/// (Euler and Rodrigues: a rotation by a whole quaternion).
fn whole_frame(dice: &mut Dice) -> ([DVec3; 3], f64) {
    loop {
        let [w, x, y, z] = [0; 4].map(|_| dice.whole(2) as f64);
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
fn whole_camera(dice: &mut Dice) -> (Pose, Lens, DVec3, Vec<ExactPlane>, Vec<Vec3>) {
    let ([right, up, back], length) = whole_frame(dice);
    let forward = -back;
    let eye = dice.whole3(4).as_dvec3();
    let origin = dice.whole3(1).as_dvec3() * 1e6;
    // Depths in lengths of the frame's vectors, whose sums stay whole.
    let (near, far) = (1.0, dice.chance(0.7).then(|| 2.0 + dice.below(3) as f64));
    let quarters = |dice: &mut Dice, most: usize| 0.25 * (1 + dice.below(most)) as f64;
    let (width, height) = (quarters(dice, 12), quarters(dice, 12));
    let low = [0; 2].map(|_| 0.25 * dice.whole(8) as f64);
    let kind = dice.below(3);
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
        planes.push(match lens {
            Lens::Orthographic { .. } => (axis * sign, -edge * length * sign),
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
    let scale = libm::exp2(dice.whole(100) as f64);
    let pose = if dice.chance(0.5) {
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
        let mut dice = Dice::new(seed);
        let (pose, lens, origin, planes, tips) = whole_camera(&mut dice);
        let oracle = Oracle::of_camera(&pose, &lens, origin).expect("a camera");
        for _ in 0..8 {
            let tip = tips[dice.below(tips.len())];
            let mut b = grid_box(&mut dice, tip);
            if dice.chance(0.4) {
                // A little beside the tie.
                let by = dice.whole3(1) / 1024.0;
                (b.min, b.max) = (b.min + by, b.max + by);
            }
            let wanted = simplex::verdict(&planes, &b);
            let found = oracle.judge(&b);
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
        let near = 1e-100 * length.max(1e-200).min(1e80);
        let edge = 0.5 * near;
        let off_axis = Lens::off_axis([-edge, edge, -edge, edge], near, None);
        let oracle = Oracle::of_camera(&pose, &off_axis.expect("a lens"), DVec3::ZERO);
        let oracle = oracle.expect("a camera");
        let verdicts = [2.0, 2.0f32.next_up(), 1.5].map(|x| oracle.judge(&b(x)));
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
        let found = oracle.judge(&b);
        (found.verdict, found.undecided)
    };
    let near = libm::exp2(-100.0);
    assert_eq!(judge(near), (Verdict::In, false));
    assert_eq!(judge(-near), (Verdict::Out, false));
    for beyond in [-libm::exp2(-200.0), 0.0, libm::exp2(-200.0)] {
        assert_eq!(judge(beyond), (Verdict::Touch, true));
    }
}

#[test]
fn impossible_cameras_have_no_oracle() {
    let lens = Lens::perspective(60.0, 1.0, 1.0, None).expect("a lens");
    let of = |eye: DVec3, look: DVec3, up: DVec3| {
        Oracle::of_camera(&Pose::LookAt { eye, look, up }, &lens, DVec3::ZERO).is_some()
    };
    let odd = DVec3::new(0.1, 0.7, 0.3);
    assert!(of(odd, DVec3::ZERO, DVec3::Y));
    assert!(!of(odd, odd, DVec3::Y), "eye is look");
    assert!(!of(odd, DVec3::ZERO, DVec3::ZERO), "no up");
    assert!(!of(DVec3::ZERO, odd, -odd * 4.0), "up is parallel");
    assert!(!of(odd, DVec3::splat(f64::NAN), DVec3::Y), "not finite");
    let huge = DVec3::X * 1.7e308;
    assert!(of(huge, -huge, DVec3::Y), "the difference is beyond f64");
    let unchecked = Lens::OffAxis {
        window: [1.0, -1.0, -1.0, 1.0],
        near: 1.0,
        far: None,
    };
    let pose = Pose::Forward {
        eye: DVec3::ZERO,
        forward: DVec3::X,
        up: DVec3::Z,
    };
    assert!(Oracle::of_camera(&pose, &unchecked, DVec3::ZERO).is_none());
}
