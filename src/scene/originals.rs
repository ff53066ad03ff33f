//! Boxes and points as they were written, in f64, beside the f32 that indexes
//! hold. It defines the exact comparison of the two; searching is left to the
//! indexes.

use std::sync::{Arc, OnceLock};

use glam::DVec3;

use super::WorldBox;
use super::shared_faces::SharedFaces;
use crate::arithmetic::two_sum;
use crate::geometry::Aabb;

/// The boxes as written, kept only where f32 holds one of them otherwise.
#[derive(Clone, Default, Debug)]
pub struct Originals {
    boxes: Arc<[WorldBox]>,
    /// Made when first asked for.
    faces: Arc<OnceLock<Option<SharedFaces>>>,
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
            faces: Arc::default(),
        }
    }

    /// The faces that these boxes share, if they do. `stored` and `origin` as they were
    /// given.
    #[inline]
    pub(super) fn faces(&self, stored: &[Aabb], origin: DVec3) -> Option<&SharedFaces> {
        let made = || SharedFaces::of(self.boxes(), stored, origin);
        self.faces.get_or_init(made).as_ref()
    }

    /// In world coordinates; `None` if the stored boxes are the very same.
    pub fn boxes(&self) -> Option<&[WorldBox]> {
        (!self.boxes.is_empty()).then_some(&self.boxes)
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;
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
        assert!(!scene.is_refined(&p));
        let p = scene.sought(DVec3::new(1.0 + 1e-12, 0.5, 0.5));
        let mut found = vec![0];
        assert!(scene.is_refined(&p) && p.local.x == 1.0);
        scene.refine(&p, &mut found, 0);
        assert!(found.is_empty());
    }
}
