//! `cullbench advise`: which structure, test and features suit a scene and path.
//!
//! With the evidence. The library measures and evaluates it.

use anyhow::{Context, Result};

use super::args::AdviseArgs;
use super::document::{Block, Column, Table, show};
use super::processes::{Job, Message, Timing};
use super::run_table::{heads, structures};
use super::run_verdict::{BLIND, sharing, times};
use super::study::{Study, load, note_solid};
use super::text::{self, significant, some, time_within};
use super::{Ending, print};
use crate::advise::{
    self, Advice, AdviseInput, Axis, Omission, PairResult, TaskResult, TestRow, ns, policy_of,
};
use crate::index::Registry;
use crate::measure::{
    Effort, Group, Machine, Part, Plan, ProcessTimes, ReportCell, Setting, Share, YARDSTICK,
    cameras_within,
};
use crate::report::{Comparison, Experiment};
use crate::suite::SUITES;

/// Most cameras of a path: every rule has views of all, about 20 KB per camera.
const MOST_CAMERAS: usize = 4096;
/// Rounds of a task if a single process does them all.
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
        let scene = Job::scene(0, share, false);
        let found = (study.workers).found(process, scene, &begin, Message::part);
        parts.extend(found.with_context(|| format!("process {}", process + 1))?);
        study.bar.inc(1);
    }
    let prepared = advise::prepare(&input, Group::of(&parts).cells, &begin)?;
    let step = "with and without every rule";
    let times = study.times(step, setting.path.lens_scale, &prepared.plan)?;
    let advice = prepared.conclude(&input, &times);
    note_solid(&setting.scene, args.format);
    let machine = Machine::capture();
    let table = || show(&blocks(&advice, args, &machine));
    print(args.format, &advice, table)?;
    Ok(Ending::of(!advice.found_wrong_answers()))
}

/// The plan of a run in which a structure has the same times as here.
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

/// The inputs of a worker, or of the command, which reports omissions.
fn setting(registry: &Registry, args: &AdviseArgs, timing: Option<&Timing>) -> Result<Setting> {
    let study = &args.study;
    let mut setting = load(registry, study, ROUNDS, timing, [1, 0, 0])?;
    setting.structures = plan(registry, args)?.structures;
    let all = text::counted(setting.path.cameras.len(), "camera");
    if setting.path.cameras.len() > MOST_CAMERAS && timing.is_none() {
        let used = text::count(MOST_CAMERAS);
        tell!("note: the rules look at {used} of {all}, evenly spread");
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

/// The advice, with the evidence if requested.
fn blocks(advice: &Advice, args: &AdviseArgs, machine: &Machine) -> Vec<Block> {
    let all_columns = args.all_columns;
    let rows = &advice.structure.rows;
    let here = compared(rows);
    let lines = heads(&here).into_iter();
    let lines = lines.chain([text::over(advice.processes, advice.twin.as_ref())]);
    let mut blocks: Vec<Block> = lines.map(Block::Line).collect();
    if all_columns {
        blocks.extend(evidence(advice));
    }
    blocks.push(Block::line(""));
    if here.is_blind() {
        blocks.push(Block::line(BLIND));
        return blocks;
    }
    let failed = rows.iter().filter_map(|row| {
        let (status, why) = (row.status.name(), row.reason.as_ref()?);
        Some(format!("{}: {status}: {why}", row.structure))
    });
    let more = in_motion(advice).into_iter();
    let more = more.flat_map(|paragraph| [String::new(), paragraph]);
    let told = failed.chain([taken(advice)]).chain(more);
    blocks.extend(told.map(Block::Line));
    let threads = args.study.kernel.threads.iter().max();
    let shared = threads.and_then(|threads| sharing(rows, *threads, machine));
    blocks.extend(shared.into_iter().flatten());
    blocks.extend(changes(advice).into_iter().map(Block::Line));
    blocks.push(Block::Table(rule_table(&advice.omissions, all_columns)));
    blocks.extend(Block::more(all_columns, "evidence: --all-columns"));
    blocks
}

/// Cells of one scene and path, fastest first.
fn compared(rows: &[ReportCell]) -> Comparison<'_> {
    let (cells, bounds) = (rows.iter().collect(), Vec::new());
    Comparison { cells, bounds }
}

/// The recommended structure and test, in a sentence.
fn taken(advice: &Advice) -> String {
    let choice = &advice.structure;
    let Some(name) = &choice.name else {
        return "No structure answered right".to_owned();
    };
    let mut others = choice.rows.iter().filter(|row| row.rank.is_some());
    let next = others.find(|row| row.structure != *name && !choice.ties.contains(&row.structure));
    let lead = next.zip(choice.taken()).and_then(|(next, own)| {
        let lead = Some(ns(next)? / ns(own)?).filter(|lead| *lead >= 1.0)?;
        let lead = format!("{} {}", times(lead), next.structure);
        Some(match tie(&choice.ties) {
            tie if tie.is_empty() => format!(" ({lead}, the next)"),
            tie => format!(" ({tie}; {lead})"),
        })
    });
    let test = some(advice.test.name, |test| {
        format!(", test {test}{}", ties(&advice.test.ties))
    });
    let lead = lead.unwrap_or_else(|| ties(&choice.ties));
    format!("Take structure {name}{lead}{test}.")
}

/// The recommended update policy, with the times of a frame.
fn in_motion(advice: &Advice) -> Option<String> {
    let motion = advice.motion.as_ref()?;
    let policy = motion.policy.as_ref()?;
    let (row, others) = motion.policies.split_first()?;
    let frame = ns(row)?;
    let longer = others.iter().filter_map(|row| {
        let (policy, longer) = (policy_of(&row.structure), times(ns(row)? / frame));
        Some(format!("{policy} takes {longer} as long"))
    });
    let ruled_out = motion.ruled_out.iter();
    let ruled_out = ruled_out
        .map(|(policy, frames)| format!("{policy} {} by its builds alone", times(*frames)));
    let others: Vec<String> = longer.chain(ruled_out).collect();
    let others = some(others.first(), |_| format!(" ({})", others.join("; ")));
    Some(format!(
        "In motion: {policy}{}{others}. A frame takes {}, of which the update {}. The rules below, \
         except those of the index and of rebuilds, are weighed on the still scene.",
        ties(&motion.policy_ties),
        text::time(frame),
        some(row.value("update_ns"), text::time),
    ))
}

/// Crossovers to other structures, a line per axis.
fn changes(advice: &Advice) -> Vec<String> {
    let all = &advice.changes;
    let turns = (all.iter()).any(|own| own.below.is_some() || own.above.is_some());
    let head = match all.iter().all(|own| own.not_varied.is_some()) {
        _ if turns => "Another structure is faster",
        false => "No other structure is shown to be faster",
        true => "Another structure may be faster",
    };
    let told = all.iter().map(|change| {
        let (what, show): (_, fn(f64) -> String) = match change.axis {
            Axis::Items => ("number of items", |items| {
                text::count(items.round() as usize)
            }),
            Axis::ShareInView => ("share in view", text::short_percent),
            Axis::ShareMoved => ("share moved", text::short_percent),
        };
        if let Some(why) = &change.not_varied {
            return format!("  {what}: not varied: {why}");
        }
        let sides = [("below", &change.below), ("above", &change.above)];
        let found = sides.into_iter().filter_map(|(side, turn)| {
            let turn = turn.as_ref()?;
            let [at, lower, upper] = [turn.at, turn.lower, turn.upper].map(show);
            let structure = &turn.structure;
            let other = if side == "below" { &lower } else { &upper };
            // No crossover if the workload itself is a tie.
            Some(match turn.at == change.here {
                true => format!("at {other} {structure}, at {at} a tie"),
                false => format!("{side} {at} ({lower} to {upper}) {structure}"),
            })
        });
        let [low, high] = change.measured.map(show);
        let found = match text::joined(found) {
            none if none.is_empty() && turns => "none; ".to_owned(),
            none if none.is_empty() => none,
            found => found + "; ",
        };
        format!("  {what}: {found}measured from {low} to {high}")
    });
    let head = ["", head].map(str::to_owned);
    let head = all.first().map(|_| head);
    head.into_iter().flatten().chain(told).collect()
}

/// Every structure, policy and test with its times.
fn evidence(advice: &Advice) -> Vec<Block> {
    let table = |rows| structures(&compared(rows), Some(YARDSTICK), true);
    let rows = &advice.structure.rows;
    let structures = Block::section("Structures, all answers checked:", table(rows));
    let mut blocks = Vec::from(structures);
    let motion = advice.motion.as_ref().map(|motion| &motion.policies);
    if let Some(policies) = motion.filter(|policies| !policies.is_empty()) {
        blocks.extend(Block::section(
            "Update policies, side by side:",
            table(policies),
        ));
    }
    let ns = advice.draw_ns;
    let tests = format!("Culling tests, with {ns} ns to draw an item that cannot be seen:");
    let columns: &[Column<&TestRow>] = &[
        ("structure", |r| r.structure.clone()),
        ("test", |r| r.test.to_owned()),
        (">query", |r| some(r.query_ns, time_within)),
        (">false positives %", |r| text::rate(r.excess, 100.0)),
        (">missed ppm", |r| text::rate(r.false_negative_ppm, 1.0)),
        (">false positives per query", |r| {
            some(r.false_positives_per_query, significant)
        }),
        (">query and drawing", |r| some(r.total_ns, text::time)),
    ];
    let tests_measured = Table::with(&advice.test.rows, columns);
    blocks.extend(Block::section(tests, tests_measured));
    blocks
}

/// " (a tie with wide, bvh)".
pub fn ties(names: &[impl AsRef<str>]) -> String {
    some(names.first(), |_| format!(" ({})", tie(names)))
}

fn tie(names: &[impl AsRef<str>]) -> String {
    some(names.first(), |_| {
        format!("a tie with {}", text::joined(names))
    })
}

/// Columns of features; from the seventh on they are evidence.
fn features<'o>() -> [Column<&'o Omission>; 13] {
    [
        ("feature", |rule| rule.rule.left_out.to_owned()),
        ("use", |rule| rule.answer().to_owned()),
        (">with", |rule| some(rule.cost_ns, |[with, _]| cost(with))),
        (">without", |rule| {
            some(rule.cost_ns, |[_, without]| cost(without))
        }),
        (">ratio", |rule| match rule.cost_ns {
            Some(_) if rule.is_tie => "tie".to_owned(),
            Some([with, without]) if (with / without).is_finite() => times(with / without),
            _ => String::new(),
        }),
        ("", |rule| rule.reason.clone()),
        (">statistic", |rule| some(rule.statistic, significant)),
        (">used above", |rule| some(rule.threshold, significant)),
        ("measured on", |rule| {
            some(rule.check.as_ref(), |check| check.on.clone())
        }),
        (">with / without", |rule| {
            let ratio = rule.check.as_ref().and_then(|check| check.ratio);
            some(ratio, text::within)
        }),
        (">false pos. %, both", |rule| {
            let both = rule.check.as_ref();
            let both = both.and_then(|check| check.kept.excess.zip(check.left_out.excess));
            some(both, |(with, without)| {
                format!("{:.3} / {:.3}", with * 100.0, without * 100.0)
            })
        }),
        ("answers", |rule| {
            let misses = |side: &TaskResult| side.false_negative_ppm > Some(0.0);
            let answers = |check: &PairResult| match check.same_answers {
                _ if rule.is_wrong() => "WRONG: not the same",
                _ if misses(&check.kept) || misses(&check.left_out) => "some missed",
                true => "the same",
                false => "other extras",
            };
            some(rule.check.as_ref(), |check| answers(check).to_owned())
        }),
        ("what it counts", |rule| rule.rule.statistic_name.to_owned()),
    ]
}

/// A time; empty if there is none.
fn cost(ns: f64) -> String {
    some(Some(ns).filter(|ns| ns.is_finite()), text::time)
}

/// Features to use, ties, features to skip, and those that do not apply.
fn rule_table(rules: &[Omission], all_columns: bool) -> Table {
    let mut rules = rules.to_vec();
    let order = ["yes", "either", "no", ""];
    rules.sort_by_key(|rule| order.iter().position(|answer| *answer == rule.answer()));
    // A reason shared by several stages is given once.
    for row in (1..rules.len()).rev() {
        if rules[row].answer().is_empty() && rules[row].reason == rules[row - 1].reason {
            "as above".clone_into(&mut rules[row].reason);
        }
    }
    let features = features();
    let shown = if all_columns { features.len() } else { 6 };
    Table::with(&rules, &features[..shown])
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
