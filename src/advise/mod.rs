//! Advice about a scene and a path, with its measurements.
//!
//! It names a structure, a culling test and the features to leave out.

mod case;
mod choice;
mod omission;
mod options;
mod rule;
mod rules;
mod trials;

use serde::{Deserialize, Serialize};

pub use choice::{StructureChoice, StructureRow, TestChoice, TestRow};
pub use omission::{Check, LeftOutIf, Omission};
pub use options::{AdviseError, AdviseOptions};

use crate::culling::{Culling, CullingTest};
use crate::funnel::check_memory;
use crate::index::StructureSpec;
use crate::measure::{OverProcesses, ProcessTimes, Protocol, Schedule, Workload, timed_to_end};
use crate::path::CameraPath;
use crate::scene::Scene;
use crate::statistics::Estimate;

use case::Case;
use rule::{Draft, Rule, Unfit};
use rules::RULES;
use trials::{Answered, BASE, Trials};

/// Structure, test and features to leave out, with the evidence.
#[derive(Clone, Debug, Serialize)]
pub struct Advice {
    /// Name of the scene.
    pub scene: String,
    /// Name of the path.
    pub path: String,
    /// Number of items.
    pub items: usize,
    /// Number of bad items that were left out on request.
    pub skipped_items: usize,
    /// Number of cameras.
    pub cameras: usize,
    /// Costs and limits.
    pub options: AdviseOptions,
    /// Number of timed processes; an interval needs three or more.
    pub processes: usize,
    /// A/A check: time of the fastest tree, entered a second time, / its own time; the
    /// interval contains 1.
    pub twin: Option<Estimate>,
    /// The structure to take.
    pub structure: StructureChoice,
    /// The culling test to take.
    pub test: TestChoice,
    /// One omission per rule.
    pub omissions: Vec<Omission>,
    /// Warnings about the cameras in the scene.
    pub warnings: Vec<String>,
}

impl Advice {
    /// Returns `true` if a structure or a side of a rule gave a wrong answer.
    pub fn found_wrong_answers(&self) -> bool {
        let structures = self.structure.rows.iter();
        let omissions = self.omissions.iter().flat_map(|o| &o.checks);
        structures.into_iter().any(|row| row.is_failure)
            || omissions.into_iter().any(Check::is_wrong)
    }
}

/// Tasks and schedule of the timed pass, the same for all processes.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TrialPlan {
    /// The tree and the scan of the rules.
    structures: [String; 2],
    schedule: Schedule,
    /// Number of ids, by task and camera.
    expected: Vec<Vec<u64>>,
}

/// Compared advice before its times.
pub struct Prepared {
    /// Tasks and schedule for all processes.
    pub plan: TrialPlan,
    tests: Vec<(CullingTest, usize)>,
    rules: Vec<(&'static Rule, Result<Draft, String>)>,
    twin: usize,
    answered: Answered,
    advice: Advice,
}

/// Bytes per item of the structures and trees of all rules; 950 were measured.
const BYTES_PER_ITEM: u64 = 1000;

/// Scene, path and options.
#[derive(Clone, Copy)]
pub struct AdviseInput<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The cameras.
    pub path: &'a CameraPath,
    /// Structures to choose from.
    pub structures: &'a [StructureSpec],
    /// Costs and limits.
    pub options: &'a AdviseOptions,
    /// Rounds and times of a process.
    pub protocol: &'a Protocol,
}

impl<'a> AdviseInput<'a> {
    /// Refuses a scene without items and a path without cameras.
    ///
    /// # Errors
    /// [`AdviseError::Refused`].
    pub fn check(&self) -> Result<(), AdviseError> {
        let (scene, path) = (&self.scene.name, &self.path.name);
        let reason = match (self.scene.items.len(), self.path.cameras.len()) {
            (0, _) => format!("scene '{scene}' has no items; expected at least one"),
            (_, 0) => format!("path '{path}' has no cameras; expected at least one"),
            _ => return Ok(()),
        };
        Err(AdviseError::Refused(reason))
    }

    fn workload(&self) -> Result<Workload<'a>, AdviseError> {
        let needed = BYTES_PER_ITEM * self.scene.items.len() as u64;
        check_memory(&self.scene.name, needed)
            .map_err(|error| AdviseError::Refused(error.to_string()))?;
        Ok(Workload::new(self.scene, self.path, &Culling::default())?)
    }
}

/// Runs every rule with and without its feature on the fastest tree.
///
/// Compares both sides with each other and with the exact truth, and plans their times.
///
/// # Errors
/// A camera without a view, a scene that a structure of the rules refuses.
pub fn prepare(
    input: &AdviseInput,
    mut structure: StructureChoice,
    progress: &dyn Fn(&str),
) -> Result<Prepared, AdviseError> {
    let AdviseInput { scene, path, .. } = *input;
    let workload = input.workload()?;
    let specs = structure.tree_and_scan(input.structures)?;
    structure.note_kinds(input.structures);
    let structures = specs.each_ref().map(|spec| spec.label.clone());
    let case = Case::new(&workload, path, specs, input.options, input.protocol)?;
    let mut entered = Entered::new(&case, progress)?;
    progress("answers, checked");
    let answered = entered.trials.answered();
    let drafts = entered.rules.iter_mut().flat_map(|(_, draft)| draft);
    drafts
        .flat_map(|draft| &mut draft.sides)
        .for_each(|sides| entered.trials.compare(sides));
    let tasks = entered.trials.tasks(&answered.counts);
    Ok(Prepared {
        plan: TrialPlan {
            structures,
            schedule: Schedule::new(path.cameras.len(), &tasks, input.protocol),
            expected: answered.counts.clone(),
        },
        advice: Advice {
            scene: scene.name.clone(),
            path: path.name.clone(),
            items: scene.items.len(),
            skipped_items: scene.skipped_items,
            cameras: path.cameras.len(),
            options: *input.options,
            processes: 0,
            twin: None,
            test: TestChoice::untimed(&case.spec.label),
            structure,
            omissions: Vec::new(),
            warnings: path.warnings(scene),
        },
        tests: entered.tests,
        rules: entered.rules,
        twin: entered.twin,
        answered,
    })
}

/// Times of one process.
///
/// # Errors
/// The errors of [`prepare`], and a scene other than the planned one.
pub fn time(input: &AdviseInput, plan: &TrialPlan) -> Result<ProcessTimes, AdviseError> {
    let workload = input.workload()?;
    let [tree, scan] = &plan.structures;
    let specs = [tree, scan].map(|label| choice::planned(input.structures, label));
    let [tree, scan] = specs;
    let case = Case::new(
        &workload,
        input.path,
        [tree?, scan?],
        input.options,
        input.protocol,
    )?;
    let entered = Entered::new(&case, &|_| ())?;
    let (found, planned) = (entered.trials.len(), plan.expected.len());
    let cameras = plan.expected.iter().map(Vec::len);
    if found != planned || cameras.min() != Some(input.path.cameras.len()) {
        return Err(AdviseError::Refused(format!(
            "{found} ways to answer; the plan has {planned}: the scene or the cameras have changed \
             on the way"
        )));
    }
    let once_ns = entered.trials.once_ns.clone();
    let tasks = entered.trials.tasks(&plan.expected);
    Ok(ProcessTimes {
        once_ns,
        ..ProcessTimes::of(&timed_to_end(&tasks, &plan.schedule, input.protocol))
    })
}

impl Prepared {
    /// The advice from the times of all processes.
    pub fn conclude(self, processes: &[ProcessTimes]) -> Advice {
        let (times, answered) = (OverProcesses::of(processes), &self.answered);
        let mut advice = self.advice;
        advice.processes = processes.len();
        advice.twin = times.ratio(self.twin, BASE);
        let draw_ns = advice.options.draw_ns;
        let structure = std::mem::take(&mut advice.test.structure);
        advice.test = TestChoice::of(structure, draw_ns, &self.tests, answered, &times);
        let settled = self.rules.into_iter().map(|(rule, draft)| match draft {
            Ok(draft) => rule.settled(draft, answered, &times, (&advice.structure, &advice.test)),
            Err(reason) => rule.not_applicable(reason),
        });
        advice.omissions = settled.collect::<Vec<_>>();
        advice
    }
}

/// All tasks, in the order in which every process enters them.
struct Entered<'c> {
    trials: Trials<'c>,
    tests: Vec<(CullingTest, usize)>,
    rules: Vec<(&'static Rule, Result<Draft, String>)>,
    twin: usize,
}

impl<'c> Entered<'c> {
    fn new(case: &'c Case<'c>, progress: &dyn Fn(&str)) -> Result<Self, AdviseError> {
        let mut trials = Trials::new(case);
        let mut rules = Vec::with_capacity(RULES.len());
        for rule in RULES {
            progress(rule.name);
            let draft = match (rule.prepare)(&mut trials) {
                Err(Unfit::Failed(error)) => return Err(error),
                Err(Unfit::NotApplicable(reason)) => Err(reason),
                Ok(draft) => Ok(draft),
            };
            rules.push((rule, draft));
        }
        Ok(Entered {
            tests: choice::enter_tests(&mut trials)?,
            twin: trials.add_base(),
            trials,
            rules,
        })
    }
}
