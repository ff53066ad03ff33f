//! The first view, with the stage that removed each item.

use super::item_stages::ItemStages;
use super::stage::{Chain, StageKind};
use super::truth::Truth;
use super::world::World;
use crate::camera::Camera;
use crate::query::ItemId;

/// The stage that removed an item, or the item's visibility.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Fate {
    /// A stage removed it.
    Removed(StageKind),
    /// Every stage kept it, and no sample sees it.
    Kept,
    /// In front at a sample.
    Visible,
    /// In front at a sample, and removed.
    Lost,
}

/// The first view with the fate of each item.
#[derive(Clone, Default, Debug)]
pub struct PlanView {
    /// Its camera; `None` if there is no view.
    pub camera: Option<Camera>,
    /// Fates by item.
    pub fates: Vec<Fate>,
}

impl PlanView {
    /// The first view, behind the stages of whole items of a chain.
    pub fn of(world: &World, stages: &ItemStages, chain: &Chain, truth: &Truth) -> PlanView {
        let (Some(view), Some(visible)) = (world.views.first(), truth.first()) else {
            return PlanView::default();
        };
        let left = StageKind::OF_ITEMS.map(|stage| {
            let steps = chain.steps_with(stage, chain.of(stage));
            (stage, stages.items(&steps, 0))
        });
        let is_visible = |item| visible.binary_search_by_key(&item, |(id, _)| *id).is_ok();
        let items = (0..).take(world.scene.items.len());
        PlanView {
            camera: Some(*view.rays.camera()),
            fates: items
                .map(|item| fate(item, &left, is_visible(item)))
                .collect(),
        }
    }
}

/// Fate of an item, from the ascending items behind each stage (`None`: all items).
fn fate(item: ItemId, left: &[(StageKind, Option<&[ItemId]>)], is_visible: bool) -> Fate {
    let lacks = |set: &Option<&[ItemId]>| set.is_some_and(|set| set.binary_search(&item).is_err());
    let removed = left.iter().find(|(_, set)| lacks(set));
    match (removed, is_visible) {
        (Some(_), true) => Fate::Lost,
        (Some((stage, _)), false) => Fate::Removed(*stage),
        (None, true) => Fate::Visible,
        (None, false) => Fate::Kept,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_stage_that_lacks_an_item_removed_it() {
        let sets: [(StageKind, Option<&[ItemId]>); 3] = [
            (StageKind::Region, None),
            (StageKind::Object, Some(&[1, 2, 3])),
            (StageKind::Occlusion, Some(&[1, 3])),
        ];
        let of = |item, is_visible| fate(item, &sets, is_visible);
        assert_eq!(of(1, true), Fate::Visible);
        assert_eq!(of(3, false), Fate::Kept);
        assert_eq!(of(2, false), Fate::Removed(StageKind::Occlusion));
        assert_eq!(of(2, true), Fate::Lost);
        assert_eq!(of(7, false), Fate::Removed(StageKind::Object));
    }
}
