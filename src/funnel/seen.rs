//! What the views of a funnel show, exactly: solid boxes as boxes, meshes and maps as
//! triangles.

use super::error::FunnelError;
use super::left_out::most_drawn;
use super::truth::Truth;
use super::world::World;
use crate::query::ItemId;
use crate::visibility::fragment;
use crate::visibility::truth::{
    RayIndex, SampleTruth, SolidBox, SurfaceIndex, visible_by_random_rays,
};
use crate::visibility::{Rays, SampleGrid};

/// Samples that tell how many items are in front at all.
const FEW: SampleGrid = SampleGrid::new(16, 9);

/// At the samples of every view and along so many random rays, whose items count as
/// one sample each if they are at none. `None` if stopped.
///
/// # Errors
/// Too many items in front at the same samples.
pub fn seen(
    world: &World,
    samples: SampleGrid,
    random_rays: usize,
    threads: usize,
    stop: &dyn Fn() -> bool,
) -> Result<Option<Truth>, FunnelError> {
    let all = Shown::of(world);
    let items = world.items() as ItemId;
    let mut visible = Vec::with_capacity(world.views());
    for view in 0..world.views() {
        if stop() {
            return Ok(None);
        }
        let rays = world.rays(view);
        let at_few = all.at_samples(rays, FEW, threads).samples_of;
        let at_few: u64 = at_few.into_iter().map(u64::from).sum();
        let (in_front, most) = (
            at_few * samples.samples() as u64 / FEW.samples() as u64,
            most_drawn(samples),
        );
        if in_front > most {
            return Err(FunnelError::TooManyTies {
                place: world.camera(view),
                in_front,
                most,
            });
        }
        let truth = all.at_samples(rays, samples, threads);
        let counts = truth.visible.iter().copied().zip(truth.samples_of);
        let mut seen: Vec<(ItemId, u32)> = counts.collect();
        if random_rays > 0 {
            let more = all.along_random(rays, random_rays, view as u64 + 1, threads);
            let is_new = |id: &ItemId| truth.visible.binary_search(id).is_err();
            seen.extend(more.into_iter().filter(is_new).map(|id| (id, 1)));
            seen.sort_unstable();
        }
        // Behind a map's items come its floors and ceilings.
        seen.retain(|(item, _)| *item < items);
        visible.push(seen);
    }
    Ok(Some(Truth::new(visible)))
}

/// What is shown, as rays end at it: solid boxes; or the triangles of a mesh, or the walls,
/// floors and ceilings of a map.
pub enum Shown<'w> {
    Solids(RayIndex, Option<&'w fragment::Surfaces>),
    Surfaces(SurfaceIndex),
}

impl Shown<'_> {
    /// Of a scene as its items are taken.
    pub fn of<'w>(world: &'w World) -> Shown<'w> {
        if let Some(solids) = world.solids.as_ref() {
            let index = RayIndex::build(solids);
            return Shown::Solids(index, world.cut_outs.as_ref());
        }
        let surfaces = world
            .surfaces
            .as_ref()
            .expect("triangles of what is no solid box");
        Shown::Surfaces(SurfaceIndex::build(surfaces))
    }

    /// What is in front at the samples of a view; behind a map's items come its floors and
    /// ceilings.
    pub fn at_samples(&self, rays: &Rays, grid: SampleGrid, threads: usize) -> SampleTruth {
        match self {
            Shown::Solids(index, Some(holes)) => {
                let opaque = |body: &SolidBox, probe: &_, at: &_| {
                    holes.opaque(body.item, &body.b, probe, at)
                };
                SampleTruth::of_opaque(index, &opaque, rays, grid, threads)
            }
            Shown::Solids(index, None) => SampleTruth::of(index, rays, grid, threads),
            Shown::Surfaces(index) => SampleTruth::of(index, rays, grid, threads),
        }
    }

    fn along_random(&self, rays: &Rays, count: usize, seed: u64, threads: usize) -> Vec<ItemId> {
        match self {
            Shown::Solids(index, _) => visible_by_random_rays(index, rays, count, seed, threads),
            Shown::Surfaces(index) => visible_by_random_rays(index, rays, count, seed, threads),
        }
    }
}
