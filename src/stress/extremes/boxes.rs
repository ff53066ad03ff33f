//! Boxes that make rounding as bad as it gets: most touch the view volume at a
//! point of a face, an edge or a corner, and are then shifted by up to two
//! ulps per axis; the rest lie about anywhere.

use glam::{DVec3, Vec3};

use crate::camera::{Camera, FARTHEST, Surroundings};
use crate::geometry::Aabb;
use crate::kernel::each;
use crate::scene::SeededRng;

/// Shapes of the boxes of a case.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Shapes {
    /// Points, cubes, slivers, specks and boxes larger than the volume.
    Mixed,
    /// Lines and plates: zero on one or two axes, long on the others.
    Needles,
    /// A few boxes, many times each.
    Coincident,
    /// Sizes over six orders of magnitude side by side.
    Ratio,
    /// Bounds on a grid of integers that the camera is on as well.
    Grid,
}

/// The hull of what a camera sees, in scene-local f64.
struct Hull {
    /// Near corners, then far ones; bit 0 is right, bit 1 top.
    corners: [DVec3; 8],
    /// Inward, in the order of the corners' bits: left, right, bottom, top,
    /// near, far.
    normals: [DVec3; 6],
}

/// Depth up to which an infinite volume is probed / near.
const DEEP: f64 = 1e4;

impl Hull {
    fn of(camera: &Camera, around: &Surroundings) -> Option<Hull> {
        let deep = (camera.lens.near() * DEEP).min(FARTHEST);
        let far = camera.lens.far().unwrap_or(deep);
        let lens = camera.lens.with_far(Some(far)).ok()?;
        let frame = camera.frame.relative_to(around.origin);
        let camera = Camera {
            lens,
            frame: camera.frame,
        };
        // Only as a hint where inside is.
        let planes = camera.convex_volume_f64(around).ok()?;
        let normals: Vec<DVec3> = planes.planes().iter().map(|p| p.normal).collect();
        Some(Hull {
            corners: lens.corners(&frame)?,
            normals: normals.try_into().ok()?,
        })
    }

    fn at(&self, [s, t, w]: [f64; 3]) -> DVec3 {
        let across = |i: usize| {
            let [a, b, c, d] = each([0, 1, 2, 3], |k| self.corners[i + k]);
            a.lerp(b, s).lerp(c.lerp(d, s), t)
        };
        across(0).lerp(across(4), w)
    }
}

/// `count` boxes about a camera's volume, in scene-local coordinates. One in
/// 64 is inverted, and so empty. None if the lens has no corners.
pub fn adversarial(
    rng: &mut SeededRng,
    camera: &Camera,
    around: &Surroundings,
    shapes: Shapes,
    count: usize,
) -> Option<Vec<Aabb>> {
    let hull = Hull::of(camera, around)?;
    let mut boxes: Vec<Aabb> = Vec::with_capacity(count);
    for i in 0..count {
        if shapes == Shapes::Coincident && i >= 16 {
            let again = boxes[i % 16];
            boxes.push(again);
            continue;
        }
        let mut b = match rng.below(8) {
            0 => astray(rng, &hull),
            _ => touching(rng, &hull, shapes),
        };
        if rng.below(64) == 0 {
            b = Aabb::new(b.max, b.min);
        }
        boxes.push(b);
    }
    Some(boxes)
}

/// A box whose corner, edge or face meets the hull where it was aimed.
fn touching(rng: &mut SeededRng, hull: &Hull, shapes: Shapes) -> Aabb {
    // Anywhere between near and far, every order of magnitude alike.
    let depth = libm::exp2(-rng.between(0.0, 14.0));
    let mut at = [rng.unit(), rng.unit(), depth];
    let mut faces: Vec<DVec3> = Vec::with_capacity(3);
    let first = rng.below(3);
    for step in 0..[1, 2, 2, 3][rng.below(4)] {
        let axis = (first + step) % 3;
        let high = rng.below(2);
        at[axis] = high as f64;
        faces.push(hull.normals[2 * axis + high]);
    }
    let (mut inward, mut both) = (faces.iter().sum::<DVec3>(), [false; 3]);
    let axis = rng.below(3);
    match faces[..] {
        // An edge against an edge of the box along this axis.
        [a, b, ..] if a[axis] * b[axis] < 0.0 && rng.below(2) == 0 => {
            inward = a * b[axis].abs() + b * a[axis].abs();
            both[axis] = true;
        }
        // A corner against a face of the box across this axis.
        [_, _, _] if rng.below(2) == 0 => {
            both = [0, 1, 2].map(|k| k != axis);
        }
        _ => {}
    }
    let mut p = hull.at(at);
    if shapes == Shapes::Grid {
        p = (p * 4.0).round() / 4.0;
    }
    let scale = (hull.at([0.5, 0.5, at[2]]) - hull.at([0.0, 0.0, at[2]])).length();
    let (mut min, mut max) = (p.as_vec3(), p.as_vec3());
    let sizes = sizes(rng, shapes, scale);
    for k in 0..3 {
        let ulps = rng.below(5) as i32 - 2;
        let corner = shifted(p[k] as f32, ulps);
        let (low, high) = (p[k] - sizes[k], p[k] + sizes[k]);
        (min[k], max[k]) = if both[k] {
            (low as f32, high as f32)
        } else if inward[k] >= 0.0 {
            ((low as f32).min(corner), corner)
        } else {
            (corner, (high as f32).max(corner))
        };
    }
    let limit = Vec3::splat(f32::MAX);
    Aabb::new(min.clamp(-limit, limit), max.clamp(-limit, limit))
}

/// A box well inside, beside, behind or before the volume: a plane that is
/// missing or far off shows here.
fn astray(rng: &mut SeededRng, hull: &Hull) -> Aabb {
    let wide = |rng: &mut SeededRng| rng.between(-0.5, 1.5);
    let (s, t) = (wide(rng), wide(rng));
    // The size of near against the depth of the volume.
    let near = (hull.corners[0] - hull.corners[3]).length();
    let far = (hull.corners[4] - hull.corners[7]).length();
    let before = (near / (far - near).max(near)).min(1.0);
    let w = match rng.below(3) {
        0 => rng.unit(),
        1 => 1.0 + rng.unit(),
        _ => -rng.unit() * before,
    };
    let p = hull.at([s, t, w]);
    let size = near * libm::exp2(rng.between(-8.0, 1.0));
    let half = rng.point() * size;
    let limit = DVec3::splat(f64::from(f32::MAX));
    let [low, high] = [p - half, p + half].map(|corner| corner.clamp(-limit, limit));
    Aabb::new(low.as_vec3(), high.as_vec3())
}

/// Edge lengths for a volume that is `scale` wide where the box is.
fn sizes(rng: &mut SeededRng, shapes: Shapes, scale: f64) -> [f64; 3] {
    let edge = scale * libm::exp2(rng.between(-6.0, 0.0));
    match shapes {
        Shapes::Grid => [0, 1, 2].map(|_| rng.below(9) as f64 / 4.0),
        Shapes::Ratio => [scale * [1e-3, 1e3][rng.below(2)]; 3],
        Shapes::Needles => [0, 1, 2].map(|_| [0.0, edge * 64.0][rng.below(2)]),
        Shapes::Mixed | Shapes::Coincident => match rng.below(6) {
            0 => [0.0; 3],
            1 => [0, 1, 2].map(|_| [0.0, edge][rng.below(2)]),
            2 => [edge * 1e-5; 3],
            3 => [0, 1, 2].map(|_| edge * 1e3 * rng.unit()),
            4 => [0, 1, 2].map(|_| edge * rng.unit()),
            _ => [edge; 3],
        },
    }
}

/// The number `ulps` representable numbers above `x`, or below.
fn shifted(x: f32, ulps: i32) -> f32 {
    (0..ulps.abs()).fold(x, |x, _| if ulps > 0 { x.next_up() } else { x.next_down() })
}
