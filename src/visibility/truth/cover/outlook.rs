//! What a search looks at: the boxes, the tree and the view; and rays in it.

use glam::DVec3;

use super::super::certificate::longest;
use super::super::ray_index::RayIndex;
use super::super::sight::{Polygon, Sight, Triple};
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::{Ray, Solids};

#[derive(Clone, Debug)]
pub struct Outlook<'s> {
    pub solids: &'s Solids,
    pub index: &'s RayIndex,
    pub sight: Sight,
}

impl Outlook<'_> {
    pub fn boxed(&self, item: ItemId) -> &WorldBox {
        &self.solids.boxes[item as usize]
    }

    /// A ray about the middle of a polygon.
    pub fn ray_through(&self, image: &Polygon) -> Ray {
        let view = &self.sight.view;
        let (forward, eye) = (DVec3::from(view.forward), DVec3::from(view.eye));
        let unit = |line: &Triple| match view.parallel {
            true => line.near[longest(view.forward)],
            false => forward.dot(line.near.into()),
        };
        let sum: DVec3 = image
            .corners
            .iter()
            .map(|c| DVec3::from(c.near) / unit(c))
            .sum();
        let mut middle = sum / image.corners.len() as f64;
        if !view.parallel {
            return view.ray(view.eye, middle.to_array());
        }
        middle[longest(view.forward)] = 0.0;
        let origin = middle + forward * forward.dot(eye - middle);
        view.ray(origin.to_array(), view.forward)
    }

    /// Whether the ray, as rounded, is one of the view.
    pub fn is_of_view(&self, ray: &Ray) -> bool {
        let line = self.line_of(ray);
        let sides = &self.sight.sides;
        sides.iter().all(|side| side.dot_sign(&line) >= 0)
    }

    /// A ray of the view as three numbers.
    pub fn line_of(&self, ray: &Ray) -> Triple {
        match self.sight.view.parallel {
            false => ray.direction.to_array().map(Into::into).into(),
            true => self.sight.through(ray.origin.to_array()),
        }
    }
}
