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
            let own = label.rsplit_once("threads=");
            // Behind a colon or a comma.
            let own = own.map(|(alone, _)| &alone[..alone.len() - 1]);
            let alone = own.map_or(Some(cell), |own| {
                cells.iter().find(|cell| cell.structure == own)
            })?;
            let [wall, cpu] = match own {
                Some(_) => ["query_wall_ns", "query_ns"],
                None => ["views_wall_ns", "views_ns"],
            };
            let wall_ns = cell.value(wall)?;
            Some(SharedWork {
                structure: label.clone(),
                shares_views: own.is_none(),
                wall_ns,
                wall_gain: alone.value("query_wall_ns")? / wall_ns,
                cpu_ratio: cell
                    .value(cpu)
                    .zip(alone.value("query_ns"))
                    .map(|(all, one)| all / one),
            })
        });
        shared.collect()
    }
}
