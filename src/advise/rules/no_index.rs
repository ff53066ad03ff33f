//! The index itself: below some number of items a scan is as fast. The
//! crossover is measured on evenly spread parts of the scene, by the path's own
//! cameras, side by side with everything else.

use std::rc::Rc;

use super::super::case::Case;
use super::super::omission::{By, Draft, Forced, LeftOutIf, Omission, Way};
use super::super::rule::{Rule, Unfit};
use crate::geometry::Aabb;
use crate::index::DynIndex;

pub(super) const RULE: Rule = Rule {
    name: "no-index",
    left_out: "the index itself",
    advice: ["no index: a scan is fast enough", "an index pays off"],
    statistic_name: "items",
    left_out_if: LeftOutIf::AtMost,
    by: By::Time,
    prepare,
};

/// The smallest part that is looked at, and the largest beside the whole.
const LEAST: usize = 32;
const MOST: usize = 16_384;

fn prepare<'c>(case: &'c Case<'c>, omission: Omission) -> Result<Draft<'c>, Unfit> {
    let (scan, tree) = (&case.scan, &case.spec);
    let items = &case.scene().items;
    let whole: Rc<dyn DynIndex> = Rc::from(scan.build(items)?);
    let forced = Forced {
        on: format!("{} against {}", tree.label, scan.label),
        kept: Way::Base,
        left_out: asked(case, whole.clone()),
        same: true,
        judged: true,
    };
    let mut counts = Vec::new();
    let mut pairs = Vec::new();
    for count in parts_of(items.len()) {
        let part: Vec<Aabb> = (0..count).map(|i| items[i * items.len() / count]).collect();
        let both = [Rc::from(scan.build(&part)?), Rc::from(tree.build(&part)?)];
        pairs.push(both.map(|index| asked(case, index)));
        counts.push(count);
    }
    pairs.push([asked(case, whole), Way::Base]);
    counts.push(items.len());
    let names = format!("{} / {}", scan.label, tree.label);
    let mut draft = omission.draft(vec![forced]);
    draft.pairs = pairs;
    Ok(draft.finished_by(move |omission, aside| {
        let ratios = aside.ratios.iter().copied();
        let parts = counts.iter().copied().zip(ratios);
        let parts: Vec<(usize, f64)> = parts.filter(|(_, ratio)| ratio.is_finite()).collect();
        let told: Vec<String> = parts
            .iter()
            .map(|(count, ratio)| format!("{ratio:.2} at {count}"))
            .collect();
        omission.reason = format!("time of {names} on parts of the scene: {}", told.join(", "));
        let all = counts.last().copied().unwrap_or(0);
        omission.weigh(all as f64, items_at(&parts));
    }))
}

/// An index over items of its own, asked by the path's cameras.
fn asked<'c>(case: &'c Case<'c>, index: Rc<dyn DynIndex>) -> Way<'c> {
    let views = &case.workload.views;
    Way::Other(Box::new(move |n, out| index.query(views[n].as_any(), out)))
}

/// Doubled from the smallest, all fewer than `items`.
fn parts_of(items: usize) -> impl Iterator<Item = usize> {
    let doubled = std::iter::successors(Some(LEAST), |count| Some(2 * count));
    doubled.take_while(move |&count| count < items && count <= MOST)
}

/// Where the ratio crosses 1 for good: between the last part on which the scan
/// is as fast and the next, by the logarithms of both. 0 if it never is,
/// all items if it always is.
fn items_at(parts: &[(usize, f64)]) -> f64 {
    let Some(last) = parts.iter().rposition(|(_, ratio)| *ratio <= 1.0) else {
        return 0.0;
    };
    let (count, ratio) = parts[last];
    let Some(&(next, above)) = parts.get(last + 1) else {
        return count as f64;
    };
    let [low, high] = [count, next].map(|count| (count as f64).ln());
    let share = -ratio.ln() / (above.ln() - ratio.ln());
    (low + share * (high - low)).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_doubled_below_the_whole() {
        let parts = |items| parts_of(items).collect::<Vec<_>>();
        assert!(parts(32).is_empty());
        assert_eq!(parts(129), [32, 64, 128]);
        assert_eq!(parts(1 << 24).last(), Some(&MOST));
    }

    #[test]
    fn the_crossing_lies_between_the_parts_about_it() {
        let at = items_at(&[(64, 0.5), (128, 0.5), (256, 2.0), (512, 4.0)]);
        assert!((at - 181.02).abs() < 0.01, "{at}");
        // A part that was disturbed does not end the search.
        let late = items_at(&[(64, 1.2), (128, 0.9), (256, 1.1), (512, 3.0)]);
        assert!((128.0..256.0).contains(&late), "{late}");
        assert_eq!(items_at(&[(64, 1.5), (128, 2.5)]), 0.0);
        assert_eq!(items_at(&[(64, 0.4), (100, 0.9)]), 100.0);
        assert_eq!(items_at(&[]), 0.0);
        assert!((items_at(&[(64, 1.0), (128, 2.0)]) - 64.0).abs() < 1e-9);
    }
}
