//! Building trees from the top: the loop that octree, quadtree and BSP share.
//! A splitter decides how a group of items is divided; this file owns the
//! order of work, the leaves, and the way out where nothing can be divided.

use super::tree::{PackedTree, TreeWriter};
use super::{BuildError, indexable};
use crate::geometry::Aabb;
use crate::query::ItemId;

/// An item on its way into a tree; kept together, so that a level of the
/// build is one pass over memory.
#[derive(Clone, Copy, Debug)]
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
    /// As [`indexable`].
    pub fn all(items: &[Aabb]) -> Result<Vec<Record>, BuildError> {
        Ok(Record::some(items, &indexable(items)?))
    }

    /// All boxes, numbered in their order.
    pub fn numbered(boxes: &[Aabb]) -> Vec<Record> {
        let records = boxes.iter().zip(0..);
        records.map(|(&bounds, id)| Record { bounds, id }).collect()
    }

    fn some(items: &[Aabb], ids: &[ItemId]) -> Vec<Record> {
        let record = |&id: &ItemId| Record {
            bounds: items[id as usize],
            id,
        };
        ids.iter().map(record).collect()
    }
}

/// A part of a divided group.
#[derive(Clone, Copy, Debug)]
pub struct Part<C> {
    /// Number of items of the part.
    pub items: usize,
    /// What the splitter wants to know when it sees the part again; `None`
    /// for a part that is not to be divided by the splitter any more.
    pub cell: Option<C>,
}

/// How a group of items is divided.
pub trait Splitter {
    /// What is known of a group, such as its cell.
    type Cell: Copy;

    /// Reorders the records so that the parts lie one after the other, and
    /// pushes the parts. No part, or a single one, means that the group
    /// cannot be divided in this way. `node` is the number that the group's
    /// node gets.
    fn split(
        &mut self,
        records: &mut [Record],
        cell: Self::Cell,
        node: usize,
        parts: &mut Vec<Part<Self::Cell>>,
    );

    /// Orders the items of a group that becomes a leaf.
    fn arrange(&mut self, _records: &mut [Record]) {}
}

/// Builds a tree over the items `ids`, with at most `leaf` items a leaf.
///
/// Groups that the splitter cannot divide (coincident items, say) are halved
/// by size, so that no leaf exceeds its limit and the depth stays bounded.
/// O(n log n) for splitters that divide evenly.
pub fn build_top_down<S: Splitter>(
    items: &[Aabb],
    ids: &[ItemId],
    leaf: usize,
    root: S::Cell,
    splitter: &mut S,
) -> PackedTree {
    enum TaskKind<C> {
        Enter {
            first: usize,
            items: usize,
            cell: Option<C>,
        },
        Leave(usize),
    }
    let mut records = Record::some(items, ids);
    let mut writer = TreeWriter::with_capacity(records.len());
    let mut parts = Vec::new();
    let mut open = Vec::new();
    if !records.is_empty() {
        open.push(TaskKind::Enter {
            first: 0,
            items: records.len(),
            cell: Some(root),
        });
    }
    while let Some(task) = open.pop() {
        let (first, count, cell) = match task {
            TaskKind::Leave(node) => {
                writer.close(node);
                continue;
            }
            TaskKind::Enter { first, items, cell } => (first, items, cell),
        };
        let group = &mut records[first..first + count];
        let node = writer.open();
        open.push(TaskKind::Leave(node));
        if count <= leaf {
            splitter.arrange(group);
            for record in group.iter() {
                writer.push(record.id, &record.bounds);
            }
            continue;
        }
        parts.clear();
        if let Some(cell) = cell {
            splitter.split(group, cell, node, &mut parts);
        }
        if parts.len() < 2 {
            halve_by_size(group, &mut parts);
        }
        let mut end = first + count;
        for part in parts.iter().rev() {
            end -= part.items;
            open.push(TaskKind::Enter {
                first: end,
                items: part.items,
                cell: part.cell,
            });
        }
        debug_assert_eq!(end, first, "the parts are the group");
    }
    writer.finish()
}

/// The smaller and the larger half: nested boxes at least part by size.
fn halve_by_size<C>(group: &mut [Record], parts: &mut Vec<Part<C>>) {
    let size = |r: &Record| r.bounds.extent().max_element();
    let half = group.len() / 2;
    group.select_nth_unstable_by(half, |a, b| {
        size(a).total_cmp(&size(b)).then(a.id.cmp(&b.id))
    });
    parts.clear();
    parts.push(Part {
        items: half,
        cell: None,
    });
    parts.push(Part {
        items: group.len() - half,
        cell: None,
    });
}
