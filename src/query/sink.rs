//! Where answers go: collect, count, or stop at the first one.

use std::ops::ControlFlow;

use super::ItemId;

/// Where answers go. A structure hands over slices: a subtree that is wholly
/// inside is one call. Returning `Break` ends the query.
pub trait Sink {
    fn accept(&mut self, ids: &[ItemId]) -> ControlFlow<()>;
}

/// Collects all ids, in the structure's own order.
impl Sink for Vec<ItemId> {
    #[inline(always)]
    fn accept(&mut self, ids: &[ItemId]) -> ControlFlow<()> {
        match ids {
            // Often, and a call to copy four bytes would cost more than they.
            [id] => self.push(*id),
            _ => self.extend_from_slice(ids),
        }
        ControlFlow::Continue(())
    }
}

/// Counts the answers without keeping them.
#[derive(Clone, Copy, Default, Debug)]
pub struct Count(pub u64);

impl Sink for Count {
    #[inline(always)]
    fn accept(&mut self, ids: &[ItemId]) -> ControlFlow<()> {
        self.0 += ids.len() as u64;
        ControlFlow::Continue(())
    }
}

/// Stops at the first answer.
#[derive(Clone, Copy, Default, Debug)]
pub struct First(pub Option<ItemId>);

impl Sink for First {
    #[inline(always)]
    fn accept(&mut self, ids: &[ItemId]) -> ControlFlow<()> {
        match ids.first() {
            Some(&id) => {
                self.0 = Some(id);
                ControlFlow::Break(())
            }
            None => ControlFlow::Continue(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_answer_ends_the_query_and_an_empty_slice_is_none() {
        let mut first = First::default();
        assert!(first.accept(&[]).is_continue());
        assert_eq!(first.accept(&[7, 8]), ControlFlow::Break(()));
        assert_eq!(first.0, Some(7));
    }
}
