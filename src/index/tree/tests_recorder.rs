//! Cost of a recorder that is off.
//!
//! Region search with `NoRecorder` (`by_library`), and a copy of the search without that parameter
//! (`by_hand`). `scripts/check-recorder.sh` compares the instructions of the two.

use std::hint::black_box;

use glam::Vec3;

use super::PackedTree;
use crate::geometry::Aabb;
use crate::index::{Input, Octree, RegionIndex};
use crate::kernel::Plain;
use crate::query::{ItemId, NoRecorder, QueryContext, Sink};

/// Region search of the library with a recorder that is off.
#[inline(never)]
fn by_library(tree: &PackedTree, p: Vec3, out: &mut Vec<ItemId>) {
    let _ = tree.query(&p, &mut QueryContext::new(Plain, out, &mut NoRecorder));
}

/// The same search, written without a recorder.
#[inline(never)]
fn by_hand(tree: &PackedTree, p: Vec3, out: &mut Vec<ItemId>) {
    let nodes = tree.nodes();
    let mut at = 0;
    while let Some(node) = nodes.get(at) {
        if !node.bounds.contains_point(p) {
            at = node.after();
            continue;
        }
        at += 1;
        if node.after() == at {
            let items = node.items();
            for (start, lanes, block) in tree.boxes().range(items.start, items.end) {
                let admitted = block.holding(p) & lanes;
                if admitted != 0 {
                    // A Vec never stops the query.
                    let _ = out.accept_lanes(Plain, tree.ids(), start, admitted);
                }
            }
        }
    }
}

#[test]
fn a_recorder_that_is_off_changes_no_region_search() {
    // Residues by primes: boxes that overlap all over a cube.
    let axes = [(919, 1_009), (729, 1_013), (953, 1_019)];
    let place = |i: u32| Vec3::from_array(axes.map(|(k, all)| (i * k % all) as f32));
    let items = (0..20_000).map(|i| Aabb::around(place(i), Vec3::splat(10.0)));
    let items: Vec<Aabb> = items.collect();
    let octree = Octree::build(&Input::new(&items), &Default::default()).expect("a tree");
    let (mut found, mut wanted) = (Vec::new(), Vec::new());
    for item in &items {
        found.clear();
        wanted.clear();
        by_library(
            black_box(&octree.tree),
            black_box(item.centre()),
            &mut found,
        );
        by_hand(
            black_box(&octree.tree),
            black_box(item.centre()),
            &mut wanted,
        );
        assert!(!found.is_empty() && found == wanted, "{}", item.centre());
    }
}
