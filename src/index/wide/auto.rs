//! The structure `auto`: a tree or a scan, and its kind of updates.
//!
//! The build counts the work of a few frusta that look from item to item. Updates are weighed by
//! moved items, by queries between updates, and by the counted work of the refitted tree. All are
//! counts: every run chooses the same, and no answer depends on the choice.

mod params;

use std::ops::{ControlFlow, Range};
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

pub use self::params::AutoParams;
use self::params::{Update, Use};
use super::{Moving, WideParams};
use crate::geometry::{Aabb, ConvexVolume, Plane};
use crate::index::{BuildError, Info, Input, Kind, Linear, LinearParams, MemoryUsage, RegionIndex};
use crate::kernel::Plain;
use crate::query::{Context, Count, ItemId, QueryContext, QueryCost, QueryVolume};

/// Searches by their index in [`Auto::costs`].
const SEARCHES: [&str; 2] = ["scan of all items", "tree"];
const SCAN: usize = 0;
const TREE: usize = 1;

/// Kinds of updates by their index in [`Auto::updates`].
const UPDATES: [&str; 4] = ["scan of overwritten boxes", "refit", "rebuild", "two trees"];
const OVERWRITE: usize = 0;
const REFIT: usize = 1;
const REBUILD: usize = 2;
const MOVING: usize = 3;

// Times in ns, measured on one processor (AVX-512). Choices depend only on their ratios.
/// A query without its tests, by search.
const QUERY_NS: [f64; 2] = [51.0, 51.0];
/// A tested node, a tested item, a plane of an item, an item accepted untested.
const TREE_NS: [f64; 4] = [1.5, 0.12, 0.15, 0.03];
/// An item of a scan that fits the nearest cache.
const SCAN_NS: f64 = 0.5;
/// Items that fit the nearest cache; beyond, time grows with the cube root of n.
const NEAR: f64 = 65_536.0;
/// An overwritten item, by search; a scan keeps items in the order of their ids.
const MOVE_NS: [f64; 2] = [4.0, 8.0];
/// A refit, and each leaf whose bounds it recomputes.
const REFIT_NS: [f64; 2] = [100.0, 10.0];
/// A refit of the two trees, per moved item that jumps.
const MOVING_NS: f64 = 250.0;
/// Time of a query of two trees / of one in a new tree, until it is counted.
const TWO: f64 = 2.0;
/// An item of a build.
const BUILD_NS: f64 = 45.0;

/// Number of frusta whose work is counted.
const VIEWS: usize = 8;
/// Time of a counted query / time of an uncounted one.
const COUNTED: f64 = 8.0;
/// Time of updates and queries per time spent on counting the refitted tree's work.
const RARELY: f64 = 16.0;
/// Time saved by a new tree / time of its build; less may be chance.
const AGE: f64 = 4.0;
/// Most by which counts become rarer if a tree does not age.
const MOST_PATIENCE: f64 = 16.0;
/// Number of weighings after which a scan has mostly forgotten a tree's age.
const FORGETS: f64 = 256.0;
/// Updates per weighing.
const TOGETHER: u32 = 8;
/// Items x updates per weighing, if there are few items.
const FEW: u32 = 2048;
/// Most queries counted between two weighings; later ones write nothing.
const MOST_QUERIES: u32 = 256;

/// A tree, or a scan, by counted work.
#[derive(Default)]
pub struct Auto {
    trees: Moving,
    /// Answers in place of the trees, which are stale from its first update on.
    scan: Option<Linear>,
    /// A scan of the same boxes, kept until the number of queries per frame is known.
    reserve: Option<Linear>,
    /// True if movers have a separate tree.
    two_trees: bool,
    params: AutoParams,
    /// Index of the search after a build.
    built: usize,
    /// Modelled time of a query, ns, by search; infinite where that is unknown.
    costs: [f64; 2],
    /// Likewise of the refitted tree and of two trees; then of each view in a new tree.
    aged: [f64; 2],
    fresh: [Option<f64>; VIEWS],
    /// The view that was counted last.
    turn: usize,
    /// Queries since the last weighing, at most [`MOST_QUERIES`].
    queries: AtomicU32,
    /// Updates since the last weighing, and items moved.
    weighing: u32,
    moved: f64,
    /// Current kind of update, and the modelled time it has lost to the best, ns.
    update: usize,
    regret: f64,
    /// Queries and modelled time since work was counted.
    since: [f64; 2],
    /// Queries of the tree before that, and the time a new one would have saved, ns.
    answered: f64,
    saving: f64,
    /// Grows with each count that finds no change: counts become rarer.
    patience: f64,
    /// Updates by kind, and the modelled time of all of them by each kind, ns.
    updates: [u32; 4],
    spent: [f64; 4],
}

impl Auto {
    /// Frustum of 60 degrees from the centre of an item to that of another one.
    fn view(&self, items: &[Aabb], i: usize) -> Option<ConvexVolume> {
        let ids = &self.trees.still.ids[..];
        let centre = |at: usize| {
            let from = ids.iter().cycle().skip(at % ids.len().max(1));
            let from = from.take(ids.len());
            let mut present = from.filter_map(|&id| items.get(id as usize));
            Some(present.find(|b| !b.is_empty())?.centre())
        };
        // Tree order follows space: half, a quarter, .. of the items lie between.
        let at = i * ids.len() / VIEWS;
        let (eye, end) = (centre(at)?, centre(at + (ids.len() >> (1 + i % 4)))?);
        // Scaled by a power of two, so that no squared length overflows.
        let scale = f32::from_bits((end - eye).abs().max_element().to_bits() & 0x7F80_0000);
        let forward = ((end - eye) / scale).try_normalize()?;
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

    /// Modelled time of a query, ns, from some views relative to a new tree.
    ///
    /// The current estimate if no view can be compared.
    fn age(&self, items: &[Aabb], views: Range<usize>) -> f64 {
        let both = views.filter_map(|i| Some([self.view_ns(items, i)?, self.fresh[i]?]));
        let [now, fresh] = both.fold([0.0; 2], |sum, both| [sum[0] + both[0], sum[1] + both[1]]);
        match fresh > 0.0 {
            true => self.costs[TREE] * now / fresh,
            false => self.aged[usize::from(self.two_trees)],
        }
    }

    /// Counts the work of all views in a new tree; returns the mean modelled time, ns.
    fn count(&mut self, items: &[Aabb]) -> f64 {
        self.fresh = std::array::from_fn(|i| self.view_ns(items, i));
        let known = self.fresh.iter().flatten();
        match known.clone().count() {
            0 => f64::INFINITY,
            count => known.sum::<f64>() / count as f64,
        }
    }

    /// Modelled time of a scan, ns.
    fn scan_ns(&self) -> f64 {
        let lanes = self.trees.still.ids.len() as f64;
        QUERY_NS[SCAN] + SCAN_NS * lanes * (lanes / NEAR).max(1.0).cbrt()
    }

    /// Chooses the search of a new tree.
    fn calibrate(&mut self, items: &[Aabb]) {
        let scan = self.scan_ns();
        let tree = self.count(items);
        (self.aged, self.costs) = ([tree, TWO * tree], [scan, tree]);
        self.built = match self.params.structure {
            Use::Linear => SCAN,
            Use::Auto if scan < tree => SCAN,
            _ => TREE,
        };
        self.scan = self.built_scan(items);
    }

    /// The scan that replaces a new tree, if the build chose a scan.
    fn built_scan(&self, items: &[Aabb]) -> Option<Linear> {
        (self.built == SCAN && !self.two_trees).then(|| self.scan_of(items))?
    }

    /// A scan that the second update may take.
    fn reserve_of(&self, items: &[Aabb]) -> Option<Linear> {
        let is_free = self.params.structure == Use::Auto && self.params.update == Update::Auto;
        (is_free && self.updates == [0; 4]).then(|| self.scan_of(items))?
    }

    fn scan_of(&self, items: &[Aabb]) -> Option<Linear> {
        let input = Input::new(items).spheres(self.trees.still.balls.is_some());
        Linear::build(&input, &LinearParams::default()).ok()
    }

    /// Replaces the trees; false with nothing changed if they cannot be built.
    fn rebuild(&mut self, items: &[Aabb]) -> bool {
        let (order, spheres) = (self.params.order, self.trees.still.balls.is_some());
        let input = Input::new(items).spheres(spheres);
        // Two trees hold new items without reserved lanes.
        let input = input.come_and_go(self.update != MOVING);
        let Ok(trees) = Moving::resting(&input, &WideParams { order }) else {
            return false;
        };
        self.trees = trees;
        self.two_trees = self.update == MOVING;
        self.scan = self.built_scan(items);
        if matches!(self.update, REFIT | MOVING) {
            let new = self.count(items);
            self.costs[TREE] = new;
            self.aged[usize::from(self.two_trees)] = if self.two_trees { TWO * new } else { new };
        }
        self.start();
        self.updates[REBUILD] += 1;
        true
    }

    /// Starts to track the age of new trees.
    fn start(&mut self) {
        (self.since, self.answered, self.saving) = ([0.0; 2], 0.0, 0.0);
        // The first count comes early.
        self.patience = 0.25;
    }

    /// Writes new bounds into a scan; the tree is stale from then on.
    fn overwrite(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        if self.scan.is_none() {
            self.scan = self.reserve.take();
        }
        let is_held = match &mut self.scan {
            Some(scan) => scan.refit(items, moved),
            None => {
                self.scan = self.scan_of(items);
                self.scan.is_some()
            }
        };
        self.updates[OVERWRITE] += u32::from(is_held);
        is_held
    }

    /// Writes new bounds into the trees; false if they cannot take them over.
    fn refit_held(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        match self.two_trees {
            true => self.trees.refit(items, moved),
            false => self.trees.still.take_over(items, moved),
        }
    }

    fn refit_trees(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        let scans = self.scan.is_some();
        let is_held = match scans {
            // The moves made in the meantime are not recorded: all items count as moved.
            true => {
                let all: Vec<ItemId> = (0..items.len() as ItemId).collect();
                !self.is_aged() && self.trees.still.overwrite(items, &all).is_some()
            }
            false => self.refit_held(items, moved),
        };
        if is_held && scans {
            self.scan = None;
            self.trees.still.fit();
            self.aged[0] = self.age(items, 0..VIEWS);
            self.start();
        }
        if !is_held || self.is_old(items) {
            let is_built = self.rebuild(items);
            if self.two_trees && !is_held {
                // Too crowded, now and after a build.
                self.aged[1] = f64::INFINITY;
            }
            return is_built;
        }
        self.updates[self.update] += 1;
        true
    }

    /// Returns whether queries take more than 1.5 times as long as in a new tree.
    fn is_aged(&self) -> bool {
        self.aged[0] > 1.5 * self.costs[TREE]
    }

    /// Returns whether a new tree pays; counts the work rarely, one view per update.
    ///
    /// It pays if it would have saved [`AGE`] times the time of its build in the queries so far.
    /// Ageing up to the first count is left out: a new tree would age as fast.
    fn is_old(&mut self, items: &[Aabb]) -> bool {
        let ([queries, spent], present) = (self.since, self.aged[usize::from(self.two_trees)]);
        if self.params.update != Update::Auto || spent < RARELY * self.patience * COUNTED * present
        {
            return false;
        }
        self.turn = (self.turn + 1) % VIEWS;
        let aged = self.age(items, self.turn..self.turn + 1);
        // Later changes count half, since views differ, unless the time has doubled.
        let is_less = self.answered > 0.0 && aged < 2.0 * present;
        let more = (aged - present) / if is_less { 2.0 } else { 1.0 };
        self.saving += more * self.answered;
        self.answered += queries;
        self.aged[usize::from(self.two_trees)] += more;
        self.patience = match more.abs() < 0.05 * aged {
            true => MOST_PATIENCE.min(4.0 * self.patience),
            false => 1.0,
        };
        self.since = [0.0; 2];
        self.saving > AGE * BUILD_NS * items.len() as f64
    }

    /// Chooses the kind of updates.
    ///
    /// Switches once the present kind has lost the cost of a switch: outliers change nothing.
    fn weigh(&mut self, items: &[Aabb]) {
        let before = self.updates.iter().sum::<u32>();
        let updates = f64::from(std::mem::take(&mut self.weighing));
        let moved = std::mem::take(&mut self.moved);
        let own = f64::from(std::mem::take(self.queries.get_mut()));
        // Queries before the first update belong to no frame.
        let queries = if before == 0 { 1.0 } else { own.max(updates) };
        let (all, leaves) = (items.len() as f64, self.trees.still.occupied.len() as f64);
        // Approximate number of leaves that hold them, if items move anywhere.
        let fitted = moved * leaves / (moved / updates).hypot(leaves);
        let fit = REFIT_NS[1] * fitted;
        self.costs[SCAN] = self.scan_ns();
        let scans = self.scan.is_some();
        if scans || self.two_trees {
            self.aged[0] += (self.costs[TREE] - self.aged[0]) / FORGETS;
        }
        let [overwritten, taken] = MOVE_NS.map(|ns| ns * moved);
        let costs = [
            overwritten + queries * self.costs[SCAN],
            taken + REFIT_NS[0] * updates + fit + queries * self.aged[0],
            BUILD_NS * all * updates + queries * self.costs[self.built],
            taken + REFIT_NS[0] * updates + MOVING_NS * moved + queries * self.aged[1],
        ];
        for (spent, cost) in self.spent.iter_mut().zip(costs) {
            *spent += cost;
        }
        let best = match (self.params.update, self.params.structure) {
            (Update::Rebuild, _) => REBUILD,
            (_, Use::Linear) => OVERWRITE,
            (_, Use::Moving) => MOVING,
            (Update::Refit, _) => REFIT.min(self.built),
            (_, Use::Wide) => REFIT,
            _ if before == 0 => REFIT.min(self.built),
            _ => (0..4).fold(0, |best, i| if costs[i] < costs[best] { i } else { best }),
        };
        let is_new = (best == MOVING) != self.two_trees || scans && best == REFIT && self.is_aged();
        // A build; a switch between scan and tree; or a switch that keeps the tree.
        let change = match (is_new, best == OVERWRITE || scans) {
            (true, _) => BUILD_NS * all,
            (_, true) => MOVE_NS[TREE] * all + REFIT_NS[1] * leaves,
            _ => 2.0 * REFIT_NS[1] * leaves,
        };
        self.regret += costs[self.update] - costs[best];
        // At the second update the number of queries per frame is known.
        if before < 2 || self.regret > change {
            (self.update, self.regret) = (best, 0.0);
        }
        self.since = [self.since[0] + queries, self.since[1] + costs[self.update]];
    }
}

impl RegionIndex for Auto {
    const INFO: Info = Info::ours(
        "auto",
        "a tree or a scan, and its updates, by counted work; use=wide, moving or linear \
         and update=refit or rebuild force them",
        Kind::Tree,
    )
    .refits()
    .threaded_build()
    .on_request();
    type Params = AutoParams;

    /// O(n log n), that of [`Wide`](super::Wide), and a few queries.
    fn build(input: &Input<'_>, params: &AutoParams) -> Result<Self, BuildError> {
        let (order, two_trees) = (params.order, params.structure == Use::Moving);
        if two_trees && params.update == Update::Rebuild {
            return Err(BuildError::Params {
                structure: Self::INFO.name,
                reason: "use=moving,update=rebuild; expected update=refit, as a new tree has no \
                         second one of movers"
                    .to_owned(),
            });
        }
        let input = input.come_and_go(input.come_and_go && !two_trees);
        let mut auto = Auto {
            trees: Moving::resting(&input, &WideParams { order })?,
            params: *params,
            two_trees,
            ..Auto::default()
        };
        auto.calibrate(input.items);
        auto.start();
        Ok(auto)
    }

    fn memory(&self) -> MemoryUsage {
        let scan = self.scan.as_ref().or(self.reserve.as_ref());
        let scan = scan.map_or(MemoryUsage::default(), Linear::memory);
        let trees = self.trees.memory();
        MemoryUsage {
            node_bytes: trees.node_bytes + scan.node_bytes,
            item_bytes: trees.item_bytes + scan.item_bytes,
        }
    }

    #[inline(always)]
    fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, cx: &mut C) -> ControlFlow<()> {
        // A query that counts its work is not one of a frame.
        if size_of::<C::Recorder>() == 0 {
            let queries = self.queries.load(Relaxed);
            if queries < MOST_QUERIES {
                self.queries.store(queries + 1, Relaxed);
            }
        }
        let Some(scan) = &self.scan else {
            return self.trees.query(volume, cx);
        };
        // Nothing has moved: the root of the tree bounds all items.
        if self.updates[OVERWRITE] == 0
            && let Some(flow) = self.trees.still.query_root(volume, &scan.ids, cx)
        {
            return flow;
        }
        scan.query(volume, cx)
    }

    /// O(moved), or a rebuild. Items may become or cease to be empty.
    fn refit(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        if moved.is_empty() {
            // Prepares tables for the following updates.
            return match &mut self.scan {
                Some(scan) => scan.refit(items, moved),
                None => {
                    self.reserve = self.reserve.take().or_else(|| self.reserve_of(items));
                    self.refit_held(items, moved) || self.rebuild(items)
                }
            };
        }
        self.weighing += 1;
        self.moved += moved.len() as f64;
        let before = self.updates.iter().sum::<u32>();
        if before < 2 || self.weighing >= TOGETHER.max(FEW / items.len().max(1) as u32) {
            self.weigh(items);
        }
        if before == 0
            && let Some(scan) = &mut self.reserve
        {
            scan.refit(items, moved);
        } else if self.update != OVERWRITE {
            self.reserve = None;
        }
        match self.update {
            REBUILD => self.rebuild(items),
            kind if (kind == MOVING) != self.two_trees => self.rebuild(items),
            OVERWRITE => self.overwrite(items, moved),
            _ => self.refit_trees(items, moved),
        }
    }

    fn chose(&self) -> Option<String> {
        let others = |names: &[&str], costs: &[f64], taken: usize| {
            let others =
                (0..names.len()).filter(|&i| i != taken && (costs[i] / costs[taken]).is_normal());
            let ratio =
                |i: usize| format!("{} (modelled {:.3} x)", names[i], costs[i] / costs[taken]);
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
            told = format!("built as {told}; {name} in {here} of {count} updates{left_out}");
        }
        Some(told)
    }
}

#[cfg(test)]
mod tests;
