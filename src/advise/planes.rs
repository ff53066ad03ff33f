//! Rules about planes: which are tested, below which nodes, in which precision.

use std::rc::Rc;

use anyhow::bail;
use glam::DVec3;

use super::case::{NO_NODES, TOLERANCE, subset};
use super::rule::{EnteredRule, Finding};
use super::tasks::{BASE, TaskList, TaskPair};
use super::test_choice::TestChoice;
use crate::camera::PlaneOptions;
use crate::culling::{Arithmetic, CameraView, Culling, CullingTest};
use crate::geometry::{Aabb, BoxBlock, ConvexVolume, LANES, LaneMask, PlaneMask};
use crate::index::{FrustumQuery, Input, Query, RegionIndex, Wide};
use crate::kernel::{Isa, Kernel};
use crate::measure::Workload;
use crate::query::{ItemId, NoRecorder, Planes, Predicate, QueryVolume, Sorted, plane_test};
use crate::shown::{count, counted, significant};

/// Share of the planes above which the saving is not significant.
const MAX_NEEDED: f64 = 0.99;

/// Rule: planes with the whole scene on their inner side are not needed.
///
/// Mostly far planes, which paths often put behind the scene.
pub fn needless_planes(tasks: &mut TaskList) -> anyhow::Result<EnteredRule> {
    let case = tasks.case;
    let bounds = &case.workload.scene.bounds;
    let (mut needed, mut all) = (0, 0);
    let mut fewer = Vec::with_capacity(case.workload.views.len());
    for volume in case.volumes() {
        let left = without_needless(volume, bounds);
        all += volume.planes().len();
        needed += left.planes().len();
        fewer.push(CameraView::Volume(left));
    }
    let share = needed as f64 / all.max(1) as f64;
    let (inside, planes) = (all - needed, counted(all, "plane"));
    let reason = format!("scene is inside {inside} of {planes}");
    // Two sides with the same planes would only differ by noise.
    let sides = (inside > 0).then(|| {
        let left_out = tasks.index(&*case.index, fewer);
        TaskPair::new(&case.spec.label, BASE, left_out)
    });
    let finding = Finding::new(share, MAX_NEEDED, reason);
    Ok(EnteredRule::new(sides, finding))
}

/// Removes the planes that contain the bounds.
///
/// Every box within the bounds gets the same verdict, since plane tests are monotone.
fn without_needless(volume: &ConvexVolume, bounds: &Aabb) -> ConvexVolume {
    let indexed = volume.planes().iter().zip(0..);
    let needed = indexed.filter(|(_, index)| !volume.contains(*index, bounds));
    let needed: Vec<_> = needed.map(|(plane, _)| *plane).collect();
    // Finite planes, and no more than before.
    ConvexVolume::from_planes(&needed).unwrap_or_else(|_| volume.clone())
}

/// Least share of the plane tests that masks must save.
///
/// A small tree saves a few percent, and carrying masks has a cost.
const MIN_SAVED: f64 = 0.1;
/// Cameras whose plane tests are counted.
const COUNTED_CAMERAS: usize = 64;

/// Rule: plane masks, which skip planes that contain a node in its subtree.
///
/// The side without masks is a view that leaves all planes open unless all are closed.
pub fn plane_masks(tasks: &mut TaskList) -> anyhow::Result<EnteredRule> {
    let case = tasks.case;
    let kernel = case.spec.execution.kernel;
    let input = Input::new(&case.workload.scene.items);
    let tree = Rc::new(Wide::build(&input, &Default::default())?);
    let volumes: Rc<[ConvexVolume]> = case.volumes().cloned().collect();
    let step = volumes.len().div_ceil(COUNTED_CAMERAS).max(1);
    let (mut fewer, mut all) = (0, 0);
    for volume in volumes.iter().step_by(step) {
        fewer += tree.counted(volume).1.planes_tested;
        all += tree.counted(&Unmasked(volume)).1.planes_tested;
    }
    let mut finding = Finding::none("no plane is ever tested");
    if all > 0 {
        let [left, tests] = [fewer, all].map(|tests| count(tests as usize));
        let reason = format!("masks leave {left} of {tests} tests");
        finding = Finding::new(1.0 - fewer as f64 / all as f64, MIN_SAVED, reason);
    }
    let (other, views) = (tree.clone(), volumes.clone());
    let kept = tasks.enter(true, move |n, out| see(kernel, &tree, &volumes[n], out));
    let left_out = tasks.enter(true, move |n, out| {
        see(kernel, &other, &Unmasked(&views[n]), out)
    });
    let sides = TaskPair::new(Wide::INFO.name, kept, left_out);
    Ok(EnteredRule::concluded(sides, |advice, _| {
        match advice.structure.is_scan() {
            true => Finding::none(NO_NODES),
            false => finding,
        }
    }))
}

fn see<Q: QueryVolume>(kernel: Kernel, index: &Wide, volume: &Q, sink: &mut Vec<ItemId>) {
    let recorder = &mut NoRecorder;
    // A Vec never breaks off.
    let _ = kernel.run(Query {
        index,
        volume,
        sink,
        recorder,
    });
}

/// Six-plane view in which every plane is open if any is.
struct Unmasked<'a>(&'a ConvexVolume);

impl Predicate for Unmasked<'_> {
    plane_test!(self => self.0, bounds => bounds);
}

impl QueryVolume for Unmasked<'_> {
    #[inline(always)]
    fn kept_lanes<I: Isa>(&self, isa: I, block: &BoxBlock, mask: PlaneMask) -> LaneMask {
        self.0.kept_lanes(isa, block, mask)
    }
    #[inline(always)]
    fn one_plane<I: Isa>(&self, isa: I, plane: u32) -> impl Planes<I> {
        self.0.one_plane(isa, plane)
    }
    #[inline(always)]
    fn prefetch(&self, block: &BoxBlock, mask: PlaneMask) {
        self.0.prefetch(block, mask);
    }
    #[inline(always)]
    fn sorted_lanes<I: Isa>(&self, isa: I, block: &BoxBlock, mask: PlaneMask) -> Sorted<I> {
        let (kept, words) = self.0.sorted_lanes(isa, block, mask);
        let inside = isa.equal(words, 0);
        let mut open = [mask; LANES];
        let lanes = open.iter_mut().enumerate();
        let inside = lanes.filter(|(lane, _)| inside >> lane & 1 == 1);
        inside.for_each(|(_, open)| *open = 0);
        (kept, isa.words(&open))
    }
}

/// Rule: axes beyond the six planes, from the volume's own box and silhouettes.
///
/// The exact test adds them. They cost test time and save the drawing of false positives.
pub fn six_planes() -> anyhow::Result<EnteredRule> {
    Ok(EnteredRule::concluded(None, |advice, _| {
        let check = &advice.test.axes;
        let sides = (check.as_ref()).map(|check| [&check.kept, &check.left_out]);
        let more = sides.and_then(|[exact, six]| {
            Some(six.false_positives_per_query? - exact.false_positives_per_query?)
        });
        let Some(([exact, six], more)) = sides.zip(more) else {
            return Finding::none("no camera was judged");
        };
        let draw_ns = advice.draw_ns;
        let reason = format!("with {} ns/item drawn", significant(draw_ns));
        let finding = Finding {
            check: check.clone(),
            ..Finding::new(more * draw_ns, exact.ns - six.ns, reason)
        };
        with_choice(finding, &advice.test)
    }))
}

/// Decides as the chosen test, which has these axes or has not.
fn with_choice(mut finding: Finding, choice: &TestChoice) -> Finding {
    let Some(taken) = choice.name else {
        return finding;
    };
    let with_axes = |name: &str| name == CullingTest::Exact.name();
    let kept = with_axes(taken);
    // The chosen side by its chosen test, the other by its best.
    let total = |with: bool| {
        let rows = choice.rows.iter().filter(|row| with_axes(row.test) == with);
        let rows = rows.filter(|row| choice.structure.as_ref() == Some(&row.structure));
        let rows = rows.filter(|row| with != kept || row.test == taken);
        rows.filter_map(|row| row.total_ns).min_by(f64::total_cmp)
    };
    finding.cost_ns = total(true).zip(total(false)).map(<[f64; 2]>::from);
    finding.leaves_out = Some(!kept);
    finding.is_tie = Some(choice.ties.iter().any(|name| with_axes(name) != kept));
    finding
}

/// Rule: the plane test in f64.
///
/// f32 planes, moved outward for their rounding, miss nothing either, and their margin is usually
/// far too thin to contain an item.
pub fn f64_kernel(tasks: &mut TaskList) -> anyhow::Result<EnteredRule> {
    let case = tasks.case;
    let planes = PlaneOptions::default();
    let in_f64 = Culling::new(CullingTest::SixPlane, Arithmetic::F64, planes);
    let kept = tasks.index(&*case.index, case.views_by(&in_f64)?);
    let sides = TaskPair::new(&case.spec.label, kept, BASE);
    let margin = case.margin(&case.workload.around);
    Ok(EnteredRule::new(sides, of_margin(margin)))
}

fn of_margin(margin: f64) -> Finding {
    let reason = format!("f32 errs by {margin:.0e} of depth");
    Finding::new(margin, TOLERANCE, reason)
}

/// Rule: a scene origin of its own.
///
/// Near the world's origin f32 has enough digits without. One side has the scene about its centre,
/// the other about the world's origin.
pub fn rebasing(tasks: &mut TaskList) -> anyhow::Result<EnteredRule> {
    let case = tasks.case;
    let scene = case.workload.scene;
    if case.workload.around != scene.surroundings() {
        bail!("a motion that leaves the scene");
    }
    let is_moved = scene.origin != DVec3::ZERO;
    let bounds = scene.world_bounds();
    let centre = bounds.min / 2.0 + bounds.max / 2.0;
    let elsewhere = if is_moved { DVec3::ZERO } else { centre };
    let other = subset(scene, elsewhere, scene.items.len())?;
    let workload = Workload::new(&other, case.path, &Culling::default());
    let views = workload?.views;
    let (at_zero, moved) = match is_moved {
        true => (&other, scene),
        false => (scene, &other),
    };
    let [margin, better] = [at_zero, moved].map(|scene| case.margin(&scene.surroundings()));
    if margin > TOLERANCE && better > margin / 2.0 {
        bail!("about no origin are coordinates much smaller");
    }
    let there = tasks.index(case.spec.build(&other.items)?, views);
    let [kept, left_out] = [[there, BASE], [BASE, there]][usize::from(is_moved)];
    let sides = TaskPair::new(&case.spec.label, kept, left_out);
    Ok(EnteredRule::new(sides, of_margin(margin)))
}

#[cfg(test)]
mod tests {
    use super::super::rule::some_rule;
    use super::super::tasks::{Basis, Decision};
    use super::*;
    use crate::geometry::Plane;
    use glam::Vec3;

    #[test]
    fn planes_that_cut_the_scene_stay() {
        let planes = [
            // Cuts the bounds; contains them; just contains them; excludes them.
            Plane::new(Vec3::X, 0.0),
            Plane::new(Vec3::Y, 5.0),
            Plane::new(Vec3::Z, 1.0),
            Plane::new(-Vec3::Z, -2.0),
        ];
        let volume = ConvexVolume::from_planes(&planes).unwrap();
        let bounds = Aabb::new(Vec3::splat(-1.0), Vec3::splat(1.0));
        let left = without_needless(&volume, &bounds);
        assert_eq!(left.planes(), [planes[0], planes[3]]);
        let none = without_needless(&ConvexVolume::from_planes(&planes[1..3]).unwrap(), &bounds);
        assert!(none.planes().is_empty() && none.sees(&bounds));
    }

    #[test]
    fn without_masks_the_answer_is_the_same_and_costs_more_tests() {
        let corner = |i: u32| Vec3::new((i % 40) as f32, (i / 40 % 40) as f32, (i / 1600) as f32);
        let items: Vec<Aabb> = (0..16_000)
            .map(|i| Aabb::new(corner(i), corner(i) + 0.5))
            .collect();
        let planes = [Vec3::X, Vec3::Y, -Vec3::X, -Vec3::Y].map(|normal| {
            Plane::new(
                normal,
                if normal.max_element() > 0.0 {
                    -10.2
                } else {
                    30.7
                },
            )
        });
        let volume = ConvexVolume::from_planes(&planes).unwrap();
        let tree = Wide::build(&Input::new(&items), &Default::default()).unwrap();
        let ask = |masked: bool| {
            let (mut out, cost) = match masked {
                true => tree.counted(&volume),
                false => tree.counted(&Unmasked(&volume)),
            };
            out.sort_unstable();
            let mut timed = Vec::new();
            match masked {
                true => see(Kernel::best(), &tree, &volume, &mut timed),
                false => see(Kernel::best(), &tree, &Unmasked(&volume), &mut timed),
            }
            timed.sort_unstable();
            assert_eq!(timed, out);
            (out, cost.planes_tested, cost.subtrees_accepted)
        };
        let ((with, fewer, accepted), (without, all, also)) = (ask(true), ask(false));
        assert!(!with.is_empty() && with == without);
        assert_eq!(accepted, also, "what is inside is accepted either way");
        assert!(fewer * 3 < all * 2, "{fewer} of {all}");
    }

    #[test]
    fn the_test_taken_decides_about_the_axes() {
        let tests = ["six-plane", "six-box", "exact", "sphere"];
        for predicted in [true, false] {
            for (taken, ties, decision, is_tie) in [
                (tests[0], vec![], Decision::LeaveOut, false),
                (tests[3], vec![], Decision::LeaveOut, false),
                (tests[1], vec![], Decision::LeaveOut, false),
                (tests[2], vec![], Decision::Keep, false),
                (tests[2], vec![tests[1]], Decision::Keep, true),
                (tests[0], vec![tests[2]], Decision::LeaveOut, true),
                (tests[1], vec![tests[3]], Decision::LeaveOut, false),
                (tests[0], vec!["exact on bvh"], Decision::LeaveOut, false),
            ] {
                let statistic = if predicted { 0.5 } else { 2.0 };
                let finding = Finding::new(statistic, 1.0, "");
                let mut choice = TestChoice {
                    name: Some(taken),
                    ties: ties.into_iter().map(str::to_owned).collect(),
                    structure: Some("wide".to_owned()),
                    rows: Vec::new(),
                    costs: None,
                    axes: None,
                };
                let settled = |choice: &TestChoice| {
                    some_rule(Basis::Rule).omission(with_choice(finding.clone(), choice), None)
                };
                let omission = settled(&choice);
                let found = (omission.decision, omission.is_tie);
                assert_eq!(found, (decision, is_tie), "{taken} {:?}", choice.ties);
                // Without a chosen test the rule decides.
                choice.name = None;
                let leaves_out = settled(&choice).decision == Decision::LeaveOut;
                assert_eq!(leaves_out, predicted);
            }
        }
    }
}
