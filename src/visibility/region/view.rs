//! Half-spaces through the eye, and convex polygons cut by them, in camera
//! coordinates: right, up, and the depth along the axis of view.
//!
//! All cuts keep what is outside by less than a slack, so that no rounding ever
//! loses a line of sight. The slack's proof is at [`SLACK`].

use glam::DVec3;

use super::graph::Opening;
use crate::scene::clip_into;
use crate::visibility::Rays;

/// Distance within which a point outside of a half-space `n . x >= 0` is kept.
///
/// Relative to bounds of |n| and |x| (sums of absolute coordinates).
///
/// The errors to cover, with u = 2^-53 and X = |x|:
/// - A corner minus the eye is rounded by u relative; three products and two sums
///   with axes whose coordinates are at most 1 add 3 u X a coordinate: below 2^-49 X.
/// - A ray of the camera is `u a + v b + forward`, rounded: u relative an operation,
///   and the axes are orthonormal to 2^-50: below 2^-48 X.
/// - A normal is the cross product of two such corners: the corners' errors and its
///   own rounding, below 2^-47 |a| |b|; `bound` is |a| |b|, not |n|, so an edge that
///   is seen end on cuts nothing. Its product with x adds below 2^-48 bound X.
/// - Each cut makes corners on edges between earlier ones, off them by at most
///   4 u X. After at most `MOST_PLANES` + 4 cuts: 68 * 2^-51 X, below 2^-44 X.
///
/// The sum is below 2^-43 bound X. The cut's threshold is shifted by all of
/// 2^-36 bound X, and the opening itself is grown by as much before the first cut, so
/// each true point of the window stays inside of each edge by more than what the
/// edges are moved by rounding.
const SLACK: f64 = 1.0 / (1u64 << 36) as f64;

/// Most half-spaces that a window keeps; more are left out, which makes it larger.
pub const MOST_PLANES: usize = 64;

/// `normal . x >= 0`, a half-space whose plane passes through the eye.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct HalfSpace {
    /// Not of unit length.
    pub normal: DVec3,
    /// At least the normal's length; errors are relative to it.
    pub bound: f64,
    /// Equal numbers in one search are equal half-spaces.
    pub number: u32,
}

/// A camera as half-spaces.
#[derive(Clone, Debug)]
pub struct View {
    /// World coordinates.
    pub eye: DVec3,
    axes: [DVec3; 3],
    /// Left, right, bottom, top: slopes per unit of depth.
    pub window: [f64; 4],
    far: f64,
    /// Left, right, bottom, top; numbers 0 to 3.
    pub sides: [HalfSpace; 4],
}

/// The polygon of an opening as it is seen, grown by the slack.
#[derive(Clone, Debug, Default)]
pub struct Polygon {
    /// Corners in turn, camera coordinates.
    corners: Vec<DVec3>,
    /// Largest |x| of the opening's corners.
    reach: f64,
    spare: Vec<DVec3>,
}

impl View {
    /// The half-spaces of a camera whose rays share an eye: not orthographic.
    pub fn of(rays: &Rays) -> View {
        let camera = &rays.camera;
        let frame = &camera.frame;
        let window @ [left, right, bottom, top] = rays.window;
        let side = |number: u32, x: f64, y: f64, z: f64| HalfSpace {
            normal: DVec3::new(x, y, z),
            bound: DVec3::new(x, y, z).abs().element_sum(),
            number,
        };
        View {
            eye: frame.eye,
            axes: [frame.u(), frame.v(), frame.forward()],
            window,
            far: camera.lens.far().unwrap_or(f64::INFINITY),
            sides: [
                side(0, 1.0, 0.0, -left),
                side(1, -1.0, 0.0, right),
                side(2, 0.0, 1.0, -bottom),
                side(3, 0.0, -1.0, top),
            ],
        }
    }

    /// A vector in camera coordinates.
    fn turned(&self, d: DVec3) -> DVec3 {
        let [u, v, forward] = self.axes;
        DVec3::new(u.dot(d), v.dot(d), forward.dot(d))
    }

    /// Tests whether all of an opening, its corners given in camera coordinates, lies
    /// beyond the far plane.
    fn is_beyond(&self, corners: &[DVec3; 4], reach: f64) -> bool {
        corners.iter().all(|c| c.z - reach * SLACK > self.far)
    }

    /// The corners of an opening in camera coordinates, and the largest size of one.
    fn corners(&self, opening: &Opening) -> ([DVec3; 4], f64) {
        let corners = opening.corners.map(|c| self.turned(c - self.eye));
        let sizes = corners.map(|c| c.abs().element_sum());
        (corners, sizes.into_iter().fold(0.0, f64::max))
    }

    /// Left, right, bottom and top of the smallest rectangle of the image that
    /// surely holds the opening's part of it; `None` if it is surely not in the
    /// image. Slopes per unit of depth, grown by the slack.
    pub fn rectangle(&self, opening: &Opening) -> Option<[f64; 4]> {
        let (corners, reach) = self.corners(opening);
        if self.is_beyond(&corners, reach) {
            return None;
        }
        let outside = |side: &HalfSpace| {
            let slack = SLACK * side.bound * reach;
            corners.iter().all(|c| side.normal.dot(*c) < -slack)
        };
        if self.sides.iter().any(outside) {
            return None;
        }
        // Nothing is known of the directions to corners at depths about zero.
        if corners.iter().any(|c| c.z <= 4.0 * SLACK * reach) {
            return Some(self.window);
        }
        let (most, least) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut rectangle = [most, least, most, least];
        for c in &corners {
            let (x, y) = (c.x / c.z, c.y / c.z);
            // Both coordinates of x / z are off by below 2^-48 reach.
            let slack = 2.0 * SLACK * reach / c.z;
            let (sx, sy) = (slack * (1.0 + x.abs()), slack * (1.0 + y.abs()));
            rectangle[0] = rectangle[0].min(x - sx);
            rectangle[1] = rectangle[1].max(x + sx);
            rectangle[2] = rectangle[2].min(y - sy);
            rectangle[3] = rectangle[3].max(y + sy);
        }
        Some(rectangle)
    }
}

impl Polygon {
    /// Makes it the part of an opening within half-spaces, grown by the slack.
    ///
    /// Returns the corners of the opening in camera coordinates and the largest size of one; `None` if
    /// nothing is seen: the opening has no area, or all of it is outside or too far.
    pub fn see(
        &mut self,
        view: &View,
        opening: &Opening,
        within: &[HalfSpace],
    ) -> Option<([DVec3; 4], f64)> {
        let (corners, reach) = view.corners(opening);
        // The edges of the opening itself: from far away its corners may come out the same.
        let ring = &opening.corners;
        let (along, across) = (ring[1] - ring[0], ring[3] - ring[0]);
        if view.is_beyond(&corners, reach) || along == DVec3::ZERO || across == DVec3::ZERO {
            return None;
        }
        // More than the slack, as coordinates are off too.
        let grow = |edge: DVec3| view.turned(edge.normalize()) * (4.0 * SLACK * reach);
        let (along, across) = (grow(along), grow(across));
        self.corners.clear();
        let [a, b, c, d] = corners;
        let [a, b, c, d] = [a - along, b + along, c + along, d - along];
        self.corners
            .extend([a - across, b - across, c + across, d + across]);
        self.reach = reach * (1.0 + 32.0 * SLACK);
        let is_left = within.iter().all(|plane| self.cut(plane));
        is_left.then_some((corners, reach))
    }

    /// Cuts off the part that is surely outside of the half-space.
    ///
    /// `false` if nothing is left.
    fn cut(&mut self, by: &HalfSpace) -> bool {
        let slack = SLACK * by.bound * self.reach;
        let depth = |x: DVec3| by.normal.dot(x) + slack;
        if self.corners.iter().all(|c| depth(*c) >= 0.0) {
            return true;
        }
        clip_into(&self.corners, depth, &mut self.spare);
        std::mem::swap(&mut self.corners, &mut self.spare);
        !self.corners.is_empty()
    }

    /// Tests whether each point of it surely satisfies the half-space.
    pub fn is_within(&self, of: &HalfSpace) -> bool {
        let slack = SLACK * of.bound * self.reach;
        self.corners.iter().all(|c| of.normal.dot(*c) >= slack)
    }
}

/// The half-space through the eye and an edge of an opening, towards its middle;
/// `None` if rounding hides which side that is.
pub fn through_edge(
    corners: &[DVec3; 4],
    edge: usize,
    reach: f64,
    number: u32,
) -> Option<HalfSpace> {
    let (a, b) = (corners[edge], corners[(edge + 1) % 4]);
    let middle = (corners[0] + corners[1] + corners[2] + corners[3]) * 0.25;
    let normal = a.cross(b);
    let bound = a.abs().element_sum() * b.abs().element_sum();
    let towards = normal.dot(middle);
    if towards.abs() <= 16.0 * SLACK * bound * reach {
        return None;
    }
    Some(HalfSpace {
        normal: if towards < 0.0 { -normal } else { normal },
        bound,
        number,
    })
}
