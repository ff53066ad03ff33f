//! The nodes of a frontier parted by what is open for them: one list for each
//! plane by itself, and the rest. So a plane's numbers are made ready once for
//! all of its nodes, and nothing has to be guessed between one and the next.

use super::frontier::Frontier;
use crate::geometry::LANES;
use crate::kernel::Isa;

/// Planes with a list of their own, the lowest ones: those of a frustum. What
/// further planes are open for stays with the rest.
pub const LISTED: usize = 6;

/// The lists, kept between queries.
#[derive(Default)]
pub struct ByPlane {
    lists: [Vec<u32>; LISTED],
    used: [usize; LISTED],
    /// Nodes that several planes are open for, or one without a list.
    pub rest: Frontier,
}

impl ByPlane {
    /// Parts a frontier; each list keeps its order. O(nodes * planes / 16).
    #[inline(always)]
    pub fn part<I: Isa>(&mut self, isa: I, frontier: &Frontier) {
        self.make_room(frontier.len());
        let mut used = [0; LISTED];
        for (nodes, open, lanes) in frontier.rows() {
            let (nodes, open) = (isa.words(nodes), isa.words(open));
            let mut rest = lanes;
            for (plane, used) in used.iter_mut().enumerate() {
                let alone = isa.equal(open, 1 << plane) & lanes;
                rest &= !alone;
                if let Some(place) = self.lists[plane][*used..].first_chunk_mut() {
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
        for list in &mut self.lists {
            if list.len() < room {
                list.resize(room, 0);
            }
        }
        self.rest.clear(nodes.div_ceil(LANES));
    }

    /// The nodes that this plane alone is open for.
    #[inline(always)]
    pub fn list(&self, plane: usize) -> &[u32] {
        &self.lists[plane][..self.used[plane]]
    }
}
