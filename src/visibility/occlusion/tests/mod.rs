//! The stage against rays, one by one and in f64.

mod by_rays;
mod lanes;
mod maps;
mod meshes;
mod none;
mod pairs;
mod rules;
mod slits;
mod streets;
mod traces;
mod windows;
mod worlds;

use super::{Interleaved, OccluderChoice, OcclusionBuffer, TwoPass, View};
use crate::kernel::Kernel;
use crate::query::ItemId;
use by_rays::Ready;
pub use none::NoOcclusion;

/// How many cases a test that takes minutes goes through: `cargo test --release --lib --
/// --ignored`, and this variable for more or fewer.
fn asked_for(variable: &str, cases: usize) -> usize {
    std::env::var(variable).map_or(cases, |n| n.parse().unwrap())
}

/// What is left of the items in the view, in order: by two passes, and interleaved
/// where the back end allows it.
fn kept<B: OcclusionBuffer>(ready: &Ready, view: &View, kernel: Kernel) -> Vec<Vec<ItemId>> {
    let mut answers = vec![by_two_passes::<B>(ready, view, OccluderChoice::All, kernel)];
    if B::ALTERNATES {
        let mut culler = Interleaved::new(B::new(view.grid), kernel).drawing_from(u32::MAX);
        let mut kept = Vec::new();
        culler.cull(&ready.occluders, view, &mut kept);
        kept.sort_unstable();
        answers.push(kept);
    }
    answers
}

fn by_two_passes<B: OcclusionBuffer>(
    ready: &Ready,
    view: &View,
    choice: OccluderChoice,
    kernel: Kernel,
) -> Vec<ItemId> {
    let candidates = ready.in_view(view.volume);
    let mut culler = TwoPass::new(B::new(view.grid), choice, kernel);
    let mut kept = Vec::new();
    culler.cull(&ready.occluders, view, &candidates, &mut kept);
    kept.sort_unstable();
    kept
}
