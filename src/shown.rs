//! Text from outside as it is displayed, and counts with their nouns.
//!
//! Escapes everything that a terminal, a picture or a page would interpret. Defines the harmless
//! characters, for all outputs.

use std::io;

/// Text on one line: line breaks and tabs are spaces.
///
/// Characters that would control the reader's terminal, change the direction of the text or are not
/// XML are escaped by number, `\u{1b}`.
pub fn plain(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\n' | '\r' | '\t' | '\u{b}' | '\u{c}' | '\u{85}' | '\u{2028}' | '\u{2029}' => {
                out.push(' ');
            }
            c if is_harmful(c) => out.extend(c.escape_unicode()),
            c => out.push(c),
        }
    }
    out
}

/// [`plain`] for text of several lines: line feeds stay.
pub fn lines(text: &str) -> String {
    let plain: Vec<String> = text.split('\n').map(plain).collect();
    plain.join("\n")
}

/// [`plain`] text of at most `most` characters plus an ellipsis.
pub fn shortened(text: &str, most: usize) -> String {
    without_middle(&plain(text), [most, 0])
}

/// [`plain`] text of a message.
///
/// Very long words lose their middle, and so does the whole: a name of any length leaves place and
/// expectation readable.
pub fn message(text: &str) -> String {
    let text = plain(text);
    let words = text.split(' ').map(|word| without_middle(word, [160, 80]));
    let words: Vec<String> = words.collect();
    without_middle(&words.join(" "), [1200, 400])
}

/// The end of a message about an I/O error.
///
/// "; expected an existing file"; `what` is a file or a folder. Empty if the error's own text has
/// an expectation.
pub fn expected_by(error: &io::Error, what: &str) -> String {
    use io::ErrorKind::*;
    if error.to_string().contains("expected") {
        return String::new();
    }
    let expected = match kind_of(error) {
        NotFound => format!("an existing {what}"),
        IsADirectory => "a file".to_owned(),
        NotADirectory => "folders before the last name".to_owned(),
        PermissionDenied | ReadOnlyFilesystem => format!("a {what} with permission"),
        StorageFull | QuotaExceeded => "room on the disk".to_owned(),
        OutOfMemory => "more free memory".to_owned(),
        _ => format!("another {what}"),
    };
    format!("; expected {expected}")
}

/// The kind of an error that `csv` may have wrapped.
pub(crate) fn kind_of(error: &io::Error) -> io::ErrorKind {
    let inner = error.get_ref().and_then(|inner| inner.downcast_ref());
    match inner.map(csv::Error::kind) {
        Some(csv::ErrorKind::Io(inner)) => kind_of(inner),
        _ => error.kind(),
    }
}

/// The expectation of a message about a file with several parts.
pub(crate) fn part_hint(file: &str, name: &str) -> String {
    // A value that starts with a minus needs `=`, a separate argument `--`.
    if file == "-" || file.starts_with("-#") {
        return format!("one of them by name, as in '--scene={file}#{name}' or '-- {file}#{name}'");
    }
    format!("one of them by name, as in '{file}#{name}'")
}

/// Nanoseconds with three significant digits in a suitable unit.
pub fn time(ns: f64) -> String {
    let (size, name) = unit(ns);
    format!("{} {name}", significant(ns / size))
}

/// The unit suited to a time, in ns, and its name.
pub fn unit(ns: f64) -> (f64, &'static str) {
    match ns {
        n if n < 999.5 => (1.0, "ns"),
        n if n < 999.5e3 => (1e3, "us"),
        n if n < 999.5e6 => (1e6, "ms"),
        _ => (1e9, "s"),
    }
}

/// Three significant digits: 0.0123, 1.23, 12.3, 123, 12,345.
///
/// An exponent only for numbers longer than any measurement.
pub fn significant(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    if !(1e-9..1e15).contains(&value.abs()) {
        return format!("{value:.2e}");
    }
    if value.abs() >= 999.5 {
        let sign = if value < 0.0 { "-" } else { "" };
        return sign.to_owned() + &count(value.abs().round() as usize);
    }
    // Of the rounded number: 9.996 becomes 10.0.
    let rounded = format!("{:.2e}", value.abs());
    let exponent = rounded.split_once('e').and_then(|(_, e)| e.parse().ok());
    let digits = (2 - exponent.unwrap_or(0)).clamp(0, 12) as usize;
    format!("{value:.digits$}")
}

/// The first and the last characters of a longer text, with an ellipsis between.
pub fn without_middle(text: &str, [first, last]: [usize; 2]) -> String {
    let count = text.chars().count();
    if count <= first + last {
        return text.to_owned();
    }
    let mut kept: String = text.chars().take(first).collect();
    kept.push_str("...");
    kept.extend(text.chars().skip(count - last));
    kept
}

/// Tests for characters that must not reach an output.
///
/// Control characters, marks and overrides of the direction, zero-width characters, tags, and
/// characters that XML does not allow.
fn is_harmful(c: char) -> bool {
    c.is_control()
        || matches!(c,
            '\u{61c}' | '\u{200b}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}'
            | '\u{2060}'..='\u{206f}' | '\u{feff}' | '\u{fff9}'..='\u{fffb}'
            | '\u{e0000}'..='\u{e007f}')
        || u32::from(c) & 0xFFFE == 0xFFFE
}

/// Lower-case hexadecimal.
pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

/// Whole numbers with digits in groups of three.
pub fn count(value: usize) -> String {
    let digits = value.to_string();
    let groups = digits.as_bytes().rchunks(3).rev();
    let groups = groups.map(|group| str::from_utf8(group).unwrap_or_default());
    groups.collect::<Vec<_>>().join(",")
}

/// All digits of a number; an exponent if it is longer than any count.
pub fn number(value: f64) -> String {
    match value.abs() < 1e15 {
        true => value.to_string(),
        false => format!("{value:e}"),
    }
}

/// "1 cell", "1,234 cells", "no queries".
pub fn counted(value: usize, one: &str) -> String {
    match value {
        0 => format!("no {}", plural(one)),
        1 => format!("1 {one}"),
        more => format!("{} {}", count(more), plural(one)),
    }
}

/// The first names of a list and the number of the others: "a, b and 3 more".
pub fn first_of(names: &[impl AsRef<str>], most: usize) -> String {
    let named: Vec<&str> = names.iter().take(most).map(AsRef::as_ref).collect();
    match names.len() - named.len() {
        _ if named.is_empty() => "none".to_owned(),
        0 => named.join(", "),
        more => format!("{} and {} more", named.join(", "), count(more)),
    }
}

/// The plural of a regular noun.
fn plural(one: &str) -> String {
    let stem = one.strip_suffix('y');
    let stem = stem.filter(|stem| !stem.ends_with(['a', 'e', 'i', 'o', 'u']));
    match stem {
        Some(stem) => format!("{stem}ies"),
        None if one.ends_with(['x', 's']) || one.ends_with("ch") => format!("{one}es"),
        None => format!("{one}s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_shown_steers_a_terminal_or_ends_a_page() {
        for (text, wanted) in [
            (
                "plain \u{e4}\u{3b1}\u{1f600}",
                "plain \u{e4}\u{3b1}\u{1f600}",
            ),
            ("\u{1b}]0;title\u{7}", "\\u{1b}]0;title\\u{7}"),
            ("\u{9b}31m", "\\u{9b}31m"),
            ("a\tb\u{1b}[31m", "a b\\u{1b}[31m"),
            ("a\r\nb\u{2028}c", "a  b c"),
            ("exe\u{202e}vsc.\u{2069}", "exe\\u{202e}vsc.\\u{2069}"),
            (
                "\0\u{7f}\u{fffe}\u{10ffff}",
                "\\u{0}\\u{7f}\\u{fffe}\\u{10ffff}",
            ),
            ("\u{feff}a\u{200b}", "\\u{feff}a\\u{200b}"),
        ] {
            assert_eq!(plain(text), wanted);
            // Applying it twice changes nothing.
            assert_eq!(plain(&plain(text)), wanted);
        }
        assert_eq!(lines("a\n\u{1b}b\r\n"), "a\n\\u{1b}b \n");
    }

    #[test]
    fn a_long_name_leaves_its_message() {
        let line = message(&format!(
            "unknown scene '{}'; expected a file",
            "a".repeat(100_000)
        ));
        assert!(line.len() < 300 && line.ends_with("aaa'; expected a file"));
    }

    #[test]
    fn three_digits_are_those_of_the_rounded_number() {
        let shown = [9.994, 9.996, -99.96, 0.9996, 999.6].map(significant);
        assert_eq!(shown, ["9.99", "10.0", "-100", "1.00", "1,000"]);
        assert_eq!(
            [999.7, 999_600.0, 999.4].map(time),
            ["1.00 us", "1.00 ms", "999 ns"]
        );
    }

    #[test]
    fn every_character_of_xml_is_legal() {
        let all: String = (char::MIN..=char::MAX).collect();
        for c in plain(&all).chars() {
            let legal = matches!(c, ' '..='\u{d7ff}' | '\u{e000}'..='\u{fffd}' | '\u{10000}'..);
            assert!(legal, "{c:?}");
        }
    }

    #[test]
    fn a_full_disk_is_told_the_same_through_any_writer() {
        let full = || io::Error::from(io::ErrorKind::StorageFull);
        let csv = |error: io::Error| io::Error::from(csv::Error::from(error));
        let json = |error: io::Error| io::Error::from(serde_json::Error::io(error));
        for error in [full(), csv(full()), csv(csv(full())), json(full())] {
            assert_eq!(expected_by(&error, "file"), "; expected room on the disk");
        }
    }

    #[test]
    fn numbers_beyond_any_count_have_an_exponent() {
        let shown = [25.0, 182.25, 999_999_999_999_999.0, 1.5e300, f64::INFINITY].map(number);
        assert_eq!(shown, ["25", "182.25", "999999999999999", "1.5e300", "inf"]);
    }

    #[test]
    fn words_agree_with_their_numbers() {
        for (one, many) in [
            ("box", "boxes"),
            ("query", "queries"),
            ("way", "ways"),
            ("cell", "cells"),
        ] {
            assert_eq!(counted(1, one), format!("1 {one}"));
            assert_eq!(counted(7, one), format!("7 {many}"));
            assert_eq!(counted(0, one), format!("no {many}"));
        }
        assert_eq!(
            [count(7), count(1234), count(1_234_567)],
            ["7", "1,234", "1,234,567"]
        );
        assert_eq!(counted(2000, "query"), "2,000 queries");
        let named = [0, 2, 5].map(|n| first_of(&["a", "b", "c", "d", "e"][..n], 2));
        assert_eq!(named, ["none", "a, b", "a, b and 3 more"]);
    }
}
