//! Advice about one scene and path: which structure, which culling test, and
//! what can be left out, each with what was measured for it. It defines the rules
//! of omission and how their evidence is weighed; scenes, structures, clocks and
//! the truth belong to other modules.

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

use crate::culling::Culling;
use crate::index::StructureSpec;
use crate::measure::{OverProcesses, ProcessTimes, Protocol, Schedule, Workload, timed};
use crate::path::CameraPath;
use crate::scene::Scene;
use crate::statistics::Estimate;

use case::Case;
use choice::EnteredTest;
use omission::Draft;
use rules::RULES;
use trials::{Answered, BASE, Entered, Trials};

/// What to use and what to leave out, with the evidence.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Advice {
    /// Name of the scene.
    pub scene: String,
    /// Name of the path.
    pub path: String,
    /// Number of items.
    pub items: usize,
    /// Bad items that were left out on request.
    pub skipped_items: usize,
    /// Number of cameras.
    pub cameras: usize,
    /// What the advice was asked for with.
    pub options: AdviseOptions,
    /// Processes that were timed; an interval needs three or more.
    pub processes: usize,
    /// Time of the tree that rules are forced on, entered a second time, / time of
    /// itself: a check whose interval is to hold 1.
    pub twin: Option<Estimate>,
    /// Which structure to take.
    pub structure: StructureChoice,
    /// Which culling test to take.
    pub test: TestChoice,
    /// What to leave out or keep, a rule each.
    pub omissions: Vec<Omission>,
}

impl Advice {
    /// Whether something gave a wrong answer on the way.
    pub fn found_wrong_answers(&self) -> bool {
        let structures = self.structure.rows.iter();
        let omissions = self.omissions.iter().flat_map(|o| &o.checks);
        structures.into_iter().any(|row| row.is_failure)
            || omissions.into_iter().any(Check::is_wrong)
    }
}

/// What all processes time: the plan is the same for each.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TrialPlan {
    /// The tree and the scan that rules are forced on.
    structures: [String; 2],
    schedule: Schedule,
    /// By way and camera: ids.
    expected: Vec<Vec<u64>>,
}

/// Both sides of every rule, asked, compared and judged, but not timed.
pub struct Prepared {
    /// What the other processes are to measure.
    pub plan: TrialPlan,
    tests: Vec<EnteredTest>,
    rules: Vec<Entered>,
    twin: usize,
    answered: Answered,
    /// All but what follows from times.
    advice: Advice,
}

/// What advice is given about, and how it is measured.
#[derive(Clone, Copy)]
pub struct AdviseInput<'a> {
    /// The scene that the advice is about.
    pub scene: &'a Scene,
    /// The cameras that look at it.
    pub path: &'a CameraPath,
    /// To choose from.
    pub structures: &'a [StructureSpec],
    /// Thresholds and what to judge.
    pub options: &'a AdviseOptions,
    /// Rounds and times of a process.
    pub protocol: &'a Protocol,
}

impl AdviseInput<'_> {
    /// Whether there is anything to give advice about.
    ///
    /// # Errors
    /// No items, no cameras.
    pub fn check(&self) -> Result<(), AdviseError> {
        if self.scene.items.is_empty() {
            let scene = self.scene.name.clone();
            return Err(AdviseError::NoItems { scene });
        }
        if self.path.cameras.is_empty() {
            let path = self.path.name.clone();
            return Err(AdviseError::NoCameras { path });
        }
        Ok(())
    }
}

/// Forces every rule on and off on the fastest tree, compares both sides with
/// each other and with the exact truth, and plans how they are timed. `None` if
/// stopped.
///
/// # Errors
/// Nothing to look at, a camera without a view, a scene that the structures of
/// the rules refuse.
pub fn prepare(
    input: &AdviseInput,
    structure: StructureChoice,
    stop: &dyn Fn() -> bool,
    progress: &dyn Fn(&str),
) -> Result<Option<Prepared>, AdviseError> {
    let AdviseInput {
        scene,
        path,
        structures,
        options,
        protocol,
    } = *input;
    let workload = Workload::new(scene, path, &Culling::default())?;
    let specs = [structure.tree(structures)?, structure.scan(structures)?];
    let labels = specs.each_ref().map(|spec| spec.label.clone());
    let case = Case::new(&workload, path, specs, options)?;
    let Some(mut all) = Ways::enter(&case, stop, progress)? else {
        return Ok(None);
    };
    progress("answers, checked");
    let answered = all.trials.answered();
    for rule in &mut all.rules {
        all.trials.compare(rule);
    }
    let cameras = path.cameras.len();
    let tasks = all.trials.tasks(&answered.counts);
    Ok(Some(Prepared {
        plan: TrialPlan {
            structures: labels,
            schedule: Schedule::new(cameras, &tasks, protocol),
            expected: answered.counts.clone(),
        },
        advice: Advice {
            scene: scene.name.clone(),
            path: path.name.clone(),
            items: scene.items.len(),
            skipped_items: scene.skipped_items,
            cameras,
            options: *options,
            processes: 0,
            twin: None,
            test: TestChoice::untimed(&case.spec.label),
            structure,
            omissions: Vec::new(),
        },
        tests: all.tests,
        rules: all.rules,
        twin: all.twin,
        answered,
    }))
}

/// Times in this process what was planned; `None` if stopped.
///
/// # Errors
/// As [`prepare`]; another scene than the one that was planned for.
pub fn time(
    input: &AdviseInput,
    plan: &TrialPlan,
    stop: &dyn Fn() -> bool,
) -> Result<Option<ProcessTimes>, AdviseError> {
    let AdviseInput {
        scene,
        path,
        structures,
        options,
        protocol,
    } = *input;
    let workload = Workload::new(scene, path, &Culling::default())?;
    let [tree, scan] = &plan.structures;
    let specs = [
        choice::planned(structures, tree)?,
        choice::planned(structures, scan)?,
    ];
    let case = Case::new(&workload, path, specs, options)?;
    let Some(all) = Ways::enter(&case, stop, &|_| ())? else {
        return Ok(None);
    };
    let (found, planned) = (all.trials.len(), plan.expected.len());
    let cameras = plan.expected.iter().map(Vec::len);
    if found != planned || cameras.min() != Some(path.cameras.len()) {
        return Err(AdviseError::OtherPlan { found, planned });
    }
    let tasks = all.trials.tasks(&plan.expected);
    let timed = timed(&tasks, &plan.schedule, protocol, &|_| stop());
    Ok(timed.map(|timed| ProcessTimes {
        once_ns: all.once_ns,
        ..ProcessTimes::of(&timed)
    }))
}

impl Prepared {
    /// What follows from the times of all processes.
    pub fn conclude(self, processes: &[ProcessTimes]) -> Advice {
        let times = OverProcesses::of(processes);
        let mut advice = self.advice;
        advice.processes = processes.len();
        advice.twin = times.ratio(self.twin, BASE);
        let structure = std::mem::take(&mut advice.test.structure);
        let draw_ns = advice.options.draw_ns;
        advice.test = TestChoice::of(&structure, draw_ns, &self.tests, &self.answered, &times);
        let settled = self.rules.into_iter().map(|rule| {
            let mut omission = rule.settled(&self.answered, &times);
            rules::follow_test(&mut omission, &advice.test);
            omission
        });
        advice.omissions = settled.collect();
        advice
    }
}

/// Everything that is asked, in the order that all processes enter it.
struct Ways<'c> {
    trials: Trials<'c>,
    tests: Vec<EnteredTest>,
    rules: Vec<Entered>,
    twin: usize,
    once_ns: Vec<f64>,
}

impl<'c> Ways<'c> {
    /// `None` if stopped.
    fn enter(
        case: &'c Case<'c>,
        stop: &dyn Fn() -> bool,
        progress: &dyn Fn(&str),
    ) -> Result<Option<Self>, AdviseError> {
        let mut drafts: Vec<Draft<'c>> = Vec::with_capacity(RULES.len());
        for rule in RULES {
            if stop() {
                return Ok(None);
            }
            progress(rule.name);
            drafts.push(rule.draft(case)?);
        }
        let mut trials = Trials::new(case);
        let tests = choice::enter_tests(case, &mut trials)?;
        let mut once_ns = Vec::new();
        let drafts = drafts.into_iter();
        let rules = drafts
            .map(|draft| trials.enter(draft, &mut once_ns))
            .collect();
        Ok(Some(Ways {
            twin: trials.add_base(),
            trials,
            tests,
            rules,
            once_ns,
        }))
    }
}
