//! Non-empty items, which every structure holds: their ids, and records for builds.

use glam::Vec3;

use super::BuildError;
use crate::geometry::Aabb;
use crate::query::ItemId;

/// Ids of all non-empty items, ascending, after a check of all bounds.
///
/// # Errors
/// An item with a NaN or infinite bound; more items than ids.
pub fn indexable(items: &[Aabb]) -> Result<Vec<ItemId>, BuildError> {
    // The top id stays free as a mark of "none".
    let most = ItemId::MAX as usize - 1;
    if items.len() > most {
        return Err(BuildError::TooManyItems {
            count: items.len(),
            most,
        });
    }
    // One look at each item: large scenes do not fit the cache.
    let (mut count, mut all_finite) = (0, true);
    for b in items {
        count += usize::from(!b.is_empty());
        all_finite &= b.is_finite();
    }
    if !all_finite && let Some(item) = items.iter().position(|b| !b.is_finite()) {
        return Err(BuildError::NonFiniteItem {
            item,
            bounds: items[item],
        });
    }
    if count == items.len() {
        return Ok((0..count as ItemId).collect());
    }
    // A structure keeps this list, so no slack.
    let mut ids = Vec::with_capacity(count);
    let sound = items.iter().zip(0..).filter(|(b, _)| !b.is_empty());
    ids.extend(sound.map(|(_, id)| id));
    Ok(ids)
}

/// An item during a build: bounds and id together, so that a level of the build is
/// one pass over memory.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Record {
    /// Bounds of the item.
    pub bounds: Aabb,
    /// Index of the item in the scene.
    pub id: ItemId,
}

impl Record {
    /// The items that a structure has to hold.
    ///
    /// # Errors
    /// The errors of [`indexable`].
    pub fn all(items: &[Aabb]) -> Result<Vec<Record>, BuildError> {
        let record = |id: ItemId| Record {
            bounds: items[id as usize],
            id,
        };
        Ok(indexable(items)?.into_iter().map(record).collect())
    }

    /// All boxes, numbered in their order.
    pub fn numbered(boxes: &[Aabb]) -> Vec<Record> {
        let records = boxes.iter().zip(0..);
        records.map(|(&bounds, id)| Record { bounds, id }).collect()
    }
}

/// Smallest box that holds the given centres.
pub fn bounds_of_centres(centres: impl Iterator<Item = Vec3>) -> Aabb {
    centres.fold(Aabb::EMPTY, |all, c| all.union(&Aabb::new(c, c)))
}
