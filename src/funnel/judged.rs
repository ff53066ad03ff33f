//! What a stage hands on beside what is truly visible: counts of a view, and their
//! rates over views.

use serde::Serialize;

use crate::query::ItemId;
use crate::statistics::{Rate, rate};

/// One view of one stage.
#[derive(Clone, Copy, Default, PartialEq, Debug)]
pub struct Judged {
    /// What the stage was given.
    pub input: u64,
    /// What it handed on.
    pub output: u64,
    /// Of that what is not visible.
    pub hidden: u64,
    /// What it should have handed on, and no more.
    pub truth: u64,
    /// Handed on, though not visible.
    pub false_positives: u64,
    /// Visible, and not handed on.
    pub false_negatives: u64,
    /// Samples whose front item is not handed on.
    pub missing_samples: u64,
    /// The most of them of one item.
    pub worst_missing_samples: u64,
    /// Samples that any item is in front at.
    pub samples: u64,
}

/// What was made of the items `input` (`None`: of `all` that there are) against the
/// visible ones with the samples of each; all ascending.
pub fn judge_items(
    input: Option<&[ItemId]>,
    all: usize,
    output: &[ItemId],
    visible: &[(ItemId, u32)],
) -> Judged {
    let is_given = |item: &ItemId| input.is_none_or(|input| input.binary_search(item).is_ok());
    let given = visible.iter().filter(|(item, _)| is_given(item)).count();
    let count = input.map_or(all, <[ItemId]>::len) as u64;
    let mut judged = Judged {
        input: count,
        hidden: count - given as u64,
        output: output.len() as u64,
        truth: visible.len() as u64,
        ..Judged::default()
    };
    for &(item, samples) in visible {
        judged.samples += u64::from(samples);
        if output.binary_search(&item).is_err() {
            judged.false_negatives += 1;
            judged.missing_samples += u64::from(samples);
            judged.worst_missing_samples = judged.worst_missing_samples.max(samples.into());
        }
    }
    judged.false_positives = judged.output + judged.false_negatives - judged.truth;
    judged
}

/// All views of one stage together. Counts are means per view.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Errors {
    /// Items (or triangles) that it was given.
    pub input_count: f64,
    /// Of them those that it handed on.
    pub output_count: f64,
    /// Those that are visible.
    pub truth_count: f64,
    /// Handed on, though not visible.
    pub false_positive_count: f64,
    /// Visible, and not handed on.
    pub false_negative_count: f64,
    /// False positives / visible, by view.
    pub excess: Option<Rate>,
    /// False negatives / visible, by view.
    pub missing: Option<Rate>,
    /// Share of the samples whose front item is missing, by view.
    pub image_error: Option<Rate>,
    /// Most samples that one missing item is in front at.
    pub worst_missing_samples: u64,
    /// Longest run of views one after the other that each lack something.
    pub longest_missing_streak: usize,
    /// Of what is not visible, the share that it removed.
    pub removed_share: Option<Rate>,
}

impl Errors {
    /// Of the views of a path, in its order.
    pub fn of(views: &[Judged]) -> Errors {
        let mean = |of: fn(&Judged) -> u64| {
            views.iter().map(|view| of(view) as f64).sum::<f64>() / views.len().max(1) as f64
        };
        let share = |of: fn(&Judged) -> [u64; 2]| {
            let clusters: Vec<[f64; 2]> = views.iter().map(|v| of(v).map(|n| n as f64)).collect();
            rate(&clusters)
        };
        let streaks = views.split(|view| view.false_negatives == 0);
        Errors {
            input_count: mean(|v| v.input),
            output_count: mean(|v| v.output),
            truth_count: mean(|v| v.truth),
            false_positive_count: mean(|v| v.false_positives),
            false_negative_count: mean(|v| v.false_negatives),
            excess: share(|v| [v.false_positives, v.truth]),
            missing: share(|v| [v.false_negatives, v.truth]),
            image_error: share(|v| [v.missing_samples, v.samples]),
            worst_missing_samples: views
                .iter()
                .map(|v| v.worst_missing_samples)
                .max()
                .unwrap_or(0),
            longest_missing_streak: streaks.map(<[Judged]>::len).max().unwrap_or(0),
            removed_share: share(|v| [v.hidden.saturating_sub(v.false_positives), v.hidden]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_counted_by_item_and_by_sample() {
        let visible = [(2, 10), (5, 1), (9, 4)];
        let judged = judge_items(Some(&[1, 2, 3, 7, 9]), 12, &[1, 2, 3, 9], &visible);
        assert_eq!((judged.false_positives, judged.false_negatives), (2, 1));
        assert_eq!(
            (judged.missing_samples, judged.worst_missing_samples),
            (1, 1)
        );
        assert_eq!((judged.samples, judged.truth), (15, 3));
        assert_eq!((judged.input, judged.hidden), (5, 3));
        assert_eq!(judge_items(None, 12, &[], &visible).false_negatives, 3);
        assert_eq!(judge_items(None, 12, &[1, 4], &[]).false_positives, 2);
    }

    #[test]
    fn streaks_are_of_views_one_after_the_other() {
        let view = |false_negatives| Judged {
            input: 10,
            hidden: 6,
            output: 6,
            truth: 4,
            false_positives: 2 + false_negatives,
            false_negatives,
            ..Judged::default()
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
