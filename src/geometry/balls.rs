//! Bounding spheres in blocks of sixteen: centre and radius, 16 bytes per item.
//!
//! Four rows decide nearly every item by one sum per plane. Items within the rounding
//! errors of a plane get the test of [`Spheres::drops`], so the sets are the same.
//! Trees have nodes over spheres too. They leave radii out, so a plane is open for fewer nodes
//! than over cubes: it keeps all spheres of a node from where it touches the last one.

use glam::Vec3;

use super::box_block::sums_at;
use super::{Aabb, Ball, BoxBlock, LANES, LaneMask, PlaneMask, Spheres};
use crate::kernel::{Isa, prefetch};

/// Sixteen spheres as four rows: centre x, y, z, radius. 256 bytes.
#[derive(Clone, Copy, Default, Debug)]
#[repr(C, align(64))]
pub struct BallBlock {
    rows: [[f32; LANES]; 4],
}

/// Below 1 / sqrt(3): moved by it along all axes, no plane's value changes by 1.
const SHARE: f32 = 0.577;

/// Nodes over spheres, and the radii that they leave out.
pub type BallNodes<'t> = (&'t [[BoxBlock; 2]], [f32; 2]);

/// Spheres in blocks, in the order in which they were set.
#[derive(Clone, Default, Debug)]
pub struct BallBlocks {
    blocks: Vec<BallBlock>,
    /// Sixteen nodes each, 768 bytes.
    ///
    /// At the corner farthest along a plane's normal, the second block bounds the values of all
    /// spheres of a node from above, the first one from below.
    nodes: Vec<[BoxBlock; 2]>,
    /// Radii that the blocks of nodes leave out.
    radii: [f32; 2],
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
            ..BallBlocks::default()
        };
        cubes.enumerate().for_each(|(at, cube)| all.set(at, &cube));
        all
    }

    /// The same with nodes above, level by level. O(cubes).
    ///
    /// The value of a sphere's farthest point is that of its centre and the radius. Blocks of
    /// nodes leave out a radius that all of them share: the least one, for the bounds from below,
    /// and one that few exceed, for those from above. For what a radius is larger, its centre
    /// moves outward along all axes, which is enough, or by [`SHARE`] of it, which is not too
    /// much.
    pub fn tree_of(cubes: impl ExactSizeIterator<Item = Aabb> + Clone) -> BallBlocks {
        let balls = || cubes.clone().map(|cube| Ball::in_cube(&cube));
        let mut all = BallBlocks::of(cubes.clone());
        let mut radii = Vec::from_iter(balls().map(|b| b.radius).chain([f32::MAX]));
        let most = (radii.len() - 1) * 31 / 32;
        let (below, typical, _) = radii.select_nth_unstable_by(most, f32::total_cmp);
        all.radii = [below.iter().copied().fold(f32::MAX, f32::min), *typical];
        let around = |b: Ball| {
            let [near, far] = all.radii.map(|radius| b.radius - radius);
            [-SHARE * near, far.max(SHARE * far)].map(|by| Aabb::around(b.centre, Vec3::splat(by)))
        };
        let mut bounds: Vec<[Aabb; 2]> = balls().map(around).collect();
        while bounds.len() > LANES {
            let join = |[a, b]: [Aabb; 2], [c, d]: [Aabb; 2]| [a.union(&c), b.union(&d)];
            let united = |some: &[_]| some.iter().copied().reduce(join);
            bounds = bounds.chunks(LANES).filter_map(united).collect();
            for some in bounds.chunks(LANES) {
                let mut nodes = [BoxBlock::EMPTY; 2];
                for (lane, [near, far]) in some.iter().enumerate() {
                    // So that the farthest corner's rows hold the nearest one.
                    nodes[0].set(lane, &Aabb::new(near.max, near.min));
                    nodes[1].set(lane, far);
                }
                all.nodes.push(nodes);
            }
        }
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

    /// The nodes from an index on, and the radii that they leave out.
    #[inline(always)]
    pub fn nodes_from(&self, first: usize) -> BallNodes<'_> {
        (&self.nodes[first..], self.radii)
    }

    /// Heap bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.blocks[..]) + size_of_val(&self.nodes[..])
    }
}

/// A plane of length 1 in vectors: normal and offset.
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

/// The lanes whose distance is not below the least.
///
/// No closure: one that is called twice is compiled apart, without the instruction set.
#[inline(always)]
fn above<I: Isa>(isa: I, distances: I::Floats, least: f32) -> LaneMask {
    isa.kept(isa.keep(isa.keep_all(), distances, isa.splat(least)))
}

/// The lanes that are kept, by the distances of their farthest points.
#[inline(always)]
pub(super) fn decide<'s, I: Isa>(
    isa: I,
    farthest: I::Floats,
    doubt: f32,
    question: impl FnOnce() -> (&'s Spheres, PlaneMask, &'s BoxBlock),
) -> LaneMask {
    let possible = above(isa, farthest, -doubt);
    let sure = above(isa, farthest, doubt);
    if possible == sure {
        return sure;
    }
    let (spheres, mask, block) = question();
    sure | spheres.settled(block, mask, possible & !sure)
}

impl Balls<'_> {
    #[inline(always)]
    pub(super) fn load<I: Isa>(&self, isa: I, at: usize) -> ([I::Floats; 3], I::Floats) {
        let [x, y, z, radius] = &self.blocks[at].rows;
        ([isa.load(x), isa.load(y), isa.load(z)], isa.load(radius))
    }
}

impl Spheres {
    /// Distance from any plane up to which a sum decides nothing.
    ///
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

    /// The lanes of a block of nodes whose spheres no plane is sure to drop all.
    ///
    /// For each of them, the planes of the mask that may drop one.
    ///
    /// Answers have the same order on all instruction sets: no fused sums.
    #[inline(always)]
    pub fn sorted_nodes<I: Isa>(
        &self,
        isa: I,
        (nodes, [least, typical]): BallNodes,
        (at, doubt): (usize, f32),
        mask: PlaneMask,
    ) -> (LaneMask, I::Words) {
        let [near, far] = &nodes[at];
        let (mut kept, mut open) = (isa.keep_all(), isa.splat_word(mask));
        let mut left = mask;
        while left != 0 {
            let bit = left.trailing_zeros();
            left &= left - 1;
            let [x, y, z, d] = self.plane_of_bit(bit).1.unit;
            let (normal, corner) = (Vec3::new(x, y, z), self.planes().p_vertex_of_bit(bit));
            let sums = sums_at(isa, normal, far.corner_rows(corner));
            kept = isa.keep(kept, sums, isa.splat(-doubt - d - typical));
            let sums = sums_at(isa, normal, near.corner_rows(corner));
            open = isa.without(open, sums, isa.splat(doubt - d - least), 1 << bit);
        }
        (isa.kept(kept), open)
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
    use crate::geometry::{BallFrustum, ConvexVolume, Plane, Planes, sphere_cube};
    use crate::kernel::{Kernel, Plain, Work};
    use glam::{EulerRot, Quat};
    use proptest::prelude::*;

    fn bits(lanes: impl Iterator<Item = bool>) -> LaneMask {
        lanes.fold(0, |all, lane| {
            all >> 1 | LaneMask::from(lane) << (LANES - 1)
        })
    }

    /// Lanes by single planes, and by the frustum of all six.
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
    /// `None` where sums over spheres would overflow, else true for a frustum's planes.
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

    /// Planes through spheres' farthest points, but for a few roundings, or free.
    fn touching(normals: &[(Vec3, f32, i32)], boxes: &[Aabb]) -> Vec<Plane> {
        let through = |((normal, d, ulps), b): (&(Vec3, f32, i32), &Aabb)| {
            let ball = Ball::in_cube(b);
            let far = normal.dot(ball.centre) + ball.radius * normal.length();
            let touches = f32::from_bits((-far).to_bits().saturating_add_signed(*ulps));
            let free = *ulps % 3 == 0 || !touches.is_finite();
            Plane::new(*normal, if free { *d } else { touches })
        };
        normals.iter().zip(boxes).map(through).collect()
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
            check(&boxes, &touching(&normals, &boxes), mask);
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
            // Each sphere touches a plane but for some roundings.
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

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]

        #[test]
        fn no_node_contradicts_its_spheres(
            boxes in prop::collection::vec(any_box(), 17..400),
            normals in prop::collection::vec((vector(), number(), -40i32..40), 1..8),
        ) {
            let mut cubes: Vec<Aabb> = boxes.iter().map(sphere_cube).collect();
            cubes.retain(|b| !b.is_empty() && b.is_finite() && Ball::in_cube(b).reach < 1e6);
            cubes.sort_by(|a, b| a.min.x.total_cmp(&b.min.x));
            let planes: Vec<Plane> = touching(&normals, &cubes);
            let spheres = Spheres::new(&ConvexVolume::from_planes(&planes).unwrap());
            let all = BallBlocks::tree_of(cubes.iter().copied());
            let Some(Balls { doubt, .. }) = all.seen_by(&spheres) else { return Ok(()) };
            let nodes = all.nodes_from(0);
            let leaves = cubes.len().div_ceil(LANES);
            for (first, span) in [(0, LANES), (leaves.div_ceil(LANES), LANES * LANES)] {
                for (node, below) in cubes.chunks(span).enumerate() {
                    let (at, lane) = (first + node / LANES, node % LANES);
                    if at >= nodes.0.len() {
                        continue;
                    }
                    for plane in (0..32).filter(|i| spheres.planes().mask() >> i & 1 == 1) {
                        let (kept, open) = spheres.sorted_nodes(Plain, nodes, (at, doubt), 1 << plane);
                        let drops = below.iter().filter(|b| spheres.drops(plane, b)).count();
                        if kept >> lane & 1 == 0 {
                            prop_assert_eq!(drops, below.len(), "dropped by {:?}", planes);
                        } else if open[lane] == 0 {
                            prop_assert_eq!(drops, 0, "inside of {:?}", planes);
                        }
                    }
                }
            }
        }
    }
}
