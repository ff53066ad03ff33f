//! Truth by integers of any length, without an index.
//!
//! The tests compare everything else with it.

use std::cmp::Ordering;

use dashu_int::IBig;
use glam::{DVec3, Vec3};

use crate::camera::{Camera, Lens, look_at};
use crate::geometry::Aabb;
use crate::query::ItemId;
use crate::scene::{Scene, SeededRng, SurfaceKind, Surfaces, WorldBox};
use crate::visibility::{Ray, Solids};

/// A double as an integer number of units of 2^-300.
pub fn exact(x: f64) -> IBig {
    let bits = x.to_bits();
    let (exponent, fraction) = ((bits >> 52 & 0x7FF) as i32, bits & ((1 << 52) - 1));
    assert!(exponent < 0x7FF, "a finite number");
    if exponent == 0 && fraction == 0 {
        return IBig::ZERO;
    }
    let shift = exponent - 1075 + 300;
    assert!(exponent > 0 && shift >= 0, "{x:e} is beyond this judge");
    let size = IBig::from(fraction | 1 << 52) << shift as usize;
    if x < 0.0 { -size } else { size }
}

/// A depth: numerator and denominator, which is positive.
pub type Depth = (IBig, IBig);

pub fn order(a: &Depth, b: &Depth) -> Ordering {
    (&a.0 * &b.1).cmp(&(&b.0 * &a.1))
}

/// Entry of a ray into a box, if it meets it.
pub fn entry(ray: &Ray, b: &WorldBox) -> Option<Depth> {
    let mut range: Option<(Depth, Depth)> = None;
    for axis in 0..3 {
        let (o, d) = (exact(ray.origin[axis]), exact(ray.direction[axis]));
        let (low, high) = (exact(b.min[axis]) - &o, exact(b.max[axis]) - &o);
        let (from, to) = match d.cmp(&IBig::ZERO) {
            Ordering::Equal if low > IBig::ZERO || high < IBig::ZERO => return None,
            Ordering::Equal => continue,
            Ordering::Greater => ((low, d.clone()), (high, d)),
            Ordering::Less => ((-high, -&d), (-low, -d)),
        };
        range = Some(match range {
            None => (from, to),
            Some((first, last)) => (
                if order(&from, &first).is_gt() {
                    from
                } else {
                    first
                },
                if order(&to, &last).is_lt() { to } else { last },
            ),
        });
    }
    let (first, last) = range?;
    let depth = |x: f64| (exact(x), exact(1.0));
    let met = order(&first, &last).is_le()
        && order(&first, &depth(ray.near)).is_ge()
        && (ray.far.is_infinite() || order(&first, &depth(ray.far)).is_le());
    met.then_some(first)
}

/// Front items of a ray, ascending.
pub fn front(ray: &Ray, boxes: &[WorldBox]) -> Vec<ItemId> {
    let mut best: Option<Depth> = None;
    let mut items = Vec::new();
    for (item, b) in boxes.iter().enumerate() {
        let Some(depth) = entry(ray, b) else { continue };
        let found = best
            .as_ref()
            .map_or(Ordering::Less, |best| order(&depth, best));
        if found.is_lt() {
            items.clear();
            best = Some(depth);
        }
        if found.is_le() {
            items.push(item as ItemId);
        }
    }
    items
}

/// A few boxes with integer coordinates, full of coplanar faces, some flat.
pub fn ties(rng: &mut SeededRng, count: usize) -> Vec<WorldBox> {
    let coordinate = |rng: &mut SeededRng| rng.below(7) as f64 - 3.0;
    let corner = |rng: &mut SeededRng| [(); 3].map(|()| coordinate(rng));
    let one = |rng: &mut SeededRng| {
        let (a, b) = (DVec3::from(corner(rng)), DVec3::from(corner(rng)));
        WorldBox::new(a.min(b), a.max(b))
    };
    (0..count).map(|_| one(rng)).collect()
}

/// The boxes as solids.
pub fn solids(boxes: &[WorldBox]) -> Solids {
    Solids::of(&Scene::about("test", boxes, DVec3::ZERO).unwrap())
}

/// Cameras among these boxes, with every kind of lens.
///
/// Eyes at integers, in the planes of faces; views along axes, along diagonals and at random;
/// windows whose samples lie on edges.
pub fn camera(rng: &mut SeededRng) -> Camera {
    let whole = |rng: &mut SeededRng, n: usize| rng.below(2 * n + 1) as f64 - n as f64;
    let eye = DVec3::new(whole(rng, 5), whole(rng, 5), whole(rng, 5));
    let forward = match rng.below(3) {
        0 => [
            DVec3::X,
            DVec3::Y,
            DVec3::Z,
            -DVec3::X,
            -DVec3::Y,
            -DVec3::Z,
        ][rng.below(6)],
        1 => DVec3::new(
            1.0,
            [1.0, -1.0, 0.0][rng.below(3)],
            [0.0, 1.0][rng.below(2)],
        ),
        _ => rng.normal3(),
    };
    // Mostly towards the boxes.
    let forward = if forward.dot(eye) > 0.0 {
        -forward
    } else {
        forward
    };
    let up = if forward.x == 0.0 && forward.y == 0.0 {
        DVec3::Y
    } else {
        DVec3::Z
    };
    let near = [0.125, 1.0, 2.0][rng.below(3)];
    let lens = match rng.below(6) {
        0 => Lens::perspective(90.0, 1.0, near, None),
        1 => Lens::perspective(rng.between(20.0, 120.0), 1.5, near, Some(near + 3.0)),
        2 => Lens::off_axis([-near, near, -near, near], near, None),
        3 => Lens::off_axis([-0.25 * near, near, 0.0, near], near, Some(9.0)),
        // Slopes that the f32 slab tests do not cover.
        4 => Lens::off_axis([-1.0, 1.0, -1.0, 1.0], 1.0 / 4096.0, None),
        _ => Lens::orthographic(8.0, 1.0, [-2.0, 0.0, 1.0][rng.below(3)], 7.0),
    };
    let frame = look_at(eye, eye + forward, up).unwrap();
    Camera {
        frame,
        lens: lens.unwrap(),
    }
}

/// Triangles on a few integers, and boxes of triangles.
///
/// They share edges and corners and lie in common planes; some have no area.
pub fn triangles(rng: &mut SeededRng) -> Surfaces {
    let shift = [0.0, 0.0, 0.1, 3e6 + 0.3][rng.below(4)];
    let mut surfaces = Surfaces::about(DVec3::splat(shift));
    let corners: Vec<Vec3> = (0..6)
        .map(|_| {
            let mut one = || rng.below(7) as f32 - 3.0;
            Vec3::new(one(), one(), one())
        })
        .collect();
    let one_of = |rng: &mut SeededRng| {
        let kinds = [
            SurfaceKind::Opaque,
            SurfaceKind::Opaque,
            SurfaceKind::Clear,
            SurfaceKind::CutOut,
        ];
        kinds[rng.below(4)]
    };
    for _ in 0..1 + rng.below(8) {
        let kind = one_of(rng);
        let mut triangle = || [0; 3].map(|_| rng.below(6) as u32);
        let triangles = [triangle(), triangle()];
        surfaces.push(kind, rng.below(2) == 0, &corners, &triangles);
        // Items of two materials.
        let mixed = surfaces.kinds.len() - 1;
        surfaces.kinds[mixed] = one_of(rng);
        surfaces.two_sided[mixed] = rng.below(2) == 0;
    }
    for b in ties(rng, 6) {
        let (low, high) = (b.min.as_vec3(), b.max.as_vec3());
        let b = Aabb::new(low, high);
        surfaces.push_box(SurfaceKind::Opaque, &b);
    }
    surfaces
}
