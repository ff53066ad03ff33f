//! Degenerate scenes, volumes that touch their boxes exactly where they can, and
//! points on the faces of a view. Plain data; nothing is checked here.

use glam::{DVec3, Vec3};

use crate::camera::Camera;
use crate::geometry::{Aabb, ConvexVolume, Plane, PlaneF64};

fn cube(x: f32, y: f32, z: f32, half: f32) -> Aabb {
    Aabb::around(Vec3::new(x, y, z), Vec3::splat(half))
}

fn row(count: u16, scale: f32) -> Vec<Aabb> {
    let at = |i| f32::from(i) * scale;
    let boxes = (0..count).map(|i| cube(at(i), 0.0, 0.0, 0.4 * scale));
    boxes.collect()
}

/// The scenes with their names: nothing, points, coincident and nested boxes,
/// extreme sizes and places, inverted boxes.
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
        ("far away", (0..500).map(far).collect()),
        ("everything overlaps", everything),
        ("nested", (0..500).map(nested).collect()),
        ("growing from a corner", (0..500).map(growing).collect()),
        ("inverted among sound", third_inverted),
        ("only inverted", vec![Aabb::new(Vec3::ONE, Vec3::ZERO); 10]),
    ]
}

/// All of space, nothing, and half-spaces and slabs through the scene whose
/// planes touch its boxes exactly.
pub fn edge_volumes(items: &[Aabb]) -> Vec<ConvexVolume> {
    let bounds = match Aabb::union_of(items) {
        b if b.is_empty() => cube(0.0, 0.0, 0.0, 1.0),
        b => b,
    };
    let mut sets: Vec<Vec<Plane>> = vec![vec![], vec![Plane::new(Vec3::ZERO, -1.0)]];
    for axis in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::new(0.3, -0.5, 0.8)] {
        let corners = items.iter().take(3).map(|b| b.max);
        for anchor in corners.chain([bounds.centre(), bounds.max]) {
            let low = Plane::new(axis, -axis.dot(anchor));
            let high = Plane::new(-axis, axis.dot(anchor));
            sets.extend([vec![low], vec![high], vec![low, high]]);
        }
    }
    // Planes that overflow f32 are no volume.
    let volumes = sets.iter().map(|planes| ConvexVolume::from_planes(planes));
    volumes.filter_map(Result::ok).collect()
}

/// Points on the faces of a camera's view, as near as f32 has them: what a
/// rounding that is not the usual one, or a missing epsilon, puts on the other
/// side. For each face points all over the view (the R3 sequence of Roberts
/// 2018), moved onto it; faces and points are about `origin`.
pub fn points_on_faces(camera: &Camera, origin: DVec3, faces: &[PlaneF64]) -> Vec<Aabb> {
    const EACH: u32 = 48;
    const STEP: DVec3 = DVec3::new(
        0.819_172_513_396_164_4,
        0.671_043_606_703_789_3,
        0.549_700_477_901_970_3,
    );
    let (frame, near) = (&camera.frame, camera.lens.near());
    let far = camera.lens.far().unwrap_or(near * 1000.0);
    let mut points = Vec::new();
    for face in faces {
        for i in 0..EACH {
            let share = (STEP * f64::from(i)).fract();
            let depth = near + (far - near) * share.z;
            let (x, y) = ((share.x * 2.0 - 1.0) * depth, (share.y - 0.5) * depth);
            let at = frame.eye - origin + frame.u() * x + frame.v() * y - frame.n() * depth;
            let on = (at - face.normal * (face.normal.dot(at) + face.d)).as_vec3();
            points.push(Aabb::new(on, on));
        }
    }
    points
}
