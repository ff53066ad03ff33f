//! The coupling in two passes: all occluders first, then all candidates.

use std::fmt;

use super::buffer::{CullStats, OcclusionBuffer, draw};
use super::rect::{Candidate, Rects};
use super::scene::OccluderScene;
use super::view::View;
use crate::geometry::BoxBlock;
use crate::kernel::{Isa, Kernel, LANES, Work};
use crate::query::ItemId;

/// Which candidates are drawn as occluders.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum OccluderChoice {
    /// All of them.
    All,
    /// Those of least depth, up to a number.
    Nearest(usize),
    /// Those whose rectangles cover the most pixels, up to a number.
    Largest(usize),
}

impl OccluderChoice {
    /// Parses `all`, `nearest:64`, `largest:64`.
    pub fn parse(text: &str) -> Option<OccluderChoice> {
        let count = |text: &str| text.parse().ok().filter(|count| *count > 0);
        match text.split_once(':') {
            None if text == "all" => Some(OccluderChoice::All),
            Some(("nearest", number)) => count(number).map(OccluderChoice::Nearest),
            Some(("largest", number)) => count(number).map(OccluderChoice::Largest),
            _ => None,
        }
    }
}

impl fmt::Display for OccluderChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            OccluderChoice::All => f.write_str("all"),
            OccluderChoice::Nearest(count) => write!(f, "nearest:{count}"),
            OccluderChoice::Largest(count) => write!(f, "largest:{count}"),
        }
    }
}

/// Two passes over candidates, with memory that is kept from view to view.
#[derive(Clone, Debug)]
pub struct TwoPass<B> {
    buffer: B,
    choice: OccluderChoice,
    kernel: Kernel,
    ids: Vec<ItemId>,
    candidates: Vec<Candidate>,
    order: Vec<u32>,
}

impl<B: OcclusionBuffer> TwoPass<B> {
    /// With a buffer, on an instruction set.
    pub fn new(buffer: B, choice: OccluderChoice, kernel: Kernel) -> TwoPass<B> {
        TwoPass {
            buffer,
            choice,
            kernel,
            ids: Vec::new(),
            candidates: Vec::new(),
            order: Vec::new(),
        }
    }

    /// Appends those candidates that are not hidden, in their order. The candidates
    /// are items in the view, each once.
    pub fn cull(
        &mut self,
        scene: &OccluderScene,
        view: &View,
        candidates: &[ItemId],
        out: &mut Vec<ItemId>,
    ) -> CullStats {
        self.kernel.run(Culled {
            state: self,
            scene,
            view,
            ids: candidates,
            out,
        })
    }
}

struct Culled<'a, B> {
    state: &'a mut TwoPass<B>,
    scene: &'a OccluderScene,
    view: &'a View<'a>,
    ids: &'a [ItemId],
    out: &'a mut Vec<ItemId>,
}

impl<B: OcclusionBuffer> Work for Culled<'_, B> {
    type Output = CullStats;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> CullStats {
        let (state, scene, view) = (self.state, self.scene, self.view);
        let mut stats = CullStats::default();
        state.ids.clear();
        state.ids.extend_from_slice(self.ids);
        state.ids.extend(scene.blocks());
        project_all(isa, scene, view, &state.ids, &mut state.candidates);
        stats.boxes = self.ids.len();
        choose(
            scene,
            view,
            &state.candidates,
            state.choice,
            &mut state.order,
        );
        state.buffer.clear();
        for &index in &state.order {
            let candidate = &state.candidates[index as usize];
            stats.drawn += draw(isa, &mut state.buffer, scene, view, candidate);
        }
        state.buffer.finish();
        let before = self.out.len();
        for candidate in &state.candidates {
            let Some(item) = scene.item(candidate.position as usize) else {
                continue;
            };
            if candidate.near || !state.buffer.hides(isa, &candidate.rect) {
                self.out.push(item);
            }
        }
        stats.kept = self.out.len() - before;
        stats
    }
}

/// The candidates that some ray of the image may meet, in their order, projected
/// sixteen at a time.
#[inline(always)]
fn project_all<I: Isa>(
    isa: I,
    scene: &OccluderScene,
    view: &View,
    ids: &[ItemId],
    candidates: &mut Vec<Candidate>,
) {
    candidates.clear();
    let mut rects = Rects::NONE;
    for chunk in ids.chunks(LANES) {
        let mut block = BoxBlock::EMPTY;
        for (lane, &id) in chunk.iter().enumerate() {
            block.set(lane, &scene.outer(scene.position(id)));
        }
        rects.project(isa, &block, view);
        let seen = rects.seen;
        for (lane, &id) in chunk.iter().enumerate() {
            if seen >> lane & 1 == 1 {
                candidates.push(rects.candidate(lane, scene.position(id)));
            }
        }
    }
}

/// The indices of the occluders, the nearest first. The same for every buffer and
/// instruction set, and compiled once.
fn choose(
    scene: &OccluderScene,
    view: &View,
    candidates: &[Candidate],
    choice: OccluderChoice,
    order: &mut Vec<u32>,
) {
    order.clear();
    let allowed = |&index: &u32| {
        let position = candidates[index as usize].position as usize;
        !view.entered_before_near(&scene.outer(position))
    };
    order.extend((0..candidates.len() as u32).filter(allowed));
    let depth = |index: u32| candidates[index as usize].depth;
    let nearer = |&a: &u32, &b: &u32| depth(a).total_cmp(&depth(b)).then(a.cmp(&b));
    let area = |index: u32| match &candidates[index as usize] {
        candidate if candidate.near => u32::MAX,
        candidate => candidate.rect.area(),
    };
    match choice {
        OccluderChoice::All => {}
        OccluderChoice::Nearest(count) => keep_first(order, count, nearer),
        OccluderChoice::Largest(count) => {
            keep_first(order, count, |&a, &b| area(b).cmp(&area(a)).then(a.cmp(&b)));
        }
    }
    order.sort_unstable_by(nearer);
}

fn keep_first(
    order: &mut Vec<u32>,
    count: usize,
    compare: impl FnMut(&u32, &u32) -> std::cmp::Ordering,
) {
    if count < order.len() {
        order.select_nth_unstable_by(count, compare);
        order.truncate(count);
    }
}
