//! Cameras that are matrices: random ones of every convention against sums of
//! their rows in whole numbers times powers of two, and matrices of known
//! cameras against those.

use cullbench::camera::{
    Camera, ClipSpace, Lens, MATRIX_CONVENTIONS, MatrixConvention, PlaneOptions, Surroundings,
    look_at,
};
use cullbench::culling::CameraView;
use cullbench::geometry::{Aabb, sphere_cube};
use cullbench::oracle::{Oracle, Pose, Verdict};
use cullbench::verify::points_on_faces;
use glam::{DMat4, DVec3, Vec3};

use super::camera::{self, View, robust, safe_views_of};
use super::cases;
use super::draw::{SeededRng, grid_box};
use super::simplex::{self, ExactPlane};
use super::wide::Dyadic;

type Entries = [[f64; 4]; 4];

/// Entries of a matrix in a convention.
fn written(matrix: &DMat4, convention: MatrixConvention) -> Entries {
    let columns = matrix.to_cols_array_2d();
    match convention.name().starts_with("row") {
        true => columns,
        false => matrix.transpose().to_cols_array_2d(),
    }
}

fn is_from_zero(convention: MatrixConvention) -> bool {
    convention.name().contains("d3d")
}

/// The planes of a matrix for column vectors about `origin`, exactly. One
/// without a normal, above zero, is none.
fn planes(rows: &Entries, from_zero: bool, origin: DVec3) -> Vec<ExactPlane> {
    let [x, y, z, w] = rows.map(|row| row.map(Dyadic::from));
    let sum = |a: &ExactPlane, b: &ExactPlane| [0, 1, 2, 3].map(|k| a[k].plus(&b[k]));
    let difference = |a: &ExactPlane, b: &ExactPlane| [0, 1, 2, 3].map(|k| a[k].minus(&b[k]));
    let low = if from_zero { z.clone() } else { sum(&w, &z) };
    let all = [
        sum(&w, &x),
        difference(&w, &x),
        sum(&w, &y),
        difference(&w, &y),
        low,
        difference(&w, &z),
    ];
    let bounds = |p: &ExactPlane| !p[..3].iter().all(Dyadic::is_zero) || p[3].is_negative();
    let about = all.into_iter().filter(bounds).map(|[a, b, c, d]| {
        let along = [(&a, origin.x), (&b, origin.y), (&c, origin.z)];
        let d = along
            .into_iter()
            .fold(d, |d, (n, at)| d.plus(&n.times(&Dyadic::from(at))));
        [a, b, c, d]
    });
    about.collect()
}

/// A matrix as some engine would have made it: of any lens with an eye, any
/// depth, scaled, upside down, rounded to f32, or with entries that are off.
fn matrix(rng: &mut SeededRng, pose: &Pose, lens: &Lens, from_zero: bool) -> Option<DMat4> {
    let clip = match (from_zero, rng.chance(0.5)) {
        (false, _) => ClipSpace::OpenGl,
        (true, false) => ClipSpace::D3d,
        (true, true) => ClipSpace::ReversedZ,
    };
    let mut matrix = lens.projection(clip) * pose.frame().ok()?.world_to_eye();
    if rng.chance(0.3) {
        matrix = DMat4::from_scale(DVec3::new(1.0, -1.0, 1.0)) * matrix;
    }
    if rng.chance(0.3) {
        matrix *= rng.magnitude(-6.0, 6.0);
    }
    let mut entries = matrix.to_cols_array();
    if rng.chance(0.4) {
        entries = entries.map(|entry| f64::from(entry as f32));
    }
    if rng.chance(0.2) {
        entries = entries.map(|entry| entry * (1.0 + rng.between(-0.01, 0.01)));
    }
    Some(DMat4::from_cols_array(&entries))
}

/// A point near the volume's surface, about `origin`.
fn point(rng: &mut SeededRng, camera: &Camera, view: &View, origin: DVec3) -> DVec3 {
    let Some(corners) = camera.lens.corners(&camera.frame) else {
        return view.point(rng);
    };
    let mut share = || match rng.below(4) {
        0 => -rng.magnitude(-6.0, 0.0),
        1 => 1.0 + rng.magnitude(-6.0, 0.0),
        2 => rng.between(-0.5, 1.5),
        _ => rng.unit(),
    };
    let [x, y, z] = [share(), share(), share()];
    let near = corners[0]
        .lerp(corners[1], x)
        .lerp(corners[2].lerp(corners[3], x), y);
    let far = corners[4]
        .lerp(corners[5], x)
        .lerp(corners[6].lerp(corners[7], x), y);
    near.lerp(far, z) - origin
}

#[test]
fn random_matrices_of_every_convention() {
    const BOXES: usize = 8;
    let (mut verdicts, mut refused, mut views) = ([0; 3], 0, 0);
    let rounds = cases(3000) / BOXES;
    for seed in 0..rounds as u64 {
        let mut rng = SeededRng::new(seed ^ 0x5EED);
        let (convention, name, _) = MATRIX_CONVENTIONS[seed as usize % 8];
        let lens = camera::lens(rng.below(5), &mut rng);
        let (pose, origin) = camera::pose(&mut rng);
        let Some(matrix) = matrix(&mut rng, &pose, &lens, is_from_zero(convention)) else {
            continue;
        };
        let made = Camera::of_matrix(written(&matrix, convention), convention);
        let camera = match made {
            Ok(camera) => camera,
            Err(error) => {
                let line = error.to_string();
                assert!(line.contains("expected") && !line.contains('\n'), "{line}");
                refused += 1;
                continue;
            }
        };
        let view = View::new(&pose, lens, origin);
        let rows = matrix.transpose().to_cols_array_2d();
        let planes = planes(&rows, is_from_zero(convention), origin);
        let pose = Pose::of(&camera);
        let oracle = Oracle::of_camera(&pose, &camera.lens, origin).expect("a camera");
        let (mut boxes, mut seen) = (Vec::new(), Vec::new());
        for _ in 0..BOXES {
            let [a, b] = [0; 2].map(|_| point(&mut rng, &camera, &view, origin));
            let share = rng.magnitude(-6.0, 0.0);
            let (a, b) = (a.as_vec3(), (a + (b - a) * share).as_vec3());
            let b = Aabb::new(a.min(b), a.max(b));
            if !b.is_finite() || b.reach().max_element() > 1e37 {
                continue;
            }
            let found = oracle.classify(&b);
            let what = || format!("seed {seed}, {name}: {found:?} for {b:?}, {rows:?}");
            match robust(&planes, &b, -140) {
                Some(wanted) => {
                    assert!(found.verdict == wanted && !found.undecided, "{}", what());
                }
                None => {
                    let wanted = robust(&planes, &b, -170);
                    let tie = found.undecided && found.verdict == Verdict::Touch;
                    assert!(tie && wanted.is_none(), "{}, wanted {wanted:?}", what());
                }
            }
            verdicts[found.verdict as usize] += 1;
            boxes.push(b);
            seen.push(found.verdict != Verdict::Out);
        }
        for made in safe_views_of(&camera, origin, &boxes) {
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
                    "seed {seed}, {name}: {b:?}, {rows:?}, {made:?}"
                );
            }
        }
    }
    println!("random matrices: {verdicts:?}, {refused} refused, {views} views");
    let all: usize = verdicts.iter().sum();
    assert!(
        verdicts[0] * 5 > all && verdicts[2] * 5 > all,
        "{verdicts:?}"
    );
    assert!(
        refused * 3 < rounds && views > 4 * rounds,
        "{refused}, {views}"
    );
}

/// Points as near to the planes as f32 has them: half of them are visible, and
/// none of those may be lost; without the margin some are.
#[test]
fn points_on_the_planes_of_matrices_are_not_lost() {
    let (mut visible, mut lost) = (0, 0);
    for seed in 0..cases(3000) as u64 / 60 {
        let mut rng = SeededRng::new(seed ^ 0xFACE);
        let (convention, name, _) = MATRIX_CONVENTIONS[seed as usize % 8];
        let direction = |rng: &mut SeededRng| {
            DVec3::from_array([0; 3].map(|_| rng.between(-1.0, 1.0))) + DVec3::splat(1e-3)
        };
        let eye = direction(&mut rng) * rng.magnitude(0.0, 7.0);
        let (forward, up) = (direction(&mut rng), DVec3::Z);
        let pose = Pose::Forward { eye, forward, up };
        let near = rng.magnitude(-2.0, 1.0);
        let far = rng.chance(0.7).then_some(near * rng.magnitude(1.0, 5.0));
        let lens = Lens::perspective(rng.between(10.0, 150.0), 1.5, near, far);
        let lens = lens.expect("a lens");
        let matrix = matrix(&mut rng, &pose, &lens, is_from_zero(convention));
        let entries = written(&matrix.expect("a matrix"), convention);
        let Ok(camera) = Camera::of_matrix(entries, convention) else {
            continue;
        };
        let origin = if rng.chance(0.5) {
            eye.round()
        } else {
            DVec3::ZERO
        };
        let around = Surroundings {
            origin,
            ..Surroundings::default()
        };
        let faces = camera.convex_volume_f64(&around).expect("planes");
        let mut points = points_on_faces(&camera, origin, faces.planes());
        points.retain(|b| b.is_finite());
        let oracle = Oracle::of_camera(&Pose::of(&camera), &camera.lens, origin);
        let oracle = oracle.expect("a camera");
        points.retain(|b| oracle.verdict(b) != Verdict::Out);
        visible += points.len();
        let bare = PlaneOptions {
            epsilon: 0.0,
            ..PlaneOptions::default()
        };
        let bare = camera.volume(&bare, &around).expect("planes");
        lost += points.iter().filter(|b| !bare.sees(b)).count();
        for made in safe_views_of(&camera, origin, &points) {
            for b in &points {
                let kept = match made {
                    CameraView::Spheres(_) => made.as_any().sees(&sphere_cube(b)),
                    _ => made.as_any().sees(b),
                };
                assert!(kept, "seed {seed}, {name}: {b:?}, {entries:?}, {made:?}");
            }
        }
    }
    assert!(visible > 500 && lost > 50, "{visible}, {lost}");
    println!("points on planes of matrices: {visible} visible, {lost} lost without a margin");
}

/// A left plane that leans by a component that is subnormal in f32.
///
/// Over 5e37 units along y, its rounding moves the plane by a third of what the box is inside.
#[test]
fn a_subnormal_component_of_a_normal_loses_nothing() {
    let (along, lean) = (5e37, f64::exp2(-151.0));
    let entries = [
        [1e3, 1e3 * lean, 0.0, 0.0],
        [0.0, 1.0 / 6e37, 0.0, 0.0],
        [0.0, 0.0, -0.1, 0.0],
        [0.0, 0.0, 0.0, 1.0],
    ];
    let camera = Camera::of_matrix(entries, MatrixConvention::ColumnGl).expect("a camera");
    let high = (-0.001 - 0.8 * lean * along) as f32;
    let seen = Aabb::new(
        Vec3::new(high - 1e-4, along as f32, -1.0),
        Vec3::new(high, along as f32, 1.0),
    );
    let around = Surroundings::of_boxes(&[seen]);
    let oracle = Oracle::of_camera(&Pose::of(&camera), &camera.lens, DVec3::ZERO);
    assert!(oracle.expect("a camera").verdict(&seen) != Verdict::Out);
    for made in safe_views_of(&camera, DVec3::ZERO, &[seen]) {
        let kept = match made {
            CameraView::Spheres(_) => made.as_any().sees(&sphere_cube(&seen)),
            _ => made.as_any().sees(&seen),
        };
        assert!(kept, "{made:?}");
    }
    let volume = camera.volume(&PlaneOptions::default(), &around);
    assert!(volume.expect("planes").sees(&seen));
}

/// |x| <= -z, |y| <= -z, 1 <= -z <= 3 (or without an end).
const OPEN_GL: Entries = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, -2.0, -3.0],
    [0.0, 0.0, -1.0, 0.0],
];

fn with_depth(row: [f64; 4]) -> Entries {
    let [x, y, _, w] = OPEN_GL;
    [x, y, row, w]
}

fn transposed(m: Entries) -> Entries {
    [0, 1, 2, 3].map(|i| [0, 1, 2, 3].map(|j| m[j][i]))
}

#[test]
fn whole_matrices_see_what_their_planes_say_under_every_name() {
    use MatrixConvention::{ColumnD3d, ColumnGl, RowD3d, RowGl};
    let plane = |n: [f64; 4]| n.map(Dyadic::from);
    let sides = [
        plane([1.0, 0.0, -1.0, 0.0]),
        plane([-1.0, 0.0, -1.0, 0.0]),
        plane([0.0, 1.0, -1.0, 0.0]),
        plane([0.0, -1.0, -1.0, 0.0]),
        plane([0.0, 0.0, -1.0, -1.0]),
    ];
    let d3d = with_depth([0.0, 0.0, -1.5, -1.5]);
    let reversed = with_depth([0.0, 0.0, 0.5, 1.5]);
    let endless = [
        (with_depth([0.0, 0.0, -1.0, -2.0]), ColumnGl),
        (with_depth([0.0, 0.0, -1.0, -1.0]), ColumnD3d),
        (with_depth([0.0, 0.0, 0.0, 1.0]), ColumnD3d),
        (transposed(with_depth([0.0, 0.0, 0.0, 1.0])), RowD3d),
    ];
    let ending = [
        (OPEN_GL, ColumnGl),
        (transposed(OPEN_GL), RowGl),
        (d3d, ColumnD3d),
        (transposed(d3d), RowD3d),
        (reversed, ColumnD3d),
        (transposed(reversed), RowD3d),
    ];
    let all = ending.map(|e| (e, Some(3.0))).into_iter();
    let all = all.chain(endless.map(|e| (e, None)));
    for ((entries, convention), far) in all {
        let what = format!("{entries:?}, {}", convention.name());
        let camera = Camera::of_matrix(entries, convention).expect(&what);
        assert_eq!(camera.frame.eye, DVec3::ZERO, "{what}");
        assert_eq!(camera.frame.forward(), -DVec3::Z, "{what}");
        assert_eq!(
            (camera.lens.near(), camera.lens.far()),
            (1.0, far),
            "{what}"
        );
        let volume = camera.volume(&Default::default(), &Default::default());
        assert_eq!(
            volume.expect(&what).planes().len(),
            5 + usize::from(far.is_some())
        );
        let mut planes = sides.to_vec();
        planes.extend(far.map(|far| plane([0.0, 0.0, 1.0, far])));
        let pose = Pose::of(&camera);
        let oracle = Oracle::of_camera(&pose, &camera.lens, DVec3::ZERO).expect(&what);
        let mut rng = SeededRng::new(7);
        let mut touching = 0;
        let mut boxes = Vec::new();
        for _ in 0..2000 {
            let at = rng.whole3(5) + Vec3::new(0.0, 0.0, -2.0);
            let b = grid_box(&mut rng, at);
            let wanted = simplex::verdict(&planes, &b);
            assert_eq!(oracle.verdict(&b), wanted, "{b:?}: {what}");
            touching += u32::from(wanted == Verdict::Touch);
            boxes.push((b, wanted));
        }
        assert!(touching > 100, "{touching}");
        let bounds: Vec<Aabb> = boxes.iter().map(|b| b.0).collect();
        for made in safe_views_of(&camera, DVec3::ZERO, &bounds) {
            for (b, wanted) in &boxes {
                let kept = match made {
                    CameraView::Spheres(_) => made.as_any().sees(&sphere_cube(b)),
                    _ => made.as_any().sees(b),
                };
                assert!(kept || *wanted == Verdict::Out, "{b:?}: {what}: {made:?}");
            }
        }
    }
    // Read by another name it is another camera, or none.
    let right = Camera::of_matrix(OPEN_GL, ColumnGl).map(|camera| camera.lens);
    for other in [ColumnD3d, RowGl, RowD3d] {
        let wrong = Camera::of_matrix(OPEN_GL, other).map(|camera| camera.lens);
        assert_ne!(wrong, right, "{}", other.name());
    }
}

#[test]
fn a_matrix_of_a_known_camera_sees_what_the_camera_sees() {
    let mut differing = 0;
    for seed in 0..cases(3000) as u64 / 100 {
        let mut rng = SeededRng::new(seed);
        let eye = DVec3::from_array([0; 3].map(|_| rng.between(-100.0, 100.0)));
        let look = DVec3::from_array([0; 3].map(|_| rng.between(-100.0, 100.0)));
        let far = (seed % 3 > 0).then_some(300.0);
        let lens = Lens::perspective(rng.between(20.0, 120.0), 1.5, 0.5, far);
        let known = Camera {
            frame: look_at(eye, look, DVec3::Z).expect("a frame"),
            lens: lens.expect("a lens"),
        };
        let (convention, ..) = MATRIX_CONVENTIONS[seed as usize % 8];
        let clip = match (is_from_zero(convention), seed % 2) {
            (false, _) => ClipSpace::OpenGl,
            (true, 0) => ClipSpace::D3d,
            (true, _) => ClipSpace::ReversedZ,
        };
        let matrix = known.lens.projection(clip) * known.frame.world_to_eye();
        let camera = Camera::of_matrix(written(&matrix, convention), convention).expect("a matrix");
        assert!((camera.frame.eye - eye).length() < 1e-9, "{seed}");
        assert!((camera.frame.forward() - known.frame.forward()).length() < 1e-9);
        assert!((camera.lens.near() / 0.5 - 1.0).abs() < 1e-9);
        let boxes: Vec<Aabb> = (0..2000)
            .map(|_| {
                let at = Vec3::from_array([0; 3].map(|_| rng.between(-200.0, 200.0) as f32));
                Aabb::around(at, Vec3::splat(rng.between(0.0, 9.0) as f32))
            })
            .collect();
        let by_pose = Oracle::of_camera(&Pose::of(&known), &known.lens, DVec3::ZERO);
        let by_pose = by_pose.expect("a camera");
        let (ours, theirs) = (&camera, &known);
        let views = [ours, theirs].map(|camera| safe_views_of(camera, DVec3::ZERO, &boxes));
        assert_eq!(views[0].len(), views[1].len());
        for (a, b) in views[0].iter().zip(&views[1]) {
            for item in &boxes {
                let indexed = match a {
                    CameraView::Spheres(_) => sphere_cube(item),
                    _ => *item,
                };
                let seen = [a, b].map(|view| view.as_any().sees(&indexed));
                if seen[0] != seen[1] {
                    differing += 1;
                    // Only what both may return too much.
                    assert_eq!(by_pose.verdict(item), Verdict::Out, "{item:?}");
                }
            }
        }
        let by_matrix = Oracle::of_camera(&Pose::of(&camera), &camera.lens, DVec3::ZERO);
        let by_matrix = by_matrix.expect("a camera");
        for item in &boxes {
            let ours = by_matrix.verdict(item);
            let is_near = by_pose.depth(item).abs() < 1e-9;
            assert!(ours == by_pose.verdict(item) || is_near, "{item:?}");
        }
    }
    assert!(differing < 100, "{differing}");
}

#[test]
fn what_is_no_camera_is_refused() {
    use MatrixConvention::ColumnGl;
    let of = |entries: Entries, convention| {
        let error = Camera::of_matrix(entries, convention).unwrap_err();
        error.to_string()
    };
    let starts = |error: String, what: &str| assert!(error.starts_with(what), "{error}");
    let singular = [[1.0; 4]; 4];
    starts(of(singular, ColumnGl), "the matrix is singular");
    starts(of([[0.0; 4]; 4], ColumnGl), "the matrix is singular");
    let negated = OPEN_GL.map(|row| row.map(|entry| -entry));
    starts(of(negated, ColumnGl), "the matrix sees nothing");
    for value in [f64::NAN, f64::INFINITY] {
        let mut entries = OPEN_GL;
        entries[1][2] = value;
        let error = of(entries, ColumnGl);
        assert!(error.contains("m12") && error.contains("finite"), "{error}");
    }
    for value in [1e61, -1e-61, 5e-324] {
        let mut entries = OPEN_GL;
        entries[2][0] = value;
        let error = of(entries, ColumnGl);
        assert!(error.contains("m20") && error.contains("1e-60"), "{error}");
    }
}
