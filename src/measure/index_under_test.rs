//! [`Subject`]: a structure under test, built over its own copy of the data.
//!
//! So no other structure warms its data. Times the build and updates after items have moved; a
//! panic becomes a verdict.

use super::clock::Stopwatch;
use super::key::Pass;
use super::{Verdict, Workload, compare_with_scan, guarded, input_for, input_of};
use crate::culling::CullingTest;
use crate::geometry::Aabb;
use crate::index::{DynIndex, MemoryUsage, StructureSpec};
use crate::path::evenly;
use crate::query::{AnyVolume, ItemId, QueryCost};
use crate::scene::Scene;

/// A structure with its two indexes: over the items and over the regions.
///
/// The first returns what the camera sees, the second where the camera is.
#[derive(Debug)]
pub struct Subject {
    /// Structure, parameters, kernel and threads.
    pub spec: StructureSpec,
    /// True for the second copy of a structure, which should be as fast as the first.
    pub is_twin: bool,
    /// The indexes, or the reason why there are none.
    pub built: Result<Built, Verdict>,
}

/// The indexes of a structure over one scene.
#[derive(Debug)]
pub struct Built {
    /// Index over the items in the form that the culling test needs.
    pub items: Box<dyn DynIndex>,
    /// Index over the regions; `None` if these are the indexed items.
    regions: Option<Box<dyn DynIndex>>,
    /// CPU time of one build over the items, ms.
    ///
    /// Wall time if builds have several threads.
    pub build_ms: f64,
    /// Memory of the index over the items.
    pub memory: MemoryUsage,
    /// CPU time of an update, ms; `None` in scenes too large for it.
    pub update_ms: Option<f64>,
}

impl Built {
    /// The index that answers region search.
    pub fn regions(&self) -> &dyn DynIndex {
        self.regions.as_deref().unwrap_or(self.items.as_ref())
    }

    /// Answers query `n` of a pass: appends ids to an empty output.
    pub(super) fn answer(&self, workload: &Workload, pass: Pass, n: usize, out: &mut Vec<ItemId>) {
        match pass {
            Pass::Queries => self.items.query(workload.views[n].as_any(), out),
            Pass::Searches => workload.search(n, out, |p, out| self.regions().locate(p, out)),
        }
    }

    /// [`Built::answer`] with the counting recorder.
    pub(super) fn count(
        &self,
        workload: &Workload,
        pass: Pass,
        n: usize,
        out: &mut Vec<ItemId>,
        cost: &mut QueryCost,
    ) {
        match pass {
            Pass::Queries => (self.items).query_counted(workload.views[n].as_any(), out, cost),
            Pass::Searches => workload.search(n, out, |p, out| {
                self.regions().query_counted(p.into(), out, cost);
            }),
        }
    }
}

/// Suffix of a twin's label.
pub(super) const TWIN: &str = "#twin";

/// A label without the suffix of a twin.
pub(super) fn original(label: &str) -> &str {
    label.strip_suffix(TWIN).unwrap_or(label)
}

/// Builds shorter than this are made twice, and the second one counts.
const AGAIN_BELOW_MS: f64 = 50.0;

impl Subject {
    /// Builds the structure over the items in the form that a culling test needs.
    ///
    /// A panic or a refusal becomes its verdict.
    pub fn build(spec: StructureSpec, is_twin: bool, scene: &Scene, test: CullingTest) -> Subject {
        let built = guarded(|| build(&spec, scene, test)).unwrap_or_else(Err);
        Subject {
            spec,
            is_twin,
            built,
        }
    }

    /// Also measures updates, on another index that is then dropped.
    pub fn with_updates(mut self, scene: &Scene, test: CullingTest) -> Subject {
        if let Ok(built) = &mut self.built {
            let update = || measure_update(&self.spec, scene, test);
            match guarded(update).unwrap_or_else(Err) {
                Ok(update_ms) => built.update_ms = update_ms,
                Err(verdict) => self.built = Err(verdict),
            }
        }
        self
    }

    /// Label on the command line; a twin's ends in `#twin`.
    pub fn label(&self) -> String {
        match self.is_twin {
            true => format!("{}{TWIN}", self.spec.label),
            false => self.spec.label.clone(),
        }
    }
}

fn build(spec: &StructureSpec, scene: &Scene, test: CullingTest) -> Result<Built, Verdict> {
    let items = test.items(&scene.items);
    let build = || {
        let watch = Stopwatch::start();
        let built = spec.build(input_for(test, scene, &items));
        // This thread's CPU time does not include other threads' work.
        let lap = watch.lap();
        let alone = spec.execution.threads <= 1;
        built.map(|index| (index, if alone { lap.cpu_ns } else { lap.wall_ns } / 1e6))
    };
    let (mut index, mut build_ms) = build()?;
    if build_ms < AGAIN_BELOW_MS {
        // The first build has paid for memory that was never touched. Never two at once: a large
        // scene would not fit twice.
        drop(index);
        (index, build_ms) = build()?;
    }
    let boxes = scene.regions.boxes(&scene.items);
    let others = !std::ptr::eq(boxes, &items[..]);
    let regions = others.then(|| spec.build(input_of(scene, boxes)));
    Ok(Built {
        memory: index.memory(),
        build_ms,
        update_ms: None,
        items: index,
        regions: regions.transpose()?,
    })
}

/// Share of the items that move in the measured update.
const UPDATE_SHARE: f64 = 0.01;
/// Most items of a scene whose updates are measured: they need a second copy of it.
pub(super) const MOST_UPDATED: usize = 2_000_000;

/// CPU time of an update after [`UPDATE_SHARE`] of the items have moved, ms.
///
/// They move by their own size. Of two updates the second counts, as with builds. A search after
/// them is checked.
fn measure_update(
    spec: &StructureSpec,
    scene: &Scene,
    test: CullingTest,
) -> Result<Option<f64>, Verdict> {
    let mut items = test.items(&scene.items).into_owned();
    if items.is_empty() || items.len() > MOST_UPDATED {
        return Ok(None);
    }
    let mut index = spec.build(input_for(test, scene, &items))?;
    let mut update_ms = None;
    for _ in 0..2 {
        let moved = move_share(&mut items, UPDATE_SHARE);
        let watch = Stopwatch::start_for(spec.is_threaded());
        spec.update(&mut index, input_for(test, scene, &items), &moved)?;
        update_ms = Some(watch.lap().cpu_ns / 1e6);
    }
    if let Some(moved) = items.iter().find(|b| !b.is_empty()) {
        let point = AnyVolume::Point(moved.min);
        let answer = |out: &mut Vec<ItemId>| index.query(point, out);
        compare_with_scan(&items, point, "a search after updates", answer)?;
    }
    Ok(update_ms)
}

/// Moves evenly spread items by their own extent, within f32; returns their ids.
pub fn move_share(items: &mut [Aabb], share: f64) -> Vec<ItemId> {
    let count = ((items.len() as f64 * share).round() as usize).clamp(1, items.len());
    let moved = evenly(items.len(), count).map(|id| id as ItemId);
    let moved: Vec<ItemId> = moved.collect();
    for &id in &moved {
        let b = &mut items[id as usize];
        let step = b.extent();
        let moved = Aabb::new(b.min + step, b.max + step);
        *b = if moved.is_finite() { moved } else { *b };
    }
    moved
}
