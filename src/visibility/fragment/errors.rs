//! Cost and errors of draw orders, by the exact order of depths at each sample.
//!
//! Items are drawn in several orders at once, ray by ray. An item at a sample is one fragment,
//! where the ray meets it first; a one-sided triangle is met from its front only.

use std::cmp::Ordering;
use std::collections::HashSet;

use super::canvas::{Rectangle, Screen};
use super::draw::{Drawable, Tally};
use super::order::Piece;
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::truth::{Along, BodyIndex};
use crate::visibility::{Rays, SampleGrid};

/// The errors of an order that should be front to back.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct OrderErrors {
    /// Pairs of items that overlap in the image: both met by a sample's ray, at
    /// different depths.
    pub pairs: u64,
    /// Pairs that are drawn the wrong way round at a sample.
    pub wrong: u64,
    /// Samples that show a wrong item if the list is drawn back to front without a
    /// z-test (painter's algorithm).
    pub wrong_samples: u64,
}

/// Most pairs of layers that are compared in an image.
///
/// A sample with the layers of the one before adds none.
const MOST_PAIRS: u64 = 1 << 25;

/// A fragment, where its ray meets the item and when it was drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layer<A> {
    pub when: u32,
    pub item: ItemId,
    pub at: A,
}

/// The errors so far, sample by sample.
#[derive(Default)]
pub(super) struct ErrorCount {
    wrong_samples: u64,
    /// Pairs (nearer, deeper) that were drawn in the right and in the wrong order.
    right: HashSet<(ItemId, ItemId)>,
    wrong: HashSet<(ItemId, ItemId)>,
    /// Items of the last sample in the order in which they were drawn, each with its
    /// place in the exact order of depths; items at the same depth share one.
    ranked: Vec<(ItemId, u32)>,
    looked_at: u64,
}

impl ErrorCount {
    /// Adds a sample: all its layers, and the exact order of two of them.
    ///
    /// Returns how many pass the z-test when they come.
    pub fn sample<A>(
        &mut self,
        layers: &mut Vec<Layer<A>>,
        compare: impl Fn(&A, &A) -> Ordering,
    ) -> u64 {
        // A ray along a cut meets both parts: the first counts.
        layers.sort_by_key(|layer| (layer.item, layer.when));
        layers.dedup_by_key(|layer| layer.item);
        layers.sort_by_key(|layer| layer.when);
        let mut ranked: Vec<(ItemId, u32)> = layers.iter().map(|l| (l.item, 0)).collect();
        let mut by_depth: Vec<usize> = (0..layers.len()).collect();
        by_depth.sort_by(|&a, &b| compare(&layers[a].at, &layers[b].at));
        let mut rank = 0;
        for pair in by_depth.windows(2) {
            rank += u32::from(compare(&layers[pair[0]].at, &layers[pair[1]].at).is_lt());
            ranked[pair[1]].1 = rank;
        }
        // Nearer than all before, of a tie the lower id.
        let (mut front, mut shaded) = ((u32::MAX, ItemId::MAX), 0);
        for &(item, rank) in &ranked {
            shaded += u64::from((rank, item) < front);
            front = front.min((rank, item));
        }
        // Painted from the last to the first: the first of the list stays.
        self.wrong_samples += u64::from(ranked.first().is_some_and(|first| first.1 > 0));
        if ranked != self.ranked {
            if rank > 0 {
                self.pairs_of(&ranked);
            }
            self.ranked = ranked;
        }
        shaded
    }

    /// Adds the pairs of a sample, unless there are too many.
    fn pairs_of(&mut self, ranked: &[(ItemId, u32)]) {
        let layers = ranked.len() as u64;
        self.looked_at += layers * (layers - 1) / 2;
        if self.looked_at > MOST_PAIRS {
            return;
        }
        for (i, a) in ranked.iter().enumerate() {
            for b in &ranked[i + 1..] {
                match a.1.cmp(&b.1) {
                    Ordering::Less => self.right.insert((a.0, b.0)),
                    Ordering::Greater => self.wrong.insert((b.0, a.0)),
                    Ordering::Equal => false,
                };
            }
        }
    }

    /// The errors of all samples; the reason where more pairs than are compared occur.
    pub fn all(self) -> Result<OrderErrors, String> {
        if self.looked_at > MOST_PAIRS {
            return Err(format!(
                "more than {MOST_PAIRS} pairs of layers at the samples of a view; \
                 expected fewer samples or fewer items behind each other"
            ));
        }
        let all = self.right.union(&self.wrong);
        let unordered = all.map(|&(a, b)| (a.min(b), a.max(b)));
        Ok(OrderErrors {
            pairs: unordered.collect::<HashSet<_>>().len() as u64,
            wrong: self.wrong.len() as u64,
            wrong_samples: self.wrong_samples,
        })
    }
}

/// A part of an item, the samples that it may be met at, and its place in the list.
type Placed = (Option<WorldBox>, Rectangle, u32);

/// The parts of an item, and those that may be met in a row of samples.
#[derive(Clone, Default)]
struct Parts {
    all: Vec<Placed>,
    row: Option<u32>,
    in_row: Vec<Placed>,
}

impl Parts {
    /// Place in the list of the first part that holds a point at a sample.
    fn when<B: Drawable>(
        &mut self,
        (row, column): (u32, u32),
        (probe, at): (&B::Probe, &B::At),
    ) -> Option<u32> {
        let first = self.all.first()?.2;
        if self.all.len() == 1 {
            return Some(first);
        }
        if self.row.replace(row) != Some(row) {
            let in_row = self.all.iter().filter(|(_, of, _)| of.rows.contains(&row));
            self.in_row.clear();
            self.in_row.extend(in_row.cloned());
        }
        let is_in = |part: &WorldBox| B::is_in(part, probe, at);
        let holds = |(part, of, _): &&Placed| {
            of.columns.contains(&column) && part.as_ref().is_none_or(is_in)
        };
        self.in_row.iter().find(holds).map(|part| part.2)
    }
}

/// Cost and errors of several orders of the items that are left.
///
/// `left` has their ids among those of `index`, ascending; pieces and `is_opaque` number items
/// by the place there. Fragments are counted whether opaque or not. O(fragments log layers),
/// plus the parts in its row of samples for each fragment of a cut item, plus the pairs that are
/// looked at.
pub fn draw_orders<B: Drawable, F: Fn(ItemId, &B::Probe, &B::At) -> bool>(
    rays: &Rays,
    grid: SampleGrid,
    index: &BodyIndex<B>,
    left: &[ItemId],
    is_opaque: &F,
    orders: &[Vec<Piece>],
) -> Vec<(Tally, Result<OrderErrors, String>)> {
    let screen = Screen::of(rays, grid);
    let parts_of = |pieces: &[Piece]| {
        let mut parts = vec![Parts::default(); left.len()];
        for (Piece { item, part }, when) in pieces.iter().zip(0..) {
            let place = match part {
                Some(b) => screen.rectangle(b).unwrap_or_default(),
                None => Rectangle {
                    columns: 0..grid.width,
                    rows: 0..grid.height,
                },
            };
            parts[*item as usize].all.push((*part, place, when));
        }
        parts
    };
    let parts = orders.iter().map(|pieces| parts_of(pieces));
    let mut parts: Vec<Vec<Parts>> = parts.collect();
    let mut counts: Vec<(Tally, ErrorCount)> = orders.iter().map(|_| Default::default()).collect();
    let mut layers: Vec<Layer<B::At>> = Vec::new();
    for sample in (0..grid.height).flat_map(|row| (0..grid.width).map(move |c| (row, c))) {
        let ray = rays.sample(grid, sample.1, sample.0);
        let probe = index.probe(&ray);
        let mut met = index.all_along(&ray);
        met.retain_mut(|(item, _)| {
            let place = left.binary_search(item);
            *item = place.unwrap_or_default() as ItemId;
            place.is_ok()
        });
        met.sort_unstable_by(|(a, at_a), (b, at_b)| a.cmp(b).then(probe.compare(at_a, at_b)));
        met.dedup_by_key(|(item, _)| *item);
        let fragments = met.len() as u64;
        met.retain(|(item, at)| is_opaque(*item, &probe, at));
        for (parts, (tally, errors)) in parts.iter_mut().zip(&mut counts) {
            layers.clear();
            layers.extend(met.iter().filter_map(|&(item, at)| {
                let parts = &mut parts[item as usize];
                let when = parts.when::<B>(sample, (&probe, &at))?;
                Some(Layer { when, item, at })
            }));
            tally.fragment_count += fragments;
            tally.covered_count += u64::from(!layers.is_empty());
            tally.shaded_count += errors.sample(&mut layers, |a, b| probe.compare(a, b));
        }
    }
    let all = counts.into_iter();
    all.map(|(tally, errors)| (tally, errors.all())).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::scene::SeededRng;

    fn layer(when: u32, item: ItemId, at: u32) -> Layer<u32> {
        Layer { when, item, at }
    }

    #[test]
    fn pairs_are_those_of_every_sample_by_itself() {
        let mut rng = SeededRng::new(4);
        for _ in 0..40 {
            let (mut count, mut wrong_samples) = (ErrorCount::default(), 0);
            let (mut right, mut wrong) = (BTreeSet::new(), BTreeSet::new());
            let mut layers: Vec<Layer<u32>> = Vec::new();
            for _ in 0..30 {
                // The layers of the sample before, or others.
                if rng.below(3) == 0 {
                    let items = 1 + rng.below(9) as u32;
                    layers = (0..items).map(|i| layer(i, i * 7 % 11, 0)).collect();
                    layers.iter_mut().for_each(|l| l.at = rng.below(4) as u32);
                }
                for (i, a) in layers.iter().enumerate() {
                    for b in layers[i + 1..].iter().filter(|b| b.at != a.at) {
                        match a.at < b.at {
                            true => right.insert((a.item, b.item)),
                            false => wrong.insert((b.item, a.item)),
                        };
                    }
                }
                let nearest = layers.iter().map(|l| l.at).min();
                wrong_samples += u64::from(layers.first().map(|l| l.at) > nearest);
                count.sample(&mut layers.clone(), u32::cmp);
            }
            let errors = count.all().unwrap();
            assert_eq!(
                (errors.wrong, errors.wrong_samples),
                (wrong.len() as u64, wrong_samples)
            );
            let both = right.union(&wrong).map(|&(a, b)| (a.min(b), a.max(b)));
            assert_eq!(errors.pairs, both.collect::<BTreeSet<_>>().len() as u64);
        }
    }

    #[test]
    fn layers_of_one_depth_are_no_pairs_and_too_many_pairs_are_refused() {
        let mut count = ErrorCount::default();
        count.sample(
            &mut (0..200_000).map(|i| layer(i, i, 5)).collect(),
            u32::cmp,
        );
        assert_eq!(count.all(), Ok(OrderErrors::default()));
        let mut count = ErrorCount::default();
        // The same layers at every sample are looked at once.
        let behind: Vec<Layer<u32>> = (0..1000).map(|i| layer(i, i, i)).collect();
        for _ in 0..100 {
            count.sample(&mut behind.clone(), u32::cmp);
        }
        assert_eq!(count.looked_at, 499_500);
        count.sample(&mut (0..9000).map(|i| layer(i, i, i)).collect(), u32::cmp);
        assert!(count.all().is_err());
    }
}
