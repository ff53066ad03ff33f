//! Views of a run: visible items of each, and the clock readings along the path.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use super::Report;
use super::files::{SAMPLES, STREAM};
use super::reading::read_stream;
use crate::measure::{GroupKey, TaskKind};
use crate::shown::shown_field;
use crate::statistics::median;

/// A clock reading along a path: the median over all rounds.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Reading {
    /// Middle of the views, as an index of the path.
    pub frame: f64,
    /// Number of views in the reading.
    pub queries: u32,
    /// CPU time per query.
    pub ns: f64,
}

/// The views of one group.
#[derive(Clone, Default, PartialEq, Debug)]
pub struct Views {
    /// Visible items of each view of the path.
    pub visible: Vec<u64>,
    /// Readings of each structure, in the order of the path.
    pub times: BTreeMap<String, Vec<Reading>>,
}

/// Times of each reading, by its first view and the number of views.
type Readings = BTreeMap<(u32, u32), Vec<f64>>;

/// The columns of samples.csv that matter here.
#[derive(Deserialize)]
struct SampleRow {
    scene: String,
    path: String,
    cache: String,
    structure: String,
    test: String,
    task: String,
    frame: u32,
    queries: u32,
    cpu_ns: f64,
}

/// The views of a report in the folder it came from, by the text of their keys.
///
/// Nothing without the stream of the very run.
pub fn views(folder: &Path, report: &Report) -> BTreeMap<String, Views> {
    let stream = read_stream(&folder.join(STREAM));
    let Some((stream, _)) = stream.ok().filter(|s| s.0.header.run.id == report.run.id) else {
        return BTreeMap::new();
    };
    let mut cells: BTreeMap<[String; 5], Readings> = BTreeMap::new();
    let samples = csv::Reader::from_path(folder.join(SAMPLES));
    for row in samples.into_iter().flat_map(csv::Reader::into_deserialize) {
        let Ok(row): Result<SampleRow, _> = row else {
            break;
        };
        if row.task == TaskKind::Query.name() {
            let key = [row.scene, row.path, row.cache, row.test, row.structure];
            let readings = cells.entry(key).or_default();
            let times = readings.entry((row.frame, row.queries)).or_default();
            times.push(row.cpu_ns);
        }
    }
    let mut all = BTreeMap::new();
    for kept in stream.parts.iter().map(|kept| &kept.part) {
        let Some(known) = kept.known.as_ref().filter(|_| kept.process == 0) else {
            continue;
        };
        let schedule = known.query.as_ref().map(|query| &query.schedule.cameras);
        let own = |label: &str| {
            let GroupKey {
                scene,
                path,
                cache,
                test,
                ..
            } = &kept.key;
            let key = [scene, path, cache, test].map(|name| shown_field(name));
            let [scene, path, cache, test] = key;
            let readings = cells.get(&[scene, path, cache, test, shown_field(label)])?;
            let cameras = schedule?;
            let reading = |(&(frame, queries), ns): (&(u32, u32), &Vec<f64>)| {
                let first = cameras.iter().position(|camera| *camera == frame)?;
                let last = cameras.get(first + (queries as usize).max(1) - 1)?;
                Some(Reading {
                    frame: (f64::from(frame) + f64::from(*last)) / 2.0,
                    queries,
                    ns: median(ns)?,
                })
            };
            Some((
                label.to_owned(),
                readings.iter().filter_map(reading).collect(),
            ))
        };
        let labels = kept.subjects.iter().map(|subject| subject.label.as_str());
        let views = Views {
            visible: known.visible.iter().map(|answer| answer.count).collect(),
            times: labels.filter_map(own).collect(),
        };
        all.insert(kept.key.id(), views);
    }
    all
}
