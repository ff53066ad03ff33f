//! Choice of structure, by measured cells, and of update policy.

use serde::Serialize;

use super::case::{AdviseInput, SCAN, TREE};
use super::tasks::is_longer;
use crate::index::UpdatePolicy;
use crate::measure::ReportCell;
use crate::statistics::{Estimate, ratio};

/// Chosen structure, and all candidates.
#[derive(Clone, Debug, Serialize)]
pub struct StructureChoice {
    /// Fastest correct structure; of ties a single-threaded scan first; null if none.
    pub name: Option<String>,
    /// Others that tie with it.
    pub ties: Vec<String>,
    /// Cells as in a report, fastest first; failures come last.
    pub rows: Vec<ReportCell>,
}

/// CPU time per frame, or per frustum query of a still scene, ns.
pub fn ns(cell: &ReportCell) -> Option<f64> {
    Some(cell.time()?.value)
}

impl StructureChoice {
    /// Chooses from the cells of a run with all structures on one scene and path.
    pub(super) fn of(cells: &[ReportCell]) -> StructureChoice {
        let rows = by_time(cells).into_iter().cloned().collect();
        let mut first = fastest(cells);
        first.sort_by_key(|cell| (is_shared(cell), !cell.is_scan()));
        let mut first = first.into_iter().map(|cell| cell.structure.clone());
        let (name, ties) = (first.next(), first.collect());
        StructureChoice { name, ties, rows }
    }

    /// Cell of the chosen structure.
    pub fn taken(&self) -> Option<&ReportCell> {
        let mut rows = self.rows.iter();
        rows.find(|row| self.name.as_ref() == Some(&row.structure))
    }

    /// Returns `true` if the chosen structure is a scan.
    pub fn is_scan(&self) -> bool {
        self.taken().is_some_and(ReportCell::scans)
    }

    /// Returns `true` if a scan ties with a chosen tree, or a tree with a chosen scan.
    pub(super) fn is_scan_or_tree(&self) -> bool {
        let ties = |row: &ReportCell| self.ties.contains(&row.structure);
        let mut tied = alone(&self.rows).filter(|row| ties(row));
        tied.any(|row| row.scans() != self.is_scan())
    }

    /// Adds ties that appear only where the contenders are timed without the others.
    pub(super) fn add_ties(&mut self, contenders: &[String], alone: &[ReportCell]) {
        let Some(taken) = &self.name else { return };
        let own = |label: &&String| *label == taken || self.ties.contains(label);
        let ties = |label: &&String| {
            let ratio = time_over(alone, taken, label);
            let ratio = ratio.filter(|ratio| ratio.ends().is_some() && !own(label));
            ratio.is_some_and(|ratio| is_longer(ratio) != Some(false))
        };
        let ties: Vec<String> = contenders.iter().filter(ties).cloned().collect();
        self.ties.extend(ties);
    }

    /// Fastest tree or grid, and fastest scan.
    pub(super) fn tree_and_scan(&self) -> [Option<&ReportCell>; 2] {
        [false, true].map(|scans| alone(&self.rows).find(|row| row.scans() == scans))
    }

    /// Labels of the two for the rules, and of the chosen structure.
    ///
    /// `wide` and `linear` if missing.
    pub(super) fn labels(&self) -> [String; 3] {
        let [tree, scan] = self.tree_and_scan();
        let own = [(tree, TREE), (scan, SCAN), (self.taken().or(tree), TREE)];
        own.map(|(row, other)| row.map_or(other, |row| &row.structure).to_owned())
    }

    /// Returns `true` if a scan is chosen and there is a tree too.
    pub(super) fn may_be_a_tree(&self) -> bool {
        self.is_scan() && self.tree_and_scan()[0].is_some()
    }

    /// Takes the fastest tree, with the trees that tie with it.
    pub(super) fn take_tree(&mut self) {
        let trees = alone(&self.rows).filter(|row| !row.scans());
        let trees = StructureChoice::of(&trees.cloned().collect::<Vec<_>>());
        (self.name, self.ties) = (trees.name, trees.ties);
    }

    /// Leaves out ties between a scan and a tree.
    pub(super) fn keep_ties_of_kind(&mut self) {
        let scans = self.is_scan();
        let other = self.rows.iter().filter(|row| row.scans() != scans);
        (self.ties).retain(|label| other.clone().all(|row| row.structure != *label));
    }

    /// Labels of the chosen structure and of those that may replace it elsewhere.
    ///
    /// These are the fastest tree and scan; with a motion the three fastest too.
    pub(super) fn contenders(&self, moves: bool) -> Vec<String> {
        let (most, of_kind) = (if moves { 3 } else { 0 }, self.tree_and_scan());
        let own = alone(&self.rows).enumerate();
        let is_own = |row| of_kind.contains(&Some(row)) || self.taken() == Some(row);
        let own = own.filter(|(n, row)| *n < most || is_own(row));
        let mut own: Vec<String> = own.map(|(_, row)| row.structure.clone()).collect();
        own.sort_by_key(|label| Some(label) != self.name.as_ref());
        own
    }
}

/// Ranked rows on one thread.
fn alone(rows: &[ReportCell]) -> impl Iterator<Item = &ReportCell> {
    (rows.iter()).filter(|row| row.rank.is_some() && !is_shared(row))
}

fn is_shared(row: &ReportCell) -> bool {
    row.params["threads"].as_u64() > Some(1)
}

/// Time of a structure / time of another one, by the metric that ranks them.
pub(super) fn over(own: &ReportCell, other: &ReportCell) -> Option<Estimate> {
    let [own, other] = [own, other].map(|cell| cell.ln_ns(cell.ranked_by()));
    ratio(&other, &own, &other)
}

/// [`over`], by the labels of the two cells.
pub(super) fn time_over(cells: &[ReportCell], own: &str, other: &str) -> Option<Estimate> {
    let cell = |label| cells.iter().find(|cell| cell.structure == label);
    over(cell(own)?, cell(other)?)
}

/// Cells by their times; those without a rank, as of wrong answers, come last.
fn by_time(cells: &[ReportCell]) -> Vec<&ReportCell> {
    let mut cells: Vec<&ReportCell> = cells.iter().collect();
    cells.sort_by(|a, b| {
        let order = a.rank.is_none().cmp(&b.rank.is_none());
        order.then(or_last(ns(a)).total_cmp(&or_last(ns(b))))
    });
    cells
}

/// Fastest structure and those that tie with it.
pub(super) fn fastest(cells: &[ReportCell]) -> Vec<&ReportCell> {
    // Nothing is taken if nothing is visible.
    let sound = |cell: &&ReportCell| {
        cell.rank.is_some() && ns(cell).is_some() && cell.value("visible_count") != Some(0.0)
    };
    let mut sound: Vec<&ReportCell> = by_time(cells).into_iter().filter(sound).collect();
    let Some(&first) = sound.first() else {
        return sound;
    };
    let is_longer = |cell: &ReportCell| is_longer(over(cell, first)?);
    sound.retain(|cell| cell.structure == first.structure || is_longer(cell) != Some(true));
    sound
}

/// Maps a missing time to the end of the order.
pub(super) fn or_last(time: Option<f64>) -> f64 {
    time.unwrap_or(f64::INFINITY)
}

/// Rebuilding is ruled out if the builds alone take this many times a frame.
const RULED_OUT: f64 = 1.5;

/// Chosen update policy of the structure.
#[derive(Clone, Debug, Serialize)]
pub struct MotionChoice {
    /// Fastest policy of the chosen structure; null without a structure.
    pub policy: Option<String>,
    /// Others that tie with it.
    pub policy_ties: Vec<String>,
    /// Measured policies of the structure, fastest first.
    pub policies: Vec<ReportCell>,
    /// Unmeasured policies, each with its builds / a frame with refits, same processes.
    pub ruled_out: Vec<(String, f64)>,
}

impl MotionChoice {
    /// Label of the chosen structure with rebuilds, to be measured.
    ///
    /// Its builds / a frame as the error, if they rule rebuilds out. `None` if there is no such
    /// policy, or policies of `--update` are rows of the run.
    pub(super) fn rebuilt(
        input: &AdviseInput,
        structure: &StructureChoice,
    ) -> Option<Result<String, f64>> {
        let (all, row) = (&input.setting.structures, structure.taken()?);
        let spec = all.iter().find(|spec| spec.label == row.structure)?;
        let are_rows = all.iter().any(|spec| spec.policy != UpdatePolicy::Refit);
        input.motion.filter(|_| spec.info().refits && !are_rows)?;
        let frames = row.value("build_ms").unwrap_or(0.0) * 1e6 / or_last(ns(row));
        Some(match frames > RULED_OUT {
            true => Err(frames),
            false => Ok(format!("{}@rebuild", spec.label)),
        })
    }

    /// Chooses among the cells of the chosen structure under several policies.
    pub(super) fn of(
        input: &AdviseInput,
        structure: &StructureChoice,
        cells: &[ReportCell],
    ) -> MotionChoice {
        let alone = |label: &str| label.split('@').next().map(str::to_owned);
        let taken = structure.name.as_deref().and_then(alone);
        let own = cells.iter().filter(|cell| alone(&cell.structure) == taken);
        let own = StructureChoice::of(&own.cloned().collect::<Vec<_>>());
        let mut specs = input.setting.structures.iter();
        let spec = specs.find(|spec| structure.name.as_ref() == Some(&spec.label));
        let policy = |label: &String| match policy_of(label) {
            "refit" if spec.is_some_and(|spec| !spec.info().refits) => "rebuild".to_owned(),
            policy => policy.to_owned(),
        };
        let ruled_out = MotionChoice::rebuilt(input, structure).and_then(Result::err);
        MotionChoice {
            policy: own.name.as_ref().map(policy),
            policy_ties: own.ties.iter().map(policy).collect(),
            policies: own.rows,
            ruled_out: (ruled_out.into_iter())
                .map(|frames| ("rebuild".to_owned(), frames))
                .collect(),
        }
    }
}

/// Policy in a label, as in `wide@every=10`.
pub fn policy_of(label: &str) -> &str {
    label.split_once('@').map_or("refit", |(_, policy)| policy)
}

#[cfg(test)]
pub use tests::structure;

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::case::spec_of;
    use super::*;
    use crate::index::Registry;
    use crate::measure::Metric;

    pub fn structure(structure: &str, kind: &str, threads: u64) -> ReportCell {
        let cell = json!({
            "scene": { "name": "s", "total_count": 1, "region_count": 0,
                "origin": [0.0, 0.0, 0.0], "bounds_min": [0.0, 0.0, 0.0],
                "bounds_max": [1.0, 1.0, 1.0], "skipped_items": 0, "digest": "d" },
            "path": { "name": "p", "camera_count": 8, "cache": "warm", "planes": "frame",
                "epsilon": 8.0, "arithmetic": "f32" },
            "structure": structure, "kind": kind, "params": { "threads": threads }, "rank": 1,
            "test": "six-plane", "status": "ok", "reason": null, "error": null,
            "left_out": [], "samples_ref": null,
            "metrics": { "query_ns": { "value": 1.0, "unit": "ns" } },
        });
        serde_json::from_value(cell).unwrap()
    }

    #[test]
    fn a_tie_is_a_ratio_whose_interval_holds_a_difference_of_five_percent() {
        let of = |value: f64, ends| is_longer(Estimate::within(value, ends));
        assert_eq!(of(1.2, [1.06, 1.3]), Some(true));
        assert_eq!(of(0.8, [0.7, 0.94]), Some(false));
        assert_eq!(of(1.2, [1.04, 1.3]), None);
        assert_eq!(of(1.0, [0.9, 1.1]), None);
        // Significant, but by less than another memory layout makes.
        assert_eq!(of(1.03, [1.02, 1.04]), None);
        assert_eq!(of(1.01, [f64::NAN; 2]), Some(true));
    }

    #[test]
    fn a_scan_that_ties_with_the_fastest_is_taken() {
        let cell = |name: &str, kind, threads, ns: f64| {
            let mut cell = structure(name, kind, threads);
            let own = (0..10).map(|n| ns * (1.0 + 0.004 * ((n * name.len()) % 7) as f64));
            cell.times
                .by_process
                .insert("query_ns".to_owned(), own.collect());
            cell.metrics.get_mut("query_ns").unwrap().value = ns;
            cell
        };
        let of = |scan: f64| {
            let rows = [("wide", "tree", 1, 100.0), ("linear", "scan", 1, scan)];
            let shared = [
                ("linear:threads=2", "scan", 2, 100.0),
                ("bsp", "tree", 1, 150.0),
            ];
            rows.into_iter()
                .chain(shared)
                .map(|row| cell(row.0, row.1, row.2, row.3))
                .collect::<Vec<_>>()
        };
        let tie = StructureChoice::of(&of(101.0));
        assert_eq!(tie.name.as_deref(), Some("linear"));
        assert_eq!(tie.ties, ["wide", "linear:threads=2"]);
        assert!(tie.is_scan() && tie.is_scan_or_tree());
        assert_eq!(tie.contenders(false), ["linear", "wide"]);
        // A tie without the other structures counts too; a significant answer stays.
        let mut ahead = StructureChoice::of(&of(80.0));
        assert_eq!(
            (ahead.name.as_deref(), ahead.ties.len()),
            (Some("linear"), 0)
        );
        let contenders = ahead.contenders(false);
        ahead.add_ties(&contenders, &of(80.0));
        assert!(ahead.ties.is_empty() && !ahead.is_scan_or_tree());
        ahead.add_ties(&contenders, &of(100.0));
        assert!(ahead.ties == ["wide"] && ahead.is_scan_or_tree());
    }

    #[test]
    fn scans_are_told_from_trees() {
        let mut choice = StructureChoice::of(&[]);
        assert_eq!(choice.labels(), ["wide", "linear", "wide"]);
        choice.rows = vec![
            structure("linear:threads=2", "scan", 2),
            structure("linear-scalar", "scan", 1),
            structure("octree", "tree", 1),
        ];
        assert_eq!(choice.labels(), ["octree", "linear-scalar", "octree"]);
        assert_eq!(choice.contenders(false), ["linear-scalar", "octree"]);
        // A structure that selects its method is a scan where it tested most items.
        choice.rows.insert(0, structure("auto", "tree", 1));
        choice.rows[0].scene.total_count = 100;
        for (chose, tested, tree) in [
            (Some("tree"), 20.0, "auto"),
            (Some("scan of all items"), 100.0, "octree"),
            (
                Some("built as tree; scan of overwritten boxes"),
                95.0,
                "octree",
            ),
            (None, 95.0, "auto"),
        ] {
            let row = &mut choice.rows[0];
            row.chose = chose.map(str::to_owned);
            let tested = Metric::of(Estimate::exact(tested), "1");
            row.metrics.insert("items_tested".to_owned(), tested);
            assert_eq!(choice.labels()[0], tree, "{chose:?}");
        }
        // A plan names what was chosen, even if the list does not contain it.
        let structures = Registry::builtin()
            .structures("octree,linear-scalar")
            .unwrap();
        for name in [
            "octree",
            "linear-scalar",
            "wide",
            "linear",
            "octree@every=10",
        ] {
            assert_eq!(spec_of(&structures, name).label, name);
        }
        let every = spec_of(&structures, "octree@every=10").policy;
        assert_eq!(every, UpdatePolicy::Every(10));
    }
}
