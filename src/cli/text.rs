//! Figures as text.

use std::io::{self, Write};
use std::iter;

use crate::measure::Metric;
use crate::report::{Comparison, Report, ReportCell};

/// Terminal columns of a text: two for each Chinese character.
pub use console::measure_text_width as across;

pub use crate::shown::*;
use crate::statistics::Estimate;
use crate::verify::ErrorCount;

/// "698 items, 2 bad items left out".
pub fn items(count: usize, left_out: usize) -> String {
    let bad = any(left_out, "bad item", |bad| format!("{bad} left out"));
    joined([counted(count, "item"), bad])
}

/// Text about counted things; empty if there are none.
pub fn any(count: usize, thing: &str, show: impl FnOnce(String) -> String) -> String {
    some((count > 0).then(|| counted(count, thing)), show)
}

/// A figure as text; empty if there is none.
pub fn some<T>(value: Option<T>, show: impl FnOnce(T) -> String) -> String {
    value.map(show).unwrap_or_default()
}

/// Texts that are not empty, separated by commas.
pub fn joined(texts: impl IntoIterator<Item = impl AsRef<str>>) -> String {
    let texts = texts.into_iter().map(|text| text.as_ref().to_owned());
    let texts: Vec<String> = texts.filter(|text| !text.is_empty()).collect();
    texts.join(", ")
}

/// "Cold, six-box: Take wide .."; the sentence alone if the name is empty.
pub fn labelled(name: &str, sentence: &str) -> String {
    let (first, rest) = name.split_at(name.chars().next().map_or(0, char::len_utf8));
    match name {
        "" => sentence.to_owned(),
        _ => format!("{}{rest}: {sentence}", first.to_uppercase()),
    }
}

/// "10 processes", or the fewest and the most: "3 to 10 processes".
pub fn range(all: impl Iterator<Item = usize> + Clone, shown: impl Fn(usize) -> String) -> String {
    let (least, most) = (all.clone().min().unwrap_or(0), all.max().unwrap_or(0));
    match least == most {
        true => shown(most),
        false => format!("{} to {}", count(least), shown(most)),
    }
}

/// Basis of the times of a report, and the missing parts of its plan.
pub fn conclusion(report: &Report) -> String {
    basis_of_times(report) + &missing(report)
}

/// "; shard 1/2; not measured: city along orbit"; empty for a whole run.
pub fn missing(report: &Report) -> String {
    let (shard, missing) = (&report.run.shard, &report.run.missing);
    let shard = some(shard.as_ref(), |shard| format!("; shard {shard}"));
    let first = || format!("; not measured: {}", first_of(missing, 4));
    shard + &some(missing.first(), |_| first())
}

/// Processes and intervals of a report, in one sentence.
fn basis_of_times(report: &Report) -> String {
    let processes = report.cells.iter().map(|c| c.times.processes);
    let least = processes.filter(|p| *p > 0).min().unwrap_or(0);
    let planned = report.run.processes as usize;
    let of_planned = |processes: String| match report.run.finished_at {
        None if least < planned => format!("{} of {planned} processes", count(least)),
        _ => processes,
    };
    if least == 0 {
        return "nothing was timed".to_owned();
    }
    if least < 3 {
        return format!(
            "{}: times without intervals, ranks by their order alone (--processes 10 gives \
             intervals)",
            of_planned(counted(least, "process"))
        );
    }
    let few = ["", "; with fewer than ten the intervals are broad"][usize::from(least < 10)];
    let over = of_planned(format!("{least} processes"));
    let twins = report.noise.twins.iter();
    let twins: Vec<bool> = twins.filter_map(|twin| twin.holds_one()).collect();
    let hold = twins.iter().filter(|holds| **holds).count();
    let check = match twins.len() {
        0 => String::new(),
        all => format!("; A/A check: {hold} of {all} intervals contain 1"),
    };
    format!("95 % intervals over {over}{few}{check}")
}

/// Three significant digits without trailing zeros: 12.5, 9, 0.05.
pub fn short(value: f64) -> String {
    let text = significant(value);
    match text.contains('.') && !text.contains('e') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// A value with its 95 % interval: "4.04 [3.95, 4.16]".
pub fn within(found: Estimate) -> String {
    significant(found.value) + &interval(found.ends(), 1.0)
}

/// A time in ns with its 95 % interval in the same unit: "1.81 us [1.75, 1.90]".
pub fn time_within(ns: Estimate) -> String {
    time(ns.value) + &interval(ns.ends(), unit(ns.value).0)
}

/// A time with its uncertainty: "1.3±0.4 us", "8.12 [0.5, 48] us".
pub fn time_plus_minus(ns: Option<Estimate>) -> String {
    some(ns, |ns| {
        let (size, name) = unit(ns.value);
        format!("{} {name}", with_ends(ns.per(size)))
    })
}

/// A value with a margin, or with its interval if an end is far.
fn with_ends(found: Estimate) -> String {
    let value = found.value;
    let is_near = |end: f64| value == 0.0 || (end / value).ln().abs() < 0.5;
    let margin = |[lower, upper]: [f64; 2]| f64::max(value - lower, upper - value);
    match found.ends() {
        Some(ends) if !ends.into_iter().all(is_near) => {
            significant(value) + &interval(Some(ends), 1.0)
        }
        ends => plus_minus(value, ends.map(margin)),
    }
}

/// A value with a margin, rounded to the margin's leading digit.
///
/// A value below that digit has one more: "83.4±0.7", "560000±9000", "70±200", "0.2±4.0". Zero is
/// shown by its upper bound: "<0.0005".
pub fn plus_minus(value: f64, margin: Option<f64>) -> String {
    let Some(margin) = margin.filter(|margin| margin.is_finite() && *margin > 0.0) else {
        return significant(value);
    };
    let place = |x: f64| 10f64.powi(x.log10().floor() as i32);
    let of_margin = place(margin);
    let unit = match value.abs() / of_margin {
        0.2..1.0 => 0.1 * of_margin,
        _ => of_margin,
    };
    let shown = (value / unit).round() * unit;
    // A margin is rounded up, or it might not cover the interval any more.
    let margin = ((margin + (value - shown).abs()) / of_margin - 1e-9).ceil() * of_margin;
    let decimals = (-unit.log10().round()).max(0.0) as usize;
    match value == 0.0 {
        true => format!("<{margin:.decimals$}"),
        false => format!("{shown:.decimals$}±{margin:.decimals$}"),
    }
}

/// A time in ns or ms with its uncertainty: "3.64 us ± 11 %".
///
/// A share if the interval is nearly symmetric in the logarithm, else its ends; empty if an end is
/// unknown.
pub fn time_with(metric: &Metric) -> String {
    let size = [1.0, 1e6][usize::from(metric.unit == "ms")];
    let ns = metric.estimate().times(size);
    let (value, ends) = (ns.value, ns.ends());
    let logs = ends.map(|[lower, upper]| [value / lower, upper / value].map(f64::ln));
    let uncertainty = match logs {
        Some([below, above]) if (below - above).abs() <= 0.2 * above && above < 0.5 => {
            let percent = below.max(above).exp_m1() * 100.0;
            let digits = usize::from(percent < 1.0);
            format!(" ± {percent:.digits$} %")
        }
        _ => interval(ends, unit(value).0),
    };
    time(value) + &uncertainty
}

/// A rate per `units` with its 95 % interval; empty if there is none.
pub fn rate(rate: Option<Estimate>, units: f64) -> String {
    some(rate.map(|rate| rate.times(units)), with_ends)
}

/// Text with spaces replaced by line breaks in lines longer than `width`.
///
/// Continuations of an indented line are indented as well.
pub fn wrapped(text: &str, width: usize) -> String {
    let mut lines: Vec<String> = Vec::new();
    for line in text.split('\n') {
        if across(line) <= width {
            lines.push(line.to_owned());
            continue;
        }
        let words = line.trim_start_matches(' ');
        let indent = &line[..line.len() - words.len()];
        lines.push(indent.to_owned());
        for word in words.split(' ') {
            match lines.last_mut() {
                Some(line) if line.len() == indent.len() => line.push_str(word),
                Some(line) if across(line) + across(word) < width => {
                    *line += &format!(" {word}");
                }
                _ => lines.push(format!("{indent}{word}")),
            }
        }
    }
    lines.join("\n")
}

/// A name and a text per row, the text wrapped in its own column.
pub fn entries<T: AsRef<str>>(rows: impl IntoIterator<Item = [T; 2]>, width: usize) -> String {
    let rows: Vec<[T; 2]> = rows.into_iter().collect();
    let names = rows.iter().map(|[name, _]| name.as_ref().chars().count());
    let names = names.max().unwrap_or(0);
    let mut all = String::new();
    for [name, text] in &rows {
        let text = wrapped(text.as_ref(), width.saturating_sub(names + 4));
        let before = iter::once(name.as_ref()).chain(iter::repeat(""));
        for (line, name) in text.lines().zip(before) {
            all += format!("  {name:<names$}  {line}").trim_end();
            all.push('\n');
        }
    }
    all
}

/// " [lower, upper]" in a unit; empty without ends.
pub fn interval(ends: Option<[f64; 2]>, unit: f64) -> String {
    some(ends, |ends| {
        let [lower, upper] = ends.map(|end| significant(end / unit).replace(',', ""));
        format!(" [{lower}, {upper}]")
    })
}

/// Basis of the times of a study, with the ratio of the task timed twice.
pub fn over(processes: usize, twin: Option<&Estimate>) -> String {
    let count = counted(processes, "process");
    let twice = |twin: &Estimate| format!(" (measured twice: {} times as long)", within(*twin));
    match processes {
        0..3 => format!("{count}: times without intervals, no ties (--processes 10 gives both)"),
        _ => format!("{count}, times with 95 % intervals{}", some(twin, twice)),
    }
}

/// Basis of the times of a table.
///
/// "10 processes, 100 rounds each; 64 cameras timed, 128 checked, 8 of them against the oracle".
pub fn basis(comparison: &Comparison) -> String {
    if comparison.timed(|_| 0).next().is_none() {
        return "no times".to_owned();
    }
    let of = |number: fn(&ReportCell) -> usize, shown: &dyn Fn(usize) -> String| {
        range(comparison.timed(number), shown)
    };
    let is_of_frames = !comparison.about().path.motion.is_empty();
    let asked = ["camera", "query"][usize::from(is_of_frames)];
    format!(
        "{}, {} each; {} timed, {} checked, {} of them against the oracle",
        of(|cell| cell.times.processes, &|n| counted(n, "process")),
        of(|cell| cell.times.rounds, &|n| counted(n, "round")),
        of(|cell| cell.times.cameras_timed, &|n| counted(n, asked)),
        of(|cell| cell.times.cameras_checked, &count),
        count(comparison.of_any("judged_queries").unwrap_or(0.0) as usize)
    )
}

/// False positives by storage, planes and test: "12/0/80".
pub fn sources(errors: ErrorCount) -> String {
    let sources = [errors.by_storage, errors.by_planes, errors.by_test()];
    sources.map(|items| items.to_string()).join("/")
}

/// A word quoted for a shell.
pub fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "_-./:=,%+@".contains(c);
    match !word.is_empty() && word.chars().all(is_plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', "'\\''")),
    }
}

/// Escaped text of an element or an attribute.
pub fn html(text: &str) -> String {
    let text = plain(text).replace('&', "&amp;").replace('<', "&lt;");
    let text = text.replace('>', "&gt;").replace('"', "&quot;");
    text.replace('\'', "&#39;")
}

/// A share as a percentage, rounded neither up to 100 nor down to 0.
pub fn percent(share: f64) -> String {
    match format!("{:.2}", share * 100.0).as_str() {
        "100.00" if share < 1.0 => ">99.99 %".to_owned(),
        "0.00" if share > 0.0 => "<0.01 %".to_owned(),
        rounded => format!("{rounded} %"),
    }
}

/// A share in percent with up to three digits, never rounded up to 100: "0.1 %".
pub fn short_percent(share: f64) -> String {
    match share {
        0.99..1.0 => percent(share),
        _ => format!("{} %", short(share * 100.0)),
    }
}

/// Columns of the terminal of standard output; 80 for anything else.
pub fn width() -> usize {
    let size = console::Term::stdout().size_checked();
    let columns = size.map(|(_, columns)| usize::from(columns));
    columns.filter(|columns| *columns > 0).unwrap_or(80)
}

/// Prints text without control characters from outside.
pub fn print(parts: &[String]) -> io::Result<()> {
    let text = lines(&parts.join("\n")) + "\n";
    io::stdout().lock().write_all(text.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::super::document::Table;
    use super::*;

    #[test]
    fn a_time_has_the_larger_half_of_its_interval_or_both_ends() {
        let shown = |[lower, upper]: [Option<f64>; 2]| {
            let value = 1301.0;
            time_plus_minus(Some(Estimate {
                value,
                lower,
                upper,
            }))
        };
        assert_eq!(shown([Some(1201.0), Some(1681.0)]), "1.3±0.4 us");
        assert_eq!(shown([Some(0.0), Some(2601.0)]), "1.30 [0, 2.60] us");
        assert_eq!(shown([Some(1201.0), Some(9000.0)]), "1.30 [1.20, 9.00] us");
        assert_eq!(shown([Some(1300.0), None]), "1.30 us");
        assert_eq!(time_plus_minus(None), "");
    }

    #[test]
    fn a_margin_is_a_share_where_the_interval_is_symmetric() {
        let shown = |value: f64, lower, upper| {
            let unit = "ns".to_owned();
            time_with(&Metric {
                value,
                lower,
                upper,
                unit,
            })
        };
        assert_eq!(shown(3640.0, Some(3280.0), Some(4040.0)), "3.64 us ± 11 %");
        assert_eq!(shown(100.0, Some(99.6), Some(100.4)), "100 ns ± 0.4 %");
        assert_eq!(shown(100.0, Some(100.0), Some(100.0)), "100 ns ± 0.0 %");
        assert_eq!(shown(100.0, Some(90.0), Some(101.0)), "100 ns [90.0, 101]");
        assert_eq!(shown(100.0, Some(40.0), Some(250.0)), "100 ns [40.0, 250]");
        assert_eq!(shown(100.0, Some(0.0), None), "100 ns");
    }

    #[test]
    fn figures_have_three_digits_and_a_unit() {
        let cases = [
            (12.345, "12.3 ns"),
            (1234.5, "1.23 us"),
            (99_500.0, "99.5 us"),
            (7.5e6, "7.50 ms"),
            (2e9, "2.00 s"),
        ];
        for (ns, text) in cases {
            assert_eq!(time(ns), text);
        }
        assert_eq!(significant(0.012_34), "0.0123");
        assert_eq!([999.4, -12_345.6].map(significant), ["999", "-12,346"]);
        assert_eq!(
            [1e308, -1e15, 5e-324, 1e-9].map(significant),
            ["1.00e308", "-1.00e15", "4.94e-324", "0.00000000100"]
        );
        assert_eq!(percent(0.999_99), ">99.99 %");
        assert_eq!(
            (percent(1.0), percent(0.98)),
            ("100.00 %".into(), "98.00 %".into())
        );
    }

    #[test]
    fn an_interval_is_in_the_unit_of_its_value() {
        let metric = Metric {
            value: 1810.0,
            lower: Some(990.0),
            upper: Some(1_900_000.0),
            unit: "ns".to_owned(),
        };
        assert_eq!(time_within(metric.estimate()), "1.81 us [0.990, 1900]");
        assert_eq!(within(metric.estimate()), "1,810 [990, 1900000]");
        let bare = Metric {
            lower: None,
            ..metric
        };
        assert_eq!(time_within(bare.estimate()), "1.81 us");
    }

    #[test]
    fn tables_and_lines_hold_no_escapes() {
        let mut table = Table::of("a\u{1b}b");
        table.add_row(["two\nlines\u{202e}"]);
        let shown = table.bare();
        assert!(shown.contains("a\\u{1b}b") && shown.contains("two lines\\u{202e}"));
        assert_eq!(lines("\u{1b}[2J\n7\n"), "\\u{1b}[2J\n7\n");
    }

    #[test]
    fn margins_leave_their_digits_and_lines_their_width() {
        let cases = [
            (83.364, Some(0.62), "83.4±0.7"),
            (83.36, Some(0.58), "83.4±0.7"),
            (9.97, Some(0.96), "10.0±1.0"),
            (12.122, Some(0.05), "12.12±0.06"),
            (0.056, Some(0.0061), "0.056±0.007"),
            (560_397.0, Some(8_123.0), "560000±9000"),
            (606.7, Some(3.2), "607±4"),
            (5.0, Some(9.6), "5±10"),
            (71.9, Some(156.0), "70±200"),
            (7.1, Some(22.0), "7±30"),
            (0.24, Some(3.0), "0.2±4.0"),
            (0.6e-3, Some(3.5e-3), "0.0006±0.0040"),
            (0.1e-3, Some(3.1e-3), "0.000±0.004"),
            (5e-324, Some(3.0), "0±3"),
            (0.0, Some(3.1e-4), "<0.0004"),
            (0.25, None, "0.250"),
        ];
        for (value, margin, text) in cases {
            assert_eq!(plus_minus(value, margin), text);
        }
        assert_eq!(
            wrapped("a  b\nfour words of text", 11),
            "a  b\nfour words\nof text"
        );
        assert_eq!(wrapped("  four words", 8), "  four\n  words");
        let rows = [["a", "one two three\n4"], ["name", "5"]];
        assert_eq!(
            entries(rows, 16),
            "  a     one two\n        three\n        4\n  name  5\n"
        );
    }

    #[test]
    fn a_label_begins_with_a_capital_of_any_alphabet() {
        let cases = [
            ("six-box", "Six-box: so"),
            ("écran", "Écran: so"),
            ("", "so"),
        ];
        for (name, shown) in cases {
            assert_eq!(labelled(name, "so"), shown);
        }
    }
}
