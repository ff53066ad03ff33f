//! What the rules about stages beyond the frustum have in common: one side removes
//! something that the other hands on, so what is weighed is the drawing that this
//! saves against the time that it takes.

use super::super::case::Case;
use super::super::omission::{Check, Draft, Forced, Omission, Way};
use crate::geometry::ConvexVolume;
use crate::measure::Ask;
use crate::query::ItemId;
use crate::scene::Scene;
use crate::visibility::truth::{RayIndex, SurfaceIndex};
use crate::visibility::{Ray, Rays, SampleGrid, Solids, surfaces_of};

/// Cameras that a prediction looks at, evenly spread, and rays of each.
pub(super) const PROBED: usize = 8;
pub(super) const PROBES: SampleGrid = SampleGrid::new(16, 9);
/// Cameras on which items are counted, evenly spread.
const MOST_COUNTED: usize = 64;

/// Rays and six planes of every camera, or why there are none.
pub(super) fn sights(case: &Case) -> Result<Vec<(Rays, ConvexVolume)>, &'static str> {
    let rays = case.workload.cameras.iter().map(|c| Rays::of(c).ok());
    let both = rays.zip(case.volumes());
    let sights: Option<Vec<_>> = both.map(|(rays, v)| Some((rays?, v.clone()))).collect();
    let sights = sights.filter(|sights| sights.len() == case.workload.views.len());
    sights.ok_or("cameras without rays of their own")
}

/// The items as rays meet them: solid boxes, or triangles.
pub(super) enum Met {
    Boxes(RayIndex),
    /// With the number of items: what is behind them in the list is none.
    Triangles(SurfaceIndex, usize),
}

impl Met {
    /// All of a scene.
    pub fn of(scene: &Scene) -> Met {
        match surfaces_of(scene) {
            None => Met::Boxes(RayIndex::build(&Solids::of(scene))),
            Some(surfaces) => Met::Triangles(SurfaceIndex::build(&surfaces), scene.items.len()),
        }
    }

    /// How many items lie along a ray.
    pub fn layers(&self, ray: &Ray) -> usize {
        let mut met: Vec<ItemId> = match self {
            Met::Boxes(index) => {
                let all = index.all_along(ray).into_iter();
                all.map(|(item, _)| item).collect()
            }
            Met::Triangles(index, items) => {
                let all = index.all_along(ray).into_iter();
                let all = all.map(|(item, _)| item);
                all.filter(|&item| (item as usize) < *items).collect()
            }
        };
        met.sort_unstable();
        met.dedup();
        met.len()
    }
}

/// So many of the cameras, or all, evenly spread.
pub(super) fn frames(cameras: usize, most: usize) -> impl Iterator<Item = usize> {
    let count = cameras.min(most);
    (0..count).map(move |n| n * cameras / count)
}

/// Mean number of items that are handed on, over some of the cameras.
pub(super) fn mean_count(ask: &Ask, cameras: usize, most: usize) -> f64 {
    let mut out = Vec::new();
    mean(frames(cameras, most).map(|frame| {
        out.clear();
        ask(frame, &mut out);
        out.len() as f64
    }))
}

/// 0 of nothing.
pub(super) fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for value in values {
        sum += value;
        count += 1;
    }
    sum / f64::from(count.max(1))
}

/// What one side removes of what the other hands on.
pub(super) struct Removal {
    /// What is removed: one, and more of it.
    pub unit: [&'static str; 2],
    /// Left by the side that removes, a view.
    pub with: f64,
    /// Handed on by the other, a view.
    pub without: f64,
    /// What one costs that is not removed, ns.
    pub cost_ns: f64,
    /// The share that is removed, from something cheaper than removing it.
    pub predicted: f64,
}

impl Removal {
    /// Completes a rule: leaves out where what is removed is worth no more than the
    /// time that removing takes.
    pub fn weigh(&self, omission: &mut Omission, check: &Check) {
        let (with, without, cost_ns) = (self.with, self.without, self.cost_ns);
        let [one, many] = self.unit;
        if without == 0.0 {
            omission.saving = None;
            omission.reason = format!("no {one} is in any view that was looked at");
            return;
        }
        let removed = without - with;
        let testing = check.kept_ns - check.left_out_ns;
        let pays = (testing / (cost_ns * without)).max(0.0);
        let share = removed / without;
        omission.reason = format!(
            "{removed:.1} of {without:.1} {many} a view are removed ({:.1} %; predicted {:.1} %), \
             which saves {} ns each{}",
            share * 100.0,
            self.predicted * 100.0,
            (cost_ns * 1e3).round() / 1e3,
            match testing > 0.0 && removed > 0.0 {
                true => format!("; pays above {:.1} ns per {one}", testing / removed),
                false => String::new(),
            }
        );
        omission.weigh(share, pays);
        let costs = [
            check.kept_ns + with * cost_ns,
            check.left_out_ns + without * cost_ns,
        ];
        omission.saving = Some(1.0 - costs[1] / costs[0]).filter(|saving| saving.is_finite());
        let predicted = self.predicted;
        omission.confirmed = (predicted.is_finite() && pays.is_finite())
            .then_some((predicted <= pays) == (share <= pays));
    }
}

/// A rule of which one side removes something; what, is looked at when all is timed.
pub(super) fn weighed<'c>(
    omission: Omission,
    forced: Forced<'c>,
    removal: impl FnOnce() -> Removal + 'static,
) -> Draft<'c> {
    let draft = omission.draft(vec![forced]);
    draft.finished_by(move |omission, _| {
        if let Some(check) = omission.checks.first().cloned() {
            removal().weigh(omission, &check);
        }
    })
}

/// A rule about items: `kept` hands on less of them than `left_out`.
pub(super) fn draft<'c>(
    case: &'c Case<'c>,
    omission: Omission,
    on: String,
    kept: Ask<'c>,
    left_out: Way<'c>,
    predicted: f64,
) -> Draft<'c> {
    let frames = case.workload.views.len();
    let base: Ask = Box::new(|n, out| case.query(n, out));
    let removal = Removal {
        unit: ["item", "items"],
        with: mean_count(&kept, frames, MOST_COUNTED),
        without: match &left_out {
            Way::Base => mean_count(&base, frames, MOST_COUNTED),
            Way::Other(ask) => mean_count(ask, frames, MOST_COUNTED),
        },
        cost_ns: case.options.draw_ns,
        predicted,
    };
    let forced = Forced {
        on,
        kept: Way::Other(kept),
        left_out,
        same: false,
        judged: false,
    };
    weighed(omission, forced, move || removal)
}

#[cfg(test)]
mod tests {
    use super::super::super::omission::{Aside, By, Decision, LeftOutIf, check};
    use super::super::super::rule::unsettled;
    use super::*;

    #[test]
    fn cameras_are_spread_evenly_and_none_is_looked_at_twice() {
        assert_eq!(frames(3, 8).collect::<Vec<_>>(), [0, 1, 2]);
        assert_eq!(frames(10, 4).collect::<Vec<_>>(), [0, 2, 5, 7]);
        assert_eq!(frames(0, 4).count(), 0);
        assert_eq!(mean([2.0, 4.0].into_iter()), 3.0);
        assert_eq!(mean([].into_iter()), 0.0);
    }

    #[test]
    fn a_stage_is_left_out_where_it_takes_longer_than_what_it_saves() {
        let of = |with: f64, cost_ns: f64, predicted: f64| {
            let rule = unsettled(LeftOutIf::AtMost, By::Rule);
            let mut check = check(3.0, None);
            check.same_expected = false;
            let removal = Removal {
                unit: ["thing", "things"],
                with,
                without: 50.0,
                cost_ns,
                predicted,
            };
            let own = check.clone();
            let finish = move |omission: &mut Omission, _: &Aside| removal.weigh(omission, &own);
            rule.settled(vec![check], &Aside::default(), Some(Box::new(finish)))
        };
        // 200 ns for 40 of 50: pays above 5 ns each.
        let dear = of(10.0, 5.1, 0.79);
        assert_eq!(
            (dear.decision, dear.confirmed),
            (Decision::Keep, Some(true))
        );
        assert_eq!(dear.statistic, Some(0.8));
        assert!((dear.threshold.unwrap() - 200.0 / 255.0).abs() < 1e-12);
        assert!(
            dear.reason.contains("40.0 of 50.0 things"),
            "{}",
            dear.reason
        );
        assert!(
            dear.reason.contains("above 5.0 ns per thing"),
            "{}",
            dear.reason
        );
        let cheap = of(10.0, 4.9, 0.9);
        assert_eq!(
            (cheap.decision, cheap.confirmed),
            (Decision::LeaveOut, Some(false))
        );
        // It costs 300 + 49 with and 100 + 245 without.
        assert!((cheap.saving.unwrap() - (1.0 - 345.0 / 349.0)).abs() < 1e-12);
        assert_eq!(of(50.0, 1e9, 0.0).decision, Decision::LeaveOut);
        let removal = Removal {
            unit: ["thing", "things"],
            with: 0.0,
            without: 0.0,
            cost_ns: 1.0,
            predicted: f64::NAN,
        };
        let mut nothing = unsettled(LeftOutIf::AtMost, By::Rule);
        removal.weigh(&mut nothing, &check(3.0, None));
        assert_eq!((nothing.predicted, nothing.threshold), (None, None));
        assert!(nothing.reason.contains("no thing"), "{}", nothing.reason);
    }
}
