//! The figure of a funnel: items that each stage of the chain leaves, as bars.

use super::figure::{Axis, Figure};
use super::figure_rows::{Form, Row, rows};
use super::text;
use crate::funnel::{FunnelReport, NONE};

/// Bars on a logarithmic axis, from all items to what the last stage passes.
pub fn chain(report: &FunnelReport) -> Figure {
    let count = |mean: f64| match mean.fract() == 0.0 || mean >= 1000.0 {
        true => text::count(mean.round() as usize),
        false => text::significant(mean),
    };
    let row = |name: &str, value: f64, unit: &str, note: String| Row {
        value,
        label: format!("{name} {} {unit}", count(value)),
        note,
        ..Row::default()
    };
    let all = row("all", report.items as f64, "items", String::new());
    let chosen = report.stages.iter().filter(|row| row.is_chosen);
    let stages = chosen.filter(|row| row.back_end.name != NONE).map(|stage| {
        let (name, errors) = (stage.back_end.stage.name(), &stage.errors);
        let by = stage.structure.as_deref().unwrap_or(stage.back_end.name);
        let given = count(errors.input_count);
        let note = format!("{name} by {by}: of {given} {}", stage.unit);
        row(name, errors.output_count, stage.unit, note)
    });
    let bars: Vec<Row> = [all].into_iter().chain(stages).collect();
    let axis = Axis::log("", bars.iter().map(|row| row.value), 3.0, &count);
    let caption = format!(
        "{}, {}: what each stage leaves per view (logarithmic)",
        report.scene, report.path
    );
    rows([caption.clone(), caption], &axis, None, Form::Bars, &bars)
}
