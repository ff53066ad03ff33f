//! Exactly visible items of each view, and a stage's counts against them.
//!
//! Rays meet solid boxes in box scenes, triangles in meshes and maps.

use anyhow::anyhow;
use serde::Serialize;

use super::error::most_drawn;
use super::setup::{Setup, Shape};
use crate::query::ItemId;
use crate::statistics::{Estimate, rate_of};
use crate::visibility::truth::{RayIndex, SampleTruth, SolidBox, SurfaceIndex};
use crate::visibility::{Rays, SampleGrid, fragment};

/// Coarse grid that estimates the number of body tests at all samples.
const COARSE_GRID: SampleGrid = SampleGrid::new(16, 9);

/// Number of body tests that take about as long as one front item.
const TESTS_PER_ITEM: u64 = 16;

/// Visible items of each view by ascending id, with their numbers of samples.
pub type VisibleItems = Vec<Vec<(ItemId, u32)>>;

/// Visible items at the samples of every view.
///
/// # Errors
/// Too many items in front at the same samples, or too many bodies around the eye.
pub fn visible(setup: &Setup, threads: usize) -> anyhow::Result<VisibleItems> {
    let targets = RayTargets::of(&setup.shape, setup.cut_outs.as_ref());
    let samples = setup.samples;
    let items = setup.items() as ItemId;
    let of_view = |view| {
        let rays = setup.rays(view);
        let truth = targets.visible(rays, samples, threads);
        let camera = setup.views[view].camera;
        let truth = truth.map_err(|error| anyhow!("camera {camera}: {error}"))?;
        let counts = truth.visible.iter().copied().zip(truth.samples_of);
        let mut seen: Vec<(ItemId, u32)> = counts.collect();
        // Floors and ceilings of a map follow its items.
        seen.retain(|(item, _)| *item < items);
        Ok(seen)
    };
    setup.views().map(of_view).collect()
}

/// Surfaces that stop rays: solid boxes, or triangles with the floors of a map.
pub enum RayTargets<'w> {
    Boxes(RayIndex, Option<&'w fragment::AlphaMasks>),
    Triangles(SurfaceIndex),
}

impl RayTargets<'_> {
    /// Surfaces of a scene of this shape, with the holes of its items.
    pub fn of<'w>(shape: &Shape, masks: Option<&'w fragment::AlphaMasks>) -> RayTargets<'w> {
        match shape {
            Shape::Boxes(solids) => RayTargets::Boxes(RayIndex::build(solids), masks),
            Shape::Triangles(surfaces) => RayTargets::Triangles(SurfaceIndex::build(surfaces)),
        }
    }

    /// Items in front at the samples of a view.
    ///
    /// # Errors
    /// Too many items in front at the same samples, or too many bodies around the eye.
    pub fn visible(
        &self,
        rays: &Rays,
        samples: SampleGrid,
        threads: usize,
    ) -> Result<SampleTruth, String> {
        let coarse_tests = match self {
            RayTargets::Boxes(index, _) => index.min_body_tests(rays, COARSE_GRID),
            RayTargets::Triangles(index) => index.min_body_tests(rays, COARSE_GRID),
        };
        let most = most_drawn(samples);
        let most_tests = most * TESTS_PER_ITEM;
        let tests = coarse_tests * samples.samples() as u64 / COARSE_GRID.samples() as u64;
        let refused = |found: &str, most: u64, fewer: &str| {
            format!(
                "{found}, summed over the samples; expected at most {most}: fewer samples or \
                 fewer items {fewer}"
            )
        };
        if tests > most_tests {
            let found = format!("about {tests} surfaces to test");
            return Err(refused(&found, most_tests, "around the eye"));
        }
        let truth = match self {
            RayTargets::Boxes(index, masks) => {
                let opaque = |body: &SolidBox, probe: &_, at: &_| {
                    masks.is_none_or(|masks| masks.opaque(body.item, &body.b, probe, at))
                };
                SampleTruth::of_opaque(index, &opaque, rays, samples, threads, most)
            }
            RayTargets::Triangles(index) => {
                SampleTruth::of_opaque(index, &|_, _, _| true, rays, samples, threads, most)
            }
        };
        truth.ok_or_else(|| refused("too many front items", most, "with a common face"))
    }
}

/// Counts of one stage in one view.
#[derive(Clone, Copy, Default, PartialEq, Debug)]
pub struct ViewCounts {
    /// Number of candidates.
    pub input: u64,
    /// Number of returned candidates.
    pub output: u64,
    /// Number of visible candidates.
    pub truth: u64,
    /// Visible candidates that are not returned.
    pub false_negatives: u64,
    /// Samples with a false negative in front, summed over the false negatives.
    pub missing_samples: u64,
    /// Most such samples of a single item.
    pub worst_missing_samples: u64,
    /// Samples with an item in front, summed over the visible items.
    pub samples: u64,
}

impl ViewCounts {
    /// Candidates that are not visible.
    pub fn hidden(&self) -> u64 {
        self.input - self.truth
    }

    /// Returned candidates that are not visible.
    pub fn false_positives(&self) -> u64 {
        self.output + self.false_negatives - self.truth
    }
}

/// Counts of a stage with the given input and output.
///
/// `visible` are the visible items, each with its number of samples. All lists are ascending.
pub fn count_items(input: &[ItemId], output: &[ItemId], visible: &[(ItemId, u32)]) -> ViewCounts {
    let mut counts = ViewCounts {
        input: input.len() as u64,
        output: output.len() as u64,
        ..ViewCounts::default()
    };
    for &(item, samples) in visible {
        let samples = u64::from(samples);
        counts.samples += samples;
        let is_given = input.binary_search(&item).is_ok();
        counts.truth += u64::from(is_given);
        // A loss counts at the stage that drops the item, not at later ones.
        if is_given && output.binary_search(&item).is_err() {
            counts.false_negatives += 1;
            counts.missing_samples += samples;
            counts.worst_missing_samples = counts.worst_missing_samples.max(samples);
        }
    }
    counts
}

/// Errors of a stage over all views; counts are means per view.
#[derive(Clone, Default, Debug, Serialize)]
pub struct Errors {
    /// Candidates: items or triangles.
    pub input_count: f64,
    /// Returned candidates.
    pub output_count: f64,
    /// Visible candidates.
    pub truth_count: f64,
    /// Returned candidates that are not visible.
    pub false_positive_count: f64,
    /// Visible candidates that are not returned.
    pub false_negative_count: f64,
    /// False positives / visible, by view.
    pub excess: Option<Estimate>,
    /// False negatives / visible, by view.
    pub missing: Option<Estimate>,
    /// Share of the samples whose front item the stage drops, by view.
    pub image_error: Option<Estimate>,
    /// Most samples at which a single missing item is in front.
    pub worst_missing_samples: u64,
    /// Longest run of consecutive views that each lack a visible item.
    pub longest_missing_streak: usize,
    /// Share of the invisible candidates that the stage removed.
    pub removed_share: Option<Estimate>,
}

impl Errors {
    /// Errors over the views of a path, in path order.
    pub fn of(views: &[ViewCounts]) -> Errors {
        let mean = |of: fn(&ViewCounts) -> u64| {
            views.iter().map(|view| of(view) as f64).sum::<f64>() / views.len().max(1) as f64
        };
        let share = |of: fn(&ViewCounts) -> [u64; 2]| rate_of(views, of).map(Estimate::of_share);
        let streaks = views.split(|view| view.false_negatives == 0);
        let worst = views.iter().map(|v| v.worst_missing_samples).max();
        Errors {
            input_count: mean(|v| v.input),
            output_count: mean(|v| v.output),
            truth_count: mean(|v| v.truth),
            false_positive_count: mean(ViewCounts::false_positives),
            false_negative_count: mean(|v| v.false_negatives),
            excess: rate_of(views, |v| [v.false_positives(), v.truth]),
            missing: share(|v| [v.false_negatives, v.truth]),
            image_error: share(|v| [v.missing_samples, v.samples]),
            worst_missing_samples: worst.unwrap_or(0),
            longest_missing_streak: streaks.map(<[_]>::len).max().unwrap_or(0),
            removed_share: share(|v| [v.hidden().saturating_sub(v.false_positives()), v.hidden()]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_counted_by_item_and_by_sample() {
        let visible = [(2, 10), (5, 1), (9, 4)];
        let all: Vec<ItemId> = (0..12).collect();
        let counts = count_items(&all, &[1, 2, 3, 9], &visible);
        assert_eq!((counts.false_positives(), counts.false_negatives), (2, 1));
        assert_eq!(
            (counts.missing_samples, counts.worst_missing_samples),
            (1, 1)
        );
        assert_eq!((counts.samples, counts.truth), (15, 3));
        // A loss at an earlier stage is not counted again.
        let counts = count_items(&[1, 2, 3, 7, 9], &[1, 2, 9], &visible);
        assert_eq!((counts.input, counts.hidden(), counts.truth), (5, 3, 2));
        assert_eq!((counts.false_positives(), counts.false_negatives), (1, 0));
        assert_eq!((counts.samples, counts.missing_samples), (15, 0));
        assert_eq!(count_items(&all, &[], &visible).false_negatives, 3);
        assert_eq!(count_items(&all, &[1, 4], &[]).false_positives(), 2);
    }

    #[test]
    fn streaks_are_of_views_one_after_the_other() {
        let view = |false_negatives| ViewCounts {
            input: 10,
            output: 6,
            truth: 4,
            false_negatives,
            ..ViewCounts::default()
        };
        let errors = Errors::of(&[1, 0, 2, 1, 0].map(view));
        assert_eq!(errors.longest_missing_streak, 2);
        assert_eq!(errors.false_negative_count, 0.8);
        assert_eq!(errors.missing.unwrap().value, 0.2);
        assert_eq!(
            Errors::of(&[view(0)]).removed_share.unwrap().value,
            4.0 / 6.0
        );
    }
}
