//! Draw orders, and the fragments that an early z-test shades in each.
//!
//! Items are drawn in all orders at once, ray by ray. An item at a sample is one fragment,
//! where the ray meets it first; a one-sided triangle is met from its front only.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::draw::Tally;
use crate::camera::Camera;
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::truth::{Along, Body, BodyIndex, SolidBox};
use crate::visibility::{Rays, SampleGrid};

named! {
    /// An order in which items are drawn.
    #[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum DrawOrder, ORDERS {
        #[default]
        #[serde(rename = "none")]
        Listed = "none", "items in the order of their ids";
        BoxDistance = "box-distance", "sorted by the distance of the nearest point of each box";
    }
}

impl DrawOrder {
    /// Appends all items, of which the boxes are given by ascending id. O(n log n).
    pub fn sort(self, camera: &Camera, boxes: &[SolidBox], out: &mut Vec<ItemId>) {
        if self == DrawOrder::Listed {
            return out.extend(boxes.iter().map(|body| body.item));
        }
        let keyed = boxes
            .iter()
            .map(|body| (nearest(camera, &body.b), body.item));
        let mut keyed: Vec<(f64, ItemId)> = keyed.collect();
        keyed.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        out.extend(keyed.into_iter().map(|(_, item)| item));
    }
}

/// Distance of the nearest point of a box.
///
/// Squared from the eye; the depth for an orthographic lens.
fn nearest(camera: &Camera, b: &WorldBox) -> f64 {
    let (eye, forward) = (camera.frame.eye, camera.frame.forward());
    match camera.lens.is_orthographic() {
        true => {
            let point = DVec3::select(forward.cmpgt(DVec3::ZERO), b.min, b.max);
            (point - eye).dot(forward)
        }
        false => (eye.max(b.min).min(b.max) - eye).length_squared(),
    }
}

/// Place of an item that is not drawn.
const NOWHERE: u32 = u32::MAX;

/// Counts the fragments of the same items of an index, drawn in each order.
///
/// Fragments are counted whether opaque or not. O(fragments log layers).
pub fn draw_orders<B: Body>(
    (rays, grid): (&Rays, SampleGrid),
    index: &BodyIndex<B>,
    is_opaque: &impl Fn(ItemId, &B::Probe, &B::At) -> bool,
    orders: &[Vec<ItemId>; ORDERS.len()],
) -> [Tally; ORDERS.len()] {
    let places = orders.each_ref().map(|order| {
        let mut places = vec![NOWHERE; index.items];
        for (&item, place) in order.iter().zip(0..) {
            places[item as usize] = place;
        }
        places
    });
    let mut tallies = [Tally::default(); ORDERS.len()];
    for ray in rays.of_grid(grid) {
        let probe = index.probe(&ray);
        let mut met = index.all_along(&ray);
        met.retain(|(item, _)| places[0][*item as usize] != NOWHERE);
        met.sort_unstable_by(|(a, at_a), (b, at_b)| a.cmp(b).then(probe.compare(at_a, at_b)));
        met.dedup_by_key(|(item, _)| *item);
        let fragments = met.len() as u64;
        met.retain(|(item, at)| is_opaque(*item, &probe, at));
        for (places, tally) in places.iter().zip(&mut tallies) {
            met.sort_unstable_by_key(|(item, _)| places[*item as usize]);
            tally.fragment_count += fragments;
            tally.covered_count += u64::from(!met.is_empty());
            let mut front: Option<&(ItemId, B::At)> = None;
            for layer in &met {
                // Nearer than all before, of a tie the lower id.
                let is_nearer = |front: &(ItemId, B::At)| {
                    let depths = probe.compare(&layer.1, &front.1);
                    depths.then(layer.0.cmp(&front.0)).is_lt()
                };
                if front.is_none_or(is_nearer) {
                    front = Some(layer);
                    tally.shaded_count += 1;
                }
            }
        }
    }
    tallies
}
