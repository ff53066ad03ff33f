//! Random differential cases: small scenes made to be unpleasant (touching
//! faces, repeated and flat boxes, wild sizes) and volumes of every kind, a point and
//! a box. A case is its seed, so that any failure is one number.

use glam::{DVec3, Vec3};

use crate::camera::{Camera, Frame, Lens, PlaneOptions, Surroundings};
use crate::geometry::{Aabb, ConvexVolume, Plane};
use crate::query::ItemId;
use crate::scene::SeededRng;

/// The volumes that cases are drawn from.
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

/// One scene with one volume and one point.
pub struct RandomCase {
    /// Boxes, some of them inverted.
    pub items: Vec<Aabb>,
    /// Planes to be culled by.
    pub volume: ConvexVolume,
    /// Index into [`VOLUME_KINDS`].
    pub kind: usize,
    /// A point to be located among the items.
    pub point: Vec3,
    /// To be searched by: the items that overlap it.
    pub region: Aabb,
}

impl RandomCase {
    /// The case of a seed; the same on every machine.
    pub fn new(seed: u64) -> RandomCase {
        let mut rng = SeededRng::new(seed ^ 0xC011_BE7C);
        let scale = libm::exp2((rng.below(41) as f64) - 20.0);
        let count = [0, 1, 2, 17, 120, 600][rng.below(6)];
        let items: Vec<Aabb> = (0..count).map(|_| item(&mut rng, scale)).collect();
        let kind = rng.below(VOLUME_KINDS.len());
        let volume = loop {
            // A drawn camera may be impossible (up along the view): again.
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

    /// The items that overlap the region, by the six comparisons.
    pub fn overlapping(&self) -> impl Iterator<Item = ItemId> {
        let items = (0..).zip(&self.items);
        let found = items.filter(|(_, b)| !b.is_empty() && self.region.intersects(b));
        found.map(|(id, _)| id)
    }
}

/// A point on a coarse grid half of the time: exact ties are the point.
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
            // A perspective volume with its x sheared along y and z: opposite
            // planes are no longer mirror images.
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
            // Two half-spaces that face away from each other, or none at all.
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

/// Planes whose x is sheared along y and z.
pub fn sheared(planes: &[Plane], [a, b]: [f32; 2]) -> Vec<Plane> {
    let shear = |n: Vec3| Vec3::new(n.x, n.y + a * n.x, n.z + b * n.x);
    planes
        .iter()
        .map(|p| Plane::new(shear(p.normal), p.d))
        .collect()
}

/// Planes near the middle of the scene, facing it more often than not; some
/// axis-parallel, some through grid points, so that boxes touch them.
fn planes(rng: &mut SeededRng, count: usize, scale: f64) -> Option<ConvexVolume> {
    let planes = (0..count).map(|_| {
        let axis = [Vec3::X, Vec3::Y, Vec3::Z][rng.below(3)];
        let normal = match rng.below(3) {
            0 => axis,
            1 => -axis,
            _ => rng.normal3().as_vec3(),
        };
        let through = grid_point(rng, scale);
        let facing = if normal.dot(through) > 0.0 && rng.unit() < 0.8 {
            -normal
        } else {
            normal
        };
        Plane::through(through, facing)
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
    let forward = if rng.unit() < 0.3 {
        axis
    } else {
        rng.normal3()
    };
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

#[cfg(test)]
mod tests {
    use super::*;

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
}
