//! How cost grows with the number of items while the number of visible ones
//! stays the same: the exponent e of N^e, from the cells of a report.

use super::matching::grouped;
use super::surface::world_of;
use super::{Report, ReportCell};
use crate::measure::Status;
use crate::statistics::{Estimate, slope};

/// The growth of one structure.
pub struct Growth<'r> {
    /// Name of the scene without its number of items.
    pub world: String,
    /// Name of the path family.
    pub path: &'r str,
    /// "warm" or "cold".
    pub cache: &'r str,
    /// Name of the culling test.
    pub test: &'r str,
    /// Label of the structure.
    pub structure: &'r str,
    /// Mean over the sizes.
    pub visible: f64,
    /// Ascending.
    pub sizes: Vec<usize>,
    /// Least-squares slope of log query_ns over log N, with its 95 % interval.
    pub exponent: Estimate,
}

/// Visible counts this far apart are the same count.
const SAME_COUNT: f64 = 1.3;
/// Fewer sizes have no interval.
const LEAST_SIZES: usize = 3;

/// All structures that were measured on at least three sizes of a world with
/// (about) the same number of visible items by the same kind of path.
pub fn growths(report: &Report) -> Vec<Growth<'_>> {
    let ok = report.cells.iter().filter(|c| c.status == Status::Ok);
    let ok = ok.filter(|cell| cell.path.motion.is_empty());
    let points = ok.filter_map(|cell| {
        let (visible, ns) = (cell.value("visible_count")?, cell.value("query_ns")?);
        let point = (cell.scene.total_count, visible, ns);
        // A NaN stays, and has no slope.
        let nothing = visible <= 0.0 || ns <= 0.0;
        (!nothing).then(|| (key(cell), point))
    });
    grouped(points).into_iter().flat_map(of_series).collect()
}

type Key<'r> = (String, &'r str, &'r str, &'r str, &'r str);
/// Items, visible ones, ns.
type Point = (usize, f64, f64);

fn key(cell: &ReportCell) -> Key<'_> {
    let path = cell.path.name.split(':').next().unwrap_or_default();
    let world = world_of(&cell.scene.name);
    (world, path, &cell.path.cache, &cell.test, &cell.structure)
}

fn of_series<'r>((key, mut points): (Key<'r>, Vec<Point>)) -> Vec<Growth<'r>> {
    points.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut found = Vec::new();
    while let Some(&(_, least, _)) = points.first() {
        let end = points.partition_point(|p| p.1 <= least * SAME_COUNT);
        let mut same: Vec<Point> = points.drain(..end).collect();
        same.sort_by_key(|p| p.0);
        same.dedup_by_key(|p| p.0);
        let logs: Vec<(f64, f64)> = same
            .iter()
            .map(|&(items, _, ns)| ((items as f64).ln(), ns.ln()))
            .collect();
        let Some(exponent) = slope(&logs).filter(|_| same.len() >= LEAST_SIZES) else {
            continue;
        };
        found.push(Growth {
            world: key.0.clone(),
            path: key.1,
            cache: key.2,
            test: key.3,
            structure: key.4,
            visible: same.iter().map(|p| p.1).sum::<f64>() / same.len() as f64,
            sizes: same.iter().map(|p| p.0).collect(),
            exponent,
        });
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_one_count_over_several_sizes_has_an_exponent() {
        let key = || ("uniform".to_owned(), "orbit", "warm", "six-plane", "bvh");
        let grown = |points: &[Point]| of_series((key(), points.to_vec()));
        // 500 visible: N^0.5 exactly; 2 % visible grows along and says nothing.
        let points = [
            (10_000, 500.0, 100.0),
            (1_000_000, 510.0, 1000.0),
            (100_000, 490.0, 316.227_766),
            (1_000_000, 20_000.0, 9e4),
            (100_000, 2_000.0, 9e3),
        ];
        let found = grown(&points);
        assert_eq!(found.len(), 1);
        assert!((found[0].exponent.value - 0.5).abs() < 1e-6);
        let exponent = found[0].exponent;
        assert!(exponent.upper.unwrap() - exponent.lower.unwrap() < 1e-5);
        assert_eq!(found[0].sizes, [10_000, 100_000, 1_000_000]);
        assert!((found[0].visible - 500.0).abs() < 1e-9);
        assert!(grown(&points[..2]).is_empty());
        // Two paths of one size are not two sizes.
        let twice = [points[0], points[0], points[1], points[1]];
        assert!(grown(&twice).is_empty());
    }
}
