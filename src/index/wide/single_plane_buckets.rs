//! The nodes of a frontier in buckets by their only open plane.
//!
//! One bucket for each plane, and one for nodes with several open planes. So a plane's coefficients
//! are prepared once for all of its nodes, without unpredictable branches between them.

use crate::geometry::LANES;
use crate::index::frontier::{Frontier, NodeList};
use crate::kernel::Isa;

/// Number of planes with a bucket, the lowest ones: those of a frustum.
///
/// Nodes whose only open plane is another one stay in `rest`.
const BUCKETS: usize = 6;

/// The buckets, kept between queries.
#[derive(Default)]
pub struct SinglePlaneBuckets {
    /// The nodes whose only open plane is that of the index.
    pub buckets: [NodeList; BUCKETS],
    /// Nodes with several open planes, or one without a bucket.
    pub rest: Frontier,
}

impl SinglePlaneBuckets {
    /// Distributes a frontier; each bucket keeps its order. O(nodes * planes / 16).
    #[inline(always)]
    pub fn distribute<I: Isa>(&mut self, isa: I, frontier: &Frontier) {
        let parents = frontier.len().div_ceil(LANES);
        for bucket in &mut self.buckets {
            bucket.clear(parents);
        }
        self.rest.clear(parents);
        for (nodes, open, lanes) in frontier.rows() {
            let (nodes, open) = (isa.words(nodes), isa.words(open));
            let mut rest = lanes;
            for (plane, bucket) in self.buckets.iter_mut().enumerate() {
                let alone = isa.equal(open, 1 << plane) & lanes;
                rest &= !alone;
                bucket.push(isa, nodes, alone);
            }
            self.rest.push(isa, nodes, open, rest);
        }
    }
}
