//! The nodes of a frontier in buckets: one for each plane that is the only open one
//! of its nodes, and the rest. So a plane's coefficients are prepared once for all of
//! its nodes, without unpredictable branches between them.

use crate::geometry::LANES;
use crate::index::frontier::Frontier;
use crate::kernel::Isa;

/// Planes with a bucket, the lowest ones: those of a frustum. Nodes with other
/// open planes stay with the rest.
pub const BUCKETS: usize = 6;

/// The buckets, kept between queries.
#[derive(Default)]
pub struct SinglePlaneBuckets {
    buckets: [Vec<u32>; BUCKETS],
    used: [usize; BUCKETS],
    /// Nodes with several open planes, or one without a bucket.
    pub rest: Frontier,
}

impl SinglePlaneBuckets {
    /// Distributes a frontier; each bucket keeps its order. O(nodes * planes / 16).
    #[inline(always)]
    pub fn distribute<I: Isa>(&mut self, isa: I, frontier: &Frontier) {
        self.make_room(frontier.len());
        let mut used = [0; BUCKETS];
        for (nodes, open, lanes) in frontier.rows() {
            let (nodes, open) = (isa.words(nodes), isa.words(open));
            let mut rest = lanes;
            for (plane, used) in used.iter_mut().enumerate() {
                let alone = isa.equal(open, 1 << plane) & lanes;
                rest &= !alone;
                if let Some(place) = self.buckets[plane][*used..].first_chunk_mut() {
                    isa.compress(place, nodes, alone);
                }
                *used += alone.count_ones() as usize;
            }
            self.rest.push(isa, nodes, open, rest);
        }
        self.used = used;
    }

    fn make_room(&mut self, nodes: usize) {
        let room = nodes + LANES;
        for bucket in &mut self.buckets {
            if bucket.len() < room {
                bucket.resize(room, 0);
            }
        }
        self.rest.clear(nodes.div_ceil(LANES));
    }

    /// The nodes whose only open plane is this one.
    #[inline(always)]
    pub fn bucket(&self, plane: usize) -> &[u32] {
        &self.buckets[plane][..self.used[plane]]
    }
}
