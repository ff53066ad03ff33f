//! What the views of a funnel show, item by item.

use crate::query::ItemId;

/// What is visible in each view: items with the samples of each, ascending.
pub struct Truth {
    visible: Vec<Vec<(ItemId, u32)>>,
}

impl Truth {
    /// By view: items with the samples of each, ascending.
    pub fn new(visible: Vec<Vec<(ItemId, u32)>>) -> Truth {
        Truth { visible }
    }

    /// Nothing, in so many views.
    pub fn empty(views: usize) -> Truth {
        Truth {
            visible: vec![Vec::new(); views],
        }
    }

    /// Items with their samples, ascending.
    pub fn of_view(&self, view: usize) -> &[(ItemId, u32)] {
        &self.visible[view]
    }

    /// Whether an item is in front at a sample of a view.
    pub fn sees(&self, view: usize, item: ItemId) -> bool {
        let found = self.visible[view].binary_search_by_key(&item, |(item, _)| *item);
        found.is_ok()
    }
}
