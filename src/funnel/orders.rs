//! Depth orders of the items that the chain leaves.
//!
//! A row has the fragments that an early z-test saves, the errors of a painter without
//! z-test, and the time of sorting.

use std::borrow::Cow;
use std::cell::RefCell;
use std::collections::BTreeMap;

use serde::Serialize;

use super::item_stages::ItemStages;
use super::task::{FunnelKey, KeyedTask};
use super::world::{Shape, World};
use crate::measure::Ask;
use crate::query::ItemId;
use crate::statistics::{Estimate, flat};
use crate::visibility::fragment::order::{self, ORDERS};
use crate::visibility::fragment::{self, DepthOrder, OrderErrors, Piece, Tally, draw_orders};
use crate::visibility::truth::{Crossing, Probe, RayIndex, SurfaceIndex};
use crate::visibility::{Guarantee, Rays, Solids};

/// Items as listed, and from front to back.
pub const SORTED: [&str; 2] = ["none", "box-distance"];

/// A depth order over all views. Counts are means per view.
#[derive(Clone, Default, Debug, Serialize)]
pub struct OrderRow {
    /// Name in the table of orders.
    pub name: &'static str,
    /// One line about it.
    pub summary: &'static str,
    /// Samples that meet an item, counted for each: a box with or without holes, or
    /// opaque triangles. Clear ones and cut-outs hide nothing, so no order saves any.
    pub fragment_count: f64,
    /// Fragments that pass the z-test when they come, and are shaded.
    pub shaded_count: f64,
    /// Samples that anything covers.
    pub covered_count: f64,
    /// Shaded / covered: 1 at best.
    pub overdraw: Option<f64>,
    /// Pairs of items that overlap in the image.
    pub pair_count: f64,
    /// Pairs in the wrong order.
    pub wrong_pair_count: f64,
    /// Samples that show a wrong item without a z-test, back to front.
    pub wrong_sample_count: f64,
    /// Declared guarantee of the order.
    pub guarantee: Guarantee,
    /// Reasons for which the guarantee does not hold, with the number of views.
    pub exceptions: BTreeMap<&'static str, usize>,
    /// Thread CPU time of sorting the items of a view.
    #[serde(flatten, serialize_with = "flat::stage_ns")]
    pub time: Option<Estimate>,
}

/// Items of a view, and every order prepared for them.
struct Left {
    items: Vec<ItemId>,
    /// Solid boxes, or the boxes about the items.
    boxes: Solids,
    cut_outs: Option<fragment::Holes>,
    orders: Vec<(&'static order::OrderRow, Box<dyn DepthOrder>)>,
}

/// Items that the chain leaves of every view, to be ordered.
pub struct Orders<'w> {
    world: &'w World<'w>,
    views: Vec<Left>,
}

impl Left {
    fn of(world: &World, all: &Solids, items: &[ItemId], is_all: bool) -> Left {
        let boxes = all.some(items);
        let are_solid = world.shape.boxes().is_some();
        let wanted = ORDERS.iter();
        let wanted = wanted.filter(|row| is_all || SORTED.contains(&row.name));
        let built = wanted.filter_map(|row| Some((row, (row.build)(&boxes, are_solid)?)));
        Left {
            orders: built.collect(),
            cut_outs: world.cut_outs.as_ref().map(|surfaces| surfaces.some(items)),
            items: items.to_vec(),
            boxes,
        }
    }
}

impl<'w> Orders<'w> {
    /// Orders of the remaining items, all or [`SORTED`].
    pub fn new(stages: &ItemStages<'w>, is_all: bool) -> Orders<'w> {
        let world = stages.world;
        let all = match world.shape.boxes() {
            Some(solids) => Cow::Borrowed(solids),
            None => Cow::Owned(Solids::of(world.scene)),
        };
        let of = |view| Left::of(world, &all, &stages.listed(view), is_all);
        let views = world.views().map(of).collect();
        Orders { world, views }
    }

    /// The rows, the same in every view.
    fn rows(&self) -> impl Iterator<Item = &'static order::OrderRow> {
        let orders = self.views.first().map(|left| &left.orders);
        orders.into_iter().flatten().map(|(row, _)| *row)
    }

    pub fn tasks(&self) -> impl Iterator<Item = KeyedTask<'_>> {
        self.rows().enumerate().map(move |(order, row)| {
            let pieces = RefCell::new(Vec::new());
            let ask: Ask = Box::new(move |view, out| {
                let pieces = &mut *pieces.borrow_mut();
                let (_, order) = &self.views[view].orders[order];
                order.order(&self.world.rays(view).camera, pieces);
                out.extend(pieces.iter().map(|piece| piece.item));
            });
            (FunnelKey::Order(row.name.to_owned()), ask)
        })
    }

    /// Draws every view in every order.
    ///
    /// # Errors
    /// Too many items behind each other.
    pub fn drawn(&self) -> Result<Vec<OrderRow>, String> {
        let mut rows: Vec<OrderRow> = self.rows().map(OrderRow::new).collect();
        // Processes that only time need no tree of the triangles.
        let index = match &self.world.shape {
            Shape::Boxes(_) => None,
            Shape::Triangles(surfaces) => Some(SurfaceIndex::build(surfaces)),
        };
        for (view, left) in self.views.iter().enumerate() {
            let rays = self.world.rays(view);
            let counts = self.counted(left, rays, index.as_ref());
            for ((row, (_, order)), (tally, errors)) in
                rows.iter_mut().zip(&left.orders).zip(counts)
            {
                row.add(&tally, &errors?, self.views.len() as f64);
                if let Some(reason) = order.exception(&rays.camera) {
                    *row.exceptions.entry(reason).or_default() += 1;
                }
            }
        }
        for row in &mut rows {
            let covered = Some(row.covered_count).filter(|count| *count > 0.0);
            row.overdraw = covered.map(|covered| row.shaded_count / covered);
        }
        Ok(rows)
    }

    /// Fragments and errors of each order of a view.
    fn counted(
        &self,
        left: &Left,
        rays: &Rays,
        index: Option<&SurfaceIndex>,
    ) -> Vec<(Tally, Result<OrderErrors, String>)> {
        let (samples, items) = (self.world.samples, &left.items);
        let sorted = left.orders.iter().map(|(_, order)| {
            let mut pieces = Vec::new();
            order.order(&rays.camera, &mut pieces);
            pieces
        });
        let sorted: Vec<Vec<Piece>> = sorted.collect();
        if let Some(index) = index {
            return draw_orders(rays, samples, index, items, &|_, _, _| true, &sorted);
        }
        let all: Vec<ItemId> = (0..items.len() as ItemId).collect();
        let is_opaque = |item: ItemId, probe: &Probe, at: &Crossing| {
            let b = &left.boxes.boxes[item as usize];
            let mut holes = left.cut_outs.iter();
            holes.all(|holes| holes.opaque(item, b, probe, at))
        };
        let index = RayIndex::build(&left.boxes);
        draw_orders(rays, samples, &index, &all, &is_opaque, &sorted)
    }
}

impl OrderRow {
    fn new(row: &order::OrderRow) -> OrderRow {
        OrderRow {
            name: row.name,
            summary: row.summary,
            guarantee: row.guarantee,
            ..OrderRow::default()
        }
    }

    /// Adds one of `views` views to the means.
    fn add(&mut self, tally: &Tally, errors: &OrderErrors, views: f64) {
        for (mean, count) in [
            (&mut self.fragment_count, tally.fragment_count),
            (&mut self.shaded_count, tally.shaded_count),
            (&mut self.covered_count, tally.covered_count),
            (&mut self.pair_count, errors.pairs),
            (&mut self.wrong_pair_count, errors.wrong),
            (&mut self.wrong_sample_count, errors.wrong_samples),
        ] {
            *mean += count as f64 / views;
        }
    }
}
