//! `cullbench check`: goes through a file of certificates with a program that shares
//! no code with what made them.

use std::collections::BTreeMap;
use std::io::{self, Write};

use anyhow::{Context, bail};

use super::funnel_args::CheckArgs;
use super::shared_args::TableFormat;
use super::{Ending, load_scene, print_json, text, unread_is_fine};
use crate::input::read_file;
use crate::visibility::Solids;
use crate::visibility::truth::{Certificates, Counts, check as check_proofs};
use serde::Serialize;

/// What was found in a file.
#[derive(Default, Serialize)]
struct Checked {
    view_count: usize,
    visible_count: usize,
    hidden_count: usize,
    tied_count: usize,
    undecided_count: usize,
    cell_count: usize,
    /// The first proof of each view that does not hold.
    rejected: Vec<Rejection>,
}

#[derive(Serialize)]
struct Rejection {
    line: usize,
    item: u32,
    reason: &'static str,
}

impl Checked {
    fn add(&mut self, counts: &Counts) {
        self.visible_count += counts.visible;
        self.hidden_count += counts.hidden;
        self.tied_count += counts.tied;
        self.undecided_count += counts.undecided;
        self.cell_count += counts.cells;
    }
}

pub fn check(args: &CheckArgs) -> anyhow::Result<Ending> {
    let file = args.certificates.display().to_string();
    let bytes = read_file(&args.certificates)?;
    let Ok(lines) = std::str::from_utf8(&bytes) else {
        bail!("{file}: no UTF-8; expected certificates as lines of JSON");
    };
    let mut scenes: BTreeMap<String, Solids> = BTreeMap::new();
    let mut checked = Checked::default();
    for (number, line) in lines
        .lines()
        .enumerate()
        .filter(|(_, line)| !line.trim().is_empty())
    {
        let place = || format!("{file}, line {}", number + 1);
        let certificates = Certificates::from_json(line)
            .with_context(|| format!("{}: expected the certificates of a view as JSON", place()))?;
        let name = args
            .scene
            .clone()
            .unwrap_or_else(|| certificates.scene.clone());
        if !scenes.contains_key(&name) {
            let scene = load_scene(&name, &args.scene_args, 1)
                .with_context(|| format!("{}: the scene it is about", place()))?;
            scenes.insert(name.clone(), Solids::of(&scene));
        }
        let boxes = &scenes[&name].boxes;
        if boxes.len() != certificates.boxes {
            bail!(
                "{}: it is about {} boxes; expected the {} of scene '{name}'",
                place(),
                certificates.boxes,
                boxes.len()
            );
        }
        checked.view_count += 1;
        match check_proofs(&certificates, boxes) {
            Ok(counts) => checked.add(&counts),
            Err(rejected) => checked.rejected.push(Rejection {
                line: number + 1,
                item: rejected.item,
                reason: rejected.reason,
            }),
        }
    }
    if checked.view_count == 0 {
        bail!("{file}: no certificate in it; expected at least one line");
    }
    unread_is_fine(match args.format {
        TableFormat::Json => print_json(&checked),
        TableFormat::Table => show(&checked, &mut text::terminal()),
    })?;
    Ok(match checked.rejected.is_empty() {
        true => Ending::Ok,
        false => Ending::WrongAnswer,
    })
}

fn show(checked: &Checked, out: &mut impl Write) -> io::Result<()> {
    for Rejection { line, item, reason } in &checked.rejected {
        writeln!(out, "line {line}, item {item}: rejected, {reason}")?;
    }
    let decided = checked.visible_count + checked.hidden_count + checked.tied_count;
    writeln!(
        out,
        "{}: {} proven visible, {} proven hidden ({} of images), {} tied, {} undecided.",
        text::counted(checked.view_count, "view"),
        checked.visible_count,
        checked.hidden_count,
        text::counted(checked.cell_count, "part"),
        checked.tied_count,
        checked.undecided_count
    )?;
    match checked.rejected.len() {
        0 => writeln!(out, "All {decided} proofs hold."),
        count => writeln!(
            out,
            "{} with a proof that does not hold.",
            text::counted(count, "view")
        ),
    }
}
