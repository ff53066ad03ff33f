//! Camera level: random cameras of every lens against planes derived here, by
//! other formulas and with 640 bits.

use cullbench::camera::{Camera, CameraError, Lens, LensKind, Surroundings};
use cullbench::culling::{Arithmetic, CameraView, Culling, CullingError, TESTS};
use cullbench::geometry::{Aabb, sphere_cube};
use cullbench::oracle::{Oracle, Pose, Verdict};
use glam::DVec3;

use super::cases;
use super::draw::SeededRng;
use super::simplex::{self, ExactPlane};
use super::wide::{Dyadic, Vector, along, cross, dot, pi, tangent, unit, vector};

/// A camera with all that the expected planes are made from.
pub struct View {
    eye: Vector,
    forward: Vector,
    right: Vector,
    up: Vector,
    lens: Lens,
}

impl View {
    pub fn new(pose: &Pose, lens: Lens, origin: DVec3) -> View {
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
        match *self.lens.kind() {
            LensKind::Perspective { fovy_deg, aspect } => {
                let half = pi()
                    .times(&Dyadic::from(fovy_deg))
                    .over(&Dyadic::from(360.0));
                symmetric(tangent(&half), aspect)
            }
            LensKind::Orthographic { height, aspect } => {
                symmetric(Dyadic::from(height).scaled(-1), aspect)
            }
            LensKind::OffAxis { window } => {
                let near = Dyadic::from(self.lens.near());
                window.map(|edge| Dyadic::from(edge).over(&near))
            }
            LensKind::Matrix(_) => unreachable!("put to the proof in `matrices`"),
        }
    }

    /// The planes through the corners of the window, and near and far.
    fn planes(&self) -> Vec<ExactPlane> {
        let [left, right, bottom, top] = self.window();
        let parallel = self.lens.is_orthographic();
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
    pub fn point(&self, rng: &mut SeededRng) -> DVec3 {
        let near = self.lens.near();
        let depth = match (self.lens.is_orthographic(), self.lens.far()) {
            (true, Some(far)) => rng.between(near, far),
            (_, Some(far)) => near * (far / near).powf(rng.between(-0.05, 1.05)),
            (_, None) => near * rng.magnitude(-0.1, 6.0),
        };
        let spread = match self.lens.is_orthographic() {
            true => 1.0,
            _ => depth,
        };
        let [left, right, bottom, top] = self.window().map(|x| x.to_f64());
        let mut share = || match rng.below(4) {
            0 => -rng.magnitude(-6.0, 0.0),
            1 => 1.0 + rng.magnitude(-6.0, 0.0),
            2 => rng.between(-0.5, 1.5),
            _ => rng.unit(),
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

/// The default culling and the one about the eye, with every test: what loses
/// nothing. None where a view is refused because its sums could overflow.
fn safe_views(pose: &Pose, lens: Lens, origin: DVec3, boxes: &[Aabb]) -> Vec<CameraView> {
    let frame = pose.frame();
    frame.map_or(Vec::new(), |frame| {
        safe_views_of(&Camera { frame, lens }, origin, boxes)
    })
}

pub fn safe_views_of(camera: &Camera, origin: DVec3, boxes: &[Aabb]) -> Vec<CameraView> {
    let around = Surroundings {
        origin,
        reach: Aabb::union_of(boxes).reach(),
    };
    let mut views = Vec::new();
    for arithmetic in [Arithmetic::F32, Arithmetic::F32Relative] {
        for (test, ..) in TESTS {
            let culling = Culling {
                test,
                arithmetic,
                ..Culling::default()
            };
            if culling.check().is_err() {
                continue;
            }
            match culling.view(camera, &around) {
                Ok(view) => views.push(view),
                Err(CullingError::Camera(CameraError::Sums { .. })) => {}
                Err(error) => {
                    let size = camera.frame.eye.abs().max_element();
                    let size = size + camera.lens.far().unwrap_or(0.0);
                    assert!(size > 1e37, "{error}: {camera:?}");
                }
            }
        }
    }
    views
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
pub fn robust(planes: &[ExactPlane], b: &Aabb, exponent: i64) -> Option<Verdict> {
    let outer = simplex::verdict(&moved(planes, b, exponent, false), b);
    if outer == Verdict::Out {
        return Some(outer);
    }
    let inner = simplex::verdict(&moved(planes, b, exponent, true), b);
    (inner == Verdict::In).then_some(inner)
}

pub const LENSES: [&str; 5] = [
    "perspective",
    "infinite far",
    "off-axis",
    "off-axis, infinite far",
    "orthographic",
];

/// Angles, aspects and depths to the ends of what is usable.
pub fn lens(kind: usize, rng: &mut SeededRng) -> Lens {
    let near = rng.magnitude(-3.0, 3.0);
    let far = near * (1.0 + rng.magnitude(-3.0, 9.0));
    let aspect = match rng.below(3) {
        0 => rng.magnitude(-8.0, 8.0),
        _ => rng.between(0.3, 3.0),
    };
    let fovy = match rng.below(6) {
        0 => rng.magnitude(-9.0, -3.0),
        1 => 180.0 - rng.magnitude(-7.0, -2.0),
        2 => rng.magnitude(-3.0, 0.0),
        _ => rng.between(1.0, 175.0),
    };
    let far = [Some(far), None, Some(far), None, Some(far)][kind];
    let lens = match kind {
        0 | 1 => Lens::perspective(fovy, aspect, near, far),
        2 | 3 => {
            let mut edges = || {
                let size = near * rng.magnitude(-2.0, 2.0);
                let low = rng.between(-2.0, 1.0) * size;
                [low, low + size]
            };
            let ([left, right], [bottom, top]) = (edges(), edges());
            Lens::off_axis([left, right, bottom, top], near, far)
        }
        _ => Lens::orthographic(
            rng.magnitude(-3.0, 3.0),
            aspect,
            near * rng.between(-1.0, 0.9),
            far.expect("finite"),
        ),
    };
    lens.expect("a lens")
}

/// A pose and the origin of the boxes' coordinates.
pub fn pose(rng: &mut SeededRng) -> (Pose, DVec3) {
    let direction = |rng: &mut SeededRng| loop {
        let v = DVec3::from_array([0; 3].map(|_| rng.between(-1.0, 1.0)));
        if v.length() > 0.1 {
            break v;
        }
    };
    let axis = |rng: &mut SeededRng| [DVec3::X, -DVec3::Y, DVec3::Z][rng.below(3)];
    let any = |rng: &mut SeededRng| {
        if rng.chance(0.2) {
            axis(rng)
        } else {
            direction(rng)
        }
    };
    let offset = match rng.below(3) {
        0 => 0.0,
        1 => rng.magnitude(0.0, 15.0),
        _ => rng.magnitude(-3.0, 3.0),
    };
    let eye = direction(rng) * offset;
    // Rounded: the rest stays in the boxes' coordinates.
    let origin = if rng.chance(0.5) {
        eye.round()
    } else {
        DVec3::ZERO
    };
    let mut forward = any(rng) * rng.magnitude(-30.0, 30.0);
    if rng.chance(0.2) {
        // Look is the eye's neighbour, or nearly so.
        forward = any(rng) * (offset * rng.magnitude(-15.5, -6.0));
    }
    let mut up = any(rng) * rng.magnitude(-5.0, 5.0);
    if rng.chance(0.4) {
        // All but parallel to the view.
        up = forward.normalize() + any(rng) * rng.magnitude(-15.0, -6.0);
        up *= if rng.chance(0.5) { 1.0 } else { -3.3e4 };
    }
    let look = eye + forward;
    let pose = if rng.chance(0.5) && look != eye {
        Pose::LookAt { eye, look, up }
    } else {
        Pose::Forward { eye, forward, up }
    };
    (pose, origin)
}

#[test]
fn random_cameras_of_every_lens() {
    const BOXES: usize = 8;
    let (mut verdicts, mut undecided, mut views) = ([0; 3], 0, 0);
    for seed in 0..(cases(3000) / BOXES) as u64 {
        let mut rng = SeededRng::new(seed);
        let kind = seed as usize % LENSES.len();
        let lens = lens(kind, &mut rng);
        let (pose, origin) = pose(&mut rng);
        let Some(oracle) = Oracle::of_camera(&pose, &lens, origin) else {
            continue;
        };
        let view = View::new(&pose, lens, origin);
        let planes = view.planes();
        let mut boxes = Vec::with_capacity(BOXES);
        let mut seen = Vec::with_capacity(BOXES);
        for _ in 0..BOXES {
            let (a, b) = (view.point(&mut rng), view.point(&mut rng));
            let share = if rng.chance(0.15) {
                1.0
            } else {
                rng.magnitude(-6.0, 0.0)
            };
            let (a, b) = (a.as_vec3(), (a + (b - a) * share).as_vec3());
            let b = Aabb::new(a.min(b), a.max(b));
            if !b.is_finite() {
                continue;
            }
            let found = oracle.classify(&b);
            let wide = oracle.classify_f64(b.min.as_dvec3(), b.max.as_dvec3());
            assert_eq!(wide, found, "the same box, by other products");
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
            boxes.push(b);
            seen.push(found.verdict != Verdict::Out);
        }
        for made in safe_views(&pose, lens, origin, &boxes) {
            views += 1;
            for (b, seen) in boxes.iter().zip(&seen) {
                let cube = sphere_cube(b);
                let b = match made {
                    CameraView::Spheres(_) => &cube,
                    _ => b,
                };
                let kept = made.as_any().sees(b);
                assert!(
                    kept || !seen,
                    "seed {seed}: {b:?}, {pose:?}, {lens:?}, {made:?}"
                );
            }
        }
    }
    assert!(views > 4 * cases(3000) / BOXES, "{views} views");
    println!("random cameras: {verdicts:?}, {undecided} undecided");
    let all: usize = verdicts.iter().sum();
    assert!(
        verdicts[0] * 5 > all && verdicts[2] * 5 > all,
        "{verdicts:?}"
    );
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
}

#[test]
fn an_up_all_but_parallel_to_the_view_loses_nothing() {
    let lens = Lens::perspective(60.0, 1.5, 0.5, Some(200.0)).expect("a lens");
    let eye = DVec3::new(0.1, 0.7, -0.3);
    let look = eye + 0.937 * DVec3::new(1.1, 2.3, 0.7);
    let across = DVec3::new(2.3, -1.1, 0.0).normalize();
    let mut lost_of_rounded = Vec::new();
    for angle in [1e-9, 1e-11, 1e-14] {
        let up = look - eye + across * (angle * (look - eye).length());
        let pose = Pose::LookAt { eye, look, up };
        let view = View::new(&pose, lens, DVec3::ZERO);
        let vec = |v: &Vector| DVec3::from_array([0, 1, 2].map(|k| v[k].to_f64()));
        let (right, up_axis, forward) = (vec(&view.right), vec(&view.up), vec(&view.forward));
        let [left, _, bottom, top] = view.window().map(|edge| edge.to_f64());
        // A hair within the left side, as near as f32 has it.
        let points: Vec<Aabb> = (1..1000)
            .map(|i| {
                let (depth, share) = (f64::from(i) * 0.199 + 0.5, f64::from(i % 7) / 8.0 + 0.06);
                let upward = bottom + (top - bottom) * share;
                let lean = right * (left * (1.0 - 1e-9)) + up_axis * upward + forward;
                let p = (eye + lean * depth).as_vec3();
                Aabb::new(p, p)
            })
            .collect();
        let oracle = Oracle::of_camera(&pose, &lens, DVec3::ZERO).expect("a camera");
        let planes = view.planes();
        let visible: Vec<&Aabb> = points
            .iter()
            .filter(|b| oracle.verdict(b) == Verdict::In)
            .collect();
        assert!(visible.len() > 300, "{}", visible.len());
        for b in visible.iter().step_by(50) {
            assert_eq!(robust(&planes, b, -140), Some(Verdict::In), "{b:?}");
        }
        for made in safe_views(&pose, lens, DVec3::ZERO, &points) {
            let sees = |b: &Aabb| match made {
                CameraView::Spheres(_) => made.as_any().sees(&sphere_cube(b)),
                _ => made.as_any().sees(b),
            };
            let lost = visible.iter().filter(|b| !sees(b)).count();
            assert_eq!(lost, 0, "at {angle:e}: {made:?}");
        }
        // What a difference that is rounded first makes of the same numbers.
        let rounded = Pose::Forward {
            eye,
            forward: look - eye,
            up,
        };
        let rounded = &safe_views(&rounded, lens, DVec3::ZERO, &points)[1];
        let lost = visible.iter().filter(|b| !rounded.as_any().sees(b));
        lost_of_rounded.push(lost.count());
    }
    assert!(
        lost_of_rounded[1] > 0 && lost_of_rounded[2] > 100,
        "{lost_of_rounded:?}"
    );
}

#[test]
fn sums_that_overflow_are_refused_and_would_have_lost_something() {
    let pose = Pose::Forward {
        eye: DVec3::ZERO,
        forward: DVec3::new(0.57, 0.57, -0.59),
        up: DVec3::Z,
    };
    for (size, fits) in [(6e37, true), (3e38, false)] {
        let lens = Lens::perspective(150.0, 1.5, 1.0, Some(0.54 * size)).expect("a lens");
        let frame = pose.frame().expect("a frame");
        let camera = Camera { frame, lens };
        let p = DVec3::new(size, size, 1.1 * size).as_vec3();
        let corner = Aabb::new(p, p);
        let oracle = Oracle::of_camera(&pose, &lens, DVec3::ZERO).expect("a camera");
        assert_eq!(oracle.verdict(&corner), Verdict::In);
        let told = |reach| Surroundings {
            origin: DVec3::ZERO,
            reach,
        };
        let volume = camera.volume(&Default::default(), &told(p));
        let relative = camera.relative_volume(&[], 8.0, &told(p));
        if fits {
            assert!(volume.is_ok_and(|volume| volume.sees(&corner)));
            assert!(relative.is_ok_and(|v| v.planes().sees(&v.moved(&corner))));
            continue;
        }
        for error in [volume.map(|_| ()), relative.map(|_| ())] {
            let error = error.expect_err("a refusal");
            assert!(matches!(error, CameraError::Sums { .. }), "{error}");
            let line = error.to_string();
            assert!(line.contains("e38") && line.contains("expected") && !line.contains('\n'));
        }
        // Of the far plane x and y alone are beyond f32; z would bring it back.
        let wide = camera.convex_volume_f64(&told(p)).expect("planes in f64");
        assert!(wide.planes().iter().all(|plane| !plane.excludes(&corner)));
        let narrow = wide.planes().iter().map(|plane| plane.narrow());
        let mut narrow = narrow.filter(|plane| plane.excludes(&corner));
        assert!(narrow.next().is_some(), "the premise");
    }
}
