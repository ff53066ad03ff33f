//! `cullbench drift`: tables of the errors of camera updates (turn, orbit, chase),
//! of the cost of a step of each, and recommendations.

use std::collections::BTreeSet;

use super::args::DriftArgs;
use super::document::{Block, show, to_page};
use super::processes::{Job, Timing};
use super::study::Study;
use super::table::{Column, Table};
use super::{Ending, drift_arms, expect_places, print, text, write_text};
use crate::drift::{
    self, ArmKind, ArmOptions, DriftOptions, DriftReport, ORBIT_RADIUS, OrbitDrift, Rated,
    Recommendation, RotationDrift, SWING_DEG, TurnDrift,
};
use crate::measure::{ProcessTimes, Protocol, Schedule};

/// Rounds of what is timed, if one process has them all.
const ROUNDS: [usize; 2] = [5, 15];

pub fn drift(args: &DriftArgs) -> anyhow::Result<Ending> {
    let outputs = [
        ("--svg", args.svg.as_deref()),
        ("--html", args.html.as_deref()),
    ];
    expect_places(&outputs, &[])?;
    let options = options(args);
    let jobs = drift::jobs(&options);
    let study = Study::new(String::new(), jobs as u64, &args.spread)?;
    let work = text::counted(jobs, "study");
    let steps = options.steps as f64;
    let seconds = options.arm.seconds;
    study.announce(
        &format!("{work}, up to {steps:e} steps or {seconds} s each"),
        "about half a minute",
    );
    let mut report = drift::prepare(&options, |job| {
        study.begin(job);
        study.advance();
    });
    let schedule = drift::plan(&options, &protocol(args, 0));
    let job = |timing| Job::Drift(schedule.clone(), timing);
    let times = study.times("everything, timed", None, job)?;
    report.conclude(&times, schedule.rounds);
    print(args.format, &report, || show(&blocks(&report, args.all)))?;
    if let Some(file) = &args.svg {
        write_text(file, &drift_arms::draw(&report.arm))?;
    }
    if let Some(file) = &args.html {
        let figures = drift_arms::figures(&report.arm).into_iter();
        let (figures, blocks) = (figures.map(Block::Figure), blocks(&report, true));
        write_text(file, &to_page("drift", usize::MAX, figures, blocks))?;
    }
    Ok(Ending::Ok)
}

fn options(args: &DriftArgs) -> DriftOptions {
    let once = |typed: &[f64]| {
        let mut list = typed.to_vec();
        list.sort_by(f64::total_cmp);
        list.dedup();
        list
    };
    let mut arms = ArmKind::ALL.to_vec();
    arms.retain(|kind| args.arm.contains(kind));
    DriftOptions {
        steps: args.steps,
        tolerance_rad: args.tolerance,
        arm: ArmOptions {
            arms,
            stiffnesses: once(&args.stiffness),
            rates_hz: once(&args.rate),
            seconds: args.seconds,
            tolerance: args.arm_tolerance,
        },
    }
}

fn protocol(args: &DriftArgs, process: u32) -> Protocol {
    args.spread.protocol(ROUNDS, process, usize::MAX)
}

/// Times everything in one process.
pub fn time(args: &DriftArgs, plan: &Schedule, timing: &Timing) -> ProcessTimes {
    drift::time(&options(args), plan, &protocol(args, timing.process))
}

/// A table of one figure: a row per method, a column per number of steps or turns.
fn grid<T>(
    title: &str,
    head: impl Fn(u64) -> String,
    all: &[T],
    of: impl Fn(&T) -> (&'static str, u64, String),
) -> Table {
    let columns: BTreeSet<u64> = all.iter().map(|row| of(row).1).collect();
    let columns = columns.into_iter().map(head);
    let mut table = Table::of_numbers([title.to_owned()].into_iter().chain(columns));
    for own in all.chunk_by(|a, b| of(a).0 == of(b).0) {
        let cells = own.iter().map(|row| of(row).2);
        table.add_row([of(&own[0]).0.to_owned()].into_iter().chain(cells));
    }
    table
}

/// A number of steps.
fn steps(count: u64) -> String {
    format!("{:e}", count as f64)
}

/// Two digits of something that spans many powers of ten.
fn scientific(value: f64) -> String {
    match value.is_nan() {
        true => "lost".to_owned(),
        false => format!("{value:.1e}"),
    }
}

/// Tables and recommendations.
///
/// With `all` the errors after each number of steps too.
fn blocks(report: &DriftReport, all: bool) -> Vec<Block> {
    let (turn, steps) = (report.turn_per_step, steps(report.steps));
    let times = match report.processes {
        ..3 => "times without intervals (--processes 10 gives them)",
        _ => "times with 95 % intervals",
    };
    let mut blocks = vec![Block::Line(format!(
        "Camera updates after {steps} steps: {}, {} in each; {times}.",
        text::counted(report.processes, "process"),
        text::counted(report.rounds, "round"),
    ))];
    blocks.push(Block::Heading(
        2,
        format!(
            "Camera bases turned by yaw {}, pitch {} and roll {} degrees per step",
            turn.yaw_deg, turn.pitch_deg, turn.roll_deg
        ),
    ));
    if all {
        blocks.extend(rotations(report));
    }
    let of_bases = rated(&report.rotation_methods, "error", report.tolerance_rad, all);
    blocks.push(Block::Table(of_bases));
    let swing = format!("Orbits: an eye carried around by {SWING_DEG:.3} degrees per step");
    blocks.push(Block::Heading(2, swing));
    if all {
        blocks.extend(orbits(report));
    }
    let of_orbits = rated(
        &report.orbit_methods,
        "error / radius",
        report.tolerance_rad,
        all,
    );
    blocks.push(Block::Table(of_orbits));
    blocks.extend(drift_arms::blocks(&report.arm, all));
    blocks.push(Block::Heading(2, "Conclusions:".to_owned()));
    let bases = (&report.rotation_methods, &report.recommended_rotation);
    let eyes = (&report.orbit_methods, &report.recommended_orbit);
    for (what, (methods, choice)) in [("a camera base", bases), ("an orbit", eyes)] {
        blocks.push(Block::Line(recommended(what, methods, choice)));
    }
    blocks.extend(drift_arms::conclusions(&report.arm).map(Block::Line));
    if !all {
        let more = "errors by number of steps, orders, stability: --all";
        blocks.extend(["", more].map(|line| Block::Line(line.to_owned())));
    }
    blocks
}

/// Errors of bases after each number of steps.
fn rotations(report: &DriftReport) -> Vec<Block> {
    let note = format!(
        "Each figure is the largest of the {} steps that end there, a period between two \
         corrections. The orbit has radius {ORBIT_RADIUS}; the eye hangs on the base.",
        report.period_steps
    );
    let (all, turns) = (&report.rotation, &report.one_degree_turns);
    let figures: [Figure<RotationDrift>; 4] = [
        ("orthogonality after", |d| d.orthogonality_error),
        ("angular error in rad after", |d| d.angle_error_rad),
        ("position error on an orbit after", |d| {
            d.orbit_position_error
        }),
        ("radius error of an orbit after", |d| d.orbit_radius_error),
    ];
    let tables = figures.iter().map(|(title, figure)| {
        let of = |d: &RotationDrift| (d.method, d.steps, scientific(figure(d)));
        Block::Table(grid(title, steps, all, of))
    });
    let title = "by 1 degree per step: error in rad after";
    let head = |turns| text::counted(turns as usize, "turn");
    let of = |d: &TurnDrift| (d.method, d.turns, format!("{:.3e}", d.angle_error_rad));
    let by_degrees = Block::Table(grid(title, head, turns, of));
    [Block::Line(note)]
        .into_iter()
        .chain(tables)
        .chain([by_degrees])
        .collect()
}

/// Title of a table of errors, and its cell.
type Figure<T> = (&'static str, fn(&T) -> f64);

/// Errors of carried eyes after each number of steps.
fn orbits(report: &DriftReport) -> impl Iterator<Item = Block> {
    let figures: [Figure<OrbitDrift>; 2] = [
        ("position error after", |d| d.position_error),
        ("radius error after", |d| d.radius_error),
    ];
    figures.into_iter().map(|(title, figure)| {
        let of = |d: &OrbitDrift| (d.method, d.steps, scientific(figure(d)));
        Block::Table(grid(title, steps, &report.orbit, of))
    })
}

/// Methods with error and time; with `all` a line about each.
fn rated(methods: &[Rated], error: &str, tolerance: f64, all: bool) -> Table {
    let columns: [Column<&Rated>; 5] = [
        ("method", |row| {
            let default = if row.is_default { " (default)" } else { "" };
            format!("{}{default}", row.name)
        }),
        (">error", |row| {
            row.error.map_or("unstable".to_owned(), scientific)
        }),
        (">time per step", |row| {
            text::time_plus_minus(row.time_per_step)
        }),
        ("", |row| {
            if row.qualifies { "yes" } else { "no" }.to_owned()
        }),
        ("", |row| row.summary.to_owned()),
    ];
    let shown = if all { columns.len() } else { 4 };
    let mut table = Table::with(methods, &columns[..shown]);
    error.clone_into(&mut table.header[1]);
    table.header[3] = format!("within {tolerance:e}");
    table
}

/// A recommendation with its figures.
fn recommended(what: &str, methods: &[Rated], choice: &Recommendation) -> String {
    let Some(name) = &choice.name else {
        return format!("Recommended for {what}: nothing, {}.", choice.reason);
    };
    let row = methods.iter().find(|row| row.name == name);
    let figures = text::some(row, |row| {
        let error = text::some(row.error, scientific);
        let time = text::time_plus_minus(row.time_per_step);
        format!(" ({time} per step, error {error})")
    });
    format!(
        "Recommended for {what}: {name}{figures}, {}.",
        choice.reason
    )
}
