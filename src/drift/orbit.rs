//! Errors of an eye that is carried around a centre by itself, without a basis.

use serde::Serialize;

use super::exact::Matrix;
use super::frames::{ORBIT_RADIUS, Turn, double, single, summed_orbit, toolkit_orbit};
use super::rotation::{Method, Sum};
use crate::arithmetic::Expansion;

/// Degrees about the z axis through the centre, every step: the golden ratio's
/// share, so that no two steps end at the same place. At 0.7 the f32 eye comes
/// round to where it was after 3600 steps, and its errors with it.
pub const SWING_DEG: f64 = 0.618_033_988_749_894_9;

/// The turn of every step.
pub const SWING: Turn = Turn::new(SWING_DEG, 0.0, 0.0);

/// The toolkit's own orbit.
pub const TOOLKIT: &str = "f64-carried";

/// Ways to carry the eye. Column u of their results is the eye less the centre, in
/// radii.
pub const CARRIERS: &[Method] = rows! { Method { name, summary, sum, walk }
    "f32-carried", "the f32 eye turned about the centre each step",
        Sum::Turns, single::carried::<false>;
    "f32-carried-radius", "the same, moved back to its distance each step",
        Sum::Turns, single::carried::<true>;
    TOOLKIT, "the f64 eye and its axes turned each step, around and over: this toolkit's orbit",
        Sum::Turns, toolkit_orbit;
    "f64-carried-radius", "the f64 eye alone, moved back to its distance each step",
        Sum::Turns, double::carried::<true>;
    "f64-angle", "the eye recomputed from an f64 angle in degrees, modulo 360",
        Sum::Angles, summed_orbit;
};

/// Error of a carried eye after a number of steps, ten away from its centre.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct OrbitDrift {
    /// Name of the method.
    pub method: &'static str,
    /// Steps taken.
    pub steps: u64,
    /// Distance from the exact eye.
    pub position_error: f64,
    /// Difference from the exact radius.
    pub radius_error: f64,
}

/// Errors of a way to carry the eye after ascending numbers of steps.
pub fn drift(carrier: &Method, steps: &[u64]) -> Vec<OrbitDrift> {
    let rows = steps.iter().zip((carrier.walk)(&SWING, steps));
    rows.map(|(&steps, offset)| {
        let exact = Matrix::about(2, &Expansion::product(SWING_DEG, steps as f64));
        // Column u of the turn is where the unit vector x has gone.
        let (position, longer) = Matrix::from(offset).column_error(&exact, 0);
        OrbitDrift {
            method: carrier.name,
            steps,
            position_error: ORBIT_RADIUS * position,
            radius_error: (ORBIT_RADIUS * longer).abs(),
        }
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_precision_leaves_its_circle_and_a_restored_radius_does_not() {
        let after = |name: &str, steps| {
            let carrier = CARRIERS.iter().find(|c| c.name == name).expect(name);
            drift(carrier, &[steps]).remove(0)
        };
        let worn = after("f32-carried", 100_000);
        assert!((1e-3..0.1).contains(&worn.radius_error), "{worn:?}");
        let kept = after("f32-carried-radius", 100_000);
        assert!(kept.radius_error < 1e-5, "{kept:?}");
        for name in [TOOLKIT, "f64-carried-radius", "f64-angle"] {
            let off = after(name, 100_000);
            assert!(off.radius_error < 1e-9, "{off:?}");
            assert!(off.position_error < 1e-7, "{off:?}");
        }
        for name in ["f64-carried-radius", "f64-angle"] {
            let kept = after(name, 100_000);
            assert!(kept.radius_error < 1e-13, "{kept:?}");
        }
        // All of them go the same way round.
        for carrier in CARRIERS {
            let off = drift(carrier, &[0, 100]).remove(1);
            assert!(off.position_error < 1e-3, "{off:?}");
        }
    }
}
