//! The least that stages can take: what they must read and write at any rate, and
//! nothing decided. Bounds are timed beside the stages, so that a ratio to one is paired
//! like any other.

use std::cell::RefCell;
use std::hint::black_box;
use std::rc::Rc;

use serde::Serialize;

use super::faces::Faces;
use super::fragment_rows::Z;
use super::stage::StageKind;
use super::times::Times;
use super::world::World;
use crate::measure::Ask;
use crate::query::ItemId;
use crate::statistics::Estimate;
use crate::visibility::occlusion::{FrameTrace, MaskedInner, OccluderScene, OcclusionBuffer, View};
use crate::visibility::region::{Opening, RegionId, RegionRow, Scratch};
use crate::visibility::triangle::SafeCones;

/// A lower bound of a back end, over all views.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct BoundRow {
    /// The stage of the back end.
    pub stage: StageKind,
    /// The back end that it is a bound of.
    pub back_end: &'static str,
    /// What is done and nothing else.
    pub name: &'static str,
    /// Thread CPU time of a view.
    #[serde(flatten)]
    pub times: Times,
    /// Time of the back end / time of this; null where the back end has none.
    pub ratio: Option<f64>,
    /// Lower end of its 95 % interval.
    pub ratio_lower: Option<f64>,
    /// Upper end of its 95 % interval.
    pub ratio_upper: Option<f64>,
}

impl BoundRow {
    /// With its time, and the back end's over it.
    pub fn set(&mut self, own: Option<Estimate>, ratio: Option<Estimate>) {
        self.times = Times::of(own);
        self.ratio = ratio.map(|r| r.value);
        self.ratio_lower = ratio.and_then(|r| r.lower);
        self.ratio_upper = ratio.and_then(|r| r.upper);
    }
}

/// A bound, ready to be timed.
pub struct Bound<'w> {
    stage: StageKind,
    back_end: &'static str,
    name: &'static str,
    /// Does it in a view; what is appended is counted and no answer.
    pub ask: Ask<'w>,
}

impl Bound<'_> {
    /// Without times.
    pub fn row(&self) -> BoundRow {
        BoundRow {
            stage: self.stage,
            back_end: self.back_end,
            name: self.name,
            times: Times::default(),
            ratio: None,
            ratio_lower: None,
            ratio_upper: None,
        }
    }
}

/// The bounds that a scene has data for. `covered` are the samples of each view that
/// something covers; nothing of views where nothing is drawn.
pub fn bounds<'w>(world: &'w World<'w>, faces: &Faces, covered: &[u64]) -> Vec<Bound<'w>> {
    let mut bounds = of_regions(world);
    bounds.extend(of_occlusion(world));
    bounds.push(of_cones(world, faces));
    bounds.push(of_fragments(world, covered));
    bounds
}

fn of_regions<'w>(world: &'w World<'w>) -> Vec<Bound<'w>> {
    let mut bounds = Vec::new();
    let views = 0..world.views();
    if let Some(row) = world.region_row("exact-pvs") {
        let homes = views.clone().map(|view| {
            let mut homes = Vec::new();
            let inside = row.graph().homes(world.rays(view), &mut homes);
            homes.truncate(if inside { homes.len() } else { 0 });
            homes
        });
        let homes: Vec<Vec<RegionId>> = homes.collect();
        bounds.push(Bound {
            stage: StageKind::Region,
            back_end: "exact-pvs",
            name: "read the rows of the eye's regions",
            ask: Box::new(move |view, _| {
                for &home in &homes[view] {
                    black_box(row.stored(home).iter().fold(0, |all, region| all ^ region));
                }
            }),
        });
    }
    if let Some(row) = world.region_row("portal-clip") {
        let openings: Vec<Vec<Opening>> =
            views.map(|view| seen_openings(world, row, view)).collect();
        bounds.push(Bound {
            stage: StageKind::Region,
            back_end: "portal-clip",
            name: "read the portals between seen regions",
            ask: Box::new(move |view, _| {
                let corners = openings[view].iter().flat_map(|opening| &opening.corners);
                let bits = corners.fold(0, |all, p| {
                    all ^ p.x.to_bits() ^ p.y.to_bits() ^ p.z.to_bits()
                });
                black_box(bits);
            }),
        });
    }
    bounds
}

/// The openings between two regions that are both seen.
fn seen_openings(world: &World, row: &dyn RegionRow, view: usize) -> Vec<Opening> {
    let mut seen = Vec::new();
    row.from_eye(world.rays(view), &mut Scratch::default(), &mut seen);
    let is_seen = |region: &RegionId| seen.binary_search(region).is_ok();
    let openings = row.graph().openings().iter();
    openings
        .filter(|opening| opening.sides.iter().all(is_seen))
        .copied()
        .collect()
}

fn of_occlusion<'w>(world: &'w World<'w>) -> [Bound<'w>; 3] {
    let scenes: Rc<[&OccluderScene]> = (0..world.views()).map(|v| world.occluders(v)).collect();
    let trace = |view: usize| {
        let (rays, volume, scene) = (world.rays(view), world.volume(view), scenes[view]);
        let view = View::new(rays, volume, scene, world.samples);
        FrameTrace::of(scene, &view, world.kernel)
    };
    let traces: Rc<[FrameTrace]> = (0..world.views()).map(trace).collect();
    let bound = |name, ask| Bound {
        stage: StageKind::Occlusion,
        back_end: "masked-inner",
        name,
        ask,
    };
    let [reading, replaying] = [(); 2].map(|()| traces.clone());
    let drawn_in = scenes.clone();
    let buffer = RefCell::new(MaskedInner::new(world.samples));
    let read = MaskedInner::new(world.samples);
    [
        bound(
            "read the occluders that are drawn",
            Box::new(move |view, _| {
                black_box(reading[view].read_occluders(drawn_in[view]));
            }),
        ),
        bound(
            "clear the buffer and write its tiles again",
            Box::new(move |view, _| replaying[view].replay(&mut buffer.borrow_mut())),
        ),
        bound(
            "read the tested boxes and the deciding tiles",
            Box::new(move |view, _| {
                black_box(traces[view].read_tested(scenes[view], &read));
            }),
        ),
    ]
}

fn of_cones<'w>(world: &'w World<'w>, faces: &Faces) -> Bound<'w> {
    let views = (0..world.views()).map(|view| SafeCones::of(faces.clusters(view)));
    let cones: Vec<SafeCones> = views.collect();
    let kernel = world.kernel;
    Bound {
        stage: StageKind::Triangle,
        back_end: "cone-f32-safe",
        name: "read the cones",
        ask: Box::new(move |view, _| {
            black_box(cones[view].read(kernel));
        }),
    }
}

/// The last one: how much it hands on is what is covered.
fn of_fragments<'w>(world: &World, covered: &[u64]) -> Bound<'w> {
    let covered: Vec<usize> = covered.iter().map(|count| *count as usize).collect();
    let samples = world.samples.samples();
    let depths = vec![1.0f32; samples];
    let buffer = RefCell::new(vec![0.0f32; samples]);
    let ids: Vec<ItemId> = (0..samples as ItemId).collect();
    Bound {
        stage: StageKind::Fragment,
        back_end: Z,
        name: "write id and depth of each covered sample",
        ask: Box::new(move |view, out| {
            let count = covered.get(view).map_or(0, |count| *count);
            out.extend_from_slice(&ids[..count]);
            let buffer = &mut buffer.borrow_mut();
            buffer[..count].copy_from_slice(&depths[..count]);
            black_box(&buffer[..count]);
        }),
    }
}
