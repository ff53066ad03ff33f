//! The crossover surface: which structure wins where.
//!
//! Over the number of items and the visible share of them; also the size from which a structure is
//! faster than the linear scan. Evaluated from a report; nothing is measured.

use std::mem::replace;

use super::ranking::{grouped, unique};
use super::{Comparison, Report, ReportCell};
use crate::measure::{Metric, Status};
use crate::statistics::{Estimate, slope, sorted};

/// One world of several sizes, with one cache state and culling test.
pub struct Surface<'r> {
    /// The scene's name without its number of items.
    pub world: String,
    /// "warm" or "cold".
    pub cache: &'r str,
    /// Name of the culling test.
    pub test: &'r str,
    /// Points by number of items, then by share.
    pub places: Vec<Place<'r>>,
}

/// A comparison as a point of a surface.
pub struct Place<'r> {
    /// Number of items in the scene.
    pub items: usize,
    /// Visible items / items, as measured.
    pub share: f64,
    /// The share rounded to 1, 1.5, 2, 3, 5, 7, 10, ... percent and fractions of it.
    ///
    /// Off by at most a factor of 1.3.
    pub class: f64,
    /// The cells there, and their ranks.
    pub comparison: Comparison<'r>,
}

/// Number of items from which a structure is faster than the linear scan.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Crossing {
    /// Faster at every measured size; this is the smallest.
    Below(usize),
    /// Between two sizes, by interpolation of the logarithms.
    At(f64),
    /// Not faster at the largest measured size.
    Above(usize),
}

/// Name of a scene without its size: `uniform:n=1000,seed=7` is `uniform:seed=7`.
pub fn world_of(scene: &str) -> String {
    let Some((name, parameters)) = scene.rsplit_once(':') else {
        return scene.to_owned();
    };
    let is_other = |pair: &&str| !pair.trim_start().starts_with("n=");
    let others: Vec<&str> = parameters.split(',').filter(is_other).collect();
    match others.is_empty() {
        true => name.to_owned(),
        false => format!("{name}:{}", others.join(",")),
    }
}

/// The nearest of ..., 0.1, 0.15, 0.2, 0.3, 0.5, 0.7, 1 by its logarithm.
fn class_of(share: f64) -> f64 {
    let decade = share.log10().floor() as i32;
    let steps = [1.0, 1.5, 2.0, 3.0, 5.0, 7.0].map(|step| step * 10f64.powi(decade));
    // Not ten times the first: a class has one value.
    let steps = steps.into_iter().chain([10f64.powi(decade + 1)]);
    let far = |step: f64| (step / share).ln().abs();
    let nearest = steps.min_by(|a, b| far(*a).total_cmp(&far(*b)));
    nearest.unwrap_or(share).min(1.0)
}

/// The surfaces of all comparisons with ranks, in the order of measurement.
pub fn surfaces<'r>(comparisons: Vec<Comparison<'r>>) -> Vec<Surface<'r>> {
    let places = comparisons.into_iter().filter_map(|comparison| {
        let about = comparison.about();
        let share = 1.0 - comparison.of_any("cull_rate")?;
        comparison.winners().next()?;
        // Nothing visible has no place on a logarithmic axis. Frames are not queries.
        if share.is_nan() || share <= 0.0 || !about.path.motion.is_empty() {
            return None;
        }
        let (cache, test) = (about.path.cache.as_str(), about.test.as_str());
        let place = Place {
            items: about.scene.total_count,
            share,
            class: class_of(share),
            comparison,
        };
        Some(((world_of(&about.scene.name), cache, test), place))
    });
    let surface = |((world, cache, test), mut places): (_, Vec<Place<'r>>)| {
        places.sort_by(|a, b| a.share.total_cmp(&b.share));
        places.sort_by_key(|place| place.items);
        Surface {
            world,
            cache,
            test,
            places,
        }
    };
    grouped(places).into_iter().map(surface).collect()
}

impl<'r> Place<'r> {
    /// Returns true if class and measured share differ by more than a tenth.
    pub fn is_off_class(&self) -> bool {
        !(0.9..=1.1).contains(&(self.share / self.class))
    }

    /// The sound cell of a structure.
    pub fn cell(&self, structure: &str) -> Option<&'r ReportCell> {
        self.comparison.sound_cell(structure)
    }
}

impl Surface<'_> {
    /// Numbers of items, ascending, each once.
    pub fn sizes(&self) -> Vec<usize> {
        let mut sizes: Vec<usize> = self.places.iter().map(|p| p.items).collect();
        sizes.dedup();
        sizes
    }

    /// Classes of shares, ascending, each once.
    pub fn classes(&self) -> Vec<f64> {
        let mut classes = sorted(self.places.iter().map(|p| p.class).collect());
        classes.dedup();
        classes
    }

    /// Structures with sound cells that pass the test, in order of occurrence.
    pub fn names(&self, is_one: impl Fn(&ReportCell) -> bool) -> Vec<&str> {
        let cells = self.places.iter().flat_map(|p| p.comparison.sound());
        let cells = cells.filter(|cell| is_one(cell));
        unique(cells.map(|cell| cell.structure.as_str()))
    }

    /// Number of items from which a structure stays faster than the linear scan.
    ///
    /// `None` if it was measured at one size only. Faster means shown to be
    /// ([`Estimate::exceeds`]); between sizes the logarithms of the speed-ups are interpolated.
    pub fn crossing(&self, structure: &str, class: f64) -> Option<Crossing> {
        let places = self.places.iter().filter(|place| place.class == class);
        let points = places.filter_map(|p| Some((p.items, p.cell(structure)?.value("speedup")?)));
        let mut curve: Vec<(usize, f64)> = points.filter(|point| point.1 > 0.0).collect();
        // The first if several paths fall into the class.
        curve.dedup_by_key(|point| point.0);
        let is_faster = |point: &(usize, f64)| self.is_faster(structure, class, point.0);
        let faster: Vec<bool> = curve.iter().map(is_faster).collect();
        let (first, last) = (curve.first()?, curve.last()?);
        if curve.len() < 2 {
            return None;
        }
        let Some(slower) = faster.iter().rposition(|is_faster| !is_faster) else {
            return Some(Crossing::Below(first.0));
        };
        if slower + 1 == curve.len() {
            return Some(Crossing::Above(last.0));
        }
        let [(n0, r0), (n1, r1)] = [curve[slower], curve[slower + 1]];
        let along = -r0.ln() / (r1.ln() - r0.ln());
        // Faster by its time, but not shown to be.
        if !(0.0..=1.0).contains(&along) {
            return Some(Crossing::Below(n1));
        }
        let (n0, n1) = ((n0 as f64).ln(), (n1 as f64).ln());
        Some(Crossing::At((n0 + along * (n1 - n0)).exp()))
    }

    /// Returns true if it is shown to be faster on every path of this size and class.
    fn is_faster(&self, structure: &str, class: f64, items: usize) -> bool {
        let here = |place: &&Place| place.class == class && place.items == items;
        let mut places = self.places.iter().filter(here);
        places.all(|place| {
            let cell = place.cell(structure);
            let ratio = cell.and_then(|cell| cell.metrics.get("speedup"));
            ratio.is_none_or(|ratio| ratio.estimate().exceeds(1.0))
        })
    }
}

/// The growth of one structure.
pub struct Growth<'r> {
    /// Key of the series, common to its cells.
    pub key: SeriesKey<'r>,
    /// Mean over the sizes.
    pub visible: f64,
    /// Numbers of items, ascending.
    pub sizes: Vec<usize>,
    /// Least-squares slope of log query_ns over log N, with its 95 % interval.
    pub exponent: Estimate,
    /// Their indices in the report's list.
    cells: Vec<usize>,
}

/// Largest ratio of visible counts that are considered equal.
const SAME_COUNT: f64 = 1.3;
/// Fewest sizes that give an interval.
const LEAST_SIZES: usize = 3;

/// All structures measured on at least three sizes of a world.
///
/// With approximately the same number of visible items, on the same kind of path.
pub fn growths(report: &Report) -> Vec<Growth<'_>> {
    let ok = report.cells.iter().enumerate();
    let ok = ok.filter(|(_, c)| c.status == Status::Ok && c.path.motion.is_empty());
    let points = ok.filter_map(|(at, cell)| {
        let (visible, ns) = (cell.value("visible_count")?, cell.value("query_ns")?);
        let point = (cell.scene.total_count, visible, ns, at);
        (visible > 0.0 && ns > 0.0).then(|| (key(cell), point))
    });
    grouped(points).into_iter().flat_map(of_series).collect()
}

/// Sets `growth_exponent` of every cell of a series.
pub(super) fn enter_growths(report: &mut Report) {
    let found = growths(report).into_iter().map(|g| (g.cells, g.exponent));
    for (cells, exponent) in found.collect::<Vec<_>>() {
        for cell in cells {
            let metrics = &mut report.cells[cell].metrics;
            metrics.insert("growth_exponent".to_owned(), Metric::of(exponent, "1"));
        }
    }
}

/// World, kind of path, cache state, culling test and structure.
pub type SeriesKey<'r> = (String, &'r str, &'r str, &'r str, &'r str);
/// Items, visible ones, ns, index of the cell.
type Point = (usize, f64, f64, usize);

fn key(cell: &ReportCell) -> SeriesKey<'_> {
    let path = cell.path.name.split(':').next().unwrap_or_default();
    let world = world_of(&cell.scene.name);
    (world, path, &cell.path.cache, &cell.test, &cell.structure)
}

fn of_series<'r>((key, mut points): (SeriesKey<'r>, Vec<Point>)) -> Vec<Growth<'r>> {
    // By items, the fewest visible first, so that these come first for their size.
    points.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut found = Vec::new();
    while let Some(least) = points.iter().map(|p| p.1).min_by(f64::total_cmp) {
        let mut last = 0;
        // Further cells of a size are from another path, and go into a later series.
        let is_same = |p: &Point| p.1 <= least * SAME_COUNT && p.0 != replace(&mut last, p.0);
        let (same, others): (Vec<Point>, Vec<Point>) = points.into_iter().partition(is_same);
        points = others;
        let log = |&(items, _, ns, _): &Point| ((items as f64).ln(), ns.ln());
        let logs: Vec<(f64, f64)> = same.iter().map(log).collect();
        let Some(exponent) = slope(&logs).filter(|_| same.len() >= LEAST_SIZES) else {
            continue;
        };
        found.push(Growth {
            key: key.clone(),
            visible: same.iter().map(|p| p.1).sum::<f64>() / same.len() as f64,
            sizes: same.iter().map(|p| p.0).collect(),
            exponent,
            cells: same.iter().map(|p| p.3).collect(),
        });
    }
    found
}

#[cfg(test)]
mod tests {
    use super::super::ranking::tests::cell;
    use super::*;
    use crate::index::Kind;

    #[test]
    fn shares_about_a_power_of_ten_have_one_class() {
        for power in -12..0 {
            let at = 10f64.powi(power);
            assert_eq!(class_of(0.96 * at), at);
            assert_eq!(class_of(1.04 * at), at);
        }
    }

    /// A comparison with these times, where a `share` of `items` items is visible.
    fn comparison(items: usize, share: f64, times: &[(&str, f64)]) -> Comparison<'static> {
        let scene = format!("uniform:n={items},seed=3");
        let cells = times.iter().zip(1..).map(|(&(name, ns), rank)| {
            let mut cell = cell(&scene, items, "p", name, ns);
            let mut culled = cell.metrics["query_ns"].clone();
            culled.value = 1.0 - share;
            cell.metrics.insert("cull_rate".to_owned(), culled);
            cell.kind = Some(if name == "linear" {
                Kind::Scan
            } else {
                Kind::Tree
            });
            cell.rank = Some(rank);
            &*Box::leak(Box::new(cell))
        });
        Comparison {
            cells: cells.collect(),
            bounds: Vec::new(),
        }
    }

    #[test]
    fn a_surface_tells_who_wins_and_where_linear_is_overtaken() {
        // The linear scan of these cells takes 1000 ns.
        let surfaces = surfaces(vec![
            comparison(100_000, 0.021, &[("bvh", 100.0), ("linear", 1000.0)]),
            comparison(1_000, 0.019, &[("linear", 1000.0), ("bvh", 10_000.0)]),
            comparison(1_000, 1.0, &[("bvh", 500.0), ("linear", 1000.0)]),
            comparison(100_000, 0.97, &[("bvh", 400.0), ("linear", 1000.0)]),
            comparison(100_000, 0.0, &[("bvh", 1.0)]),
        ]);
        assert_eq!(surfaces.len(), 1);
        let surface = &surfaces[0];
        assert_eq!(surface.world, "uniform:seed=3");
        assert_eq!(surface.sizes(), [1_000, 100_000]);
        assert_eq!(surface.classes(), [0.02, 1.0]);
        let linear: Vec<bool> = (surface.places.iter())
            .map(|place| place.comparison.winners().any(ReportCell::is_scan))
            .collect();
        assert_eq!(linear, [true, false, false, false]);
        // From a tenth to tenfold: half way on the logarithmic axis.
        let Some(Crossing::At(items)) = surface.crossing("bvh", 0.02) else {
            panic!("no crossing");
        };
        assert!((items / 10_000.0 - 1.0).abs() < 1e-9, "{items}");
        assert_eq!(surface.crossing("bvh", 1.0), Some(Crossing::Below(1_000)));
        assert_eq!(
            surface.crossing("linear", 1.0),
            Some(Crossing::Above(100_000))
        );
        assert_eq!(surface.crossing("octree", 1.0), None);
    }

    #[test]
    fn linear_is_overtaken_for_good_where_it_is_overtaken_last() {
        let times = [
            (1_000, 2000.0),
            (10_000, 500.0),
            (100_000, 2000.0),
            (1_000_000, 500.0),
        ];
        let places = times.map(|(items, ns)| {
            let mut rows = [("bvh", ns), ("linear", 1000.0)];
            rows.sort_by(|a, b| f64::total_cmp(&a.1, &b.1));
            comparison(items, 0.02, &rows)
        });
        let surfaces = surfaces(places.into_iter().collect());
        let Some(Crossing::At(items)) = surfaces[0].crossing("bvh", 0.02) else {
            panic!("no crossing");
        };
        assert!((items / 316_227.766_017 - 1.0).abs() < 1e-9, "{items}");
    }

    #[test]
    fn a_tie_is_no_crossing() {
        let tied = |items: usize, ns: f64| {
            let mut tied = comparison(items, 0.02, &[("bvh", ns), ("linear", 1000.0)]);
            let mut bvh = tied.cells[0].clone();
            bvh.metrics.get_mut("speedup").expect("a ratio").lower = Some(0.99);
            tied.cells[0] = Box::leak(Box::new(bvh));
            tied
        };
        let crossing = |places: Vec<Comparison<'static>>| {
            let surfaces = surfaces(places);
            surfaces[0].crossing("bvh", 0.02)
        };
        let clear = || comparison(10_000, 0.02, &[("bvh", 100.0), ("linear", 1000.0)]);
        // Faster by its time at 1,000 items, but not significantly.
        let found = crossing(vec![tied(1_000, 950.0), clear()]);
        assert_eq!(found, Some(Crossing::Below(10_000)));
        // Not on another path of that size.
        let found = crossing(vec![clear(), tied(10_000, 900.0), tied(1_000, 950.0)]);
        assert_eq!(found, Some(Crossing::Above(10_000)));
        let found = crossing(vec![tied(1_000, 950.0), tied(10_000, 900.0)]);
        assert_eq!(found, Some(Crossing::Above(10_000)));
    }

    #[test]
    fn classes_are_the_nearest_steps_and_worlds_lose_their_size_only() {
        for (share, class) in [
            (0.0011, 0.001),
            (0.0195, 0.02),
            (0.16, 0.15),
            (0.347, 0.3),
            (0.8, 0.7),
            (0.98, 1.0),
        ] {
            assert!((class_of(share) / class - 1.0).abs() < 1e-9, "{share}");
        }
        // The stated precision, over six powers of ten.
        for step in 0..6000 {
            let share = 10f64.powf(-f64::from(step) / 1000.0);
            let off = class_of(share) / share;
            assert!((1.0 / 1.3..=1.3).contains(&off), "{share}: {off}");
        }
        for (scene, world) in [
            ("city:n=1000", "city"),
            ("city:n=1000,seed=7", "city:seed=7"),
            ("city", "city"),
            ("maps.wad#MAP07", "maps.wad#MAP07"),
            ("mesh:forest:n=1000,seed=7", "mesh:forest:seed=7"),
            ("mesh:forest", "mesh:forest"),
        ] {
            assert_eq!(world_of(scene), world);
        }
    }

    #[test]
    fn only_one_count_over_several_sizes_has_an_exponent() {
        let key = || ("uniform".to_owned(), "orbit", "warm", "six-plane", "bvh");
        let grown = |points: &[Point]| of_series((key(), points.to_vec()));
        // 500 visible: N^0.5 exactly; 2 % visible grows with N and is not a series.
        let points = [
            (10_000, 500.0, 100.0, 7),
            (1_000_000, 510.0, 1000.0, 3),
            (100_000, 490.0, 316.227_766, 5),
            (1_000_000, 20_000.0, 9e4, 1),
            (100_000, 2_000.0, 9e3, 2),
        ];
        let found = grown(&points);
        assert_eq!(found.len(), 1);
        assert!((found[0].exponent.value - 0.5).abs() < 1e-6);
        let exponent = found[0].exponent;
        assert!(exponent.upper.unwrap() - exponent.lower.unwrap() < 1e-5);
        assert_eq!(found[0].sizes, [10_000, 100_000, 1_000_000]);
        assert_eq!(found[0].cells, [7, 5, 3]);
        assert!((found[0].visible - 500.0).abs() < 1e-9);
        assert!(grown(&points[..2]).is_empty());
        // Two paths at one size are not two sizes.
        let twice = [points[0], points[0], points[1], points[1]];
        assert!(grown(&twice).is_empty());
        // Two paths whose counts are within 30 % of each other keep their own sizes.
        let own = [(1, 85.0), (2, 88.0), (4, 90.0)].map(|(n, seen)| (n, seen, 9.0, n));
        let other = [(1, 112.0), (2, 113.0), (4, 107.0)].map(|(n, seen)| (n, seen, 9.0, 10 * n));
        let cells = grown(&[own, other].concat())
            .into_iter()
            .map(|growth| growth.cells);
        assert_eq!(cells.collect::<Vec<_>>(), [[1, 2, 4], [10, 20, 40]]);
    }
}
