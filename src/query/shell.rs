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
    pub fn about<'v>(mut volumes: impl Iterator<Item = &'v ConvexVolume>) -> Option<Shell> {
        let first = volumes.next()?.planes();
        let count = first.len();
        let (mut farthest_out, mut farthest_in) = ([0.0; MAX_PLANES], [0.0; MAX_PLANES]);
        for (plane, d) in first.iter().zip(&mut farthest_out) {
            *d = plane.d;
        }
        farthest_in[..count].copy_from_slice(&farthest_out[..count]);
        let mut alone = true;
        for volume in volumes {
            if volume.planes().len() != count {
                return None;
            }
            for (i, plane) in volume.planes().iter().enumerate() {
                if plane.normal != first[i].normal {
                    return None;
                }
                farthest_out[i] = plane.d.max(farthest_out[i]);
                farthest_in[i] = plane.d.min(farthest_in[i]);
            }
            alone = false;
        }
        let (out, inside) = (&farthest_out[..count], &farthest_in[..count]);
        let without_normal = |plane: &Plane| plane.normal == glam::Vec3::ZERO;
        if alone || first.iter().any(without_normal) || !nearly_the_same(first, out, inside) {
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

/// Whether planes of such normals, farthest out and farthest in, have nearly
/// everything between them in common.
fn nearly_the_same(normals: &[Plane], out: &[f32], inside: &[f32]) -> bool {
    let opposite = |a: &Plane, b: &Plane| {
        let (dot, lengths) = (
            a.normal.dot(b.normal),
            a.normal.length_squared() * b.normal.length_squared(),
        );
        dot < 0.0 && dot * dot > 0.998 * lengths
    };
    // Cascades have their sides in common, but nothing between near and far:
    // seen before anything is worked out, for they are many.
    let moved = || (0..normals.len()).filter(|&i| out[i] > inside[i]);
    if moved().any(|i| moved().any(|j| opposite(&normals[i], &normals[j]))) {
        return false;
    }
    let length = |i: usize| normals[i].normal.length();
    let apart = moved().map(|i| (out[i] - inside[i]) / length(i));
    let apart = apart.fold(0.0, f32::max);
    (0..normals.len()).all(|i| {
        (i + 1..normals.len())
            .filter(|&j| opposite(&normals[i], &normals[j]))
            .all(|j| apart <= MOST_APART * (inside[i] / length(i) + inside[j] / length(j)))
    })
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
