//! Exactly visible items of each view.
//!
//! Solid boxes are boxes to rays, meshes and maps are triangles.

use super::error::{FunnelError, most_drawn};
use super::world::{Shape, World};
use crate::query::ItemId;
use crate::visibility::fragment;
use crate::visibility::truth::{
    RayIndex, SampleTruth, SolidBox, SurfaceIndex, visible_by_random_rays,
};
use crate::visibility::{Rays, SampleGrid};

/// Samples that estimate how many items are in front at all samples.
const FEW: SampleGrid = SampleGrid::new(16, 9);

/// Visible items of each view with the samples of each, ascending.
pub type Truth = Vec<Vec<(ItemId, u32)>>;

/// Visible items at the samples of every view and along random rays.
///
/// Items that only some of the `random_rays` rays meet count as one sample each.
///
/// # Errors
/// Too many items in front at the same samples.
pub fn visible(world: &World, random_rays: usize, threads: usize) -> Result<Truth, FunnelError> {
    let rays_end = RaysEnd::at(&world.shape, world.cut_outs.as_ref());
    let samples = world.samples;
    let items = world.items() as ItemId;
    let mut all = Vec::with_capacity(world.views.len());
    for view in world.views() {
        let rays = world.rays(view);
        let truth = rays_end.visible(rays, samples, threads).map_err(|error| {
            FunnelError::Refused(format!("camera {}: {error}", world.views[view].camera))
        })?;
        let counts = truth.visible.iter().copied().zip(truth.samples_of);
        let mut seen: Vec<(ItemId, u32)> = counts.collect();
        if random_rays > 0 {
            let more = rays_end.along_random(rays, random_rays, view as u64 + 1, threads);
            let is_new = |id: &ItemId| truth.visible.binary_search(id).is_err();
            seen.extend(more.into_iter().filter(is_new).map(|id| (id, 1)));
            seen.sort_unstable();
        }
        // Floors and ceilings of a map come behind its items.
        seen.retain(|(item, _)| *item < items);
        all.push(seen);
    }
    Ok(all)
}

/// Surfaces at which rays end: solid boxes, or triangles with the floors of a map.
pub enum RaysEnd<'w> {
    Boxes(RayIndex, Option<&'w fragment::Holes>),
    Triangles(SurfaceIndex),
}

impl RaysEnd<'_> {
    /// Surfaces of a scene of this shape, with the holes of its items.
    pub fn at<'w>(shape: &Shape, holes: Option<&'w fragment::Holes>) -> RaysEnd<'w> {
        match shape {
            Shape::Boxes(solids) => RaysEnd::Boxes(RayIndex::build(solids), holes),
            Shape::Triangles(surfaces) => RaysEnd::Triangles(SurfaceIndex::build(surfaces)),
        }
    }

    /// Items in front at the samples of a view.
    ///
    /// # Errors
    /// Too many items in front at the same samples.
    pub fn visible(
        &self,
        rays: &Rays,
        samples: SampleGrid,
        threads: usize,
    ) -> Result<SampleTruth, String> {
        let at_few = self.at_samples(rays, FEW, threads).samples_of;
        let at_few: u64 = at_few.into_iter().map(u64::from).sum();
        let in_front = at_few * samples.samples() as u64 / FEW.samples() as u64;
        let most = most_drawn(samples);
        if in_front > most {
            return Err(format!(
                "about {in_front} front items, summed over the samples; expected at most {most}: \
                 fewer --samples or fewer items with a common face"
            ));
        }
        Ok(self.at_samples(rays, samples, threads))
    }

    fn at_samples(&self, rays: &Rays, grid: SampleGrid, threads: usize) -> SampleTruth {
        match self {
            RaysEnd::Boxes(index, Some(holes)) => {
                let opaque = |body: &SolidBox, probe: &_, at: &_| {
                    holes.opaque(body.item, &body.b, probe, at)
                };
                SampleTruth::of_opaque(index, &opaque, rays, grid, threads)
            }
            RaysEnd::Boxes(index, None) => SampleTruth::of(index, rays, grid, threads),
            RaysEnd::Triangles(index) => SampleTruth::of(index, rays, grid, threads),
        }
    }

    fn along_random(&self, rays: &Rays, count: usize, seed: u64, threads: usize) -> Vec<ItemId> {
        match self {
            RaysEnd::Boxes(index, _) => visible_by_random_rays(index, rays, count, seed, threads),
            RaysEnd::Triangles(index) => visible_by_random_rays(index, rays, count, seed, threads),
        }
    }
}
