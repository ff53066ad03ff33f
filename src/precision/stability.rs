//! How many cameras it takes until the order of the points by time stands: the
//! sampling error of the diagram itself.

use serde::Serialize;

use crate::measure::{ProcessTimes, Timed};
use crate::statistics::median;

/// How well the order of all points by time, taken from a number of cameras,
/// agrees with the order from all of them.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct StableAfter {
    /// Cameras that the times are taken from.
    pub cameras: usize,
    /// Share of pairs of points that come in the same order.
    pub pairs_in_order: f64,
    /// CPU time that measuring this many took, all points, rounds and processes.
    pub seconds: f64,
}

/// CPU ns of every camera, median over the rounds. A sample is the mean over its
/// batch and stands for all cameras up to the next: points have batches of their
/// own.
pub(super) fn by_camera(timed: &Timed, cameras: usize) -> Vec<f64> {
    let mut laps = vec![Vec::new(); cameras];
    for (i, sample) in timed.samples.iter().enumerate() {
        let next = timed.samples.get(i + 1);
        let next = next.filter(|next| next.round == sample.round);
        let end = next.map_or(cameras, |next| next.frame as usize);
        for camera in &mut laps[sample.frame as usize..end] {
            camera.push(sample.cpu_ns);
        }
    }
    laps.iter().map(|ns| median(ns).unwrap_or(0.0)).collect()
}

/// The order of the points by time from the first 1, 2, 4, .. cameras of an
/// evenly spread order, against the order from all; times are sums over the
/// processes.
pub(super) fn stability(
    tasks: &[usize],
    processes: &[ProcessTimes],
    cameras: usize,
    rounds: usize,
) -> Vec<StableAfter> {
    let spent = |task: usize, wanted: &dyn Fn(usize) -> bool| -> f64 {
        let own = processes.iter().map(|process| &process.by_camera[task]);
        let wanted = own.flat_map(|own| own.iter().enumerate().filter(|(c, _)| wanted(*c)));
        wanted.map(|(_, ns)| ns).sum()
    };
    let all: Vec<f64> = tasks.iter().map(|&task| spent(task, &|_| true)).collect();
    let mut rows = Vec::new();
    let mut count = 1;
    while count < 2 * cameras {
        let used = count.min(cameras);
        let chosen = |camera: usize| (camera * used) % cameras < used;
        let some: Vec<f64> = tasks.iter().map(|&task| spent(task, &chosen)).collect();
        let pairs = (0..all.len()).flat_map(|i| (i + 1..all.len()).map(move |k| (i, k)));
        let is_same = |&(i, k): &(usize, usize)| (some[i] < some[k]) == (all[i] < all[k]);
        let (same, total) = (pairs.clone().filter(is_same).count(), pairs.count());
        rows.push(StableAfter {
            cameras: used,
            // No pair is out of order where there is none.
            pairs_in_order: same.max(usize::from(total == 0)) as f64 / total.max(1) as f64,
            seconds: some.iter().sum::<f64>() * rounds as f64 / 1e9,
        });
        count *= 2;
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::Sample;

    /// Two rounds; each number is the mean of a batch of `queries` cameras.
    fn timed(batches: &[f64], queries: u32) -> Timed {
        let sample = |round: u32, i: usize| Sample {
            round,
            frame: i as u32 * queries,
            queries,
            cpu_ns: batches[i],
            wall_ns: batches[i],
            returned: 0,
        };
        let all = (0..2).flat_map(|round| (0..batches.len()).map(move |i| sample(round, i)));
        Timed {
            samples: all.collect(),
        }
    }

    /// In one process.
    fn rows(series: &[&Timed], cameras: usize) -> Vec<StableAfter> {
        let by_camera = series.iter().map(|timed| by_camera(timed, cameras));
        let process = ProcessTimes {
            by_camera: by_camera.collect(),
            ..ProcessTimes::default()
        };
        let tasks: Vec<usize> = (0..series.len()).collect();
        stability(&tasks, &[process], cameras, 2)
    }

    #[test]
    fn the_order_is_compared_with_the_one_from_all_cameras() {
        // The first is slower from the first camera (0), even from two (0 and
        // 2), and faster from all.
        let (a, b) = (timed(&[10.0, 1.0, 1.0, 1.0], 1), timed(&[5.0; 4], 1));
        let rows = rows(&[&a, &b], 4);
        let shares: Vec<_> = rows.iter().map(|r| (r.cameras, r.pairs_in_order)).collect();
        assert_eq!(shares, [(1, 0.0), (2, 0.0), (4, 1.0)]);
        let spent: Vec<f64> = rows.iter().map(|r| (r.seconds * 1e9).round()).collect();
        assert_eq!(spent, [30.0, 42.0, 66.0]);
        // Not a power of two: the last row is all of them.
        let c = timed(&[3.0, 2.0, 1.0], 1);
        let counts: Vec<_> = self::rows(&[&c], 3).iter().map(|r| r.cameras).collect();
        assert_eq!(counts, [1, 2, 3]);
    }

    #[test]
    fn points_with_batches_of_their_own_are_compared_camera_by_camera() {
        // All in one lap: the mean is 6 a camera, 24 in all, against 20.
        let (batched, single) = (timed(&[6.0], 4), timed(&[5.0; 4], 1));
        let rows = rows(&[&batched, &single], 4);
        assert!(rows.iter().all(|r| r.pairs_in_order == 1.0), "{rows:?}");
        assert_eq!((rows[2].seconds * 1e9).round(), 88.0);
    }
}
