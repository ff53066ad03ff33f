//! Pages of a command's output, with origin and the meaning of their columns.

use std::collections::BTreeSet;

use super::document::{Block, Table, to_html};
use super::figure::Figure;
use super::run_resume::{command_line, typed_args};
use super::{program, run_table, text};
use crate::input::warnings;
use crate::measure::{BOUNDS, METRICS, Machine, Source, Toolchain};

/// A page of a terminal's output: conclusions, figures, and the other blocks.
pub fn to_page(
    about: &str,
    conclusions: impl IntoIterator<Item = Block>,
    figures: impl IntoIterator<Item = Figure>,
    blocks: Vec<Block>,
) -> String {
    let title = format!("{} {about}", program::name());
    let mut all = vec![Block::Heading(1, title.clone())];
    all.extend(conclusions);
    all.extend(Block::warnings(warnings()));
    all.extend(figures.into_iter().map(Block::Figure));
    // Without the title for terminals.
    let is_title = |block: &Block| matches!(block, Block::Heading(1, _));
    all.extend(blocks.into_iter().filter(|block| !is_title(block)));
    all.extend(glossary(&all));
    all.push(Block::heading("Machine and command"));
    let command = command_line(&typed_args().unwrap_or_default());
    let (machine, source) = (Machine::capture(), program::source());
    let lines = origin(&command, &machine, &Toolchain::capture(), &source);
    all.extend(lines.map(Block::Line));
    to_html(&title, &all)
}

/// Command, machine and build, a line each.
pub fn origin(command: &str, machine: &Machine, built: &Toolchain, source: &Source) -> [String; 3] {
    let known = |text: &Option<String>| text.clone().unwrap_or_else(|| "unknown".to_owned());
    let (cpu, kernel) = (known(&machine.cpu), known(&machine.kernel));
    let cores = text::counted(machine.cores, "core");
    let isa = &machine.instruction_set;
    let (rustc, profile) = (known(&built.rustc), known(&built.profile));
    let (flags, features) = (&built.flags, built.features.join(","));
    let dirty = ["", " with a dirty working tree"][usize::from(source.dirty == Some(true))];
    let commit = known(&source.commit);
    [
        format!("Command: {command}"),
        format!("Machine: {cpu}, {cores}, kernel {kernel}, instruction set {isa}."),
        format!(
            "Built with {rustc}, profile {profile}, flags '{flags}', features '{features}'; source \
             {commit}{dirty}."
        ),
    ]
}

/// Meaning of the columns and labels that occur in tables.
pub fn glossary(blocks: &[Block]) -> Vec<Block> {
    let tables = blocks.iter().filter_map(|block| match block {
        Block::Table(table) | Block::Heat(table) => Some(table),
        _ => None,
    });
    let rows = tables.flat_map(|table| table.rows.iter().chain([&table.header]));
    let texts: BTreeSet<&String> = rows.flatten().collect();
    let is_of = |text: &str, name: &str| {
        text.split(", ").next() == Some(name) || name.starts_with('±') && text.contains(['[', '±'])
    };
    let occurs = |name: &str| texts.iter().any(|text| is_of(text, name));
    let figures = run_table::OF_QUERIES.iter().chain(&run_table::OF_FRAMES);
    let figures = figures.map(|(column, metric)| {
        let info = METRICS.iter().find(|info| info.name == *metric);
        [*column, info.map_or("", |info| info.summary)]
    });
    let bounds = BOUNDS.iter().map(|bound| [bound.name, bound.summary]);
    let meanings = MEANINGS.lines().filter_map(|line| line.split_once(" | "));
    let meanings = meanings.map(<[&str; 2]>::from).chain(figures).chain(bounds);
    let speedups = texts.iter().filter(|text| text.starts_with("vs "));
    let speedups = speedups.map(|name| [name, "time of that structure / time of this one"]);
    let mut table = Table::of("column | meaning");
    // The first meaning of a name is that for pages.
    let mut known = BTreeSet::new();
    let rows = meanings.filter(|row| occurs(row[0])).chain(speedups);
    for row in rows.filter(|row| known.insert(row[0])) {
        table.add_row(row);
    }
    match table.rows.is_empty() {
        true => Vec::new(),
        false => Block::section("Columns", table).into(),
    }
}

/// Columns that are not metrics, and their meanings.
const MEANINGS: &str = include_str!("assets/meanings.txt");
