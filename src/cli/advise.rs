//! `cullbench advise`: the structure, the culling test and the work to leave out
//! for a scene and path, with the evidence. The library measures and weighs it.

use std::io::{self, Write};

use super::args::AdviseArgs;
use super::interrupt::Interrupted;
use super::processes::Said;
use super::protocol::{Job, Timing};
use super::study::{Setting, Study};
use super::table::{Column, Table};
use super::text::some;
use super::{Ending, interrupt, print, tell, text};
use crate::advise::{
    self, Advice, AdviseInput, AdviseOptions, Check, LeftOutIf, Omission, StructureChoice,
    StructureRow, TestChoice, TestRow, TrialPlan,
};
use crate::culling::Culling;
use crate::index::Registry;
use crate::measure::{Group, Part, Plan, PlannedScene, ProcessTimes, Share, cameras_within};
use crate::statistics::Estimate;

/// Most cameras of a path: every rule holds views of all, some 20 KB per camera.
const MOST_CAMERAS: usize = 4096;
/// Rounds of a task, if one process has them all.
const ROUNDS: [usize; 2] = [5, 25];

pub fn advise(registry: &Registry, args: &AdviseArgs) -> anyhow::Result<Ending> {
    let options = options(args);
    let (setting, all) = setting(registry, args, None)?;
    let input = input(&setting, &options);
    if setting.path.cameras.len() < all {
        tell(&format!(
            "note: {} of {}, evenly spread, are looked at",
            text::count(setting.path.cameras.len()),
            text::counted(all, "camera")
        ));
    }
    input.check()?;
    interrupt::from_now_on_finish();
    let processes = args.study.spread.processes;
    let about = format!("{}, {}: ", args.study.scene, args.study.path);
    let study = Study::new(about, processes.into(), &args.study.spread)?;
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
    let prepared = advise::prepare(&input, choice, &interrupt::asked, &begin)?;
    let prepared = prepared.ok_or(Interrupted)?;
    let trials = |timing| Job::Trials(prepared.plan.clone(), timing);
    let step = "with and without every rule";
    let times = study.times(step, setting.path.lens_scale, trials)?;
    let advice = prepared.conclude(&times);
    print(args.format, &advice, || show(&advice))?;
    Ok(Ending::of(!advice.found_wrong_answers()))
}

/// How structures are measured before rules are: as a run does it.
pub fn plan(registry: &Registry, args: &AdviseArgs) -> anyhow::Result<Plan> {
    let study = &args.study;
    Ok(Plan {
        scenes: vec![PlannedScene {
            source: study.scene.clone(),
            paths: vec![study.path.clone()],
            caches: vec![false],
        }],
        structures: study.kernel.structures(registry, &study.structure)?,
        cullings: vec![Culling::default()],
        lens: study.lens.defaults()?,
        load: study.scene_args.options(0),
        most_cameras: MOST_CAMERAS,
        effort: study.spread.effort(ROUNDS),
        bounds: false,
        seed: study.spread.seed,
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
    let pass_ns = study.spread.effort(ROUNDS).pass_ns;
    setting.protocol.cameras = cameras_within(pass_ns, setting.scene.items.len());
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
    stop: &dyn Fn() -> bool,
) -> anyhow::Result<Option<ProcessTimes>> {
    let (setting, _) = setting(registry, args, Some(timing))?;
    Ok(advise::time(
        &input(&setting, &options(args)),
        trials,
        stop,
    )?)
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

fn show(advice: &Advice) -> io::Result<()> {
    let mut out = text::terminal();
    writeln!(
        out,
        "{}: {}; {}: {}; {}",
        text::plain(&advice.scene),
        text::counted(advice.items, "item"),
        text::plain(&advice.path),
        text::counted(advice.cameras, "camera"),
        text::over(advice.processes, advice.twin.as_ref())
    )?;
    writeln!(out, "\nStructures, all answers checked:")?;
    writeln!(out, "{}", structure_table(&advice.structure))?;
    for row in &advice.structure.rows {
        if let Some(reason) = &row.reason {
            writeln!(out, "{}: {}: {reason}", row.structure, row.status)?;
        }
    }
    writeln!(
        out,
        "\nCulling tests on {}, with {} ns to draw an item that cannot be seen:",
        advice.test.structure, advice.options.draw_ns
    )?;
    writeln!(out, "{}", test_table(&advice.test))?;
    writeln!(out, "\nWhat can be left out, measured with and without:")?;
    writeln!(out, "{}", omission_table(&advice.omissions))?;
    writeln!(
        out,
        "A rule leaves out on its side of the threshold; where both sides answer the same, the clock\n\
         decides if a paired test over the processes tells them apart. Kept / left out above 1:\n\
         leaving out is faster."
    )?;
    for omission in &advice.omissions {
        let contradicted = match omission.confirmed {
            Some(false) => " (the rule and what was measured disagree)",
            _ => "",
        };
        writeln!(
            out,
            "  {}: {}{contradicted}",
            omission.rule, omission.reason
        )?;
    }
    show_advice(&mut out, advice)?;
    out.flush()
}

/// The advice in a few lines.
fn show_advice(out: &mut impl Write, advice: &Advice) -> io::Result<()> {
    writeln!(out, "\nAdvice:")?;
    let choice = &advice.structure;
    let Some(name) = &choice.name else {
        return writeln!(out, "  no structure answered right");
    };
    let row = choice.rows.first();
    let times = some(row.and_then(|row| row.speedup), |times| {
        format!(", {} x linear", text::significant(times))
    });
    let repaid = some(row.and_then(|row| row.break_even_queries), |n| {
        let queries = text::counted(n as usize, "query");
        format!("; its build is repaid after {queries}")
    });
    writeln!(
        out,
        "  structure: {name}{times}{}{repaid}",
        ties(&choice.ties)
    )?;
    if let Some(name) = &choice.region_search {
        writeln!(
            out,
            "  region search: {name}{}",
            ties(&choice.region_search_ties)
        )?;
    }
    if let Some(test) = advice.test.name {
        writeln!(out, "  test: {test}{}", ties(&advice.test.ties))?;
    }
    for omission in &advice.omissions {
        if let Some(told) = omission.advice() {
            writeln!(out, "  {}: {told}", omission.rule)?;
        }
    }
    Ok(())
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
            text::time_within(row.query_ns, [row.query_ns_lower, row.query_ns_upper])
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
            text::time_within(row.query_ns, [row.query_ns_lower, row.query_ns_upper])
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

fn omission_table(omissions: &[Omission]) -> Table {
    let mut table = Table::of(
        "rule | decision | >statistic | >threshold | >saving | measured on | >kept | >left out \
         | >kept / left out | >false positives % kept / left out | answers",
    );
    for omission in omissions {
        let side = match omission.left_out_if {
            LeftOutIf::AtMost => "<=",
            LeftOutIf::AtLeast => ">=",
        };
        let mut cells = vec![
            omission.rule.to_owned(),
            omission.decision.name().to_owned(),
            some(omission.statistic, general),
            some(omission.threshold, |t| format!("{side} {}", general(t))),
            some(omission.saving, text::percent),
        ];
        let mut checks = omission.checks.iter();
        cells.extend(checks.next().map(check_cells).into_iter().flatten());
        table.add_row(cells);
        for check in checks {
            let cells = vec![String::new(); 5].into_iter();
            table.add_row(cells.chain(check_cells(check)));
        }
    }
    table
}

fn check_cells(check: &Check) -> [String; 6] {
    let excess = |share: Option<f64>| share.map(|s| format!("{:.3}", s * 100.0));
    let both = excess(check.kept_excess).zip(excess(check.left_out_excess));
    let missed = [
        check.kept_false_negative_ppm,
        check.left_out_false_negative_ppm,
    ];
    let missed = missed.into_iter().flatten().any(|ppm| ppm > 0.0);
    [
        check.on.clone(),
        text::time(check.kept_ns),
        text::time(check.left_out_ns),
        text::within(&Estimate::within(
            check.ratio,
            [check.ratio_lower, check.ratio_upper],
        )),
        some(both, |(kept, left_out)| format!("{kept} / {left_out}")),
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
