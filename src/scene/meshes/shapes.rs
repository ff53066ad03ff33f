//! Small shapes that larger meshes are put together from: cones, columns, cards.

use glam::Vec3;

/// Points and the triangles between them, counter-clockwise from outside.
#[derive(Default)]
pub struct Shape {
    pub points: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
}

impl Shape {
    /// Appends another shape.
    pub fn add(&mut self, other: &Shape) {
        let first = self.points.len() as u32;
        self.points.extend_from_slice(&other.points);
        let moved = other
            .triangles
            .iter()
            .map(|t| t.map(|corner| first + corner));
        self.triangles.extend(moved);
    }
}

/// A regular polygon about `centre`, counter-clockwise from above.
fn ring(centre: Vec3, radius: f32, sides: u32) -> impl Iterator<Item = Vec3> {
    (0..sides).map(move |i| {
        let turn = std::f64::consts::TAU * f64::from(i) / f64::from(sides);
        let (sin, cos) = libm::sincos(turn);
        centre + Vec3::new(cos as f32, sin as f32, 0.0) * radius
    })
}

/// A fan over the polygon of `sides` points from `first`, facing up.
fn cap(first: u32, sides: u32) -> impl Iterator<Item = [u32; 3]> {
    (1..sides - 1).map(move |i| [first, first + i, first + i + 1])
}

/// A closed cone standing on the disc about `base`: 2 `sides` - 2 triangles.
pub fn cone(base: Vec3, radius: f32, height: f32, sides: u32) -> Shape {
    let mut points: Vec<Vec3> = ring(base, radius, sides).collect();
    points.push(base + Vec3::Z * height);
    let side = (0..sides).map(|i| [i, (i + 1) % sides, sides]);
    let floor = cap(0, sides).map(|[a, b, c]| [a, c, b]);
    Shape {
        triangles: side.chain(floor).collect(),
        points,
    }
}

/// A closed column standing on the disc about `base`: 4 `sides` - 4 triangles.
pub fn column(base: Vec3, radius: f32, height: f32, sides: u32) -> Shape {
    let top = base + Vec3::Z * height;
    let points = ring(base, radius, sides).chain(ring(top, radius, sides));
    let side = (0..sides).flat_map(|i| {
        let (a, b) = (i, (i + 1) % sides);
        [[a, b, sides + b], [a, sides + b, sides + a]]
    });
    let floor = cap(0, sides).map(|[a, b, c]| [a, c, b]);
    Shape {
        triangles: side.chain(floor).chain(cap(sides, sides)).collect(),
        points: points.collect(),
    }
}

/// A rectangle about `centre` with two half edges: two triangles.
pub fn card(centre: Vec3, u: Vec3, v: Vec3) -> Shape {
    Shape {
        points: vec![
            centre - u - v,
            centre + u - v,
            centre + u + v,
            centre - u + v,
        ],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    }
}
