//! Axes beyond the six planes: the volume's own box and its silhouettes, which
//! the exact test adds. They cost test time and save the drawing of what cannot
//! be seen.

use super::super::case::{Case, asked};
use super::super::choice::TestChoice;
use super::super::omission::{By, Decision, Draft, Forced, LeftOutIf, Omission, Way};
use super::super::rule::{Rule, Unfit, not_applicable};
use crate::culling::{Culling, CullingTest};

pub(super) const RULE: Rule = Rule {
    name: "six-planes",
    left_out: "axes beyond the six planes",
    advice: [
        "six planes are enough",
        "use the exact test (separating axes): six planes are not enough",
    ],
    statistic_name: "cost of drawing what six planes let through, ns a query",
    left_out_if: LeftOutIf::AtMost,
    by: By::Rule,
    prepare,
};

fn prepare<'c>(case: &'c Case<'c>, omission: Omission) -> Result<Draft<'c>, Unfit> {
    let exact = Culling {
        test: CullingTest::Exact,
        ..Culling::default()
    };
    let views = case.views(&exact).map_err(not_applicable)?;
    let forced = Forced {
        on: case.spec.label.clone(),
        kept: Way::Other(asked(case.tree_for(CullingTest::Exact)?, views)),
        left_out: Way::Base,
        same: false,
        judged: true,
    };
    let draw_ns = case.options.draw_ns;
    let predicted = predicted_excess(case);
    Ok(omission.draft(vec![forced]).finished_by(move |omission, _| {
        let Some(check) = omission.checks.first() else {
            return;
        };
        let Some(more) = check.more_false_positives() else {
            return;
        };
        let (drawing, testing) = (more * draw_ns, check.kept_ns - check.left_out_ns);
        let excess = check.left_out_excess.unwrap_or(0.0);
        let worth = testing / more;
        let (kept, left_out) = (check.kept_ns, check.left_out_ns + drawing);
        omission.reason = format!(
            "{more:.1} items a query too many ({:.2} %; 4 (s/D)^2 predicts {:.2} %) at {draw_ns} ns each, \
             against the extra test time{}",
            excess * 100.0,
            predicted * 100.0,
            match worth.is_finite() && worth > 0.0 {
                true => format!("; worth it above {worth:.0} ns per item"),
                false => String::new(),
            }
        );
        omission.weigh(drawing, testing);
        omission.saving = Some(1.0 - left_out / kept).filter(|saving| saving.is_finite());
    }))
}

/// The test that is taken has these axes or has not: one decision, said once.
/// The rule's own side is then what it predicted.
pub(in crate::advise) fn follow(omission: &mut Omission, choice: &TestChoice) {
    let applies = omission.rule == RULE.name && omission.decision != Decision::NotApplicable;
    let Some(taken) = choice.name.filter(|_| applies) else {
        return;
    };
    let with_axes = |name: &str| {
        let tests = [CullingTest::SixBox, CullingTest::Exact];
        tests.iter().any(|test| test.name() == name)
    };
    let kept = with_axes(taken);
    let is_tie = choice.ties.iter().any(|name| with_axes(name) != kept);
    omission.decision = match kept {
        true => Decision::Keep,
        false => Decision::LeaveOut,
    };
    let predicted = omission.predicted.filter(|_| !is_tie);
    omission.confirmed = predicted.map(|left_out| left_out != kept);
    omission.reason += &match is_tie {
        true => format!("; a tie, {taken} is the simplest"),
        false => format!("; {taken} is the test taken"),
    };
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
    use super::super::super::omission::Aside;
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
                let rule = RULE
                    .omission()
                    .compares(if predicted { 0.5 } else { 2.0 }, 1.0);
                let mut omission = rule.settled(Vec::new(), &Aside::default(), None);
                let mut choice = TestChoice {
                    name: Some(taken),
                    ties,
                    structure: "wide".to_owned(),
                    rows: Vec::new(),
                };
                follow(&mut omission, &choice);
                let found = (omission.decision, omission.confirmed);
                assert_eq!(found, (decision, confirmed), "{taken} {:?}", choice.ties);
                assert!(omission.reason.contains(taken), "{}", omission.reason);
                // Nothing could be judged: the rule decides.
                choice.name = None;
                let before = omission.decision;
                follow(&mut omission, &choice);
                assert_eq!(omission.decision, before);
            }
        }
    }
}
