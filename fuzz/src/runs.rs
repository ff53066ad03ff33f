//! Readers of what a run leaves: report.json, stream.jsonl and samples.csv.

use std::fs;
use std::path::Path;

use cullbench::report::{
    Basis, JUDGED_METRICS, Report, StoppedRun, Stream, changes, comparisons, growths, merge,
    read_report, read_stream, save_report, settings, surfaces,
};
use tempfile::TempDir;

use crate::read;

/// A finished shard that is a whole plan.
const STREAM: &[u8] = include_bytes!("../corpus/stream/shard.jsonl");
const SAMPLES: &[u8] = include_bytes!("../corpus/samples/shard.csv");

fn folder(files: &[(&str, &[u8])]) -> TempDir {
    let folder = tempfile::tempdir().expect("a place for files");
    for (name, bytes) in files {
        fs::write(folder.path().join(name), bytes).expect("room for a file");
    }
    folder
}

pub fn report(bytes: &[u8]) {
    let folder = folder(&[("report.json", bytes)]);
    if let Some(report) = read(read_report(folder.path())) {
        let text = serde_json::to_vec(&report).expect("a report is JSON");
        let again: Report = serde_json::from_slice(&text).expect("what was written");
        assert_eq!(again, report);
        conclude(folder.path(), &report);
    }
}

/// Everything that is read off a report.
fn conclude(folder: &Path, report: &Report) {
    let _ = surfaces(comparisons(report));
    growths(report);
    settings(report, report);
    let cells = [&report.cells[..]; 2];
    changes(Basis::Reports, cells, 0.05, JUDGED_METRICS);
    save_report(folder, report).expect("room for a file");
}

pub fn stream(bytes: &[u8]) {
    let folder = folder(&[("stream.jsonl", bytes), ("samples.csv", SAMPLES)]);
    let file = folder.path().join("stream.jsonl");
    if let Some((stream, _)) = read(read_stream(&file)) {
        conclude(folder.path(), &stream.report());
        go_on(folder.path());
        fs::write(&file, written(&stream)).expect("room for a file");
        let again = read_stream(&file).expect("what was written").0;
        assert_eq!(again, stream);
    }
}

fn written(stream: &Stream) -> Vec<u8> {
    let text = stream.lines();
    let text = text.flat_map(|line| line.to_json().expect("a line is JSON"));
    text.collect()
}

/// Joins the run with nothing, and continues it.
fn go_on(folder: &Path) {
    if let Some(merged) = read(merge(&[folder.to_owned()], (&[], ""))) {
        read(merged.write(&folder.join("merged"), &|| Ok(())));
    }
    if let Some((stopped, stream)) = read(StoppedRun::open(folder)) {
        assert!(stopped.lost == 0 || stream.finished_at.is_none());
        read(stopped.go_on(&stream));
        let again = read_stream(&folder.join("stream.jsonl"));
        assert_eq!(again.expect("what was left").0.parts, stream.parts);
    }
}

pub fn samples(bytes: &[u8]) {
    go_on(folder(&[("stream.jsonl", STREAM), ("samples.csv", bytes)]).path());
}
