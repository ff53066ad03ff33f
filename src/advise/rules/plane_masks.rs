//! Plane tests below a node that a plane contains: the mask of open planes that
//! a node passes to its children leaves them out. The side without the rule is a view
//! whose nodes never close a plane (unless they close all of them).

use std::rc::Rc;

use super::super::rule::{Draft, Finding, Unfit};
use super::super::trials::{Sides, Trials};
use crate::geometry::{Aabb, BoxBlock, ConvexVolume, LANES, LaneMask, PlaneMask};
use crate::index::{FrustumQuery, Input, Query, RegionIndex, Wide};
use crate::kernel::{Isa, Kernel};
use crate::query::{ItemId, NoRecorder, Planes, Predicate, QueryCost, QueryVolume};

/// Share of the plane tests that has to go: a small tree saves a few percent,
/// and carrying masks is not free.
const THRESHOLD: f64 = 0.1;
/// Cameras whose plane tests are counted.
const COUNTED: usize = 64;

pub(super) fn prepare(trials: &mut Trials) -> Result<Draft, Unfit> {
    let case = trials.case;
    let kernel = case.spec.execution.kernel;
    let tree = Rc::new(Wide::build(
        &Input::new(&case.scene().items),
        &Default::default(),
    )?);
    let volumes: Rc<[ConvexVolume]> = case.volumes().cloned().collect();
    let step = volumes.len().div_ceil(COUNTED).max(1);
    let (mut with, mut without) = (QueryCost::default(), QueryCost::default());
    for volume in volumes.iter().step_by(step) {
        with += tree.counted(volume).1;
        without += tree.counted(&Unmasked(volume)).1;
    }
    let [fewer, all] = [with, without].map(|cost| cost.planes_tested);
    let mut finding = Finding {
        reason: "no plane is ever tested".to_owned(),
        ..Finding::default()
    };
    if all > 0 {
        let reason = format!("{fewer} plane tests with masks, {all} without");
        let saved = 1.0 - fewer as f64 / all as f64;
        finding = Finding::new(saved, THRESHOLD, reason)
            .noted(format!("save {:.0} % of plane tests", saved * 100.0));
    }
    let (other, views) = (tree.clone(), volumes.clone());
    let kept = trials.judged(move |n, out| see(kernel, &other, &Unmasked(&views[n]), out));
    let left_out = trials.judged(move |n, out| see(kernel, &tree, &volumes[n], out));
    let sides = Sides::same(Wide::INFO.name, kept, left_out);
    Ok(Draft::new(vec![sides], finding))
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

/// The six-plane view with every plane open wherever one is.
struct Unmasked<'a>(&'a ConvexVolume);

impl Predicate for Unmasked<'_> {
    #[inline(always)]
    fn mask(&self) -> PlaneMask {
        self.0.mask()
    }
    #[inline(always)]
    fn excludes(&self, plane: u32, bounds: &Aabb) -> bool {
        self.0.excludes(plane, bounds)
    }
    #[inline(always)]
    fn contains(&self, plane: u32, bounds: &Aabb) -> bool {
        self.0.contains(plane, bounds)
    }
}

impl QueryVolume for Unmasked<'_> {
    #[inline(always)]
    fn kept_lanes<I: Isa>(&self, isa: I, block: &BoxBlock, mask: PlaneMask) -> LaneMask {
        self.0.kept_lanes(isa, block, mask)
    }
    #[inline(always)]
    fn kept_of_four<I: Isa>(
        &self,
        isa: I,
        blocks: &[BoxBlock; 4],
        mask: PlaneMask,
    ) -> [LaneMask; 4] {
        self.0.kept_of_four(isa, blocks, mask)
    }
    #[inline(always)]
    fn one_plane<I: Isa>(&self, isa: I, plane: u32) -> impl Planes<I> {
        self.0.one_plane(isa, plane)
    }
    #[inline(always)]
    fn all_planes<I: Isa>(&self, isa: I) -> Option<impl Planes<I>> {
        self.0.all_planes(isa)
    }
    #[inline(always)]
    fn prefetch(&self, block: &BoxBlock, mask: PlaneMask) {
        self.0.prefetch(block, mask);
    }
    #[inline(always)]
    fn sorted_lanes<I: Isa>(
        &self,
        isa: I,
        block: &BoxBlock,
        mask: PlaneMask,
    ) -> (LaneMask, I::Words) {
        let (kept, words) = self.0.sorted_lanes(isa, block, mask);
        let inside = isa.zeros(words);
        let mut open = [mask; LANES];
        for (lane, open) in open.iter_mut().enumerate() {
            if inside >> lane & 1 == 1 {
                *open = 0;
            }
        }
        (kept, isa.words(&open))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Plane;
    use glam::Vec3;

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
}
