//! What a back end of the region stage answers with.

use std::sync::Arc;

use super::clip_windows::ClipWindows;
use super::graph::RegionGraph;
use super::windows::Windows;
use crate::visibility::{Guarantee, Rays};

pub(super) use super::number::{Marks, RegionId, decode};

/// Where the eye of an answer is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum EyePlace {
    /// In regions: the answer is what they let it see.
    Inside,
    /// Not wholly in regions (or the lens is orthographic): all regions are listed.
    Outside,
}

/// What a back end declares of itself.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct About {
    /// As it is typed.
    pub name: &'static str,
    /// One line of what it does.
    pub summary: &'static str,
    /// What it promises of its answers from an eye, in the world of regions and
    /// openings (what items hide is not asked here).
    pub guarantee: Guarantee,
}

/// A back end of the region stage: which regions can be seen at all.
#[allow(clippy::wrong_self_convention)] // What is seen from an eye, not a conversion.
pub trait RegionRow: Send + Sync {
    /// Name, summary and promise.
    fn about(&self) -> About;

    /// The graph that it searches.
    fn graph(&self) -> &Arc<RegionGraph>;

    /// Replaces `out` by the regions that a camera may see, ascending.
    fn from_eye(&self, rays: &Rays, scratch: &mut Scratch, out: &mut Vec<RegionId>) -> EyePlace;

    /// What is stored of the regions that are seen from a region, ascending; nothing of a
    /// row that searches.
    fn stored(&self, _: RegionId) -> &[RegionId] {
        &[]
    }
}

/// Memory that queries use again and again.
#[derive(Clone, Default, Debug)]
pub struct Scratch {
    pub(super) homes: Vec<RegionId>,
    pub(super) seen: Marks,
    pub(super) queue: Vec<RegionId>,
    pub(super) rectangles: Windows<[f64; 4]>,
    pub(super) windows: ClipWindows,
}
