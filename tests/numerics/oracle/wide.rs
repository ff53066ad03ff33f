//! Numbers `mantissa * 2^exponent` with a mantissa of any length: exact sums
//! and products, and, cut to 640 bits, quotients, roots and tangents by
//! formulas that the library does not use.

use dashu_int::{IBig, ops::BitTest};

/// Bits kept by [`Dyadic::cut`].
const BITS: usize = 640;

#[derive(Clone, Debug)]
pub struct Dyadic {
    pub mantissa: IBig,
    pub exponent: i64,
}

impl From<f64> for Dyadic {
    fn from(value: f64) -> Self {
        assert!(value.is_finite());
        let bits = value.to_bits();
        let fraction = (bits & ((1 << 52) - 1)) as i64;
        let (magnitude, exponent) = match (bits >> 52 & 0x7FF) as i64 {
            0 => (fraction, -1074),
            biased => (fraction | 1 << 52, biased - 1075),
        };
        let zeros = if magnitude == 0 {
            0
        } else {
            i64::from(magnitude.trailing_zeros())
        };
        let odd = magnitude >> zeros;
        Dyadic {
            mantissa: IBig::from(if value < 0.0 { -odd } else { odd }),
            exponent: exponent + zeros,
        }
    }
}

impl From<f32> for Dyadic {
    fn from(value: f32) -> Self {
        f64::from(value).into()
    }
}

impl Dyadic {
    pub fn is_zero(&self) -> bool {
        self.mantissa == IBig::ZERO
    }

    pub fn is_negative(&self) -> bool {
        self.mantissa < IBig::ZERO
    }

    /// The number in units of `2^unit`, which must divide it.
    pub fn in_units(&self, unit: i64) -> IBig {
        if self.is_zero() {
            return IBig::ZERO;
        }
        let shift = usize::try_from(self.exponent - unit).expect("a unit that divides");
        &self.mantissa << shift
    }

    fn bits(&self) -> usize {
        self.mantissa.bit_len()
    }

    /// Times `2^exponent`.
    pub fn scaled(&self, exponent: i64) -> Dyadic {
        Dyadic {
            mantissa: self.mantissa.clone(),
            exponent: self.exponent + exponent,
        }
    }

    pub fn cut(self) -> Dyadic {
        self.cut_to(BITS)
    }

    /// The leading bits, rounded down.
    pub fn cut_to(self, bits: usize) -> Dyadic {
        let surplus = self.bits().saturating_sub(bits);
        Dyadic {
            mantissa: self.mantissa >> surplus,
            exponent: self.exponent + surplus as i64,
        }
    }

    pub fn plus(&self, other: &Dyadic) -> Dyadic {
        let used = [self, other].into_iter().filter(|x| !x.is_zero());
        let unit = used.map(|x| x.exponent).min().unwrap_or(0);
        Dyadic {
            mantissa: self.in_units(unit) + other.in_units(unit),
            exponent: unit,
        }
    }

    pub fn negated(&self) -> Dyadic {
        Dyadic {
            mantissa: -&self.mantissa,
            exponent: self.exponent,
        }
    }

    pub fn minus(&self, other: &Dyadic) -> Dyadic {
        self.plus(&other.negated())
    }

    pub fn times(&self, other: &Dyadic) -> Dyadic {
        Dyadic {
            mantissa: &self.mantissa * &other.mantissa,
            exponent: self.exponent + other.exponent,
        }
    }

    pub fn abs(&self) -> Dyadic {
        if self.is_negative() {
            self.negated()
        } else {
            self.clone()
        }
    }

    pub fn over(&self, divisor: &Dyadic) -> Dyadic {
        let shift = BITS + divisor.bits();
        let quotient = Dyadic {
            mantissa: (&self.mantissa << shift) / &divisor.mantissa,
            exponent: self.exponent - shift as i64 - divisor.exponent,
        };
        quotient.cut()
    }

    pub fn sqrt(&self) -> Dyadic {
        let odd = self.exponent.rem_euclid(2);
        let shift = 2 * BITS;
        let radicand = &self.mantissa << (shift + odd as usize);
        let root = dashu_int::UBig::try_from(radicand).expect("not negative");
        let root = Dyadic {
            mantissa: dashu_int::ops::SquareRoot::sqrt(&root).into(),
            exponent: (self.exponent - odd) / 2 - BITS as i64,
        };
        root.cut()
    }

    pub fn to_f64(&self) -> f64 {
        let top = self.clone().cut_to(60);
        let mantissa = i64::try_from(top.mantissa).expect("60 bits") as f64;
        libm::ldexp(mantissa, top.exponent as i32)
    }
}

/// The arc tangent of `1/n` by its power series.
fn arctan_of_reciprocal(n: f64) -> Dyadic {
    let square = Dyadic::from(n * n);
    let mut power = Dyadic::from(1.0).over(&Dyadic::from(n));
    let mut sum = power.clone();
    for k in 1..2 * BITS {
        power = power.over(&square).negated();
        sum = sum.plus(&power.over(&Dyadic::from((2 * k + 1) as f64)));
        if power.exponent + (power.bits() as i64) < -(BITS as i64) {
            break;
        }
    }
    sum.cut()
}

/// Pi by Machin's formula.
pub fn pi() -> Dyadic {
    let (a, b) = (arctan_of_reciprocal(5.0), arctan_of_reciprocal(239.0));
    a.scaled(4).minus(&b.scaled(2))
}

/// The tangent of an angle in (0, pi/2): Lambert's continued fraction for an
/// eighth of it, then doubled thrice.
pub fn tangent(angle: &Dyadic) -> Dyadic {
    let x = angle.scaled(-3).cut();
    let square = x.times(&x).cut();
    let mut fraction = Dyadic::from(161.0);
    for odd in (0..80).rev().map(|k| f64::from(2 * k + 1)) {
        fraction = Dyadic::from(odd).minus(&square.over(&fraction)).cut();
    }
    let mut tangent = x.over(&fraction);
    for _ in 0..3 {
        let square = tangent.times(&tangent).cut();
        tangent = tangent.scaled(1).over(&Dyadic::from(1.0).minus(&square));
    }
    tangent
}

pub type Vector = [Dyadic; 3];

pub fn vector(v: glam::DVec3) -> Vector {
    v.to_array().map(Dyadic::from)
}

pub fn dot(a: &Vector, b: &Vector) -> Dyadic {
    let [x, y, z] = [0, 1, 2].map(|k| a[k].times(&b[k]));
    x.plus(&y).plus(&z)
}

pub fn cross(a: &Vector, b: &Vector) -> Vector {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| a[i].times(&b[j]).minus(&a[j].times(&b[i])))
}

/// `a + b * factor`.
pub fn along(a: &Vector, b: &Vector, factor: &Dyadic) -> Vector {
    [0, 1, 2].map(|k| a[k].plus(&b[k].times(factor)))
}

pub fn unit(v: &Vector) -> Vector {
    let length = dot(v, v).sqrt();
    [0, 1, 2].map(|k| v[k].over(&length))
}

#[test]
fn wide_numbers_agree_with_what_is_known() {
    assert_eq!(pi().to_f64(), std::f64::consts::PI);
    // 1000 bits of pi are known; the first 40 digits will do.
    let digits: IBig = "3141592653589793238462643383279502884197".parse().unwrap();
    let scale = IBig::from(10).pow(39);
    let scaled = pi().times(&Dyadic {
        mantissa: scale,
        exponent: 0,
    });
    assert_eq!(scaled.mantissa >> (-scaled.exponent) as usize, digits);
    for (share, wanted) in [(4.0, 1.0), (6.0, 1.0 / 3f64.sqrt()), (3.0, 3f64.sqrt())] {
        let found = tangent(&pi().over(&Dyadic::from(share)));
        assert!((found.to_f64() - wanted).abs() < 1e-15);
    }
    // tan(pi/4) is 1 to nearly all bits, tan(pi/3) a root of three.
    let small = |x: Dyadic| x.abs().minus(&Dyadic::from(1.0).scaled(-600)).is_negative();
    let one = tangent(&pi().scaled(-2));
    assert!(small(one.minus(&Dyadic::from(1.0))));
    let root = tangent(&pi().over(&Dyadic::from(3.0)));
    assert!(small(root.minus(&Dyadic::from(3.0).sqrt())));
    let steep = tangent(&pi().scaled(-1).times(&Dyadic::from(1.0 - 1e-7)).cut());
    let wanted = 2e7 / std::f64::consts::PI;
    assert!((steep.to_f64() / wanted - 1.0).abs() < 1e-8);
    assert_eq!(Dyadic::from(-0.3).to_f64(), -0.3);
}
