//! The first view from above, with the stage that removed each item.

use glam::DVec3;

use super::item_stages::ItemStages;
use super::stage::{Chain, StageKind};
use super::truth::Truth;
use super::world::World;
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

/// Items about the eye of one view, as seen from above.
#[derive(Clone, Default, Debug)]
pub struct PlanView {
    /// The eye.
    pub eye: [f64; 2],
    /// Directions of the left and the right edge of the view.
    pub edges: [[f64; 2]; 2],
    /// Low and high corner of each item, and its fate; the farthest first.
    pub items: Vec<([f64; 4], Fate)>,
}

/// Most items that are drawn: those nearest to the eye.
const MOST_DRAWN: usize = 4_000;

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
        let eye = view.rays.camera().frame.eye;
        let flat = |v: DVec3| [v.x, v.y];
        let items = world.scene.items.iter().zip(0..);
        let mut near: Vec<(f64, [f64; 4], ItemId)> = items
            .filter(|(b, _)| !b.is_empty())
            .map(|(b, item)| {
                let (min, max) = b.in_world(world.scene.origin);
                let nearest = eye.clamp(min, max).with_z(eye.z);
                (nearest.distance(eye), [min.x, min.y, max.x, max.y], item)
            })
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
        near.truncate(MOST_DRAWN);
        let drawn = near.into_iter().rev();
        PlanView {
            eye: flat(eye),
            edges: [0.0, 1.0].map(|x| flat(view.rays.through(x, 0.5).direction)),
            items: drawn
                .map(|(_, plan, item)| (plan, fate(item, &left, is_visible(item))))
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
