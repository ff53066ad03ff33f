//! The structure `auto`: a tree or a scan, and how it is updated.
//!
//! The build counts the work of a few frusta that look from item to item. Updates are
//! weighed by what has moved, by the queries between them and by the work that the refitted
//! tree has come to. All are counts, so every run chooses the same, and no answer depends
//! on the choice.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use serde::{Deserialize, Serialize};

use super::{BlockOrder, Moving, WideParams};
use crate::geometry::{Aabb, ConvexVolume, Plane};
use crate::index::linear::{Linear, LinearParams};
use crate::index::{BuildError, Info, Input, Kind, MemoryUsage, Origin, RegionIndex};
use crate::kernel::Plain;
use crate::query::{Context, Count, ItemId, QueryContext, QueryCost, QueryVolume};

/// Parameters: `auto:use=linear,update=rebuild`.
#[derive(Clone, Copy, Default, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AutoParams {
    /// The structure to be: `linear`, `wide` or `moving`; `auto` for the cheapest.
    #[serde(rename = "use")]
    pub structure: Use,
    /// Updates by `refit` or `rebuild`; `auto` for the cheapest.
    pub update: Update,
    /// The order of the items: `median` or `morton`.
    pub order: BlockOrder,
}

/// Structure that [`Auto`] is to be.
#[derive(Clone, Copy, Default, PartialEq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Use {
    /// The cheapest of a scan and a tree.
    #[default]
    Auto,
    /// A scan of all items.
    Linear,
    /// A tree.
    Wide,
    /// A tree of what rests beside a tree of what moves.
    Moving,
}

/// Work of [`Auto`] after items have moved.
#[derive(Clone, Copy, Default, PartialEq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Update {
    /// The cheapest.
    #[default]
    Auto,
    /// New bounds in the same structure.
    Refit,
    /// A new structure.
    Rebuild,
}

/// Searches by their index in [`Auto::costs`].
const SEARCHES: [&str; 2] = ["scan of all items", "tree"];
const SCAN: usize = 0;
const TREE: usize = 1;

/// Kinds of updates by their index in [`Auto::updates`].
const UPDATES: [&str; 3] = ["overwriting", "refit", "rebuild"];
const OVERWRITE: usize = 0;
const REFIT: usize = 1;
const REBUILD: usize = 2;

// Times in ns, measured on one processor (AVX-512). Only their ratios choose.
/// A query, besides what it tests.
const QUERY_NS: f64 = 51.0;
/// A tested node, a tested item, an item passed with its subtree; of a tree.
const TREE_NS: [f64; 3] = [1.65, 0.28, 0.03];
/// An item of a scan, in the nearest cache.
const SCAN_NS: f64 = 0.32;
/// Items that fit the nearest cache.
///
/// Beyond it the time of an item grows with the cube root of their number.
const NEAR: f64 = 32_768.0;
/// An overwritten item, and (more) an item of a scan that leaves or enters.
const MOVE_NS: f64 = 7.0;
const ENTER_NS: f64 = 8.0;
/// A refit, and a leaf whose bounds it fits.
const REFIT_NS: [f64; 2] = [100.0, 10.0];
/// The same of two trees, of a moved item.
const REFIT_TWO_NS: f64 = 15.0;
/// An item of a build.
const BUILD_NS: f64 = 45.0;

/// Fewest items that go to a scan in an update.
const LEAST_FILLED: usize = 256;
/// Mark of a scan that has all items.
const WHOLE: usize = usize::MAX;

/// Number of frusta whose work is counted.
const VIEWS: usize = 8;
/// Time of a counted query / time of a query.
const COUNTED: f64 = 4.0;
/// Time of updates and queries / time of counting the work of the refitted tree.
const RARELY: f64 = 32.0;
/// Updates that are weighed at once.
const TOGETHER: u32 = 8;
/// Most queries that are counted between two weighings; then nothing is written.
const MOST_ASKED: u32 = 256;

/// A tree, or a scan, by counted work.
#[derive(Default)]
pub struct Auto {
    trees: Moving,
    /// The trees are as they were when it became whole.
    scan: Option<Linear>,
    /// Items that have gone to the scan; [`WHOLE`] once it takes the queries.
    filled: usize,
    params: AutoParams,
    /// Index of the search after a build.
    built: usize,
    /// Modelled time of a query, ns, by search; infinite where that is unknown.
    costs: [f64; 2],
    /// The same of the refitted tree, when its work was counted last.
    aged: f64,
    /// Queries since the last weighing, at most [`MOST_ASKED`].
    asked: AtomicU32,
    /// Updates since the last weighing, items moved, and how many of them left.
    weighing: u32,
    moved: f64,
    left: f64,
    /// Present kind of update, and the modelled time it has lost to the best, ns.
    update: usize,
    regret: f64,
    /// Queries and modelled time since work was counted, and time lost to age, ns.
    since: [f64; 2],
    lost: f64,
    /// Updates by kind, and the modelled time of all of them by each kind, ns.
    updates: [u32; 3],
    spent: [f64; 3],
}

impl Auto {
    /// Returns whether movers get a tree of their own.
    fn has_two_trees(&self) -> bool {
        self.params.structure == Use::Moving
    }

    /// Frusta of 60 degrees from the centre of an item to that of another one.
    fn views(&self, items: &[Aabb]) -> Vec<ConvexVolume> {
        let ids = &self.trees.still.ids[..];
        let centre = |at: usize| {
            let from = ids.iter().cycle().skip(at % ids.len()).take(ids.len());
            let present = from.filter_map(|&id| items.get(id as usize));
            Some(present.copied().find(|b| !b.is_empty())?.centre())
        };
        let view = |i: usize| {
            // Tree order is spread over space: half, a quarter, .. of the items between.
            let at = i * ids.len() / VIEWS;
            let (eye, end) = (centre(at)?, centre(at + (ids.len() >> (1 + i % 4)))?);
            let forward = (end - eye).try_normalize()?;
            let (right, up) = forward.any_orthonormal_pair();
            let side = |across| (forward * 0.5 + across * 0.75_f32.sqrt(), eye);
            let planes = [
                side(right),
                side(-right),
                side(up),
                side(-up),
                (-forward, end),
            ];
            let planes = planes.map(|(normal, through)| Plane::new(normal, -normal.dot(through)));
            ConvexVolume::from_planes(&planes).ok()
        };
        let views = if ids.is_empty() { 0 } else { VIEWS };
        (0..views).filter_map(view).collect()
    }

    /// Modelled time of a query of the trees, ns, by the counted work of some views;
    /// infinite without a view.
    fn tree_ns(&self, items: &[Aabb]) -> f64 {
        let views = self.views(items);
        let (mut sink, mut cost) = (Count::default(), QueryCost::default());
        for view in &views {
            let cx = &mut QueryContext::new(Plain, &mut sink, &mut cost);
            let _ = self.trees.query(view, cx);
        }
        let [nodes, tested, passed] = TREE_NS;
        let work = nodes * cost.nodes_tested as f64
            + tested * cost.items_tested as f64
            + passed * cost.items_accepted_untested as f64;
        match views.len() {
            0 => f64::INFINITY,
            views => QUERY_NS + work / views as f64,
        }
    }

    /// Chooses the search of a new tree.
    fn calibrate(&mut self, items: &[Aabb]) {
        let all = self.trees.still.ids.len() as f64;
        let scan = QUERY_NS + SCAN_NS * all * (all / NEAR).max(1.0).cbrt();
        self.costs = [scan, self.tree_ns(items)];
        self.aged = self.costs[TREE];
        self.built = match self.params.structure {
            Use::Linear => SCAN,
            Use::Auto if scan < self.aged => SCAN,
            _ => TREE,
        };
    }

    /// Scans from now on; false if that cannot be.
    fn begin_scan(&mut self, input: &Input<'_>) -> bool {
        self.scan = Linear::build(input, &LinearParams::default()).ok();
        self.filled = WHOLE;
        self.scan.is_some()
    }

    /// Trees with a lane for each item, one that is gone beside the item before it.
    fn trees_of(items: &[Aabb], params: &AutoParams) -> Result<Moving, BuildError> {
        let order = params.order;
        let resting = |items: &[Aabb]| Moving::resting(&Input::new(items), &WideParams { order });
        // A bound that is no number is refused by the build.
        let is_gone = |b: &Aabb| b.is_empty() && b.is_finite();
        let ids = (0..).zip(items).filter(|(_, b)| is_gone(b));
        let gone: Vec<ItemId> = ids.map(|(id, _)| id).collect();
        let held = items.iter().find(|b| !b.is_empty());
        let (false, Some(mut last)) = (params.structure == Use::Moving || gone.is_empty(), held)
        else {
            return resting(items);
        };
        let held = items.iter().map(|b| {
            last = if is_gone(b) { last } else { b };
            *last
        });
        let mut trees = resting(&held.collect::<Vec<_>>())?;
        trees.still.take_over(items, &gone);
        Ok(trees)
    }

    /// Replaces the trees; false with nothing changed if they cannot be built.
    fn rebuild(&mut self, items: &[Aabb]) -> bool {
        let Ok(trees) = Auto::trees_of(items, &self.params) else {
            return false;
        };
        self.trees = trees;
        (self.scan, self.filled) = (None, 0);
        (self.aged, self.since, self.lost) = (self.costs[TREE], [0.0; 2], 0.0);
        self.updates[REBUILD] += 1;
        self.built == TREE || self.begin_scan(&Input::new(items))
    }

    /// The scan alone, once it has all items; the trees are stale from then on.
    fn overwrite(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        let count = items.len();
        let scan = (self.scan).get_or_insert_with(|| Linear::with_room(count));
        let from = self.filled;
        if from == WHOLE {
            self.updates[OVERWRITE] += 1;
            return scan.refit(items, moved);
        }
        // Filled in item order, as many at once as are moved: no update is much slower.
        let more = if from == 0 { 0 } else { moved.len() };
        let end = count.min(from + LEAST_FILLED.max(more));
        let held = moved.iter().filter(|id| (**id as usize) < from);
        let ids: Vec<ItemId> = held.copied().chain(from as ItemId..end as ItemId).collect();
        self.filled = if end < count { end } else { WHOLE };
        let is_held = scan.refit(items, &ids) && (end == count || self.refit_held(items, moved));
        self.updates[OVERWRITE] += u32::from(is_held);
        is_held || self.rebuild(items)
    }

    /// New bounds in the trees; false if they cannot take them over.
    fn refit_held(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        match self.has_two_trees() {
            true => self.trees.refit(items, moved),
            false => self.trees.still.take_over(items, moved),
        }
    }

    fn refit_trees(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        if self.filled == WHOLE {
            let all: Vec<ItemId> = (0..items.len() as ItemId).collect();
            if self.is_aged() || self.has_two_trees() || !self.trees.still.take_over(items, &all) {
                return self.rebuild(items);
            }
            self.aged = self.tree_ns(items);
        }
        (self.scan, self.filled) = (None, 0);
        if self.is_old(items) || !self.refit_held(items, moved) {
            return self.rebuild(items);
        }
        self.updates[REFIT] += 1;
        true
    }

    /// Returns whether queries take half as long again as those of a new tree.
    fn is_aged(&self) -> bool {
        self.aged > 1.5 * self.costs[TREE]
    }

    /// Returns whether age has cost as much as a new tree; rarely counts the work.
    fn is_old(&mut self, items: &[Aabb]) -> bool {
        let [asked, spent] = self.since;
        if self.params.update != Update::Auto || spent < RARELY * COUNTED * VIEWS as f64 * self.aged
        {
            return false;
        }
        let aged = self.tree_ns(items);
        self.lost += asked * ((self.aged + aged) / 2.0 - self.costs[TREE]).max(0.0);
        (self.aged, self.since) = (aged, [0.0; 2]);
        self.lost > BUILD_NS * items.len() as f64
    }

    /// Chooses the kind of updates: another one when the present one has lost what a
    /// change costs, so that a few exceptions change nothing.
    fn weigh(&mut self, items: usize) {
        let is_first = self.updates == [0; 3];
        let updates = f64::from(std::mem::take(&mut self.weighing));
        let moved = std::mem::take(&mut self.moved);
        let left = std::mem::take(&mut self.left);
        let asked = f64::from(std::mem::take(self.asked.get_mut()));
        // Queries before the first update are of no frame.
        let asked = if is_first { 1.0 } else { asked.max(updates) };
        let (all, leaves) = (items as f64, self.trees.still.occupied.len() as f64);
        // About the number of leaves that hold them, if items move anywhere.
        let fitted = moved * leaves / (moved / updates).hypot(leaves);
        let fit = REFIT_NS[0] * updates
            + match self.has_two_trees() {
                true => REFIT_TWO_NS * moved,
                false => REFIT_NS[1] * fitted,
            };
        let is_scan = self.filled == WHOLE;
        let tree = match is_scan {
            true => self.costs[TREE],
            false => self.aged,
        };
        let change = match is_scan && self.is_aged() || self.has_two_trees() {
            true => BUILD_NS * all,
            false => MOVE_NS * all + REFIT_NS[1] * leaves,
        };
        let costs = [
            // About as many enter as leave.
            MOVE_NS * moved + 2.0 * ENTER_NS * left + asked * self.costs[SCAN],
            MOVE_NS * moved + fit + asked * tree,
            BUILD_NS * all * updates + asked * self.costs[self.built],
        ];
        for (spent, cost) in self.spent.iter_mut().zip(costs) {
            *spent += cost;
        }
        let best = match (self.params.update, self.params.structure) {
            (Update::Rebuild, _) => REBUILD,
            (_, Use::Linear) => OVERWRITE,
            (Update::Refit, _) => REFIT.min(self.built),
            (_, Use::Wide | Use::Moving) => REFIT,
            _ if costs[OVERWRITE] <= costs[REFIT].min(costs[REBUILD]) => OVERWRITE,
            _ if costs[REFIT] <= costs[REBUILD] => REFIT,
            _ => REBUILD,
        };
        self.regret += costs[self.update] - costs[best];
        if is_first || self.regret > change {
            (self.update, self.regret) = (best, 0.0);
        }
        self.since = [self.since[0] + asked, self.since[1] + costs[self.update]];
    }
}

impl RegionIndex for Auto {
    const INFO: Info = Info::new(
        "auto",
        "a tree or a scan, and its updates, by counted work; use=wide, moving or linear \
         and update=refit or rebuild force them",
        Kind::Tree,
        Origin::Ours,
    )
    .refits()
    .threaded_build()
    .on_request();
    type Params = AutoParams;

    /// O(n log n), that of [`Wide`](super::Wide), and a few queries.
    fn build(input: &Input<'_>, params: &AutoParams) -> Result<Self, BuildError> {
        let order = params.order;
        let mut auto = Auto {
            trees: Moving::resting(input, &WideParams { order })?,
            params: *params,
            ..Auto::default()
        };
        auto.calibrate(input.items);
        if auto.built == SCAN {
            auto.begin_scan(input);
        }
        Ok(auto)
    }

    fn memory(&self) -> MemoryUsage {
        let mut memory = self.trees.memory();
        memory.item_bytes += (self.scan.as_ref()).map_or(0, |scan| scan.memory().item_bytes);
        memory
    }

    #[inline(always)]
    fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, cx: &mut C) -> ControlFlow<()> {
        // A query that counts its work is not one of a frame.
        if size_of::<C::Recorder>() == 0 {
            let asked = self.asked.load(Relaxed);
            if asked < MOST_ASKED {
                self.asked.store(asked + 1, Relaxed);
            }
        }
        match &self.scan {
            Some(scan) if self.filled == WHOLE => {
                // Nothing has moved: the tree's root holds all items.
                if self.updates[OVERWRITE] == 0
                    && let Some(flow) = self.trees.still.query_root(scan.ids(), volume, cx)
                {
                    return flow;
                }
                scan.query(volume, cx)
            }
            _ if self.trees.movers.ids.is_empty() => self.trees.still.query(volume, cx),
            _ => self.trees.query(volume, cx),
        }
    }

    /// O(moved), or a new build. Items may become or cease to be empty.
    fn refit(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        if moved.is_empty() {
            // Tables for the updates that follow.
            return match &mut self.scan {
                Some(scan) => scan.refit(items, moved),
                None => self.refit_held(items, moved) || self.rebuild(items),
            };
        }
        self.trees.still.balls = None;
        self.weighing += 1;
        self.moved += moved.len() as f64;
        let left = moved.iter().filter(|id| items[**id as usize].is_empty());
        self.left += left.count() as f64;
        if self.weighing == TOGETHER || self.updates == [0; 3] {
            self.weigh(items.len());
        }
        match self.update {
            OVERWRITE => self.overwrite(items, moved),
            REFIT => self.refit_trees(items, moved),
            _ => self.rebuild(items),
        }
    }

    fn chose(&self) -> Option<String> {
        let others = |names: &[&str], costs: &[f64], taken: usize| {
            let others = (0..names.len()).filter(|&i| i != taken && costs[i].is_finite());
            let ratio = |i: usize| format!("{} ({:.3} x)", names[i], costs[i] / costs[taken]);
            let others = others.map(ratio).collect::<Vec<_>>().join(", ");
            let not = if others.is_empty() { "" } else { ", not " };
            format!("{not}{others}")
        };
        let left_out = others(&SEARCHES, &self.costs, self.built);
        let mut told = format!("{}{left_out}", SEARCHES[self.built]);
        let count: u32 = self.updates.iter().sum();
        let most = (0..UPDATES.len()).max_by_key(|&kind| self.updates[kind]);
        if let Some(most) = most.filter(|_| count > 0) {
            let left_out = others(&UPDATES, &self.spent, most);
            let (name, here) = (UPDATES[most], self.updates[most]);
            told += &format!("; {name} in {here} of {count} updates{left_out}");
        }
        Some(told)
    }
}

#[cfg(test)]
mod tests;
