//! Cameras of the generated extremes, and the boxes around them.
//!
//! Each family is extreme in one way; its variants are its parameters. A row of the table is a
//! family.

use glam::{DVec3, Vec3};

use crate::camera::{Camera, CameraError, FARTHEST, Lens, PlaneMethod, PlaneOptions, Surroundings};
use crate::geometry::Aabb;
use crate::kernel::each;
use crate::oracle::Pose;
use crate::scene::SeededRng;

/// Distribution of the boxes' shapes in a case.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug)]
pub enum Shapes {
    /// Points, cubes, slivers, specks and boxes larger than the volume.
    #[default]
    Mixed,
    /// Lines and plates: zero size on one or two axes, long on the others.
    Needles,
    /// A few boxes, each many times.
    Coincident,
    /// Sizes over six orders of magnitude next to each other.
    Ratio,
    /// Bounds on the integer grid that the camera is on too.
    Grid,
}

/// Convex hull of a camera's view, in scene-local f64.
struct Hull {
    /// Near corners, then far ones; bit 0 is right, bit 1 top.
    corners: [DVec3; 8],
    /// Inward normals: left, right, bottom, top, near, far.
    ///
    /// The order matches the corners' bits.
    normals: [DVec3; 6],
}

/// Depth / near up to which an infinite volume is probed.
const FAR_OVER_NEAR: f64 = 1e4;

impl Hull {
    fn of(camera: &Camera, around: &Surroundings) -> Option<Hull> {
        let deep = (camera.lens.near() * FAR_OVER_NEAR).min(FARTHEST);
        let far = camera.lens.far().unwrap_or(deep);
        let lens = camera.lens.with_far(Some(far)).ok()?;
        let frame = camera.frame.relative_to(around.origin);
        let camera = Camera { lens, ..*camera };
        // Only the normals' directions are needed.
        let planes = camera.convex_volume_f64(around).ok()?;
        let normals: Vec<DVec3> = planes.planes().iter().map(|p| p.normal).collect();
        let (corners, normals) = (lens.corners(&frame)?, normals.try_into().ok()?);
        Some(Hull { corners, normals })
    }

    fn at(&self, [s, t, w]: [f64; 3]) -> DVec3 {
        let across = |i: usize| {
            let [a, b, c, d] = each([0, 1, 2, 3], |k| self.corners[i + k]);
            a.lerp(b, s).lerp(c.lerp(d, s), t)
        };
        across(0).lerp(across(4), w)
    }
}

/// Generates `count` boxes around a camera's volume, in scene-local coordinates.
///
/// One in 64 is inverted, and so empty. `None` if the lens has no corners.
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
            boxes.push(boxes[i % 16]);
            continue;
        }
        let mut b = match rng.below(8) {
            0 => away_from_hull(rng, &hull),
            _ => touching(rng, &hull, shapes),
        };
        if rng.below(64) == 0 {
            b = Aabb::new(b.max, b.min);
        }
        boxes.push(b);
    }
    Some(boxes)
}

/// A box whose corner, edge or face touches a random point of the hull.
fn touching(rng: &mut SeededRng, hull: &Hull, shapes: Shapes) -> Aabb {
    // Between near and far, uniform in the logarithm of the depth.
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
        // An edge of the hull against the box's edge along this axis.
        [a, b, ..] if a[axis] * b[axis] < 0.0 && rng.below(2) == 0 => {
            inward = a * b[axis].abs() + b * a[axis].abs();
            both[axis] = true;
        }
        // A corner of the hull against the box's face perpendicular to this axis.
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

/// A box well inside the volume, beside, behind or before it.
///
/// Reveals a plane that is missing or far off.
fn away_from_hull(rng: &mut SeededRng, hull: &Hull) -> Aabb {
    let (s, t) = (rng.between(-0.5, 1.5), rng.between(-0.5, 1.5));
    // Size of the near face relative to the depth of the volume.
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

/// Edge lengths, for a volume that is `scale` wide at the box.
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

/// Steps `ulps` representable numbers up from `x`, or down if negative.
fn shifted(x: f32, ulps: i32) -> f32 {
    (0..ulps.abs()).fold(x, |x, _| if ulps > 0 { x.next_up() } else { x.next_down() })
}

/// A family of extreme cameras.
pub struct CameraFamily {
    /// Name in the table of results.
    pub name: &'static str,
    /// Parameters of the family, mildest first.
    pub variants: &'static [f64],
    /// Name of a variant, used in ids.
    pub label: fn(f64) -> String,
    /// Changes an ordinary camera into one of the family, given the parameter.
    adjust: fn(&mut CameraBuilder, &mut SeededRng, f64),
}

/// Distances from the origin.
const OFFSETS: &[f64] = &[1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e12, 1e15];

/// Far / near.
const RATIOS: &[f64] = &[1e3, 1e6, 1e9, f64::INFINITY];

/// All families of cameras, in the order of the table of results.
pub static CAMERA_FAMILIES: &[CameraFamily] = rows! { CameraFamily { name, variants, label, adjust }
    // Far / near from 1e3 to 1e9, and infinite.
    "near-far", RATIOS, plain, |builder, _, ratio| builder.depth(ratio);
    // As near-far, with planes from a reversed-Z matrix in f64.
    "reversed-z", RATIOS, plain, |builder, _, ratio| {
        builder.depth(ratio);
        builder.planes.method = PlaneMethod::GhRevzF64;
    };
    // Vertical field of view from 1e-9 to 179.9999999 degrees.
    "fov", &[1e-9, 1e-6, 1e-3, 1.0, 90.0, 170.0, 179.99, 179.99999, 179.9999999], plain,
        |builder, _, fov| builder.fovy_deg = fov;
    // Width / height from 1e-8 to 1e8.
    "aspect", &[1e-8, 1e-4, 1e-2, 1e2, 1e4, 1e8], plain, |builder, _, aspect| builder.aspect = aspect;
    // A camera 1e4 to 1e15 times its depth away from the scene's origin.
    "offset", OFFSETS, plain, |builder, rng, offset| builder.move_away(rng, offset);
    // As offset, in coordinates relative to a point near the camera.
    "rebased", OFFSETS, plain, |builder, rng, offset| {
        builder.move_away(rng, offset);
        builder.origin = builder.eye.round();
    };
    // Up within 1e-6 to 1e-15 rad of the direction of view.
    "condition", &[1e-6, 1e-9, 1e-11, 1e-13, 1e-14, 1e-15], plain, |builder, rng, angle| {
        builder.redraw_until_valid(rng, |builder, rng| {
            builder.to_look = rng.below(2) == 0;
            // Close to the view direction as f64 has it: rounding can bring one camera's up vector
            // too close to the view, whatever its length.
            let length = libm::exp2(rng.between(-4.0, 4.0));
            let away = angle * builder.forward.length() / builder.up.length();
            let across = builder.up * away * rng.between(0.9, 1.5);
            builder.up = (builder.forward + across) * length;
        });
    };
    // Eye and look 1e-6 to 1e-15 of their coordinates apart.
    "near-look", &[1e-6, 1e-9, 1e-12, 1e-15], plain, |builder, rng, share| {
        builder.redraw_until_valid(rng, |builder, _| {
            builder.to_look = true;
            let size = builder.eye.abs().max_element();
            builder.forward *= 4.0 * share * size / builder.forward.length();
        });
    };
    // A volume around zero, seen from 1e3 to 1e15 depths away.
    "shell", &[1e3, 1e6, 1e9, 1e12, 1e15], plain, |builder, _, distance| {
        let half = builder.far.unwrap_or(1.0) / 2.0;
        let distance = distance * half;
        builder.eye = builder.forward.normalize() * -distance;
        builder.fovy_deg = (half / distance).to_degrees();
        (builder.near, builder.far) = (distance - half, Some(distance + half));
    };
    // The whole scene scaled by 2^-148 to 2^127; views that may overflow may be refused.
    "scale", &[-148.0, -140.0, -126.0, -100.0, -60.0, 60.0, 100.0, 120.0, 122.0, 124.0, 127.0],
        |power| format!("2^{power}"), |builder, _, power| builder.scale(libm::exp2(power));
    // Boxes 1e-3 and 1e3 times as wide as the view, side by side.
    "size-ratio", &[1e6], plain, |builder, _, _| builder.shapes = Shapes::Ratio;
    // Sixteen boxes, repeated.
    "coincident", &[16.0], plain, |builder, _, _| builder.shapes = Shapes::Coincident;
    // Lines, plates and points without thickness.
    "needles", &[64.0], plain, |builder, _, _| builder.shapes = Shapes::Needles;
    // A 90-degree camera on an integer grid with its boxes: exact ties and one-ulp shifts.
    "ties", &[8.0, 64.0, 4096.0], plain, |builder, rng, far| {
        builder.shapes = Shapes::Grid;
        builder.eye = builder.eye.round();
        builder.forward = [DVec3::X, -DVec3::Y, DVec3::Z][rng.below(3)];
        builder.up = DVec3::new(builder.forward.z, builder.forward.x, builder.forward.y);
        (builder.fovy_deg, builder.aspect) = (90.0, 1.0);
        (builder.near, builder.far) = (1.0, Some(far));
    };
    // Orthographic, off-axis, and off-axis without a far plane.
    "lens", &[0.0, 1.0, 2.0],
        |kind| ["orthographic", "off-axis", "off-axis inf"][kind as usize].to_owned(),
        |builder, rng, kind| {
            let half = builder.near * libm::tan(builder.fovy_deg.to_radians() / 2.0);
            let shift = half * rng.between(-3.0, 3.0);
            let window = [shift - half, shift + half, -half, half * builder.aspect];
            let far = builder.far.unwrap_or(1.0);
            builder.other_lens = Some(match kind as u32 {
                0 => Lens::orthographic(far * rng.unit().max(0.01), builder.aspect, -far, far),
                1 => Lens::off_axis(window, builder.near, builder.far),
                _ => Lens::off_axis(window, builder.near, None),
            });
        };
};

impl CameraFamily {
    /// Generates a camera for a parameter.
    pub fn builder(&self, rng: &mut SeededRng, variant: f64) -> CameraBuilder {
        let mut builder = CameraBuilder::any(rng);
        (self.adjust)(&mut builder, rng, variant);
        builder
    }
}

fn plain(value: f64) -> String {
    match value {
        v if v.is_infinite() => "inf".to_owned(),
        v if (0.01..1000.0).contains(&v) => format!("{v}"),
        v => format!("{v:e}"),
    }
}

/// Camera under construction, as exact numbers.
#[derive(Default)]
pub struct CameraBuilder {
    eye: DVec3,
    forward: DVec3,
    up: DVec3,
    fovy_deg: f64,
    aspect: f64,
    near: f64,
    far: Option<f64>,
    /// True if the pose specifies a point to look at.
    to_look: bool,
    /// Lens to use instead of the perspective one.
    other_lens: Option<Result<Lens, CameraError>>,
    /// Scene-local origin in world coordinates.
    pub origin: DVec3,
    /// Derivation of its planes.
    pub planes: PlaneOptions,
    /// Shapes of the boxes around it.
    pub shapes: Shapes,
}

impl CameraBuilder {
    /// An ordinary camera: depth around 10, within some 10 of the origin.
    ///
    /// Looks along an axis one time in four.
    fn any(rng: &mut SeededRng) -> CameraBuilder {
        let (forward, up) = loop {
            let (mut forward, up) = (rng.normal3(), rng.normal3());
            if rng.below(4) == 0 {
                forward = [DVec3::X, DVec3::Y, -DVec3::Z][rng.below(3)];
            }
            if forward.cross(up).length() > 0.01 * forward.length() * up.length() {
                break (forward, up);
            }
        };
        let far = libm::exp2(rng.between(1.0, 5.0));
        CameraBuilder {
            eye: (rng.point() - 0.5) * 20.0,
            forward,
            up,
            fovy_deg: rng.between(20.0, 120.0),
            aspect: rng.between(0.4, 2.5),
            near: far / libm::exp2(rng.between(2.0, 8.0)),
            far: Some(far),
            ..CameraBuilder::default()
        }
    }

    /// Redraws and adjusts ordinary cameras until the vectors make a frame.
    fn redraw_until_valid(
        &mut self,
        rng: &mut SeededRng,
        adjust: impl Fn(&mut CameraBuilder, &mut SeededRng),
    ) {
        adjust(self, rng);
        while self.pose().frame().is_err() {
            *self = CameraBuilder::any(rng);
            adjust(self, rng);
        }
    }

    /// Moves the eye by `offset` on each axis, in a random octant.
    fn move_away(&mut self, rng: &mut SeededRng, offset: f64) {
        self.eye += rng.point().map(|c| (c - 0.5).signum() * offset);
    }

    fn depth(&mut self, ratio: f64) {
        match self.far {
            Some(far) if ratio.is_finite() => self.near = far / ratio,
            _ => self.far = None,
        }
    }

    fn scale(&mut self, factor: f64) {
        // A far plane beyond `FARTHEST` would count as infinite.
        let factor = self.far.map_or(factor, |far| factor.min(FARTHEST / far));
        self.eye *= factor;
        self.near *= factor;
        self.far = self.far.map(|far| far * factor);
    }

    /// Position and orientation, exact.
    pub fn pose(&self) -> Pose {
        let (eye, forward, up) = (self.eye, self.forward, self.up);
        let look = eye + forward;
        match self.to_look {
            true => Pose::LookAt { eye, look, up },
            false => Pose::Forward { eye, forward, up },
        }
    }

    /// The lens, or the reason why there is none.
    pub fn lens(&self) -> Result<Lens, CameraError> {
        let other = self.other_lens.clone();
        other.unwrap_or_else(|| Lens::perspective(self.fovy_deg, self.aspect, self.near, self.far))
    }
}
