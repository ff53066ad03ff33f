//! Several views' answers as one list: each item once, with the views that see
//! it. It owns the merge; how the lists came about is not its business.

use super::ItemId;

/// Merges lists of ids into items with view masks. Keeps its memory, a word an
/// item, from merge to merge.
#[derive(Default, Debug)]
pub struct ViewMasks {
    /// By item; all zero between merges.
    masks: Vec<u32>,
    seen: Vec<(ItemId, u32)>,
}

impl ViewMasks {
    /// Each item that is in any of the lists, with bit `i` set if it is in list
    /// `i`; in order of first appearance, the first list first. O(ids), and
    /// once O(largest id).
    ///
    /// # Panics
    /// If there are more than 32 lists.
    pub fn merge(&mut self, lists: &[Vec<ItemId>]) -> &[(ItemId, u32)] {
        assert!(lists.len() <= 32, "a mask has 32 bits");
        self.seen.clear();
        for (view, list) in lists.iter().enumerate() {
            for &id in list {
                let at = id as usize;
                if at >= self.masks.len() {
                    self.masks.resize(at + 1, 0);
                }
                if self.masks[at] == 0 {
                    self.seen.push((id, 0));
                }
                self.masks[at] |= 1 << view;
            }
        }
        for (id, mask) in &mut self.seen {
            *mask = std::mem::take(&mut self.masks[*id as usize]);
        }
        &self.seen
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_comes_once_with_all_of_its_views() {
        let mut masks = ViewMasks::default();
        let lists = [vec![7, 2], vec![], vec![2, 900, 7], vec![3]];
        let wanted = [(7, 0b101), (2, 0b101), (900, 0b100), (3, 0b1000)];
        assert_eq!(masks.merge(&lists), wanted);
        // Nothing is left of the last merge.
        assert_eq!(masks.merge(&[vec![900, 2]]), [(900, 1), (2, 1)]);
        assert_eq!(masks.merge(&[]), []);
    }
}
