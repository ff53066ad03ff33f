//! The nodes of a frontier in buckets, by the plane that alone is open.
//!
//! One bucket for each plane that is the only open one of its nodes, and one for the rest. So a
//! plane's coefficients are prepared once for all of its nodes, without unpredictable branches
//! between them.

use crate::geometry::LANES;
use crate::index::frontier::{Frontier, NodeList};
use crate::kernel::Isa;

/// Planes with a bucket, the lowest ones: those of a frustum. Nodes with other
/// open planes stay with the rest.
const BUCKETS: usize = 6;

/// The buckets, kept between queries.
#[derive(Default)]
pub struct SinglePlaneBuckets {
    /// The nodes whose only open plane is that one.
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
