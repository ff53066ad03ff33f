//! `cullbench merge`: the shards of a plan become one run, with the files of one.

use anyhow::Context;

use super::args::MergeArgs;
use super::document::show;
use super::report::{close, shown, write_page};
use super::run_resume::{command_line, same_recorded};
use super::{Ending, expect_folder, interrupt, text, unread_is_fine};
use crate::report::{merge as join, read_stream};

pub fn merge(args: &MergeArgs) -> anyhow::Result<Ending> {
    expect_folder("--out", Some(&args.out))?;
    let mut first: Option<Vec<String>> = None;
    for path in &args.runs {
        let other = read_stream(&path.join("stream.jsonl"))?.0.header.args;
        // The first as well: its own options may be none.
        let first = first.get_or_insert_with(|| other.clone());
        same_recorded(first, &other).with_context(|| path.display().to_string())?;
    }
    let kept = without_place(&first.unwrap_or_default());
    let merged = join(&args.runs, (&kept, &command_line(&kept)))?;
    interrupt::from_now_on_finish();
    if !merged.write(&args.out, &interrupt::asked)? {
        return Ok(Ending::Interrupted);
    }
    let report = merged.stream.report();
    write_page(&report, &args.out, Vec::new())?;
    unread_is_fine(show(&shown(&report, false, text::width())))?;
    let cells = text::counted(report.cells.len(), "cell");
    let shards = text::counted(args.runs.len(), "shard");
    let basis = format!("{cells} of {shards}; {}", text::conclusion(&report));
    unread_is_fine(close(&basis, None, &args.out, None))?;
    Ok(Ending::of(!report.has_failed()))
}

/// The options but for those that say which shard, and where to.
fn without_place(args: &[String]) -> Vec<String> {
    let mut kept = Vec::new();
    let mut left = args.iter();
    while let Some(arg) = left.next() {
        match arg.as_str() {
            "--shard" | "--out" => drop(left.next()),
            joined if joined.starts_with("--shard=") || joined.starts_with("--out=") => {}
            _ => kept.push(arg.clone()),
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_merged_run_is_of_no_shard_and_no_place() {
        let args = |line: &str| -> Vec<String> { line.split(' ').map(str::to_owned).collect() };
        for line in [
            "run --shard 1/2 --seed 3 --out a",
            "run --out=a --seed 3 --shard=1/2",
        ] {
            assert_eq!(without_place(&args(line)), args("run --seed 3"), "{line}");
        }
    }
}
