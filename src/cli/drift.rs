//! `cullbench drift`: tables of the errors of camera updates (turn, orbit, chase),
//! of the cost of a step of each, and recommendations.

use std::collections::BTreeMap;

use super::args::DriftArgs;
use super::diagram::{Diagram, Joined, Point, Series};
use super::document::{Block, show, to_page};
use super::figure::{Axis, Figure, Look, is_drawn, picture};
use super::processes::{Job, Timing};
use super::study::Study;
use super::table::{Column, Table};
use super::text::{self, some, time_plus_minus};
use super::{Ending, expect_places, print, write_text};
use crate::drift::{
    self, ARMS, ArmChoice, ArmKind, ArmOptions, ArmPoint, ArmReport, DriftOptions, DriftReport,
    ORBIT_RADIUS, OrbitDrift, Rated, Recommendation, RotationDrift, SWING_DEG, StabilityLimit,
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
        write_text(file, &draw(&report.arm))?;
    }
    if let Some(file) = &args.html {
        let figures = arm_figures(&report.arm).into_iter();
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
    let mut blocks = vec![Block::line(format!(
        "Camera updates after {steps} steps: {}, {} in each; {times}.",
        text::counted(report.processes, "process"),
        text::counted(report.rounds, "round"),
    ))];
    let turns = format!(
        "Camera bases turned by yaw {}, pitch {} and roll {} degrees per step",
        turn.yaw_deg, turn.pitch_deg, turn.roll_deg
    );
    let swing = format!("Orbits: an eye carried around by {SWING_DEG:.3} degrees per step");
    for (heading, methods, error, tables) in [
        (
            turns,
            &report.rotation_methods,
            "error",
            rotations as Tables,
        ),
        (swing, &report.orbit_methods, "error / radius", orbits),
    ] {
        blocks.push(Block::Heading(2, heading));
        if all {
            blocks.extend(tables(report));
        }
        let rated = rated(methods, error, report.tolerance_rad, all);
        blocks.push(Block::Table(rated));
    }
    blocks.extend(arm_blocks(&report.arm, all));
    blocks.push(Block::heading("Conclusions:"));
    let bases = (&report.rotation_methods, &report.recommended_rotation);
    let eyes = (&report.orbit_methods, &report.recommended_orbit);
    for (what, (methods, choice)) in [("a camera base", bases), ("an orbit", eyes)] {
        blocks.push(Block::Line(recommended(what, methods, choice)));
    }
    blocks.extend(arm_conclusions(&report.arm).map(Block::Line));
    if !all {
        let more = "errors by number of steps, orders, stability: --all";
        blocks.extend(["", more].map(Block::line));
    }
    blocks
}

/// Tables of errors after each number of steps.
type Tables = fn(&DriftReport) -> Vec<Block>;

/// Errors of bases after each number of steps.
fn rotations(report: &DriftReport) -> Vec<Block> {
    let note = format!(
        "Each figure is the largest of the {} steps that end there, a period between two \
         corrections. The orbit has radius {ORBIT_RADIUS}; the eye hangs on the base.",
        report.period_steps
    );
    let figures: [Errors<RotationDrift>; 4] = [
        ("orthogonality after", |d| d.orthogonality_error),
        ("angular error in rad after", |d| d.angle_error_rad),
        ("position error on an orbit after", |d| {
            d.orbit_position_error
        }),
        ("radius error of an orbit after", |d| d.orbit_radius_error),
    ];
    let by_turns = report.one_degree_turns.iter().map(|d| {
        let turns = text::counted(d.turns as usize, "turn");
        [
            d.method.to_owned(),
            turns,
            format!("{:.3e}", d.angle_error_rad),
        ]
    });
    let by_turns = Table::grid("by 1 degree per step: error in rad after", by_turns);
    let mut blocks = vec![Block::Line(note)];
    blocks.extend(errors(&figures, &report.rotation, |d| (d.method, d.steps)));
    blocks.push(Block::Table(by_turns));
    blocks
}

/// Errors of carried eyes after each number of steps.
fn orbits(report: &DriftReport) -> Vec<Block> {
    let figures: [Errors<OrbitDrift>; 2] = [
        ("position error after", |d| d.position_error),
        ("radius error after", |d| d.radius_error),
    ];
    errors(&figures, &report.orbit, |d| (d.method, d.steps)).collect()
}

/// Title of a table of errors, and its cell.
type Errors<T> = (&'static str, fn(&T) -> f64);

/// A table per error: a row per method, a column per number of steps.
fn errors<T>(
    figures: &[Errors<T>],
    rows: &[T],
    of: fn(&T) -> (&'static str, u64),
) -> impl Iterator<Item = Block> {
    figures.iter().map(move |(title, error)| {
        let cells = rows.iter().map(|row| {
            let (method, count) = of(row);
            [method.to_owned(), steps(count), scientific(error(row))]
        });
        Block::Table(Table::grid(title, cells))
    })
}

/// Methods with error and time; with `all` a line about each.
fn rated(methods: &[Rated], error: &str, tolerance: f64, all: bool) -> Table {
    let columns: [Column<&Rated>; 5] = [
        ("method", |r| {
            let default = if r.is_default { " (default)" } else { "" };
            format!("{}{default}", r.name)
        }),
        (">error", |r| {
            r.error.map_or("unstable".to_owned(), scientific)
        }),
        (">time per step", |r| time_plus_minus(r.time_per_step)),
        ("", |r| if r.qualifies { "yes" } else { "no" }.to_owned()),
        ("", |r| r.summary.to_owned()),
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
    let figures = some(row, |row| {
        let error = some(row.error, scientific);
        let time = time_plus_minus(row.time_per_step);
        format!(" ({time} per step, error {error})")
    });
    format!(
        "Recommended for {what}: {name}{figures}, {}.",
        choice.reason
    )
}

/// Method of each arm; with `all` errors, orders and limits of stability as well.
pub fn arm_blocks(report: &ArmReport, all: bool) -> Vec<Block> {
    let mut blocks = vec![
        Block::heading("Spring arms, critically damped, behind a moving target"),
        Block::line(format!(
            "The target is known where frames end. Errors are the largest at the end of a frame in \
             {} s, times are thread CPU time per simulated second.",
            report.seconds
        )),
    ];
    for (arm, name, what) in ARMS {
        if all && report.points.iter().any(|p| p.setting.arm == arm) {
            blocks.push(Block::Heading(3, format!("{name} arm: {what}")));
            let title = format!("{name}, {} Hz, within {:e}", rate(report), report.tolerance);
            let cell = |own: &[&ArmPoint]| within(own, report.tolerance);
            blocks.push(Block::Table(by_stiffness(report, arm, &title, cell)));
            let title = format!("{name}, observed order");
            blocks.push(Block::Table(by_stiffness(report, arm, &title, orders)));
        }
    }
    if all {
        blocks.push(Block::line(
            "Orders are the powers of the step by which a method's own error falls from each \
             number of steps to the next; ! is half a power or more below the classical order: \
             steps are not far below 1/omega, or the arm meets the stop.",
        ));
        blocks.push(Block::Table(stability(&report.stability)));
    }
    blocks.push(Block::Table(choices(report, all)));
    blocks
}

/// Methods to take, each with the number of settings it is the choice of.
pub fn arm_conclusions(report: &ArmReport) -> impl Iterator<Item = String> {
    ARMS.iter().filter_map(|(arm, name, _)| {
        let own = report.choices.iter().filter(|c| c.setting.arm == *arm);
        let own: Vec<&ArmChoice> = own.collect();
        let first = own.first()?;
        let mut methods = BTreeMap::<&str, usize>::new();
        for choice in &own {
            *methods
                .entry(choice.method.unwrap_or("nothing"))
                .or_default() += 1;
        }
        let mut methods: Vec<_> = methods.into_iter().collect();
        methods.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        let told = match methods[..] {
            [(method, _)] => format!("{method}, {}", first.choice.reason),
            _ => {
                let each = methods
                    .iter()
                    .map(|(name, count)| format!("{name} in {count}"));
                format!(
                    "{} of {} settings, the cheapest with an error within {:e}",
                    each.collect::<Vec<_>>().join(", "),
                    own.len(),
                    report.tolerance
                )
            }
        };
        Some(format!("Recommended for a {name} arm: {told}."))
    })
}

/// The frame rate in the middle, the one of errors and orders.
fn rate(report: &ArmReport) -> f64 {
    let mut rates: Vec<f64> = report.choices.iter().map(|c| c.setting.rate_hz).collect();
    rates.sort_by(f64::total_cmp);
    rates.get(rates.len() / 2).copied().unwrap_or(f64::NAN)
}

/// A table of an arm: a row per method, a column per stiffness.
fn by_stiffness(
    report: &ArmReport,
    arm: ArmKind,
    title: &str,
    cell: impl Fn(&[&ArmPoint]) -> String,
) -> Table {
    let shown = (arm, rate(report));
    let points = report.points.iter();
    let points = points.filter(|p| (p.setting.arm, p.setting.rate_hz) == shown);
    let points: Vec<&ArmPoint> = points.collect();
    let is_same = |a: &&ArmPoint, b: &&ArmPoint| (a.setting, a.method) == (b.setting, b.method);
    let cells = points.chunk_by(is_same).map(|own| {
        let stiffness = format!("k={:e}", own[0].setting.stiffness);
        [own[0].method.to_owned(), stiffness, cell(own)]
    });
    Table::grid(title, cells)
}

/// "x4: 1.2e-4, 3.21 us" of the cheapest that is precise enough, or the nearest.
fn within(points: &[&ArmPoint], tolerance: f64) -> String {
    let stable = || points.iter().filter_map(|p| Some((p.position_error?, *p)));
    let time = |point: &ArmPoint| point.us_per_second.map_or(f64::INFINITY, |us| us.value);
    let good = stable().filter(|(error, _)| *error <= tolerance);
    if let Some((error, point)) = good.min_by(|a, b| time(a.1).total_cmp(&time(b.1))) {
        let time = point.us_per_second.map(|us| text::time(us.value * 1e3));
        return format!(
            "x{}: {error:.1e}, {}",
            point.substeps,
            time.unwrap_or_default()
        );
    }
    match stable().min_by(|a, b| a.0.total_cmp(&b.0)) {
        Some((error, point)) => format!("no: x{} {error:.1e}", point.substeps),
        None => "unstable".to_owned(),
    }
}

/// "1.98 2.00", with "!" where the order is reduced.
fn orders(points: &[&ArmPoint]) -> String {
    let order = |p: &&ArmPoint| {
        let mark = if p.order_reduced { "!" } else { "" };
        p.observed_order.map(|order| format!("{order:.1}{mark}"))
    };
    let orders: Vec<String> = points.iter().filter_map(order).collect();
    orders.join(" ")
}

fn stability(limits: &[StabilityLimit]) -> Table {
    let cells = limits.iter().map(|limit| {
        let shown = limit.limit_omega_h.map(|limit| format!("{limit:.4}"));
        let shown = shown.unwrap_or("always".to_owned());
        [
            limit.method.to_owned(),
            format!("zeta={}", limit.damping_ratio),
            shown,
        ]
    });
    let critical = limits.iter().filter(|limit| limit.damping_ratio == 1.0);
    let left = critical.map(|limit| {
        let share = limit.stiffest_left_per_step;
        let unstable = if share.abs() > 1.0 { ", unstable" } else { "" };
        let head = "left per step at 16.7, zeta=1".to_owned();
        [
            limit.method.to_owned(),
            head,
            format!("{share:.1e}{unstable}"),
        ]
    });
    Table::grid("stable while omega h <", cells.chain(left))
}

/// The method of each arm; with `all` the reasons too.
fn choices(report: &ArmReport, all: bool) -> Table {
    let columns: [Column<&ArmChoice>; 5] = [
        ("", |c| {
            let setting = &c.setting;
            let (arm, k, rate) = (setting.arm.name(), setting.stiffness, setting.rate_hz);
            format!("{arm} k={k:e}, {rate} Hz")
        }),
        ("method", |c| {
            c.choice.name.clone().unwrap_or("nothing".into())
        }),
        (">error", |c| {
            some(c.position_error, |error| format!("{error:.1e}"))
        }),
        (">time per s", |c| {
            some(c.us_per_second, |us| text::time(us * 1e3))
        }),
        ("why", |c| c.choice.reason.clone()),
    ];
    let shown = if all { columns.len() } else { 4 };
    let mut table = Table::with(&report.choices, &columns[..shown]);
    table.header[0] = format!("to take within {:e}", report.tolerance);
    table
}

/// Time and error, if the point has both.
fn at(point: &ArmPoint) -> Option<[f64; 2]> {
    // A logarithmic axis has no zero.
    let at = [
        point.us_per_second?.value * 1e3,
        point.position_error?.max(1e-16),
    ];
    at.iter().all(|value| is_drawn(*value)).then_some(at)
}

pub fn arm_figures(report: &ArmReport) -> Vec<Figure> {
    let places = || report.points.iter().filter_map(at);
    let settings = report.points.chunk_by(|a, b| a.setting == b.setting);
    let figure = |points: &[ArmPoint]| {
        let setting = points[0].setting;
        let (arm, k, rate) = (setting.arm.name(), setting.stiffness, setting.rate_hz);
        let methods = points.chunk_by(|a, b| a.method == b.method);
        let series = methods.map(|own| {
            let nth = report.methods.iter().position(|m| m.name == own[0].method);
            let point = |point: &ArmPoint| {
                let wide = point.us_per_second.and_then(|us| us.lower.zip(us.upper));
                let wide = wide.map(|(low, high)| [low * 1e3, high * 1e3]);
                Some(Point {
                    at: at(point)?,
                    wide,
                    note: format!("{}, {} steps per frame", point.method, point.substeps),
                    ..Point::default()
                })
            };
            Series {
                name: own[0].method.to_owned(),
                look: Look::nth(nth.unwrap_or(0)),
                is_scan: false,
                points: own.iter().filter_map(point).collect(),
            }
        });
        let error = |error: f64| format!("{error:.0e}");
        let title = "CPU time per simulated second";
        let caption = format!("{arm} arm, k = {k:e}/s2, {rate} Hz: position error against time");
        let axes = [
            Axis::log(title, places().map(|p| p[0]), 1.2, &text::time),
            Axis::log("", places().map(|p| p[1]), 2.0, &error),
        ];
        let series = series.filter(|series| !series.points.is_empty()).collect();
        Diagram::of(caption, axes, Joined::Marked, series).draw()
    };
    settings.map(figure).collect()
}

/// All as one picture: a row per arm and stiffness, a column per rate.
pub fn draw(report: &ArmReport) -> String {
    let mut rates: Vec<f64> = report.points.iter().map(|p| p.setting.rate_hz).collect();
    rates.sort_by(f64::total_cmp);
    rates.dedup();
    picture(&arm_figures(report), rates.len().max(1))
}
