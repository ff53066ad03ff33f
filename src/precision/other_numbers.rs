//! The plane test in other numbers than the toolkit's own: fused, flushed to
//! zero, about the box's centre, in double-double and in interval arithmetic.
//! They are there to be measured beside it; nothing else is asked with them.

use std::array;

use glam::Vec3;

use crate::arithmetic::{Expansion, two_sum, upper_half};
use crate::geometry::{
    Aabb, BoxBlock, LANES, LaneMask, MAX_PLANES, PVertexSigns, Plane, PlaneF64, PlaneMask,
};
use crate::kernel::{Isa, each};
use crate::query::{Predicate, QueryVolume};

/// A plane whose test is carried out in some numbers.
///
/// The corners of a box are given as the one farthest along the normal, and the
/// one opposite.
pub trait PlaneForm: Copy + 'static {
    /// What the farthest corner evaluates to, as far as it takes no decision.
    type Value: Copy + Default + PartialOrd;

    fn normal_upper(&self) -> PVertexSigns;
    fn value(&self, far: [f32; 3], near: [f32; 3]) -> Self::Value;
    /// Whether the whole box lies outside, from [`PlaneForm::value`].
    #[inline(always)]
    fn is_outside(&self, value: Self::Value, _far: [f32; 3], _near: [f32; 3]) -> bool {
        value < Self::Value::default()
    }
    /// Whether the whole box lies inside.
    #[inline(always)]
    fn is_inside(&self, far: [f32; 3], near: [f32; 3]) -> bool {
        self.value(near, far) >= Self::Value::default()
    }
}

/// A view whose planes are all of one form. Without a constraint where a plane
/// has a zero normal and no negative offset.
#[derive(Clone, Debug)]
pub struct Formed<P> {
    planes: Vec<P>,
}

impl<P: PlaneForm> Formed<P> {
    pub fn new(planes: impl IntoIterator<Item = P>) -> Formed<P> {
        let planes: Vec<P> = planes.into_iter().take(MAX_PLANES).collect();
        Formed { planes }
    }

    pub fn of<'p, F>(planes: &'p [F]) -> Formed<P>
    where
        P: From<&'p F>,
    {
        Formed::new(planes.iter().map(P::from))
    }

    #[inline(always)]
    fn corners(&self, plane: u32, b: &Aabb) -> (P, [f32; 3], [f32; 3]) {
        let plane = self.planes[plane as usize];
        let upper = plane.normal_upper();
        let at = |upper: bool, k: usize| if upper { b.max[k] } else { b.min[k] };
        let far = each([0, 1, 2], |k| at(upper[k], k));
        (plane, far, each([0, 1, 2], |k| at(!upper[k], k)))
    }
}

impl<P: PlaneForm> Predicate for Formed<P> {
    #[inline(always)]
    fn mask(&self) -> PlaneMask {
        ((1u64 << self.planes.len()) - 1) as PlaneMask
    }
    #[inline(always)]
    fn excludes(&self, plane: u32, bounds: &Aabb) -> bool {
        let (plane, far, near) = self.corners(plane, bounds);
        plane.is_outside(plane.value(far, near), far, near)
    }
    #[inline(always)]
    fn contains(&self, plane: u32, bounds: &Aabb) -> bool {
        let (plane, far, near) = self.corners(plane, bounds);
        plane.is_inside(far, near)
    }
}

impl<P: PlaneForm> QueryVolume for Formed<P> {
    #[inline(always)]
    fn kept_lanes<I: Isa>(&self, _: I, block: &BoxBlock, mask: PlaneMask) -> LaneMask {
        let mut outside = [false; LANES];
        for (bit, plane) in self.planes.iter().enumerate() {
            if mask >> bit & 1 == 0 {
                continue;
            }
            let upper = plane.normal_upper();
            let (far, near) = (
                block.corner_rows(upper),
                block.corner_rows(each(upper, |u| !u)),
            );
            let of = |rows: [&[f32; LANES]; 3], lane: usize| each(rows, |row| row[lane]);
            // First what vectors do, then what may take a decision of its own.
            let mut values = [P::Value::default(); LANES];
            for (lane, value) in values.iter_mut().enumerate() {
                *value = plane.value(of(far, lane), of(near, lane));
            }
            for (lane, outside) in outside.iter_mut().enumerate() {
                *outside |= plane.is_outside(values[lane], of(far, lane), of(near, lane));
            }
        }
        let bits = outside.iter().enumerate();
        !bits.fold(0, |bits, (lane, &outside)| {
            bits | LaneMask::from(outside) << lane
        })
    }
}

#[inline(always)]
fn upper(normal: [f64; 3]) -> PVertexSigns {
    each(normal, |n| n >= 0.0)
}

/// An f32 plane whose products are fused with the sums: three roundings, not
/// six. Monotone as they are.
#[derive(Clone, Copy, Debug)]
pub struct Fused(Plane);

impl From<&Plane> for Fused {
    fn from(plane: &Plane) -> Self {
        Fused(*plane)
    }
}

impl PlaneForm for Fused {
    type Value = f32;

    #[inline(always)]
    fn normal_upper(&self) -> PVertexSigns {
        self.0.upper()
    }
    #[inline(always)]
    fn value(&self, far: [f32; 3], _: [f32; 3]) -> f32 {
        let Plane { normal: n, d } = self.0;
        n.x.mul_add(far[0], n.y.mul_add(far[1], n.z.mul_add(far[2], d)))
    }
}

/// An f32 plane in a processor that takes subnormal numbers for zero, operands
/// and results: an emulation, flush by flush. Monotone, because flushing is.
#[derive(Clone, Copy, Debug)]
pub struct Flushed(Plane);

impl From<&Plane> for Flushed {
    fn from(plane: &Plane) -> Self {
        let normal = plane.normal.to_array().map(flush);
        Flushed(Plane::new(Vec3::from(normal), flush(plane.d)))
    }
}

/// A subnormal number becomes a zero of its sign.
#[inline(always)]
fn flush(x: f32) -> f32 {
    if x.abs() < f32::MIN_POSITIVE {
        0f32.copysign(x)
    } else {
        x
    }
}

impl PlaneForm for Flushed {
    type Value = f32;

    #[inline(always)]
    fn normal_upper(&self) -> PVertexSigns {
        self.0.upper()
    }
    #[inline(always)]
    fn value(&self, far: [f32; 3], _: [f32; 3]) -> f32 {
        let Plane { normal: n, d } = self.0;
        let [x, y, z] = each(far, flush);
        let sum = flush(flush(n.x * x) + flush(n.y * y));
        flush(flush(sum + flush(n.z * z)) + d)
    }
}

/// An f32 plane that meets a box as its centre and half extent, as many engines
/// keep them. Not monotone: a node's centre may be rounded against an item's, so
/// only a scan may ask it.
#[derive(Clone, Copy, Debug)]
pub struct CentreExtent(Plane);

impl From<&Plane> for CentreExtent {
    fn from(plane: &Plane) -> Self {
        CentreExtent(*plane)
    }
}

impl CentreExtent {
    /// The centre's value and how far the box reaches along the normal.
    #[inline(always)]
    fn parts(&self, far: [f32; 3], near: [f32; 3]) -> [f32; 2] {
        let Plane { normal: n, d } = self.0;
        let [x, y, z] = each([0, 1, 2], |k| 0.5 * far[k] + 0.5 * near[k]);
        let [a, b, c] = each([0, 1, 2], |k| (0.5 * far[k] - 0.5 * near[k]).abs());
        let m = n.abs();
        [
            ((n.x * x + n.y * y) + n.z * z) + d,
            (m.x * a + m.y * b) + m.z * c,
        ]
    }
}

impl PlaneForm for CentreExtent {
    type Value = f32;

    #[inline(always)]
    fn normal_upper(&self) -> PVertexSigns {
        self.0.upper()
    }
    #[inline(always)]
    fn value(&self, far: [f32; 3], near: [f32; 3]) -> f32 {
        let [centre, reach] = self.parts(far, near);
        centre + reach
    }
    #[inline(always)]
    fn is_inside(&self, far: [f32; 3], near: [f32; 3]) -> bool {
        let [centre, reach] = self.parts(far, near);
        centre - reach >= 0.0
    }
}

/// An f64 plane evaluated in double-double, some 106 bits: products exact, sums
/// with an error of 3 * 2^-106 of themselves (M. Joldes, J.-M. Muller and V.
/// Popescu 2017, "Tight and rigorous error bounds for basic building blocks of
/// double-word arithmetic", ACM Trans. Math. Softw. 44(2), AccurateDWPlusDW).
/// What that leaves undecided an expansion decides, so that every sign is exact,
/// and the test as monotone as real numbers are.
#[derive(Clone, Copy, Debug)]
pub struct DoubleDouble {
    /// The normal as two parts of at most 28 and 25 bits: their products with an
    /// f32 number are exact.
    high: [f64; 3],
    low: [f64; 3],
    d: f64,
}

/// Some times 3 * 3 * 2^-106.
const UNDECIDED: f64 = f64::from_bits((1023 - 102) << 52);

impl From<&PlaneF64> for DoubleDouble {
    fn from(plane: &PlaneF64) -> Self {
        let normal = plane.normal.to_array();
        let high = normal.map(upper_half);
        DoubleDouble {
            low: array::from_fn(|k| normal[k] - high[k]),
            high,
            d: plane.d,
        }
    }
}

impl DoubleDouble {
    #[inline(always)]
    fn sum(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
        let (high, low) = two_sum(a[0], b[0]);
        let (middle, rest) = two_sum(a[1], b[1]);
        let (high, low) = quick_two_sum(high, low + middle);
        let (high, low) = quick_two_sum(high, rest + low);
        [high, low]
    }

    /// The sign of `n . x + d`, without any error.
    fn sign(&self, [value, error]: [f64; 2], corner: [f32; 3]) -> i32 {
        if value.abs() > error {
            return if value > 0.0 { 1 } else { -1 };
        }
        let mut exact = Expansion::from(self.d);
        for (part, x) in self.high.iter().chain(&self.low).zip(corner.iter().cycle()) {
            exact.grow(part * f64::from(*x));
        }
        exact.sign()
    }
}

/// The sum of two numbers, the first the larger one, and what rounding lost.
#[inline(always)]
fn quick_two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    (sum, b - (sum - a))
}

impl PlaneForm for DoubleDouble {
    /// The value and how far it may be off.
    type Value = [f64; 2];

    #[inline(always)]
    fn normal_upper(&self) -> PVertexSigns {
        upper(each([0, 1, 2], |k| self.high[k]))
    }
    #[inline(always)]
    fn value(&self, far: [f32; 3], _: [f32; 3]) -> [f64; 2] {
        let products = each([0, 1, 2], |k| {
            let x = f64::from(far[k]);
            let (high, low) = quick_two_sum(self.high[k] * x, self.low[k] * x);
            [high, low]
        });
        let [x, y, z] = products;
        let sum = Self::sum(Self::sum(Self::sum(x, y), z), [self.d, 0.0]);
        let size = x[0].abs() + y[0].abs() + z[0].abs() + self.d.abs();
        [sum[0], UNDECIDED * size]
    }
    #[inline(always)]
    fn is_outside(&self, value: [f64; 2], far: [f32; 3], _: [f32; 3]) -> bool {
        self.sign(value, far) < 0
    }
    #[inline(always)]
    fn is_inside(&self, far: [f32; 3], near: [f32; 3]) -> bool {
        self.sign(self.value(near, far), near) >= 0
    }
}

/// A plane whose every number is an interval of f64, evaluated by the rules of
/// interval arithmetic, each end rounded outward (R. Moore 1966, "Interval
/// Analysis"). A box is dropped if all of the interval is negative: what is
/// undecided is kept. Monotone, because a box within another has an interval
/// within the other's.
#[derive(Clone, Copy, Debug)]
pub struct Interval {
    normal: [[f64; 2]; 3],
    d: [f64; 2],
}

impl Interval {
    /// A plane whose normal is true to `normal_error` in each component and its
    /// offset to `offset_error`.
    pub fn around(plane: &PlaneF64, normal_error: f64, offset_error: f64) -> Interval {
        let around = |x: f64, error: f64| [down(x - error), up(x + error)];
        Interval {
            normal: plane.normal.to_array().map(|n| around(n, normal_error)),
            d: around(plane.d, offset_error),
        }
    }

    /// The interval of `n . x + d` over the box between two corners.
    #[inline(always)]
    fn ends(&self, far: [f32; 3], near: [f32; 3]) -> [f64; 2] {
        let mut sum = [0.0, 0.0];
        for k in 0..3 {
            let [low, high] = self.normal[k];
            let (a, b) = (f64::from(far[k]), f64::from(near[k]));
            let [c, d] = sorted(low * a, high * a);
            let [e, f] = sorted(low * b, high * b);
            sum = added(sum, [down(sorted(c, e)[0]), up(sorted(d, f)[1])]);
        }
        added(sum, self.d)
    }
}

#[inline(always)]
fn sorted(a: f64, b: f64) -> [f64; 2] {
    if a < b { [a, b] } else { [b, a] }
}

/// A number that is surely above the one that was rounded to `x`: what is added is
/// an ulp or two. Monotone, and without a branch.
#[inline(always)]
fn up(x: f64) -> f64 {
    x + (x.abs() * f64::EPSILON + f64::MIN_POSITIVE)
}

#[inline(always)]
fn down(x: f64) -> f64 {
    x - (x.abs() * f64::EPSILON + f64::MIN_POSITIVE)
}

/// The sum of two intervals, rounded outward.
#[inline(always)]
fn added(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [down(a[0] + b[0]), up(a[1] + b[1])]
}

impl PlaneForm for Interval {
    /// The upper end.
    type Value = f64;

    #[inline(always)]
    fn normal_upper(&self) -> PVertexSigns {
        upper(each([0, 1, 2], |k| self.normal[k][1]))
    }
    #[inline(always)]
    fn value(&self, far: [f32; 3], near: [f32; 3]) -> f64 {
        self.ends(far, near)[1]
    }
    #[inline(always)]
    fn is_inside(&self, far: [f32; 3], near: [f32; 3]) -> bool {
        self.ends(far, near)[0] >= 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::arbitrary::{any_box, number, vector};
    use crate::geometry::{ConvexVolume, ConvexVolumeF64};
    use crate::kernel::BASELINE;
    use crate::scene::SeededRng;
    use glam::DVec3;
    use proptest::prelude::*;

    /// What a tree asks of a view: no item is seen of a node that is excluded,
    /// none is dropped of one that is contained, and lanes are as boxes are.
    fn check<P: PlaneForm>(view: &Formed<P>, items: &[Aabb]) -> Result<(), TestCaseError> {
        let node = Aabb::union_of(items);
        for plane in 0..view.planes.len() as u32 {
            for item in items {
                prop_assert!(!view.excludes(plane, &node) || view.drops(plane, item));
                prop_assert!(!view.contains(plane, &node) || !view.drops(plane, item));
            }
        }
        lanes(view, items)
    }

    fn lanes<P: PlaneForm>(view: &Formed<P>, items: &[Aabb]) -> Result<(), TestCaseError> {
        let mut block = BoxBlock::EMPTY;
        let shown = &items[..items.len().min(LANES)];
        shown
            .iter()
            .enumerate()
            .for_each(|(lane, b)| block.set(lane, b));
        let kept = view.kept_lanes(BASELINE, &block, view.mask());
        for (lane, item) in shown.iter().enumerate() {
            prop_assert_eq!(kept >> lane & 1 == 1, view.sees(item), "{:?}", item);
        }
        Ok(())
    }

    /// The sign of `n . x + d` at the farthest corner, without any error.
    fn exact(plane: &PlaneF64, b: &Aabb) -> i32 {
        let mut sum = Expansion::from(plane.d);
        for k in 0..3 {
            let x = if plane.normal[k] >= 0.0 {
                b.max[k]
            } else {
                b.min[k]
            };
            let product = Expansion::product(plane.normal[k], f64::from(x));
            product.terms().iter().for_each(|&term| sum.grow(term));
        }
        sum.sign()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        #[test]
        fn trees_and_scans_agree_in_every_monotone_form(
            items in prop::collection::vec(any_box(), 1..20),
            planes in prop::collection::vec((vector(), number()), 1..8),
        ) {
            let planes: Vec<Plane> = planes.into_iter().map(|(n, d)| Plane::new(n, d)).collect();
            let wide = ConvexVolumeF64::from(&ConvexVolume::from_planes(&planes).unwrap());
            let wide = wide.planes();
            check(&Formed::new(planes.iter().map(Fused::from)), &items)?;
            check(&Formed::new(planes.iter().map(Flushed::from)), &items)?;
            check(&Formed::new(wide.iter().map(|p| Interval::around(p, 1e-9, 1e-3))), &items)?;
            check(&Formed::new(wide.iter().map(DoubleDouble::from)), &items)?;
            lanes(&Formed::new(planes.iter().map(CentreExtent::from)), &items)?;
        }

        /// Both decide as exact arithmetic does, wherever they decide.
        #[test]
        fn double_double_and_intervals_are_exact_where_they_decide(
            normal in [-1f64..1.0, -1f64..1.0, -1f64..1.0], b in any_box(), ulps in -3i64..4,
            free in -1e6f64..1e6, touching: bool,
        ) {
            let normal = DVec3::from(normal);
            // A plane that the far corner touches, but for some ulps.
            let far = DVec3::from_array(array::from_fn(|k| {
                f64::from(if normal[k] >= 0.0 { b.max[k] } else { b.min[k] })
            }));
            let d = -normal.dot(far);
            let d = match touching && d != 0.0 {
                true => f64::from_bits(d.to_bits().wrapping_add_signed(ulps)),
                false => free,
            };
            let plane = PlaneF64::new(normal, d);
            let sign = exact(&plane, &b);
            let doubled = Formed::new([DoubleDouble::from(&plane)]);
            prop_assert_eq!(doubled.excludes(0, &b), sign < 0);
            let interval = Formed::new([Interval::around(&plane, 0.0, 0.0)]);
            prop_assert!(!interval.excludes(0, &b) || sign < 0);
            prop_assert!(!interval.contains(0, &b) || sign >= 0);
        }
    }

    /// Planes through a box's corner but for what f64 cannot hold: rounding drops
    /// many of those boxes, an interval none, and exact signs none.
    #[test]
    fn intervals_and_exact_signs_keep_what_rounding_would_drop() {
        let mut rng = SeededRng::new(2);
        let mut dropped = 0;
        for _ in 0..2000 {
            let [normal, a, b] = [(); 3].map(|()| rng.point() * 2.0 - 1.0);
            let (a, b) = (a.as_vec3(), b.as_vec3());
            let b = Aabb::new(a.min(b), a.max(b));
            let mut plane = PlaneF64::new(normal, 0.0);
            let upper = normal.to_array().map(|n| n >= 0.0);
            let far = (0..3).map(|k| if upper[k] { b.max[k] } else { b.min[k] });
            plane.d = -(0..3)
                .zip(far)
                .map(|(k, x)| normal[k] * f64::from(x))
                .sum::<f64>();
            while exact(&plane, &b) < 0 {
                plane.d = plane.d.next_up();
            }
            // As low as it goes with the box still touching.
            let lower = |plane: &PlaneF64| PlaneF64::new(plane.normal, plane.d.next_down());
            while exact(&lower(&plane), &b) >= 0 {
                plane = lower(&plane);
            }
            dropped += u32::from(plane.excludes(&b));
            let interval = Formed::new([Interval::around(&plane, 0.0, 0.0)]);
            let doubled = Formed::new([DoubleDouble::from(&plane)]);
            assert!(interval.sees(&b) && doubled.sees(&b), "{plane:?} {b:?}");
        }
        assert!(dropped > 20, "{dropped}");
    }

    /// What each form loses, or keeps, that the plain test does not.
    #[test]
    fn the_forms_differ_where_they_must() {
        let at = |x: f32| Aabb::new(Vec3::splat(x), Vec3::splat(x));
        // x (1 + e) - (1 + 2 e) at 1 + e: e^2, which only fused is left.
        let e = f32::EPSILON;
        let plane = Plane::new(Vec3::new(-1.0 - e, 0.0, 0.0), 1.0 + 2.0 * e);
        assert!(!plane.excludes(&at(1.0 + e)));
        assert!(Formed::new([Fused::from(&plane)]).excludes(0, &at(1.0 + e)));
        // Below 2^-126 there is nothing.
        let tiny = f32::MIN_POSITIVE / 2.0;
        let plane = Plane::new(Vec3::X, -2.0 * tiny);
        assert!(plane.excludes(&at(tiny)));
        let plane = Plane::new(Vec3::X, -tiny);
        assert!(plane.excludes(&at(0.0)));
        assert!(!Formed::new([Flushed::from(&plane)]).excludes(0, &at(0.0)));
        // Touching boxes that the centre, rounded, takes from the plane.
        let mut rng = SeededRng::new(1);
        let lost = (0..1000).filter(|_| {
            let [a, b, n] = [(); 3].map(|()| (rng.point() * 2.0 - 1.0).as_vec3());
            let b = Aabb::new(a.min(b), a.max(b));
            let through = Plane::new(n, 0.0);
            let plane = Plane::new(n, -through.value_at(through.p_vertex(&b)));
            let centre = Formed::new([CentreExtent::from(&plane)]);
            assert!(!plane.excludes(&b));
            centre.excludes(0, &b)
        });
        let lost = lost.count();
        assert!((100..900).contains(&lost), "{lost}");
    }
}
