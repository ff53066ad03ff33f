//! The order in which what is left is drawn: how many fragments an early z-test keeps
//! from being shaded, what a painter without z-test would get wrong, what sorting takes.

use std::collections::BTreeMap;

use serde::Serialize;

use super::pass::Pass;
use super::stage::by_name;
use super::times::Times;
use super::world::World;
use crate::visibility::fragment::order::ORDERS;
use crate::visibility::fragment::{Canvas, DepthOrder, Piece, Surfaces, Tests, draw, order_errors};
use crate::visibility::{Guarantee, Rays, SampleGrid, Solids};

/// A depth order over all views. Counts are means per view.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct OrderRow {
    /// As in the table of orders.
    pub name: &'static str,
    /// One line about it.
    pub summary: &'static str,
    /// Fragments of all items that are left: samples that meet an item, holes or not.
    pub fragment_count: f64,
    /// Of them those that pass the z-test when they come, and are shaded.
    pub shaded_count: f64,
    /// Samples that anything covers.
    pub covered_count: f64,
    /// Shaded / covered: 1 at best.
    pub overdraw: Option<f64>,
    /// Pairs of items that overlap in the image.
    pub pair_count: f64,
    /// Of them those in the wrong order.
    pub wrong_pair_count: f64,
    /// Samples that show a wrong item without a z-test, back to front.
    pub wrong_sample_count: f64,
    /// Items on cycles of overlaps, for which no order is right.
    pub cyclic_count: f64,
    /// What the order promises.
    #[serde(serialize_with = "by_name")]
    pub guarantee: Guarantee,
    /// Why it does not hold in some views, and in how many.
    pub exceptions: BTreeMap<&'static str, usize>,
    /// Thread CPU time of bringing the items of a view into this order.
    #[serde(flatten)]
    pub times: Times,
}

/// What is left of a view, and every order prepared for it.
struct Left {
    solids: Solids,
    cut_outs: Option<Surfaces>,
    rays: Rays,
    orders: Vec<Box<dyn DepthOrder>>,
}

/// What is left of every view.
pub struct Orders {
    views: Vec<Left>,
}

impl Orders {
    /// For a set of items of each view.
    pub fn of(world: &World, all: &Solids, pass: &Pass, set: usize) -> Orders {
        let views = (0..world.views()).map(|view| {
            let items = world.listed(pass.items(set, view));
            let solids = all.some(&items);
            Left {
                orders: ORDERS.iter().map(|row| (row.build)(&solids)).collect(),
                rays: *world.rays(view),
                cut_outs: world
                    .cut_outs
                    .as_ref()
                    .map(|surfaces| surfaces.some(&items)),
                solids,
            }
        });
        Orders {
            views: views.collect(),
        }
    }

    /// Brings a view into an order; the number of pieces.
    pub fn sort(&self, order: usize, view: usize, pieces: &mut Vec<Piece>) -> u64 {
        let left = &self.views[view];
        left.orders[order].order(&left.solids, left.rays.camera(), pieces);
        pieces.len() as u64
    }

    /// Draws every view in every order; `None` if stopped.
    pub fn drawn(&self, samples: SampleGrid, stop: &dyn Fn() -> bool) -> Option<Vec<OrderRow>> {
        let mut rows = Vec::new();
        for (order, row) in ORDERS.iter().enumerate() {
            let mut sums = [0.0; 7];
            let mut exceptions = BTreeMap::new();
            for (view, left) in self.views.iter().enumerate() {
                if stop() {
                    return None;
                }
                let canvas = Canvas::of(&left.rays, samples);
                let mut pieces = Vec::new();
                self.sort(order, view, &mut pieces);
                if let Some(reason) = left.orders[order].exception(left.rays.camera()) {
                    *exceptions.entry(reason).or_default() += 1;
                }
                let tests = Tests {
                    surfaces: left.cut_outs.as_ref(),
                    stencil: None,
                };
                let tally = draw(&canvas, &left.solids, &pieces, &tests).tally;
                let errors = order_errors(&canvas, &left.solids, &pieces, &tests);
                let counts = [
                    tally.fragments,
                    tally.passed,
                    tally.covered,
                    errors.pairs,
                    errors.wrong,
                    errors.wrong_samples,
                    errors.cyclic as u64,
                ];
                for (sum, count) in sums.iter_mut().zip(counts) {
                    *sum += count as f64 / self.views.len() as f64;
                }
            }
            let [
                fragments,
                shaded,
                covered,
                pairs,
                wrong,
                wrong_samples,
                cyclic,
            ] = sums;
            rows.push(OrderRow {
                name: row.name,
                summary: row.summary,
                fragment_count: fragments,
                shaded_count: shaded,
                covered_count: covered,
                overdraw: (covered > 0.0).then(|| shaded / covered),
                pair_count: pairs,
                wrong_pair_count: wrong,
                wrong_sample_count: wrong_samples,
                cyclic_count: cyclic,
                guarantee: row.guarantee,
                exceptions,
                times: Times::default(),
            });
        }
        Some(rows)
    }
}

/// How many orders there are.
pub const COUNT: usize = ORDERS.len();
