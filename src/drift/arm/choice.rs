//! What follows from errors and times: the Pareto front of every setting, the method
//! to take there, and a sentence about all of them.

use serde::Serialize;

use super::super::rated::{fastest, front};
use super::methods::Information;
use super::study::{ARMS, ArmKind, ArmPoint, Setting};
use crate::measure::OverProcesses;

/// Errors above this share of the tolerance are at its limit.
const AT_LIMIT: f64 = 0.99;

/// The method to take for an arm at a frame rate.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct ArmChoice {
    /// The arm and its frame rate.
    #[serde(flatten)]
    pub setting: Setting,
    /// The method; null if none is precise enough.
    pub method: Option<&'static str>,
    /// With its effort and precision.
    pub name: Option<String>,
    /// Largest error of its position, in the unit of the arm; null without a method.
    pub position_error: Option<f64>,
    /// Whether that is so near to the tolerance that another machine's rounding may
    /// choose another.
    pub at_limit: bool,
    /// Thread CPU time per simulated second; null without a method or a time.
    pub us_per_second: Option<f64>,
    /// Others that are precise enough and that the processes do not show to be slower.
    pub as_fast: Vec<String>,
    /// The choice in a sentence.
    pub reason: String,
}

/// Fills in times: `tasks` holds a point's task and the simulated seconds of a query.
pub fn time(points: &mut [ArmPoint], tasks: &[Option<(usize, f64)>], times: &OverProcesses) {
    for (point, task) in points.iter_mut().zip(tasks) {
        let Some((task, seconds)) = task else {
            continue;
        };
        if let Some(found) = times.ns(*task) {
            let scaled = |ns: f64| Some(ns / seconds / 1e3).filter(|us| us.is_finite());
            point.us_per_second = scaled(found.value);
            point.us_per_second_lower = scaled(found.lower);
            point.us_per_second_upper = scaled(found.upper);
        }
    }
}

/// A point that may be taken: which one, its error, and ln of its time in every
/// process.
struct Candidate {
    point: usize,
    error: f64,
    ln_ns: Vec<f64>,
}

fn candidates(
    points: &[ArmPoint],
    tasks: &[Option<(usize, f64)>],
    times: &OverProcesses,
) -> Vec<Candidate> {
    let all = points.iter().zip(tasks).enumerate();
    all.filter_map(|(point, (of, task))| {
        let (task, seconds) = (*task)?;
        let ln_ns = times.ln_ns(task).into_iter();
        let ln_ns: Vec<f64> = ln_ns.map(|ln_ns| ln_ns - seconds.ln()).collect();
        let is_told_ends = of.information == Information::FrameEnds;
        (is_told_ends && !ln_ns.is_empty()).then_some(Candidate {
            point,
            error: of.position_error?,
            ln_ns,
        })
    })
    .collect()
}

/// Marks the front of one setting, and chooses.
pub fn conclude(
    points: &mut [ArmPoint],
    tasks: &[Option<(usize, f64)>],
    times: &OverProcesses,
    tolerance: f64,
) -> Option<ArmChoice> {
    time(points, tasks, times);
    let candidates = candidates(points, tasks, times);
    let value = |c: &Candidate| {
        let time = points[c.point].us_per_second;
        [c.error, time.unwrap_or(f64::INFINITY)]
    };
    let values: Vec<[f64; 2]> = candidates.iter().map(value).collect();
    let logs: Vec<&[f64]> = candidates.iter().map(|c| &*c.ln_ns).collect();
    for (candidate, found) in candidates.iter().zip(front(&values, &logs)) {
        let by = found.dominated_by;
        let by = by.map(|by| points[candidates[by].point].label());
        let point = &mut points[candidate.point];
        point.on_front = by.is_none();
        point.is_tie = found.is_tie;
        point.dominated_by = by;
    }
    Some(choose(
        points,
        &candidates,
        tolerance,
        points.first()?.setting,
    ))
}

/// Of the points within the tolerance that nothing is faster than, the most precise.
fn choose(
    points: &[ArmPoint],
    candidates: &[Candidate],
    tolerance: f64,
    setting: Setting,
) -> ArmChoice {
    let good: Vec<&Candidate> = candidates.iter().filter(|c| c.error <= tolerance).collect();
    let fastest = fastest(&good, |c| &c.ln_ns, |c| c.error);
    let chosen = fastest.first().map(|candidate| &points[candidate.point]);
    let error = fastest.first().map(|candidate| candidate.error);
    let least = candidates.iter().min_by(|a, b| a.error.total_cmp(&b.error));
    let reason = match (chosen, least) {
        (Some(_), _) => format!(
            "the most precise of {} that are as fast, of {} within {tolerance:e}; {:.4e} off",
            fastest.len(),
            good.len(),
            error.unwrap_or(f64::NAN)
        ),
        (None, Some(least)) => format!(
            "none is within {tolerance:e}; {} comes nearest, {:.1e} off",
            points[least.point].label(),
            least.error
        ),
        (None, None) => "nothing was timed".to_owned(),
    };
    let others = fastest.iter().skip(1);
    ArmChoice {
        setting,
        method: chosen.map(|point| point.method),
        name: chosen.map(ArmPoint::label),
        position_error: error,
        at_limit: error.is_some_and(|error| error > AT_LIMIT * tolerance),
        us_per_second: chosen.and_then(|point| point.us_per_second),
        as_fast: others.map(|c| points[c.point].label()).collect(),
        reason,
    }
}

/// Which method for which stiffness and frame rate, in one sentence.
pub fn conclusion(choices: &[ArmChoice], tolerance: f64) -> String {
    let of = |(arm, name, _): (ArmKind, &str, &str)| {
        let mut own: Vec<&ArmChoice> = choices.iter().filter(|c| c.setting.arm == arm).collect();
        own.sort_by(|a, b| a.setting.omega_h.total_cmp(&b.setting.omega_h));
        let spans = own.chunk_by(|a, b| a.method == b.method);
        let spans: Vec<String> = spans
            .map(|span| {
                let method = span[0].method.unwrap_or("nothing");
                let method = match span.iter().any(|choice| choice.at_limit) {
                    true => &*format!("{method} (at the limit)"),
                    false => method,
                };
                let ends = [span[0], span[span.len() - 1]].map(|c| c.setting.omega_h);
                match own.len() == span.len() {
                    true => method.to_owned(),
                    false => format!("{method} at omega h {}", range(ends)),
                }
            })
            .collect();
        (!spans.is_empty()).then(|| format!("for the {name} arm {}", spans.join(", ")))
    };
    let arms: Vec<String> = ARMS.into_iter().filter_map(of).collect();
    format!(
        "Cheapest within {tolerance:e} on jittered frames: {}.",
        arms.join("; ")
    )
}

fn range([least, most]: [f64; 2]) -> String {
    match least == most {
        true => format!("{least:.2}"),
        false => format!("{least:.2} to {most:.2}"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::course::FrameTimes;
    use super::super::study::{ArmOptions, errors, settings};
    use super::*;
    use crate::measure::ProcessTimes;

    /// The points of a soft linear arm, whose times are the steps of a frame.
    fn concluded(tolerance: f64, processes: u32) -> (Vec<ArmPoint>, ArmChoice) {
        let options = ArmOptions {
            arms: vec![ArmKind::Linear],
            stiffnesses: vec![1e2],
            rates_hz: vec![60.0],
            seconds: 1.0,
            tolerance,
        };
        let (mut points, _) = errors(settings(&options)[0], options.seconds);
        let jittered = |p: &ArmPoint| p.frame_times == FrameTimes::Jittered;
        let tasks = points.iter().enumerate();
        let tasks: Vec<_> = tasks
            .map(|(i, p)| jittered(p).then_some((i, 2.0)))
            .collect();
        let process = |n: u32| {
            let speed = f64::from(n % 3) / 10.0;
            let ln = |p: &ArmPoint| Ok(Some((2e3 * p.steps_per_frame).ln() + speed));
            ProcessTimes {
                ln_ns: points.iter().map(ln).collect(),
                ..ProcessTimes::default()
            }
        };
        let processes: Vec<ProcessTimes> = (0..processes).map(process).collect();
        let times = OverProcesses::of(&processes);
        let choice = conclude(&mut points, &tasks, &times, tolerance).expect("a setting");
        (points, choice)
    }

    #[test]
    fn of_those_that_are_as_fast_the_most_precise_is_taken() {
        let (points, choice) = concluded(1e-2, 10);
        assert!(choice.as_fast.len() > 4, "{choice:?}");
        let one_step = points
            .iter()
            .filter(|p| p.us_per_second.is_some() && p.steps_per_frame == 1.0);
        let best = one_step
            .clone()
            .filter(|p| p.information == Information::FrameEnds);
        let best = best
            .map(|p| p.position_error.unwrap_or(1.0))
            .fold(1.0, f64::min);
        let point = one_step.clone().find(|p| Some(p.label()) == choice.name);
        let point = point.expect("a point");
        assert_eq!(point.position_error, Some(best));
        assert!(point.on_front && point.dominated_by.is_none(), "{point:?}");
        let us = point.us_per_second.expect("timed");
        assert!((0.9..1.3).contains(&us), "{us}");
        assert!(point.us_per_second_lower < Some(us) && Some(us) < point.us_per_second_upper);
    }

    #[test]
    fn a_choice_that_the_last_percent_of_the_tolerance_decides_says_so() {
        let (_, choice) = concluded(1e-2, 10);
        let error = choice.position_error.expect("chosen");
        for (share, at_limit) in [(0.9998, true), (0.98, false)] {
            let (_, choice) = concluded(error / share, 10);
            assert_eq!(choice.at_limit, at_limit, "{choice:?}");
            let off = format!("; {error:.4e} off");
            assert!(choice.reason.ends_with(&off), "{choice:?}");
        }
    }

    #[test]
    fn nothing_is_taken_where_nothing_is_precise_enough() {
        let (_, choice) = concluded(1e-9, 1);
        assert_eq!((choice.method, choice.as_fast.len()), (None, 0));
        assert!(
            choice.reason.starts_with("none is within 1e-9; "),
            "{choice:?}"
        );
    }

    #[test]
    fn points_that_are_told_more_are_on_no_front() {
        let (points, _) = concluded(1e-3, 10);
        for point in &points {
            let told_more = point.information == Information::Midpoints;
            let decided = point.on_front || point.dominated_by.is_some();
            let is_timed = point.us_per_second.is_some();
            assert_eq!(decided, is_timed && !told_more, "{point:?}");
        }
    }

    #[test]
    fn the_sentence_names_spans_of_stiffness() {
        let (_, choice) = concluded(1e-3, 1);
        let with = |method, omega_h: f64| {
            let mut choice = choice.clone();
            (choice.method, choice.setting.omega_h) = (method, omega_h);
            choice.at_limit = omega_h > 10.0 && method.is_some();
            choice
        };
        let choices = [
            with(Some("b"), 16.7),
            with(Some("a"), 0.3),
            with(Some("a"), 0.1),
            with(None, 30.0),
        ];
        assert_eq!(
            conclusion(&choices, 1e-3),
            "Cheapest within 1e-3 on jittered frames: for the linear arm a at omega h 0.10 to 0.30, \
             b (at the limit) at omega h 16.70, nothing at omega h 30.00."
        );
        assert!(conclusion(&choices[1..3], 1e-3).ends_with("for the linear arm a."));
    }
}
