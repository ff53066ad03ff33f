//! `cullbench drift`: tables of the errors of camera bases and spring arms, of the
//! cost of a step of each, and recommendations.

use anyhow::ensure;

use super::args::DriftArgs;
use super::diagram::{Diagram, Joined, Point, Series};
use super::document::{Block, show};
use super::figure::{Axis, Figure, Look, is_drawn, picture};
use super::page::to_page;
use super::processes::Timing;
use super::study::{ROUNDS, Study};
use super::table::{Column, Table};
use super::text::{self, some, time_plus_minus};
use super::{Ending, expect_places, print, write_if};
use crate::drift::{
    self, ARMS, ArmChoice, ArmKind, ArmPoint, ArmReport, DriftReport, ORBIT_RADIUS, Rated,
    Recommendation, RotationDrift, StabilityLimit,
};
use crate::measure::ProcessTimes;
use crate::report::grouped;

/// Most steps of the reference behind one arm: about a minute.
const MOST_STEPS: f64 = 1e9;

pub fn drift(args: &DriftArgs) -> anyhow::Result<Ending> {
    let outputs = [("--svg", &args.svg), ("--html", &args.html)];
    expect_places(&outputs, &[""; 0])?;
    let options = &args.options;
    let arms = &options.arms;
    let stiffest = arms.stiffness.iter().copied().fold(0.0, f64::max);
    let reference = drift::reference_steps(stiffest, arms.seconds);
    ensure!(
        reference <= MOST_STEPS,
        "--stiffness {stiffest:e} over --seconds {}: {reference:.0e} steps of the reference; \
         expected at most {MOST_STEPS:e}",
        arms.seconds
    );
    let jobs = drift::jobs(options);
    let study = Study::new(String::new(), jobs as u64, &args.spread)?;
    let (steps, seconds) = (options.steps as f64, arms.seconds);
    let work = text::counted(jobs, "study");
    let work = format!("{work}, up to {steps:e} steps or {seconds} s each");
    study.announce(&work, "about half a minute");
    let mut report = drift::prepare(options, |job| {
        study.begin(job);
        study.advance();
    });
    let schedule = drift::plan(options, &args.spread.protocol(ROUNDS, 0));
    let times = study.times("everything, timed", None, &schedule)?;
    report.conclude(&times, schedule.rounds);
    print(args.format, &report, || show(&blocks(&report, args.all)))?;
    write_if(&args.svg, || draw(&report.arm))?;
    write_if(&args.html, || {
        let (told, figures) = (conclusions(&report), arm_figures(&report.arm));
        to_page("drift", told, figures, tables(&report, true))
    })?;
    Ok(Ending::Ok)
}

/// Times everything in one process.
pub fn time(args: &DriftArgs, timing: &Timing) -> anyhow::Result<ProcessTimes> {
    let protocol = args.spread.protocol(ROUNDS, timing.process);
    Ok(drift::time(&args.options, &timing.plan()?, &protocol))
}

/// A number of steps.
fn steps(count: u64) -> String {
    match count < 1000 {
        true => count.to_string(),
        false => format!("{:e}", count as f64),
    }
}

/// Two digits of something that spans many powers of ten.
fn scientific(value: f64) -> String {
    match value.is_nan() {
        true => "lost".to_owned(),
        false => format!("{value:.1e}"),
    }
}

/// Tables and recommendations.
fn blocks(report: &DriftReport, all: bool) -> Vec<Block> {
    let mut blocks = tables(report, all);
    blocks.push(Block::heading("Conclusions:"));
    blocks.extend(conclusions(report));
    let more = "errors by number of steps, orders, stability: --all";
    blocks.extend(Block::more(all, more));
    blocks
}

/// The tables; with `all` the errors after each number of steps too.
fn tables(report: &DriftReport, all: bool) -> Vec<Block> {
    let [yaw, pitch, roll] = report.turn_per_step;
    let (steps, rounds) = (steps(report.steps), text::counted(report.rounds, "round"));
    let unit = ["steps", "step"][usize::from(report.steps == 1)];
    let over = text::over(report.processes, None);
    let mut blocks = vec![
        Block::line(format!(
            "Camera updates after {steps} {unit}; {over}; {rounds} in each."
        )),
        Block::heading(format!(
            "Camera bases turned by yaw {yaw}, pitch {pitch} and roll {roll} degrees per step"
        )),
    ];
    if all {
        blocks.extend(rotations(report));
    }
    blocks.push(Block::Table(rated(report, all)));
    blocks.extend(arm_blocks(&report.arm, all));
    blocks
}

/// Title of a table of errors, and its cell.
type Errors = (&'static str, fn(&RotationDrift) -> f64);

/// Errors of bases: a row per method, a column per number of steps.
fn rotations(report: &DriftReport) -> Vec<Block> {
    let note = format!(
        "Each figure is the largest of the {} steps that end there, a period between two \
         corrections. The orbit has radius {ORBIT_RADIUS}; the eye hangs on the base.",
        report.period_steps
    );
    let figures: [Errors; 4] = [
        ("orthogonality after", |d| d.orthogonality_error),
        ("angular error in rad after", |d| d.angle_error_rad),
        ("orbit position error after", |d| d.orbit_position_error),
        ("orbit radius error after", |d| d.orbit_radius_error),
    ];
    let grid = |(title, error): Errors| {
        let drifts = report.rotation.iter();
        let cell = |d: &RotationDrift| [d.method.into(), steps(d.steps), scientific(error(d))];
        Block::Table(Table::grid(title, drifts.map(cell)))
    };
    let by_turns = report.one_degree_turns.iter().map(|d| {
        let turns = text::counted(d.turns as usize, "turn");
        [d.method.into(), turns, format!("{:.3e}", d.angle_error_rad)]
    });
    let by_turns = Table::grid("by 1 degree per step: error in rad after", by_turns);
    let mut blocks = vec![Block::Line(note)];
    blocks.extend(figures.map(grid));
    blocks.push(Block::Table(by_turns));
    blocks
}

/// Methods with error and time; with `all` a line about each.
fn rated(report: &DriftReport, all: bool) -> Table {
    let columns: [Column<&Rated>; 5] = [
        ("method", |r| {
            let default = if r.is_default { " (default)" } else { "" };
            format!("{}{default}", r.name)
        }),
        (">error", |r| scientific(r.error)),
        (">time per step", |r| time_plus_minus(r.time_per_step)),
        ("", |r| if r.qualifies { "yes" } else { "no" }.to_owned()),
        ("description", |r| r.summary.to_owned()),
    ];
    let shown = if all { columns.len() } else { 4 };
    let mut table = Table::with(&report.rotation_methods, &columns[..shown]);
    table.header[3] = format!("within {:e}", report.tolerance_rad);
    table
}

fn chosen(choice: &Recommendation) -> &str {
    choice.name.as_deref().unwrap_or("nothing")
}

/// The recommended way to turn, with its figures.
fn recommended(report: &DriftReport) -> String {
    let choice = &report.recommended_rotation;
    let name = chosen(choice);
    let mut methods = report.rotation_methods.iter();
    let figures = some(methods.find(|row| row.name == name), |row| {
        let time = time_plus_minus(row.time_per_step);
        format!(" ({time} per step, error {})", scientific(row.error))
    });
    let reason = &choice.reason;
    format!("Recommended for a camera base: {name}{figures}, {reason}.")
}

/// Method of each arm; with `all` errors, orders and limits of stability as well.
fn arm_blocks(report: &ArmReport, all: bool) -> Vec<Block> {
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
            let title = format!("{name}, within {:e}", report.tolerance);
            let cell = |own: &[&ArmPoint]| within(own, report.tolerance);
            blocks.push(Block::Table(by_stiffness(report, arm, &title, cell)));
            let title = format!("{name}, observed order");
            blocks.push(Block::Table(by_stiffness(report, arm, &title, orders)));
        }
    }
    if all {
        blocks.push(Block::line(
            "xN: N steps per frame, then the error and the time; no: even the least error is larger. \
             Orders are the powers of the step by which a method's own error falls from each \
             number of steps to the next. They are not the classical ones where steps are not far \
             below 1/omega, and where the arm meets the stop.",
        ));
        blocks.push(Block::Table(stability(&report.stability)));
    }
    blocks.push(Block::Table(choices(report, all)));
    blocks
}

/// The way to turn, and the method to take for each stiffness of each arm.
fn conclusions(report: &DriftReport) -> impl Iterator<Item = Block> {
    let choices = report.arm.choices.iter();
    let arms = grouped(choices.map(|c| (c.setting.arm.name(), c))).into_iter();
    let of_arms = arms.map(|(arm, own)| {
        let each = own.iter();
        let each = each.map(|c| format!("{} at k={:e}", chosen(&c.choice), c.setting.stiffness));
        let (each, within) = (text::joined(each), report.arm.tolerance);
        let what = match own.iter().any(|c| c.choice.name.is_some()) {
            true => "the cheapest with",
            false => "no method has",
        };
        format!("Recommended for a {arm} arm: {each}, {what} an error within {within:e}.")
    });
    let told = [recommended(report)].into_iter().chain(of_arms);
    told.map(Block::Line)
}

/// A table of an arm: a row per method, a column per stiffness.
fn by_stiffness(
    report: &ArmReport,
    arm: ArmKind,
    title: &str,
    cell: impl Fn(&[&ArmPoint]) -> String,
) -> Table {
    let points = report.points.iter().filter(|p| p.setting.arm == arm);
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
    let error = |point: &&&ArmPoint| point.position_error;
    let time = |point: &ArmPoint| point.us_per_second.map_or(f64::INFINITY, |us| us.value);
    let good = points.iter().filter(|p| error(p) <= tolerance);
    let best = good.min_by(|a, b| time(a).total_cmp(&time(b)));
    let sound = points.iter().filter(|p| !error(p).is_nan());
    match (best, sound.min_by(|a, b| error(a).total_cmp(&error(b)))) {
        (Some(p), _) => {
            let time = some(p.us_per_second, |us| text::time(us.value * 1e3));
            format!("x{}: {:.1e}, {time}", p.substeps, p.position_error)
        }
        (None, Some(p)) => format!("no: x{} {:.1e}", p.substeps, p.position_error),
        (None, None) => "unstable".to_owned(),
    }
}

/// "1.98 2.00".
fn orders(points: &[&ArmPoint]) -> String {
    let orders = points.iter().filter_map(|p| p.observed_order);
    let orders: Vec<String> = orders.map(|order| format!("{order:.1}")).collect();
    orders.join(" ")
}

fn stability(limits: &[StabilityLimit]) -> Table {
    let cells = limits.iter().map(|limit| {
        let shown = limit.limit_omega_h.map(|limit| format!("{limit:.4}"));
        let shown = shown.unwrap_or("always".to_owned());
        let damping = format!("zeta={}", limit.damping_ratio);
        [limit.method.to_owned(), damping, shown]
    });
    Table::grid("stable while omega h <", cells)
}

/// The method of each arm; with `all` the reasons too.
fn choices(report: &ArmReport, all: bool) -> Table {
    let columns: [Column<&ArmChoice>; 5] = [
        ("", |c| {
            let setting = &c.setting;
            let (arm, k, rate) = (setting.arm.name(), setting.stiffness, setting.rate_hz);
            format!("{arm} k={k:e}, {rate} Hz")
        }),
        ("method", |c| chosen(&c.choice).to_owned()),
        (">error", |c| some(c.position_error, scientific)),
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
    let at = [point.us_per_second?.value * 1e3, point.position_error];
    at.iter().all(|value| is_drawn(*value)).then_some(at)
}

fn arm_figures(report: &ArmReport) -> Vec<Figure> {
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

/// All as one picture: a row per arm, a column per stiffness.
fn draw(report: &ArmReport) -> String {
    let mut arms = (report.choices).chunk_by(|a, b| a.setting.arm == b.setting.arm);
    picture(&arm_figures(report), arms.next().map_or(1, <[_]>::len))
}
