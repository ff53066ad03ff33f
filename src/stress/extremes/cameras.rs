//! The cameras of the generated extremes: one family per way in which a
//! camera or its boxes can be extreme. A row of the table is a family; its
//! variants say how far it goes.

use glam::DVec3;

use super::boxes::Shapes;
use crate::camera::{CameraError, FARTHEST, Lens, PlaneMethod, PlaneOptions};
use crate::oracle::Pose;
use crate::scene::SeededRng;

/// One way of being extreme.
pub struct CameraFamily {
    /// Name in the table of results.
    pub name: &'static str,
    /// Parameters of the family, mildest first.
    pub variants: &'static [f64],
    /// Name of a variant in ids.
    pub label: fn(f64) -> String,
    /// Makes an ordinary camera one of the family, for a parameter.
    adjust: fn(&mut Draft, &mut SeededRng, f64),
}

/// Distances from zero.
const OFFSETS: &[f64] = &[1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e12, 1e15];

/// Far / near.
const RATIOS: &[f64] = &[1e3, 1e6, 1e9, f64::INFINITY];

/// All families of cameras, in the order of the table of results.
pub static CAMERA_FAMILIES: &[CameraFamily] = rows! { CameraFamily { name, variants, label, adjust }
    // Far / near from 1e3 to 1e9, and infinite.
    "near-far", RATIOS, plain, |draft, _, ratio| draft.depth(ratio);
    // The same with planes from a reversed-Z matrix in f64.
    "reversed-z", RATIOS, plain, |draft, _, ratio| {
        draft.depth(ratio);
        draft.planes.method = PlaneMethod::GhRevzF64;
    };
    // Vertical field of view from 1e-9 to 179.9999999 degrees.
    "fov", &[1e-9, 1e-6, 1e-3, 1.0, 90.0, 170.0, 179.99, 179.99999, 179.9999999], plain,
        |draft, _, fov| draft.fovy_deg = fov;
    // Width / height from 1e-8 to 1e8.
    "aspect", &[1e-8, 1e-4, 1e-2, 1e2, 1e4, 1e8], plain, |draft, _, aspect| draft.aspect = aspect;
    // A camera 1e4 to 1e15 depths of 1 away from the scene's zero.
    "offset", OFFSETS, plain, |draft, rng, offset| draft.carry_off(rng, offset);
    // The same in coordinates about a point near the camera.
    "rebased", OFFSETS, plain, |draft, rng, offset| {
        draft.carry_off(rng, offset);
        draft.origin = draft.eye.round();
    };
    // Up within 1e-6 to 1e-15 rad of the direction of view.
    "condition", &[1e-6, 1e-9, 1e-11, 1e-13, 1e-14, 1e-15], plain, |draft, rng, angle| {
        draft.until_it_has_a_frame(rng, |draft, rng| {
            draft.to_look = rng.below(2) == 0;
            // Along the view as f64 has it, and hardly away from it: rounding can bring
            // one camera's up too near to the view whatever its length is.
            let length = libm::exp2(rng.between(-4.0, 4.0));
            let away = angle * draft.forward.length() / draft.up.length();
            let across = draft.up * away * rng.between(0.9, 1.5);
            draft.up = (draft.forward + across) * length;
        });
    };
    // Eye and look 1e-6 to 1e-15 of their coordinates apart.
    "near-look", &[1e-6, 1e-9, 1e-12, 1e-15], plain, |draft, rng, share| {
        draft.until_it_has_a_frame(rng, |draft, _| {
            draft.to_look = true;
            let size = draft.eye.abs().max_element();
            draft.forward *= 4.0 * share * size / draft.forward.length();
        });
    };
    // A volume about zero, seen from 1e3 to 1e15 depths away.
    "shell", &[1e3, 1e6, 1e9, 1e12, 1e15], plain, |draft, _, distance| {
        let half = draft.far.unwrap_or(1.0) / 2.0;
        let distance = distance * half;
        draft.eye = draft.forward.normalize() * -distance;
        draft.fovy_deg = (half / distance).to_degrees();
        (draft.near, draft.far) = (distance - half, Some(distance + half));
    };
    // The whole scene scaled by 2^-148 to 2^127; views that may overflow may be refused.
    "scale", &[-148.0, -140.0, -126.0, -100.0, -60.0, 60.0, 100.0, 120.0, 122.0, 124.0, 127.0],
        |power| format!("2^{power}"), |draft, _, power| draft.scale(libm::exp2(power));
    // Boxes 1e-3 and 1e3 times as wide as the view, side by side.
    "size-ratio", &[1e6], plain, |draft, _, _| draft.shapes = Shapes::Ratio;
    // Sixteen boxes, over and over.
    "coincident", &[16.0], plain, |draft, _, _| draft.shapes = Shapes::Coincident;
    // Lines, plates and points without thickness.
    "needles", &[64.0], plain, |draft, _, _| draft.shapes = Shapes::Needles;
    // A 90 degree camera on a grid of integers with its boxes: exact ties and one-ulp shifts.
    "ties", &[8.0, 64.0, 4096.0], plain, |draft, rng, far| {
        draft.shapes = Shapes::Grid;
        draft.eye = draft.eye.round();
        draft.forward = [DVec3::X, -DVec3::Y, DVec3::Z][rng.below(3)];
        draft.up = DVec3::new(draft.forward.z, draft.forward.x, draft.forward.y);
        (draft.fovy_deg, draft.aspect) = (90.0, 1.0);
        (draft.near, draft.far) = (1.0, Some(far));
    };
    // Orthographic, off-axis, and off-axis without a far plane.
    "lens", &[0.0, 1.0, 2.0],
        |kind| ["orthographic", "off-axis", "off-axis inf"][kind as usize].to_owned(),
        |draft, rng, kind| {
            let half = draft.near * libm::tan(draft.fovy_deg.to_radians() / 2.0);
            let shift = half * rng.between(-3.0, 3.0);
            let window = [shift - half, shift + half, -half, half * draft.aspect];
            let far = draft.far.unwrap_or(1.0);
            draft.other_lens = Some(match kind as u32 {
                0 => Lens::orthographic(far * rng.unit().max(0.01), draft.aspect, -far, far),
                1 => Lens::off_axis(window, draft.near, draft.far),
                _ => Lens::off_axis(window, draft.near, None),
            });
        };
};

impl CameraFamily {
    /// Draws a camera for a parameter.
    pub fn draft(&self, rng: &mut SeededRng, variant: f64) -> Draft {
        let mut draft = Draft::any(rng);
        (self.adjust)(&mut draft, rng, variant);
        draft
    }
}

fn plain(value: f64) -> String {
    match value {
        v if v.is_infinite() => "inf".to_owned(),
        v if (0.01..1000.0).contains(&v) => format!("{v}"),
        v => format!("{v:e}"),
    }
}

/// A camera that is still being described, as exact numbers.
pub struct Draft {
    eye: DVec3,
    forward: DVec3,
    up: DVec3,
    fovy_deg: f64,
    aspect: f64,
    near: f64,
    far: Option<f64>,
    /// True if the pose names a point to look at.
    to_look: bool,
    /// Replaces the perspective lens.
    other_lens: Option<Result<Lens, CameraError>>,
    /// Scene-local zero in world coordinates.
    pub origin: DVec3,
    /// Derivation of its planes.
    pub planes: PlaneOptions,
    /// Shapes of the boxes about it.
    pub shapes: Shapes,
}

impl Draft {
    /// Ordinary in every way: some 10 deep, within some 10 of zero; along an
    /// axis one time in four.
    fn any(rng: &mut SeededRng) -> Draft {
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
        Draft {
            eye: (rng.point() - 0.5) * 20.0,
            forward,
            up,
            fovy_deg: rng.between(20.0, 120.0),
            aspect: rng.between(0.4, 2.5),
            near: far / libm::exp2(rng.between(2.0, 8.0)),
            far: Some(far),
            origin: DVec3::ZERO,
            planes: PlaneOptions::default(),
            shapes: Shapes::Mixed,
            to_look: false,
            other_lens: None,
        }
    }

    /// Adjusts one ordinary camera after another until its vectors make a frame.
    fn until_it_has_a_frame(
        &mut self,
        rng: &mut SeededRng,
        adjust: impl Fn(&mut Draft, &mut SeededRng),
    ) {
        adjust(self, rng);
        while self.pose().frame().is_err() {
            *self = Draft::any(rng);
            adjust(self, rng);
        }
    }

    /// Moves the eye into some corner of space.
    fn carry_off(&mut self, rng: &mut SeededRng, offset: f64) {
        self.eye += rng.point().map(|c| (c - 0.5).signum() * offset);
    }

    fn depth(&mut self, ratio: f64) {
        match self.far {
            Some(far) if ratio.is_finite() => self.near = far / ratio,
            _ => self.far = None,
        }
    }

    fn scale(&mut self, factor: f64) {
        // A far plane beyond the farthest would be an infinite one.
        let factor = self.far.map_or(factor, |far| factor.min(FARTHEST / far));
        self.eye *= factor;
        self.near *= factor;
        self.far = self.far.map(|far| far * factor);
    }

    /// Position and orientation, exact.
    pub fn pose(&self) -> Pose {
        let (eye, forward, up) = (self.eye, self.forward, self.up);
        match self.to_look {
            true => Pose::LookAt {
                eye,
                look: eye + forward,
                up,
            },
            false => Pose::Forward { eye, forward, up },
        }
    }

    /// The lens, or why there is none.
    pub fn lens(&self) -> Result<Lens, CameraError> {
        let other = self.other_lens.clone();
        other.unwrap_or_else(|| Lens::perspective(self.fovy_deg, self.aspect, self.near, self.far))
    }
}
