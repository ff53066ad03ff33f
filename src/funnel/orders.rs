//! Draw orders of the items that the chain leaves.
//!
//! A row has the fragments that an early z-test saves, and the time of sorting.

use std::borrow::Cow;

use serde::Serialize;

use super::item_stages::ItemStages;
use super::task::{FunnelKey, KeyedTask};
use super::world::{Shape, World};
use crate::measure::Ask;
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::statistics::{Estimate, flat};
use crate::visibility::fragment::{DrawOrder, ORDERS, Tally, draw_orders};
use crate::visibility::truth::{BodyIndex, Boxes, Crossing, Probe, SolidBox, SurfaceIndex};

/// A draw order over all views. Counts are means per view.
#[derive(Clone, Default, Debug, Serialize)]
pub struct OrderRow {
    /// The order.
    #[serde(rename = "name")]
    pub order: DrawOrder,
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
    /// Thread CPU time of sorting the items of a view.
    #[serde(flatten, serialize_with = "flat::stage_ns")]
    pub time: Option<Estimate>,
}

/// Items that the chain leaves of every view, to be ordered.
pub struct Orders<'w> {
    world: &'w World<'w>,
    /// Items of each view as boxes, or the boxes about them.
    views: Vec<Vec<SolidBox>>,
}

impl<'w> Orders<'w> {
    /// Orders of the remaining items.
    pub fn new(stages: &ItemStages<'w>) -> Orders<'w> {
        let world = stages.world;
        let boxes: Cow<[WorldBox]> = match world.shape.boxes() {
            Some(solids) => Cow::Borrowed(&solids.boxes),
            None => world.scene.written().collect(),
        };
        let left = |view| SolidBox::some(&boxes, &stages.listed(view)).collect();
        let views = world.views().map(left).collect();
        Orders { world, views }
    }

    pub fn tasks(&self) -> impl Iterator<Item = KeyedTask<'_>> {
        DrawOrder::ALL.into_iter().map(move |order| {
            let ask: Ask = Box::new(move |view, out| {
                order.sort(&self.world.rays(view).camera, &self.views[view], out);
            });
            (FunnelKey::Order(order), ask)
        })
    }

    /// Draws every view in every order.
    pub fn drawn(&self) -> Vec<OrderRow> {
        // Processes that only time need no tree of the triangles.
        let index = match &self.world.shape {
            Shape::Boxes(_) => None,
            Shape::Triangles(surfaces) => Some(SurfaceIndex::build(surfaces)),
        };
        let mut rows = ORDERS.map(|(order, _, summary)| OrderRow {
            order,
            summary,
            ..OrderRow::default()
        });
        for view in self.world.views() {
            let tallies = self.counted(view, index.as_ref());
            for (row, tally) in rows.iter_mut().zip(tallies) {
                let mean = |count: u64| count as f64 / self.views.len() as f64;
                row.fragment_count += mean(tally.fragment_count);
                row.shaded_count += mean(tally.shaded_count);
                row.covered_count += mean(tally.covered_count);
            }
        }
        for row in &mut rows {
            let covered = Some(row.covered_count).filter(|count| *count > 0.0);
            row.overdraw = covered.map(|covered| row.shaded_count / covered);
        }
        rows.into()
    }

    /// Fragments of each order of a view; `index` holds the triangles of all items.
    fn counted(&self, view: usize, index: Option<&SurfaceIndex>) -> [Tally; ORDERS.len()] {
        let (world, left) = (self.world, &self.views[view]);
        let image = (world.rays(view), world.samples);
        let orders = DrawOrder::ALL.map(|order| {
            let mut items = Vec::new();
            order.sort(&image.0.camera, left, &mut items);
            items
        });
        if let Some(index) = index {
            return draw_orders(image, index, &|_, _, _| true, &orders);
        }
        let solids = world.shape.boxes().expect("solid boxes");
        let is_opaque = |item: ItemId, probe: &Probe, at: &Crossing| {
            let mut holes = world.cut_outs.iter();
            holes.all(|holes| holes.opaque(item, &solids.boxes[item as usize], probe, at))
        };
        let index = BodyIndex::of(&Boxes::some(solids, left.clone()), world.kernel);
        draw_orders(image, &index, &is_opaque, &orders)
    }
}
