//! `cullbench drift`: errors and costs of camera bases and spring arms.
//!
//! Tables, and recommendations.

use super::args::DriftArgs;
use super::diagram::{Diagram, Joined, Point, Series};
use super::document::{Block, Column, Table, show};
use super::figure::{Axis, Figure, Look, ends, is_drawn, picture};
use super::page::to_page;
use super::processes::Timing;
use super::study::{ROUNDS, Study};
use super::text::{self, some, time_plus_minus};
use super::{Ending, expect_places, print, write_if};
use crate::drift::{
    self, ARM_TOLERANCE, ArmKind, ArmPoint, DriftReport, RATE_HZ, Rotation, SECONDS, STEADY,
    Stability,
};
use crate::measure::ProcessTimes;

pub fn drift(args: &DriftArgs) -> anyhow::Result<Ending> {
    let outputs = [("--svg", &args.svg), ("--html", &args.html)];
    expect_places(&outputs, &[""; 0])?;
    let study = Study::new(String::new(), 0, &args.spread)?;
    let work = format!("{:e} steps, arms over {SECONDS} s", args.steps as f64);
    study.announce(&work, "about half a minute");
    study.begin("all errors");
    let mut report = drift::prepare(args.steps);
    let schedule = drift::plan(&args.spread.protocol(ROUNDS, 0));
    let times = study.times("everything, timed", None, &schedule)?;
    report.conclude(&times, schedule.rounds);
    print(args.format, &report, || show(&blocks(&report, args.all)))?;
    // A row per arm, a column per stiffness.
    let columns = report.arm_choices.len() / ArmKind::ALL.len();
    write_if(&args.svg, || picture(&arm_figures(&report), columns))?;
    write_if(&args.html, || {
        let (told, figures) = (conclusions(&report), arm_figures(&report));
        to_page("drift", told, figures, tables(&report, true))
    })?;
    Ok(Ending::Ok)
}

/// Times everything in one process.
pub fn time(args: &DriftArgs, timing: &Timing) -> anyhow::Result<ProcessTimes> {
    let protocol = args.spread.protocol(ROUNDS, timing.process);
    Ok(drift::time(&timing.plan()?, &protocol))
}

/// Tables and recommendations.
fn blocks(report: &DriftReport, all: bool) -> Vec<Block> {
    let mut blocks = tables(report, all);
    blocks.push(Block::heading("Conclusions:"));
    blocks.extend(conclusions(report));
    let more = "what methods do, limits of stability: --all";
    blocks.extend(Block::more(all, more));
    blocks
}

/// The tables; with `all` also a line about each method and limits of stability.
fn tables(report: &DriftReport, all: bool) -> Vec<Block> {
    let [yaw, pitch, roll] = STEADY;
    let (steps, rounds) = (report.steps as f64, text::counted(report.rounds, "round"));
    let over = text::over(report.processes, None);
    let tried = text::joined(drift::SUBSTEPS.map(|n| n.to_string()));
    let starts = text::joined(drift::STARTS.map(|share| share.to_string()));
    let mut blocks = vec![
        Block::line(format!(
            "Camera updates, bases after {steps:e} steps; {over}; {rounds} in each."
        )),
        Block::heading(format!(
            "Camera bases turned by yaw {yaw}, pitch {pitch} and roll {roll} degrees per step"
        )),
        Block::Table(bases(report, all)),
        Block::heading(format!(
            "Spring arms, critically damped, {RATE_HZ} frames a second"
        )),
        Block::line(format!(
            "The target is known where frames end. xN: N steps per frame ({tried} are tried), then \
             the largest error at the end of a frame in {SECONDS} s, started {starts} from zero, \
             and the thread CPU time per simulated second; no: even the least error of these is \
             larger."
        )),
        Block::Table(by_stiffness(report)),
    ];
    blocks.extend(all.then(|| Block::Table(methods(report))));
    blocks
}

/// Rotation methods with errors and time; with `all` a line about each.
fn bases(report: &DriftReport, all: bool) -> Table {
    let columns: [Column<&Rotation>; 5] = [
        ("method", |r| r.method.name.to_owned()),
        (">orthogonality", |r| {
            format!("{:.1e}", r.orthogonality_error)
        }),
        (">angle (rad)", |r| format!("{:.1e}", r.angle_error_rad)),
        (">time per step", |r| time_plus_minus(r.time_per_step)),
        ("description", |r| r.method.summary.to_owned()),
    ];
    let shown = if all { columns.len() } else { 4 };
    Table::with(&report.rotation, &columns[..shown])
}

/// The recommended rotation, and the method for each stiffness of each arm.
fn conclusions(report: &DriftReport) -> impl Iterator<Item = Block> {
    let base = ("camera basis".to_owned(), &report.recommended_rotation);
    let arms = report.arm_choices.iter().map(|choice| {
        let (arm, k) = (choice.setting.arm.name(), choice.setting.stiffness);
        (format!("{arm} arm, k={k:e}"), &choice.choice)
    });
    [base].into_iter().chain(arms).map(|(what, choice)| {
        let (name, why) = (choice.name.as_deref().unwrap_or("nothing"), &choice.reason);
        Block::Line(format!("Recommended for a {what}: {name}, {why}."))
    })
}

/// A row per method, a column per arm and stiffness.
fn by_stiffness(report: &DriftReport) -> Table {
    let is_same = |a: &ArmPoint, b: &ArmPoint| (a.setting, a.method) == (b.setting, b.method);
    let cells = report.arm_points.chunk_by(is_same).map(|own| {
        let (arm, k) = (own[0].setting.arm.name(), own[0].setting.stiffness);
        let setting = format!("{arm}, k={k:e}");
        [own[0].method.to_owned(), setting, within(own)]
    });
    Table::grid(&format!("within {ARM_TOLERANCE:e}"), cells)
}

/// The fewest precise steps tried, else the most precise: "x4: 1.2e-4, 3.21 us".
fn within(points: &[ArmPoint]) -> String {
    let is_good = |p: &&ArmPoint| p.position_error <= ARM_TOLERANCE;
    let sound = points.iter().filter(|p| !p.position_error.is_nan());
    let nearest = sound.min_by(|a, b| a.position_error.total_cmp(&b.position_error));
    let Some(p) = points.iter().find(is_good).or(nearest) else {
        return "unstable".to_owned();
    };
    let no = if is_good(&p) { "" } else { "no: " };
    let time = some(p.us_per_second, |us| text::time(us.value * 1e3));
    format!("{no}x{}: {:.1e}, {time}", p.substeps, p.position_error)
}

/// Methods of arms: description, classical orders, limits of stability.
fn methods(report: &DriftReport) -> Table {
    let columns: [Column<&Stability>; 4] = [
        ("method", |m| m.method.name.to_owned()),
        (">classical order", |m| m.method.order.to_string()),
        (">stable while omega h <", |m| match m.limit_omega_h {
            Some(limit) => format!("{limit:.4}"),
            None => "always".to_owned(),
        }),
        ("description", |m| m.method.summary.to_owned()),
    ];
    Table::with(&report.arm_methods, &columns)
}

/// Time and error of a point, if it has both.
fn place(point: &ArmPoint) -> Option<Point> {
    let time = point.us_per_second?.per(1e-3);
    let at = [time.value, point.position_error];
    at.iter().all(|value| is_drawn(*value)).then(|| Point {
        at,
        wide: ends(time),
        note: format!("{}, {} steps per frame", point.method, point.substeps),
        ..Point::default()
    })
}

/// Error against time, a figure per arm and stiffness.
fn arm_figures(report: &DriftReport) -> Vec<Figure> {
    let places = || report.arm_points.iter().filter_map(place).map(|p| p.at);
    let settings = (report.arm_points).chunk_by(|a, b| a.setting == b.setting);
    let figure = |points: &[ArmPoint]| {
        let methods = points.chunk_by(|a, b| a.method == b.method);
        let series = methods.enumerate().map(|(n, own)| Series {
            look: Look::nth(n),
            ..Series::of(own[0].method, false, own.iter().filter_map(place).collect())
        });
        let (arm, k) = (points[0].setting.arm.name(), points[0].setting.stiffness);
        let caption = format!("{arm} arm, k = {k:e}/s2, {RATE_HZ} Hz: position error against time");
        let error = |error: f64| format!("{error:.0e}");
        let title = "CPU time per simulated second";
        let axes = [
            Axis::log(title, places().map(|p| p[0]), 1.2, &text::time),
            Axis::log("", places().map(|p| p[1]), 2.0, &error),
        ];
        let series = series.filter(|series| !series.points.is_empty()).collect();
        Diagram::of(caption, axes, Joined::Marked, series).draw()
    };
    settings.map(figure).collect()
}
