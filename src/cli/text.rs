//! How figures and tables look on a terminal.

use comfy_table::presets::UTF8_BORDERS_ONLY;
use comfy_table::{CellAlignment, ContentArrangement, Table};
use cullbench::measure::Metric;

/// A table with a header. Columns named in `right` hold numbers.
pub fn table(header: &[&str], right: &[usize]) -> Table {
    let mut table = Table::new();
    table
        .load_style(UTF8_BORDERS_ONLY)
        .set_content_arrangement(ContentArrangement::Disabled)
        .set_header(header.iter().copied());
    for &column in right {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}

/// Nanoseconds with three significant digits and a fitting unit.
pub fn time(ns: f64) -> String {
    let (value, unit) = match ns {
        n if n < 1e3 => (n, "ns"),
        n if n < 1e6 => (n / 1e3, "us"),
        n if n < 1e9 => (n / 1e6, "ms"),
        n => (n / 1e9, "s"),
    };
    format!("{} {unit}", significant(value))
}

/// Three significant digits, no exponent: 0.0123, 1.23, 12.3, 123, 12345.
pub fn significant(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let digits = 2 - value.abs().log10().floor() as i32;
    format!("{value:.*}", digits.clamp(0, 12) as usize)
}

/// A value with its interval: "4.04 [3.95, 4.16]"; nothing if there is none.
pub fn estimate(metric: Option<&Metric>) -> String {
    let Some(metric) = metric else {
        return String::new();
    };
    let value = significant(metric.value);
    match (metric.lower, metric.upper) {
        (Some(lower), Some(upper)) => {
            format!("{value} [{}, {}]", significant(lower), significant(upper))
        }
        _ => value,
    }
}

/// A share as a percentage, never rounded up to 100.
pub fn percent(share: f64) -> String {
    let rounded = format!("{:.2}", share * 100.0);
    if rounded == "100.00" && share < 1.0 {
        return ">99.99 %".to_owned();
    }
    format!("{rounded} %")
}

/// Whole numbers in groups of three.
pub fn count(value: usize) -> String {
    let digits = value.to_string();
    let mut grouped = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            grouped.push(',');
        }
        grouped.push(digit);
    }
    grouped
}

/// Text of a file as a terminal may have it: no control characters.
pub fn plain(text: &str) -> String {
    text.replace(char::is_control, " ")
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert_eq!(significant(12_345.6), "12346");
        assert_eq!(percent(0.999_99), ">99.99 %");
        assert_eq!(
            (percent(1.0), percent(0.98)),
            ("100.00 %".into(), "98.00 %".into())
        );
        assert_eq!(
            [count(7), count(1234), count(1_234_567)],
            ["7", "1,234", "1,234,567"]
        );
    }
}
