//! Volumes that are nearly the same, such as two eyes': one view that stands for
//! all of them above the leaves. What it excludes none of them sees, and the
//! planes that it closes are closed for each.

use super::planes::planes_as_ever;
use super::{AsEver, View};
use crate::geometry::{Aabb, BoxBlock, ConvexVolume, LaneMask, MAX_PLANES, Plane, PlaneMask};
use crate::kernel::Isa;

/// Volumes with the same normals in the same order, between two of their kind:
/// each plane farthest out, and farthest in. For each volume, a block is decided
/// with its own bits: its sums are the same, and its `d` is between the two.
pub struct Shell {
    outer: ConvexVolume,
    /// `-d` of each plane farthest in.
    inner_least: [f32; MAX_PLANES],
}

/// Between the planes of volumes that are nearly the same, at most this part of
/// what is between the opposite planes of all of them.
const MOST_APART: f32 = 0.25;

impl Shell {
    /// `None` for fewer than two volumes, for others than described, and where
    /// they have too little in common for it to pay. O(volumes * planes).
    pub fn about<'v>(mut volumes: impl Iterator<Item = &'v ConvexVolume> + Clone) -> Option<Shell> {
        let first = volumes.next()?.planes();
        let moved = moved(first, volumes.clone())?;
        let facing = |i: usize, j: usize| face_each_other(&first[i], &first[j]);
        // Cascades have their sides in common, but nothing between near and far: seen
        // before anything is worked out, for they are many, and from the last planes
        // on, where a frustum has these two.
        let mut from_last = bits_from_last(moved).enumerate();
        if from_last.any(|(n, i)| bits_from_last(moved).skip(n + 1).any(|j| facing(i, j))) {
            return None;
        }
        let count = first.len();
        let (mut farthest_out, mut farthest_in) = ([0.0; MAX_PLANES], [0.0; MAX_PLANES]);
        for (i, plane) in first.iter().enumerate() {
            let all = volumes.clone().map(|volume| volume.planes()[i].d);
            (farthest_out[i], farthest_in[i]) = all.fold((plane.d, plane.d), |(out, inside), d| {
                (d.max(out), d.min(inside))
            });
        }
        let (out, inside) = (&farthest_out[..count], &farthest_in[..count]);
        let length = |i: usize| first[i].normal.length();
        let apart = (0..count).map(|i| (out[i] - inside[i]) / length(i));
        let apart = apart.fold(0.0, f32::max);
        let between = |(i, j)| inside[i] / length(i) + inside[j] / length(j);
        let pairs = (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j)));
        let mut facing = pairs.filter(|&(i, j)| facing(i, j));
        if !facing.all(|pair| apart <= MOST_APART * between(pair)) {
            return None;
        }
        let at = |(plane, d): (&Plane, &f32)| Plane::new(plane.normal, *d);
        let mut planes = [Plane::new(glam::Vec3::ZERO, 0.0); MAX_PLANES];
        for (place, plane) in planes.iter_mut().zip(first.iter().zip(out).map(at)) {
            *place = plane;
        }
        Some(Shell {
            outer: ConvexVolume::from_planes(&planes[..count]).ok()?,
            inner_least: farthest_in.map(|d| -d),
        })
    }
}

/// The planes whose `d` is not the same in all volumes; `None` if there is only
/// one volume, or one with other normals, or a plane without one.
fn moved<'v>(first: &[Plane], others: impl Iterator<Item = &'v ConvexVolume>) -> Option<PlaneMask> {
    let (mut moved, mut alone) = (0, true);
    for volume in others {
        alone = false;
        let planes = volume.planes();
        let same = |(a, b): (&Plane, &Plane)| a.normal == b.normal;
        if planes.len() != first.len() || !first.iter().zip(planes).all(same) {
            return None;
        }
        for (i, (a, b)) in first.iter().zip(planes).enumerate() {
            moved |= PlaneMask::from(a.d != b.d) << i;
        }
    }
    let normals = first.iter().all(|plane| plane.normal != glam::Vec3::ZERO);
    (!alone && normals).then_some(moved)
}

/// The bits that are set, highest first.
fn bits_from_last(mut mask: PlaneMask) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = mask.checked_ilog2()?;
        mask ^= 1 << bit;
        Some(bit as usize)
    })
}

/// Whether the inner sides of two planes face each other, or nearly so.
fn face_each_other(a: &Plane, b: &Plane) -> bool {
    let (dot, lengths) = (
        a.normal.dot(b.normal),
        a.normal.length_squared() * b.normal.length_squared(),
    );
    dot < 0.0 && dot * dot > 0.998 * lengths
}

impl View for Shell {
    planes_as_ever!();

    #[inline(always)]
    fn mask(&self) -> PlaneMask {
        self.outer.mask()
    }
    #[inline(always)]
    fn excludes(&self, plane: u32, bounds: &Aabb) -> bool {
        self.outer.excludes(plane, bounds)
    }
    #[inline(always)]
    fn contains(&self, plane: u32, bounds: &Aabb) -> bool {
        let normal = self.outer.plane_of_bit(plane).normal;
        let least = self.inner_least[plane as usize % MAX_PLANES];
        Plane::new(normal, -least).contains(bounds)
    }
    #[inline(always)]
    fn kept_lanes<I: Isa>(&self, isa: I, block: &BoxBlock, mask: PlaneMask) -> LaneMask {
        self.outer.kept_lanes(isa, block, mask)
    }
    #[inline(always)]
    fn sorted_lanes<I: Isa>(
        &self,
        isa: I,
        block: &BoxBlock,
        mask: PlaneMask,
    ) -> (LaneMask, I::Words) {
        block.sorted_by(isa, &self.outer, &self.inner_least, mask)
    }
}
