//! The reference of the arms without a closed form: Gragg's, Bulirsch's and Stoer's
//! extrapolation, of order 16, which shares no formula with any method and estimates
//! its own error; a stop is met where it is met, to the last digit.

/// Substeps of the modified midpoint rule.
const SUBSTEPS: [u32; 8] = [2, 4, 6, 8, 10, 12, 14, 16];

/// What a step may be off by its own estimate, positions and velocities / omega.
const TOLERANCE: f64 = 1e-14;

/// The slope of a state at a time.
pub type Slope<'s, const N: usize> = &'s dyn Fn(f64, &[f64; N]) -> [f64; N];

/// `n` substeps of the modified midpoint rule without smoothing (Gragg 1965; Hairer,
/// Nørsett and Wanner 1993, "Solving Ordinary Differential Equations I", II.9): its
/// error has even powers of the substep alone.
fn midpoint<const N: usize>(f: Slope<N>, t: f64, y: &[f64; N], h: f64, n: u32) -> [f64; N] {
    let h = h / f64::from(n);
    let ahead = |y: &[f64; N], h: f64, slope: [f64; N]| -> [f64; N] {
        std::array::from_fn(|i| y[i] + h * slope[i])
    };
    let mut before = *y;
    let mut now = ahead(y, h, f(t, y));
    for i in 1..n {
        let next = ahead(&before, 2.0 * h, f(t + f64::from(i) * h, &now));
        (before, now) = (now, next);
    }
    now
}

/// One step and the difference of its two best columns, by Aitken's and Neville's
/// scheme.
fn extrapolated<const N: usize>(f: Slope<N>, t: f64, y: &[f64; N], h: f64) -> ([f64; N], [f64; N]) {
    let mut row: Vec<[f64; N]> = Vec::with_capacity(SUBSTEPS.len());
    let mut off = [f64::INFINITY; N];
    for (j, &n) in SUBSTEPS.iter().enumerate() {
        let mut next = midpoint(f, t, y, h, n);
        for k in 0..j {
            let ratio = f64::from(n) / f64::from(SUBSTEPS[j - 1 - k]);
            let factor = 1.0 / (ratio * ratio - 1.0);
            let better = std::array::from_fn(|i| next[i] + (next[i] - row[k][i]) * factor);
            row[k] = next;
            off = std::array::from_fn(|i| (better[i] - next[i]).abs());
            next = better;
        }
        row.push(next);
    }
    (row[row.len() - 1], off)
}

/// An arm on its way.
pub struct Reference<const N: usize> {
    pub y: [f64; N],
    /// Sum of the estimates of all steps: positions, and velocities / omega. The
    /// arms forget their errors, so that it bounds what is left of them.
    pub error: f64,
    /// Entries of a state that are position.
    position: usize,
    omega: f64,
    stop: Option<f64>,
    step: f64,
}

impl<const N: usize> Reference<N> {
    pub fn new(y: [f64; N], position: usize, omega: f64, stop: Option<f64>) -> Self {
        Reference {
            y,
            error: 0.0,
            position,
            omega,
            stop,
            step: 1.0 / omega,
        }
    }

    /// From `t` to `end`.
    ///
    /// With a stop: the arm rests at it while it is pushed into it, and its velocity
    /// is lost when it meets it. Both moments are found by bisection to neighbouring
    /// doubles. An arm that touches and leaves within one step of about 1/omega goes
    /// unnoticed.
    pub fn follow(&mut self, f: Slope<N>, mut t: f64, end: f64) {
        while t < end {
            t = match self.stop {
                Some(stop) if self.rests(f, stop, t) => {
                    let pushed = |t: f64| self.rests(f, stop, t);
                    end_of(pushed, t, end)
                }
                _ => self.step(f, t, end),
            };
        }
    }

    /// Whether it lies at the stop and is pushed into it.
    fn rests(&self, f: Slope<N>, stop: f64, t: f64) -> bool {
        self.y[0] >= stop && self.y[self.position] == 0.0 && f(t, &self.y)[self.position] >= 0.0
    }

    /// One step that its estimate accepts; the time where it ends.
    fn step(&mut self, f: Slope<N>, t: f64, end: f64) -> f64 {
        loop {
            let rest = end - t;
            let h = self.step.min(rest);
            let (y, off) = extrapolated(f, t, &self.y, h);
            let error = off.iter().enumerate().fold(0.0, |most: f64, (i, off)| {
                most.max(match i < self.position {
                    true => *off,
                    false => off / self.omega,
                })
            });
            // The estimate is the error of the last but one column, of order 14.
            let factor = 0.9 * (TOLERANCE / error.max(1e-20)).powf(1.0 / 15.0);
            let smallest = 1e-3 / self.omega;
            if error > TOLERANCE && h > smallest {
                self.step = (h * factor.clamp(0.1, 0.9)).max(smallest);
                continue;
            }
            if h == self.step {
                self.step = h * factor.clamp(0.5, 2.0);
            }
            self.error += error;
            if let Some(stop) = self.stop
                && y[0] > stop
            {
                return self.meet(f, stop, t, t + h);
            }
            self.y = y;
            return if h == rest { end } else { t + h };
        }
    }

    /// Goes to the stop, which it passes before `end`; the time when it is there.
    fn meet(&mut self, f: Slope<N>, stop: f64, t: f64, end: f64) -> f64 {
        let at = |end: f64| extrapolated(f, t, &self.y, end - t).0;
        let met = end_of(|end| at(end)[0] <= stop, t, end);
        self.y = at(met);
        self.y[0] = stop;
        self.y[self.position..].fill(0.0);
        met
    }
}

/// The first double after `good` where something no longer holds, by bisection; `end`
/// if it holds there.
fn end_of(holds: impl Fn(f64) -> bool, mut good: f64, end: f64) -> f64 {
    if holds(end) {
        return end;
    }
    let mut bad = end;
    loop {
        let middle = good + (bad - good) / 2.0;
        if middle <= good || middle >= bad {
            return bad;
        }
        match holds(middle) {
            true => good = middle,
            false => bad = middle,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::course::{FrameTimes, frames, linear_way, way};
    use super::super::limited::Limited;
    use super::super::linear::Linear;
    use super::super::methods::Information;
    use super::*;

    #[test]
    fn two_references_of_nothing_in_common_agree() {
        for stiffness in [1e2, 1e4, 1e6] {
            let frames = frames(30.0, FrameTimes::Jittered, 2.0);
            for information in [
                None,
                Some(Information::FrameEnds),
                Some(Information::Midpoints),
            ] {
                let a = linear_way(stiffness, &frames, information);
                let b = way::<Linear<f64>, 2>(stiffness, &frames, information);
                assert!(b.error < 1e-11, "{stiffness}: {:e}", b.error);
                for (a, b) in a.states.iter().zip(&b.states) {
                    let apart = (a[0] - b[0]).abs();
                    assert!(apart < 1e-12, "{stiffness} {information:?}: {apart:e}");
                }
            }
        }
    }

    /// It meets the stop at the time that a march of small steps finds, and
    /// leaves it when the target comes back.
    #[test]
    fn a_stop_is_met_and_left_on_time() {
        let ends = |rate: f64| {
            let frames = frames(rate, FrameTimes::Steady, 3.0);
            let states = way::<Limited<f64>, 2>(1e2, &frames, None).states;
            frames
                .into_iter()
                .map(|f| f.start + f.seconds)
                .zip(states)
                .collect::<Vec<_>>()
        };
        let all = ends(60.0);
        // sin t = 0.6 on the way down.
        let left = std::f64::consts::PI - 0.6f64.asin();
        let (mut at_stop, mut before) = (0, 0);
        for (t, [x, v]) in &all {
            match *x == 0.6 {
                true => {
                    at_stop += 1;
                    assert!(*v == 0.0 && *t <= left + 1e-12, "{t} {x} {v}");
                }
                false => before += usize::from(*t < 1.0),
            }
        }
        assert!(at_stop > 60 && before > 30, "{at_stop} {before}");
        // Whatever frames it is looked at by.
        for ((t, a), (_, b)) in ends(120.0).iter().skip(1).step_by(2).zip(&all) {
            assert!(
                (a[0] - b[0]).abs() < 1e-13 && (a[1] - b[1]).abs() < 1e-11,
                "{t}: {a:?} {b:?}"
            );
        }
    }

    #[test]
    fn the_last_double_before_an_end_is_found() {
        let root = end_of(|x| x * x < 2.0, 1.0, 2.0);
        assert!(root * root >= 2.0 && root.next_down().powi(2) < 2.0);
        assert_eq!(end_of(|_| true, 1.0, 2.0), 2.0);
    }
}
