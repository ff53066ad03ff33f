//! `cullbench drift`: tables of how far ways to turn, orbit and chase drift
//! from the truth, what a step of each costs, and what follows from that.

use std::collections::BTreeSet;
use std::io::{self, Write};

use indicatif::ProgressBar;

use super::args::DriftArgs;
use super::shared_args::TableFormat;
use super::{Ending, print_json, text, unread_is_fine};
use crate::drift::{
    self, DriftOptions, DriftReport, ORBIT_RADIUS, Rated, Recommendation, SWING_DEG,
};

/// Long summaries wrap at this width.
const WIDTH: u16 = 110;

pub fn drift(args: &DriftArgs) -> anyhow::Result<Ending> {
    let options = DriftOptions {
        steps: args.steps,
        tolerance_rad: args.tolerance,
    };
    let bar = ProgressBar::new(drift::jobs() as u64);
    let report = drift::measure(&options, |job| {
        bar.set_message(job.to_owned());
        bar.inc(1);
    });
    bar.finish_and_clear();
    unread_is_fine(match args.format {
        TableFormat::Json => print_json(&report),
        TableFormat::Table => show(&report, &mut io::stdout().lock()),
    })?;
    Ok(Ending::Ok)
}

/// Rows by columns, where each cell is looked up by its row's and its
/// column's name.
fn grid(
    corner: &str,
    columns: &[String],
    rows: &[&str],
    cell: impl Fn(&str, usize) -> String,
) -> text::Table {
    let mut header = vec![corner];
    header.extend(columns.iter().map(String::as_str));
    let right: Vec<usize> = (1..header.len()).collect();
    let mut table = text::table(&header, &right);
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
    show_rotations(report, out)?;
    show_orbits(report, out)?;
    show_springs(report, out)
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
        "Frames: yaw {}, pitch {} and roll {} degrees per step",
        turn.yaw_deg, turn.pitch_deg, turn.roll_deg
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

fn show_springs(report: &DriftReport, out: &mut impl Write) -> io::Result<()> {
    let integrators = names(&report.integrators);
    writeln!(
        out,
        "Chase camera on a spring arm: critically damped, 60 Hz, RMS error over 20 s\n\
         behind a target at sin t, begun one away from it"
    )?;
    let first = report.spring.first().map(|e| e.integrator);
    let stiffnesses = report.spring.iter().filter(|e| Some(e.integrator) == first);
    let columns: Vec<String> = stiffnesses
        .map(|e| format!("k={:e}", e.stiffness))
        .collect();
    let table = grid("integrator", &columns, &integrators, |name, column| {
        let own = report.spring.iter().filter(|e| e.integrator == name);
        let mut errors = own.map(|e| e.rms_error.map_or("unstable".to_owned(), scientific));
        errors.nth(column).unwrap_or_default()
    });
    writeln!(out, "{table}")?;
    let first = report.stability.first().map(|l| l.integrator);
    let dampings = report
        .stability
        .iter()
        .filter(|l| Some(l.integrator) == first);
    let mut columns: Vec<String> = dampings
        .map(|l| format!("zeta={}", l.damping_ratio))
        .collect();
    let dampings = columns.len();
    columns.push("left per step at k=1e6".to_owned());
    let title = "stable while omega h < (formula)";
    let table = grid(title, &columns, &integrators, |name, column| {
        let mut own = report.stability.iter().filter(|l| l.integrator == name);
        if column == dampings {
            let critical = own.find(|l| l.damping_ratio == 1.0);
            return critical.map_or(String::new(), |l| left(l.stiffest_left_per_step));
        }
        let limit = |omega_h: Option<f64>| {
            omega_h.map_or("always".to_owned(), |limit| format!("{limit:.4}"))
        };
        own.nth(column).map_or(String::new(), |l| {
            format!("{} ({})", limit(l.limit_omega_h), limit(l.formula_omega_h))
        })
    });
    writeln!(out, "{table}")?;
    show_rated("integrators", "worst error", &report.integrators, out)?;
    recommend("a spring arm", &report.recommended_integrator, out)
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

fn show_rated(title: &str, error: &str, rated: &[Rated], out: &mut impl Write) -> io::Result<()> {
    let header = [title, error, "ns/step", "good", "dominated by", ""];
    let mut table = text::table(&header, &[1, 2]);
    table.fit(WIDTH);
    for row in rated {
        let name = match row.is_default {
            true => format!("{} (default)", row.name),
            false => row.name.to_owned(),
        };
        table.add_row([
            name,
            row.error.map_or("unstable".to_owned(), scientific),
            text::significant(row.ns_per_step),
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
    match choice.name {
        Some(name) => writeln!(out, "Recommended for {what}: {name}, {}.\n", choice.reason),
        None => writeln!(out, "Recommended for {what}: nothing; {}.\n", choice.reason),
    }
}
