//! `cullbench advise`: the structure, the culling test and the work to leave out
//! for a scene and path, with the evidence. The library measures and weighs it.

use anyhow::Result;

use super::advise_table::blocks;
use super::args::AdviseArgs;
use super::document::show;
use super::processes::{Job, Message, Timing};
use super::study::{Study, load, note_solid};
use super::{Ending, print, tell, text};
use crate::advise::{self, AdviseInput};
use crate::index::Registry;
use crate::measure::{Effort, Group, Part, Plan, ProcessTimes, Setting, Share, cameras_within};
use crate::report::Experiment;
use crate::suite::SUITES;

/// Most cameras of a path: every rule holds views of all, some 20 KB per camera.
const MOST_CAMERAS: usize = 4096;
/// Rounds of a task, if one process has them all.
const ROUNDS: [usize; 2] = [5, 25];

pub fn advise(registry: &Registry, args: &AdviseArgs) -> Result<Ending> {
    let setting = setting(registry, args, None)?;
    let input = input(args, &setting);
    input.workload()?;
    let processes = args.study.spread.processes;
    let about = format!("{}, {}: ", args.study.scene, args.study.path);
    let study = Study::new(about, processes.into(), &args.study.spread)?;
    let items = text::counted(setting.scene.items.len(), "item");
    study.announce(&items, "less than a minute");
    let begin = |step: &str| study.begin(step);
    let mut parts: Vec<Part> = Vec::new();
    for process in 0..processes {
        let share = Share {
            process,
            known: vec![parts.first().and_then(|first| first.known.clone())],
            ..Share::first(1)
        };
        let scene = Job::Scene {
            scene: 0,
            share,
            samples: false,
        };
        let part = |said| match said {
            Message::Part(part, _) => Some(*part),
            _ => None,
        };
        parts.extend(study.workers.found(process, scene, &begin, part)?);
        study.advance();
    }
    let prepared = advise::prepare(&input, Group::of(&parts).cells, &begin)?;
    let step = "with and without every rule";
    let times = study.times(step, setting.path.lens_scale, &prepared.plan)?;
    let advice = prepared.conclude(&input, &times);
    note_solid(&setting.scene, args.format);
    let table = || show(&blocks(&advice, args.all_columns));
    print(args.format, &advice, table)?;
    Ok(Ending::of(!advice.found_wrong_answers()))
}

/// The plan of a run of the scene and path: a structure has the same times there.
pub fn plan(registry: &Registry, args: &AdviseArgs) -> Result<Plan> {
    let study = &args.study;
    let list = args.moves.list(&study.structure);
    let structures = study.kernel.structures(registry, list)?;
    let alone = Experiment::new(&study.scene).path(&study.path);
    if let [_, second, ..] = &args.moves.motion[..] {
        anyhow::bail!("--motion '{second}' is a second one; expected one motion");
    }
    let mut plan = Plan {
        lens: study.lens.defaults()?,
        load: study.lens.scene_args.options(structures.len()),
        effort: Effort {
            processes: study.spread.processes,
            ..SUITES[0].effort
        },
        bounds: true,
        seed: study.spread.seed,
        ..alone.structures(structures).plan
    };
    args.moves.enter(&mut plan)?;
    Ok(plan)
}

/// The inputs of the command, which tells what is left out, or of a worker.
fn setting(registry: &Registry, args: &AdviseArgs, timing: Option<&Timing>) -> Result<Setting> {
    let study = &args.study;
    let held = |structures| [structures as u64, 0];
    let mut setting = load(registry, study, ROUNDS, timing, held)?;
    setting.structures = plan(registry, args)?.structures;
    let all = text::counted(setting.path.cameras.len(), "camera");
    if setting.path.cameras.len() > MOST_CAMERAS && timing.is_none() {
        let used = text::count(MOST_CAMERAS);
        tell(&format!(
            "note: the rules look at {used} of {all}, evenly spread"
        ));
    }
    setting.path = setting.path.at_most(MOST_CAMERAS);
    setting.protocol.cameras = cameras_within(SUITES[0].effort.pass_ns, setting.scene.items.len());
    Ok(setting)
}

fn input<'s>(args: &'s AdviseArgs, setting: &'s Setting) -> AdviseInput<'s> {
    AdviseInput {
        setting,
        motion: args.moves.motion.first().map(String::as_str),
        views: args.moves.views,
        draw_ns: args.draw_ns,
    }
}

/// Times the trials in one process.
pub fn time(registry: &Registry, args: &AdviseArgs, timing: &Timing) -> Result<ProcessTimes> {
    let setting = setting(registry, args, Some(timing))?;
    advise::time(&input(args, &setting), &timing.plan()?)
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::super::args::{Cli, Command};
    use super::super::run_plan;
    use super::*;

    #[test]
    fn structures_are_timed_by_the_plan_of_a_run() {
        let registry = Registry::builtin();
        let plan = |command: &str| {
            let line = format!("x {command} --scene city:n=9 --path spin --processes 3 --seed 7");
            let line = line + " --motion drift --views 2 --update refit,every=10 --threads 1,2";
            match Cli::parse_from(line.split(' ')).command {
                Command::Run(args) => run_plan::plan(&registry, &args).unwrap().plan,
                Command::Advise(args) => super::plan(&registry, &args).unwrap(),
                _ => unreachable!("one of two commands"),
            }
        };
        let [run, advise] = ["run", "advise"].map(plan);
        assert_eq!(run.effort, advise.effort);
        assert_eq!((run.bounds, run.seed), (advise.bounds, advise.seed));
        assert_eq!(run.cells(), advise.cells());
        assert_eq!(run.views_per_frame, advise.views_per_frame);
        for row in ["wide@every=10", "linear:threads=2"] {
            assert!(
                advise.structures.iter().any(|spec| spec.label == row),
                "{row}"
            );
        }
    }
}
