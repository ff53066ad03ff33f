//! The index itself: below some number of items a scan is as fast. The
//! crossover is measured on evenly spread parts of the scene, by the path's own
//! cameras.

use super::super::AdviseError;
use super::super::case::Case;
use super::super::omission::{By, Draft, Forced, LeftOutIf, Omission, Way};
use crate::geometry::Aabb;
use crate::index::StructureSpec;
use crate::measure::{Competitor, Protocol, paired_ratio, timed_rounds};

pub(super) const NAME: &str = "no-index";

/// The smallest part that is looked at.
const LEAST: usize = 32;
/// Time of the scan / time of the tree at which no larger part is looked at, if
/// it has so many items: for fewer the ratio goes up and down.
const CLEAR: f64 = 2.0;
const MANY: usize = 4096;

pub(super) fn prepare<'c>(case: &'c Case<'c>) -> Result<Draft<'c>, AdviseError> {
    let omission = Omission::new(
        NAME,
        "the index itself",
        "items",
        LeftOutIf::AtMost,
        By::Time,
    );
    let (scan, tree) = (&case.scan, &case.spec);
    let items = &case.scene().items;
    let parts = crossover(case, scan, tree)?;
    let crossing = items_at(&parts);
    let told: Vec<String> = parts
        .iter()
        .map(|(count, ratio)| format!("{ratio:.2} at {count}"))
        .collect();
    let omission = omission
        .compares(items.len() as f64, crossing)
        .because(format!(
            "time of {} / {} on parts of the scene: {}",
            scan.label,
            tree.label,
            told.join(", ")
        ));
    let index = scan.build(items)?;
    let forced = Forced {
        on: format!("{} against {}", tree.label, scan.label),
        kept: Way::Base,
        left_out: Way::Other(Box::new(move |n, out| {
            index.see(case.workload.views[n].as_any(), out);
        })),
        same: true,
        judged: true,
    };
    Ok(omission.draft(vec![forced]))
}

/// Time of the scan / time of the tree on growing parts of the scene, up to
/// where the tree is clearly ahead.
fn crossover(
    case: &Case,
    scan: &StructureSpec,
    tree: &StructureSpec,
) -> Result<Vec<(usize, f64)>, AdviseError> {
    let items = &case.scene().items;
    let protocol = Protocol {
        rounds: [5, 9],
        task_ns: 75e6,
        ..case.protocol
    };
    let mut parts = Vec::new();
    let mut count = LEAST.min(items.len());
    loop {
        let part: Vec<Aabb> = (0..count).map(|i| items[i * items.len() / count]).collect();
        let ratio = ratio_on(case, &part, [scan, tree], &protocol)?;
        parts.extend(ratio.map(|ratio| (count, ratio)));
        if count == items.len() || (count >= MANY && ratio.is_none_or(|ratio| ratio > CLEAR)) {
            return Ok(parts);
        }
        count = (2 * count).min(items.len());
    }
}

fn ratio_on(
    case: &Case,
    part: &[Aabb],
    specs: [&StructureSpec; 2],
    protocol: &Protocol,
) -> Result<Option<f64>, AdviseError> {
    let mut competitors = Vec::with_capacity(2);
    for spec in specs {
        let index = spec.build(part)?;
        let views = &case.workload.views;
        let mut out = Vec::new();
        let counts = views.iter().map(|view| {
            out.clear();
            index.see(view.as_any(), &mut out);
            out.len() as u64
        });
        competitors.push(Competitor {
            expected: counts.collect(),
            ask: Box::new(move |n, out| index.see(views[n].as_any(), out)),
            ask_many: None,
            least_ns: None,
        });
    }
    let count = case.workload.views.len();
    let timed = timed_rounds(count, &competitors, protocol, &|| false);
    Ok(match timed.as_deref() {
        Some([Ok(scan), Ok(tree)]) => paired_ratio(scan, tree).map(|ratio| ratio.value),
        _ => None,
    })
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
