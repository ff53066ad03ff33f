//! Culling by bounding spheres.
//!
//! An index holds the cube about each sphere. A margin keeps the sphere test conservative with
//! respect to the box test. `balls` has the same test on blocks of centres and radii.

use glam::{DVec4, Vec3};

use super::convex_volume::MAX_PLANES;
use super::{Aabb, ConvexVolume, Plane};
use crate::arithmetic::rounding::{difference_down, difference_up, round_up};
use crate::kernel::each;

/// The cube about a box's bounding sphere.
///
/// An index over these cubes tests its items as spheres.
///
/// The centre is the box's centre, rounded; the radius reaches the farthest corner from there,
/// rounded up; the cube's bounds are rounded outward. So the box lies in the sphere and the sphere
/// in the cube, exactly. Bounds beyond f32 are clamped to its largest number; [`Ball::in_cube`]
/// then has an infinite radius. An empty box is returned unchanged, and so is one that is not
/// finite, for the build to report.
pub fn sphere_cube(b: &Aabb) -> Aabb {
    if b.is_empty() || !b.is_finite() {
        return *b;
    }
    let centre = b.centre();
    let (c, min, max) = (centre.as_dvec3(), b.min.as_dvec3(), b.max.as_dvec3());
    // A few roundings in f64, each at most 2^-53.
    let radius = (max - c).max(c - min).length() * (1.0 + 8.0 * f64::EPSILON);
    let radius = f64::from(round_up(radius).min(f32::MAX));
    let low = |k: usize| difference_down(c[k], radius).max(f32::MIN);
    let high = |k: usize| difference_up(c[k], -radius).min(f32::MAX);
    Aabb::new(each([0, 1, 2], low).into(), each([0, 1, 2], high).into())
}

/// A sphere as read back from its cube.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Ball {
    /// Within the cube.
    pub centre: Vec3,
    /// Radius, never below the one that the cube was made with.
    ///
    /// Infinite if the cube was clamped to the range of f32.
    pub radius: f32,
    /// Largest absolute coordinate of the cube.
    pub reach: f32,
}

impl Ball {
    /// The sphere in a cube: half the sum and half the difference of the bounds.
    ///
    /// Each edge of the cube is at least a diameter, so the shortest suffices. The centre is
    /// clamped to the bounds, which halving a subnormal may leave.
    #[inline(always)]
    pub fn in_cube(cube: &Aabb) -> Ball {
        let (low, high) = (cube.min, cube.max);
        let lesser = |a: f32, b: f32| if a < b { a } else { b };
        let greater = |a: f32, b: f32| if a > b { a } else { b };
        let half = |k: usize| high[k] * 0.5 - low[k] * 0.5;
        let reach = |k: usize| greater(-low[k], high[k]);
        let reach = greater(greater(reach(0), reach(1)), reach(2));
        let radius = lesser(lesser(half(0), half(1)), half(2));
        Ball {
            centre: cube.centre().max(low).min(high),
            radius: if reach < f32::MAX {
                radius
            } else {
                f32::INFINITY
            },
            reach,
        }
    }
}

/// Numbers of a plane that the sphere test needs in addition to its normal.
#[derive(Clone, Copy, PartialEq, Default, Debug)]
pub struct SphereMargin {
    /// The normal's length, rounded up.
    pub length: f32,
    /// Margin per unit of [`Ball::reach`].
    pub slope: f32,
    /// The plane's offset plus the rest of the margin.
    pub d: f32,
    /// Normal and offset divided by the length, rounded.
    pub unit: [f32; 4],
    /// Distance from the plane that rounding may misjudge.
    ///
    /// Per unit of reach, for a reach of 0, and the largest reach without overflow.
    pub doubt: [f32; 3],
}

impl SphereMargin {
    /// Roundings of u = 2^-24 that the margin covers.
    ///
    /// Each is relative to the sum of magnitudes `|n|_1 * reach + |d|` (reach bounds the radius and
    /// every coordinate of the box and the centre): 4 in the box test that must not be
    /// contradicted, 6 in the sphere's dot product, 3 in `radius * length`, 2 between the centre of
    /// the cube and that of the sphere; 15 in all.
    const ROUNDINGS: f64 = 24.0;
    /// Roundings from the sum for the unit plane to the tests of [`Spheres::drops`].
    ///
    /// Each is relative to `2 |n|_1 * reach + |d|`: 24 for the margin above and 15 for what it
    /// covers, 4 from cube to sphere, 12 of the sum over centre and radius itself and of the
    /// division.
    const OF_BOTH: f64 = 96.0;

    fn of(plane: &Plane) -> SphereMargin {
        const UNIT_ROUNDOFF: f64 = 1.0 / (1u64 << 24) as f64;
        // Some times the smallest subnormal f32: products and halves that underflow.
        const TINY: f64 = f64::from_bits((1023 - 145) << 52);
        let normal = plane.normal.as_dvec3();
        let size = normal.abs().element_sum();
        let d = f64::from(plane.d);
        let margin = Self::ROUNDINGS * UNIT_ROUNDOFF;
        let length = normal.length();
        let [x, y, z, unit_d] = [normal.x, normal.y, normal.z, d].map(|x| x / length);
        let (both, tiny) = (Self::OF_BOTH * UNIT_ROUNDOFF, TINY * 64.0 * (1.0 + size));
        // An eighth leaves room for three terms, each twice.
        let most = f64::from(f32::MAX / 8.0);
        let rest = (both * d.abs() + tiny) / length + tiny;
        let most_reach = ((most - d.abs()) / size).min(most);
        let overflows = length == 0.0 || unit_d.abs() > most || rest > most;
        SphereMargin {
            length: round_up(length * (1.0 + 4.0 * f64::EPSILON)),
            slope: round_up(margin * size),
            d: round_up(d + margin * d.abs() + TINY * (1.0 + size)),
            unit: [x as f32, y as f32, z as f32, unit_d as f32],
            doubt: [
                round_up(both * 2.0 * size / length),
                round_up(rest),
                if overflows { -1.0 } else { most_reach as f32 },
            ],
        }
    }

    /// The value of the sphere's farthest point, or slightly more.
    ///
    /// The ball is certainly outside if this is a number below zero. An overflow yields an infinity
    /// or a NaN, which is no such number.
    #[inline(always)]
    pub fn value_at(&self, normal: Vec3, ball: &Ball) -> f32 {
        let c = ball.centre;
        let dot = ((normal.x * c.x + normal.y * c.y) + normal.z * c.z) + self.d;
        (dot + ball.radius * self.length) + ball.reach * self.slope
    }
}

/// A volume that sees its items as spheres, given by [`sphere_cube`]s.
///
/// A plane drops an item if the cube's p-vertex evaluates below zero or the sphere is certainly
/// outside. A verdict about a node (over cubes, by the plane test) never contradicts the verdict
/// about an item in it, bit for bit:
///
/// - A node outside a plane contains only cubes outside it (the plane test is monotone). The first
///   clause drops those; the sphere alone, with its margin, might keep one.
/// - A node inside a plane has an n-vertex of at least zero, and so have its cubes. Their
///   p-vertices evaluate no lower. Nor do their spheres: the centre lies in the cube, so
///   `n . c + d'` with `d' >= d` is monotone too and not below the n-vertex's value, and the term
///   added to it is not negative (or a NaN). Neither clause drops them.
///
/// The volume loses nothing that [`ConvexVolume::sees`] with the same planes sees. The box lies in
/// the cube, so if the cube's p-vertex evaluates below zero the box's does too. The sphere contains
/// the box, so its farthest point lies at least as far along the normal as any point of the box,
/// and the margin covers every rounding of both tests (`SphereMargin::ROUNDINGS`).
#[derive(Clone, Debug)]
pub struct Spheres {
    planes: ConvexVolume,
    margins: [SphereMargin; MAX_PLANES],
    /// All planes as sums, if they are those of a symmetric frustum with a far plane.
    pub(super) frustum: Option<FrustumSums>,
}

impl Spheres {
    /// Prepares a volume's planes for the sphere test.
    pub fn new(planes: &ConvexVolume) -> Self {
        let mut margins = [SphereMargin::default(); MAX_PLANES];
        for (margin, plane) in margins.iter_mut().zip(planes.planes()) {
            *margin = SphereMargin::of(plane);
        }
        let mut spheres = Spheres {
            planes: planes.clone(),
            margins,
            frustum: None,
        };
        spheres.frustum = FrustumSums::of(&spheres);
        spheres
    }

    /// The planes in f32, without the margins of the sphere test.
    #[inline(always)]
    pub fn planes(&self) -> &ConvexVolume {
        &self.planes
    }

    /// Plane `index` of a mask bit with its margin.
    ///
    /// Without a bounds check in the inner loop.
    #[inline(always)]
    pub fn plane_of_bit(&self, index: u32) -> (&Plane, &SphereMargin) {
        let margin = &self.margins[index as usize % MAX_PLANES];
        (self.planes.plane_of_bit(index), margin)
    }

    /// Returns whether plane `index` has the item's sphere on its outer side.
    #[inline(always)]
    pub fn drops(&self, index: u32, cube: &Aabb) -> bool {
        let (plane, margin) = self.plane_of_bit(index);
        if plane.excludes(cube) {
            return true;
        }
        let value = margin.value_at(plane.normal, &Ball::in_cube(cube));
        (f32::MIN..0.0).contains(&value)
    }
}

/// The six planes of a view frustum as three sums.
///
/// The smaller of the distances from two planes is `s - |t|`, where s and t are half the sum and
/// half the difference of the two. For a symmetric frustum, s of each pair of sides is linear in t
/// of near and far plane.
#[derive(Clone, Debug)]
pub(super) struct FrustumSums {
    pub depth: [f32; 4],
    pub half_depth: f32,
    /// Factor of the depth, offset, and t, for each pair of sides.
    pub sides: [([f32; 2], [f32; 4]); 2],
}

impl FrustumSums {
    /// Largest part of s that is not linear in the depth, per unit of coordinates.
    ///
    /// Together with the roundings of the sums, less than half of [`Spheres::doubt`].
    const RESIDUAL: f64 = 3e-6;

    /// `None` unless the planes are those of a symmetric frustum with a far plane.
    pub fn of(spheres: &Spheres) -> Option<Self> {
        if spheres.planes().mask() != 0b11_1111 {
            return None;
        }
        let plane = |index: u32| {
            let [x, y, z, d] = spheres.plane_of_bit(index).1.unit;
            DVec4::new(x.into(), y.into(), z.into(), d.into())
        };
        let halves = |pair: u32| {
            let (a, b) = (plane(2 * pair), plane(2 * pair + 1));
            ((a + b) * 0.5, (a - b) * 0.5)
        };
        let (still, depth) = halves(2);
        let mut residual = still.truncate().length();
        let axis = depth.truncate();
        let mut side = |pair: u32| {
            let (s, t) = halves(pair);
            let factor = s.truncate().dot(axis) / axis.length_squared();
            let rest = s - depth * factor;
            residual = residual.max(rest.truncate().length());
            ([factor as f32, rest.w as f32], t.as_vec4().to_array())
        };
        let sides = [side(0), side(1)];
        (residual <= Self::RESIDUAL).then(|| FrustumSums {
            depth: depth.as_vec4().to_array(),
            half_depth: still.w as f32,
            sides,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_corner_of_a_cube_alone_is_not_enough() {
        // Through a corner region of the cube, past the sphere.
        let b = Aabb::new(Vec3::splat(-1.0), Vec3::splat(1.0));
        let cube = sphere_cube(&b);
        let radius = 3f32.sqrt();
        assert!(cube.max.x >= radius && cube.max.x < radius * 1.000001);
        let normal = Vec3::splat(1.0 / radius);
        let at = |distance: f32| {
            let plane = Plane::new(normal, -distance);
            Spheres::new(&ConvexVolume::from_planes(&[plane]).unwrap())
        };
        assert!(!at(1.732).drops(0, &cube), "the sphere reaches 1.7320508");
        assert!(at(1.733).drops(0, &cube));
        assert!(!at(1.733).planes().planes()[0].excludes(&cube));
    }

    #[test]
    fn boxes_at_the_end_of_f32_stay_finite_and_visible() {
        let corner = Vec3::splat(f32::MAX);
        for b in [
            Aabb::new(-corner, corner),
            Aabb::new(corner * 0.5, corner),
            Aabb::new(corner, corner),
        ] {
            let cube = sphere_cube(&b);
            assert!(cube.is_finite() && cube.contains(&b));
            // Close to the corner that the clamped cube's own sphere does not reach.
            let plane = Plane::new(Vec3::splat(1e-3), -2.9e-3 * f32::MAX);
            let volume = ConvexVolume::from_planes(&[plane]).unwrap();
            assert!(volume.sees(&b) && !Spheres::new(&volume).drops(0, &cube));
        }
        let empty = Aabb::new(Vec3::ONE, Vec3::ZERO);
        assert_eq!(sphere_cube(&empty), empty);
    }

    /// Any size: a grid for ties, all exponents for the others.
    fn number() -> impl Strategy<Value = f32> {
        prop_oneof![
            (-8i8..8).prop_map(f32::from),
            -1e3f32..1e3,
            (0.5f32..1.0, -126i32..127).prop_map(|(m, e)| m * 2f32.powi(e)),
            prop::num::f32::SUBNORMAL,
            prop::num::f32::NORMAL,
        ]
    }

    fn vector() -> impl Strategy<Value = Vec3> {
        prop_oneof![
            [number(), number(), number()],
            [-1f32..1.0, -1f32..1.0, -1f32..1.0],
        ]
        .prop_map(Vec3::from_array)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        #[test]
        fn a_sphere_never_loses_what_the_box_test_sees(
            a in vector(), size in vector(), normal in vector(), scale in 0i32..24,
            free in number(), ulps in -20i32..20, touching: bool,
        ) {
            // Down to far away and tiny, where rounding the cube matters.
            let b = a + size * 2f32.powi(-scale);
            prop_assume!(b.is_finite());
            let b = Aabb::new(a.min(b), a.max(b));
            let cube = sphere_cube(&b);
            prop_assert!(cube.is_finite() && cube.contains(&b));
            // A plane that the box's far corner touches up to a few ulps.
            let through = Plane::new(normal, 0.0);
            let d = -through.value_at(through.p_vertex(&b));
            let touches = f32::from_bits(d.to_bits().saturating_add_signed(ulps));
            let d = if touching { touches } else { free };
            prop_assume!(d.is_finite());
            let volume = ConvexVolume::from_planes(&[Plane::new(normal, d)]).unwrap();
            if volume.sees(&b) {
                prop_assert!(!Spheres::new(&volume).drops(0, &cube));
            }
        }

        #[test]
        fn the_sphere_read_back_holds_the_box(a in vector(), size in vector()) {
            let b = a + size;
            prop_assume!(b.is_finite());
            let b = Aabb::new(a.min(b), a.max(b));
            let ball = Ball::in_cube(&sphere_cube(&b));
            // The centre read back may be off by two roundings.
            let off = 2.0 * f64::from(ball.reach) * 2f64.powi(-24) + 2f64.powi(-148);
            let far = (0..8).map(|i| (b.corner(i) - b.centre()).as_dvec3().length());
            let reach = f64::from(ball.radius) * (1.0 + 1e-6) + 2.0 * off;
            prop_assert!(far.fold(0.0, f64::max) <= reach);
        }
    }
}
