//! `cullbench advise`: which structure, which culling test and what to leave out
//! for a scene and path, shown with the evidence. What is measured and how it is
//! weighed is the library's.

use std::io::{self, Write};
use std::time::Duration;

use anyhow::bail;
use indicatif::ProgressBar;

use super::args::{AdviseArgs, TableFormat};
use super::{Ending, interrupt, load_scene, text, unread_is_fine};
use crate::advise::{
    Advice, AdviseOptions, Check, Decision, LeftOutIf, Omission, StructureChoice, TestChoice,
    advise as advice_for,
};
use crate::index::Registry;
use crate::measure::{Machine, Protocol, cameras_within};
use crate::path;

pub fn advise(registry: &Registry, args: &AdviseArgs) -> anyhow::Result<Ending> {
    let options = options(args)?;
    let structures = args.kernel.structures(registry, &args.structure)?;
    let defaults = args.lens.defaults()?;
    let scene = load_scene(&args.scene, &args.scene_args, structures.len())?;
    let path = path::load(&args.path, &scene, &defaults)?;
    interrupt::from_now_on_finish();
    let bar = ProgressBar::new_spinner();
    bar.enable_steady_tick(Duration::from_millis(200));
    let protocol = Protocol {
        rounds: [5, 25],
        task_ns: 150e6,
        cameras: cameras_within(100e6, scene.items.len()),
        cold: false,
        seed: args.seed,
        cache_bytes: Machine::capture().cache_sweep_bytes(),
    };
    let advice = advice_for(
        &scene,
        &path,
        &structures,
        &options,
        &protocol,
        &interrupt::asked,
        &|next| {
            let job = format!("{}, {}: {next}", args.scene, args.path);
            bar.set_message(text::plain(&job));
        },
    )?;
    bar.finish_and_clear();
    let Some(advice) = advice else {
        return Ok(Ending::Interrupted);
    };
    unread_is_fine(match args.format {
        TableFormat::Json => show_json(&advice),
        TableFormat::Table => show(&advice),
    })?;
    Ok(match advice.found_wrong_answers() {
        true => Ending::WrongAnswer,
        false => Ending::Ok,
    })
}

/// The options, each in its range.
fn options(args: &AdviseArgs) -> anyhow::Result<AdviseOptions> {
    for (name, value, least) in [
        ("--draw-ns", args.draw_ns, 0.0),
        ("--tolerance", args.tolerance, f64::MIN_POSITIVE),
        ("--queries-per-update", args.queries_per_update, 0.0),
    ] {
        if !(value.is_finite() && value >= least) {
            let wanted = if least > 0.0 { "above" } else { "of at least" };
            bail!("{name} is {value}; expected a number {wanted} 0");
        }
    }
    let percent = args.moved.strip_suffix('%');
    let number = percent.unwrap_or(&args.moved).trim().parse::<f64>();
    let share = number.map(|n| if percent.is_some() { n / 100.0 } else { n });
    match share {
        Ok(moved) if moved > 0.0 && moved <= 1.0 => Ok(AdviseOptions {
            draw_ns: args.draw_ns,
            tolerance: args.tolerance,
            moved,
            queries_per_update: args.queries_per_update,
        }),
        _ => bail!(
            "--moved is '{}'; expected a share such as 1% or 0.01, above 0 and at most 100%",
            args.moved
        ),
    }
}

fn show_json(advice: &Advice) -> io::Result<()> {
    let mut out = io::stdout().lock();
    writeln!(out, "{}", serde_json::to_string_pretty(advice)?)?;
    out.flush()
}

fn show(advice: &Advice) -> io::Result<()> {
    let mut out = text::terminal();
    writeln!(
        out,
        "{}: {}; {}: {}; noise floor {}",
        text::plain(&advice.scene),
        text::counted(advice.items, "item"),
        text::plain(&advice.path),
        text::counted(advice.cameras, "camera"),
        text::percent(advice.noise_floor)
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
    writeln!(out, "\nWhat can be left out, each forced on and off:")?;
    writeln!(out, "{}", omission_table(&advice.omissions))?;
    writeln!(
        out,
        "A rule leaves out on its side of the threshold; where both sides answer the same, the clock\n\
         decides beyond the noise floor. Kept / left out above 1: leaving out is faster."
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
    let times = row.and_then(|row| row.speedup);
    let times = times.map(|times| format!(", {} x linear", text::significant(times)));
    let repaid = row.and_then(|row| row.break_even_queries);
    let repaid = repaid.map(|n| {
        format!(
            "; its build is repaid after {}",
            text::counted(n as usize, "query")
        )
    });
    writeln!(
        out,
        "  structure: {name}{}{}{}",
        times.unwrap_or_default(),
        ties(&choice.ties),
        repaid.unwrap_or_default()
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
    for decision in [Decision::LeaveOut, Decision::Keep] {
        let of = advice.omissions.iter().filter(|o| o.decision == decision);
        let named: Vec<&str> = of.map(|omission| omission.left_out).collect();
        if !named.is_empty() {
            writeln!(out, "  {}:\n    {}", decision.name(), named.join("\n    "))?;
        }
    }
    Ok(())
}

fn ties<S: AsRef<str>>(names: &[S]) -> String {
    let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
    match names.is_empty() {
        true => String::new(),
        false => format!(" (a tie with {})", names.join(", ")),
    }
}

fn structure_table(choice: &StructureChoice) -> text::Table {
    let header = [
        "structure",
        "query median [95 % interval]",
        "times linear",
        "build",
        "B/item",
        "break-even queries",
        "locate",
        "status",
    ];
    let mut table = text::table(&header, &[1, 2, 3, 4, 5, 6]);
    for row in &choice.rows {
        let show = |value: Option<f64>, how: fn(f64) -> String| value.map(how).unwrap_or_default();
        table.add_row([
            row.structure.clone(),
            interval(row.query_ns, row.query_ns_lower, row.query_ns_upper),
            show(row.speedup, text::significant),
            show(row.build_ms, |ms| text::time(ms * 1e6)),
            show(row.memory_bytes_per_item, |bytes| format!("{bytes:.1}")),
            show(row.break_even_queries, |n| text::count(n as usize)),
            show(row.locate_ns, text::time),
            row.status.to_owned(),
        ]);
    }
    table
}

fn interval(value: Option<f64>, lower: Option<f64>, upper: Option<f64>) -> String {
    match (value, lower, upper) {
        (Some(value), Some(lower), Some(upper)) => format!(
            "{} [{}, {}]",
            text::time(value),
            text::time(lower),
            text::time(upper)
        ),
        _ => String::new(),
    }
}

fn test_table(choice: &TestChoice) -> text::Table {
    let header = [
        "",
        "test",
        "query [95 % interval]",
        "excess %",
        "missed ppm",
        "too many a query",
        "query and drawing",
    ];
    let mut table = text::table(&header, &[2, 3, 4, 5, 6]);
    for row in &choice.rows {
        let show = |value: Option<f64>, how: fn(f64) -> String| value.map(how).unwrap_or_default();
        table.add_row([
            if choice.name == Some(row.test) {
                "*"
            } else {
                ""
            }
            .to_owned(),
            row.test.to_owned(),
            interval(row.query_ns, row.query_ns_lower, row.query_ns_upper),
            show(row.excess, |share| format!("{:.3}", share * 100.0)),
            show(row.false_negative_ppm, text::significant),
            show(row.false_positives_per_query, text::significant),
            show(row.total_ns, text::time),
        ]);
    }
    table
}

fn omission_table(omissions: &[Omission]) -> text::Table {
    let header = [
        "rule",
        "advice",
        "statistic",
        "threshold",
        "saving",
        "forced on",
        "kept",
        "left out",
        "kept / left out",
        "excess % kept / left out",
        "answers",
    ];
    let mut table = text::table(&header, &[2, 3, 4, 6, 7, 8, 9]);
    for omission in omissions {
        let figure = |value: Option<f64>| value.map(general).unwrap_or_default();
        let side = match omission.left_out_if {
            LeftOutIf::AtMost => "<= ",
            LeftOutIf::AtLeast => ">= ",
        };
        let mut cells = vec![
            omission.rule.to_owned(),
            omission.decision.name().to_owned(),
            figure(omission.statistic),
            omission
                .threshold
                .map(|t| format!("{side}{}", general(t)))
                .unwrap_or_default(),
            omission.saving.map(text::percent).unwrap_or_default(),
        ];
        let mut checks = omission.checks.iter();
        cells.extend(checks.next().map(check_cells).into_iter().flatten());
        table.add_row(cells);
        for check in checks {
            let mut cells = vec![String::new(); 5];
            cells.extend(check_cells(check));
            table.add_row(cells);
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
        format!(
            "{} [{}, {}]",
            text::significant(check.ratio),
            text::significant(check.ratio_lower),
            text::significant(check.ratio_upper)
        ),
        both.map(|(kept, left_out)| format!("{kept} / {left_out}"))
            .unwrap_or_default(),
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
