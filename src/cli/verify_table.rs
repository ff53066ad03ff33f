//! The table of `cullbench verify`.
//!
//! A row per structure, the first differences, and the comparison in a sentence.

use std::io;

use serde::Serialize;

use super::table::{Column, Table};
use super::text;
use crate::report::grouped;
use crate::shown::shortened;

/// Scene of the random cases.
pub(super) const RANDOM: &str = "random";

/// One structure on one scene and path (or on all random cases).
#[derive(Serialize)]
pub(super) struct Check {
    pub(super) scene: String,
    pub(super) path: String,
    pub(super) structure: String,
    pub(super) volumes: usize,
    pub(super) verdicts: u64,
    pub(super) status: &'static str,
    /// The first difference and the command that shows it again.
    pub(super) difference: Option<String>,
}

#[derive(Serialize)]
pub(super) struct Outcome {
    pub(super) ok: bool,
    pub(super) verdicts: u64,
    /// Bad items that were left out of the scenes.
    pub(super) skipped_items: usize,
    /// Checks with a difference, however many verdicts are wrong in each.
    pub(super) mismatches: usize,
    /// True if answers were compared with the cameras as written too.
    pub(super) against_cameras: bool,
    pub(super) seconds: f64,
    pub(super) seed: u64,
    pub(super) cases: u64,
    pub(super) checks: Vec<Check>,
}

pub(super) fn show(outcome: &Outcome) -> io::Result<()> {
    let width = text::width();
    let all = outcome.checks.iter();
    let all = grouped(all.map(|check| (check.structure.as_str(), check)));
    let columns: &[Column<&Vec<&Check>>] = &[
        ("structure", |own| shortened(&own[0].structure, 30)),
        (">paths", |own| {
            let of_paths = own.iter().filter(|check| check.scene != RANDOM);
            text::count(of_paths.count())
        }),
        (">volumes", |own| {
            text::count(own.iter().map(|check| check.volumes).sum())
        }),
        (">verdicts", |own| {
            let verdicts = own.iter().map(|check| check.verdicts).sum::<u64>();
            text::count(verdicts as usize)
        }),
        ("status", |own| {
            let mut statuses: Vec<&str> = own.iter().map(|check| check.status).collect();
            statuses.sort_unstable();
            statuses.dedup();
            statuses.join(", ")
        }),
    ];
    let table = Table::with(all.iter().map(|(_, own)| own), columns);
    let mut told = vec![table.fitted(width)];
    for check in &outcome.checks {
        if let Some(difference) = &check.difference {
            let (structure, scene, path) = (&check.structure, &check.scene, &check.path);
            let about = text::plain(&format!("{structure} on {scene}, {path}"));
            told.push(format!("{about}:\n  {difference}"));
        }
    }
    let own = all.iter().map(|(_, own)| own);
    let differ = own.filter(|own| own.iter().any(|check| check.difference.is_some()));
    let is_silent = |check: &&Check| check.difference.is_none() && !check.is_answered();
    let silent = all.iter().filter(|(_, own)| own.iter().any(is_silent));
    let (of, checks) = (text::counted(all.len(), "structure"), outcome.checks.len());
    let reference = "the reference scan";
    let checked = format!(
        "{}: {} in {:.1} s ({:.1} million/s), {}",
        match (differ.count(), silent.count(), &all[..]) {
            (0, 0, []) => "Nothing was checked".to_owned(),
            (0, 0, [(one, _)]) => format!("{one} returns the sets of {reference}"),
            (0, 0, _) => format!("All {of} return the sets of {reference}"),
            (0, silent, _) if silent == all.len() =>
                "No structure answered (see status)".to_owned(),
            (0, silent, _) => format!(
                "{silent} of {of} did not answer (see status), the others return the sets of \
                 {reference}"
            ),
            (1, ..) => format!("1 of {of} differs from {reference} or misses what the cameras see"),
            (wrong, ..) =>
                format!("{wrong} of {of} differ from {reference} or miss what the cameras see"),
        },
        text::counted(outcome.verdicts as usize, "verdict"),
        outcome.seconds,
        outcome.verdicts as f64 / outcome.seconds / 1e6,
        match outcome.mismatches {
            0 => "no mismatches".to_owned(),
            failed => format!("{failed} of {checks} checks failed (structure x path)"),
        }
    );
    told.push(text::wrapped(&checked, width));
    if !outcome.against_cameras {
        let doubt = "Planes without the full margin may drop visible items: a few cameras were \
                     checked, points on their faces were not.";
        told.push(text::wrapped(doubt, width));
    }
    text::print(&told)
}
