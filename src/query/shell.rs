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
    inner: ConvexVolume,
}

/// Between the planes of volumes that are nearly the same, at most this part of
/// what is between the opposite planes of all of them.
const MOST_APART: f32 = 0.25;

impl Shell {
    /// `None` for fewer than two volumes, for others than described, and where
    /// they have too little in common for it to pay. O(volumes * planes).
    pub fn about<'v>(mut volumes: impl Iterator<Item = &'v ConvexVolume>) -> Option<Shell> {
        let first = volumes.next()?.planes();
        let count = first.len();
        let mut outer = [Plane::new(glam::Vec3::ZERO, 0.0); MAX_PLANES];
        outer[..count].copy_from_slice(first);
        let mut inner = outer;
        let mut alone = true;
        for volume in volumes {
            if volume.planes().len() != count {
                return None;
            }
            for (i, plane) in volume.planes().iter().enumerate() {
                if plane.normal != outer[i].normal {
                    return None;
                }
                outer[i].d = outer[i].d.max(plane.d);
                inner[i].d = inner[i].d.min(plane.d);
            }
            alone = false;
        }
        let (outer, inner) = (&outer[..count], &inner[..count]);
        if alone || outer.iter().any(Plane::is_trivial) || !nearly_the_same(outer, inner) {
            return None;
        }
        Some(Shell {
            outer: ConvexVolume::from_planes(outer).ok()?,
            inner: ConvexVolume::from_planes(inner).ok()?,
        })
    }
}

fn nearly_the_same(outer: &[Plane], inner: &[Plane]) -> bool {
    let length = |plane: &Plane| plane.normal.length();
    let apart = |(out, inside): (&Plane, &Plane)| (out.d - inside.d) / length(out);
    let apart = outer.iter().zip(inner).map(apart).fold(0.0, f32::max);
    // Cascades have their sides in common, but nothing between near and far.
    let mut width = f32::INFINITY;
    for (i, a) in inner.iter().enumerate() {
        for b in &inner[i + 1..] {
            if a.normal.dot(b.normal) < -0.999 * length(a) * length(b) {
                width = width.min(a.d / length(a) + b.d / length(b));
            }
        }
    }
    apart <= MOST_APART * width
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
        self.inner.contains(plane, bounds)
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
        block.sorted_by(isa, &self.outer, &self.inner, mask)
    }
}
