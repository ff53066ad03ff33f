//! Times of the tasks of a study, in one process and over several.
//!
//! Values, ratios and orders by the estimators of a run (for runs, `results` has them).

use std::borrow::Borrow;

use serde::{Deserialize, Serialize};

use super::{Part, Timed, Verdict};
use crate::statistics::{Estimate, one_run, ratio};

/// Times of the tasks of a schedule in one process, in the order of the schedule.
///
/// Plain data, passed between processes.
#[derive(Clone, Default, PartialEq, Debug, Serialize, Deserialize)]
pub struct ProcessTimes {
    /// Per task: ln of the CPU ns per query; `None` if no camera is timed.
    pub ln_ns: Vec<Result<Option<f64>, Verdict>>,
    /// Groups of cells measured beside the tasks.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<Part>,
}

impl ProcessTimes {
    /// The times of tasks in one process, ln ns, in their order.
    pub fn of(timed: &[Result<Timed, Verdict>]) -> ProcessTimes {
        let ln_ns = timed.iter().map(|timed| timed.as_ref().map(Timed::ln_ns));
        let ln_ns = ln_ns.map(|own| own.map_err(Verdict::clone));
        ProcessTimes {
            ln_ns: ln_ns.collect(),
            ..ProcessTimes::default()
        }
    }
}

/// Times of the same tasks in several processes, by the keys of the tasks.
///
/// A key is the index in the schedule, or a value defined by the study.
pub struct OverProcesses<K = usize> {
    keys: Vec<K>,
    /// Per task, ln ns in each process.
    ///
    /// Empty without times; the verdict of the first process in which the task failed.
    logs: Vec<Result<Vec<f64>, Verdict>>,
    /// The first task with times: a slowdown of a process slows all tasks.
    reference: Vec<f64>,
}

impl OverProcesses {
    /// The times of tasks by their indices in the schedule.
    ///
    /// # Panics
    /// If the processes have not timed the same tasks.
    pub fn of(processes: &[ProcessTimes]) -> OverProcesses {
        let tasks = processes.first().map_or(0, |first| first.ln_ns.len());
        OverProcesses::keyed((0..tasks).collect(), processes)
    }
}

impl<K: PartialEq> OverProcesses<K> {
    /// The times of tasks by their keys, given in the order of the schedule.
    ///
    /// # Panics
    /// If the processes have not timed the same tasks.
    pub fn keyed(keys: Vec<K>, processes: &[ProcessTimes]) -> OverProcesses<K> {
        let of_task = |task: usize| {
            let found = processes.iter().map(|p| p.ln_ns[task].clone());
            let logs: Result<Option<Vec<f64>>, Verdict> = found.collect();
            logs.map(Option::unwrap_or_default)
        };
        let logs: Vec<_> = (0..keys.len()).map(of_task).collect();
        let timed = logs.iter().flatten().find(|own| !own.is_empty());
        OverProcesses {
            keys,
            reference: timed.cloned().unwrap_or_default(),
            logs,
        }
    }

    fn log(&self, task: impl Borrow<K>) -> Option<&Result<Vec<f64>, Verdict>> {
        let position = self.keys.iter().position(|key| key == task.borrow())?;
        self.logs.get(position)
    }

    /// ln of the time of a task as measured in each process, ns; empty without times.
    pub fn own(&self, task: impl Borrow<K>) -> &[f64] {
        let timed = self.log(task).and_then(|log| log.as_deref().ok());
        timed.unwrap_or_default()
    }

    /// Number of processes with times.
    pub fn processes(&self) -> usize {
        self.reference.len()
    }

    /// Verdict of a task that failed; `None` for a sound one and for an unknown key.
    pub fn failure(&self, task: impl Borrow<K>) -> Option<&Verdict> {
        self.log(task)?.as_ref().err()
    }

    /// Speed of each process: the reported time of the first task / its own.
    pub fn speeds(&self) -> Vec<f64> {
        let reported = one_run(&self.reference, &self.reference);
        let reported = reported.map_or(f64::NAN, |found| found.value);
        let own = self.reference.iter();
        own.map(|ln_ns| reported / ln_ns.exp()).collect()
    }

    /// Time of a query of a task, ns; `None` without times and for an unknown key.
    pub fn ns(&self, task: impl Borrow<K>) -> Option<Estimate> {
        one_run(&self.reference, self.own(task))
    }

    /// ln of the time of a task in each process, ns.
    ///
    /// Normalised to the reported value of [`Self::ns`]; empty without times.
    pub fn ln_ns(&self, task: impl Borrow<K>) -> Vec<f64> {
        let speed = one_run(&self.reference, &self.reference);
        let speed = speed.map_or(f64::NAN, |found| found.value.ln());
        let both = self.own(task).iter().zip(&self.reference);
        both.map(|(own, reference)| own - reference + speed)
            .collect()
    }

    /// Time of `task` / time of `other`.
    ///
    /// The ratio of the two values of [`Self::ns`].
    pub fn ratio(&self, task: impl Borrow<K>, other: impl Borrow<K>) -> Option<Estimate> {
        ratio(&self.reference, self.own(task), self.own(other))
    }
}

#[cfg(test)]
mod tests {
    use super::super::Status;
    use super::*;
    use crate::statistics::{ALPHA, is_less};

    fn is_faster(times: &OverProcesses, task: usize, other: usize) -> bool {
        is_less(&times.ln_ns(task), &times.ln_ns(other), ALPHA)
    }

    fn process(ln_ns: [f64; 3]) -> ProcessTimes {
        ProcessTimes {
            ln_ns: ln_ns.map(|ln_ns| Ok(Some(ln_ns))).into(),
            ..ProcessTimes::default()
        }
    }

    /// Processes on a machine of two speeds; the second and third tasks have one mean.
    fn processes() -> Vec<ProcessTimes> {
        let one = |n: usize| {
            let speed = 5.0 + if n.is_multiple_of(3) { 0.6 } else { 0.0 };
            let swing = if n.is_multiple_of(2) { 0.02 } else { -0.02 };
            process([speed, speed + 0.1 + swing / 4.0, speed + 0.1 - swing])
        };
        (0..10).map(one).collect()
    }

    #[test]
    fn ratios_are_those_of_the_shown_times_and_ties_are_left() {
        let times = OverProcesses::of(&processes());
        let [a, b, c] = [0, 1, 2].map(|task| times.ns(task).unwrap());
        let ratio = times.ratio(1, 0).unwrap();
        assert!((ratio.value - b.value / a.value).abs() < 1e-12);
        // The speeds of the machine affect the times and not the ratio.
        let ends = |e: Estimate| (e.lower.unwrap(), e.upper.unwrap());
        let ((low, high), (lower, upper)) = (ends(a), ends(ratio));
        assert!(high / low > 1.4 && upper / lower < 1.02);
        assert!(lower < 0.1f64.exp() && 0.1f64.exp() < upper);
        assert!(ends(c).0 <= c.value && c.value <= ends(c).1);
        assert!(is_faster(&times, 0, 1) && !is_faster(&times, 1, 0));
        assert!(!is_faster(&times, 1, 2) && !is_faster(&times, 2, 1));
    }

    #[test]
    fn one_process_has_values_without_intervals_and_no_ties() {
        let times = OverProcesses::of(&processes()[..1]);
        let found = times.ns(1).unwrap();
        assert!(found.value > 0.0 && found.lower.is_none() && found.upper.is_none());
        assert!(times.ratio(1, 0).unwrap().lower.is_none());
        assert!(is_faster(&times, 2, 1) && !is_faster(&times, 1, 2));
    }

    #[test]
    fn what_fails_in_one_process_has_no_time_in_any() {
        let mut processes = processes();
        processes[4].ln_ns[1] = Err(Verdict::new(Status::Wrong, "one id too many"));
        processes[2].ln_ns[2] = Ok(None);
        let times = OverProcesses::of(&processes);
        assert_eq!(times.failure(1).unwrap().status, Status::Wrong);
        assert_eq!(
            (times.ns(1), times.ns(2), times.failure(2)),
            (None, None, None)
        );
        assert!(times.ns(0).is_some() && times.ratio(1, 0).is_none());
        assert!(!is_faster(&times, 0, 1) && !is_faster(&times, 1, 0));
    }

    #[test]
    fn a_task_is_found_by_its_key() {
        let processes = processes();
        let (keyed, by_position) = (
            OverProcesses::keyed(vec!["sweep", "scan", "tree"], &processes),
            OverProcesses::of(&processes),
        );
        assert_eq!(keyed.ns("tree"), by_position.ns(2));
        assert_eq!(keyed.ratio("scan", "sweep"), by_position.ratio(1, 0));
        assert_eq!((keyed.ns("other"), keyed.failure("other")), (None, None));
    }
}
