//! [`SharedWork`]: the gain from threads that share queries or views.

use serde::Serialize;

use super::ReportCell;

/// Work that several threads share, beside the same work on one thread.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct SharedWork {
    /// Label of the structure.
    pub structure: String,
    /// True if threads share the views of all cameras; false if they share each query.
    pub shares_views: bool,
    /// Wall time per query, ns.
    pub wall_ns: f64,
    /// Wall time on one thread / this wall time.
    pub wall_gain: f64,
    /// CPU time of all threads / CPU time on one thread.
    pub cpu_ratio: Option<f64>,
}

impl SharedWork {
    /// The shared work among cells of one scene and path.
    pub fn of<'c>(cells: impl IntoIterator<Item = &'c ReportCell>) -> Vec<SharedWork> {
        let cells: Vec<&ReportCell> = cells.into_iter().collect();
        let shared = cells.iter().filter_map(|cell| {
            let label = &cell.structure;
            let own = on_one_thread(label);
            let is_alone = |cell: &&&ReportCell| Some(&cell.structure) == own.as_ref();
            let (alone, [wall, cpu]) = match &own {
                Some(_) => (cells.iter().find(is_alone)?, ["query_wall_ns", "query_ns"]),
                None => (cell, ["views_wall_ns", "views_ns"]),
            };
            let wall_ns = cell.value(wall)?;
            let cpu_ns = cell.value(cpu).zip(alone.value("query_ns"));
            Some(SharedWork {
                structure: label.clone(),
                shares_views: own.is_none(),
                wall_ns,
                wall_gain: alone.value("query_wall_ns")? / wall_ns,
                cpu_ratio: cpu_ns.map(|(all, one)| all / one),
            })
        });
        shared.collect()
    }
}

/// Label without its threads: `linear@rebuild` of `linear:threads=2@rebuild`.
fn on_one_thread(label: &str) -> Option<String> {
    let (before, after) = label.rsplit_once("threads=")?;
    let after = after.trim_start_matches(|c: char| c.is_ascii_digit());
    Some(before.strip_suffix([':', ','])?.to_owned() + after)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_partner_has_the_policy_and_no_threads() {
        for (label, wanted) in [
            ("linear:threads=2", Some("linear")),
            ("linear:leaf=4,threads=16", Some("linear:leaf=4")),
            ("linear:threads=2@rebuild", Some("linear@rebuild")),
            ("threads=2", None),
            ("\u{e9}threads=2", None),
        ] {
            assert_eq!(on_one_thread(label).as_deref(), wanted, "{label}");
        }
    }
}
