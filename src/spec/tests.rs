//! Specs: numbers, lists, suggestions; and the parameters that `list` shows.

use super::*;
use std::collections::BTreeSet;
/// Parameters with their defaults, without the remarks in parentheses.
/// Parameters with their defaults, as `list` shows them; remarks are in parentheses.
pub(crate) fn listed(params: &str) -> Vec<(String, String)> {
    let mut depth = 0;
    let bare: String = params
        .chars()
        .filter(|&c| {
            depth += i32::from(c == '(');
            let is_outside = depth == 0;
            depth -= i32::from(c == ')');
            is_outside
        })
        .collect();
    let each = bare
        .split(',')
        .map(str::trim)
        .filter(|each| !each.is_empty());
    each.map(|each| {
        let (key, value) = each.split_once('=').unwrap_or((each, ""));
        (key.trim().to_owned(), value.trim().to_owned())
    })
    .collect()
}

pub(crate) fn keys(listed: &[(String, String)]) -> BTreeSet<&str> {
    listed.iter().map(|(key, _)| key.as_str()).collect()
}

/// The parameters that are read, by the error of one that is not.
pub(crate) fn known(error: &str) -> BTreeSet<&str> {
    let (_, known) = error
        .split_once("(known: ")
        .expect("a list of what is known");
    known.trim_end_matches(')').split(", ").collect()
}

#[test]
fn numbers_take_suffixes() {
    let cases = [
        ("2.01k", 2010.0),
        ("1.001M", 1_001_000.0),
        ("100k", 1e5),
        ("10M", 1e7),
        ("2%", 0.02),
        ("1_000", 1e3),
        ("1e6", 1e6),
    ];
    for (text, value) in cases {
        assert_eq!(parse_number(text), Some(value), "{text}");
    }
    for text in ["", "k", "ten", "inf", "nan", "1e999"] {
        assert_eq!(parse_number(text), None, "{text}");
    }
}

#[test]
fn errors_are_one_line_whatever_was_typed() {
    let error = Spec::parse("city:a\u{1b}\nb").unwrap_err().to_string();
    assert!(
        error.contains("'a\\u{1b} b'; expected key=value"),
        "{error}"
    );
}

#[test]
fn lists_keep_parameters_with_their_structure() {
    assert_eq!(
        Spec::split_list("bvh:leaf=4,preset=fast, linear"),
        ["bvh:leaf=4,preset=fast", "linear"]
    );
}

#[test]
fn unknown_words_get_the_nearest_suggestion() {
    let error = SpecError::unknown("structure", "bhv", ["linear", "bvh"]);
    assert!(error.to_string().contains("did you mean 'bvh'"), "{error}");
    let error = Spec::parse("helsinki:n=3").unwrap().finish().unwrap_err();
    let wanted = "unknown parameter of 'helsinki': 'n'; expected none";
    assert_eq!(error.to_string(), wanted);
    let mut spec = Spec::parse("city:sed=3").unwrap();
    spec.whole("seed", 1, 0..=u64::MAX).unwrap();
    let error = spec.finish().unwrap_err().to_string();
    assert!(error.contains("did you mean 'seed'"), "{error}");
}

#[test]
fn bad_values_say_what_was_expected() {
    let mut spec = Spec::parse("city:n=many,seed=18446744073709551615,x=3").unwrap();
    assert!(
        spec.whole("n", 1, 0..=10)
            .unwrap_err()
            .to_string()
            .contains("n is 'many'")
    );
    assert_eq!(spec.whole("seed", 1, 0..=u64::MAX).unwrap(), u64::MAX);
    let mut percents = Spec::parse("city:n=200%").unwrap();
    let error = percents.whole("n", 1, 0..=10).unwrap_err().to_string();
    assert!(
        error.contains("n is '200%'; expected a whole number"),
        "{error}"
    );
    assert!(spec.number_between("x", 1.0, 0.0, 2.0).is_err());
    assert!(Spec::parse("city:n").is_err());
    assert!(Spec::parse("city:n=1,n=2").is_err());
}
