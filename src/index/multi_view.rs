//! Several volumes asked of the wide tree in one pass. Where two or more of
//! them are undecided about an inner block, it is looked at once for all, and
//! planes of one normal share their arithmetic; where only one is left, that one
//! goes on alone, and every one tests its leaves alone, as in a query by itself
//! (`wide`).

use std::borrow::Cow;
use std::cell::Cell;
use std::ops::{ControlFlow, Range};

use glam::Vec3;

use super::TreeOrder;
use super::by_plane::ByPlane;
use super::frontier::{AHEAD, Frontier, Merger, first_ahead};
use super::pass::{Layer, Pass};
use super::wide::{Scratch, Wide};
use crate::geometry::{ConvexVolume, LANES, LaneMask, MAX_PLANES, Plane, PlaneMask, Upper};
use crate::kernel::{Isa, Kernel, Work};
use crate::query::{AnyView, ItemId, NoRecorder, Shell, Sink};

/// Some of the volumes of a pass, one bit each.
type ViewMask = u32;

/// Volumes of one pass.
const MOST_VIEWS: usize = ViewMask::BITS as usize;

/// Volumes whose planes are numbered alike: planes of the same normal have the
/// same number in all of them. Zeros of either sign are the same: neither they
/// nor the corner they choose change a verdict.
struct Bundle<'v> {
    normals: [(Vec3, Upper); MAX_PLANES],
    /// As they were given, but for the numbers and planes that decide nothing.
    volumes: Vec<Cow<'v, ConvexVolume>>,
}

impl<'v> Bundle<'v> {
    /// `None` if there are more normals than a mask has bits, or more volumes.
    fn of(given: impl ExactSizeIterator<Item = &'v ConvexVolume>) -> Option<Self> {
        if given.len() > MOST_VIEWS {
            return None;
        }
        let mut normals = [(Vec3::ZERO, [true; 3]); MAX_PLANES];
        let mut known = 0;
        let mut volumes = Vec::with_capacity(given.len());
        for volume in given {
            // Of each plane, its number.
            let mut numbers = [0; MAX_PLANES];
            let (mut taken, mut as_given): (PlaneMask, bool) = (0, true);
            for (place, plane) in volume.planes().iter().enumerate() {
                if plane.is_trivial() {
                    as_given = false;
                    continue;
                }
                let same =
                    |number: &usize| taken >> number & 1 == 0 && normals[*number].0 == plane.normal;
                let number = (0..known).find(same).unwrap_or(known);
                if number == MAX_PLANES {
                    return None;
                }
                if number == known {
                    normals[known] = (plane.normal, plane.upper());
                    known += 1;
                }
                taken |= 1 << number;
                as_given &= number == place;
                numbers[place] = number;
            }
            // Eyes and cascades have their planes in the same order already.
            volumes.push(match as_given {
                true => Cow::Borrowed(volume),
                false => Cow::Owned(renumbered(volume, &numbers, taken)?),
            });
        }
        Some(Bundle { normals, volumes })
    }
}

/// The volume with its planes at those places; between them, planes that decide
/// nothing.
fn renumbered(volume: &ConvexVolume, numbers: &[usize], taken: PlaneMask) -> Option<ConvexVolume> {
    let mut planes = [Plane::new(Vec3::ZERO, 0.0); MAX_PLANES];
    let numbered = volume.planes().iter().zip(numbers);
    for (plane, &number) in numbered.filter(|(plane, _)| !plane.is_trivial()) {
        planes[number] = *plane;
    }
    let used = (PlaneMask::BITS - taken.leading_zeros()) as usize;
    ConvexVolume::from_planes(&planes[..used]).ok()
}

/// Blocks of one level about which several volumes are undecided.
#[derive(Default)]
struct Shared {
    /// With the planes that any of them has open.
    frontier: Frontier,
    views: Frontier,
}

/// What is kept between passes: frontiers of now and of the level below. Shared
/// ones are of inner blocks.
#[derive(Default)]
struct Walks {
    shared: [Shared; 2],
    /// Of each volume, blocks about which no other is undecided.
    own: Vec<[Frontier; 2]>,
    /// Of each volume, items inside that may still go on.
    runs: Vec<Merger>,
    by_plane: ByPlane,
}

thread_local! {
    static WALKS: Cell<Option<Box<Walks>>> = const { Cell::new(None) };
}

/// The bits that are set, lowest first.
#[inline(always)]
fn bits(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        if mask == 0 {
            return None;
        }
        let bit = mask.trailing_zeros();
        mask &= mask - 1;
        Some(bit as usize % 32)
    })
}

/// A pass on its way: who is asked, who still listens.
struct Together<'p, 'a, I, S> {
    tree: &'p Wide,
    isa: I,
    bundle: &'p Bundle<'p>,
    sinks: &'p mut [(&'a ConvexVolume, &'a mut S)],
    listening: ViewMask,
}

impl<I: Isa, S: Sink> Together<'_, '_, I, S> {
    #[inline(always)]
    fn hand_over(&mut self, view: usize, places: Range<usize>) {
        if !places.is_empty() && self.listening >> view & 1 == 1 {
            let (_, sink) = &mut self.sinks[view];
            let flow = sink.accept_places(self.isa, self.tree.ids(), places);
            self.note(view, flow);
        }
    }

    /// A sink that breaks off is not called again.
    #[inline(always)]
    fn note(&mut self, view: usize, flow: ControlFlow<()>) {
        if flow.is_break() {
            self.listening &= !(1 << view);
        }
    }

    /// One level: what several volumes share, then what each has to itself.
    /// Leaves are nobody's to share: each volume tests them plane by plane.
    #[inline(always)]
    fn sort_level(&mut self, layer: &Layer, walks: &mut Walks, now: usize, above_leaves: bool) {
        let isa = self.isa;
        let Walks {
            shared, own, runs, ..
        } = walks;
        let [even, odd] = shared;
        let (here, below) = if now == 0 { (even, odd) } else { (odd, even) };
        let (places, masks) = here.frontier.entries();
        let views = here.views.entries().1;
        below.frontier.clear(places.len());
        below.views.clear(places.len());
        for frontiers in &mut own[..self.sinks.len()] {
            let alone = frontiers[now].entries().0.len();
            frontiers[1 - now].clear(places.len() + alone);
        }
        let zero = isa.splat(0.0);
        let (mut far, mut near) = ([zero; MAX_PLANES], [zero; MAX_PLANES]);
        for i in first_ahead(layer.far) {
            layer.fetch(places, i);
        }
        for (i, (&at, &mask)) in places.iter().zip(masks).enumerate() {
            layer.fetch(places, i + AHEAD);
            let (block, lanes) = layer.block(at as usize);
            for plane in bits(mask) {
                let (normal, upper) = self.bundle.normals[plane];
                far[plane] = block.farthest(isa, normal, upper);
                near[plane] = block.nearest(isa, normal, upper);
            }
            let nodes = isa.counting(at * LANES as u32);
            let (mut open, mut asking) = (isa.splat_word(0), isa.splat_word(0));
            // Lanes about which one is undecided, and more than one.
            let (mut once, mut twice) = (0, 0);
            let mut undecided_by = [0; MOST_VIEWS];
            let views = views[i] & self.listening;
            for view in bits(views) {
                let volume = &self.bundle.volumes[view];
                let mask = mask & volume.mask();
                let mut lowest = isa.splat(f32::INFINITY);
                let mut straddled: LaneMask = 0;
                let mut straddling = [0; MAX_PLANES];
                for plane in bits(mask) {
                    let d = isa.splat(volume.plane_of_bit(plane as u32).d);
                    lowest = isa.lower(isa.add(far[plane], d), lowest);
                    straddling[plane] = !isa.at_most(zero, isa.add(near[plane], d));
                    straddled |= straddling[plane];
                }
                let kept = !isa.below_zero(lowest) & lanes;
                let undecided = kept & straddled;
                if above_leaves {
                    open = isa.splat_word(0);
                }
                for bit in bits(mask) {
                    let lanes = straddling[bit] & undecided;
                    open = isa.with(open, lanes, 1 << bit);
                }
                if above_leaves {
                    own[view][1 - now].push(isa, nodes, open, undecided);
                } else {
                    asking = isa.with(asking, undecided, 1 << view);
                    undecided_by[view] = undecided;
                    twice |= once & undecided;
                    once |= undecided;
                }
                let inside = kept & !straddled;
                for places in layer.places_of(at as usize, inside, self.tree.ids().len()) {
                    if let Some(ended) = runs[view].join(places) {
                        self.hand_over(view, ended);
                    }
                }
            }
            below.frontier.push(isa, nodes, open, twice);
            below.views.push(isa, nodes, asking, twice);
            let alone = once & !twice;
            if alone != 0 {
                for view in bits(views) {
                    own[view][1 - now].push(isa, nodes, open, undecided_by[view] & alone);
                }
            }
        }
        for (view, (frontiers, run)) in own.iter_mut().zip(runs).enumerate() {
            let [even, odd] = frontiers;
            let (here, below) = if now == 0 { (even, odd) } else { (odd, even) };
            if self.listening >> view & 1 == 1 {
                let mut pass = Pass {
                    tree: self.tree,
                    isa,
                    view: self.bundle.volumes[view].as_ref(),
                    sink: &mut *self.sinks[view].1,
                    recorder: &mut NoRecorder,
                };
                let mut flow = pass.sort_level(layer, here, below, run);
                if flow.is_continue() {
                    flow = pass.hand_over(run.take());
                }
                self.note(view, flow);
            }
        }
    }

    #[inline(always)]
    fn test_leaves(&mut self, leaves: &Layer, walks: &mut Walks, now: usize) {
        let isa = self.isa;
        for view in bits(self.listening) {
            let mut pass = Pass {
                tree: self.tree,
                isa,
                view: self.bundle.volumes[view].as_ref(),
                sink: &mut *self.sinks[view].1,
                recorder: &mut NoRecorder,
            };
            let flow = pass.test_leaves(leaves, &walks.own[view][now], &mut walks.by_plane);
            self.note(view, flow);
        }
    }

    #[inline(always)]
    fn search(&mut self, walks: &mut Walks) {
        let count = self.sinks.len();
        if walks.own.len() < count {
            walks.own.resize_with(count, Default::default);
            walks.runs.resize(count, Merger::default());
        }
        for (frontiers, run) in walks.own.iter_mut().zip(&mut walks.runs) {
            frontiers.iter_mut().for_each(|frontier| frontier.clear(0));
            run.take();
        }
        let isa = self.isa;
        // One volume has nobody to share with, and the root may be a leaf.
        let shares = count > 1 && self.tree.depth() > 1;
        let (mut open, mut asking) = (0, 0);
        for view in 0..count {
            let mask = self.bundle.volumes[view].mask();
            if mask == 0 {
                self.hand_over(view, 0..self.tree.ids().len());
                self.listening &= !(1 << view);
            } else if shares {
                open |= mask;
                asking |= 1 << view;
            } else {
                walks.own[view][0].start(isa, mask);
            }
        }
        walks.shared[0].frontier.clear(0);
        walks.shared[0].views.clear(0);
        if shares {
            walks.shared[0].frontier.start(isa, open);
            walks.shared[0].views.start(isa, asking);
        }
        let mut now = 0;
        for level in (1..self.tree.depth()).rev() {
            self.sort_level(&self.tree.layer(level), walks, now, level == 1);
            now = 1 - now;
        }
        self.test_leaves(&self.tree.layer(0), walks, now);
    }
}

/// Hands everything to all sinks that still listen.
struct All<'s, 'a, S> {
    sinks: &'s mut [(&'a ConvexVolume, &'a mut S)],
    listening: ViewMask,
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
}

impl Wide {
    /// Volumes that are nearly the same: one way down for all of them, and each
    /// tests the leaves that are left.
    #[inline(always)]
    fn visible_alike<'a, I: Isa, S: Sink>(
        &self,
        isa: I,
        shell: &Shell,
        asked: &mut [(&'a ConvexVolume, &'a mut S)],
    ) {
        let mut scratch = Scratch::taken();
        scratch.start(isa, shell);
        let listening = ViewMask::MAX >> (MOST_VIEWS - asked.len());
        let mut all = All {
            sinks: &mut *asked,
            listening,
        };
        let top = self.depth() - 1;
        // It ends early only if nobody listens any more.
        let _ = self.descend(isa, shell, 0..top, &mut all, &mut NoRecorder, &mut scratch);
        for view in bits(all.listening) {
            let (volume, sink) = &mut asked[view];
            let _ = self.search_leaves(isa, *volume, *sink, &mut NoRecorder, &mut scratch);
        }
        scratch.give_back();
    }

    /// What several volumes see, in one pass: exactly the sets of as many
    /// queries, each to its own sink. A sink's order is deterministic, but not
    /// that of a query by itself. One that breaks off ends its own query only.
    ///
    /// False, with nothing done, for more than 32 volumes or more than 32
    /// different normals.
    #[inline(always)]
    pub fn visible_together<'a, I: Isa, S: Sink>(
        &self,
        isa: I,
        asked: &mut [(&'a ConvexVolume, &'a mut S)],
    ) -> bool {
        if self.depth() == 0 || asked.is_empty() {
            return true;
        }
        if asked.len() <= MOST_VIEWS
            && let Some(shell) = Shell::about(asked.iter().map(|(volume, _)| *volume))
        {
            self.visible_alike(isa, &shell, asked);
            return true;
        }
        let Some(bundle) = Bundle::of(asked.iter().map(|(volume, _)| *volume)) else {
            return false;
        };
        let mut walks = WALKS.take().unwrap_or_default();
        let mut pass = Together {
            tree: self,
            isa,
            bundle: &bundle,
            listening: ViewMask::MAX >> (MOST_VIEWS - asked.len()),
            sinks: asked,
        };
        pass.search(&mut walks);
        WALKS.set(Some(walks));
        true
    }
}

/// The pass as the chosen kernel does it.
struct See<'t, 'a> {
    tree: &'t Wide,
    asked: &'t mut [(&'a ConvexVolume, &'a mut Vec<ItemId>)],
}

impl Work for See<'_, '_> {
    type Output = bool;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> bool {
        self.tree.visible_together(isa, self.asked)
    }
}

impl Wide {
    /// [`Wide::visible_together`] by the chosen kernel: appends to `out[i]` what
    /// `views[i]` sees. An option, not what [`DynIndex::see_many`] does: a pass
    /// has its own costs, and only pairs of eyes have so much in common that it
    /// is often the quicker one (docs/MULTI_VIEW.md has the figures).
    ///
    /// False, with nothing done, also if a view is not a [`ConvexVolume`].
    ///
    /// # Panics
    /// If there is not one list a view.
    ///
    /// [`DynIndex::see_many`]: super::DynIndex::see_many
    pub fn see_in_one_pass(&self, views: &[AnyView<'_>], out: &mut [Vec<ItemId>]) -> bool {
        assert_eq!(views.len(), out.len(), "one list a view");
        let mut asked = Vec::with_capacity(views.len());
        for (view, out) in views.iter().zip(out) {
            let AnyView::Volume(volume) = view else {
                return false;
            };
            asked.push((*volume, out));
        }
        Kernel::chosen().run(See {
            tree: self,
            asked: &mut asked,
        })
    }
}
