//! The first view from above: where each item is and which stage removed it.

use super::stage::StageKind;
use crate::query::ItemId;

/// What became of an item.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Fate {
    /// A stage removed it.
    Removed(StageKind),
    /// Every stage handed it on, and no sample sees it.
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
    /// Low and high corner of each item, and its fate; what is farthest first.
    pub items: Vec<([f64; 4], Fate)>,
}

/// Most items that are drawn: those nearest to the eye.
pub const MOST_DRAWN: usize = 4_000;

/// The fate of an item from the sets before and after each stage, and whether it is
/// visible. Sets are ascending, `None` is all items.
pub fn fate(item: ItemId, sets: &[(StageKind, Option<&[ItemId]>)], is_visible: bool) -> Fate {
    let lacks = |set: &Option<&[ItemId]>| set.is_some_and(|set| set.binary_search(&item).is_err());
    let removed = sets.iter().find(|(_, set)| lacks(set));
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
