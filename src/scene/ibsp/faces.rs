//! Triangles of surfaces and brushes.
//!
//! Source: id Software, Quake III Arena (2005), code/qcommon/qfiles.h and renderer/tr_curve.c.

use glam::{DVec3, Vec3};

use crate::geometry::Aabb;
use crate::input::Result;
use crate::scene::bsp::clipped;
use crate::scene::records::Table;

/// Points, and triangles as indices into them.
pub type Faces = (Vec<Vec3>, Vec<[u32; 3]>);

/// Segments of a curve between two control points that it passes through.
const SEGMENTS: usize = 4;
/// Triangles of a patch of three by three control points.
pub const PER_PATCH: usize = 2 * SEGMENTS * SEGMENTS;
/// Most sides of a brush whose faces are computed; with more, its box is taken.
const MOST_SIDES: usize = 64;
/// Grid of brush corners per unit, so that faces of a brush share corners.
const GRID: f64 = 64.0;

/// Tessellates a patch; rows and columns have an odd number of control points.
pub fn patch(points: &[Vec3], width: usize) -> Faces {
    let bounds = Aabb::of_points(points.iter().copied());
    let (mut all, mut triangles) = (Vec::new(), Vec::new());
    let weights = |step: usize| {
        let t = step as f32 / SEGMENTS as f32;
        [(1.0 - t) * (1.0 - t), 2.0 * t * (1.0 - t), t * t]
    };
    for row in (0..points.len() / width - 1).step_by(2) {
        for column in (0..width - 1).step_by(2) {
            let first = all.len() as u32;
            for (u, v) in (0..=SEGMENTS).flat_map(|u| (0..=SEGMENTS).map(move |v| (u, v))) {
                let mut p = Vec3::ZERO;
                for (i, down) in weights(u).into_iter().enumerate() {
                    for (j, along) in weights(v).into_iter().enumerate() {
                        p += points[(row + i) * width + column + j] * (down * along);
                    }
                }
                all.push(p.clamp(bounds.min, bounds.max));
            }
            let across = SEGMENTS as u32 + 1;
            for (u, v) in (0..across - 1).flat_map(|u| (0..across - 1).map(move |v| (u, v))) {
                let a = first + u * across + v;
                let [b, c, d] = [a + 1, a + across, a + across + 1];
                triangles.extend([[a, b, c], [b, d, c]]);
            }
        }
    }
    (all, triangles)
}

/// The box of a brush: its first six sides.
///
/// # Errors
/// Sides that are not those of a box.
pub fn brush_box(brushes: &Table, brush: usize, sides: &[(Vec3, f32)]) -> Result<Aabb> {
    let mut bounds = Aabb::EMPTY;
    for axis in 0..3 {
        match sides.get(2 * axis..2 * axis + 2) {
            Some(&[(low, behind), (high, before)])
                if low == -Vec3::AXES[axis] && high == Vec3::AXES[axis] =>
            {
                (bounds.min[axis], bounds.max[axis]) = (-behind, before);
            }
            _ => {
                let found = format!("brush {brush} without the sides of its box");
                return Err(brushes.error(brush, 0, found, "its axial sides first"));
            }
        }
    }
    Ok(bounds)
}

/// The faces of the convex body inside all sides, if it is bounded.
pub fn brush(sides: &[(Vec3, f32)], bounds: &Aabb) -> Option<Faces> {
    if sides.len() > MOST_SIDES {
        return None;
    }
    let sides = sides.iter().map(|&(n, d)| (n.as_dvec3(), f64::from(d)));
    let sides: Vec<(DVec3, f64)> = sides.collect();
    let (mut points, mut triangles): Faces = Default::default();
    for (at, side) in sides.iter().enumerate() {
        let mut polygon = square(*side, bounds)?;
        for (_, other) in sides.iter().enumerate().filter(|(other, _)| *other != at) {
            polygon = clipped(&polygon, |p| other.1 - other.0.dot(p));
        }
        let mut corners: Vec<u32> = Vec::with_capacity(polygon.len());
        for p in polygon {
            let p = ((p * GRID).round() / GRID).as_vec3();
            let p = p.clamp(bounds.min, bounds.max);
            let known = points.iter().position(|&known| known == p);
            let corner = known.unwrap_or_else(|| {
                points.push(p);
                points.len() - 1
            });
            corners.push(corner as u32);
        }
        corners.dedup();
        if corners.len() > 1 && corners.first() == corners.last() {
            corners.pop();
        }
        let rim = corners.get(1..).unwrap_or_default().windows(2);
        triangles.extend(rim.map(|c| [corners[0], c[0], c[1]]));
    }
    (triangles.len() >= 4).then_some((points, triangles))
}

/// The part of a plane around a box, counter-clockwise about the normal.
fn square((n, d): (DVec3, f64), bounds: &Aabb) -> Option<Vec<DVec3>> {
    let axis = n.abs().max_position();
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let (min, max) = (bounds.min.as_dvec3() - 1.0, bounds.max.as_dvec3() + 1.0);
    let mut corners = [(min, min), (max, min), (max, max), (min, max)].map(|(a, b)| {
        let mut p = DVec3::ZERO;
        (p[u], p[v]) = (a[u], b[v]);
        p[axis] = (d - n.dot(p)) / n[axis];
        p
    });
    if n[axis] < 0.0 {
        corners.reverse();
    }
    let is_plane = corners.iter().all(|p| p.is_finite());
    is_plane.then(|| corners.to_vec())
}
