//! Lower bounds of stages: the memory that a back end must read and write.
//!
//! They are timed beside the stages, so that a ratio to one is paired like any other.

use std::cell::RefCell;
use std::hint::black_box;

use serde::Serialize;

use super::stage::{Chain, PORTAL_CLIP, StageKind, Z};
use super::task::{FunnelKey, KeyedTask};
use super::triangle_stage::TriangleStage;
use super::world::World;
use crate::measure::OverProcesses;
use crate::query::ItemId;
use crate::statistics::{Estimate, flat};
use crate::visibility::region::{Opening, RegionId, RegionRow, Scratch};
use crate::visibility::triangle::SafeCones;

const STORED_PVS: &str = "stored-pvs";

/// A lower bound of a back end, over all views.
#[derive(Clone, Debug, Serialize)]
pub struct BoundRow {
    /// The stage of the back end.
    pub stage: StageKind,
    /// The back end.
    pub back_end: &'static str,
    /// The reads and writes that are timed.
    pub name: &'static str,
    /// Thread CPU time of a view.
    #[serde(flatten, serialize_with = "flat::stage_ns")]
    pub time: Option<Estimate>,
    /// Time of the back end / time of this; null where the back end has none.
    #[serde(flatten, serialize_with = "flat::ratio")]
    pub ratio: Option<Estimate>,
}

impl BoundRow {
    fn key(&self) -> FunnelKey {
        FunnelKey::Bound(self.stage, self.name.to_owned())
    }

    pub(super) fn set(&mut self, chain: &Chain, times: &OverProcesses<FunnelKey>) {
        let own = self.key();
        self.time = times.ns(&own);
        let bounded = FunnelKey::of_stage(chain, self.stage, self.back_end);
        self.ratio = bounded.and_then(|bounded| times.ratio(&bounded, &own));
    }
}

/// A bound with its task; what the task appends is counted and no answer.
pub type Bound<'w> = (BoundRow, KeyedTask<'w>);

fn bound<'w>(
    stage: StageKind,
    [back_end, name]: [&'static str; 2],
    ask: impl Fn(usize, &mut Vec<ItemId>) + 'w,
) -> Bound<'w> {
    let row = BoundRow {
        stage,
        back_end,
        name,
        time: None,
        ratio: None,
    };
    let key = row.key();
    (row, (key, Box::new(ask)))
}

/// Name of the bound that appends the ids of the covered samples.
const WRITE_COVERED: &str = "write id and depth of each covered sample";

/// Key of the bound that appends the ids of the covered samples.
pub fn covered_key() -> FunnelKey {
    FunnelKey::Bound(StageKind::Fragment, WRITE_COVERED.to_owned())
}

/// Bounds that a scene has data for. `covered` are the samples of each view that
/// something covers; empty where nothing is drawn.
pub fn bounds<'w>(
    world: &'w World<'w>,
    triangles: &TriangleStage,
    covered: &[u64],
) -> Vec<Bound<'w>> {
    let mut bounds = Vec::new();
    let row = |name| world.regions.as_ref().and_then(|regions| regions.row(name));
    bounds.extend(row(STORED_PVS).map(|row| of_table(world, row)));
    bounds.extend(row(PORTAL_CLIP).map(|row| of_portals(world, row)));
    bounds.push(of_cones(world, triangles));
    bounds.push(of_fragments(world, covered));
    bounds
}

fn of_table<'w>(world: &'w World, row: &'w RegionRow) -> Bound<'w> {
    let homes = world.views().map(|view| {
        let mut homes = Vec::new();
        let is_inside = row.graph.homes(world.rays(view), &mut homes);
        Some(homes).filter(|_| is_inside).unwrap_or_default()
    });
    let homes: Vec<Vec<RegionId>> = homes.collect();
    let name = "read the rows of the eye's regions";
    bound(StageKind::Region, [STORED_PVS, name], move |view, _| {
        for &home in &homes[view] {
            let stored = row.pvs.iter().flat_map(|pvs| pvs.row(home));
            black_box(stored.fold(0, |all, region| all ^ region));
        }
    })
}

fn of_portals<'w>(world: &World, row: &RegionRow) -> Bound<'w> {
    let seen_openings = |view| -> Vec<Opening> {
        let mut seen = Vec::new();
        row.from_eye(world.rays(view), &mut Scratch::default(), &mut seen);
        let is_seen = |region: &RegionId| seen.binary_search(region).is_ok();
        let openings = row.graph.openings.iter();
        let inner = openings.filter(|opening| opening.sides.iter().all(is_seen));
        inner.copied().collect()
    };
    let openings: Vec<Vec<Opening>> = world.views().map(seen_openings).collect();
    let name = "read the portals between seen regions";
    bound(StageKind::Region, [PORTAL_CLIP, name], move |view, _| {
        let corners = openings[view].iter().flat_map(|opening| &opening.corners);
        let bits = corners.fold(0, |all, p| {
            all ^ p.x.to_bits() ^ p.y.to_bits() ^ p.z.to_bits()
        });
        black_box(bits);
    })
}

fn of_cones<'w>(world: &World, triangles: &TriangleStage) -> Bound<'w> {
    let cones = (world.views()).map(|view| SafeCones::of(triangles.clusters(view)));
    let cones: Vec<SafeCones> = cones.collect();
    let kernel = world.kernel;
    let names = ["cone-f32-safe", "read the cones"];
    bound(StageKind::Triangle, names, move |view, _| {
        black_box(cones[view].read(kernel));
    })
}

fn of_fragments<'w>(world: &World, covered: &[u64]) -> Bound<'w> {
    let covered: Vec<usize> = covered.iter().map(|count| *count as usize).collect();
    let samples = world.samples.samples();
    let depths = vec![1.0f32; samples];
    let buffer = RefCell::new(vec![0.0f32; samples]);
    let ids: Vec<ItemId> = (0..samples as ItemId).collect();
    bound(StageKind::Fragment, [Z, WRITE_COVERED], move |view, out| {
        let count = covered.get(view).map_or(0, |count| *count);
        out.extend_from_slice(&ids[..count]);
        let buffer = &mut buffer.borrow_mut();
        buffer[..count].copy_from_slice(&depths[..count]);
        black_box(&buffer[..count]);
    })
}
