//! Stages of whole items: their back ends, and the items that chains leave.

use std::cell::RefCell;
use std::rc::Rc;

use super::setup::{PathView, Setup};
use super::stage::{Chain, NONE, OCCLUSION_ROWS, StageKind, Step};
use super::task::{FunnelKey, KeyedTask};
use super::visible_items::{ViewCounts, VisibleItems, count_items};
use crate::camera::Camera;
use crate::measure::QueryFn;
use crate::query::ItemId;
use crate::visibility::occlusion;
use crate::visibility::region::{IdSet, Scratch};

/// Appends the items that a stage leaves; the argument is its input (`None`: all).
pub type StageRun<'w> = Box<dyn Fn(usize, Option<&[ItemId]>, &mut Vec<ItemId>) + 'w>;

impl Setup<'_> {
    /// Back end of a stage of whole items, after the steps `before`.
    ///
    /// # Panics
    /// If there is no such back end.
    pub fn run(&self, stage: StageKind, name: &str, before: &[Step]) -> StageRun<'_> {
        match stage {
            StageKind::Region => self.run_region(name),
            StageKind::Object => self.run_object(name),
            StageKind::Occlusion => self.run_occlusion(name, before),
            StageKind::Triangle | StageKind::Fragment => unreachable!("no stage of whole items"),
        }
    }

    fn run_region(&self, name: &str) -> StageRun<'_> {
        let regions = self.regions.as_ref().expect("a scene with regions");
        let pairs = regions.pairs(name).expect("a row of the region stage");
        let state = RefCell::new((Scratch::default(), IdSet::default(), Vec::new()));
        Box::new(move |view, _, out| {
            let (scratch, marks, seen) = &mut *state.borrow_mut();
            let rays = &self.views[view].rays;
            regions.graph.seen_by(rays, pairs, scratch, seen);
            regions.items.of_regions(seen, marks, out);
        })
    }

    fn run_object(&self, name: &str) -> StageRun<'_> {
        let found = self.structures.iter().find(|(spec, _)| spec.label == name);
        let (_, index) = found.expect("a structure that was built");
        let state = RefCell::new((IdSet::default(), Vec::new()));
        Box::new(move |view, input, out| {
            let volume = &self.views[view].volume;
            let Some(items) = input else {
                return index.visible(volume, out);
            };
            // A structure always searches the whole scene.
            let (marks, found) = &mut *state.borrow_mut();
            found.clear();
            index.visible(volume, found);
            marks.clear(self.items());
            marks.insert_all(found.iter());
            out.extend(items.iter().filter(|&&id| marks.holds(id)));
        })
    }

    fn run_occlusion(&self, name: &str, before: &[Step]) -> StageRun<'_> {
        let row = OCCLUSION_ROWS.iter().find(|row| row.name == name);
        let row = row.expect("a row of the occlusion stage");
        let occlude = RefCell::new((row.build)(self.samples, self.kernel));
        let occluders: Vec<_> = self.views().map(|view| self.occluders(view)).collect();
        // A traversal of the whole scene ignores the visible regions.
        let by_region = before.iter().any(|(stage, _)| *stage == StageKind::Region);
        Box::new(move |view, input, out| {
            let occluders = occluders[view];
            let PathView { rays, volume, .. } = &self.views[view];
            let view = occlusion::View::new(rays, volume, occluders, self.samples);
            (occlude.borrow_mut())(occluders, &view, out);
            if let (Some(items), true) = (input, by_region) {
                out.retain(|id| items.binary_search(id).is_ok());
            }
        })
    }
}

/// Ascending ids of a view, which views of all items share.
type Ids = Rc<[ItemId]>;

/// Items that remain in each view after the back ends of the item stages.
pub struct ItemStages<'w> {
    pub setup: &'w Setup<'w>,
    /// Steps of the chain, whose items remain.
    steps: Vec<Step>,
    /// Ascending ids for each view, keyed by the steps that leave them.
    ///
    /// First those of no steps: all items.
    outputs: Vec<(Vec<Step>, Vec<Ids>)>,
}

impl<'w> ItemStages<'w> {
    /// Runs a chain and all chains that differ from it in one stage.
    pub fn all(setup: &'w Setup<'w>, chain: &Chain) -> ItemStages<'w> {
        let every: Ids = (0..setup.items() as ItemId).collect();
        let mut all = ItemStages {
            setup,
            steps: chain.steps(),
            outputs: vec![(Vec::new(), vec![every; setup.views.len()])],
        };
        all.run(&chain.steps());
        for stage in StageKind::OF_ITEMS {
            for (_, name) in setup.rows(stage) {
                all.run(&chain.steps_with(stage, &name));
            }
            if chain.is_separate(stage) {
                all.run(&chain.clone().with(stage, NONE).steps());
            }
        }
        all
    }

    /// Runs steps in order, each sequence only once.
    fn run(&mut self, steps: &[Step]) {
        let Some(((stage, name), before)) = steps.split_last() else {
            return;
        };
        if self.outputs.iter().any(|(own, _)| own == steps) {
            return;
        }
        self.run(before);
        let run = self.setup.run(*stage, name, before);
        let input = self.input(before);
        let output = self.setup.views().map(|view| {
            let mut ids = Vec::new();
            run(view, input.map(|outputs| &outputs[view][..]), &mut ids);
            ids.sort_unstable();
            ids.into()
        });
        let output = output.collect();
        self.outputs.push((steps.to_vec(), output));
    }

    /// Items of each view after some steps.
    fn after(&self, steps: &[Step]) -> &[Ids] {
        let found = self.outputs.iter().find(|(own, _)| own == steps);
        &found.expect("steps that were run").1
    }

    /// Input of what follows some steps; `None` (all items) after none.
    fn input(&self, before: &[Step]) -> Option<&[Ids]> {
        (!before.is_empty()).then(|| self.after(before))
    }

    /// Items of a view after some steps.
    pub fn items(&self, steps: &[Step], view: usize) -> &[ItemId] {
        &self.after(steps)[view]
    }

    /// Remaining items of a view.
    pub fn remaining(&self, view: usize) -> &[ItemId] {
        self.items(&self.steps, view)
    }

    /// Mean number of items per view that a chain leaves.
    pub fn mean_count(&self, chain: &Chain) -> f64 {
        let outputs = self.after(&chain.steps());
        let counts = outputs.iter().map(|outputs| outputs.len() as f64);
        counts.sum::<f64>() / outputs.len().max(1) as f64
    }

    /// Counts of the last of some steps in each view.
    pub fn counts(&self, before: &[Step], steps: &[Step], truth: &VisibleItems) -> Vec<ViewCounts> {
        let both = self.after(before).iter().zip(self.after(steps));
        let seen = both.zip(truth);
        let counts = seen.map(|((input, output), seen)| count_items(input, output, seen));
        counts.collect()
    }

    /// Tasks of all steps that were run.
    pub fn tasks(&self) -> impl Iterator<Item = KeyedTask<'_>> {
        self.outputs.iter().filter_map(|(steps, _)| {
            let ((stage, name), before) = steps.split_last()?;
            let run = self.setup.run(*stage, name, before);
            let input = self.input(before);
            let ask: QueryFn = Box::new(move |view, out| {
                run(view, input.map(|outputs| &outputs[view][..]), out);
            });
            Some((FunnelKey::Steps(steps.clone()), ask))
        })
    }

    /// Tasks of a chain; their times add up.
    pub fn timed(&self, chain: &Chain) -> Vec<FunnelKey> {
        let steps = chain.steps();
        let is_timed = |end: &usize| chain.is_separate(steps[end - 1].0);
        let ends = (1..=steps.len()).filter(is_timed);
        ends.map(|end| FunnelKey::Steps(steps[..end].to_vec()))
            .collect()
    }
}

/// Outcome for an item: the stage that removed it, or its visibility.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum ItemOutcome {
    /// Removed by a stage.
    Removed(StageKind),
    /// Kept by all stages, but not visible at any sample.
    Kept,
    /// Kept, and in front at a sample.
    Visible,
    /// Removed, although in front at a sample.
    Lost,
}

/// The view with the most visible items, and the outcome for each item.
#[derive(Clone, Default, Debug)]
pub struct PlanView {
    /// Camera of the view; `None` without views.
    pub camera: Option<Camera>,
    /// Outcomes by item.
    pub outcomes: Vec<ItemOutcome>,
}

impl PlanView {
    /// First of the views with the most visible items, under a chain's item stages.
    pub fn of(setup: &Setup, stages: &ItemStages, chain: &Chain, truth: &VisibleItems) -> PlanView {
        let both = setup.views.iter().zip(truth).enumerate();
        let most = both.rev().max_by_key(|(_, (_, visible))| visible.len());
        let Some((index, (view, visible))) = most else {
            return PlanView::default();
        };
        let outputs = StageKind::OF_ITEMS.map(|stage| {
            let steps = chain.steps_with(stage, chain.of(stage));
            (stage, stages.items(&steps, index))
        });
        let is_visible = |item| visible.binary_search_by_key(&item, |(id, _)| *id).is_ok();
        let items = (0..).take(setup.scene.items.len());
        let outcomes = items.map(|item| outcome(item, &outputs, is_visible(item)));
        PlanView {
            camera: Some(view.rays.camera),
            outcomes: outcomes.collect(),
        }
    }
}

/// Outcome of an item, from the ascending ids after each stage.
fn outcome(item: ItemId, outputs: &[(StageKind, &[ItemId])], is_visible: bool) -> ItemOutcome {
    let mut outputs = outputs.iter();
    let removed = outputs.find(|(_, set)| set.binary_search(&item).is_err());
    match (removed, is_visible) {
        (Some(_), true) => ItemOutcome::Lost,
        (Some((stage, _)), false) => ItemOutcome::Removed(*stage),
        (None, true) => ItemOutcome::Visible,
        (None, false) => ItemOutcome::Kept,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_stage_that_lacks_an_item_removed_it() {
        let sets: [(StageKind, &[ItemId]); 3] = [
            (StageKind::Region, &[1, 2, 3, 7]),
            (StageKind::Object, &[1, 2, 3]),
            (StageKind::Occlusion, &[1, 3]),
        ];
        let of = |item, is_visible| outcome(item, &sets, is_visible);
        assert_eq!(of(1, true), ItemOutcome::Visible);
        assert_eq!(of(3, false), ItemOutcome::Kept);
        assert_eq!(of(2, false), ItemOutcome::Removed(StageKind::Occlusion));
        assert_eq!(of(2, true), ItemOutcome::Lost);
        assert_eq!(of(7, false), ItemOutcome::Removed(StageKind::Object));
    }
}
