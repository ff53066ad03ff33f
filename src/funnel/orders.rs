//! The order in which what is left is drawn: how many fragments an early z-test keeps
//! from being shaded, what a painter without z-test would get wrong, what sorting takes.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

use serde::Serialize;

use super::left_out::{LeftOutRow, Reason, fits_drawing};
use super::pass::Pass;
use super::stage::by_name;
use super::times::Times;
use super::world::World;
use crate::query::ItemId;
use crate::scene::Surfaces;
use crate::visibility::fragment::order::{self, ORDERS};
use crate::visibility::fragment::{
    self, Canvas, DepthOrder, OrderErrors, Part, Piece, Screen, Tally, Tests, ToOrder,
    TooManyPairs, draw, draw_surfaces, order_errors,
};
use crate::visibility::truth::SurfaceIndex;
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
    items: Vec<ItemId>,
    /// As they are, or the boxes about them.
    boxes: Solids,
    cut_outs: Option<fragment::Surfaces>,
    rays: Rays,
    orders: Vec<Box<dyn DepthOrder>>,
}

/// What is left of every view.
pub struct Orders {
    rows: Vec<&'static order::OrderRow>,
    views: Vec<Left>,
    /// The triangles that are drawn, of a scene whose items are no solid boxes.
    triangles: Option<Arc<Surfaces>>,
    /// Orders whose pieces are too much to be drawn.
    pub left_out: Vec<LeftOutRow>,
}

impl Left {
    /// Refuses an order that cuts items into pieces of which too much would be drawn.
    fn fits(&self, order: usize, samples: SampleGrid) -> Result<(), Reason> {
        let mut pieces = Vec::new();
        self.orders[order].order(&self.boxes, self.rays.camera(), &mut pieces);
        if pieces.len() == self.items.len() {
            return Ok(());
        }
        let screen = Screen::of(&self.rays, samples);
        let drawn = pieces.iter().filter_map(|piece| match &piece.part {
            Some(Part::Within(part)) => screen.rectangle(part),
            _ => screen.rectangle(&self.boxes.boxes[piece.item as usize]),
        });
        fits_drawing(samples, drawn)
    }
}

impl Orders {
    /// For a set of items of each view; none for what is too much to be drawn.
    pub fn of(world: &World, pass: &Pass, set: usize, too_much: Option<&Reason>) -> Orders {
        let surfaces = world.surfaces.as_deref();
        let all = match &world.solids {
            Some(solids) => Cow::Borrowed(solids),
            None => Cow::Owned(Solids::of(world.scene)),
        };
        let mut rows: Vec<&'static order::OrderRow> = Vec::new();
        let mut left_out = Vec::new();
        left_out.extend(too_much.map(|reason| LeftOutRow::of("orders", "all", reason.clone())));
        let views = if too_much.is_some() {
            0..0
        } else {
            0..world.views()
        };
        let views = views.map(|view| {
            let items = world.listed(pass.items(set, view));
            let boxes = all.some(&items);
            let triangles = surfaces.map(|surfaces| surfaces.some(&items));
            let to_order = match &triangles {
                None => ToOrder::boxes(&boxes),
                Some(own) => ToOrder::surfaces(&boxes, own, world.scene.own_tree.as_ref()),
            };
            let built = ORDERS.iter();
            let built = built.filter_map(|row| Some((row, (row.build)(&to_order)?)));
            let (known, orders) = built.unzip();
            rows = known;
            Left {
                orders,
                rays: *world.rays(view),
                cut_outs: world
                    .cut_outs
                    .as_ref()
                    .map(|surfaces| surfaces.some(&items)),
                items: items.into_owned(),
                boxes,
            }
        });
        let mut views: Vec<Left> = views.collect();
        // Triangles are met by rays, whatever the pieces are.
        let cuts = if surfaces.is_none() { rows.len() } else { 0 };
        for order in (0..cuts).rev() {
            let fits = |left: &Left| left.fits(order, world.samples);
            if let Err(reason) = views.iter().try_for_each(fits) {
                let row = rows.remove(order);
                left_out.push(LeftOutRow::of("orders", row.name, reason));
                views
                    .iter_mut()
                    .for_each(|left| drop(left.orders.remove(order)));
            }
        }
        Orders {
            views,
            rows,
            triangles: world.surfaces.clone(),
            left_out,
        }
    }

    /// How many orders there are.
    pub fn count(&self) -> usize {
        self.rows.len()
    }

    /// Brings a view into an order.
    pub fn sort(&self, order: usize, view: usize, pieces: &mut Vec<Piece>) {
        let left = &self.views[view];
        left.orders[order].order(&left.boxes, left.rays.camera(), pieces);
    }

    /// Draws every view in every order; `None` if stopped.
    ///
    /// # Errors
    /// Too many items behind each other.
    pub fn drawn(
        &self,
        samples: SampleGrid,
        stop: &dyn Fn() -> bool,
    ) -> Result<Option<Vec<OrderRow>>, TooManyPairs> {
        let mut sums = vec![[0.0; 7]; self.count()];
        let mut exceptions = vec![BTreeMap::new(); self.count()];
        // Here and not before: processes that time need no tree of the triangles.
        let index = self.triangles.as_deref().map(SurfaceIndex::build);
        for (view, left) in self.views.iter().enumerate() {
            if stop() {
                return Ok(None);
            }
            let sorted = (0..self.count()).map(|order| {
                let mut pieces = Vec::new();
                self.sort(order, view, &mut pieces);
                pieces
            });
            let sorted = sorted.collect();
            let Some(counts) = self.counted(left, index.as_ref(), samples, sorted, stop) else {
                return Ok(None);
            };
            for (sums, (tally, errors)) in sums.iter_mut().zip(counts) {
                let errors = errors?;
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
            for (order, exceptions) in left.orders.iter().zip(&mut exceptions) {
                if let Some(reason) = order.exception(left.rays.camera()) {
                    *exceptions.entry(reason).or_default() += 1;
                }
            }
        }
        let rows = self.rows.iter().zip(sums).zip(exceptions);
        let rows = rows.map(|((row, sums), exceptions)| {
            let [
                fragments,
                shaded,
                covered,
                pairs,
                wrong,
                wrong_samples,
                cyclic,
            ] = sums;
            OrderRow {
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
            }
        });
        Ok(Some(rows.collect()))
    }

    /// What each order of a view takes and gets wrong.
    fn counted(
        &self,
        left: &Left,
        index: Option<&SurfaceIndex>,
        samples: SampleGrid,
        sorted: Vec<Vec<Piece>>,
        stop: &dyn Fn() -> bool,
    ) -> Option<Vec<(Tally, Result<OrderErrors, TooManyPairs>)>> {
        if let (Some(index), Some(all)) = (index, &self.triangles) {
            let orders = left.orders.iter().map(|order| &**order);
            let orders: Vec<_> = orders.zip(sorted).collect();
            let (rays, items) = (&left.rays, &left.items);
            return Some(draw_surfaces(
                rays, samples, index, all.origin, items, &orders,
            ));
        }
        let canvas = Canvas::of(&left.rays, samples);
        let tests = Tests {
            surfaces: left.cut_outs.as_ref(),
            stencil: None,
        };
        let counts = sorted.iter().map(|pieces| {
            let tally = draw(&canvas, &left.boxes, pieces, &tests).tally;
            let errors = order_errors(&canvas, &left.boxes, pieces, &tests);
            (!stop()).then_some((tally, errors))
        });
        counts.collect()
    }
}
