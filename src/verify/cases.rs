//! Difficult scenes and volumes: degenerate ones, random ones, of every kind.
//!
//! Degenerate scenes come with volumes that touch their boxes exactly if they can. A random
//! differential case is given by its seed, so any failure is one number. One camera yields every
//! kind of volume.

use glam::{DVec3, Vec3};

use super::scan;
use crate::camera::{Camera, CameraError, Frame, Lens, PlaneOptions, Surroundings};
use crate::geometry::{Aabb, ConvexVolume, Plane, PlaneF64};
use crate::query::ItemId;
use crate::scene::SeededRng;

/// Kinds of volumes from which cases are drawn.
pub const VOLUME_KINDS: [&str; 9] = [
    "perspective",
    "infinite far",
    "orthographic",
    "off-axis",
    "sheared",
    "unbounded (1 to 5 planes)",
    "12 planes",
    "31 planes",
    "empty",
];

/// A scene with one volume, one point and one region.
#[derive(Clone, Debug)]
pub struct RandomCase {
    /// Boxes, some of them inverted.
    pub items: Vec<Aabb>,
    /// Volume to cull by.
    pub volume: ConvexVolume,
    /// Index into [`VOLUME_KINDS`].
    pub kind: usize,
    /// Point to be located among the items.
    pub point: Vec3,
    /// Region to search: the items that overlap it.
    pub region: Aabb,
}

impl RandomCase {
    /// Case of a seed; the same on every machine.
    pub fn new(seed: u64) -> RandomCase {
        let mut rng = SeededRng::new(seed ^ 0xC011_BE7C);
        let scale = libm::exp2((rng.below(41) as f64) - 20.0);
        let count = [0, 1, 2, 17, 120, 600][rng.below(6)];
        let items: Vec<Aabb> = (0..count).map(|_| item(&mut rng, scale)).collect();
        let kind = rng.below(VOLUME_KINDS.len());
        let volume = loop {
            // A random camera may be impossible (up along the view): draws another.
            if let Some(volume) = volume(&mut rng, kind, scale, &items) {
                break volume;
            }
        };
        let mut point = grid_point(&mut rng, scale);
        let near = items.get(rng.below(count.max(1)));
        if let Some(b) = near.filter(|_| rng.unit() < 0.5) {
            point = b.corner(rng.below(8));
        }
        RandomCase {
            items,
            volume,
            kind,
            point,
            region: item(&mut rng, scale),
        }
    }

    /// Items that overlap the region, by the six comparisons.
    pub fn overlapping(&self) -> impl Iterator<Item = ItemId> {
        scan(&self.items, |b| !b.is_empty() && self.region.intersects(b))
    }
}

/// A random point, half of the time on a coarse grid so that exact ties occur.
fn grid_point(rng: &mut SeededRng, scale: f64) -> Vec3 {
    let on_grid = rng.unit() < 0.5;
    let p = (rng.point() * 2.0 - 1.0) * 8.0;
    ((if on_grid { p.round() } else { p }) * scale).as_vec3()
}

fn item(rng: &mut SeededRng, scale: f64) -> Aabb {
    let (a, b) = (grid_point(rng, scale), grid_point(rng, scale));
    match rng.below(8) {
        // A point, a flat box, a needle, an inverted (empty) box.
        0 => Aabb::new(a, a),
        1 => Aabb::new(a.min(b), a.max(b).with_z(a.min(b).z)),
        2 => {
            let along_x = |end: Vec3| end.with_y(a.y).with_z(a.z);
            Aabb::new(along_x(a.min(b)), along_x(a.max(b)))
        }
        3 => Aabb::new(a.max(b) + Vec3::splat(scale as f32), a.min(b)),
        4 => {
            let edge = scale * libm::exp2(-rng.unit() * 20.0);
            Aabb::new(a, a + Vec3::splat(edge as f32))
        }
        // Overlapping boxes of the scene's own size.
        _ => Aabb::new(a.min(b), a.max(b)),
    }
}

fn volume(rng: &mut SeededRng, kind: usize, scale: f64, items: &[Aabb]) -> Option<ConvexVolume> {
    match kind {
        0..=3 => camera_volume(rng, kind, scale, items),
        4 => {
            // A perspective volume with its x sheared along y and z: opposite planes are no longer
            // mirror images.
            let straight = camera_volume(rng, 0, scale, items)?;
            let [a, b] = [(); 2].map(|()| rng.between(-1.0, 1.0) as f32);
            ConvexVolume::from_planes(&sheared(straight.planes(), [a, b])).ok()
        }
        5 => {
            let count = 1 + rng.below(5);
            planes(rng, count, scale)
        }
        6 => planes(rng, 12, scale),
        7 => planes(rng, 31, scale),
        _ => {
            // Two half-spaces that face away from each other, or a plane that no point satisfies.
            let normal = rng.normal3().as_vec3();
            let gap = (scale * rng.unit()) as f32;
            let impossible = [Plane::new(Vec3::ZERO, -1.0)];
            let pair = [Plane::new(normal, -gap), Plane::new(-normal, -gap)];
            let none = rng.unit() < 0.5;
            let planes = if none { &impossible[..] } else { &pair };
            ConvexVolume::from_planes(planes).ok()
        }
    }
}

/// Shears planes: x along y and z.
pub fn sheared(planes: &[Plane], [a, b]: [f32; 2]) -> Vec<Plane> {
    let shear = |n: Vec3| Vec3::new(n.x, n.y + a * n.x, n.z + b * n.x);
    let planes = planes.iter();
    planes.map(|p| Plane::new(shear(p.normal), p.d)).collect()
}

/// Random planes near the middle of the scene, most of them facing it.
///
/// Some are axis-parallel and some pass through grid points, so that boxes touch them.
fn planes(rng: &mut SeededRng, count: usize, scale: f64) -> Option<ConvexVolume> {
    let planes = (0..count).map(|_| {
        let axis = [Vec3::X, Vec3::Y, Vec3::Z][rng.below(3)];
        let normal = match rng.below(3) {
            0 => axis,
            1 => -axis,
            _ => rng.normal3().as_vec3(),
        };
        let through = grid_point(rng, scale);
        let is_turned = normal.dot(through) > 0.0 && rng.unit() < 0.8;
        Plane::through(through, if is_turned { -normal } else { normal })
    });
    ConvexVolume::from_planes(&planes.collect::<Vec<_>>()).ok()
}

fn camera_volume(
    rng: &mut SeededRng,
    kind: usize,
    scale: f64,
    items: &[Aabb],
) -> Option<ConvexVolume> {
    let eye = grid_point(rng, scale).as_dvec3();
    let axis = [DVec3::X, DVec3::Y, DVec3::Z][rng.below(3)];
    let is_along = rng.unit() < 0.3;
    let forward = if is_along { axis } else { rng.normal3() };
    let frame = Frame::looking_along(eye, forward, rng.normal3()).ok()?;
    let near = scale * rng.between(0.001, 1.0);
    let far = near + scale * rng.between(0.1, 16.0);
    let fovy = rng.between(1.0, 175.0);
    let aspect = rng.between(0.2, 4.0);
    let lens = match kind {
        0 => Lens::perspective(fovy, aspect, near, Some(far)),
        1 => Lens::perspective(fovy, aspect, near, None),
        2 => Lens::orthographic(scale * rng.between(0.1, 8.0), aspect, -near, far),
        _ => {
            let low = rng.between(-2.0, 0.5) * near;
            let high = low + near * rng.between(0.1, 2.0);
            Lens::off_axis([low, high, -near, near * aspect], near, Some(far))
        }
    };
    let around = Surroundings::of_boxes(items);
    let mut options = PlaneOptions::default();
    if rng.unit() < 0.5 {
        options.epsilon = 0.0;
    }
    let lens = lens.ok()?;
    Camera { frame, lens }.volume(&options, &around).ok()
}

fn cube(x: f32, y: f32, z: f32, half: f32) -> Aabb {
    Aabb::around(Vec3::new(x, y, z), Vec3::splat(half))
}

fn row(count: u16, scale: f32) -> Vec<Aabb> {
    let at = |i| f32::from(i) * scale;
    let cubes = (0..count).map(|i| cube(at(i), 0.0, 0.0, 0.4 * scale));
    cubes.collect()
}

/// Degenerate scenes with their names.
///
/// No items, points, coincident and nested boxes, extreme sizes and positions, inverted boxes.
pub fn edge_scenes() -> Vec<(&'static str, Vec<Aabb>)> {
    let needle = |i: u16| {
        let at = f32::from(i) * 0.01;
        Aabb::new(Vec3::new(-1e3, at, -at), Vec3::new(1e3, at, -at))
    };
    let tile = |i: u16| {
        let (x, y) = (f32::from(i % 30), f32::from(i / 30));
        Aabb::new(Vec3::new(x, y, 2.0), Vec3::new(x + 1.0, y + 1.0, 2.0))
    };
    let far = |i: u16| cube(1e7 + f32::from(i), 1e7, -1e7, 1.0);
    let point = Aabb::new(Vec3::ONE, Vec3::ONE);
    let nested = |i: u16| cube(0.0, 0.0, 0.0, 1.0 + f32::from(i));
    let growing = |i: u16| Aabb::new(Vec3::ZERO, Vec3::splat((f32::from(i) / 10.0).exp2()));
    let everything = Aabb::new(Vec3::splat(-1e6), Vec3::splat(1e6));
    let everything = [vec![everything; 50], row(500, 1.0)].concat();
    let wide = Aabb::around(Vec3::ZERO, Vec3::new(1.75e38, 1.75e38, 1.0));
    let wide = [vec![wide], row(100, 1.0)].concat();
    let mut third_inverted = row(300, 1.0);
    for b in third_inverted.iter_mut().step_by(3) {
        *b = Aabb::new(b.max, b.min);
    }
    vec![
        ("empty", vec![]),
        ("one", vec![cube(0.0, 0.0, 0.0, 1.0)]),
        ("one point", vec![Aabb::new(Vec3::ZERO, Vec3::ZERO)]),
        ("two", row(2, 1.0)),
        ("all the same", vec![cube(1.0, 2.0, 3.0, 0.5); 1000]),
        ("all the same point", vec![point; 1000]),
        ("collinear", row(1000, 1.0)),
        ("coplanar", (0..900).map(tile).collect()),
        ("needles", (0..500).map(needle).collect()),
        ("huge and tiny", [row(200, 1e30), row(200, 1e-30)].concat()),
        ("subnormal", row(100, f32::from_bits(64))),
        ("near the largest float", row(100, 1e36)),
        ("wider than the largest float", wide),
        ("far away", (0..500).map(far).collect()),
        ("everything overlaps", everything),
        ("nested", (0..500).map(nested).collect()),
        ("growing from a corner", (0..500).map(growing).collect()),
        ("inverted among sound", third_inverted),
        ("only inverted", vec![Aabb::new(Vec3::ONE, Vec3::ZERO); 10]),
    ]
}

/// All of space, nothing, a short normal, and half-spaces and slabs of a scene.
///
/// Planes of the last two touch its boxes exactly.
pub fn edge_volumes(items: &[Aabb]) -> Vec<ConvexVolume> {
    let bounds = match Aabb::union_of(items) {
        b if b.is_empty() => cube(0.0, 0.0, 0.0, 1.0),
        b => b,
    };
    let short = Plane::new(Vec3::X * 1e-3, 1.0);
    let mut sets = vec![vec![], vec![Plane::new(Vec3::ZERO, -1.0)], vec![short]];
    for axis in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::new(0.3, -0.5, 0.8)] {
        let corners = items.iter().take(3).map(|b| b.max);
        for anchor in corners.chain([bounds.centre(), bounds.max]) {
            let low = Plane::new(axis, -axis.dot(anchor));
            let high = Plane::new(-axis, axis.dot(anchor));
            sets.extend([vec![low], vec![high], vec![low, high]]);
        }
    }
    // Planes that overflow f32 make no volume.
    let volumes = sets.iter().map(|planes| ConvexVolume::from_planes(planes));
    volumes.filter_map(Result::ok).collect()
}

/// Points on the faces of a camera's view, as near as f32 has them.
///
/// An unusual rounding, or a missing epsilon, puts them on the wrong side. For each face, points
/// all over the view (the R3 sequence of Roberts 2018) are moved onto it, along the line of sight
/// if that ends there; faces and points are relative to `origin`.
pub fn points_on_faces(camera: &Camera, origin: DVec3, faces: &[PlaneF64]) -> Vec<Aabb> {
    const EACH: u32 = 48;
    const STEP: DVec3 = DVec3::new(
        0.819_172_513_396_164_4,
        0.671_043_606_703_789_3,
        0.549_700_477_901_970_3,
    );
    let Camera { frame, lens } = camera.unprojected().unwrap_or(*camera);
    let (eye, near) = (frame.eye - origin, lens.near());
    let far = lens.far().unwrap_or(near.abs() * 1000.0);
    let [left, right, bottom, top] = match lens.matrix() {
        // A sheared or oblique matrix has no window of its own.
        Some(_) => [-1.0, 1.0, -0.5, 0.5],
        None => lens.window(),
    };
    let mut points = Vec::new();
    for face in faces {
        for i in 0..EACH {
            let share = (STEP * f64::from(i)).fract();
            let (x, y) = (
                left + (right - left) * share.x,
                bottom + (top - bottom) * share.y,
            );
            let aside = frame.u() * x + frame.v() * y;
            let [from, along] = match lens.is_orthographic() {
                true => [eye + aside, -frame.n()],
                false => [eye, aside - frame.n()],
            };
            let end = -(face.normal.dot(from) + face.d) / face.normal.dot(along);
            let is_end = |of: f64| (end - of).abs() <= of.abs() * 1e-9;
            let depth = match is_end(near) || is_end(far) {
                true => end,
                false => near + (far - near) * share.z,
            };
            let at = from + along * depth;
            let on = (at - face.normal * (face.normal.dot(at) + face.d)).as_vec3();
            points.push(Aabb::new(on, on));
        }
    }
    points
}

/// Volumes of all [`VOLUME_KINDS`] at a camera's position, with their kind.
///
/// Leaves out kinds whose planes do not fit f32; `seed` determines how many planes an unbounded
/// volume keeps.
///
/// # Errors
/// The camera's own planes do not fit f32.
pub fn variants(
    camera: &Camera,
    options: &PlaneOptions,
    around: &Surroundings,
    seed: usize,
) -> Result<Vec<(&'static str, ConvexVolume)>, CameraError> {
    // Both may lie behind the eye of an orthographic lens, but of no other; those of a matrix may
    // round to the same number.
    let (near, far) = match (camera.lens.near(), camera.lens.far()) {
        (near, Some(far)) if near > 0.0 && near < far => (near, far),
        (near, _) if near > 0.0 => (near, near * 1000.0),
        (_, Some(far)) if far > 0.0 => (far / 1000.0, far),
        (near, _) => (1.0, near.abs().max(1000.0)),
    };
    let with = |lens: Lens| Camera { lens, ..*camera }.volume(options, around);
    let straight = camera.volume(options, around)?;
    let planes = straight.planes().to_vec();
    let ortho = Lens::orthographic(0.3 * far, 1.5, -0.1 * far, 0.6 * far);
    let window = [-0.2, 0.9, -0.7, 0.1].map(|edge| edge * near);
    let sheared = sheared(&planes, [0.4, -0.3]);
    let mut turned = *camera;
    turned.frame.yaw(25.0);
    turned.frame.pitch(-10.0);
    let meeting = turned.volume(options, around);
    let meeting = meeting.as_ref().map_or(&planes[..], ConvexVolume::planes);
    let twelve = planes.iter().chain(meeting).copied();
    let many = twelve.clone().cycle().take(31).enumerate().map(|(i, p)| {
        // The same planes again, each slightly farther out.
        Plane::new(p.normal, p.d + (i / 12) as f32 * 0.01 * far as f32)
    });
    // A matrix may have any number of planes.
    let first = planes.first().copied().unwrap_or(Plane::new(Vec3::X, 0.0));
    let away = Plane::new(-first.normal, -first.d - 0.01 * far as f32);
    let mut volumes = vec![
        Some(straight.clone()),
        with(camera.lens.with_far(None).unwrap_or(camera.lens)).ok(),
        ortho.and_then(with).ok(),
        Lens::off_axis(window, near, Some(far)).and_then(with).ok(),
    ];
    let few = planes.iter().copied().take(1 + seed % 5).collect();
    let (twelve, many) = (twelve.clone().collect(), many.collect());
    for planes in [sheared, few, twelve, many, vec![first, away]] {
        volumes.push(ConvexVolume::from_planes(&planes).ok());
    }
    let kinds = VOLUME_KINDS.into_iter().zip(volumes);
    Ok(kinds.filter_map(|(kind, v)| Some((kind, v?))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::look_at;
    use glam::{DVec3, Vec3};

    #[test]
    fn cases_repeat_and_cover_every_kind() {
        let mut seen = [0; VOLUME_KINDS.len()];
        let (mut verdicts, mut visible) = (0, 0);
        for seed in 0..500 {
            let case = RandomCase::new(seed);
            let again = RandomCase::new(seed);
            assert_eq!((&case.items, case.point), (&again.items, again.point));
            seen[case.kind] += 1;
            verdicts += case.items.len();
            visible += case.items.iter().filter(|b| case.volume.sees(b)).count();
        }
        assert!(seen.iter().all(|&count| count > 20), "{seen:?}");
        assert!(
            visible * 20 > verdicts && visible * 20 < verdicts * 19,
            "{visible} of {verdicts}"
        );
    }

    #[test]
    fn every_kind_is_what_it_is_called() {
        let frame = look_at(DVec3::ZERO, DVec3::X, DVec3::Z).unwrap();
        let lens = Lens::perspective(60.0, 1.5, 0.1, Some(100.0)).unwrap();
        let camera = Camera { frame, lens };
        let volumes = variants(
            &camera,
            &PlaneOptions::default(),
            &Surroundings::default(),
            2,
        )
        .unwrap();
        let counts: Vec<_> = volumes.iter().map(|(_, v)| v.planes().len()).collect();
        assert_eq!(counts, [6, 5, 6, 6, 6, 3, 12, 31, 2]);
        let ahead = Vec3::new(50.0, 0.0, 0.0);
        let holds: Vec<_> = volumes
            .iter()
            .map(|(_, v)| v.contains_point(ahead))
            .collect();
        assert!(holds[..4].iter().all(|&h| h) && !holds[8], "{holds:?}");
    }

    /// A lens that sees behind the eye, perhaps only there, has the other kinds too.
    #[test]
    fn planes_behind_the_eye_leave_the_other_kinds_whole() {
        let frame = look_at(DVec3::ZERO, DVec3::X, DVec3::Z).unwrap();
        for [near, far] in [[-10.0, 500.0], [0.0, 1.0], [-900.0, -10.0], [-1.0, 0.0]] {
            let lens = Lens::orthographic(20.0, 1.5, near, far).unwrap();
            let camera = Camera { frame, lens };
            let options = PlaneOptions::default();
            let volumes = variants(&camera, &options, &Surroundings::default(), 1).unwrap();
            assert_eq!(volumes.len(), VOLUME_KINDS.len(), "{near} to {far}");
        }
    }
}
