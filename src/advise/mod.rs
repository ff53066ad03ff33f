//! Advice about a scene and a path, with its measurements.
//!
//! Names a structure, a culling test and the features to leave out.

mod case;
mod change;
mod choice;
mod planes;
mod rule;
mod rules;
mod tasks;
mod test_choice;

use anyhow::Result;
use serde::{Deserialize, Serialize};

pub use case::AdviseInput;
pub use change::{Axis, ExtraWorkloads};
pub use choice::{MotionChoice, StructureChoice, ns, policy_of};
pub use rule::{Advice, Omission};
pub use tasks::{PairResult, TaskResult};
pub use test_choice::{TestChoice, TestRow};

use crate::funnel::{self, FunnelPlan};
use crate::measure::{
    Answer, OverProcesses, Part, ProcessTimes, ReportCell, Schedule, Setting, timed,
};
use crate::motion::Motion;

use case::Case;
use rule::{EnteredRule, Finding, Rule};
use rules::{RULES, input as stages};
use tasks::{BASE, CheckedAnswers, TaskList};
use test_choice::{Tested, add_tests};

/// Tasks and schedule of the timed pass, the same for all processes.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct AdvicePlan {
    /// Tree and scan of the rules, and structure taken by six planes.
    structures: [String; 3],
    schedule: Schedule,
    /// Expected answers by task and camera.
    expected: Vec<Vec<Answer>>,
    beside: ExtraWorkloads,
    /// Plan of the stages, if the scene and the cameras allow it.
    stages: Option<FunnelPlan>,
}

/// Advice whose answers are compared, but which is not timed.
pub struct UntimedAdvice {
    /// Tasks and schedule for all processes.
    pub plan: AdvicePlan,
    entered: RuleTasks,
    answered: CheckedAnswers,
    /// Counts of the additional workloads.
    counted: Vec<Part>,
    structure: StructureChoice,
    funnel: Result<funnel::UntimedFunnel, String>,
}

/// Runs every rule with and without its feature, most on the fastest tree.
///
/// Compares both sides with each other and with the exact truth, and plans their timing.
///
/// # Errors
/// A camera without a view, a scene that a structure of the rules refuses.
pub fn prepare(
    input: &AdviseInput,
    cells: Vec<ReportCell>,
    progress: &dyn Fn(&str),
) -> Result<UntimedAdvice> {
    let Setting { scene, path, .. } = input.setting;
    let workload = input.workload()?;
    let structure = StructureChoice::of(&cells);
    let structures = structure.labels();
    let items = scene.items.len() as f64;
    let visible = cells.iter().find_map(|cell| cell.value("visible_count"));
    let moved = workload.motion.as_ref().map(Motion::share);
    let here = [Some(items), visible.map(|count| count / items), moved];
    let contenders = structure.contenders(moved.is_some());
    let rebuilt = MotionChoice::rebuilt(input, &structure).and_then(Result::ok);
    let labels = (contenders, rebuilt);
    let (beside, counted) = ExtraWorkloads::plan(input, labels, here, progress);
    let case = Case::new(input, &workload, &structures)?;
    let mut tasks = TaskList::new(&case);
    let entered = enter(&mut tasks, progress)?;
    progress("answers, checked");
    let answered = tasks.answered();
    let tasks = tasks.tasks(&answered.answers);
    let funnel = funnel::prepare(&stages(input.setting, &case.spec), progress);
    let funnel = funnel.map_err(|error| error.to_string());
    Ok(UntimedAdvice {
        plan: AdvicePlan {
            structures,
            schedule: Schedule::new(path.cameras.len(), &tasks, &input.setting.protocol),
            expected: answered.answers.clone(),
            beside,
            stages: funnel.as_ref().ok().map(|prepared| prepared.plan.clone()),
        },
        funnel,
        structure,
        counted,
        entered,
        answered,
    })
}

/// Times the plan in one process.
///
/// # Errors
/// The errors of [`prepare`], and a scene other than the spec_of one.
pub fn time(input: &AdviseInput, plan: &AdvicePlan) -> Result<ProcessTimes> {
    let protocol = &input.setting.protocol;
    let workload = input.workload()?;
    let case = Case::new(input, &workload, &plan.structures)?;
    let mut tasks = TaskList::new(&case);
    enter(&mut tasks, &|_| ())?;
    let tasks = tasks.tasks(&plan.expected);
    let mut times = ProcessTimes {
        parts: plan.beside.times(input)?,
        ..ProcessTimes::of(&timed(&tasks, &plan.schedule, protocol, &|_| ()))
    };
    if let Some(of_stages) = &plan.stages {
        let found = funnel::time(&stages(input.setting, &case.spec), of_stages)?;
        times.ln_ns.extend(found.ln_ns);
    }
    Ok(times)
}

impl UntimedAdvice {
    /// Derives the advice from the times of all processes.
    pub fn conclude(self, input: &AdviseInput, processes: &[ProcessTimes]) -> Advice {
        let (times, answered) = (OverProcesses::of(processes), &self.answered);
        let beside = &self.plan.beside;
        let groups = beside.groups(self.counted, processes);
        let (mut structure, duel) = (self.structure, beside.here(&groups));
        structure.add_ties(&beside.contenders, duel.unwrap_or_default());
        let (tests, costs) = (self.entered.tests, [input.draw_ns, input.views as f64]);
        let test = TestChoice::of(costs, &mut structure, tests, answered, &times);
        // A tree taken for its test was not varied.
        let mut changes = beside.changes(duel.unwrap_or(&structure.rows), &groups);
        changes.retain(|_| structure.name.as_ref() == beside.contenders.first());
        let rebuilds = duel.filter(|_| beside.rebuilt.is_some());
        let policies = rebuilds.unwrap_or(&structure.rows);
        let motion = (input.motion).map(|_| MotionChoice::of(input, &structure, policies));
        // The times of the stages follow those of the tasks.
        let tasks = self.plan.expected.len();
        let of_stages = processes.iter().map(|process| ProcessTimes {
            ln_ns: process.ln_ns[tasks..].to_vec(),
            ..ProcessTimes::default()
        });
        let of_stages: Vec<ProcessTimes> = of_stages.collect();
        let funnel = self.funnel.map(|prepared| prepared.conclude(&of_stages));
        let mut advice = Advice {
            draw_ns: input.draw_ns,
            processes: processes.len(),
            twin: times.ratio(self.entered.twin, BASE),
            omissions: Vec::new(),
            test,
            motion,
            structure,
            changes,
            funnel,
        };
        let rules = self.entered.rules.into_iter();
        let settled = rules.map(|(rule, draft)| {
            let check = draft.sides.map(|sides| sides.check(answered, &times));
            let mut finding = (draft.conclude)(&advice, check.as_ref());
            finding.compared = (finding.compared).filter(|_| advice.structure.name.is_some());
            rule.omission(finding, check)
        });
        advice.omissions = settled.collect();
        advice
    }
}

/// All tasks, in the order in which every process adds them.
struct RuleTasks {
    tests: Vec<Tested>,
    rules: Vec<(&'static Rule, EnteredRule)>,
    twin: usize,
}

fn enter(tasks: &mut TaskList, progress: &dyn Fn(&str)) -> Result<RuleTasks> {
    let mut rules = Vec::with_capacity(RULES.len());
    for rule in RULES {
        progress(rule.name);
        // A rule whose tasks cannot be added does not apply.
        let draft = (rule.enter)(tasks);
        let none = |error: anyhow::Error| EnteredRule::new(None, Finding::none(error.to_string()));
        rules.push((rule, draft.unwrap_or_else(none)));
    }
    let (tests, twin) = (add_tests(tasks)?, tasks.add_base());
    Ok(RuleTasks { tests, rules, twin })
}
