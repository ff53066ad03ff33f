//! Checks of the occlusion stage against single rays in f64.

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

/// Number of cases of a long test: the environment variable, or `cases`.
///
/// Run by `cargo test --release --lib -- --ignored`.
fn case_count(variable: &str, cases: usize) -> usize {
    std::env::var(variable).map_or(cases, |n| n.parse().unwrap())
}

/// Items in view that are kept, in order, by each coupling.
///
/// Two passes first; then interleaved if the back end supports it.
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
