//! What a spring arm is to a method: a second-order equation `x'' = pull - c x'`
//! with a target of which only samples are known. The three arms are in `linear`,
//! `limited` and `turning`.

use super::super::real::Real;

/// Position, then velocity.
pub type State<R, const N: usize> = [R; N];

/// A motion that an arm chases, and how far off a state is.
pub trait Course<const N: usize> {
    /// Where the target is: a number, or an orientation.
    type Place: Copy;
    /// Entries of a state that are position.
    const POSITION: usize;
    /// A position that the arm cannot pass.
    const STOP: Option<f64> = None;

    /// The target at time `t` in seconds.
    fn at(t: f64) -> Self::Place;
    fn start() -> State<f64, N>;
    /// How far apart two states are, in position (or radians) and velocity.
    fn apart(a: &State<f64, N>, b: &State<f64, N>) -> [f64; 2];
}

/// What a method is told of the target's way through one frame.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Samples<P> {
    pub start: P,
    /// Only where [`Information`](super::methods::Information) says so.
    pub middle: Option<P>,
    pub end: P,
}

/// A critically damped arm of one stiffness, as methods see it: all in the
/// numbers `R`.
pub trait Arm<R: Real, const N: usize>: Course<N> {
    /// The target during a frame: a line through two samples, or a parabola
    /// through three, in seconds since the frame began.
    type Target: Copy;
    /// One Newton step solves an implicit stage.
    const LINEAR: bool;

    /// `stiffness` k in 1/s^2.
    fn new(stiffness: f64) -> Self;
    fn target(samples: &Samples<Self::Place>, seconds: f64) -> Self::Target;
    /// The target as if it had been where it will be after so many seconds.
    fn held(target: &Self::Target, seconds: R) -> Self::Target;
    /// c in 1/s.
    fn friction(&self) -> R;
    /// `y'` for the target at `t`.
    fn slope(&self, target: &Self::Target, t: R, y: &State<R, N>) -> State<R, N>;
    /// The position carried along by the velocity.
    fn moved(&self, y: &State<R, N>, h: R) -> State<R, N>;
    /// About `(I - g J)^-1 residual` with the Jacobian J of the slope: exact for a
    /// linear arm, near enough for Newton's iteration otherwise.
    fn solve(
        &self,
        target: &Self::Target,
        t: R,
        y: &State<R, N>,
        g: R,
        residual: &State<R, N>,
    ) -> State<R, N>;
    /// The closed form of a linear spring over `h` seconds from `t` on. What is not
    /// linear in the arm is frozen as it is at `t`.
    fn closed(&self, target: &Self::Target, t: R, y: &State<R, N>, h: R) -> State<R, N>;
    /// What is done to a state after every step: a stop, or unit length.
    fn settled(&self, y: State<R, N>) -> State<R, N> {
        y
    }
}

/// The frames of a run as a method sees them: targets, and how long they are.
pub type Frames<T, R> = [(T, R)];

/// `y + h slope`.
#[inline(always)]
pub fn along<R: Real, const N: usize>(y: &State<R, N>, h: R, slope: &State<R, N>) -> State<R, N> {
    std::array::from_fn(|i| y[i] + h * slope[i])
}

/// A parabola through samples at 0, `seconds`/2 and `seconds`, as its slope and
/// half its second derivative; a line without the one in the middle. The samples
/// are less the first.
pub fn parabola(middle: Option<f64>, end: f64, seconds: f64) -> [f64; 2] {
    match middle {
        None => [end / seconds, 0.0],
        Some(middle) => [
            (4.0 * middle - end) / seconds,
            2.0 * (end - 2.0 * middle) / (seconds * seconds),
        ],
    }
}
