//! Box scene as solids: each item hides what is behind its box, exactly.
//!
//! A ray meets a solid where it enters the solid, if that point is between near and far. A ray that
//! enters before the near plane, or starts inside, does not meet the solid: from there only the
//! inside is visible, which, like any back face, is not drawn and hides nothing.

use glam::DVec3;

use crate::geometry::Aabb;
use crate::scene::{Scene, WorldBox};

/// The items of a scene as solid boxes, in three forms.
#[derive(Clone, Debug)]
pub struct Solids {
    /// World position of the origin of `outer` and `inner`.
    pub origin: DVec3,
    /// Boxes as written in the scene: the truth.
    pub boxes: Vec<WorldBox>,
    /// Smallest enclosing f32 boxes, tested for being hidden.
    pub outer: Vec<Aabb>,
    /// Largest enclosed f32 boxes, which act as occluders; empty if there is none.
    pub inner: Vec<Aabb>,
}

impl Solids {
    /// Boxes of all items of a scene, for items of any shape. O(n).
    pub fn of(scene: &Scene) -> Solids {
        let boxes: Vec<WorldBox> = scene.written().collect();
        // Rounding an inside-out box outward rounds the box inward.
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
