//! Spring arms in `cullbench drift`: tables of the steps that each method takes to
//! be precise enough, its observed order, its limit of stability, and which one to
//! take. Errors and orders are shown at one frame rate; the JSON
//! has all.

use std::collections::BTreeMap;

use super::diagram::{Diagram, Joined, Point, Series};
use super::document::Block;
use super::figure::{Axis, Figure, Look, is_drawn, picture};
use super::table::{Column, Table};
use super::text::{self, some};
use crate::drift::{ARMS, ArmChoice, ArmKind, ArmPoint, ArmReport, StabilityLimit};

/// Method of each arm; with `all` errors, orders and limits of stability as well.
pub fn blocks(report: &ArmReport, all: bool) -> Vec<Block> {
    let heading = "Spring arms, critically damped, behind a moving target";
    let mut blocks = vec![
        Block::Heading(2, heading.to_owned()),
        Block::Line(format!(
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
        blocks.push(Block::Line(
            "Orders are the powers of the step by which a method's own error falls from each \
             number of steps to the next; ! is half a power or more below the classical order: \
             steps are not far below 1/omega, or the arm meets the stop."
                .to_owned(),
        ));
        blocks.push(Block::Table(stability(&report.stability)));
    }
    blocks.push(Block::Table(choices(report, all)));
    blocks
}

/// Methods to take, each with the number of settings it is the choice of.
pub fn conclusions(report: &ArmReport) -> impl Iterator<Item = String> {
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
    let settings: Vec<_> = points.collect();
    let settings: Vec<_> = settings.chunk_by(|a, b| a.setting == b.setting).collect();
    let stiffness = |own: &&[&ArmPoint]| format!("k={:e}", own[0].setting.stiffness);
    let columns = settings.iter().map(stiffness);
    let mut table = Table::new([title.to_owned()].into_iter().chain(columns), &[]);
    for method in report.methods {
        let cells = settings.iter().map(|all| {
            let own = all.iter().copied().filter(|p| p.method == method.name);
            cell(&own.collect::<Vec<_>>())
        });
        table.add_row([method.name.to_owned()].into_iter().chain(cells));
    }
    table
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
    let methods: Vec<_> = limits.chunk_by(|a, b| a.method == b.method).collect();
    let ratios = methods.iter().take(1).flat_map(|own| own.iter());
    let ratios = ratios.map(|limit| format!("zeta={}", limit.damping_ratio));
    let first = ["stable while omega h <".to_owned()].into_iter();
    let left = ["left per step at 16.7, zeta=1".to_owned()];
    let mut table = Table::of_numbers(first.chain(ratios).chain(left));
    for own in methods {
        let limit = |limit: &StabilityLimit| match limit.limit_omega_h {
            Some(limit) => format!("{limit:.4}"),
            None => "always".to_owned(),
        };
        let critical = own.iter().find(|limit| limit.damping_ratio == 1.0);
        let left = critical.map(|limit| match limit.stiffest_left_per_step {
            share if share.abs() > 1.0 => format!("{share:.1e}, unstable"),
            share => format!("{share:.1e}"),
        });
        let first = [own[0].method.to_owned()].into_iter();
        table.add_row(first.chain(own.iter().map(limit)).chain(left));
    }
    table
}

/// The method of each arm; with `all` the reasons too.
fn choices(report: &ArmReport, all: bool) -> Table {
    let columns: [Column<&ArmChoice>; 5] = [
        ("", |choice| {
            let setting = &choice.setting;
            let (arm, k, rate) = (setting.arm.name(), setting.stiffness, setting.rate_hz);
            format!("{arm} k={k:e}, {rate} Hz")
        }),
        ("method", |choice| {
            choice.choice.name.clone().unwrap_or("nothing".into())
        }),
        (">error", |choice| {
            some(choice.position_error, |error| format!("{error:.1e}"))
        }),
        (">time per s", |choice| {
            some(choice.us_per_second, |us| text::time(us * 1e3))
        }),
        ("why", |choice| choice.choice.reason.clone()),
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

pub fn figures(report: &ArmReport) -> Vec<Figure> {
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
    picture(&figures(report), rates.len().max(1))
}
