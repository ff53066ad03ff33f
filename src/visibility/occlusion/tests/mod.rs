//! Comparison of the occlusion stage with single rays in f64.

mod by_rays;
mod lanes;
mod maps;
mod meshes;
mod none;
mod pairs;
mod rules;
mod slits;
mod streets;
mod two_pass;
mod windows;
mod worlds;
mod z_buffer;

use super::{Interleaved, OcclusionBuffer, View};
use crate::kernel::Kernel;
use crate::query::ItemId;
use by_rays::Ready;
pub use none::NoOcclusion;
pub use two_pass::TwoPass;
pub use z_buffer::ZBuffer;

/// Number of cases of a long test: the environment variable, or `cases`.
///
/// Run by `cargo test --release --lib -- --ignored`.
fn case_count(variable: &str, cases: usize) -> usize {
    std::env::var(variable).map_or(cases, |n| n.parse().unwrap())
}

/// Kept items in the view, in order: by two passes, then interleaved.
fn kept<B: OcclusionBuffer>(ready: &Ready, view: &View, kernel: Kernel) -> [Vec<ItemId>; 2] {
    let two_passes = TwoPass {
        buffer: B::new(view.grid),
        scene: &ready.occluders,
        view,
        items: &ready.in_view(view.volume),
    };
    let mut culler = Interleaved::new(B::new(view.grid), kernel);
    culler.drawn_part = u32::MAX;
    let mut interleaved = Vec::new();
    culler.cull(&ready.occluders, view, &mut interleaved);
    let mut both = [two_passes.kept(kernel), interleaved];
    both.iter_mut().for_each(|kept| kept.sort_unstable());
    both
}
