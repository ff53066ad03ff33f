//! The index itself: below some number of items a scan is as fast. The
//! crossover is measured on evenly spread parts of the scene, by the path's own
//! cameras, side by side with everything else.

use super::super::omission::{By, Decision, LeftOutIf};
use super::super::rule::{Draft, Finding, Rule, Unfit};
use super::super::trials::{BASE, Sides, Trials};
use crate::geometry::Aabb;

pub(super) const RULE: Rule = Rule {
    name: "no-index",
    left_out: "the index itself",
    feature: "index",
    is_saving: false,
    statistic_name: "items",
    left_out_if: LeftOutIf::AtMost,
    by: By::Time,
    prepare,
};

/// The smallest part that is looked at, and the largest beside the whole.
const LEAST: usize = 32;
const MOST: usize = 16_384;

fn prepare(trials: &mut Trials) -> Result<Draft, Unfit> {
    let case = trials.case;
    let (scan, tree) = (&case.scan, &case.spec);
    let items = &case.scene().items;
    let whole = trials.index(scan.build(items)?, case.views());
    let sides = Sides::same(
        format!("{} against {}", tree.label, scan.label),
        BASE,
        whole,
    );
    let (mut counts, mut pairs) = (Vec::new(), Vec::new());
    for count in parts_of(items.len()) {
        let part: Vec<Aabb> = (0..count).map(|i| items[i * items.len() / count]).collect();
        let both = [scan.build(&part)?, tree.build(&part)?];
        pairs.push(both.map(|index| trials.index(index, case.views())));
        counts.push(count);
    }
    pairs.push([whole, BASE]);
    counts.push(items.len());
    let (names, all) = (
        format!("{} / {}", scan.label, tree.label),
        items.len() as f64,
    );
    let mut draft = Draft::concluded(vec![sides], move |facts| {
        let parts = counts.into_iter().zip(facts.ratios.iter().copied());
        let parts: Vec<(usize, f64)> = parts.filter(|(_, ratio)| ratio.is_finite()).collect();
        let ratios = parts
            .iter()
            .map(|(count, ratio)| format!("{ratio:.2} at {count}"));
        let ratios = ratios.collect::<Vec<_>>().join(", ");
        let reason = format!("time of {names} on parts of the scene: {ratios}");
        let (taken, crossing) = (facts.structure, items_at(&parts));
        Finding {
            saving: facts.saving(),
            // As the structure taken, wherever there was a choice.
            decision: taken.is_open.then_some(Decision::of(taken.is_scan)),
            note: match crossing {
                0.0 => "a scan is never as fast".to_owned(),
                _ => format!("a scan wins up to {crossing:.0} items"),
            },
            ..Finding::new(all, crossing, reason)
        }
    });
    draft.pairs = pairs;
    Ok(draft)
}

/// Doubled from the smallest, all fewer than `items`.
fn parts_of(items: usize) -> impl Iterator<Item = usize> {
    let doubled = std::iter::successors(Some(LEAST), |count| Some(2 * count));
    doubled.take_while(move |&count| count < items && count <= MOST)
}

/// Number of items at which the ratio last crosses 1.
///
/// The crossing lies between the last part on which the scan
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
