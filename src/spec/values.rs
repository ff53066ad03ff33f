//! Parsers of option values.
//!
//! Their errors state what was expected; the command line adds the option and the value.

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;

use super::{SpecError, parse_number};

/// The value, or an error about what was expected.
pub fn expected<T>(value: Option<T>, what: impl Display) -> Result<T, SpecError> {
    value.ok_or_else(|| SpecError::new(format_args!("expected {what}")))
}

/// A finite number that is sound.
fn number(
    text: &str,
    what: impl Display,
    is_sound: impl Fn(f64) -> bool,
) -> Result<f64, SpecError> {
    let number = text.parse().ok();
    expected(number.filter(|n: &f64| n.is_finite() && is_sound(*n)), what)
}

/// A whole number of a range.
pub fn whole<N: FromStr + PartialOrd + Display + Clone>(
    range: RangeInclusive<N>,
) -> impl Fn(&str) -> Result<N, SpecError> + Clone {
    move |text| {
        let sound = text.parse().ok().filter(|n| range.contains(n));
        let (least, most) = (range.start(), range.end());
        expected(sound, format!("a whole number from {least} to {most}"))
    }
}

pub fn at_least_zero(text: &str) -> Result<f64, SpecError> {
    // -0 becomes 0.
    number(text, "a number of at least 0", |n| n >= 0.0).map(|n| n + 0.0)
}

pub fn above_zero(text: &str) -> Result<f64, SpecError> {
    number(text, "a number above 0", |n| n > 0.0)
}

pub fn within(range: RangeInclusive<f64>) -> impl Fn(&str) -> Result<f64, SpecError> + Clone {
    move |text| {
        let (least, most) = (range.start(), range.end());
        let what = format_args!("a number from {least} to {most:e}");
        number(text, what, |n| range.contains(&n))
    }
}

/// A vertical angle of view in degrees.
pub fn field_of_view(text: &str) -> Result<f64, SpecError> {
    number(text, "a number above 0 and below 180", |n| {
        n > 0.0 && n < 180.0
    })
}

/// A far plane; `inf` is none.
pub fn far(text: &str) -> Result<f64, SpecError> {
    match text.parse() {
        Ok(f64::INFINITY) => Ok(f64::INFINITY),
        _ => number(text, "a number above 0 or inf", |n| n > 0.0),
    }
}

/// "5%", "5 %" or "0.05". A bare 5 could be meant as either, and as 500 % it
/// would let everything pass.
pub fn threshold(typed: &str) -> Result<f64, SpecError> {
    let typed = typed.trim();
    let share = match typed.strip_suffix('%') {
        Some(percents) => parse_number(&format!("{}%", percents.trim_end())),
        None => parse_number(typed).filter(|share| *share < 1.0),
    };
    let what = "a percentage of 0 or more such as 5%, or a share from 0 to below 1 such as 0.05";
    // Zero has two signs and one meaning.
    expected(share.filter(|share| *share >= 0.0), what).map(f64::abs)
}

/// Name of a baseline, which becomes the name of a file.
pub fn baseline(name: &str) -> Result<String, SpecError> {
    let name = name.trim_end_matches(".json");
    let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-');
    let sound = name.chars().all(is_plain) && (1..=100).contains(&name.len());
    let name = (sound && !name.starts_with(['.', '-'])).then(|| name.to_owned());
    expected(
        name,
        "a name of at most 100 letters, digits, '_', and '.' and '-' but in front",
    )
}

/// The value of that name, of a table of values, names and summaries.
pub fn choice<'t, T: Copy>(
    what: &'t str,
    table: &'t [(T, &'static str, &'static str)],
) -> impl Fn(&str) -> Result<T, SpecError> + Clone {
    move |name| {
        let row = table.iter().find(|row| row.1 == name);
        row.map(|row| row.0)
            .ok_or_else(|| SpecError::unknown(what, name, table.iter().map(|row| row.1)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thresholds_are_shares_and_nothing_else() {
        for (typed, share) in [
            ("5%", 0.05),
            ("5 %", 0.05),
            (" 0.05 ", 0.05),
            ("0", 0.0),
            ("0%", 0.0),
            ("150%", 1.5),
        ] {
            assert_eq!(threshold(typed), Ok(share), "{typed}");
        }
        assert!(threshold("-0").is_ok_and(f64::is_sign_positive));
        let bad = "nan NaN% -5% -0.1 inf inf% 1e999 5 1.5 5k five % 5%% - --all";
        for typed in bad.split(' ').chain(["", "5 5%"]) {
            let error = threshold(typed).expect_err(typed).to_string();
            assert!(
                error.starts_with("expected a percentage"),
                "{typed}: {error}"
            );
        }
    }
}
