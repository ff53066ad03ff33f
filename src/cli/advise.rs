//! `cullbench advise`: the structure, the culling test and the work to leave out
//! for a scene and path, with the evidence. The library measures and weighs it.

use std::io::{self, Write};

use super::args::AdviseArgs;
use super::processes::Said;
use super::processes::{Job, Timing};
use super::study::{Setting, Study};
use super::table::{Column, Table};
use super::text::some;
use super::{Ending, print, tell, text};
use crate::advise::{
    self, Advice, AdviseInput, AdviseOptions, Check, LeftOutIf, Omission, StructureChoice,
    StructureRow, TestChoice, TestRow, TrialPlan,
};
use crate::index::Registry;
use crate::measure::{Effort, Group, Part, Plan, ProcessTimes, Share, cameras_within};
use crate::report::Experiment;
use crate::statistics::Estimate;
use crate::suite::SUITES;

/// Most cameras of a path: every rule holds views of all, some 20 KB per camera.
const MOST_CAMERAS: usize = 4096;
/// Rounds of a task, if one process has them all.
const ROUNDS: [usize; 2] = [5, 25];
/// Effort of `run --scene`.
const EFFORT: Effort = SUITES[0].effort;

pub fn advise(registry: &Registry, args: &AdviseArgs) -> anyhow::Result<Ending> {
    let options = options(args);
    let (setting, all) = setting(registry, args, None)?;
    let input = input(&setting, &options);
    if setting.path.cameras.len() < all {
        tell(&format!(
            "note: the rules look at {} of {}, evenly spread",
            text::count(setting.path.cameras.len()),
            text::counted(all, "camera")
        ));
    }
    input.check()?;
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
        let found = study.workers.found(process, scene, &begin)?;
        parts.extend(found.into_iter().filter_map(|said| match said {
            Said::Part(part, _) => Some(*part),
            _ => None,
        }));
        study.advance();
    }
    let choice = StructureChoice::of(&Group::of(&parts));
    let prepared = advise::prepare(&input, choice, &begin)?;
    let trials = |timing| Job::Trials(prepared.plan.clone(), timing);
    let step = "with and without every rule";
    let times = study.times(step, setting.path.lens_scale, trials)?;
    let advice = prepared.conclude(&times);
    print(args.format, &advice, || show(&advice, args.all_columns))?;
    Ok(Ending::of(!advice.found_wrong_answers()))
}

/// The plan of a run of the scene and path: a structure has the same times there.
pub fn plan(registry: &Registry, args: &AdviseArgs) -> anyhow::Result<Plan> {
    let study = &args.study;
    let structures = study.kernel.structures(registry, &study.structure)?;
    let alone = Experiment::new(&study.scene).path(&study.path);
    Ok(Plan {
        lens: study.lens.defaults()?,
        load: study.scene_args.options(structures.len()),
        effort: Effort {
            processes: study.spread.processes,
            ..EFFORT
        },
        bounds: true,
        seed: study.spread.seed,
        ..alone.structures(structures).plan
    })
}

/// The inputs of the command itself or of a worker, and the cameras of the whole
/// path.
fn setting(
    registry: &Registry,
    args: &AdviseArgs,
    timing: Option<&Timing>,
) -> anyhow::Result<(Setting, usize)> {
    let study = &args.study;
    let held = |structures| study.scene_args.options(structures);
    let mut setting = Setting::load(registry, study, &study.path, ROUNDS, timing, held)?;
    let all = setting.path.cameras.len();
    setting.path = setting.path.at_most(MOST_CAMERAS);
    setting.protocol.cameras = cameras_within(EFFORT.pass_ns, setting.scene.items.len());
    Ok((setting, all))
}

fn input<'s>(setting: &'s Setting, options: &'s AdviseOptions) -> AdviseInput<'s> {
    AdviseInput {
        scene: &setting.scene,
        path: &setting.path,
        structures: &setting.structures,
        options,
        protocol: &setting.protocol,
    }
}

/// Times the trials in one process.
pub fn time(
    registry: &Registry,
    args: &AdviseArgs,
    trials: &TrialPlan,
    timing: &Timing,
) -> anyhow::Result<ProcessTimes> {
    let (setting, _) = setting(registry, args, Some(timing))?;
    Ok(advise::time(&input(&setting, &options(args)), trials)?)
}

fn options(args: &AdviseArgs) -> AdviseOptions {
    AdviseOptions {
        draw_ns: args.draw_ns,
        shade_ns: args.shade_ns,
        tolerance: args.tolerance,
        moved: args.moved,
        queries_per_update: args.queries_per_update,
    }
}

/// The advice, and before it the evidence where it is wanted.
fn show(advice: &Advice, all_columns: bool) -> io::Result<()> {
    let mut out = text::terminal();
    let width = text::width();
    let mut say = |line: &str| writeln!(out, "{}", text::wrapped(line, width));
    say(&format!(
        "{}: {}; {}: {}\n{}\n",
        text::plain(&advice.scene),
        text::counted(advice.items, "item"),
        text::plain(&advice.path),
        text::counted(advice.cameras, "camera"),
        text::over(advice.processes, advice.twin.as_ref())
    ))?;
    for line in evidence(advice, width).iter().filter(|_| all_columns) {
        say(line)?;
    }
    for row in &advice.structure.rows {
        if let Some(reason) = &row.reason {
            say(&format!("{}: {}: {reason}", row.structure, row.status))?;
        }
    }
    say(&(taken(advice) + "\n"))?;
    let rules = rule_table(advice).within(width, &["gain", "cost", ""]);
    say(rules.bare().trim_end())?;
    let named = |rule: &Omission| Some(format!("{} ({})", rule.feature, not_for(advice, rule)?));
    let listed = |is_in: &dyn Fn(&Omission) -> Option<String>| {
        let names: Vec<String> = advice.omissions.iter().filter_map(is_in).collect();
        names.join(", ")
    };
    let wrong = |rule: &Omission| rule.checks.iter().any(Check::is_wrong);
    let contradicted =
        |rule: &Omission| rule.confirmed == Some(false) && not_for(advice, rule).is_none();
    let name = |is_so: bool, rule: &Omission| is_so.then(|| rule.feature.to_owned());
    let pays_from = |rule: &Omission| name(rule.note.contains("pays from"), rule);
    for (what, names) in [
        ("Does not apply: ", listed(&named)),
        (
            "Pays from: over views of the whole path; funnel times 8 of them, or --frames: ",
            listed(&pays_from),
        ),
        (
            "WRONG: answers with and without differ: ",
            listed(&|rule| name(wrong(rule), rule)),
        ),
        (
            "\nPredicted otherwise, decided as measured: ",
            listed(&|rule| name(contradicted(rule), rule)),
        ),
    ] {
        if !names.is_empty() {
            say(&(what.to_owned() + &names))?;
        }
    }
    if !all_columns {
        say("\nevidence: --all-columns")?;
    }
    out.flush()
}

/// Structure and test to take, in a sentence.
fn taken(advice: &Advice) -> String {
    let choice = &advice.structure;
    let Some(name) = &choice.name else {
        return "No structure answered right".to_owned();
    };
    let row = choice.rows.iter().find(|row| row.structure == *name);
    let next = choice.rows.iter().find(|row| {
        row.query_ns.is_some() && row.structure != *name && !choice.ties.contains(&row.structure)
    });
    let faster = next.and_then(|next| {
        let times = text::significant(next.ns()? / row?.ns()?);
        Some(format!("{times} x {}, the next", next.structure))
    });
    let linear = row.and_then(|row| row.speedup).filter(|_| !choice.is_scan);
    let linear = linear.map(|times| format!("{} x linear", text::significant(times)));
    let figures: Vec<String> = linear.into_iter().chain(faster).collect();
    let figures = match figures.is_empty() {
        true => String::new(),
        false => format!(" ({})", figures.join(", ")),
    };
    let test = some(advice.test.name, |test| {
        format!(", test {test}{}", ties(&advice.test.ties))
    });
    let repaid = some(row.and_then(|row| row.break_even_queries), |n| {
        format!(
            " Its build is repaid after {}.",
            text::counted(n as usize, "query")
        )
    });
    let search = some(choice.region_search.as_ref(), |name| {
        format!(
            " For region search: {name}{}.",
            ties(&choice.region_search_ties)
        )
    });
    format!(
        "Take structure {name}{figures}{}{test}.{repaid}{search}",
        ties(&choice.ties)
    )
}

/// Reason for which a feature is neither needed nor not needed.
fn not_for(advice: &Advice, omission: &Omission) -> Option<String> {
    let of_nodes = ["plane-masks", "third-dimension", "rebuild"].contains(&omission.rule);
    match omission.is_needed() {
        None => Some(omission.reason.clone()),
        Some(_) if of_nodes && advice.structure.is_scan => advice
            .structure
            .name
            .as_ref()
            .map(|name| format!("{name} has no nodes")),
        Some(_) => None,
    }
}

/// Features that are needed and those that are not, with the cost of both.
fn rule_table(advice: &Advice) -> Table {
    let mut rows: Vec<Vec<String>> = Vec::new();
    for (needed, title) in [(true, "Needed"), (false, "Not needed")] {
        let rules = advice
            .omissions
            .iter()
            .filter(|rule| rule.is_needed() == Some(needed) && not_for(advice, rule).is_none());
        let of_rules = rules.map(|rule| {
            let mut sides = rule.cost_ns.unwrap_or([f64::NAN; 2]);
            if rule.is_saving {
                sides.reverse();
            }
            let [with, without] = sides;
            let ratio = if needed {
                without / with
            } else {
                with / without
            };
            let shown = |ns: f64| some(Some(ns).filter(|ns| ns.is_finite()), text::time);
            let ratio = match rule.is_tie && advice.processes >= 3 {
                true => "tie".to_owned(),
                false => some(Some(ratio).filter(|x| x.is_finite()), |x| {
                    format!("{} x", text::significant(x))
                }),
            };
            vec![
                format!("  {}", rule.feature),
                shown(with),
                shown(without),
                ratio,
                rule.note.clone(),
            ]
        });
        let of_rules: Vec<_> = of_rules.collect();
        if !of_rules.is_empty() {
            let ratio = if needed { "gain" } else { "cost" };
            rows.push(
                [title, "with", "without", ratio, ""]
                    .map(str::to_owned)
                    .into(),
            );
            rows.extend(of_rules);
        }
    }
    let mut table = Table::of("Rule | >with | >without | >x | ");
    if !rows.is_empty() {
        table.header = rows.remove(0);
    }
    table.rows = rows;
    table
}

/// Every structure, test and feature with its times.
fn evidence(advice: &Advice, width: usize) -> Vec<String> {
    let reasons = advice.omissions.iter().map(|feature| {
        let contradicted = match feature.confirmed {
            Some(false) => " (predicted otherwise)",
            _ => "",
        };
        let reason = format!("{}{contradicted}", feature.reason);
        [feature.feature.to_owned(), reason]
    });
    vec![
        "Structures, all answers checked:".to_owned(),
        structure_table(&advice.structure).fitted(width),
        format!(
            "Culling tests on {}, with {} ns to draw an item that cannot be seen:",
            advice.test.structure, advice.options.draw_ns
        ),
        test_table(&advice.test).fitted(width),
        "Features, measured with and without:".to_owned(),
        feature_table(&advice.omissions).fitted(width),
        "The statistic decides; where both sides answer the same, the clock does if a paired test \
         over the processes tells them apart."
            .to_owned(),
        text::entries(&reasons.collect::<Vec<_>>(), width),
    ]
}

fn ties(names: &[impl AsRef<str>]) -> String {
    let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
    match names.is_empty() {
        true => String::new(),
        false => format!(" (a tie with {})", names.join(", ")),
    }
}

fn structure_table(choice: &StructureChoice) -> Table {
    let columns: &[Column<&StructureRow>] = &[
        ("structure", |row| row.structure.clone()),
        (">query [95 % interval]", |row| {
            some(row.query_ns, text::time_within)
        }),
        (">speed-up", |row| some(row.speedup, text::significant)),
        (">build", |row| {
            some(row.build_ms, |ms| text::time(ms * 1e6))
        }),
        (">B/item", |row| {
            some(row.memory_bytes_per_item, |bytes| format!("{bytes:.1}"))
        }),
        (">break-even queries", |row| {
            some(row.break_even_queries, |n| text::count(n as usize))
        }),
        (">locate", |row| some(row.locate_ns, text::time)),
        ("status", |row| row.status.to_owned()),
    ];
    Table::with(&choice.rows, columns)
}

fn test_table(choice: &TestChoice) -> Table {
    let columns: &[Column<(bool, &TestRow)>] = &[
        ("", |(is_chosen, _)| {
            if *is_chosen { "*" } else { "" }.to_owned()
        }),
        ("test", |(_, row)| row.test.to_owned()),
        (">query [95 % interval]", |(_, row)| {
            some(row.query_ns, text::time_within)
        }),
        (">false positives %", |(_, row)| {
            text::rate(row.excess, 100.0)
        }),
        (">missed ppm", |(_, row)| {
            text::rate(row.false_negative_ppm, 1.0)
        }),
        (">false positives per query", |(_, row)| {
            some(row.false_positives_per_query, text::significant)
        }),
        (">query and drawing", |(_, row)| {
            some(row.total_ns, text::time)
        }),
    ];
    let rows = choice.rows.iter();
    Table::with(
        rows.map(|row| (choice.name == Some(row.test), row)),
        columns,
    )
}

/// Every feature with what decides on it, in the words of [`rule_table`].
fn feature_table(features: &[Omission]) -> Table {
    let mut table = Table::of(
        "feature | needed | >statistic | >needed if | measured on | >with | >without \
         | >with / without | >false positives % with / without | answers",
    );
    for feature in features {
        let side = match (feature.left_out_if, feature.is_saving) {
            (LeftOutIf::AtMost, false) => ">",
            (LeftOutIf::AtLeast, false) => "<",
            (LeftOutIf::AtMost, true) => "<=",
            (LeftOutIf::AtLeast, true) => ">=",
        };
        let needed = match feature.is_needed() {
            Some(true) => "yes",
            Some(false) => "no",
            None => "does not apply",
        };
        let mut own = vec![
            feature.feature.to_owned(),
            needed.to_owned(),
            some(feature.statistic, general),
            some(feature.threshold, |t| format!("{side} {}", general(t))),
        ];
        if feature.checks.is_empty() {
            table.add_row(own.clone());
        }
        for check in &feature.checks {
            table.add_row(own.drain(..).chain(check_cells(check, feature.is_saving)));
            own = vec![String::new(); 4];
        }
    }
    table
}

/// Both sides of a check.
///
/// The side that leaves out has the feature if that `is_saving`.
fn check_cells(check: &Check, is_saving: bool) -> [String; 6] {
    let mut ns = [check.kept_ns, check.left_out_ns];
    let mut excess = [check.kept_excess, check.left_out_excess];
    let mut ratio = check.ratio;
    if is_saving {
        ns.reverse();
        excess.reverse();
        ratio = ratio.map(|ratio| Estimate {
            value: ratio.value.recip(),
            lower: ratio.upper.map(f64::recip),
            upper: ratio.lower.map(f64::recip),
        });
    }
    let shown = excess.map(|share| share.map(|share| format!("{:.3}", share * 100.0)));
    let missed = [
        check.kept_false_negative_ppm,
        check.left_out_false_negative_ppm,
    ];
    let missed = missed.into_iter().flatten().any(|ppm| ppm > 0.0);
    let [with, without] = ns.map(text::time);
    let [with_extra, without_extra] = shown;
    [
        check.on.clone(),
        with,
        without,
        ratio.map_or("NaN".to_owned(), text::within),
        some(with_extra.zip(without_extra), |(with, without)| {
            format!("{with} / {without}")
        }),
        match (check.same_answers, check.is_wrong(), missed) {
            (_, true, _) => "WRONG: not the same",
            (_, _, true) => "some missed",
            (true, ..) => "the same",
            (false, ..) => "other extras",
        }
        .to_owned(),
    ]
}

/// Three digits, with an exponent where it is needed.
fn general(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        x if (1e-2..1e7).contains(&x) => text::significant(value),
        _ => format!("{value:.2e}"),
    }
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
    }
}
