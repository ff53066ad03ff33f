//! Baselines: reports that `run --save NAME` keeps by name, each the OLD of
//! `compare --baseline NAME`.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};

use super::text;
use crate::report::{Report, read_report, write_atomically};

/// Folder of the baselines, beside the runs.
pub const FOLDER: &str = "results/baselines";

/// File of a baseline.
pub fn file(name: &str) -> PathBuf {
    Path::new(FOLDER).join(format!("{name}.json"))
}

/// Keeps a report under a name, in the place of an older one.
pub fn save(name: &str, report: &Report) -> anyhow::Result<()> {
    fs::create_dir_all(FOLDER).context(FOLDER)?;
    let write = |out: &mut dyn Write| Ok(serde_json::to_writer_pretty(out, report)?);
    Ok(write_atomically(&file(name), write)?)
}

/// Reads a baseline and the run to compare with it, by default the newest run under
/// results/.
pub fn sides(name: &str, new: Option<&Path>) -> anyhow::Result<[Report; 2]> {
    ensure!(
        file(name).is_file(),
        "no baseline '{name}' in {FOLDER}; {}",
        match names(FOLDER, |_| true).as_slice() {
            [] => "expected one that `run --save NAME` kept".to_owned(),
            known => format!("available: {}", known.join(", ").replace(".json", "")),
        }
    );
    let old = read_report(&file(name))?;
    let new = match new {
        Some(new) => read_report(new)?,
        None => {
            // Names of runs begin with their time.
            let runs = names("results", |name| {
                name.starts_with(|c: char| c.is_ascii_digit())
            });
            let newest = runs.last().context(
                "no run in results; expected one to compare with the baseline, or its folder",
            )?;
            read_report(&Path::new("results").join(newest))?
        }
    };
    ensure!(
        old.run.id != new.run.id,
        "{} is the baseline '{name}' itself; expected another run to compare with it",
        text::plain(&new.run.id)
    );
    Ok([old, new])
}

/// Names in a folder, sorted; none where there is no folder.
fn names(folder: &str, is_wanted: impl Fn(&str) -> bool) -> Vec<String> {
    let listing = fs::read_dir(folder).into_iter().flatten().flatten();
    let names = listing.filter_map(|entry| entry.file_name().into_string().ok());
    let mut names: Vec<String> = names.filter(|name| is_wanted(name)).collect();
    names.sort();
    names
}
