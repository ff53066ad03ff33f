//! The oracle: whether a box and a convex volume have a point in common,
//! decided exactly. It owns the verdicts OUT, TOUCH and IN at planes level
//! (f32 planes and boxes are exact objects) and at camera level (the camera's
//! parameters are); how culling tests come out against it is measured
//! elsewhere.

mod camera;
mod certificates;
mod number;

use crate::arithmetic::{Expansion, two_sum, upper_half};
use crate::geometry::{Aabb, ConvexVolume};
use certificates::{Certificates, Extent, HalfSpace, certificates};
use number::Precision;

pub use camera::Pose;

/// How a closed box lies to a closed volume.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Verdict {
    /// No common point.
    Out,
    /// Common points, but none of them strictly inside all planes.
    Touch,
    /// A point of the box lies strictly inside all planes.
    In,
}

/// A verdict and whether it could be proved.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Judgement {
    pub verdict: Verdict,
    /// At camera level: closer to a tie than the precision of the camera's
    /// planes (2^-150 of the magnitudes involved), and so called a touch.
    pub undecided: bool,
}

/// Exact verdicts about boxes against one volume.
///
/// Prepared once per volume, O(m^4) for m planes: some 100 microseconds for a
/// frustum. A verdict takes tens of nanoseconds: a filter in f64 with proven
/// error decides nearly all, expansions the rest.
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
pub struct Oracle {
    extent: Extent,
    faces: usize,
    precision: Precision,
    /// The same certificates twice: in f64 for the filter, and in full.
    filter: Vec<Filter>,
    exact: Vec<Exact>,
    /// A point well inside the volume, to prove overlaps with.
    inner: Option<[f64; 3]>,
}

/// A certificate in f64, each coefficient rounded once.
struct Filter {
    normal: [f64; 3],
    d: f64,
}

/// A certificate in full.
struct Exact {
    /// Axis and coefficient, split so that a product with an f32 is exact.
    terms: Vec<(u8, f64)>,
    d: Vec<f64>,
    /// Magnitudes before cancellation, per axis and of d.
    size: [f64; 4],
}

/// The filter errs by less than this part of its magnitude: three coefficients
/// and an offset rounded once (2^-53 each), three products and three sums.
const FILTER_ERROR: f64 = 16.0 * f64::EPSILON;

impl Oracle {
    /// Planes level: the planes as they are, with no error whatever.
    pub fn of_volume(volume: &ConvexVolume) -> Oracle {
        let constraints: Vec<HalfSpace> = volume
            .planes()
            .iter()
            .map(|plane| HalfSpace {
                normal: plane.normal.to_array().map(Into::into),
                d: plane.d.into(),
            })
            .collect();
        Oracle::new(&constraints, Precision::EXACT)
    }

    fn new(constraints: &[HalfSpace], precision: Precision) -> Oracle {
        let Certificates { extent, faces, all } = certificates(constraints, precision);
        let filter: Vec<Filter> = all.iter().map(Filter::new).collect();
        Oracle {
            extent,
            faces,
            precision,
            inner: inner_point(&filter[..faces]),
            filter,
            exact: all.iter().map(Exact::new).collect(),
        }
    }

    /// The verdict about a box with finite bounds.
    pub fn verdict(&self, b: &Aabb) -> Verdict {
        self.judge(b).verdict
    }

    /// The verdict, and whether it is proved; at planes level it always is.
    pub fn judge(&self, b: &Aabb) -> Judgement {
        let proved = |verdict| Judgement {
            verdict,
            undecided: false,
        };
        if b.is_empty() || self.extent == Extent::Empty {
            return proved(Verdict::Out);
        }
        let corners = Corners::of(b);
        let (faces, others) = self.filter.split_at(self.faces);
        let mut doubts = Doubts::default();
        for (i, face) in faces.iter().enumerate() {
            let (value, error) = face.at_p_vertex(&corners);
            if value < -error {
                return proved(Verdict::Out);
            }
            if value <= error {
                doubts.add(i);
            }
        }
        if doubts.none() && self.extent == Extent::Solid && self.witnessed(&corners) {
            return proved(Verdict::In);
        }
        for (i, other) in others.iter().enumerate() {
            let (value, error) = other.at_p_vertex(&corners);
            if value < -error {
                return proved(Verdict::Out);
            }
            if value <= error {
                doubts.add(self.faces + i);
            }
        }
        let mut touch = self.extent == Extent::Flat;
        let mut undecided = touch && !self.precision.is_exact();
        for &i in &doubts.0 {
            match self.exact[i].sign_at_p_vertex(b, self.precision) {
                -1 => return proved(Verdict::Out),
                0 => {
                    touch = true;
                    undecided |= !self.precision.is_exact();
                }
                _ => {}
            }
        }
        Judgement {
            verdict: if touch { Verdict::Touch } else { Verdict::In },
            undecided,
        }
    }

    /// How deep the box reaches into the volume (positive), or how far it
    /// stays away (negative), in world units, to f64 rounding: the least value
    /// of any certificate of unit length. For a box that is out this is the
    /// widest gap that an axis of the separating axis test shows, never more
    /// than the true distance. Minus infinity for an empty box or volume.
    pub fn depth(&self, b: &Aabb) -> f64 {
        if b.is_empty() || self.extent == Extent::Empty {
            return f64::NEG_INFINITY;
        }
        let corners = Corners::of(b);
        let depths = self.filter.iter().map(|certificate| {
            let [x, y, z] = certificate.normal;
            let length = (x * x + y * y + z * z).sqrt();
            certificate.at_p_vertex(&corners).0 / length
        });
        depths.fold(f64::INFINITY, f64::min)
    }

    /// Whether a point of the box lies strictly inside all planes for certain:
    /// the one nearest to the volume's inner point, or the box's centre.
    fn witnessed(&self, b: &Corners) -> bool {
        let centre = [0, 1, 2].map(|k| (b.high[k] + b.low[k]) * 0.5);
        let nearest = self
            .inner
            .map(|inner| [0, 1, 2].map(|k| inner[k].clamp(b.low[k], b.high[k])));
        [nearest, Some(centre)].into_iter().flatten().any(|point| {
            self.filter[..self.faces].iter().all(|face| {
                let (value, error) = face.at(point);
                value > error
            })
        })
    }
}

/// The bounds of a box in f64.
struct Corners {
    low: [f64; 3],
    high: [f64; 3],
}

impl Corners {
    #[inline]
    fn of(b: &Aabb) -> Corners {
        Corners {
            low: b.min.as_dvec3().to_array(),
            high: b.max.as_dvec3().to_array(),
        }
    }
}

/// Certificates that the filter cannot decide.
#[derive(Default)]
struct Doubts(Vec<usize>);

impl Doubts {
    fn add(&mut self, certificate: usize) {
        self.0.push(certificate);
    }

    fn none(&self) -> bool {
        self.0.is_empty()
    }
}

impl Filter {
    fn new(certificate: &HalfSpace) -> Filter {
        Filter {
            normal: [0, 1, 2].map(|k| certificate.normal[k].estimate()),
            d: certificate.d.estimate(),
        }
    }

    /// Value at the p-vertex and a bound of its error.
    #[inline(always)]
    fn at_p_vertex(&self, b: &Corners) -> (f64, f64) {
        let corner = [0, 1, 2].map(|k| {
            if self.normal[k] >= 0.0 {
                b.high[k]
            } else {
                b.low[k]
            }
        });
        self.at(corner)
    }

    #[inline(always)]
    fn at(&self, point: [f64; 3]) -> (f64, f64) {
        let [x, y, z] = [0, 1, 2].map(|k| self.normal[k] * point[k]);
        let magnitude = x.abs() + y.abs() + z.abs() + self.d.abs();
        (((x + y) + z) + self.d, FILTER_ERROR * magnitude)
    }
}

impl Exact {
    fn new(certificate: &HalfSpace) -> Exact {
        let mut terms = Vec::new();
        for (axis, n) in certificate.normal.iter().enumerate() {
            for &term in n.value.terms() {
                let upper = upper_half(term);
                let halves = [upper, term - upper]
                    .into_iter()
                    .filter(|&half| half != 0.0);
                terms.extend(halves.map(|half| (axis as u8, half)));
            }
        }
        let [x, y, z] = [0, 1, 2].map(|k| certificate.normal[k].size);
        Exact {
            terms,
            d: certificate.d.value.terms().to_vec(),
            size: [x, y, z, certificate.d.size],
        }
    }

    /// The sign of the value at the p-vertex.
    fn sign_at_p_vertex(&self, b: &Aabb, precision: Precision) -> i32 {
        // The sign of a coefficient is that of its largest, last term.
        let mut corner = b.max;
        for &(axis, term) in &self.terms {
            let k = usize::from(axis);
            corner[k] = if term >= 0.0 { b.max[k] } else { b.min[k] };
        }
        let products = || {
            let of_corner = self
                .terms
                .iter()
                .map(|&(axis, term)| term * f64::from(corner[usize::from(axis)]));
            of_corner.chain(self.d.iter().copied())
        };
        // Most ties are between short numbers, whose sum loses nothing.
        let (mut sum, mut lost) = (0.0, 0.0);
        for product in products() {
            let (next, error) = two_sum(sum, product);
            sum = next;
            lost += error.abs();
        }
        let mut value = sum;
        let mut sign = if sum == 0.0 { 0 } else { sum.signum() as i32 };
        if lost != 0.0 {
            let mut total = Expansion::default();
            products().for_each(|product| total.grow(product));
            sign = total.sign();
            value = total.estimate();
        }
        if !precision.is_exact() {
            let at = corner.abs().as_dvec3();
            let [x, y, z, d] = self.size;
            let size = x * at.x + y * at.y + z * at.z + d;
            if precision.is_noise(value, size) {
                return 0;
            }
        }
        sign
    }
}

/// A point inside all faces: the mean of the corners. None without at least
/// four corners; only a hint, so f64 will do.
fn inner_point(faces: &[Filter]) -> Option<[f64; 3]> {
    let mut sum = [0.0; 3];
    let mut count = 0.0;
    for (i, a) in faces.iter().enumerate() {
        for (j, b) in faces.iter().enumerate().skip(i + 1) {
            for c in &faces[j + 1..] {
                let Some(corner) = meeting_point([a, b, c]) else {
                    continue;
                };
                let within = faces.iter().all(|face| {
                    let (value, error) = face.at(corner);
                    value >= -1e6 * error
                });
                if within {
                    (0..3).for_each(|k| sum[k] += corner[k]);
                    count += 1.0;
                }
            }
        }
    }
    (count >= 4.0).then(|| sum.map(|s| s / count))
}

/// Where three planes meet, by Cramer's rule.
fn meeting_point(planes: [&Filter; 3]) -> Option<[f64; 3]> {
    let [a, b, c] = planes.map(|plane| glam::DVec3::from_array(plane.normal));
    let determinant = a.dot(b.cross(c));
    let sum = b.cross(c) * planes[0].d + c.cross(a) * planes[1].d + a.cross(b) * planes[2].d;
    let point = -sum / determinant;
    point.is_finite().then(|| point.to_array())
}
