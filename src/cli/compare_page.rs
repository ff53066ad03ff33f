//! Output of a comparison: its table, and its page with the changes as intervals.

use super::command_args::CompareArgs;
use super::compare_table::{CompareTable, change_of, name};
use super::diagram::{Form, Row, rows};
use super::document::{Block, to_page};
use super::figure::{Axis, Figure, is_drawn};
use super::{Ending, text, unread_is_fine, write_text};
use crate::report::Changes;

/// Rows in the figure.
const DRAWN: usize = 40;

/// Prints a comparison in the chosen format, and writes its page.
pub fn show(table: &CompareTable, args: &CompareArgs) -> anyhow::Result<Ending> {
    let shown = unread_is_fine(table.print(args));
    if let Some(file) = &args.html {
        let blocks = table.blocks(true, Some(usize::MAX));
        let changes = figure(&table.changes).map(Block::Figure);
        write_text(file, &to_page("compare", 1, changes, blocks))?;
    }
    shown?;
    Ok(table.ending())
}

/// The changes with intervals, the worst first.
fn figure(changes: &Changes) -> Option<Figure> {
    let all = changes.rows.iter().filter_map(|row| {
        let ratio = row.ratio().filter(|ratio| is_drawn(*ratio))?;
        let judged = row.judgement.as_ref();
        let ends = judged.and_then(|judged| judged.lower.zip(judged.upper));
        Some(Row {
            name: row.cell.structure.clone(),
            value: ratio,
            ends: ends.map(<[f64; 2]>::from),
            label: format!("{} {}", row.cell.structure, change_of(ratio, None)),
            note: format!("{}: {}", name(&row.cell), change_of(ratio, ends)),
            ..Row::default()
        })
    });
    let shown: Vec<Row> = all.take(DRAWN).collect();
    shown.first()?;
    let change = |ratio: f64| format!("{:+.0} %", (ratio - 1.0) * 100.0);
    let limits = [1.0 - changes.threshold, 1.0, 1.0 + changes.threshold];
    let values = shown
        .iter()
        .flat_map(|row| row.ends.unwrap_or([row.value; 2]));
    let mut axis = Axis::log("", values.chain(limits), 1.05, &change);
    axis.ticks = limits.to_vec();
    let caption = format!(
        "Change from OLD to NEW with its 95 % interval, the worst {} of {}; lines: no change, \
         and the threshold",
        shown.len(),
        text::counted(changes.rows.len(), "figure")
    );
    let labels = [caption.clone(), caption];
    Some(rows(labels, &axis, Some(1.0), Form::Marks, &shown))
}
