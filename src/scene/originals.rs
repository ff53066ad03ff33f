//! Boxes and points as they were written, in f64, beside the f32 that indexes
//! hold. Comparing points with them is left to `side` and `sought`.

use std::sync::Arc;

use glam::DVec3;

use super::WorldBox;
use crate::arithmetic::two_sum;
use crate::geometry::Aabb;

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

#[cfg(test)]
mod tests {
    use crate::scene::{Scene, WorldBox};
    use glam::DVec3;

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
