//! The tables of `cullbench drift` about spring arms: what each method takes to be
//! precise enough, at which order it converges, what jitter and f32 cost, and what
//! follows. They show one frame rate; the JSON has all.

use std::io::{self, Write};

use super::table::Table;
use super::text;
use crate::drift::{ARMS, ArmKind, ArmPoint, ArmReport, FrameTimes, Information, StabilityLimit};

/// No table is wider.
const WIDTH: u16 = 100;

/// Equal steps per frame in the table that compares kinds of frames.
const COMPARED_STEPS: u32 = 4;

pub fn show(report: &ArmReport, out: &mut impl Write) -> io::Result<()> {
    let shown = Shown::new(report);
    writeln!(
        out,
        "Spring arms: critically damped; errors are the largest at the end of a frame in {} s,\n\
         times are thread CPU time per simulated second. Jittered frames vary by 30 % and every\n\
         fiftieth takes four times as long. Methods know the target where frames end, and\n\
         *-midpoints also in the middle.",
        report.seconds
    )?;
    writeln!(out, "{}", shown.information())?;
    for (arm, name, what) in shown.arms() {
        writeln!(
            out,
            "{}",
            text::wrapped(&format!("{name} arm: {what}"), WIDTH.into())
        )?;
        writeln!(out, "{}", shown.within(arm, name))?;
    }
    writeln!(out, "{}", shown.orders())?;
    writeln!(
        out,
        "Powers of the step by which a method's own error falls from each number of steps to the\n\
         next, steady frames: ! is order reduction, half a power or more below the classical order,\n\
         where steps are not far below 1/omega or, for the collision arm, meet the stop."
    )?;
    writeln!(out, "{}", shown.costs())?;
    writeln!(out, "{}", stability(&report.stability))?;
    writeln!(
        out,
        "Growth is the most that the energy norm of an error reaches before it falls (transient\n\
         growth, zeta = 1, omega h up to 0.9 of the limit or 100): above 1 a step that is stable\n\
         in the end is not on the way."
    )?;
    writeln!(out, "{}", shown.choices())?;
    writeln!(out, "{}", text::wrapped(&report.conclusion, WIDTH.into()))
}

/// What the tables show: all stiffnesses, the rate in the middle.
struct Shown<'r> {
    report: &'r ArmReport,
    stiffnesses: Vec<f64>,
    rates: Vec<f64>,
    rate: f64,
}

impl<'r> Shown<'r> {
    fn new(report: &'r ArmReport) -> Self {
        Shown {
            report,
            stiffnesses: report.settings(|setting| setting.stiffness),
            rates: report.settings(|setting| setting.rate_hz),
            rate: report.middle_rate_hz().unwrap_or(f64::NAN),
        }
    }

    /// Those that were studied.
    fn arms(&self) -> impl Iterator<Item = (ArmKind, &'static str, &'static str)> {
        let is_there = |arm| self.report.choices.iter().any(|c| c.setting.arm == arm);
        ARMS.into_iter().filter(move |(arm, ..)| is_there(*arm))
    }

    /// The points of a method on an arm at the rate that is shown, in f64.
    fn points(
        &self,
        arm: ArmKind,
        stiffness: f64,
        times: FrameTimes,
    ) -> impl Iterator<Item = &'r ArmPoint> {
        let rate = self.rate;
        self.report.points.iter().filter(move |point| {
            let setting = &point.setting;
            (setting.arm, setting.stiffness, setting.rate_hz) == (arm, stiffness, rate)
                && point.frame_times == times
        })
    }

    fn by_stiffness(&self, corner: &str, first: &str) -> Table {
        let mut header = vec![corner.to_owned()];
        if !first.is_empty() {
            header.push(first.to_owned());
        }
        header.extend(self.stiffnesses.iter().map(|k| format!("k={k:e}")));
        Table::new(header, &[]).fit(WIDTH)
    }

    fn information(&self) -> Table {
        let mut header = vec!["error of what is told".to_owned()];
        header.extend(self.rates.iter().map(|rate| format!("{rate} Hz")));
        let mut table = Table::new(header, &[1, 2, 3]);
        let jittered = || {
            let all = self.report.information.iter();
            all.filter(|told| told.frame_times == FrameTimes::Jittered)
        };
        for (arm, name, _) in self.arms() {
            for &stiffness in &self.stiffnesses {
                for information in Information::ALL {
                    let row = jittered().filter(|told| {
                        (told.setting.arm, told.setting.stiffness, told.information)
                            == (arm, stiffness, information)
                    });
                    let errors = row.map(|told| format!("{:.1e}", told.position_error));
                    let first = format!("{name} k={stiffness:e}, {}", information.name());
                    table.add_row([first].into_iter().chain(errors));
                }
            }
        }
        table
    }

    /// The cheapest effort of each method that is precise enough.
    fn within(&self, arm: ArmKind, name: &str) -> Table {
        let corner = format!(
            "{name}, {} Hz, f64, within {:e}",
            self.rate, self.report.tolerance
        );
        let mut table = self.by_stiffness(&corner, "");
        for method in self.report.method_names() {
            let cells = self.stiffnesses.iter().map(|&stiffness| {
                let points = self.points(arm, stiffness, FrameTimes::Jittered);
                let own = points.filter(|p| p.method == method && p.arithmetic == "f64");
                within(&own.collect::<Vec<_>>(), self.report.tolerance)
            });
            table.add_row([method.to_owned()].into_iter().chain(cells));
        }
        table
    }

    fn orders(&self) -> Table {
        let mut table = self.by_stiffness("observed order", "arm");
        for method in self.report.method_names() {
            for (arm, name, _) in self.arms() {
                let cells: Vec<String> = self
                    .stiffnesses
                    .iter()
                    .map(|&stiffness| {
                        let points = self.points(arm, stiffness, FrameTimes::Steady);
                        let own = points.filter(|p| p.method == method);
                        let orders: Vec<String> = own.filter_map(order).collect();
                        orders.join(" ")
                    })
                    .collect();
                if cells.iter().any(|cell| !cell.is_empty()) {
                    table.add_row(
                        [method.to_owned(), name.to_owned()]
                            .into_iter()
                            .chain(cells),
                    );
                }
            }
        }
        table
    }

    /// What jitter and f32 cost at the stiffness in the middle.
    fn costs(&self) -> Table {
        let middle = self.stiffnesses.get(self.stiffnesses.len() / 2);
        let stiffness = middle.copied().unwrap_or(f64::NAN);
        let corner = format!(
            "k={stiffness:e}, {} Hz, {COMPARED_STEPS} steps per frame",
            self.rate
        );
        let columns = ["arm", "steady", "jittered", "in f32", "velocity"];
        let header = [corner.as_str()].into_iter().chain(columns);
        let mut table = Table::new(header, &[2, 3, 4, 5]);
        for method in self
            .report
            .method_names()
            .into_iter()
            .filter(|m| !m.ends_with("-midpoints"))
        {
            for (arm, name, _) in self.arms() {
                let find = |times, arithmetic| {
                    let points = self.points(arm, stiffness, times);
                    let own = points.filter(|p| p.method == method && p.arithmetic == arithmetic);
                    let mut own: Vec<_> = own.filter(|p| p.substeps.is_some()).collect();
                    // An exact method has one step alone.
                    own.sort_by_key(|p| p.substeps != Some(COMPARED_STEPS));
                    own.first().copied()
                };
                let steady = find(FrameTimes::Steady, "f64");
                let jittered = find(FrameTimes::Jittered, "f64");
                let single = find(FrameTimes::Jittered, "f32");
                if jittered.is_none() {
                    continue;
                }
                table.add_row([
                    method.to_owned(),
                    name.to_owned(),
                    error(steady.and_then(|p| p.position_error)),
                    error(jittered.and_then(|p| p.position_error)),
                    error(single.and_then(|p| p.position_error)),
                    error(jittered.and_then(|p| p.velocity_error)),
                ]);
            }
        }
        table
    }

    fn choices(&self) -> Table {
        let mut header = vec![format!("to take within {:e}", self.report.tolerance)];
        header.extend(self.rates.iter().map(|rate| format!("{rate} Hz")));
        let mut table = Table::new(header, &[]).fit(WIDTH);
        for (arm, name, _) in self.arms() {
            for &stiffness in &self.stiffnesses {
                let choices = self.report.choices.iter();
                let row = choices.filter(|choice| {
                    (choice.setting.arm, choice.setting.stiffness) == (arm, stiffness)
                });
                let cells = row.map(|choice| match (&choice.name, choice.us_per_second) {
                    (Some(name), Some(us)) => {
                        let at_limit = if choice.at_limit {
                            ", at the limit"
                        } else {
                            ""
                        };
                        format!("{name}, {}{at_limit}", text::time(us * 1e3))
                    }
                    _ => choice.reason.clone(),
                });
                table.add_row([format!("{name} k={stiffness:e}")].into_iter().chain(cells));
            }
        }
        table
    }
}

fn error(error: Option<f64>) -> String {
    error.map_or("unstable".to_owned(), |error| format!("{error:.1e}"))
}

/// "x4: 1.2e-4, 3.21 us", or what comes nearest.
fn within(points: &[&ArmPoint], tolerance: f64) -> String {
    let by = |point: &ArmPoint| match (point.substeps, point.step_tolerance) {
        (Some(substeps), _) => format!("x{substeps}"),
        (_, Some(tolerance)) => format!("{tolerance:e}"),
        _ => String::new(),
    };
    let time = |point: &ArmPoint| point.us_per_second.unwrap_or(f64::INFINITY);
    let good = points
        .iter()
        .filter(|p| p.position_error.is_some_and(|e| e <= tolerance));
    let cheapest = good.min_by(|a, b| time(a).total_cmp(&time(b)));
    if let Some(point) = cheapest {
        let time = point.us_per_second.map(|us| text::time(us * 1e3));
        return format!(
            "{}: {}, {}",
            by(point),
            error(point.position_error),
            time.unwrap_or_default()
        );
    }
    let stable = points.iter().filter_map(|p| Some((p.position_error?, *p)));
    match stable.min_by(|a, b| a.0.total_cmp(&b.0)) {
        Some((_, point)) => format!("no: {} {}", by(point), error(point.position_error)),
        None => "unstable".to_owned(),
    }
}

/// "1.98", or "0.40!" where the order is reduced.
fn order(point: &ArmPoint) -> Option<String> {
    let mark = if point.order_reduced { "!" } else { "" };
    point
        .observed_order
        .map(|order| format!("{order:.1}{mark}"))
}

fn stability(limits: &[StabilityLimit]) -> Table {
    let first = limits.first().map(|limit| limit.method);
    let of_first = limits.iter().filter(|limit| Some(limit.method) == first);
    let mut header = vec!["stable while omega h <".to_owned()];
    header.extend(of_first.map(|limit| format!("zeta={}", limit.damping_ratio)));
    header.push("left per step at 16.7".to_owned());
    header.push("growth, at omega h".to_owned());
    let mut table = Table::of_numbers(header).fit(WIDTH);
    for own in limits.chunk_by(|a, b| a.method == b.method) {
        let mut cells = vec![own[0].method.to_owned()];
        cells.extend(own.iter().map(|limit| {
            let found = limit.limit_omega_h.map(|limit| format!("{limit:.4}"));
            found.unwrap_or_else(|| "always".to_owned())
        }));
        let critical = own.iter().find(|limit| limit.damping_ratio == 1.0);
        cells.extend(critical.map(|limit| left(limit.stiffest_left_per_step)));
        cells.extend(critical.map(growth));
        table.add_row(cells);
    }
    table
}

/// What is left of an error after a step, and what that means.
fn left(share: f64) -> String {
    let meaning = match share {
        s if s.abs() > 1.0 => ", unstable",
        s if s < -0.5 => ", rings",
        _ => "",
    };
    format!("{share:.1e}{meaning}")
}

fn growth(limit: &StabilityLimit) -> String {
    match limit.largest_growth > 1.0 + 1e-9 {
        true => format!("{:.2}, {:.2}", limit.largest_growth, limit.growth_omega_h),
        false => "none".to_owned(),
    }
}
