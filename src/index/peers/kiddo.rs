//! The crate kiddo: a k-d tree of points. It holds the centres of the boxes
//! and is asked for all of them within a distance (on the worst axis) that no
//! item of the answer can exceed; what comes back is tested.

use std::ops::ControlFlow;

use glam::Vec3;
use kiddo::{Chebyshev, ImmutableKdTree};

use super::{BoxByBox, BoxTest, Record, Tally, half_of_largest};
use crate::geometry::Aabb;
use crate::index::{BuildError, Info, Kind, MemoryUsage, Origin};
use crate::query::{Recorder, Sink};

/// Centres in a tree, items beside it.
pub struct PeerKiddo {
    /// `None` for no items.
    tree: Option<ImmutableKdTree<f32, 3>>,
    items: Vec<Record>,
    scene: Aabb,
    half: Vec3,
}

impl BoxByBox for PeerKiddo {
    const ABOUT: Info = Info::new(
        "peer-kiddo",
        "crate kiddo, a k-d tree of the boxes' centres, asked for those within reach",
        Kind::Tree,
        Origin::Crate("kiddo"),
    );

    fn of(items: Vec<Record>) -> Result<Self, BuildError> {
        let centres: Vec<[f32; 3]> = items
            .iter()
            .map(|item| item.bounds.centre().to_array())
            .collect();
        let tree = match items.is_empty() {
            true => None,
            false => Some(ImmutableKdTree::new_from_slice(&centres).map_err(|error| {
                BuildError::Refused {
                    structure: Self::ABOUT.name,
                    reason: error.to_string(),
                }
            })?),
        };
        Ok(PeerKiddo {
            tree,
            scene: Aabb::union_of(items.iter().map(|item| &item.bounds)),
            half: half_of_largest(&items),
            items,
        })
    }

    /// The crate does not tell: a centre and an id each, and about a stem for
    /// every leaf of 32.
    fn used(&self) -> MemoryUsage {
        let count = self.items.len();
        MemoryUsage {
            node_bytes: count.div_ceil(32) * 2 * size_of::<f32>() + count * 16,
            item_bytes: size_of_val(&self.items[..]),
        }
    }

    #[inline(always)]
    fn search<T: BoxTest, S: Sink, R: Recorder>(
        &self,
        test: &T,
        sink: &mut S,
        recorder: &mut R,
    ) -> ControlFlow<()> {
        let Some(tree) = &self.tree else {
            return ControlFlow::Continue(());
        };
        let tally = Tally::new(recorder);
        tally.node(test);
        if test.rejects(&self.scene) {
            return ControlFlow::Continue(());
        }
        let centres = test.centres(self.half, &self.scene);
        if centres.is_empty() {
            return ControlFlow::Continue(());
        }
        let centre = centres.centre();
        // A little more than half of it: the sum and the distances round.
        let radius = ((centres.max - centre).max(centre - centres.min)).max_element() * 1.000_001;
        let mut flow = ControlFlow::Continue(());
        let query = centre.to_array();
        let within = tree
            .query(&query)
            .within::<Chebyshev<f32>>(radius)
            .unsorted();
        // The visitor cannot end the search.
        within.visit(|found| {
            let item = &self.items[found.item as usize];
            if flow.is_continue() {
                tally.item(test);
                if test.admits(&item.bounds) {
                    flow = sink.accept(std::slice::from_ref(&item.id));
                }
            }
        });
        flow
    }
}
