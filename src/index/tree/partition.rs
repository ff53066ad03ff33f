//! Top-down construction, shared by octree, quadtree and BSP tree.
//!
//! Order of work, leaves, and the fallback for groups that cannot be divided. A splitter decides
//! how a group of items is divided.

use super::packed::PackedTree;
use crate::index::items::Record;

/// A part of a divided group.
#[derive(Clone, Copy, Debug)]
pub struct Part<C> {
    /// Number of items of the part.
    pub items: usize,
    /// State that the splitter gets back with the part.
    ///
    /// `None` for a part that is not divided further by the splitter.
    pub cell: Option<C>,
}

/// Divides groups of items: the part that differs between top-down builders.
pub trait Splitter {
    /// State of a group, such as its cell.
    type Cell: Copy;

    /// Reorders the records so that the parts are contiguous, and pushes the parts.
    ///
    /// At most sixteen parts, whose items add up to the records; more make the build panic. No
    /// part, or a single one, means that the group cannot be divided in this way. `node` is the
    /// index of the group's node.
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

/// Builds a tree over items, with 1 to `leaf` items per leaf.
///
/// Groups that the splitter cannot divide (coincident items, say) are halved by size, so that no
/// leaf exceeds its limit and the depth stays bounded. O(n log n) for splitters that divide evenly.
pub fn build_top_down<S: Splitter>(
    mut records: Vec<Record>,
    leaf: usize,
    root: S::Cell,
    splitter: &mut S,
) -> PackedTree {
    if records.is_empty() {
        return PackedTree::default();
    }
    let (count, leaf) = (records.len(), leaf.max(1));
    let mut parts = Vec::new();
    PackedTree::grow(
        count,
        (0..count, Some(root)),
        |tree, node, (range, cell), groups| {
            let mut start = range.start;
            let group = &mut records[range];
            if group.len() <= leaf {
                splitter.arrange(group);
                for record in group.iter() {
                    tree.push(record.id, &record.bounds);
                }
                return;
            }
            parts.clear();
            if let Some(cell) = cell {
                splitter.split(group, cell, node, &mut parts);
            }
            if parts.len() < 2 {
                halve_by_size(group, &mut parts);
            }
            for part in &parts {
                groups.push((start..start + part.items, part.cell));
                start += part.items;
            }
        },
    )
}

/// Divides a group into its smaller and its larger boxes.
fn halve_by_size<C>(group: &mut [Record], parts: &mut Vec<Part<C>>) {
    let size = |r: &Record| r.bounds.extent().max_element();
    let half = group.len() / 2;
    group.select_nth_unstable_by(half, |a, b| {
        size(a).total_cmp(&size(b)).then(a.id.cmp(&b.id))
    });
    parts.clear();
    parts.extend([half, group.len() - half].map(|items| Part { items, cell: None }));
}
