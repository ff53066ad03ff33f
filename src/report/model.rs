//! report.json: one run with everything needed to judge it. Readers ignore
//! unknown fields; the JSON Schema in docs/ is generated from these types.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::measure::{
    Cell, Judged, Machine, Metric, PathInfo, SceneInfo, Source, Status, Toolchain, TwinRatio,
};
use crate::statistics::{geometric_mean, quantile, sorted};

/// Raised when a field changes its meaning or goes away.
pub const SCHEMA_VERSION: u32 = 1;

#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Report {
    pub schema_version: u32,
    pub run: RunInfo,
    pub machine: Machine,
    pub toolchain: Toolchain,
    pub source: Source,
    pub noise: Noise,
    pub cells: Vec<ReportCell>,
    /// Physical limits measured in the same rounds as the cells of their scene
    /// and path: no structures, never ranked, and therefore a list of their own.
    #[serde(default)]
    pub bounds: Vec<ReportCell>,
}

#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct RunInfo {
    pub id: String,
    /// RFC 3339, UTC.
    pub started_at: String,
    /// Null while the run goes on, and for a run that was stopped.
    pub finished_at: Option<String>,
    pub command: String,
    pub seed: u64,
    /// Name of the suite; null for scenes and paths chosen by hand.
    pub suite: Option<String>,
    /// The generator behind generated scenes and paths.
    pub generator: String,
}

/// How far apart two measurements of the same thing lie in this run.
#[derive(Clone, Default, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Noise {
    /// Cost of a clock reading with its loop; queries are batched until this
    /// is at most 2 % of a sample.
    pub harness_overhead_ns: f64,
    /// Geometric mean of all twin ratios: 1 unless the order is unfair.
    pub aa_ratio: Option<f64>,
    /// The noise floor: 95th percentile of |ratio - 1|. Smaller differences
    /// are ties.
    pub aa_floor: Option<f64>,
    /// The twin ratio of each scene and path.
    pub twins: Vec<TwinEntry>,
}

#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct TwinEntry {
    pub scene: String,
    pub path: String,
    pub cache: String,
    pub structure: String,
    pub test: String,
    pub ratio: f64,
    pub lower: f64,
    pub upper: f64,
}

#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct ReportCell {
    pub scene: SceneInfo,
    pub path: PathInfo,
    pub structure: String,
    pub params: Value,
    pub test: String,
    pub status: Status,
    pub reason: Option<String>,
    pub metrics: BTreeMap<String, Metric>,
    /// How the answers differ from the exact truth; null where nothing was
    /// answered.
    pub error: Option<Judged>,
    pub left_out: Vec<String>,
    pub samples_ref: Option<SamplesRef>,
}

/// The cell's rows in samples.csv: zero-based, the header not counted.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SamplesRef {
    pub file: String,
    pub first_row: u64,
    pub rows: u64,
}

impl ReportCell {
    pub fn new(
        scene: &SceneInfo,
        path: &PathInfo,
        test: &str,
        cell: Cell,
        samples_ref: Option<SamplesRef>,
    ) -> ReportCell {
        ReportCell {
            scene: scene.clone(),
            path: path.clone(),
            structure: cell.structure,
            params: cell.params,
            test: test.to_owned(),
            status: cell.verdict.status,
            reason: cell.verdict.reason,
            metrics: cell.metrics,
            error: cell.judged,
            left_out: Vec::new(),
            samples_ref,
        }
    }

    /// A metric's value, if the cell has it.
    pub fn value(&self, metric: &str) -> Option<f64> {
        self.metrics.get(metric).map(|m| m.value)
    }
}

impl Noise {
    /// Adds a twin and brings ratio and floor up to date.
    pub fn add(&mut self, scene: &str, path: &PathInfo, test: &str, twin: &TwinRatio) {
        self.twins.push(TwinEntry {
            scene: scene.to_owned(),
            path: path.name.clone(),
            cache: path.cache.clone(),
            structure: twin.structure.clone(),
            test: test.to_owned(),
            ratio: twin.ratio.value,
            lower: twin.ratio.lower,
            upper: twin.ratio.upper,
        });
        let ratios: Vec<f64> = self.twins.iter().map(|t| t.ratio).collect();
        self.aa_ratio = geometric_mean(&ratios);
        let spread = ratios.iter().map(|r| (r - 1.0).abs()).collect();
        self.aa_floor = quantile(&sorted(spread), 0.95);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::Estimate;

    #[test]
    fn the_noise_floor_is_the_spread_of_the_twins() {
        let mut noise = Noise::default();
        assert_eq!(noise.aa_floor, None);
        let path = PathInfo {
            name: "orbit".into(),
            camera_count: 1,
            cache: "warm".into(),
            planes: "frame".into(),
            epsilon: 8.0,
            arithmetic: "f32".into(),
            digest: None,
        };
        for value in [1.02, 0.99] {
            let ratio = Estimate {
                value,
                lower: value,
                upper: value,
            };
            noise.add(
                "city",
                &path,
                "six-plane",
                &TwinRatio {
                    structure: "bvh".into(),
                    ratio,
                },
            );
        }
        assert!((noise.aa_ratio.unwrap() - (1.02f64 * 0.99).sqrt()).abs() < 1e-12);
        assert!((noise.aa_floor.unwrap() - 0.0195).abs() < 1e-9);
    }

    /// `UPDATE_SCHEMA=1 cargo test schema` writes the file anew.
    #[test]
    fn the_committed_schema_is_the_one_of_the_code() {
        let schema = schemars::schema_for!(Report);
        let text = serde_json::to_string_pretty(&schema).unwrap() + "\n";
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/report.schema.json");
        if std::env::var_os("UPDATE_SCHEMA").is_some() {
            std::fs::write(file, &text).unwrap();
        }
        let committed = std::fs::read_to_string(file).unwrap_or_default();
        assert!(committed == text, "run: UPDATE_SCHEMA=1 cargo test schema");
    }
}
