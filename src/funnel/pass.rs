//! What goes through chains of stages: the items that each stage is given and hands
//! on, view by view. What several chains have in common is done once.

use std::collections::HashMap;

use super::chain::Chain;
use super::stage::{NONE, StageKind};
use super::world::World;
use crate::query::ItemId;

/// A stage as it was done to one set of items of each view.
#[derive(Clone, Debug)]
pub struct Step {
    /// The stage.
    pub stage: StageKind,
    /// What does it.
    pub back_end: String,
    /// The set that it was given, an index into [`Pass::sets`].
    pub input: usize,
    /// The set that it handed on.
    pub output: usize,
}

/// The set of all items, which is never listed: index 0.
pub const ALL: usize = 0;

/// Steps, and the sets of items between them.
pub struct Pass<'w> {
    world: &'w World<'w>,
    /// By set and view, ascending ids; [`ALL`] is empty and stands for every item.
    sets: Vec<Vec<Vec<ItemId>>>,
    steps: Vec<Step>,
    found: HashMap<(StageKind, String, usize), usize>,
}

const COUNT: usize = StageKind::OF_ITEMS.len();

/// A chain that has been gone through.
#[derive(Clone, Debug)]
pub struct Walked {
    /// By stage: the step, if the stage does anything.
    pub steps: [Option<usize>; COUNT],
    /// By stage: the set that it was given, and behind them the last one.
    pub sets: [usize; COUNT + 1],
}

impl Walked {
    /// The set that is left to be drawn.
    pub fn left(&self) -> usize {
        self.sets[COUNT]
    }
}

impl<'w> Pass<'w> {
    /// Nothing yet.
    pub fn new(world: &'w World<'w>) -> Pass<'w> {
        Pass {
            world,
            sets: vec![vec![Vec::new(); world.views()]],
            steps: Vec::new(),
            found: HashMap::new(),
        }
    }

    /// Every step so far.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// The items of a set in a view; `None` for all that there are.
    pub fn items(&self, set: usize, view: usize) -> Option<&[ItemId]> {
        (set != ALL).then(|| &self.sets[set][view][..])
    }

    /// How many items a set has in a view.
    pub fn count(&self, set: usize, view: usize) -> usize {
        self.items(set, view)
            .map_or(self.world.items(), <[ItemId]>::len)
    }

    /// Mean number of items of a set over the views.
    pub fn mean_count(&self, set: usize) -> f64 {
        let views = self.world.views();
        let counts = (0..views).map(|view| self.count(set, view) as f64);
        counts.sum::<f64>() / views.max(1) as f64
    }

    /// The steps of a chain whose times add up: not the object stage where the
    /// occlusion stage does it as well.
    pub fn timed_steps(&self, walked: &Walked) -> Vec<usize> {
        let of = |stage: StageKind| walked.steps[stage as usize];
        let occlusion = of(StageKind::Occlusion);
        let is_both = |step: usize| self.world.does_object_stage(&self.steps[step].back_end);
        let object = of(StageKind::Object).filter(|_| !occlusion.is_some_and(is_both));
        let steps = [of(StageKind::Region), object, occlusion];
        steps.into_iter().flatten().collect()
    }

    /// Goes through the stages of a chain that hand on items; `None` if `stop` says
    /// so on the way.
    pub fn walk(&mut self, chain: &Chain, stop: &dyn Fn() -> bool) -> Option<Walked> {
        let mut walked = Walked {
            steps: [None; COUNT],
            sets: [ALL; COUNT + 1],
        };
        for (place, stage) in StageKind::OF_ITEMS.into_iter().enumerate() {
            let (name, input) = (chain.of(stage), walked.sets[place]);
            if name != NONE {
                walked.steps[place] = Some(self.step(stage, name, input, stop)?);
            }
            walked.sets[place + 1] = match walked.steps[place] {
                Some(step) => self.steps[step].output,
                None => input,
            };
        }
        Some(walked)
    }

    /// Does a stage to a set; its index among the steps.
    pub fn step(
        &mut self,
        stage: StageKind,
        name: &str,
        input: usize,
        stop: &dyn Fn() -> bool,
    ) -> Option<usize> {
        let key = (stage, name.to_owned(), input);
        if let Some(step) = self.found.get(&key) {
            return Some(*step);
        }
        let run = self.world.run(stage, name);
        let mut output = Vec::with_capacity(self.world.views());
        for view in 0..self.world.views() {
            if stop() {
                return None;
            }
            let mut ids = Vec::new();
            run(view, self.items(input, view), &mut ids);
            ids.sort_unstable();
            output.push(ids);
        }
        self.sets.push(output);
        self.steps.push(Step {
            stage,
            back_end: name.to_owned(),
            input,
            output: self.sets.len() - 1,
        });
        self.found.insert(key, self.steps.len() - 1);
        Some(self.steps.len() - 1)
    }
}
