//! Advice about a scene and a path, with its measurements.
//!
//! It names a structure, a culling test and the features to leave out.

mod case;
mod change;
mod choice;
mod motion;
mod omission;
mod options;
mod rule;
mod rules;
mod trials;

use anyhow::{Result, ensure};
use serde::{Deserialize, Serialize};

pub use change::{Axis, Beside, Change};
pub use choice::{StructureChoice, TestChoice, TestRow, ns};
pub use motion::{MotionChoice, policy_of};
pub use omission::Check;
pub use options::{AdviseInput, AdviseOptions};
pub use rule::Omission;

use crate::culling::CullingTest;
use crate::funnel::{self, FunnelPlan};
use crate::measure::{
    OverProcesses, Part, ProcessTimes, ReportCell, Schedule, Setting, SharedWork, timed,
};
use crate::motion::Motion;
use crate::statistics::Estimate;

use case::Case;
use options::planned;
use rule::{Draft, Facts, Finding, Rule, Unfit};
use rules::RULES;
use rules::stages;
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
    /// Update policy; null for a still scene.
    pub motion: Option<MotionChoice>,
    /// Gain from threads, where structures were measured with several.
    pub threads: Vec<SharedWork>,
    /// From which number of items and shares on another structure is faster.
    pub changes: Vec<Change>,
}

impl Advice {
    /// Returns `true` if a structure or a side of a rule gave a wrong answer.
    pub fn found_wrong_answers(&self) -> bool {
        let structures = self.structure.rows.iter();
        let omissions = self.omissions.iter().flat_map(|o| &o.checks);
        structures.into_iter().any(|row| row.status.is_failure())
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
    beside: Beside,
    /// Times of the stages, if the scene and the cameras have such.
    stages: Option<FunnelPlan>,
}

/// Compared advice before its times.
pub struct Prepared {
    /// Tasks and schedule for all processes.
    pub plan: TrialPlan,
    entered: Entered,
    answered: Answered,
    /// Cells of the run's tasks, and counts of the workloads beside.
    cells: Vec<ReportCell>,
    counted: Vec<Part>,
    structure: StructureChoice,
    motion: Option<MotionChoice>,
    funnel: Result<funnel::Prepared, String>,
}

/// Runs every rule with and without its feature on the fastest tree.
///
/// Compares both sides with each other and with the exact truth, and plans their times.
///
/// # Errors
/// A camera without a view, a scene that a structure of the rules refuses.
pub fn prepare(
    input: &AdviseInput,
    cells: Vec<ReportCell>,
    progress: &dyn Fn(&str),
) -> Result<Prepared> {
    let Setting { scene, path, .. } = input.setting;
    let workload = input.workload()?;
    let structure = StructureChoice::of(&cells);
    let structures = structure.tree_and_scan();
    let items = scene.items.len() as f64;
    let visible = cells.iter().find_map(|cell| cell.value("visible_count"));
    let moved = workload.motion.as_ref().map(Motion::share);
    let here = [Some(items), visible.map(|count| count / items), moved];
    let contenders = structure.contenders(moved.is_some());
    let (motion, policies) =
        MotionChoice::begun(input, &structure, workload.motion.as_ref()).unzip();
    let labels = [contenders, policies.unwrap_or_default()];
    let (beside, counted) = Beside::plan(input, labels, here, progress);
    let case = Case::new(input, &workload, &structures)?;
    let mut trials = Trials::new(&case);
    let mut entered = enter(&mut trials, progress)?;
    progress("answers, checked");
    let answered = trials.answered();
    let drafts = entered.rules.iter_mut();
    for sides in drafts.flat_map(|(_, draft)| &mut draft.sides) {
        trials.compare(sides);
    }
    let tasks = trials.tasks(&answered.counts);
    let tree = planned(&input.setting.structures, &structures[0]);
    let funnel = funnel::prepare(&stages::input(input.setting, &tree), progress);
    let funnel = funnel.map_err(|error| error.to_string());
    Ok(Prepared {
        plan: TrialPlan {
            structures,
            schedule: Schedule::new(path.cameras.len(), &tasks, &input.setting.protocol),
            expected: answered.counts.clone(),
            beside,
            stages: funnel.as_ref().ok().map(|prepared| prepared.plan.clone()),
        },
        funnel,
        structure,
        motion,
        cells,
        counted,
        entered,
        answered,
    })
}

/// Times of one process.
///
/// # Errors
/// The errors of [`prepare`], and a scene other than the planned one.
pub fn time(input: &AdviseInput, plan: &TrialPlan) -> Result<ProcessTimes> {
    let Setting { path, protocol, .. } = input.setting;
    let workload = input.workload()?;
    let case = Case::new(input, &workload, &plan.structures)?;
    let mut trials = Trials::new(&case);
    enter(&mut trials, &|_| ())?;
    let (found, ways) = (trials.len(), plan.expected.len());
    let cameras = plan.expected.iter().map(Vec::len);
    ensure!(
        found == ways && cameras.min() == Some(path.cameras.len()),
        "{found} ways to answer; the plan has {ways}: the scene or the cameras have changed on \
         the way"
    );
    let once_ns = trials.once_ns.clone();
    let tasks = trials.tasks(&plan.expected);
    let mut times = ProcessTimes {
        once_ns,
        parts: plan.beside.times(input)?,
        ..ProcessTimes::of(&timed(&tasks, &plan.schedule, protocol, &|_| ()))
    };
    if let Some(of_stages) = &plan.stages {
        let tree = planned(&input.setting.structures, &plan.structures[0]);
        let found = funnel::time(&stages::input(input.setting, &tree), of_stages)?;
        times.ln_ns.extend(found.ln_ns);
    }
    Ok(times)
}

impl Prepared {
    /// The advice from the times of all processes.
    pub fn conclude(self, input: &AdviseInput, processes: &[ProcessTimes]) -> Advice {
        let Setting { scene, path, .. } = input.setting;
        let (times, answered) = (OverProcesses::of(processes), &self.answered);
        let ([tree, _], beside) = (self.plan.structures, &self.plan.beside);
        let tests = &self.entered.tests;
        let test = TestChoice::of(tree, input.options.draw_ns, tests, answered, &times);
        let groups = beside.groups(self.counted, processes);
        // Under further policies the first one is the workload itself.
        let here = groups.first().filter(|_| beside.has_policies());
        let here = here.map_or(&self.cells, |group| &group.cells);
        let changes = beside.changes(here, &groups);
        // The times of the stages come behind those of the tasks.
        let tasks = self.plan.expected.len();
        let of_stages = processes.iter().map(|process| ProcessTimes {
            ln_ns: process.ln_ns[tasks..].to_vec(),
            ..ProcessTimes::default()
        });
        let of_stages: Vec<ProcessTimes> = of_stages.collect();
        let funnel = self.funnel.map(|prepared| prepared.conclude(&of_stages));
        let choices = || Facts {
            checks: Vec::new(),
            once_ns: [f64::NAN; 2],
            once_ratio: None,
            structure: &self.structure,
            test: &test,
            changes: &changes,
            funnel: &funnel,
        };
        let rules = self.entered.rules.into_iter();
        let settled = rules.map(|(rule, draft)| rule.settled(draft, answered, &times, choices()));
        Advice {
            scene: scene.name.clone(),
            path: path.name.clone(),
            items: scene.items.len(),
            skipped_items: scene.skipped_items,
            cameras: path.cameras.len(),
            options: *input.options,
            processes: processes.len(),
            twin: times.ratio(self.entered.twin, BASE),
            omissions: settled.collect(),
            test,
            warnings: path.warnings(scene),
            motion: (self.motion).map(|motion| motion.chosen(&self.structure, here)),
            structure: self.structure,
            threads: SharedWork::of(&self.cells),
            changes,
        }
    }
}

/// All tasks, in the order in which every process enters them.
struct Entered {
    tests: Vec<(CullingTest, usize)>,
    rules: Vec<(&'static Rule, Draft)>,
    twin: usize,
}

fn enter(trials: &mut Trials, progress: &dyn Fn(&str)) -> Result<Entered> {
    let mut rules = Vec::with_capacity(RULES.len());
    for rule in RULES {
        progress(rule.name);
        let draft = (rule.prepare)(trials).or_else(|error| {
            let Unfit(reason) = error.downcast()?;
            anyhow::Ok(Draft::new(Vec::new(), Finding::none(reason)))
        });
        rules.push((rule, draft?));
    }
    Ok(Entered {
        tests: choice::enter_tests(trials)?,
        twin: trials.add_base(),
        rules,
    })
}
