//! Sixteen boxes side by side: the layout that leaves and scans test.
//!
//! Block kernels; each lane computes exactly what [`Plane::excludes`] computes for one box.

use glam::{Vec3, Vec4};

use super::aabb::held;
use super::{Aabb, BoxCorner, Plane, PlaneF64, SphereMargin};
use crate::kernel::{Isa, each, first_lanes, prefetch};

/// Boxes per block, and a mask with one bit per box.
pub use crate::kernel::{LANES, LaneMask};

/// Sixteen boxes as six rows: min x, y, z, then max x, y, z. 384 bytes.
///
/// Unused lanes hold the empty box; callers mask them out.
#[derive(Clone, Copy, PartialEq, Debug)]
#[repr(C, align(64))]
pub struct BoxBlock {
    rows: [[f32; LANES]; 6],
}

impl BoxBlock {
    /// The empty box in every lane.
    pub const EMPTY: BoxBlock = BoxBlock {
        rows: {
            let (low, high) = ([f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]);
            [low, low, low, high, high, high]
        },
    };

    /// Sets the box in a lane, 0 to 15.
    // Inlined: refits spend their time here.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, b: &Aabb) {
        let values = [b.min.x, b.min.y, b.min.z, b.max.x, b.max.y, b.max.z];
        for (row, value) in self.rows.iter_mut().zip(values) {
            row[lane] = value;
        }
    }

    /// The box in a lane, 0 to 15.
    #[inline(always)]
    pub fn get(&self, lane: usize) -> Aabb {
        let row = |k: usize| self.rows[k][lane];
        Aabb::new(each([0, 1, 2], row).into(), each([3, 4, 5], row).into())
    }

    /// The union of the boxes; empty ones ([`Aabb::EMPTY`]) add nothing.
    pub fn union(&self) -> Aabb {
        let low = |k: usize| halved(&self.rows[k], Vec4::min).min_element();
        let high = |k: usize| halved(&self.rows[k], Vec4::max).max_element();
        Aabb::new(each([0, 1, 2], low).into(), each([3, 4, 5], high).into())
    }

    /// The lane whose box is nearest to a point in the Manhattan distance.
    ///
    /// The first of several.
    pub fn nearest(&self, p: Vec3) -> usize {
        let larger = |a: f32, b: f32| if a > b { a } else { b };
        let mut away = [0.0; LANES];
        for axis in 0..3 {
            let (low, high) = (&self.rows[axis], &self.rows[axis + 3]);
            for lane in 0..LANES {
                let beyond = larger(low[lane] - p[axis], p[axis] - high[lane]);
                away[lane] += larger(beyond, 0.0);
            }
        }
        let least = halved(&away, Vec4::min).min_element();
        let mut nearest = [0; LANES];
        for lane in 0..LANES {
            nearest[lane] = if away[lane] == least {
                LANE_BITS[lane]
            } else {
                0
            };
        }
        (joined(&nearest).trailing_zeros() as usize).min(LANES - 1)
    }

    /// Prefetches the whole block.
    #[inline(always)]
    pub fn prefetch(&self) {
        self.rows.iter().for_each(prefetch);
    }

    /// Prefetches the rows of one corner.
    #[inline(always)]
    pub fn prefetch_corner(&self, corner: BoxCorner) {
        for row in corner.rows() {
            prefetch(&self.rows[row]);
        }
    }

    /// Minima by axis, then maxima.
    #[inline(always)]
    pub(crate) fn rows(&self) -> &[[f32; LANES]; 6] {
        &self.rows
    }

    /// The coordinates of the same corner of every box.
    #[inline(always)]
    pub(crate) fn corner_rows(&self, corner: BoxCorner) -> [&[f32; LANES]; 3] {
        let [x, y, z] = corner.rows();
        [&self.rows[x], &self.rows[y], &self.rows[z]]
    }

    /// The lanes that none of the f64 planes excludes.
    ///
    /// Bit for bit [`PlaneF64::excludes`], lane by lane.
    #[inline(always)]
    pub fn admitted_by_wide<'p>(
        &self,
        planes: impl Iterator<Item = (&'p PlaneF64, BoxCorner)>,
    ) -> LaneMask {
        let mut excluded = 0;
        for (plane, corner) in planes {
            let n = plane.normal;
            let [x, y, z] = self.corner_rows(corner);
            // As wide as the values: narrower ones would be packed for every plane.
            let mut below = [0_u64; LANES];
            for lane in 0..LANES {
                let [x, y, z] = each([x, y, z], |row| f64::from(row[lane]));
                let value = ((n.x * x + n.y * y) + n.z * z) + plane.d;
                below[lane] = if value < 0.0 { 1 << lane } else { 0 };
            }
            excluded |= below.iter().fold(0, |all, bit| all | bit);
        }
        !(excluded as LaneMask)
    }

    /// The lanes whose sphere none of the planes drops.
    ///
    /// Bit for bit [`Spheres::drops`](super::Spheres::drops), lane by lane.
    #[inline(always)]
    pub fn admitted_as_spheres<'p, I: Isa>(
        &self,
        isa: I,
        planes: impl Iterator<Item = (&'p Plane, BoxCorner, &'p SphereMargin)>,
    ) -> LaneMask {
        // `Ball::in_cube`, with the same roundings. No closures: one that is called twice is
        // compiled separately, without the instruction set.
        let mut centre = [isa.splat(0.0); 3];
        let mut radius = isa.splat(f32::INFINITY);
        let mut reach = isa.splat(f32::NEG_INFINITY);
        for (k, centre) in centre.iter_mut().enumerate() {
            let (low, high) = (isa.load(&self.rows[k]), isa.load(&self.rows[k + 3]));
            let (half_low, half_high) = (scaled(isa, 0.5, low), scaled(isa, 0.5, high));
            let middle = isa.add(half_low, half_high);
            *centre = isa.min(isa.max(middle, low), high);
            radius = isa.min(radius, isa.add(half_high, scaled(isa, -0.5, low)));
            reach = isa.max(reach, isa.max(scaled(isa, -1.0, low), high));
        }
        let [x, y, z] = centre;
        // Cubes clamped to the range of f32 have no sphere.
        let whole = !isa.at_most(isa.splat(f32::MAX), reach);
        let mut kept = LaneMask::MAX;
        for (plane, corner, margin) in planes {
            let n = plane.normal;
            let sum = isa.add(scaled(isa, n.x, x), scaled(isa, n.y, y));
            let sum = isa.add(sum, scaled(isa, n.z, z));
            let sum = isa.add(sum, isa.splat(margin.d));
            let sum = isa.add(sum, scaled(isa, margin.length, radius));
            let value = isa.add(sum, scaled(isa, margin.slope, reach));
            let is_number = isa.at_most(isa.splat(f32::MIN), value);
            let far = sums_at(isa, n, self.corner_rows(corner));
            let far = isa.add(far, isa.splat(plane.d));
            let beyond = !isa.not_below(value, 0.0) & is_number & whole;
            kept &= isa.not_below(far, 0.0) & !beyond;
        }
        kept
    }

    /// The boxes relative to `eye`: [`Aabb::relative_to`] lane by lane.
    #[inline(always)]
    pub fn relative_to(&self, eye: Vec3) -> BoxBlock {
        let mut moved = *self;
        for (k, row) in moved.rows.iter_mut().enumerate() {
            for x in row {
                *x = held(*x - eye[k % 3]);
            }
        }
        moved
    }

    /// The lanes whose closed box contains the point.
    #[inline(always)]
    pub fn holding(&self, p: Vec3) -> LaneMask {
        self.meeting(&Aabb::new(p, p))
    }

    /// The lanes whose closed box shares a point with `b`.
    #[inline(always)]
    pub fn meeting(&self, b: &Aabb) -> LaneMask {
        let [low_x, low_y, low_z, high_x, high_y, high_z] = &self.rows;
        let mut met = [0; LANES];
        for lane in 0..LANES {
            let x = (low_x[lane] <= b.max.x) & (b.min.x <= high_x[lane]);
            let y = (low_y[lane] <= b.max.y) & (b.min.y <= high_y[lane]);
            let z = (low_z[lane] <= b.max.z) & (b.min.z <= high_z[lane]);
            met[lane] = if x & y & z { LANE_BITS[lane] } else { 0 };
        }
        joined(&met)
    }
}

/// The minimum or maximum of every fourth lane.
///
/// Lane by lane would be a chain of fifteen comparisons.
#[inline(always)]
fn halved(row: &[f32; LANES], either: impl Fn(Vec4, Vec4) -> Vec4) -> Vec4 {
    let four = |i: usize| Vec4::new(row[i], row[i + 1], row[i + 2], row[i + 3]);
    either(either(four(0), four(4)), either(four(8), four(12)))
}

/// The bit of each lane, as wide as a float.
///
/// So the result of a comparison stays in vector registers.
const LANE_BITS: [u32; LANES] = {
    let mut bits = [0; LANES];
    let mut lane = 0;
    while lane < LANES {
        bits[lane] = 1 << lane;
        lane += 1;
    }
    bits
};

#[inline(always)]
fn scaled<I: Isa>(isa: I, x: f32, floats: I::Floats) -> I::Floats {
    isa.mul(isa.splat(x), floats)
}

/// [`Plane::value_at`] without `d` of sixteen corners, given as rows.
///
/// The part that planes with the same normal share.
#[inline(always)]
pub(super) fn sums_at<I: Isa>(isa: I, n: Vec3, [x, y, z]: [&[f32; LANES]; 3]) -> I::Floats {
    let sum = isa.add(scaled(isa, n.x, isa.load(x)), scaled(isa, n.y, isa.load(y)));
    isa.add(sum, scaled(isa, n.z, isa.load(z)))
}

#[inline(always)]
fn joined(bits: &[u32; LANES]) -> LaneMask {
    bits.iter().fold(0, |all, bit| all | bit) as LaneMask
}

/// Boxes in blocks, in the order in which they were pushed.
///
/// The last block is padded with empty boxes. 24 bytes per box.
#[derive(Clone, Default, Debug)]
pub struct BoxBlocks {
    blocks: Vec<BoxBlock>,
    count: usize,
}

impl<'b> FromIterator<&'b Aabb> for BoxBlocks {
    fn from_iter<I: IntoIterator<Item = &'b Aabb>>(boxes: I) -> Self {
        let boxes = boxes.into_iter();
        let mut blocks = BoxBlocks::with_capacity(boxes.size_hint().0);
        boxes.for_each(|b| blocks.push(b));
        blocks
    }
}

impl BoxBlocks {
    /// No boxes yet, with capacity for `boxes`.
    pub fn with_capacity(boxes: usize) -> Self {
        BoxBlocks {
            blocks: Vec::with_capacity(boxes.div_ceil(LANES)),
            count: 0,
        }
    }

    /// Appends a box in the next free lane.
    pub fn push(&mut self, b: &Aabb) {
        let lane = self.count % LANES;
        if lane == 0 {
            self.blocks.push(BoxBlock::EMPTY);
        }
        if let Some(block) = self.blocks.last_mut() {
            block.set(lane, b);
        }
        self.count += 1;
    }

    /// Number of boxes, without the lanes after the last one.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Returns whether there are no boxes.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The box at an index below their number.
    pub fn get(&self, place: usize) -> Aabb {
        self.blocks[place / LANES].get(place % LANES)
    }

    /// Replaces the box at an index below their number.
    #[inline(always)]
    pub fn set(&mut self, place: usize, b: &Aabb) {
        self.blocks[place / LANES].set(place % LANES, b);
    }

    /// Removes the last box, if there is one.
    pub fn pop(&mut self) {
        if let Some(last) = self.count.checked_sub(1) {
            self.set(last, &Aabb::EMPTY);
            self.count = last;
            self.blocks.truncate(last.div_ceil(LANES));
        }
    }

    /// Prefetches the block of a box, if there is such a box.
    #[inline(always)]
    pub fn prefetch(&self, place: usize) {
        if let Some(block) = self.blocks.get(place / LANES) {
            block.prefetch();
        }
    }

    /// Frees the capacity after the last block.
    pub fn shrink_to_fit(&mut self) {
        self.blocks.shrink_to_fit();
    }

    /// Heap bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.blocks[..])
    }

    /// Exclusive or over the bits of all bounds. O(n).
    ///
    /// Reads every byte and decides nothing: a floor for any program that reads them all.
    #[inline(always)]
    pub fn xor_of_bits(&self) -> u32 {
        let mut lanes = [0; LANES];
        for block in &self.blocks {
            // Hidden from the loop vectorizer, which with 512-bit vectors would take sixteen blocks
            // at a time and gather: seven times slower.
            let [a, b, c, d, e, f] = std::hint::black_box(&block.rows);
            for lane in 0..LANES {
                let bits = |row: &[f32; LANES]| row[lane].to_bits();
                // Combined within the block first: one step of the dependency chain per block.
                lanes[lane] ^= ((bits(a) ^ bits(b)) ^ (bits(c) ^ bits(d))) ^ (bits(e) ^ bits(f));
            }
        }
        lanes.iter().fold(0, |all, bits| all ^ bits)
    }

    /// All blocks; the last one may have empty lanes.
    #[inline(always)]
    pub fn blocks(&self) -> &[BoxBlock] {
        &self.blocks
    }

    /// The blocks that hold the boxes `first..end`.
    ///
    /// Each with the position of its lane 0 and its lanes within the range.
    #[inline(always)]
    pub fn range(
        &self,
        first: usize,
        end: usize,
    ) -> impl Iterator<Item = (usize, LaneMask, &BoxBlock)> {
        blocks_of(first, end).map(|(start, lanes)| (start, lanes, &self.blocks[start / LANES]))
    }
}

/// Blocks that hold the boxes `first..end`.
///
/// Yields the index of the box in lane 0 and the lanes within the range.
#[inline(always)]
pub fn blocks_of(first: usize, end: usize) -> impl Iterator<Item = (usize, LaneMask)> {
    let mut start = first - first % LANES;
    // The lanes from `first` on; only the first block starts within a block.
    let mut from = LaneMask::MAX << (first % LANES);
    std::iter::from_fn(move || {
        if start >= end {
            return None;
        }
        let block = (start, from & first_lanes(end - start));
        (start, from) = (start + LANES, LaneMask::MAX);
        Some(block)
    })
}

#[cfg(test)]
mod tests {
    use super::super::tests_arbitrary::{any_box, number};
    use super::super::{BroadcastPlanes, ConvexVolume, Planes};
    use super::*;
    use crate::kernel::Plain;
    use proptest::prelude::*;

    #[test]
    fn blocks_hold_their_places_and_no_others() {
        for (first, end) in (0..50).flat_map(|first| (first..60).map(move |end| (first, end))) {
            let of_block = |(start, lanes): (usize, LaneMask)| {
                assert!((lanes != 0 || first == end) && start.is_multiple_of(LANES));
                (start..start + LANES).filter(move |at| lanes >> (at - start) & 1 == 1)
            };
            let places = blocks_of(first, end).flat_map(of_block);
            assert!(places.eq(first..end), "{first}..{end}");
        }
    }

    proptest! {
        #[test]
        fn every_lane_is_the_scalar_test(
            boxes in prop::collection::vec(any_box(), 1..40),
            planes in prop::collection::vec(([number(), number(), number()], number()), 0..8),
            point in [number(), number(), number()],
        ) {
            let planes: Vec<Plane> =
                planes.into_iter().map(|(n, d)| Plane::new(Vec3::from_array(n), d)).collect();
            let volume = ConvexVolume::from_planes(&planes).unwrap();
            let point = Vec3::from_array(point);
            let mut blocks = BoxBlocks::with_capacity(boxes.len());
            boxes.iter().for_each(|b| blocks.push(b));
            let (first, end) = (boxes.len() / 3, boxes.len());
            let mut seen = 0;
            for (start, lanes, block) in blocks.range(first, end) {
                let admitted = block.admitted_by(Plain, &volume, volume.mask());
                let four = [*block; 4];
                let four = BoxBlock::four_admitted_by(Plain, &four, &volume, volume.mask());
                prop_assert_eq!(four, [admitted; 4]);
                let ready = BroadcastPlanes::new(Plain, &volume, volume.mask());
                prop_assert_eq!(ready.is_some(), volume.mask().count_ones() <= 6);
                if let Some(ready) = ready {
                    prop_assert_eq!(ready.kept(Plain, block), admitted);
                }
                for lane in (0..LANES).filter(|lane| lanes >> lane & 1 == 1) {
                    let b = &boxes[start + lane];
                    seen += 1;
                    prop_assert_eq!(&block.get(lane), b);
                    let scalar = !planes.iter().any(|p| p.excludes(b));
                    prop_assert_eq!(admitted >> lane & 1 == 1, scalar);
                    prop_assert_eq!(block.holding(point) >> lane & 1 == 1, b.contains_point(point));
                    prop_assert_eq!(block.meeting(&boxes[0]) >> lane & 1 == 1, b.intersects(&boxes[0]));
                }
            }
            prop_assert_eq!(seen, end - first);
        }

        #[test]
        fn the_xor_reads_every_bound(
            boxes in prop::collection::vec(any_box(), 1..40),
            place in 0..40usize,
            row in 0..6usize,
        ) {
            let mut blocks = BoxBlocks::default();
            boxes.iter().for_each(|b| blocks.push(b));
            let mut other = blocks.clone();
            let place = place % boxes.len();
            let bound = &mut other.blocks[place / LANES].rows[row][place % LANES];
            *bound = f32::from_bits(bound.to_bits() ^ 1 << 7);
            prop_assert_eq!(other.xor_of_bits() ^ blocks.xor_of_bits(), 1 << 7);
        }
    }
}
