//! Bounding spheres in blocks of sixteen: centre and radius, 16 bytes per item.
//!
//! Four rows decide nearly every item with one sum per plane. Items within the rounding errors of a
//! plane get the test of [`Spheres::drops`], so the sets are the same.

use std::hint::cold_path;

use super::{Aabb, Ball, BoxBlock, LANES, LaneMask, PlaneMask, Spheres};
use crate::kernel::{Isa, Piece, prefetch};

/// Sixteen spheres as four rows: centre x, y, z, radius. 256 bytes.
#[derive(Clone, Copy, Default, Debug)]
#[repr(C, align(64))]
pub struct BallBlock {
    rows: [[f32; LANES]; 4],
}

/// Spheres in blocks, in the order in which they were set.
#[derive(Clone, Default, Debug)]
pub struct BallBlocks {
    blocks: Vec<BallBlock>,
    /// Upper bound of all absolute coordinates of items. Setting a sphere enlarges it.
    pub reach: f32,
}

/// The spheres of a structure with the error bound of one query.
#[derive(Clone, Copy, Debug)]
pub struct Balls<'t> {
    /// Blocks of sixteen spheres.
    pub blocks: &'t [BallBlock],
    /// Distance from a plane up to which a sum is undecided: [`Spheres::doubt`].
    pub doubt: f32,
}

impl BallBlock {
    /// Prefetches the block.
    #[inline(always)]
    pub fn prefetch(&self) {
        self.rows.iter().for_each(prefetch);
    }
}

impl BallBlocks {
    /// The spheres in cubes, one after another. O(cubes).
    pub fn of(cubes: impl ExactSizeIterator<Item = Aabb>) -> BallBlocks {
        let mut all = BallBlocks {
            blocks: Vec::with_capacity(cubes.len().div_ceil(LANES)),
            reach: 0.0,
        };
        cubes.enumerate().for_each(|(at, cube)| all.set(at, &cube));
        all
    }

    /// Sets the sphere at an index, which may be beyond the last one.
    #[inline(always)]
    pub fn set(&mut self, at: usize, cube: &Aabb) {
        let ball = Ball::in_cube(cube);
        let values = ball.centre.to_array().into_iter().chain([ball.radius]);
        if at / LANES >= self.blocks.len() {
            self.blocks.resize(at / LANES + 1, BallBlock::default());
        }
        let rows = &mut self.blocks[at / LANES].rows;
        for (row, value) in rows.iter_mut().zip(values) {
            row[at % LANES] = value;
        }
        self.reach = self.reach.max(ball.reach);
    }

    /// The blocks for a query; `None` if its numbers overflow.
    #[inline(always)]
    pub fn seen_by(&self, spheres: &Spheres) -> Option<Balls<'_>> {
        let doubt = spheres.doubt(self.reach)?;
        let blocks = &self.blocks[..];
        Some(Balls { blocks, doubt })
    }

    /// Heap bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.blocks[..])
    }
}

/// A plane with a unit normal, in vectors: normal and offset.
pub(super) type Unit<I> = [<I as Isa>::Floats; 4];

#[inline(always)]
pub(super) fn splat<I: Isa>(isa: I, [x, y, z, d]: [f32; 4]) -> Unit<I> {
    [isa.splat(x), isa.splat(y), isa.splat(z), isa.splat(d)]
}

/// The distances of centres from a plane.
#[inline(always)]
pub(super) fn distances<I: Isa>(
    isa: I,
    [a, b, c, d]: Unit<I>,
    [x, y, z]: [I::Floats; 3],
) -> I::Floats {
    let sum = isa.near_mul_add(b, y, isa.near_mul_add(a, x, d));
    isa.near_mul_add(c, z, sum)
}

/// The kept lanes, from the distances of the farthest points of their spheres.
#[inline(always)]
pub(super) fn decide<'s, I: Isa>(
    isa: I,
    farthest: I::Floats,
    doubt: f32,
    question: impl FnOnce() -> (&'s Spheres, PlaneMask, &'s BoxBlock),
) -> LaneMask {
    let possible = isa.not_below(farthest, -doubt);
    let sure = isa.not_below(farthest, doubt);
    if possible == sure {
        return sure;
    }
    cold_path();
    let (spheres, mask, block) = question();
    sure | possible & settled(isa, Doubtful(spheres, mask, block))
}

impl Balls<'_> {
    #[inline(always)]
    pub(super) fn load<I: Isa>(&self, isa: I, at: usize) -> ([I::Floats; 3], I::Floats) {
        let [x, y, z, radius] = &self.blocks[at].rows;
        ([isa.load(x), isa.load(y), isa.load(z)], isa.load(radius))
    }
}

impl Spheres {
    /// Distance from any plane up to which a sum is undecided.
    ///
    /// `None` if numbers overflow. `reach` bounds all coordinates of the items.
    #[inline(always)]
    pub fn doubt(&self, reach: f32) -> Option<f32> {
        let mut doubt = 0.0;
        let mut left = self.planes().mask();
        while left != 0 {
            let (_, margin) = self.plane_of_bit(left.trailing_zeros());
            let [slope, rest, most] = margin.doubt;
            if reach > most {
                return None;
            }
            let own = slope * reach + rest;
            doubt = if own > doubt { own } else { doubt };
            left &= left - 1;
        }
        Some(doubt)
    }

    /// The lanes that no plane of the mask drops: bit for bit [`Spheres::drops`].
    #[inline(always)]
    pub fn kept_boxes<I: Isa>(&self, isa: I, block: &BoxBlock, mask: PlaneMask) -> LaneMask {
        let mut left = mask;
        let planes = std::iter::from_fn(|| {
            let index = left.checked_ilog2()?;
            left &= !(1 << index);
            let (plane, margin) = self.plane_of_bit(index);
            Some((plane, self.planes().p_vertex_of_bit(index), margin))
        });
        block.admitted_as_spheres(isa, planes)
    }

    /// [`Spheres::kept_boxes`] from spheres in blocks.
    #[inline(always)]
    pub fn kept_balls<I: Isa>(
        &self,
        isa: I,
        balls: &Balls,
        (at, block): (usize, &BoxBlock),
        mask: PlaneMask,
    ) -> LaneMask {
        let (centres, radii) = balls.load(isa, at);
        let mut least = isa.splat(f32::MAX);
        let mut left = mask;
        while left != 0 {
            let plane = splat(isa, self.plane_of_bit(left.trailing_zeros()).1.unit);
            least = isa.min(distances(isa, plane, centres), least);
            left &= left - 1;
        }
        decide(isa, isa.add(least, radii), balls.doubt, || {
            (self, mask, block)
        })
    }
}

/// Boxes that their spheres leave undecided; many if planes or items are far away.
///
/// Tested in vectors, in a separate function: inlined, it may make a loop keep its planes in
/// memory.
struct Doubtful<'s>(&'s Spheres, PlaneMask, &'s BoxBlock);

impl<I: Isa> Piece<I> for Doubtful<'_> {
    type Output = LaneMask;

    #[inline(always)]
    fn run(self, isa: I) -> LaneMask {
        let Doubtful(spheres, mask, block) = self;
        spheres.kept_boxes(isa, block, mask)
    }
}

#[cold]
#[inline(never)]
fn settled<I: Isa>(isa: I, doubtful: Doubtful) -> LaneMask {
    isa.run_outlined(doubtful)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::tests_arbitrary::{any_box, number, vector};
    use crate::geometry::{BallFrustum, ConvexVolume, Plane, Planes, sphere_cube};
    use crate::kernel::{Kernel, Plain, Work};
    use glam::{EulerRot, Quat, Vec3};
    use proptest::prelude::*;

    fn bits(lanes: impl Iterator<Item = bool>) -> LaneMask {
        lanes.fold(0, |all, lane| {
            all >> 1 | LaneMask::from(lane) << (LANES - 1)
        })
    }

    /// Lanes from single planes, and from the frustum of all six.
    struct KeptBalls<'a> {
        spheres: &'a Spheres,
        balls: &'a Balls<'a>,
        block: (usize, &'a BoxBlock),
        mask: PlaneMask,
    }

    impl Work for KeptBalls<'_> {
        type Output = [LaneMask; 2];

        fn run<I: Isa>(self, isa: I) -> [LaneMask; 2] {
            let (balls, block) = (self.balls, self.block);
            let kept = self.spheres.kept_balls(isa, balls, block, self.mask);
            let frustum = BallFrustum::new(isa, self.spheres).filter(|_| self.mask == 0b11_1111);
            [
                kept,
                frustum.map_or(kept, |frustum| frustum.kept_balls(isa, balls, block)),
            ]
        }
    }

    /// Compares blocks of spheres and blocks of bounds with the scalar test.
    ///
    /// `None` if sums over spheres would overflow, else true for a frustum's planes.
    fn check(boxes: &[Aabb; LANES], planes: &[Plane], mask: PlaneMask) -> Option<bool> {
        let spheres = Spheres::new(&ConvexVolume::from_planes(planes).unwrap());
        let mask = mask & spheres.planes().mask();
        let all = BallBlocks::of(boxes.iter().copied());
        let mut block = BoxBlock::EMPTY;
        boxes
            .iter()
            .enumerate()
            .for_each(|(lane, b)| block.set(lane, b));
        let kept = |b: &Aabb| !(0..32).any(|i| mask >> i & 1 == 1 && spheres.drops(i, b));
        let wanted = bits(boxes.iter().map(kept));
        assert_eq!(spheres.kept_boxes(Plain, &block, mask), wanted, "{boxes:?}");
        let balls = all.seen_by(&spheres)?;
        for kernel in Kernel::available() {
            let (balls, block) = (&balls, (0, &block));
            let found = kernel.run(KeptBalls {
                spheres: &spheres,
                balls,
                block,
                mask,
            });
            assert_eq!(found, [wanted; 2], "{kernel}: {boxes:?} {planes:?}");
        }
        let frustum = BallFrustum::new(Plain, &spheres).filter(|_| mask == 0b11_1111);
        Some(frustum.is_some())
    }

    #[test]
    fn the_end_of_f32_is_left_to_the_bounds() {
        let far = Aabb::around(Vec3::splat(1e38), Vec3::splat(1e38));
        let plane = [Plane::new(Vec3::X, -1.0)];
        assert_eq!(check(&[far; LANES], &plane, 1), None);
        assert_eq!(
            check(&[Aabb::around(Vec3::ONE, Vec3::ONE); LANES], &plane, 1),
            Some(false)
        );
        let endless = [Plane::new(Vec3::ZERO, -1.0)];
        assert_eq!(check(&[Aabb::EMPTY; LANES], &endless, 1), None);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        #[test]
        fn blocks_of_spheres_decide_as_the_scalar_test(
            boxes in prop::collection::vec(any_box(), LANES),
            normals in prop::collection::vec((vector(), number(), -40i32..40), 1..8),
            mask: PlaneMask,
            as_cubes: bool,
        ) {
            let boxes: [Aabb; LANES] = boxes.try_into().unwrap();
            let boxes = if as_cubes { boxes.map(|b| sphere_cube(&b)) } else { boxes };
            prop_assume!(boxes.iter().all(|b| !b.is_empty() && b.is_finite()));
            let touching = normals.iter().zip(&boxes).map(|((normal, d, ulps), b)| {
                // Through the sphere's farthest point, up to a few roundings.
                let ball = Ball::in_cube(b);
                let far = normal.dot(ball.centre) + ball.radius * normal.length();
                let touches = f32::from_bits((-far).to_bits().saturating_add_signed(*ulps));
                Plane::new(*normal, if *ulps % 3 == 0 || !touches.is_finite() { *d } else { touches })
            });
            check(&boxes, &touching.collect::<Vec<_>>(), mask);
        }

        #[test]
        fn three_sums_decide_as_six(
            turn in prop::array::uniform3(-3f32..3.0),
            eye in prop::array::uniform3(-1e3f32..1e3),
            fov in prop::array::uniform2(0.1f32..1.5),
            scale in -10i32..10,
            spheres in prop::collection::vec(
                (prop::array::uniform3(-1f32..1.0), 0f32..0.2, -2e-6f32..2e-6), LANES),
        ) {
            let scale = 4f32.powi(scale);
            let turn = Quat::from_euler(EulerRot::XYZ, turn[0], turn[1], turn[2]);
            let [u, v, w] = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| turn * axis);
            let eye = Vec3::from_array(eye) * scale;
            let through = |n: Vec3, p: Vec3| Plane::new(n, -n.dot(p));
            let sides = [(u, fov[0]), (-u, fov[0]), (v, fov[1]), (-v, fov[1])];
            let planes = sides.map(|(n, angle)| {
                through(n * angle.cos() + w * angle.sin(), eye)
            });
            let [near, far] = [1.0, 300.0].map(|distance| eye + w * distance * scale);
            let planes = [&planes[..], &[through(w, near), through(-w, far)]].concat();
            // Each sphere touches a plane, up to some roundings.
            let boxes = spheres.iter().enumerate().map(|(lane, (at, size, off))| {
                let at = eye + Vec3::from_array(*at) * 400.0 * scale;
                let cube = sphere_cube(&Aabb::around(at, Vec3::splat(size * 100.0 * scale)));
                let (plane, ball) = (planes[lane % 6], Ball::in_cube(&cube));
                let by = plane.value_at(ball.centre) + ball.radius + off * ball.reach;
                let by = plane.normal * -by;
                Aabb::new(cube.min + by, cube.max + by)
            });
            let boxes: Vec<Aabb> = boxes.collect();
            let is_frustum = check(&boxes.try_into().unwrap(), &planes, 0b11_1111);
            prop_assert_eq!(is_frustum, Some(true));
        }
    }
}
