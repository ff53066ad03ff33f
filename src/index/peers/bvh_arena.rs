//! The crate bvh-arena: a tree that grows by insertion, asked for what
//! overlaps the bounds of the view; its volumes are of one type, so the view
//! itself cannot be asked with.

use std::cell::Cell;
use std::ops::ControlFlow;

use bvh_arena::{BoundingVolume, Bvh};
use glam::Vec3;

use super::{BoxByBox, BoxTest, Record, Tally, half_of_largest};
use crate::geometry::Aabb;
use crate::index::{BuildError, Info, Kind, MemoryUsage, Origin};
use crate::query::{Recorder, Sink};

thread_local! {
    /// Merges since it was last set to zero: they tell how deep insertion went.
    static MERGES: Cell<u32> = const { Cell::new(0) };
}

/// Our boxes as the crate's volumes. Its own type has the same fields, but
/// calls a flat box's area zero, and then all go to one side.
#[derive(Clone, Copy)]
struct Volume(Aabb);

impl BoundingVolume for Volume {
    fn merge(self, other: Self) -> Self {
        MERGES.with(|merges| merges.set(merges.get() + 1));
        Volume(self.0.union(&other.0))
    }

    /// Half the surface.
    fn area(&self) -> f32 {
        self.0.half_area()
    }

    #[inline(always)]
    fn overlaps(&self, other: &Self) -> bool {
        self.0.intersects(&other.0)
    }
}

/// Insertion recurses; deeper than this it would overflow the stack of a
/// thread before long, and in a build without optimisation before 4096 levels;
/// it has been quadratic for a while.
const DEEPEST: u32 = 1024;
/// Merges on each level of an insertion: one a side and one on the way back.
const MERGES_A_LEVEL: u32 = 3;

/// The tree, and what is asked before it.
pub struct PeerBvhArena {
    tree: Bvh<Record, Volume>,
    count: usize,
    scene: Aabb,
    half: Vec3,
}

/// Places in an order that has nothing to do with that of the scene: a sorted
/// scene would be inserted into a list.
fn shuffled(count: usize) -> impl Iterator<Item = usize> {
    // A step that shares no factor with the count visits every place once.
    let step = ((count as u64 * 0x9E37_79B1) >> 32).max(1);
    let coprime = (step..).find(|&step| greatest_common_divisor(step, count as u64) <= 1);
    let step = coprime.unwrap_or(1);
    (0..count as u64).map(move |i| (i * step % count as u64) as usize)
}

fn greatest_common_divisor(a: u64, b: u64) -> u64 {
    match b {
        0 => a,
        _ => greatest_common_divisor(b, a % b),
    }
}

impl BoxByBox for PeerBvhArena {
    const ABOUT: Info = Info::new(
        "peer-bvh-arena",
        "crate bvh-arena, insertion only, asked for what overlaps the view's bounds",
        Kind::Tree,
        Origin::Crate("bvh-arena"),
    );

    fn of(items: Vec<Record>) -> Result<Self, BuildError> {
        let mut tree = Bvh::with_capacity(2 * items.len());
        for place in shuffled(items.len()) {
            let item = items[place];
            MERGES.set(0);
            tree.insert(item, Volume(item.bounds));
            if MERGES.get() > DEEPEST * MERGES_A_LEVEL {
                return Err(BuildError::Refused {
                    structure: Self::ABOUT.name,
                    reason: format!(
                        "insertion has become a list of {DEEPEST} levels: too many items share \
                         their place"
                    ),
                });
            }
        }
        Ok(PeerBvhArena {
            tree,
            count: items.len(),
            scene: Aabb::union_of(items.iter().map(|item| &item.bounds)),
            half: half_of_largest(&items),
        })
    }

    /// The crate does not tell: two slots an item, each with the bounds, its
    /// parent, an item or two children, and the slot map's version.
    fn used(&self) -> MemoryUsage {
        const SLOT: usize = size_of::<Aabb>() + 8 + size_of::<Record>() + 4 + 4;
        MemoryUsage {
            node_bytes: self.count * SLOT,
            item_bytes: self.count * SLOT,
        }
    }

    #[inline(always)]
    fn search<T: BoxTest, S: Sink, R: Recorder>(
        &self,
        test: &T,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let tally = Tally::new(recorder);
        tally.node(test);
        if self.count == 0 || test.rejects(&self.scene) {
            return ControlFlow::Continue(());
        }
        let centres = Volume(test.centres(self.half, &self.scene));
        for item in self.tree.overlaps(&centres) {
            tally.item(test);
            if test.admits(&item.bounds) {
                sink.accept(std::slice::from_ref(&item.id))?;
            }
        }
        ControlFlow::Continue(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::{FrustumQuery, Input, NoParams, RegionIndex};

    #[test]
    fn every_place_comes_once_and_neighbours_lie_apart() {
        for count in [0, 1, 2, 3, 10, 997, 1000, 65_536] {
            let mut places: Vec<usize> = shuffled(count).collect();
            if count >= 1000 {
                assert!(
                    places
                        .windows(2)
                        .all(|pair| pair[0].abs_diff(pair[1]) > 100)
                );
            }
            places.sort_unstable();
            assert!(places.into_iter().eq(0..count), "{count}");
        }
    }

    #[test]
    fn a_tree_that_would_be_a_list_is_refused_before_the_stack_overflows() {
        let items = vec![Aabb::around(Vec3::ZERO, Vec3::ONE); 20_000];
        let error = PeerBvhArena::build(&Input::new(&items), &NoParams {}).err();
        assert!(
            matches!(error, Some(BuildError::Refused { .. })),
            "{error:?}"
        );
    }

    /// In the scene's own order each of these would go below the last one.
    #[test]
    fn a_sorted_scene_does_not_become_a_list() {
        let item = |i: u16| Aabb::around(Vec3::X * (f32::from(i) * 2.0), Vec3::splat(0.5));
        let items: Vec<Aabb> = (0..6000).map(item).collect();
        let tree = PeerBvhArena::build(&Input::new(&items), &NoParams {}).expect("a tree");
        let mut found = Vec::new();
        let _ = tree.locate(Vec3::X * 8000.0, &mut found);
        assert_eq!(found, [4000]);
    }
}
