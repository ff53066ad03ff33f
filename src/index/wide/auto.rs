//! The structure `auto`: a tree or a scan, and how it is updated.
//!
//! The build counts the work of a few frusta that look from item to item. Updates are
//! weighed by what has moved, by the queries between them and by the work that the refitted
//! tree has come to. All are counts, so every run chooses the same, and no answer depends
//! on the choice.

mod params;

use std::ops::{ControlFlow, Range};
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

pub use self::params::AutoParams;
use self::params::{Update, Use};
use super::{Moving, Wide, WideParams};
use crate::geometry::{Aabb, ConvexVolume, Plane};
use crate::index::linear::{Linear, LinearParams};
use crate::index::{BuildError, Info, Input, Kind, MemoryUsage, Origin, RegionIndex};
use crate::kernel::Plain;
use crate::query::{Context, Count, ItemId, QueryContext, QueryCost, QueryVolume};

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
/// A query, besides what it tests, by search.
const QUERY_NS: [f64; 2] = [100.0, 51.0];
/// A tested node, item, plane of an item, and an item passed with its subtree.
const TREE_NS: [f64; 4] = [1.5, 0.12, 0.15, 0.03];
/// An item of a scan, in the nearest cache.
const SCAN_NS: f64 = 0.5;
/// Items that fit the nearest cache.
///
/// Beyond it the time of an item grows with the cube root of their number.
const NEAR: f64 = 65_536.0;
/// An overwritten item, and (more) one that leaves or enters, of a scan and a tree.
const MOVE_NS: [f64; 2] = [7.0, 8.0];
const ENTER_NS: [f64; 2] = [12.0, 9.0];
/// A refit, and a leaf whose bounds it fits.
const REFIT_NS: [f64; 2] = [100.0, 10.0];
/// The same of two trees, of a moved item.
const REFIT_TWO_NS: f64 = 15.0;
/// An item of a build.
const BUILD_NS: f64 = 45.0;

/// Fewest items that go to a scan in an update.
const LEAST_FILLED: usize = 256;
/// Most updates in which a scan is filled.
const PARTS: usize = 8;
/// Mark of a scan that has all items.
const WHOLE: usize = usize::MAX;

/// Number of frusta whose work is counted.
const VIEWS: usize = 8;
/// Time of a counted query / time of a query.
const COUNTED: f64 = 4.0;
/// Time of updates and queries / time of counting the work of the refitted tree.
const RARELY: f64 = 16.0;
/// Time that a new tree would have saved / time of its build: less may be chance.
const AGE: f64 = 4.0;
/// Most that counts become rarer where a tree does not age.
const MOST_PATIENCE: f64 = 16.0;
/// Weighings in which a scan forgets most of a tree's age.
const FORGETS: f64 = 256.0;
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
    /// The same of the refitted tree, and of each view in a new tree.
    aged: f64,
    fresh: [Option<f64>; VIEWS],
    /// The view that was counted last.
    turn: usize,
    /// Queries since the last weighing, at most [`MOST_ASKED`].
    asked: AtomicU32,
    /// Updates since the last weighing, and items moved.
    weighing: u32,
    moved: f64,
    /// Present kind of update, and the modelled time it has lost to the best, ns.
    update: usize,
    regret: f64,
    /// Queries and modelled time since work was counted.
    since: [f64; 2],
    /// Queries of the tree before that, and what a new one would have saved, ns.
    answered: f64,
    saving: f64,
    /// Doubled with each count that finds no change.
    patience: f64,
    /// Updates by kind, and the modelled time of all of them by each kind, ns.
    updates: [u32; 3],
    spent: [f64; 3],
}

impl Auto {
    /// Returns whether movers get a tree of their own.
    fn has_two_trees(&self) -> bool {
        self.params.structure == Use::Moving
    }

    /// Frustum of 60 degrees from the centre of an item to that of another one.
    fn view(&self, items: &[Aabb], i: usize) -> Option<ConvexVolume> {
        let ids = &self.trees.still.ids[..];
        let centre = |at: usize| {
            let from = ids
                .iter()
                .cycle()
                .skip(at % ids.len().max(1))
                .take(ids.len());
            let mut present = from.filter_map(|&id| items.get(id as usize));
            Some(present.find(|b| !b.is_empty())?.centre())
        };
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
    }

    /// Modelled time of a view by the trees, ns, from its counted work.
    fn view_ns(&self, items: &[Aabb], i: usize) -> Option<f64> {
        let (mut sink, mut cost) = (Count::default(), QueryCost::default());
        let cx = &mut QueryContext::new(Plain, &mut sink, &mut cost);
        let _ = self.trees.query(&self.view(items, i)?, cx);
        let [nodes, tested, planes, passed] = TREE_NS;
        let work = QUERY_NS[TREE]
            + nodes * cost.nodes_tested as f64
            + tested * cost.items_tested as f64
            + planes * cost.planes_tested as f64
            + passed * cost.items_accepted_untested as f64;
        Some(work)
    }

    /// Modelled time of a query, ns, by some views beside those in a new tree.
    ///
    /// The present age if there is none.
    fn age(&self, items: &[Aabb], views: Range<usize>) -> f64 {
        let both = views.filter_map(|i| Some([self.view_ns(items, i)?, self.fresh[i]?]));
        let [now, fresh] = both.fold([0.0; 2], |sum, both| [sum[0] + both[0], sum[1] + both[1]]);
        match fresh > 0.0 {
            true => self.costs[TREE] * now / fresh,
            false => self.aged,
        }
    }

    /// Counts the work of all views in a new tree; modelled time of a query, ns.
    fn count(&mut self, items: &[Aabb]) -> f64 {
        self.fresh = std::array::from_fn(|i| self.view_ns(items, i));
        let known = self.fresh.iter().flatten();
        match known.clone().count() {
            0 => f64::INFINITY,
            count => known.sum::<f64>() / count as f64,
        }
    }

    /// Modelled time of a scan of the items that are there, ns.
    fn scan_ns(&self) -> f64 {
        let in_tree = |tree: &Wide| tree.ids.len() - tree.vacant;
        let held = match &self.scan {
            Some(scan) if self.filled == WHOLE => scan.ids().len(),
            _ => in_tree(&self.trees.still) + in_tree(&self.trees.movers),
        } as f64;
        QUERY_NS[SCAN] + SCAN_NS * held * (held / NEAR).max(1.0).cbrt()
    }

    /// Chooses the search of a new tree.
    fn calibrate(&mut self, items: &[Aabb]) {
        let scan = self.scan_ns();
        let tree = self.count(items);
        (self.aged, self.costs) = (tree, [scan, tree]);
        self.built = match self.params.structure {
            Use::Linear => SCAN,
            Use::Auto if scan < tree => SCAN,
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
        if self.update == REFIT {
            self.costs[TREE] = self.count(items);
            self.aged = self.costs[TREE];
        }
        self.start();
        self.updates[REBUILD] += 1;
        self.built == TREE || self.begin_scan(&Input::new(items))
    }

    /// Watches the age of other trees from now on.
    fn start(&mut self) {
        (self.since, self.answered, self.saving) = ([0.0; 2], 0.0, 0.0);
        self.patience = 1.0;
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
        let end = count.min(from + LEAST_FILLED.max(count / PARTS).max(more));
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
            self.aged = self.age(items, 0..VIEWS);
            self.start();
        }
        (self.scan, self.filled) = (None, 0);
        if !self.refit_held(items, moved) || self.is_old(items) {
            return self.rebuild(items);
        }
        self.updates[REFIT] += 1;
        true
    }

    /// Returns whether queries take half as long again as those of a new tree.
    fn is_aged(&self) -> bool {
        self.aged > 1.5 * self.costs[TREE]
    }

    /// Returns whether a new tree pays; rarely counts the work, a view in an update.
    ///
    /// It does if it costs less than its queries have saved against the present age. Of a tree
    /// that is old at once, a new one saves nothing.
    fn is_old(&mut self, items: &[Aabb]) -> bool {
        let [asked, spent] = self.since;
        if self.params.update != Update::Auto
            || spent < RARELY * self.patience * COUNTED * self.aged
        {
            return false;
        }
        self.turn = (self.turn + 1) % VIEWS;
        let aged = self.age(items, self.turn..self.turn + 1);
        // Half of it later on, as views differ.
        let more = (aged - self.aged) / if self.answered > 0.0 { 2.0 } else { 1.0 };
        self.saving += more * self.answered;
        self.answered += asked;
        self.aged += more;
        self.patience = match more.abs() < 0.05 * self.aged {
            true => MOST_PATIENCE.min(2.0 * self.patience),
            false => 1.0,
        };
        self.since = [0.0; 2];
        self.saving > AGE * BUILD_NS * items.len() as f64
    }

    /// Chooses the kind of updates: another one when the present one has lost what a
    /// change costs, so that a few exceptions change nothing.
    fn weigh(&mut self, items: &[Aabb], now: &[ItemId]) {
        let before = self.updates.iter().sum::<u32>();
        let updates = f64::from(std::mem::take(&mut self.weighing));
        let moved = std::mem::take(&mut self.moved);
        let left = now.iter().filter(|id| items[**id as usize].is_empty());
        let left = left.count() as f64 * updates;
        let asked = f64::from(std::mem::take(self.asked.get_mut()));
        // Queries before the first update are of no frame.
        let asked = if before == 0 { 1.0 } else { asked.max(updates) };
        let (all, leaves) = (items.len() as f64, self.trees.still.occupied.len() as f64);
        // About the number of leaves that hold them, if items move anywhere.
        let fitted = moved * leaves / (moved / updates).hypot(leaves);
        let fit = REFIT_NS[0] * updates
            + match self.has_two_trees() {
                true => REFIT_TWO_NS * moved,
                false => REFIT_NS[1] * fitted,
            };
        let is_scan = self.filled == WHOLE;
        self.costs[SCAN] = self.scan_ns();
        if is_scan && self.aged > self.costs[TREE] {
            self.aged += (self.costs[TREE] - self.aged) / FORGETS;
        }
        let change = match is_scan && self.is_aged() || self.has_two_trees() {
            true => BUILD_NS * all,
            false => MOVE_NS[TREE] * all + REFIT_NS[1] * leaves,
        };
        // About as many enter as leave.
        let taken = |kind: usize| MOVE_NS[kind] * moved + 2.0 * ENTER_NS[kind] * left;
        let costs = [
            taken(SCAN) + asked * self.costs[SCAN],
            taken(TREE) + fit + asked * self.aged,
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
            _ => (0..3).fold(0, |best, i| if costs[i] < costs[best] { i } else { best }),
        };
        self.regret += costs[self.update] - costs[best];
        // The second knows the queries of a frame.
        if before < 2 || self.regret > change {
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
        auto.start();
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
        if self.weighing == TOGETHER || self.updates.iter().sum::<u32>() < 2 {
            self.weigh(items, moved);
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
