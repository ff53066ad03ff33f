//! Several volumes asked of the wide tree at once. Neighbours in the list that are
//! nearly the same, such as two eyes, go down the inner tree once, as the shell
//! about them, and each tests the leaves that are left; every other volume is a
//! query by itself, which is quicker than anything shared (docs/MULTI_VIEW.md).

use std::ops::{ControlFlow, Range};

use super::wide::{Scratch, Wide};
use super::{FrustumQuery, erased};
use crate::geometry::ConvexVolume;
use crate::kernel::{Isa, Kernel, LANES, LaneMask, Work};
use crate::query::{AnyView, ItemId, NoRecorder, Shell, Sink, Tests};

/// Volumes of one shell: bits of a mask.
const MOST_ALIKE: usize = u32::BITS as usize;

/// Hands everything to all sinks that still listen.
struct All<'s, 'a, S> {
    sinks: &'s mut [(&'a ConvexVolume, &'a mut S)],
    /// One bit a sink.
    listening: u32,
}

/// The bits that are set, lowest first.
#[inline(always)]
fn bits(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (mask != 0).then(|| mask.trailing_zeros() as usize);
        mask &= mask.wrapping_sub(1);
        bit
    })
}

impl<S: Sink> All<'_, '_, S> {
    /// A sink that breaks off is not called again; the last one ends it all.
    #[inline(always)]
    fn note(&mut self, view: usize, flow: ControlFlow<()>) {
        if flow.is_break() {
            self.listening &= !(1 << view);
        }
    }

    #[inline(always)]
    fn flow(&self) -> ControlFlow<()> {
        match self.listening {
            0 => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        }
    }
}

impl<S: Sink> Sink for All<'_, '_, S> {
    #[inline(always)]
    fn accept(&mut self, ids: &[ItemId]) -> ControlFlow<()> {
        for view in bits(self.listening) {
            let flow = self.sinks[view].1.accept(ids);
            self.note(view, flow);
        }
        self.flow()
    }
    #[inline(always)]
    fn accept_places<I: Isa>(
        &mut self,
        isa: I,
        ids: &[ItemId],
        places: Range<usize>,
    ) -> ControlFlow<()> {
        for view in bits(self.listening) {
            let flow = self.sinks[view].1.accept_places(isa, ids, places.clone());
            self.note(view, flow);
        }
        self.flow()
    }
    /// What is found in some blocks is handed to each sink in turn.
    #[inline(always)]
    fn accept_tested<I: Isa, T: Tests<I>>(
        &mut self,
        isa: I,
        ids: &[[ItemId; LANES]],
        mut tests: T,
    ) -> ControlFlow<()> {
        let mut found = [(0, 0); FOUND_TOGETHER];
        let count = tests.count();
        for first in (0..count).step_by(FOUND_TOGETHER) {
            let found = &mut found[..FOUND_TOGETHER.min(count - first)];
            for (i, place) in found.iter_mut().enumerate() {
                *place = tests.test(isa, first + i);
            }
            for view in bits(self.listening) {
                let flow = self.sinks[view].1.accept_tested(isa, ids, Found(found));
                self.note(view, flow);
            }
            self.flow()?;
        }
        ControlFlow::Continue(())
    }
}

/// Blocks that are tested before the first sink gets any of them.
const FOUND_TOGETHER: usize = 128;

/// Blocks of which it is known what they hold.
struct Found<'a>(&'a [(usize, LaneMask)]);

impl<I: Isa> Tests<I> for Found<'_> {
    const SPARSE: bool = false;

    #[inline(always)]
    fn count(&self) -> usize {
        self.0.len()
    }
    #[inline(always)]
    fn test(&mut self, _: I, i: usize) -> (usize, LaneMask) {
        self.0[i]
    }
}

/// How many volumes from the first one on are nearly the same, and the shell
/// about them; there are `most` at most.
#[inline(always)]
fn alike<'v>(
    most: usize,
    volume: impl Fn(usize) -> Option<&'v ConvexVolume>,
) -> Option<(usize, Shell)> {
    let shells = (2..=most.min(MOST_ALIKE)).map_while(|count| {
        let volumes = (0..count).map_while(&volume);
        volume(count - 1)?;
        Some((count, Shell::about(volumes)?))
    });
    shells.last()
}

impl Wide {
    /// What several volumes see, each for its own sink: exactly the sets of as
    /// many queries, one volume or one group of neighbours that are nearly the
    /// same after the other. The order within a set is deterministic, but with a
    /// group it is not that of a query by itself. A sink that breaks off ends its
    /// own query only.
    #[inline(always)]
    pub fn visible_together<'a, I: Isa, S: Sink>(
        &self,
        isa: I,
        mut asked: &mut [(&'a ConvexVolume, &'a mut S)],
    ) {
        while !asked.is_empty() {
            let (count, shell) = match alike(asked.len(), |i| Some(asked[i].0)) {
                Some((count, shell)) => (count, Some(shell)),
                None => (1, None),
            };
            let (group, others) = asked.split_at_mut(count);
            asked = others;
            match (shell, &mut *group) {
                (Some(shell), group) => self.visible_alike(isa, &shell, group),
                (None, [(volume, sink), ..]) => {
                    // A sink that breaks off has all that it wants.
                    let _ = self.visible_by(isa, *volume, *sink, &mut NoRecorder);
                }
                (None, []) => {}
            }
        }
    }

    /// Volumes that are nearly the same: one way down for all of them, and each
    /// tests the leaves that are left.
    #[inline(always)]
    fn visible_alike<'a, I: Isa, S: Sink>(
        &self,
        isa: I,
        shell: &Shell,
        asked: &mut [(&'a ConvexVolume, &'a mut S)],
    ) {
        let Some(top) = self.depth().checked_sub(1) else {
            return;
        };
        let mut scratch = Scratch::taken();
        scratch.start(isa, shell);
        let mut all = All {
            listening: u32::MAX >> (MOST_ALIKE - asked.len()),
            sinks: &mut *asked,
        };
        // It ends early only if nobody listens any more.
        let _ = self.descend(isa, shell, 0..top, &mut all, &mut NoRecorder, &mut scratch);
        for view in bits(all.listening) {
            let (volume, sink) = &mut asked[view];
            let _ = self.search_leaves(isa, *volume, *sink, &mut NoRecorder, &mut scratch);
        }
        scratch.give_back();
    }
}

/// A group as a kernel answers it.
struct SeeAlike<'t, 'a> {
    tree: &'t Wide,
    shell: &'t Shell,
    asked: &'t mut [(&'a ConvexVolume, &'a mut Vec<ItemId>)],
}

impl Work for SeeAlike<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        self.tree.visible_alike(isa, self.shell, self.asked);
    }
}

/// As [`Wide::visible_together`], by a kernel and with views of all
/// kinds: those that share nothing by the very queries that they are alone.
pub(super) fn see_together(
    kernel: Kernel,
    tree: &Wide,
    views: &[AnyView<'_>],
    out: &mut [Vec<ItemId>],
) {
    let (mut views, mut out) = (views, out);
    while let ([view, ..], [list, ..]) = (views, &mut *out) {
        let volume = |i: usize| match views.get(i) {
            Some(AnyView::Volume(volume)) => Some(*volume),
            _ => None,
        };
        let mut count = 1;
        if let Some((alike, shell)) = alike(views.len(), volume) {
            count = alike;
            let mut asked: Vec<_> = (0..alike).map_while(volume).zip(out.iter_mut()).collect();
            kernel.run(SeeAlike {
                tree,
                shell: &shell,
                asked: &mut asked,
            });
        } else {
            erased::see(kernel, tree, *view, list);
        }
        views = &views[count..];
        out = &mut out[count..];
    }
}
