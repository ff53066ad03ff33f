//! A box scene as solids: each item hides what is behind its box, exactly.
//!
//! A ray meets a solid where it enters the solid, if that is between near and far. A ray
//! that enters before the near plane (or begins inside) does not meet the solid: only the
//! inside is visible from there, which, as the back of any closed surface, is not drawn
//! and hides nothing.

use glam::DVec3;

use crate::geometry::Aabb;
use crate::scene::{Scene, WorldBox};

/// The items of a scene as solid boxes, in three forms.
#[derive(Clone, Debug)]
pub struct Solids {
    /// World position of the zero of `outer` and `inner`.
    pub origin: DVec3,
    /// The boxes as written: the truth.
    pub boxes: Vec<WorldBox>,
    /// The smallest f32 boxes that hold them: what may be hidden.
    pub outer: Vec<Aabb>,
    /// The largest f32 boxes within them, empty where there is none: what may hide.
    pub inner: Vec<Aabb>,
}

impl Solids {
    /// Boxes of all items of a scene, for any shape of the items. O(n).
    pub fn of(scene: &Scene) -> Solids {
        let boxes: Vec<WorldBox> = scene.written().collect();
        // Outward, of what is inside out.
        let turned = |b: &WorldBox| Aabb::rounded_outward(b.max, b.min, scene.origin);
        let inner = boxes.iter().map(turned).map(|b| Aabb::new(b.max, b.min));
        Solids {
            inner: inner.collect(),
            boxes,
            outer: scene.items.clone(),
            origin: scene.origin,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inner_boxes_lie_within_and_outer_ones_around() {
        let tenth = WorldBox::new(DVec3::splat(0.1), DVec3::splat(0.3));
        let thin = WorldBox::new(DVec3::splat(0.1), DVec3::splat(0.1));
        let whole = WorldBox::new(DVec3::ZERO, DVec3::ONE);
        let scene = Scene::about("three", &[tenth, thin, whole], DVec3::ZERO).unwrap();
        let solids = Solids::of(&scene);
        assert!(f64::from(solids.inner[0].min.x) >= 0.1);
        assert!(f64::from(solids.inner[0].max.x) <= 0.3 && !solids.inner[0].is_empty());
        assert!(solids.inner[1].is_empty(), "no f32 is 0.1");
        assert_eq!(solids.inner[2], solids.outer[2]);
        assert_eq!(solids.boxes[0], tenth);
    }
}
