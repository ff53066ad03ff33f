//! Oracle: decides exactly whether a box and a convex volume share a point.
//!
//! Verdicts are OUT, TOUCH and IN, at planes level (f32 planes and boxes count as exact) or at
//! camera level (the camera's parameters do).

mod camera;
mod certificates;
mod evaluate;
mod rough;

use certificates::{Extent, certificates};
use evaluate::{Corners, Exact, HalfSpace, Precision, at, at_p_vertex, inner_point};
use glam::DVec3;

use crate::geometry::{Aabb, ConvexVolume, PlaneF64};

pub use crate::camera::Pose;

/// Relation of a closed box to a closed volume.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Verdict {
    /// No common point.
    Out,
    /// Common points, but none strictly inside all planes.
    Touch,
    /// A point of the box lies strictly inside all planes.
    In,
}

/// A verdict, and whether it is proven.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Classification {
    /// Verdict, as far as it is proven.
    pub verdict: Verdict,
    /// True for a tie too close to decide at camera level, which counts as a touch.
    ///
    /// Closer than the precision of the camera's planes: 2^-150 of the magnitudes involved.
    pub undecided: bool,
}

/// Exact verdicts about boxes against one volume.
///
/// Prepared once per volume, O(m^4) for m planes: tens of microseconds for a
/// frustum, about a millisecond for 32 planes or at camera level. A verdict
/// takes tens of nanoseconds, O(certificates): a filter in f64 with proven
/// error decides nearly all, expansions the rest. docs/NUMERICS.md ("The exact
/// oracle") has the proofs and the figures.
///
/// ```
/// use cullbench::geometry::{Aabb, ConvexVolume, Plane};
/// use cullbench::oracle::{Oracle, Verdict};
/// use glam::Vec3;
///
/// // A wedge with its edge along y: |x| <= -z.
/// let planes = [1.0, -1.0].map(|x| Plane::new(Vec3::new(x, 0.0, -1.0), 0.0));
/// let wedge = ConvexVolume::from_planes(&planes)?;
/// let oracle = Oracle::of_volume(&wedge);
/// // Both planes admit this box, and still no point of it is in the wedge.
/// let behind = Aabb::new(Vec3::new(-2.0, 0.0, 1.0), Vec3::new(2.0, 1.0, 2.0));
/// assert!(wedge.sees(&behind));
/// assert_eq!(oracle.verdict(&behind), Verdict::Out);
/// # Ok::<(), cullbench::geometry::VolumeError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Oracle {
    extent: Extent,
    faces: usize,
    precision: Precision,
    /// Certificates rounded to f64, for the filter.
    filter: Vec<PlaneF64>,
    exact: Vec<Exact>,
    /// Point well inside the volume, used to prove overlaps.
    inner: Option<DVec3>,
}

impl Oracle {
    /// Oracle at planes level, exact for the given planes.
    ///
    /// Products have at most four factors of f32, so nothing overflows or underflows.
    pub fn of_volume(volume: &ConvexVolume) -> Oracle {
        let planes = volume.planes().iter().map(|plane| HalfSpace {
            normal: plane.normal.to_array().map(Into::into),
            d: plane.d.into(),
        });
        Oracle::new(planes.collect(), Precision::EXACT)
    }

    fn new(constraints: Vec<HalfSpace>, precision: Precision) -> Oracle {
        let (extent, [mut all, others]) = certificates(constraints, precision);
        let faces = all.len();
        all.extend(others);
        let filter: Vec<PlaneF64> = all.iter().map(HalfSpace::rounded).collect();
        Oracle {
            extent,
            faces,
            precision,
            inner: inner_point(&filter[..faces]),
            filter,
            exact: all.iter().map(Exact::new).collect(),
        }
    }

    /// Verdict about a box with finite bounds.
    ///
    /// Meaningless for other bounds. An inverted box is empty, and so OUT.
    pub fn verdict(&self, b: &Aabb) -> Verdict {
        self.classify(b).verdict
    }

    /// Verdict, and whether it is proven; at planes level it always is.
    pub fn classify(&self, b: &Aabb) -> Classification {
        self.classify_f64(b.min.as_dvec3(), b.max.as_dvec3())
    }

    /// Verdict about an f64 box with finite corners of at most 1e60.
    pub fn classify_f64(&self, min: DVec3, max: DVec3) -> Classification {
        let corners = &Corners { min, max };
        let classified = |verdict, undecided| Classification { verdict, undecided };
        if corners.is_empty() || self.extent == Extent::Empty {
            return classified(Verdict::Out, false);
        }
        let mut least = if self.extent == Extent::Flat { 0 } else { 1 };
        for i in 0..self.filter.len() {
            if i == self.faces && least > 0 && self.has_inner_point(corners) {
                return classified(Verdict::In, false);
            }
            match self.sign(i, corners) {
                -1 => return classified(Verdict::Out, false),
                sign => least = least.min(sign),
            }
        }
        match least > 0 {
            true => classified(Verdict::In, false),
            false => classified(Verdict::Touch, !self.precision.is_exact()),
        }
    }

    /// Depth of the box in the volume; if negative, the distance is at least its size.
    ///
    /// In world units: the least value of any certificate of unit length, to a millionth of
    /// itself. For a box that is IN this is the length of the shortest move that makes it
    /// touch. For a box that is OUT it is the negated widest gap on an axis of the separating
    /// axis test, which is at most the true distance (less if two corners are nearest). Zero
    /// for a touch, infinite for a volume without constraints, minus infinity for an empty box
    /// or volume. O(certificates).
    ///
    /// ```
    /// # use cullbench::geometry::{Aabb, ConvexVolume, Plane};
    /// # use cullbench::oracle::Oracle;
    /// # use glam::Vec3;
    /// let slab = ConvexVolume::from_planes(&[
    ///     Plane::new(Vec3::X, 0.0),
    ///     Plane::new(-Vec3::X, 10.0),
    /// ])?;
    /// let oracle = Oracle::of_volume(&slab);
    /// let from_to = |a: f32, b: f32| Aabb::new(Vec3::splat(a), Vec3::splat(b));
    /// assert_eq!(oracle.depth(&from_to(-3.0, 1.0)), 1.0);
    /// assert_eq!(oracle.depth(&from_to(12.0, 13.0)), -2.0);
    /// # Ok::<(), cullbench::geometry::VolumeError>(())
    /// ```
    pub fn depth(&self, b: &Aabb) -> f64 {
        self.depth_f64(b.min.as_dvec3(), b.max.as_dvec3())
    }

    /// Depth of an f64 box, as [`Oracle::depth`] defines it.
    pub fn depth_f64(&self, min: DVec3, max: DVec3) -> f64 {
        let corners = &Corners { min, max };
        if corners.is_empty() || self.extent == Extent::Empty {
            return f64::NEG_INFINITY;
        }
        let depths = self.filter.iter().zip(&self.exact).map(|(filter, exact)| {
            let length = filter.normal.length();
            let (value, error) = at_p_vertex(filter, corners);
            match error > value.abs() * 1e-6 {
                true => exact.at_p_vertex(corners, self.precision) / length,
                false => value / length,
            }
        });
        depths.fold(f64::INFINITY, f64::min)
    }

    /// Returns `true` if one plane has the whole box on its outer side, exactly.
    ///
    /// This is a six-plane test without any error.
    pub fn faces_exclude(&self, b: &Aabb) -> bool {
        let [min, max] = [b.min, b.max].map(|corner| corner.as_dvec3());
        let corners = Corners { min, max };
        self.extent == Extent::Empty || (0..self.faces).any(|face| self.sign(face, &corners) < 0)
    }

    /// Sign of a certificate at the box's p-vertex.
    ///
    /// Uses exact sums if the filter does not decide.
    #[inline]
    fn sign(&self, certificate: usize, corners: &Corners) -> i32 {
        let (value, error) = at_p_vertex(&self.filter[certificate], corners);
        if value > error {
            return 1;
        }
        if value < -error {
            return -1;
        }
        let value = self.exact[certificate].at_p_vertex(corners, self.precision);
        i32::from(value > 0.0) - i32::from(value < 0.0)
    }

    /// Returns `true` if a point of the box is certainly strictly inside all planes.
    ///
    /// Tests the point nearest to the volume's inner point, and the box's centre.
    fn has_inner_point(&self, b: &Corners) -> bool {
        let is_inside = |point: DVec3| {
            self.filter[..self.faces].iter().all(|face| {
                let (value, error) = at(face, point);
                value > error
            })
        };
        let nearest = self.inner.map(|inner| inner.clamp(b.min, b.max));
        nearest.is_some_and(is_inside) || is_inside((b.max + b.min) * 0.5)
    }
}
