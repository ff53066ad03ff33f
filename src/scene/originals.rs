//! Boxes and points as they were written, in f64, beside the f32 that indexes
//! hold. It defines the exact comparison of the two; searching is left to the
//! indexes.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::{Regions, Scene, WorldBox};
use crate::arithmetic::two_sum;
use crate::geometry::Aabb;
use crate::query::ItemId;

/// The boxes as written, kept only where f32 holds one of them otherwise.
#[derive(Clone, Default, Debug)]
pub struct Originals {
    boxes: Arc<[WorldBox]>,
}

impl Originals {
    /// `stored` are the same boxes as indexes have them, about `origin`.
    pub(super) fn of(written: &[WorldBox], stored: &[Aabb], origin: DVec3) -> Originals {
        let same = |written: f64, stored: f32, origin: f64| {
            two_sum(origin, f64::from(stored)) == (written, 0.0)
        };
        let exact = written.iter().zip(stored).all(|(w, s)| {
            (0..3)
                .all(|k| same(w.min[k], s.min[k], origin[k]) && same(w.max[k], s.max[k], origin[k]))
        });
        Originals {
            boxes: if exact { &[] } else { written }.into(),
        }
    }

    /// In world coordinates; `None` if the stored boxes are the very same.
    pub fn boxes(&self) -> Option<&[WorldBox]> {
        (!self.boxes.is_empty()).then_some(&self.boxes)
    }
}

/// A point to search for: as it was written, and as indexes are asked.
///
/// Rounding to nearest loses no box: a bound is an f32 number, and what lies
/// beyond it is rounded beyond it or onto it. It can only find too many.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Sought {
    /// World coordinates, in f64.
    pub world: DVec3,
    /// Scene coordinates, rounded to the nearest f32.
    pub local: Vec3,
    /// Whether `local` is the point without any rounding.
    pub is_exact: bool,
}

/// The sign of `(p - origin) - bound`, exactly: -1, 0 or 1.
pub(super) fn side(p: f64, origin: f64, bound: f32) -> i32 {
    let (difference, lost) = two_sum(p, -origin);
    let bound = f64::from(bound);
    // The rounded difference is on the true one's side of any double.
    if difference != bound {
        return if difference > bound { 1 } else { -1 };
    }
    match lost {
        lost if lost > 0.0 => 1,
        lost if lost < 0.0 => -1,
        _ => 0,
    }
}

impl Scene {
    /// A point of the world as this scene's indexes are asked for it. A planar
    /// BSP ignores the height.
    pub fn sought(&self, world: DVec3) -> Sought {
        let mut local = (world - self.origin).as_vec3();
        let axes = if let Regions::Bsp(_) = self.regions {
            local.z = 0.0;
            2
        } else {
            3
        };
        Sought {
            world,
            local,
            is_exact: (0..axes).all(|k| side(world[k], self.origin[k], local[k]) == 0),
        }
    }

    /// Whether what an index finds for a point must still be looked at by
    /// [`Scene::refine`].
    pub fn is_refined(&self, p: &Sought) -> bool {
        match &self.regions {
            Regions::Bsp(_) => true,
            regions => !p.is_exact || self.originals_of(regions).boxes().is_some(),
        }
    }

    /// Keeps of the boxes that an index found the regions that hold the point
    /// exactly.
    #[inline]
    pub fn refine(&self, p: &Sought, found: &mut Vec<ItemId>) {
        if !found.is_empty() && self.is_refined(p) {
            self.keep_holding(p, found);
        }
    }

    fn keep_holding(&self, p: &Sought, found: &mut Vec<ItemId>) {
        match &self.regions {
            Regions::Bsp(bsp) => {
                let at = (p.world - self.origin).truncate();
                if bsp.covers(at) {
                    found.retain(|&region| bsp.holds(region, at));
                } else {
                    found.clear();
                }
            }
            _ => found.retain(|&id| self.holds(id, p.world)),
        }
    }

    /// Whether a region that is a box holds a point of the world, exactly.
    fn holds(&self, id: ItemId, p: DVec3) -> bool {
        let id = id as usize;
        if let Some(boxes) = self.originals_of(&self.regions).boxes() {
            return p.cmpge(boxes[id].min).all() && p.cmple(boxes[id].max).all();
        }
        let b = &self.regions.boxes(&self.items)[id];
        (0..3).all(|k| {
            let origin = self.origin[k];
            side(p[k], origin, b.min[k]) >= 0 && side(p[k], origin, b.max[k]) <= 0
        })
    }

    /// The reference answer, by the plainest means there are: the map's own
    /// descent, or an exact look at every box. Ascending ids.
    pub fn holding(&self, p: &Sought) -> Vec<ItemId> {
        if let Regions::Bsp(bsp) = &self.regions {
            let at = (p.world - self.origin).truncate();
            return bsp.descend(at).into_iter().collect();
        }
        let count = self.regions.boxes(&self.items).len() as ItemId;
        (0..count).filter(|&id| self.holds(id, p.world)).collect()
    }

    fn originals_of<'a>(&'a self, regions: &'a Regions) -> &'a Originals {
        match regions {
            Regions::Tiling(tiling) => &tiling.originals,
            _ => &self.originals,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dashu_int::IBig;

    /// A double as a whole number of 2^-1074.
    fn units(x: f64) -> IBig {
        let bits = x.abs().to_bits();
        let exponent = (bits >> 52) as usize;
        let mantissa = bits & ((1 << 52) - 1) | u64::from(exponent > 0) << 52;
        let size = IBig::from(mantissa) << exponent.saturating_sub(1);
        if x < 0.0 { -size } else { size }
    }

    #[test]
    fn sides_are_those_of_whole_numbers() {
        let mut state = 7u64;
        let mut next = || {
            state = state.wrapping_mul(0x5851_F42D_4C95_7F2D).wrapping_add(1);
            state >> 33
        };
        let mut ties = 0;
        for _ in 0..20_000 {
            let origin = (next() % 4096) as f64 * libm::exp2((next() % 60) as f64 - 20.0);
            let bound = (next() % 4096) as f32 * 0.1;
            let mut p = origin + f64::from(bound);
            for _ in 0..next() % 3 {
                p = if next() % 2 == 0 {
                    p.next_up()
                } else {
                    p.next_down()
                };
            }
            let exact = units(p) - units(origin) - units(f64::from(bound));
            let wanted = i32::from(exact > IBig::ZERO) - i32::from(exact < IBig::ZERO);
            assert_eq!(side(p, origin, bound), wanted, "{p:e} {origin:e} {bound:e}");
            ties += u32::from(wanted == 0);
        }
        assert!(ties > 1000, "{ties}");
    }

    #[test]
    fn what_f32_holds_exactly_needs_no_second_look() {
        let boxes = [WorldBox::new(DVec3::ZERO, DVec3::ONE)];
        let scene = Scene::about("exact", &boxes, DVec3::ZERO).expect("a scene");
        assert!(scene.originals.boxes().is_none());
        let p = scene.sought(DVec3::splat(0.5));
        assert!(p.is_exact && !scene.is_refined(&p));
        let p = scene.sought(DVec3::new(1.0 + 1e-12, 0.5, 0.5));
        let mut found = vec![0];
        assert!(!p.is_exact && p.local.x == 1.0);
        scene.refine(&p, &mut found);
        assert!(found.is_empty());
    }
}
