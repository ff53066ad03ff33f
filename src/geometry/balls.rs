//! Spheres of items in blocks of sixteen: centre and radius, 16 bytes an item.
//!
//! Four rows decide nearly every item by one sum per plane. Items within the rounding
//! errors of a plane get the test of [`Spheres::drops`], so the sets are the same.

use super::{Aabb, Ball, BoxBlock, LANES, LaneMask, PlaneMask, Spheres};
use crate::kernel::{Isa, prefetch};

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
    /// No coordinate of any item is larger.
    reach: f32,
}

/// The spheres of a structure with the doubt of one query about them.
#[derive(Clone, Copy, Debug)]
pub struct Balls<'t> {
    /// Sixteen spheres each.
    pub blocks: &'t [BallBlock],
    /// Distances from a plane up to which a sum decides nothing: [`Spheres::doubt`].
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
            blocks: vec![BallBlock::default(); cubes.len().div_ceil(LANES)],
            reach: 0.0,
        };
        cubes.enumerate().for_each(|(at, cube)| all.set(at, &cube));
        all
    }

    /// Replaces the sphere at an index below the number of spheres.
    pub fn set(&mut self, at: usize, cube: &Aabb) {
        let ball = Ball::in_cube(cube);
        let values = ball.centre.to_array().into_iter().chain([ball.radius]);
        let rows = &mut self.blocks[at / LANES].rows;
        for (row, value) in rows.iter_mut().zip(values) {
            row[at % LANES] = value;
        }
        self.reach = self.reach.max(ball.reach);
    }

    /// The blocks for a query; `None` where its numbers overflow.
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

/// A plane of length 1 in vectors: normal and offset.
type Unit<I> = [<I as Isa>::Floats; 4];

/// Planes of a sphere test in vectors, for many blocks; the first one comes again where
/// there are fewer than `N`.
#[derive(Clone, Copy)]
pub struct BallPlanes<'a, I: Isa, const N: usize> {
    spheres: &'a Spheres,
    mask: PlaneMask,
    planes: [Unit<I>; N],
}

#[inline(always)]
fn unit<I: Isa>(isa: I, spheres: &Spheres, plane: u32) -> Unit<I> {
    let [x, y, z, d] = spheres.plane_of_bit(plane).1.unit;
    [isa.splat(x), isa.splat(y), isa.splat(z), isa.splat(d)]
}

/// The distances of centres from a plane.
#[inline(always)]
fn distances<I: Isa>(isa: I, [a, b, c, d]: Unit<I>, [x, y, z]: [I::Floats; 3]) -> I::Floats {
    let sum = isa.add(isa.mul(a, x), isa.mul(b, y));
    isa.add(isa.add(sum, isa.mul(c, z)), d)
}

impl<'a, I: Isa, const N: usize> BallPlanes<'a, I, N> {
    /// The planes of a mask; `None` if it has none, or more than `N`.
    #[inline(always)]
    pub fn new(isa: I, spheres: &'a Spheres, mask: PlaneMask) -> Option<Self> {
        if mask == 0 || mask.count_ones() as usize > N {
            return None;
        }
        let mut planes = [unit(isa, spheres, mask.trailing_zeros()); N];
        let mut left = mask;
        for plane in &mut planes {
            if left != 0 {
                *plane = unit(isa, spheres, left.trailing_zeros());
                left &= left - 1;
            }
        }
        Some(BallPlanes {
            spheres,
            mask,
            planes,
        })
    }

    /// The sphere test from bounds alone.
    #[inline(always)]
    pub fn kept_boxes(&self, isa: I, block: &BoxBlock) -> LaneMask {
        self.spheres.kept_boxes(isa, block, self.mask)
    }

    /// [`Spheres::kept_balls`].
    #[inline(always)]
    pub fn kept(&self, isa: I, balls: &Balls, (at, block): (usize, &BoxBlock)) -> LaneMask {
        let (centres, radii) = balls.load(isa, at);
        let mut least = distances(isa, self.planes[0], centres);
        for &plane in &self.planes[1..] {
            least = isa.min(distances(isa, plane, centres), least);
        }
        balls.decide(isa, isa.add(least, radii), || {
            (self.spheres, self.mask, block)
        })
    }
}

impl<'a, I: Isa> BallPlanes<'a, I, 1> {
    /// The plane of that bit.
    #[inline(always)]
    pub fn one(isa: I, spheres: &'a Spheres, plane: u32) -> Self {
        BallPlanes {
            spheres,
            mask: 1 << plane,
            planes: [unit(isa, spheres, plane)],
        }
    }
}

impl Balls<'_> {
    #[inline(always)]
    fn load<I: Isa>(&self, isa: I, at: usize) -> ([I::Floats; 3], I::Floats) {
        let [x, y, z, radius] = &self.blocks[at].rows;
        ([isa.load(x), isa.load(y), isa.load(z)], isa.load(radius))
    }

    /// The lanes that are kept, by the distances of their farthest points.
    #[inline(always)]
    fn decide<'s, I: Isa>(
        &self,
        isa: I,
        farthest: I::Floats,
        question: impl FnOnce() -> (&'s Spheres, PlaneMask, &'s BoxBlock),
    ) -> LaneMask {
        let above = |least: f32| isa.kept(isa.keep(isa.keep_all(), farthest, isa.splat(least)));
        let (possible, sure) = (above(-self.doubt), above(self.doubt));
        if possible == sure {
            return sure;
        }
        let (spheres, mask, block) = question();
        sure | spheres.settled(block, mask, possible & !sure)
    }
}

impl Spheres {
    /// Distance from any plane up to which a sum over centre and radius decides nothing;
    /// `None` where numbers overflow. `reach` bounds all coordinates of the items.
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
        if mask == 0 {
            return LaneMask::MAX;
        }
        let (centres, radii) = balls.load(isa, at);
        let of = |plane: u32| distances(isa, unit(isa, self, plane), centres);
        let mut least = of(mask.trailing_zeros());
        let mut left = mask & (mask - 1);
        while left != 0 {
            least = isa.min(of(left.trailing_zeros()), least);
            left &= left - 1;
        }
        balls.decide(isa, isa.add(least, radii), || (self, mask, block))
    }

    /// Those of the lanes that no plane of the mask drops, one by one.
    #[cold]
    #[inline(never)]
    fn settled(&self, block: &BoxBlock, mask: PlaneMask, lanes: LaneMask) -> LaneMask {
        let keeps = |lane: usize| {
            let cube = block.get(lane);
            lanes >> lane & 1 == 1 && !(0..32).any(|i| mask >> i & 1 == 1 && self.drops(i, &cube))
        };
        (0..LANES).fold(0, |kept, lane| kept | LaneMask::from(keeps(lane)) << lane)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::arbitrary::{any_box, number, vector};
    use crate::geometry::{ConvexVolume, Plane, sphere_cube};
    use crate::kernel::{BASELINE, Plain};
    use glam::Vec3;
    use proptest::prelude::*;

    fn bits(lanes: impl Iterator<Item = bool>) -> LaneMask {
        lanes.fold(0, |all, lane| {
            all >> 1 | LaneMask::from(lane) << (LANES - 1)
        })
    }

    /// Compares blocks of spheres and blocks of bounds with the scalar test; `None` where
    /// sums over spheres would overflow.
    fn check(boxes: &[Aabb; LANES], planes: &[Plane], mask: PlaneMask) -> Option<()> {
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
        assert_eq!(
            spheres.kept_boxes(BASELINE, &block, mask),
            wanted,
            "{boxes:?}"
        );
        assert_eq!(spheres.kept_boxes(Plain, &block, mask), wanted, "{boxes:?}");
        let balls = all.seen_by(&spheres)?;
        let found = spheres.kept_balls(BASELINE, &balls, (0, &block), mask);
        assert_eq!(found, wanted, "{boxes:?} {planes:?}");
        if let Some(planes) = BallPlanes::<_, 6>::new(Plain, &spheres, mask) {
            assert_eq!(planes.kept(Plain, &balls, (0, &block)), wanted, "{boxes:?}");
        }
        Some(())
    }

    #[test]
    fn the_end_of_f32_is_left_to_the_bounds() {
        let far = Aabb::around(Vec3::splat(1e38), Vec3::splat(1e38));
        let plane = [Plane::new(Vec3::X, -1.0)];
        assert_eq!(check(&[far; LANES], &plane, 1), None);
        assert_eq!(
            check(&[Aabb::around(Vec3::ONE, Vec3::ONE); LANES], &plane, 1),
            Some(())
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
                // Through the sphere's farthest point, but for a few roundings.
                let ball = Ball::in_cube(b);
                let far = normal.dot(ball.centre) + ball.radius * normal.length();
                let touches = f32::from_bits((-far).to_bits().saturating_add_signed(*ulps));
                Plane::new(*normal, if *ulps % 3 == 0 || !touches.is_finite() { *d } else { touches })
            });
            check(&boxes, &touching.collect::<Vec<_>>(), mask);
        }
    }
}
