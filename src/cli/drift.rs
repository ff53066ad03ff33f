//! `cullbench drift`: tables of how far ways to turn, orbit and chase drift
//! from the truth, what a step of each costs, and what follows from that.

use std::collections::BTreeSet;
use std::io::{self, Write};

use super::args::DriftArgs;
use super::interrupt::Interrupted;
use super::processes::Workers;
use super::protocol::{Job, Timing};
use super::study::Study;
use super::table::Table;
use super::{
    Ending, drift_arms, drift_diagram, expect_place_for, interrupt, print, text, write_text,
};
use crate::drift::{
    self, ArmKind, ArmOptions, DriftOptions, DriftPlan, DriftReport, ORBIT_RADIUS, Rated,
    Recommendation, SWING_DEG,
};
use crate::measure::{ProcessTimes, Protocol};

/// Long summaries wrap at this width.
const WIDTH: u16 = 100;

/// Rounds of what is timed, if one process has them all.
const ROUNDS: [usize; 2] = [5, 15];

pub fn drift(args: &DriftArgs) -> anyhow::Result<Ending> {
    expect_place_for("--svg", args.svg.as_deref())?;
    let options = options(args);
    interrupt::from_now_on_finish();
    let workers = Workers::of_study()?;
    let jobs = drift::jobs(&options);
    let study = Study::new(String::new(), jobs as u64, &args.spread);
    study.announce(&format!(
        "{}, up to {:e} steps or {} s each",
        text::counted(jobs, "study"),
        options.steps as f64,
        options.arm.seconds
    ));
    let prepared = drift::prepare(&options, &protocol(args, 0), |job| {
        study.begin(job);
        study.advance();
        interrupt::asked()
    });
    let prepared = prepared.ok_or(Interrupted)?;
    let job = |timing| Job::Drift(prepared.plan.clone(), timing);
    let times = study.times(&workers, "everything, timed", None, job)?;
    let report = prepared.conclude(&times);
    let shown = print(args.format, &report, || {
        show(&report, &mut io::stdout().lock())
    });
    if let Some(file) = &args.svg {
        write_text(file, &drift_diagram::draw(&report.arm)?)?;
    }
    shown?;
    Ok(Ending::Ok)
}

fn options(args: &DriftArgs) -> DriftOptions {
    let once = |typed: &[f64]| {
        let mut list = typed.to_vec();
        list.sort_by(f64::total_cmp);
        list.dedup();
        list
    };
    DriftOptions {
        steps: args.steps,
        tolerance_rad: args.tolerance,
        arm: ArmOptions {
            arms: ArmKind::ALL
                .into_iter()
                .filter(|kind| args.arm.contains(kind))
                .collect(),
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

/// One process's share of the times.
pub fn time(
    args: &DriftArgs,
    plan: &DriftPlan,
    timing: &Timing,
    stop: &dyn Fn() -> bool,
) -> Option<ProcessTimes> {
    drift::time(&options(args), plan, &protocol(args, timing.process), stop)
}

/// Rows by columns, where each cell is looked up by its row's and its
/// column's name.
fn grid(
    corner: &str,
    columns: &[String],
    rows: &[&str],
    cell: impl Fn(&str, usize) -> String,
) -> Table {
    let columns_of_it = columns.iter().map(String::as_str);
    let mut table = Table::of_numbers([corner].into_iter().chain(columns_of_it));
    for row in rows {
        let cells = (0..columns.len()).map(|column| cell(row, column));
        table.add_row([(*row).to_owned()].into_iter().chain(cells));
    }
    table
}

/// A title, and the figure that is under it.
type Measure<T> = (&'static str, fn(&T) -> f64);

/// Two digits of something that spans many powers of ten.
fn scientific(value: f64) -> String {
    if value.is_nan() {
        return "lost".to_owned();
    }
    format!("{value:.1e}")
}

fn names(rated: &[Rated]) -> Vec<&'static str> {
    rated.iter().map(|rated| rated.name).collect()
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

/// Numbers of steps as the heads of columns.
fn after(steps: &BTreeSet<u64>) -> Vec<String> {
    steps.iter().map(|&n| format!("{:e}", n as f64)).collect()
}

fn show_rotations(report: &DriftReport, out: &mut impl Write) -> io::Result<()> {
    let steps: BTreeSet<u64> = report.rotation.iter().map(|d| d.steps).collect();
    let columns = after(&steps);
    let methods = names(&report.rotation_methods);
    let turn = report.turn_per_step;
    writeln!(
        out,
        "Camera bases: yaw {}, pitch {} and roll {} degrees per step; the most in the {} steps\n\
         that end there, a period between two corrections",
        turn.yaw_deg, turn.pitch_deg, turn.roll_deg, report.period_steps
    )?;
    let measures: [Measure<drift::RotationDrift>; 4] = [
        ("orthogonality after", |d| d.orthogonality_error),
        ("angle off in rad after", |d| d.angle_error_rad),
        ("position on orbit off after", |d| d.orbit_position_error),
        ("radius of orbit off after", |d| d.orbit_radius_error),
    ];
    for (title, measure) in measures {
        let table = grid(title, &columns, &methods, |method, column| {
            let own = report.rotation.iter().filter(|d| d.method == method);
            own.map(|d| scientific(measure(d)))
                .nth(column)
                .unwrap_or_default()
        });
        writeln!(out, "{table}")?;
    }
    writeln!(
        out,
        "The orbit has radius {ORBIT_RADIUS}; the eye hangs on the frame."
    )?;
    let turns: BTreeSet<u64> = report.one_degree_turns.iter().map(|d| d.turns).collect();
    let title = "in steps of 1 degree: angle off in rad after";
    let columns: Vec<String> = turns
        .iter()
        .map(|n| text::counted(*n as usize, "turn"))
        .collect();
    let table = grid(title, &columns, &methods, |method, column| {
        let own = report
            .one_degree_turns
            .iter()
            .filter(|d| d.method == method);
        let mut angles = own.map(|d| format!("{:.3e}", d.angle_error_rad));
        angles.nth(column).unwrap_or_default()
    });
    writeln!(out, "{table}")?;
    let title = format!("frames after {:e} steps", report.steps as f64);
    show_rated(&title, "error", &report.rotation_methods, out)?;
    recommend("a frame", &report.recommended_rotation, out)
}

fn show_orbits(report: &DriftReport, out: &mut impl Write) -> io::Result<()> {
    let steps: BTreeSet<u64> = report.orbit.iter().map(|d| d.steps).collect();
    let methods = names(&report.orbit_methods);
    writeln!(
        out,
        "Orbits: an eye carried around by {SWING_DEG:.3} degrees per step"
    )?;
    let measures: [Measure<drift::OrbitDrift>; 2] = [
        ("position off after", |d| d.position_error),
        ("radius off after", |d| d.radius_error),
    ];
    for (title, measure) in measures {
        let table = grid(title, &after(&steps), &methods, |method, column| {
            let own = report.orbit.iter().filter(|d| d.method == method);
            own.map(|d| scientific(measure(d)))
                .nth(column)
                .unwrap_or_default()
        });
        writeln!(out, "{table}")?;
    }
    let title = format!("orbits after {:e} steps", report.steps as f64);
    show_rated(&title, "error / radius", &report.orbit_methods, out)?;
    recommend("an orbit", &report.recommended_orbit, out)
}

fn show_rated(title: &str, error: &str, rated: &[Rated], out: &mut impl Write) -> io::Result<()> {
    let header = [title, error, "ns/step", "good", "dominated by", ""];
    let mut table = Table::new(header, &[1]).fit(WIDTH);
    for row in rated {
        let name = match row.is_default {
            true => format!("{} (default)", row.name),
            false => row.name.to_owned(),
        };
        table.add_row([
            name,
            row.error.map_or("unstable".to_owned(), scientific),
            text::significant(row.ns_per_step)
                + &text::interval([row.ns_per_step_lower, row.ns_per_step_upper], 1.0),
            if row.qualifies { "yes" } else { "no" }.to_owned(),
            match row.dominated_by {
                Some(name) => name.to_owned(),
                None if row.on_front => "(Pareto front)".to_owned(),
                None => String::new(),
            },
            row.summary.to_owned(),
        ]);
    }
    writeln!(out, "{table}")
}

fn recommend(what: &str, choice: &Recommendation, out: &mut impl Write) -> io::Result<()> {
    let said = match choice.name {
        Some(name) => format!("Recommended for {what}: {name}, {}.", choice.reason),
        None => format!("Recommended for {what}: nothing; {}.", choice.reason),
    };
    writeln!(out, "{}\n", text::wrapped(&said, WIDTH.into()))
}
