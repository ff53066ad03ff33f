//! The crossover surface: which structure wins where, over the number of items
//! and the share of them that is visible, and from which size on a structure is
//! faster than the linear scan. Read off a report; nothing is measured.

use super::{Comparison, ReportCell};

/// The scans that any structure has to beat.
const SCANS: [&str; 2] = ["linear", "linear-scalar"];

/// One world of several sizes, with one cache state and culling test.
pub struct Surface<'r> {
    /// The scene's name without its number of items.
    pub world: String,
    pub cache: &'r str,
    pub test: &'r str,
    /// By number of items, then by share.
    pub places: Vec<Place<'r>>,
}

/// A comparison as a place on a surface.
pub struct Place<'r> {
    pub items: usize,
    /// Visible items / items, as measured.
    pub share: f64,
    /// The same to the nearest of 1, 2, 5, 10, ... percent and parts of it.
    pub class: f64,
    pub comparison: Comparison<'r>,
}

/// From how many items on a structure is faster than the linear scan.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Crossing {
    /// At every size that was measured, this being the smallest.
    Below(usize),
    /// By interpolation of the logarithms between two sizes.
    At(f64),
    /// Not at the largest size that was measured.
    Above(usize),
}

/// `uniform:n=1000,seed=7` is `uniform:seed=7`.
pub fn world_of(scene: &str) -> String {
    let Some((name, parameters)) = scene.split_once(':') else {
        return scene.to_owned();
    };
    let others: Vec<&str> = parameters
        .split(',')
        .filter(|pair| !pair.trim_start().starts_with("n="))
        .collect();
    match others.is_empty() {
        true => name.to_owned(),
        false => format!("{name}:{}", others.join(",")),
    }
}

/// The nearest of ..., 0.01, 0.02, 0.05, 0.1, ..., 1 by its logarithm.
fn class_of(share: f64) -> f64 {
    let decade = 10f64.powi(share.log10().floor() as i32);
    let steps = [1.0, 2.0, 5.0, 10.0].map(|step| step * decade);
    let far = |step: f64| (step / share).ln().abs();
    let nearest = steps.into_iter().min_by(|a, b| far(*a).total_cmp(&far(*b)));
    nearest.unwrap_or(share).min(1.0)
}

/// The surfaces of all comparisons that ranked anything, in the order in which
/// they were measured.
pub fn surfaces(comparisons: Vec<Comparison<'_>>) -> Vec<Surface<'_>> {
    let mut all: Vec<Surface> = Vec::new();
    for comparison in comparisons {
        let about = comparison.about();
        let (Some(culled), Some(_)) = (comparison.of_any("cull_rate"), comparison.winners().next())
        else {
            continue;
        };
        let share = 1.0 - culled;
        // Nothing is visible: no place on a logarithmic axis.
        if share <= 0.0 {
            continue;
        }
        let (cache, test) = (about.path.cache.as_str(), about.test.as_str());
        let world = world_of(&about.scene.name);
        let place = Place {
            items: about.scene.total_count,
            share,
            class: class_of(share),
            comparison,
        };
        let same = |s: &&mut Surface| s.world == world && s.cache == cache && s.test == test;
        match all.iter_mut().find(same) {
            Some(surface) => surface.places.push(place),
            None => all.push(Surface {
                world,
                cache,
                test,
                places: vec![place],
            }),
        }
    }
    for surface in &mut all {
        surface.places.sort_by(|a, b| {
            let by_share = || a.share.total_cmp(&b.share);
            a.items.cmp(&b.items).then_with(by_share)
        });
    }
    all
}

impl<'r> Place<'r> {
    /// Whether a linear scan is the fastest, or ties with it.
    pub fn linear_wins(&self) -> bool {
        let mut winners = self.comparison.winners();
        winners.any(|cell| SCANS.contains(&cell.structure.as_str()))
    }

    /// The sound cell of a structure.
    pub fn cell(&self, structure: &str) -> Option<&'r ReportCell> {
        let ranked = self.comparison.ranked.iter().filter(|r| r.rank.is_some());
        let mut cells = ranked.map(|r| r.cell);
        cells.find(|cell| cell.structure == structure)
    }
}

impl Surface<'_> {
    /// Ascending, each once.
    pub fn sizes(&self) -> Vec<usize> {
        let mut sizes: Vec<usize> = self.places.iter().map(|p| p.items).collect();
        sizes.dedup();
        sizes
    }

    /// Ascending, each once.
    pub fn classes(&self) -> Vec<f64> {
        let mut classes: Vec<f64> = self.places.iter().map(|p| p.class).collect();
        classes.sort_by(f64::total_cmp);
        classes.dedup();
        classes
    }

    /// Whether there is anything to cross: more than one size or share.
    pub fn spans(&self) -> bool {
        self.sizes().len() > 1 || self.classes().len() > 1
    }

    /// All structures that are sound somewhere, in the order they first appear.
    pub fn structures(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for place in &self.places {
            for ranked in place.comparison.ranked.iter().filter(|r| r.rank.is_some()) {
                if !names.contains(&ranked.cell.structure.as_str()) {
                    names.push(&ranked.cell.structure);
                }
            }
        }
        names
    }

    /// A metric of a structure over the sizes, at one class of shares; the first
    /// where several paths fall into it.
    pub fn curve(&self, structure: &str, class: f64, metric: &str) -> Vec<(usize, f64)> {
        let mut curve: Vec<(usize, f64)> = Vec::new();
        for place in self.places.iter().filter(|p| p.class == class) {
            let value = place.cell(structure).and_then(|cell| cell.value(metric));
            let is_new = curve.last().is_none_or(|last| last.0 != place.items);
            if let Some(value) = value.filter(|v| *v > 0.0 && is_new) {
                curve.push((place.items, value));
            }
        }
        curve
    }

    /// Where a structure becomes faster than the linear scan for good; `None` if
    /// it is known at one size only.
    pub fn crossing(&self, structure: &str, class: f64) -> Option<Crossing> {
        let curve = self.curve(structure, class, "ratio_to_linear");
        let (first, last) = (curve.first()?, curve.last()?);
        if curve.len() < 2 {
            return None;
        }
        if last.1 <= 1.0 {
            return Some(Crossing::Above(last.0));
        }
        let Some(slower) = curve.iter().rposition(|point| point.1 <= 1.0) else {
            return Some(Crossing::Below(first.0));
        };
        let [(n0, r0), (n1, r1)] = [curve[slower], curve[slower + 1]];
        let (n0, n1) = ((n0 as f64).ln(), (n1 as f64).ln());
        let along = -r0.ln() / (r1.ln() - r0.ln());
        Some(Crossing::At((n0 + along * (n1 - n0)).exp()))
    }
}

#[cfg(test)]
mod tests {
    use super::super::ranking::tests::cell;
    use super::*;
    use crate::report::ranking::Ranked;

    /// Structures with their times where so many items are visible of `items`.
    fn comparison(items: usize, share: f64, times: &[(&str, f64)]) -> Comparison<'static> {
        let scene = format!("uniform:n={items},seed=3");
        let cells = times.iter().zip(1..).map(|(&(name, ns), rank)| {
            let mut cell = cell(&scene, items, "p", name, ns);
            let mut culled = cell.metrics["query_ns"].clone();
            culled.value = 1.0 - share;
            cell.metrics.insert("cull_rate".to_owned(), culled);
            Ranked {
                rank: Some(rank),
                cell: Box::leak(Box::new(cell)),
            }
        });
        Comparison {
            ranked: cells.collect(),
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
        let linear: Vec<bool> = surface.places.iter().map(Place::linear_wins).collect();
        assert_eq!(linear, [true, false, false, false]);
        // From a tenth to tenfold: half way by the logarithm.
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
        let places = times.map(|(items, ns)| comparison(items, 0.02, &[("bvh", ns)]));
        let surfaces = surfaces(places.into_iter().collect());
        let Some(Crossing::At(items)) = surfaces[0].crossing("bvh", 0.02) else {
            panic!("no crossing");
        };
        assert!((items / 316_227.766_017 - 1.0).abs() < 1e-9, "{items}");
    }

    #[test]
    fn classes_are_the_nearest_steps_and_worlds_lose_their_size_only() {
        for (share, class) in [
            (0.0011, 0.001),
            (0.0195, 0.02),
            (0.16, 0.2),
            (0.8, 1.0),
            (0.98, 1.0),
        ] {
            assert!((class_of(share) / class - 1.0).abs() < 1e-9, "{share}");
        }
        for (scene, world) in [
            ("city:n=1000", "city"),
            ("city:n=1000,seed=7", "city:seed=7"),
            ("city", "city"),
            ("maps.wad#MAP07", "maps.wad#MAP07"),
        ] {
            assert_eq!(world_of(scene), world);
        }
    }
}
