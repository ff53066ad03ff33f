//! What an order gets wrong, by the exact order of depths at each sample.

use super::canvas::Canvas;
use super::cycles::items_in_cycles;
use super::draw::Tests;
use super::order::Piece;
use crate::query::ItemId;
use crate::visibility::Solids;
use crate::visibility::truth::Crossing;

/// The errors of an order that should be front to back.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
#[non_exhaustive]
pub struct OrderErrors {
    /// Pairs of items that overlap in the image: both met by a sample's ray, at
    /// different depths.
    pub pairs: u64,
    /// Of these, drawn the wrong way round at a sample.
    pub wrong: u64,
    /// Samples that show a wrong item if the list is drawn back to front without a
    /// z-test (painter's algorithm).
    pub wrong_samples: u64,
    /// Items on cycles of overlaps, for which no order is right.
    pub cyclic: usize,
}

/// A fragment, where its ray meets the item and when it was drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layer<A> {
    pub when: u32,
    pub item: ItemId,
    pub at: A,
}

/// Compares an order from front to back with the exact one at every sample, of the
/// fragments that the tests beside the z-test let through. It keeps all of them: 40
/// bytes each. O(samples * layers^2).
pub fn order_errors(
    canvas: &Canvas,
    solids: &Solids,
    pieces: &[Piece],
    tests: &Tests,
) -> OrderErrors {
    let mut layers: Vec<Vec<Layer<Crossing>>> = vec![Vec::new(); canvas.grid().samples()];
    for (piece, when) in pieces.iter().zip(0..) {
        canvas.fragments(solids, piece, tests.stencil, |fragment| {
            if tests.keep(canvas, solids, &fragment) {
                layers[fragment.sample].push(Layer {
                    when,
                    item: fragment.item,
                    at: fragment.at,
                });
            }
        });
    }
    let mut errors = ErrorCount::default();
    for (sample, layers) in layers.iter_mut().enumerate() {
        let probe = canvas.probe(sample);
        errors.sample(layers, |a, b| probe.compare(a, b));
    }
    errors.all()
}

/// The errors so far, sample by sample.
#[derive(Default)]
pub(super) struct ErrorCount {
    wrong_samples: u64,
    pairs: Pairs,
}

impl ErrorCount {
    /// One more sample: all its layers, and the exact order of two of them. They are left in
    /// the order in which they were drawn, one for each item.
    pub fn sample<A>(
        &mut self,
        layers: &mut Vec<Layer<A>>,
        compare: impl Fn(&A, &A) -> std::cmp::Ordering,
    ) {
        // A ray along a cut meets both parts: the first counts.
        layers.sort_by_key(|layer| (layer.item, layer.when));
        layers.dedup_by_key(|layer| layer.item);
        layers.sort_by_key(|layer| layer.when);
        for (i, a) in layers.iter().enumerate() {
            for b in &layers[i + 1..] {
                match compare(&a.at, &b.at) {
                    std::cmp::Ordering::Less => self.pairs.right.push((a.item, b.item)),
                    std::cmp::Ordering::Greater => self.pairs.wrong.push((b.item, a.item)),
                    std::cmp::Ordering::Equal => {}
                }
            }
        }
        // Painted from the last to the first: the first of the list stays.
        if let Some((shown, rest)) = layers.split_first() {
            let nearer = |other: &Layer<A>| compare(&other.at, &shown.at).is_lt();
            self.wrong_samples += u64::from(rest.iter().any(nearer));
        }
        self.pairs.settle(false);
    }

    /// Of all samples.
    pub fn all(self) -> OrderErrors {
        let ErrorCount {
            wrong_samples,
            mut pairs,
        } = self;
        pairs.settle(true);
        let wrong = pairs.wrong.len() as u64;
        pairs.right.append(&mut pairs.wrong);
        pairs.right.sort_unstable();
        pairs.right.dedup();
        let cyclic = items_in_cycles(&pairs.right);
        let mut overlapping = pairs.right;
        for pair in &mut overlapping {
            *pair = (pair.0.min(pair.1), pair.0.max(pair.1));
        }
        overlapping.sort_unstable();
        overlapping.dedup();
        OrderErrors {
            pairs: overlapping.len() as u64,
            wrong,
            wrong_samples,
            cyclic,
        }
    }
}

/// Pairs (nearer, deeper) that were drawn in the right and in the wrong order.
#[derive(Default)]
struct Pairs {
    right: Vec<(ItemId, ItemId)>,
    wrong: Vec<(ItemId, ItemId)>,
    /// How many there were when they were sorted last.
    sorted: usize,
}

impl Pairs {
    /// Sorts and drops what is there twice, where there is much that is new.
    fn settle(&mut self, now: bool) {
        if now || self.right.len() + self.wrong.len() > 2 * self.sorted + 1_000_000 {
            for list in [&mut self.right, &mut self.wrong] {
                list.sort_unstable();
                list.dedup();
            }
            self.sorted = self.right.len() + self.wrong.len();
        }
    }
}
