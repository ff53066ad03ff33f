//! The conservative epsilon, and the range of the sums of the plane test.
//!
//! Planes move outward far enough that no visible box is lost; proof in docs/NUMERICS.md.

use glam::DVec3;

use super::{Camera, CameraError, Frame, Result, require};
use crate::arithmetic::rounding::round_up;
use crate::geometry::{ConvexVolume, FrustumPlane, Plane, PlaneF64};

/// Unit roundoff of f32.
const UNIT_ROUNDOFF: f64 = 1.0 / (1u64 << 24) as f64;

/// Covers underflow: below four times half the smallest subnormal f32.
pub(super) const TINY: f64 = f64::from_bits((1023 - 147) << 52);

/// Relative error of the derivation in f64: 16 units of 2^-53.
///
/// Each component of an axis is true to 4 units, of a normal to 8; the offset is a sum of products
/// with the eye. At a point x of `reach` that is 8 units of `|x|`, and of `|eye|` 8, 3 for the sum
/// and 2 for the rounding of the eye itself.
///
/// Depths of near and far and windows of orthographic lenses need no share, though offsets of such
/// planes round them twice. At a distance D from the plane such a length is at most
/// `|x| + |eye| + D`. Two units of `|x| + |eye|` fit into the 16, as the normal is an axis with 4;
/// two units of D are far less than D itself, which is added to the value at x.
const DERIVED: f64 = 1.0 / (1u64 << 49) as f64;

/// Upper bound of the sums of the plane test: half the largest f32.
///
/// Half, because a node's bounds may be wider than its items'.
const LARGEST_SUM: f64 = (f32::MAX / 2.0) as f64;

/// Points and bounds that determine the margins of a volume's planes.
pub(super) struct Margin {
    c: f64,
    /// Largest absolute coordinates of the points that can be visible.
    ///
    /// Those of the volume or of the scene, whichever are smaller.
    pub(super) reach: DVec3,
    /// Near corners, then far ones.
    ///
    /// An infinite view has no far corners, and for a matrix its near ones are zero.
    near: [DVec3; 4],
    far: Option<[DVec3; 4]>,
    /// Distance between the near and the far plane.
    depth: f64,
    /// Rays through the near corners at unit depth, if there is no far plane.
    rays: [DVec3; 4],
    /// Error of the derivation in f64.
    ///
    /// For the named planes; for planes made about the rounded eye.
    derived: [f64; 2],
    /// True if near and far planes are as accurate as those of a frame.
    of_frame: bool,
}

impl Camera {
    /// The frame relative to the sum of some points, subtracted one by one.
    pub(super) fn frame_about(&self, zero: &[DVec3]) -> Frame {
        let moved = |frame: Frame, zero: &DVec3| frame.relative_to(*zero);
        zero.iter().fold(self.frame, moved)
    }
}

impl Margin {
    /// Margins for coordinates, the frame's included, relative to the sum of `zero`.
    ///
    /// `of_scene` is the scene's reach in these coordinates, zero if unknown.
    ///
    /// # Errors
    /// An epsilon or a reach for which nothing is guaranteed.
    pub(super) fn new(
        camera: &Camera,
        zero: &[DVec3],
        of_scene: DVec3,
        c: f64,
        by_frame: bool,
    ) -> Result<Margin> {
        let are_sound = (0.0..f64::INFINITY).contains(&c) && of_scene.cmpge(DVec3::ZERO).all();
        let found = format_args!("epsilon is {c} and reach {of_scene}");
        let rule = "numbers of at least 0, and a finite epsilon";
        require(are_sound, found, rule)?;
        if let largest @ f64::INFINITY = of_scene.element_sum() {
            return Err(CameraError::Sums { largest });
        }
        let (frame, lens) = (camera.frame_about(zero), &camera.lens);
        let at_depth = |depth| lens.corners_at(&frame, depth);
        let (near, far) = match lens.matrix() {
            None => (at_depth(lens.near()), lens.far().map(at_depth)),
            Some(matrix) => {
                let corners = matrix.corners_about(zero);
                let corner = |i: usize| corners.map_or(DVec3::ZERO, |corners| corners[i]);
                let half = |of: usize| [0, 1, 2, 3].map(|i| corner(of + i));
                (half(0), corners.map(|_| half(4)))
            }
        };
        let reach = reach(&near, far.as_ref(), of_scene);
        let mut derived = DERIVED * (reach + frame.eye.abs()).element_sum();
        if lens.is_orthographic() {
            // Rays of samples start at points that are rounded in world coordinates.
            let eye = zero.iter().sum::<DVec3>() + frame.eye;
            derived += f64::EPSILON * eye.abs().element_sum();
        }
        // The planes of a matrix are exact sums relative to the exact origin, rounded once: only
        // components of normals that are subnormal in f32 add an error.
        let underflow = reach.element_sum() * TINY;
        let of_named = lens.matrix().map_or(derived, |_| underflow);
        Ok(Margin {
            c,
            reach,
            near,
            far,
            depth: lens.far().map_or(f64::INFINITY, |far| far - lens.near()),
            rays: lens.corners_at(&frame.relative_to(frame.eye), 1.0),
            derived: [of_named, derived],
            of_frame: by_frame && lens.matrix().is_none(),
        })
    }

    /// Named planes and further ones as one volume.
    ///
    /// With an epsilon they are moved outward. `reach` bounds the coordinates of the boxes to test.
    pub(super) fn volume(
        &self,
        named: &[(FrustumPlane, Plane)],
        more: &[PlaneF64],
        reach: DVec3,
        slack: f64,
    ) -> Result<ConvexVolume> {
        let placed = |name, plane: &Plane| match self.c > 0.0 {
            true => (name, self.moved(name, plane, slack)),
            false => (name, *plane),
        };
        let more = more.iter().map(|plane| placed(None, &plane.narrow()));
        let more = more.filter(|(_, plane)| largest_sum(plane, reach) <= LARGEST_SUM);
        let named = named.iter().map(|(name, plane)| placed(Some(*name), plane));
        let planes: Vec<_> = named.chain(more).collect();
        let volume = ConvexVolume::from_labelled_planes(&planes)?;
        check_sums(&volume, reach)?;
        Ok(volume)
    }

    /// The plane moved outward, so that no rounding error drops a visible box.
    fn moved(&self, name: Option<FrustumPlane>, plane: &Plane, slack: f64) -> Plane {
        let d = f64::from(plane.d);
        if !d.is_finite() {
            return *plane;
        }
        let error = self.c * UNIT_ROUNDOFF * self.size(name, plane);
        let derived = self.derived[usize::from(name.is_none())];
        Plane::new(plane.normal, round_up(d + (error + TINY + derived + slack)))
    }

    /// Largest sum of magnitudes at a visible point that the plane could misjudge.
    ///
    /// The error at x is at most c*u times its sum of magnitudes, which is convex in x; the
    /// distance from the plane is linear. Their difference is therefore largest at a corner;
    /// corners on the far side of the volume are too distant to matter.
    fn size(&self, name: Option<FrustumPlane>, plane: &Plane) -> f64 {
        let n = plane.normal.as_dvec3().abs();
        let d = f64::from(plane.d).abs();
        let along = |x: DVec3| n.dot(x.abs());
        let largest = |of: &[DVec3; 4]| of.iter().map(|&x| along(x)).fold(0.0, f64::max);
        let loose = n.dot(self.reach) + d;
        let unit = self.c * UNIT_ROUNDOFF;
        let Some(far) = &self.far else {
            // Along each ray the distance must grow faster than the error.
            let outruns = unit * largest(&self.rays) < 0.5;
            return match name {
                Some(FrustumPlane::Near) if self.of_frame && outruns => {
                    loose.min(largest(&self.near) + d)
                }
                _ => loose,
            };
        };
        // Half of the depth: the other half is for its own rounding.
        let across = self.depth * 0.5 / unit;
        let (near, far) = (largest(&self.near), largest(far));
        let own = match name {
            Some(FrustumPlane::Near) if self.of_frame => near.max(far - across),
            Some(FrustumPlane::Far) if self.of_frame => far.max(near - across),
            _ => near.max(far),
        };
        loose.min(own + d)
    }
}

/// Largest absolute coordinates of the points that can be visible.
fn reach(near: &[DVec3; 4], far: Option<&[DVec3; 4]>, of_scene: DVec3) -> DVec3 {
    let Some(far) = far else { return of_scene };
    let all = near.iter().chain(far);
    let of_volume = all.fold(DVec3::ZERO, |reach, corner| reach.max(corner.abs()));
    match of_scene {
        DVec3::ZERO => of_volume,
        of_scene => of_volume.min(of_scene),
    }
}

/// Checks that no sum of the plane test can overflow for boxes within `reach`.
///
/// # Errors
/// The largest possible sum, if one can.
pub(crate) fn check_sums(volume: &ConvexVolume, reach: DVec3) -> Result<()> {
    let sums = volume.planes().iter().map(|p| largest_sum(p, reach));
    let largest = sums.fold(0.0, f64::max);
    match largest <= LARGEST_SUM {
        true => Ok(()),
        false => Err(CameraError::Sums { largest }),
    }
}

/// Largest sum of the magnitudes in a plane test within `reach`.
///
/// NaN for a plane with a NaN.
fn largest_sum(plane: &Plane, reach: DVec3) -> f64 {
    plane.normal.as_dvec3().abs().dot(reach) + f64::from(plane.d).abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Lens, PlaneOptions, Surroundings, look_at};
    use glam::Vec3;

    #[test]
    fn a_plane_that_is_not_finite_stays_what_it_is() {
        let frame = look_at(DVec3::ZERO, -DVec3::Z, DVec3::Y).unwrap();
        let lens = Lens::perspective(60.0, 1.5, 0.1, None).unwrap();
        let camera = Camera { frame, lens };
        let margin = Margin::new(&camera, &[], DVec3::ONE, 1.0, false).unwrap();
        for d in [f32::INFINITY, f32::NEG_INFINITY] {
            let plane = Plane::new(Vec3::Y, d);
            assert_eq!(margin.moved(None, &plane, 0.0).d, d);
        }
    }

    #[test]
    fn an_epsilon_or_a_reach_without_a_guarantee_is_an_error() {
        let frame = look_at(DVec3::ZERO, -DVec3::Z, DVec3::Y).unwrap();
        let lens = Lens::perspective(60.0, 1.5, 0.1, Some(100.0)).unwrap();
        let camera = Camera { frame, lens };
        let refused = |epsilon: f64, reach: Vec3| {
            let origin = DVec3::ZERO;
            let around = Surroundings { origin, reach };
            let options = PlaneOptions {
                epsilon,
                ..PlaneOptions::default()
            };
            let relative = camera.relative_volume(&[], epsilon, &around).is_err();
            let volume = camera.volume(&options, &around);
            assert_eq!(volume.is_err(), relative, "{epsilon} {reach}");
            volume.err()
        };
        for bad in [f32::NAN, -1.0, f32::INFINITY] {
            let error = refused(bad.into(), Vec3::ONE);
            assert!(matches!(error, Some(CameraError::Invalid { .. })), "{bad}");
            // Boxes beyond the range of f32: sums that overflow.
            let error = refused(8.0, Vec3::new(1.0, bad, 1.0));
            let is_sum = matches!(error, Some(CameraError::Sums { .. }));
            assert!(error.is_some() && is_sum == (bad == f32::INFINITY), "{bad}");
        }
        assert_eq!(refused(0.0, Vec3::ZERO).or(refused(8.0, Vec3::ONE)), None);
    }
}
