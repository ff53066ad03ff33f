//! Every item asked, exactly: the reference that the others are held against.

use super::contract::{BackEnd, Hit, Pick};
use super::exactly;
use super::facets::Facets;
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::truth::TriangleProbe;
use crate::visibility::{Guarantee, Ray, Solids};

/// The row of this file.
pub const ROW: BackEnd = BackEnd {
    name: "linear",
    summary: "every box or triangle, in exact arithmetic: the reference",
    guarantee: Guarantee::Exact,
    build: |solids, _| Ok(Box::new(Linear::of(solids))),
    build_triangles: Some(|facets, _| Ok(Box::new(EveryTriangle(facets.clone())))),
};

/// All items in the order of their ids.
#[derive(Clone, Debug)]
pub struct Linear {
    boxes: Vec<WorldBox>,
}

impl Linear {
    /// Takes over the items.
    pub fn of(solids: &Solids) -> Linear {
        Linear {
            boxes: solids.boxes.clone(),
        }
    }

    fn candidates(&self) -> impl Iterator<Item = (ItemId, &WorldBox)> {
        self.boxes
            .iter()
            .enumerate()
            .map(|(item, b)| (item as ItemId, b))
    }
}

impl Pick for Linear {
    /// O(n).
    fn first(&self, ray: &Ray) -> Option<Hit> {
        exactly::first(ray, self.candidates())
    }

    /// O(n), and sorting what the ray meets.
    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        exactly::nearest(ray, count, self.candidates(), hits);
    }
}

/// All triangles in the order of their items.
struct EveryTriangle(Facets);

impl EveryTriangle {
    fn probe(&self, ray: &Ray) -> TriangleProbe {
        TriangleProbe::new(*ray, self.0.origin)
    }
}

impl Pick for EveryTriangle {
    /// O(triangles).
    fn first(&self, ray: &Ray) -> Option<Hit> {
        exactly::first_facet(&self.probe(ray), self.0.all.iter(), self.0.items)
    }

    /// O(triangles), and sorting what the ray meets.
    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        let facets = self.0.all.iter();
        exactly::nearest_facets(&self.probe(ray), facets, self.0.items, count, hits);
    }
}
