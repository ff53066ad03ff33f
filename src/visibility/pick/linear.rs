//! Every item asked, exactly: the reference that the others are held against.

use super::contract::{About, Hit, NotBuilt, Pick};
use super::exactly;
use crate::index::Origin;
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::{Guarantee, Ray, Solids};

/// As typed on the command line.
pub const NAME: &str = "linear";
/// One line for tables and help.
pub const SUMMARY: &str = "every item, in exact arithmetic: the reference";

/// What it declares of itself.
pub const ABOUT: About = About {
    name: NAME,
    summary: SUMMARY,
    origin: Origin::Ours,
    guarantee: Guarantee::Exact,
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

/// Never an error.
pub(super) fn build(solids: &Solids) -> Result<Box<dyn Pick>, NotBuilt> {
    Ok(Box::new(Linear::of(solids)))
}

impl Pick for Linear {
    fn about(&self) -> About {
        ABOUT
    }

    /// O(n).
    fn first(&self, ray: &Ray) -> Option<Hit> {
        exactly::first(ray, self.candidates())
    }

    /// O(n), and sorting what the ray meets.
    fn nearest(&self, ray: &Ray, count: usize, hits: &mut Vec<Hit>) {
        exactly::nearest(ray, count, self.candidates(), hits);
    }

    fn memory(&self) -> usize {
        size_of_val(&self.boxes[..])
    }
}
