//! Items of triangles drawn in several orders at once, ray by ray.
//!
//! The counts are those of [`draw`] and [`order_errors`] for boxes.
//!
//! An item at a sample is one fragment, where the ray meets it first. Every item is taken
//! for solid; a one-sided triangle is met from its front only.
//!
//! [`draw`]: super::draw
//! [`order_errors`]: super::order_errors

use glam::DVec3;

use super::draw::Tally;
use super::errors::{ErrorCount, Layer, OrderErrors, TooManyPairs};
use super::order::{DepthOrder, Part, Piece};
use crate::kernel::each;
use crate::query::ItemId;
use crate::visibility::truth::{Meeting, SurfaceIndex, TriangleProbe};
use crate::visibility::{Rays, SampleGrid};

/// When each part of each item is drawn.
struct Ranks {
    /// Leaf (or none) and place in the list of each part, by item.
    of: Vec<Vec<(Option<u32>, u32)>>,
}

impl Ranks {
    fn of(pieces: &[Piece], items: usize) -> Ranks {
        let mut ranks = vec![Vec::new(); items];
        for (piece, when) in pieces.iter().zip(0..) {
            let leaf = match piece.part {
                Some(Part::InLeaf(leaf)) => Some(leaf),
                _ => None,
            };
            ranks[piece.item as usize].push((leaf, when));
        }
        Ranks { of: ranks }
    }

    /// Place in the list at which an item is drawn at a point.
    ///
    /// A point that rounding has put into a leaf without a part of it counts with its first part.
    fn when(&self, item: ItemId, leaf: impl FnOnce() -> Option<u32>) -> Option<u32> {
        let parts = &self.of[item as usize];
        let first = parts.first()?;
        if first.0.is_none() {
            return Some(first.1);
        }
        let leaf = leaf();
        let found = parts.iter().find(|part| part.0 == leaf);
        Some(found.unwrap_or(first).1)
    }
}

/// Cost and errors of several orders of the items that are left.
///
/// `left` has their ids among those of `index`, ascending; pieces are numbered by the place
/// there. O(fragments log layers) and the pairs that are looked at.
pub fn draw_surfaces(
    rays: &Rays,
    grid: SampleGrid,
    index: &SurfaceIndex,
    origin: DVec3,
    left: &[ItemId],
    orders: &[(&dyn DepthOrder, Vec<Piece>)],
) -> Vec<(Tally, Result<OrderErrors, TooManyPairs>)> {
    let ranks: Vec<Ranks> = orders
        .iter()
        .map(|(_, pieces)| Ranks::of(pieces, left.len()))
        .collect();
    let mut counts: Vec<_> = orders
        .iter()
        .map(|_| (Tally::default(), ErrorCount::default()))
        .collect();
    let mut layers: Vec<Layer<Meeting>> = Vec::new();
    for (row, column) in (0..grid.height).flat_map(|row| (0..grid.width).map(move |c| (row, c))) {
        let ray = rays.sample(grid, column, row);
        let probe = TriangleProbe::new(ray, origin);
        let mut met = index.all_along(&ray);
        met.retain_mut(|(item, _)| {
            let place = left.binary_search(item);
            *item = place.unwrap_or_default() as ItemId;
            place.is_ok()
        });
        met.sort_unstable_by(|(a, at_a), (b, at_b)| a.cmp(b).then(probe.compare(at_a, at_b)));
        met.dedup_by_key(|(item, _)| *item);
        for (((order, _), ranks), (tally, errors)) in orders.iter().zip(&ranks).zip(&mut counts) {
            layers.clear();
            layers.extend(met.iter().filter_map(|&(item, at)| {
                let leaf = || {
                    let [a, b, c] = each(at.corners(), |p| p.as_dvec3());
                    let point = (ray.origin - origin) + ray.direction * at.depth;
                    order.leaf(point, (b - a).cross(c - a))
                };
                let when = ranks.when(item, leaf)?;
                Some(Layer { when, item, at })
            }));
            errors.sample(&mut layers, |a, b| probe.compare(a, b));
            tally.fragments += layers.len() as u64;
            tally.covered += u64::from(!layers.is_empty());
            // The z-test: nearer than all before, of a tie the lower id.
            let mut front: Option<&Layer<Meeting>> = None;
            for layer in &layers {
                let passes = front.is_none_or(|front| {
                    let order = probe.compare(&layer.at, &front.at);
                    order.then(layer.item.cmp(&front.item)).is_lt()
                });
                if passes {
                    tally.passed += 1;
                    front = Some(layer);
                }
            }
        }
    }
    let all = counts.into_iter();
    all.map(|(tally, errors)| (tally, errors.all())).collect()
}
