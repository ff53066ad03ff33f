//! `cullbench drift`: tables of the errors of camera updates (turn, orbit, chase),
//! of the cost of a step of each, and recommendations.

use std::collections::BTreeSet;
use std::io::{self, Write};

use super::args::DriftArgs;
use super::interrupt::Interrupted;
use super::protocol::{Job, Timing};
use super::study::Study;
use super::table::Table;
use super::{Ending, drift_arms, expect_place_for, interrupt, print, text, write_text};
use crate::drift::{
    self, ArmKind, ArmOptions, DriftOptions, DriftReport, ORBIT_RADIUS, OrbitDrift, Rated,
    Recommendation, RotationDrift, SWING_DEG, TurnDrift,
};
use crate::measure::{ProcessTimes, Protocol, Schedule};

/// Most columns of a table.
const WIDTH: u16 = 100;

/// Rounds of what is timed, if one process has them all.
const ROUNDS: [usize; 2] = [5, 15];

pub fn drift(args: &DriftArgs) -> anyhow::Result<Ending> {
    expect_place_for("--svg", args.svg.as_deref())?;
    let options = options(args);
    interrupt::from_now_on_finish();
    let jobs = drift::jobs(&options);
    let study = Study::new(String::new(), jobs as u64, &args.spread)?;
    let work = text::counted(jobs, "study");
    let steps = options.steps as f64;
    let seconds = options.arm.seconds;
    study.announce(
        &format!("{work}, up to {steps:e} steps or {seconds} s each"),
        "less than a minute",
    );
    let report = drift::prepare(&options, |job| {
        study.begin(job);
        study.advance();
        interrupt::asked()
    });
    let mut report = report.ok_or(Interrupted)?;
    let schedule = drift::plan(&options, &protocol(args, 0));
    let job = |timing| Job::Drift(schedule.clone(), timing);
    let times = study.times("everything, timed", None, job)?;
    report.conclude(&times, schedule.rounds);
    print(args.format, &report, || {
        show(&report, &mut io::stdout().lock())
    })?;
    if let Some(file) = &args.svg {
        write_text(file, &drift_arms::draw(&report.arm)?)?;
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
pub fn time(
    args: &DriftArgs,
    plan: &Schedule,
    timing: &Timing,
    stop: &dyn Fn() -> bool,
) -> Option<ProcessTimes> {
    drift::time(&options(args), plan, &protocol(args, timing.process), stop)
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

fn show(report: &DriftReport, out: &mut impl Write) -> io::Result<()> {
    writeln!(
        out,
        "{}, {} in each{}",
        text::counted(report.processes, "process"),
        text::counted(report.rounds, "round"),
        match report.processes {
            ..3 => ": times without intervals (--processes 10 gives them)",
            _ => ": times with 95 % intervals",
        }
    )?;
    show_rotations(report, out)?;
    show_orbits(report, out)?;
    drift_arms::show(&report.arm, out)
}

fn show_rotations(report: &DriftReport, out: &mut impl Write) -> io::Result<()> {
    let turn = report.turn_per_step;
    writeln!(
        out,
        "Camera bases: yaw {}, pitch {} and roll {} degrees per step; the most in the {} steps\n\
         that end there, a period between two corrections. The orbit has radius {ORBIT_RADIUS};\n\
         the eye hangs on the base.",
        turn.yaw_deg, turn.pitch_deg, turn.roll_deg, report.period_steps
    )?;
    let (all, turns) = (&report.rotation, &report.one_degree_turns);
    let figures: [Figure<RotationDrift>; 4] = [
        ("orthogonality after", |d| d.orthogonality_error),
        ("angular error in rad after", |d| d.angle_error_rad),
        ("position on orbit off after", |d| d.orbit_position_error),
        ("radius of orbit off after", |d| d.orbit_radius_error),
    ];
    for (title, figure) in figures {
        let of = |d: &RotationDrift| (d.method, d.steps, scientific(figure(d)));
        writeln!(out, "{}", grid(title, steps, all, of))?;
    }
    let title = "in steps of 1 degree: angular error in rad after";
    let head = |turns| text::counted(turns as usize, "turn");
    let of = |d: &TurnDrift| (d.method, d.turns, format!("{:.3e}", d.angle_error_rad));
    writeln!(out, "{}", grid(title, head, turns, of))?;
    let title = format!("bases after {} steps", steps(report.steps));
    show_rated(&title, "error", &report.rotation_methods, out)?;
    recommend("a camera base", &report.recommended_rotation, out)
}

/// Title of a table of errors, and its cell.
type Figure<T> = (&'static str, fn(&T) -> f64);

fn show_orbits(report: &DriftReport, out: &mut impl Write) -> io::Result<()> {
    let swing = format!("an eye carried around by {SWING_DEG:.3} degrees per step");
    writeln!(out, "Orbits: {swing}")?;
    let figures: [Figure<OrbitDrift>; 2] = [
        ("position off after", |d| d.position_error),
        ("radius off after", |d| d.radius_error),
    ];
    for (title, figure) in figures {
        let of = |d: &OrbitDrift| (d.method, d.steps, scientific(figure(d)));
        writeln!(out, "{}", grid(title, steps, &report.orbit, of))?;
    }
    let title = format!("orbits after {} steps", steps(report.steps));
    show_rated(&title, "error / radius", &report.orbit_methods, out)?;
    recommend("an orbit", &report.recommended_orbit, out)
}

fn show_rated(title: &str, error: &str, rated: &[Rated], out: &mut impl Write) -> io::Result<()> {
    let mut table = Table::new([title, error, "ns/step", "good", ""], &[1]).fit(WIDTH);
    for row in rated {
        let default = if row.is_default { " (default)" } else { "" };
        table.add_row([
            format!("{}{default}", row.name),
            row.error.map_or("unstable".to_owned(), scientific),
            text::some(row.ns_per_step, text::significant)
                + &text::interval([row.ns_per_step_lower, row.ns_per_step_upper], 1.0),
            if row.qualifies { "yes" } else { "no" }.to_owned(),
            row.summary.to_owned(),
        ]);
    }
    writeln!(out, "{table}")
}

fn recommend(what: &str, choice: &Recommendation, out: &mut impl Write) -> io::Result<()> {
    let name = choice.name.as_deref().unwrap_or("nothing");
    let said = format!("Recommended for {what}: {name}, {}.", choice.reason);
    writeln!(out, "{}\n", text::wrapped(&said, WIDTH.into()))
}
