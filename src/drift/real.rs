//! The numbers that a spring arm is stepped in: f32 and f64 behind one trait, with
//! the functions of `libm`, which are the same on every machine.

use std::fmt::Debug;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A floating-point number.
pub trait Real:
    Copy
    + Debug
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + 'static
{
    const NAME: &'static str;
    /// A change that is not worth another iteration: some units of the last place.
    const NEGLIGIBLE: Self;

    fn of(value: f64) -> Self;
    fn wide(self) -> f64;
    fn exp(self) -> Self;
    fn sin(self) -> Self;
    fn cos(self) -> Self;
    fn atan2(self, x: Self) -> Self;
    fn sqrt(self) -> Self;

    fn abs(self) -> Self {
        if self < Self::of(0.0) { -self } else { self }
    }

    fn max(self, other: Self) -> Self {
        if self < other { other } else { self }
    }

    fn min(self, other: Self) -> Self {
        if other < self { other } else { self }
    }
}

macro_rules! real {
    ($real:ident, $negligible:literal, $exp:path, $sin:path, $cos:path, $atan2:path) => {
        impl Real for $real {
            const NAME: &'static str = stringify!($real);
            const NEGLIGIBLE: Self = $negligible;

            #[inline(always)]
            fn of(value: f64) -> Self {
                value as $real
            }
            #[inline(always)]
            fn wide(self) -> f64 {
                f64::from(self)
            }
            fn exp(self) -> Self {
                $exp(self)
            }
            fn sin(self) -> Self {
                $sin(self)
            }
            fn cos(self) -> Self {
                $cos(self)
            }
            fn atan2(self, x: Self) -> Self {
                $atan2(self, x)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                self.sqrt()
            }
        }
    };
}

real!(f32, 5e-7, libm::expf, libm::sinf, libm::cosf, libm::atan2f);
real!(f64, 1e-14, libm::exp, libm::sin, libm::cos, libm::atan2);
