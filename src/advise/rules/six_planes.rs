//! Axes beyond the six planes: the volume's own box and its silhouettes, which
//! the exact test adds. They cost test time and save the drawing of what cannot
//! be seen.

use super::super::case::Case;
use super::super::choice::TestChoice;
use super::super::omission::{Decision, LeftOutIf};
use super::super::rule::{Draft, Finding, Unfit, not_applicable};
use super::super::trials::{BASE, Sides, Trials};
use crate::culling::{Culling, CullingTest};

pub(super) fn prepare(trials: &mut Trials) -> Result<Draft, Unfit> {
    let case = trials.case;
    let exact = Culling {
        test: CullingTest::Exact,
        ..Culling::default()
    };
    let views = case.views_by(&exact).map_err(not_applicable)?;
    let kept = trials.index(case.tree_for(CullingTest::Exact)?, views);
    let sides = Sides::new(&case.spec.label, kept, BASE);
    let draw_ns = case.options.draw_ns;
    let predicted = predicted_excess(case);
    Ok(Draft::concluded(vec![sides], move |facts| {
        let check = &facts.checks[0];
        let Some(more) = check.more_false_positives() else {
            return Finding {
                saving: facts.saving(),
                ..Finding::default()
            };
        };
        let (drawing, testing) = (more * draw_ns, check.kept_ns - check.left_out_ns);
        let worth = testing / more;
        let left_out = check.left_out_ns + drawing;
        let reason = format!(
            "{more:.1} items a query too many ({:.2} %; 4 (s/D)^2 predicts {:.2} %) at {draw_ns} ns each, \
             against the extra test time{}",
            check.left_out_excess.unwrap_or(0.0) * 100.0,
            predicted * 100.0,
            match worth.is_finite() && worth > 0.0 {
                true => format!("; worth it above {worth:.0} ns per item"),
                false => String::new(),
            }
        );
        let finding = Finding::new(drawing, testing, reason)
            .noted(format!("with {draw_ns} ns/item drawn"))
            .costing([check.kept_ns, left_out]);
        following(finding, facts.test)
    }))
}

/// Decides as the test that is taken, which has these axes or has not.
///
/// The statistic is then a prediction.
fn following(mut finding: Finding, choice: &TestChoice) -> Finding {
    let predicted = finding
        .compared
        .and_then(|both| LeftOutIf::AtMost.holds(both));
    let (Some(predicted), Some(taken)) = (predicted, choice.name) else {
        return finding;
    };
    let with_axes = |name: &str| {
        let tests = [CullingTest::SixBox, CullingTest::Exact];
        tests.iter().any(|test| test.name() == name)
    };
    let kept = with_axes(taken);
    // The side taken by its test, the other by its best.
    let total = |with: bool| {
        let rows = choice.rows.iter().filter(|row| with_axes(row.test) == with);
        let rows = rows.filter(|row| with != kept || row.test == taken);
        rows.filter_map(|row| row.total_ns).min_by(f64::total_cmp)
    };
    finding.cost_ns = total(true)
        .zip(total(false))
        .map(|(with, without)| [with, without]);
    let is_tie = choice.ties.iter().any(|name| with_axes(name) != kept);
    finding.decision = Some(Decision::of(!kept));
    finding.is_tie = Some(is_tie);
    finding.confirmed = (!is_tie).then_some(predicted != kept);
    finding.reason += &match is_tie {
        true => format!("; a tie, {taken} is the simplest"),
        false => format!("; {taken} is the test taken"),
    };
    finding
}

/// `4 (s/D)^2` for the mean square of the items' edges s and the mean depth D
/// of the views: docs/NUMERICS.md.
fn predicted_excess(case: &Case) -> f64 {
    let items = &case.scene().items;
    let squares = items
        .iter()
        .map(|item| f64::from(item.extent().length_squared()) / 3.0);
    let square = squares.sum::<f64>() / items.len() as f64;
    let cameras = case.workload.cameras.len();
    let depth = (0..cameras).map(|frame| case.depth(frame)).sum::<f64>() / cameras as f64;
    4.0 * square / (depth * depth)
}

#[cfg(test)]
mod tests {
    use super::super::super::omission::By;
    use super::super::super::rule::some_rule;
    use super::*;

    #[test]
    fn the_test_taken_decides_about_the_axes() {
        let tests = ["six-plane", "six-box", "exact", "sphere"];
        for predicted in [true, false] {
            for (taken, ties, decision, confirmed) in [
                (tests[0], vec![], Decision::LeaveOut, Some(predicted)),
                (tests[3], vec![], Decision::LeaveOut, Some(predicted)),
                (tests[1], vec![], Decision::Keep, Some(!predicted)),
                (tests[2], vec![tests[1]], Decision::Keep, Some(!predicted)),
                (tests[0], vec![tests[2]], Decision::LeaveOut, None),
                (tests[1], vec![tests[3]], Decision::Keep, None),
            ] {
                let statistic = if predicted { 0.5 } else { 2.0 };
                let finding = Finding::new(statistic, 1.0, "");
                let mut choice = TestChoice {
                    name: Some(taken),
                    ties,
                    structure: "wide".to_owned(),
                    rows: Vec::new(),
                };
                let settled = |choice: &TestChoice| {
                    let rule = some_rule(LeftOutIf::AtMost, By::Rule);
                    rule.omission(following(finding.clone(), choice), Vec::new())
                };
                let omission = settled(&choice);
                let found = (omission.decision, omission.confirmed);
                assert_eq!(found, (decision, confirmed), "{taken} {:?}", choice.ties);
                assert!(omission.reason.contains(taken), "{}", omission.reason);
                // Without a test that is taken the rule decides.
                choice.name = None;
                assert_eq!(settled(&choice).decision, Decision::of(predicted));
            }
        }
    }
}
