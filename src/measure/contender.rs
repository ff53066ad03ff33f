//! A contender of a measurement: a structure, built over its own copy of the
//! data so that nobody is warmed by a neighbour. It owns the timing of the
//! build and the net under panics.

use std::time::Duration;

use super::clock::Stopwatch;
use super::{Status, Verdict};
use crate::culling::CullingTest;
use crate::geometry::Aabb;
use crate::index::{BuildError, DynIndex, MemoryUsage, StructureSpec, caught};
use crate::query::ItemId;
use crate::scene::Scene;
use crate::statistics::median;
use crate::threads;

/// A structure with its two indexes: over the items (what does the camera
/// see) and over the regions (where is the camera).
pub struct Contender {
    pub spec: StructureSpec,
    /// Entered a second time, for the run's noise floor only.
    pub is_twin: bool,
    pub built: Result<Built, Verdict>,
}

pub struct Built {
    pub items: Box<dyn DynIndex>,
    /// `None` where the regions are the items as they are indexed.
    regions: Option<Box<dyn DynIndex>>,
    /// CPU time of one build over the items, median of all builds, ms; wall time
    /// where builds have several threads.
    pub build_ms: f64,
    pub memory: MemoryUsage,
    /// CPU time of an update, ms, for each of [`UPDATE_SHARES`]; empty for
    /// scenes too large to be moved in passing.
    pub update_ms: Vec<f64>,
}

impl Built {
    /// The index that answers region search.
    pub fn regions(&self) -> &dyn DynIndex {
        self.regions.as_deref().unwrap_or(self.items.as_ref())
    }
}

/// Shares of the items that move in the updates that are measured.
pub const UPDATE_SHARES: [f64; 4] = [0.001, 0.01, 0.1, 1.0];
/// Largest scene whose updates are measured: they need a second copy of it.
const MOST_UPDATED: usize = 2_000_000;

/// Builds are repeated this often, or until they have taken this long.
const BUILDS: usize = 3;
const BUILD_TIME: Duration = Duration::from_millis(300);

impl Contender {
    /// Builds the structure over the items as a culling test has them; a panic or a refusal becomes its verdict.
    pub fn build(
        spec: StructureSpec,
        is_twin: bool,
        scene: &Scene,
        test: CullingTest,
    ) -> Contender {
        let built = guarded(|| build(&spec, scene, test)).unwrap_or_else(Err);
        Contender {
            spec,
            is_twin,
            built,
        }
    }

    /// The name in samples: a twin is told apart.
    pub fn label(&self) -> String {
        match self.is_twin {
            true => format!("{}#twin", self.spec.label),
            false => self.spec.label.clone(),
        }
    }
}

fn build(spec: &StructureSpec, scene: &Scene, test: CullingTest) -> Result<Built, Verdict> {
    let items = test.items(&scene.items);
    let (mut times, mut index) = (Vec::new(), None);
    let total = Stopwatch::start();
    while times.len() < BUILDS && total.lap().wall_ns < BUILD_TIME.as_nanos() as f64 {
        // Never two at once: a large scene would not fit twice.
        drop(index.take());
        let watch = Stopwatch::start();
        index = Some(
            spec.build_with(&items, scene.own_tree.as_ref())
                .map_err(not_built)?,
        );
        // This thread's CPU time says nothing about what others did for it.
        let lap = watch.lap();
        let alone = threads::chosen() == 1;
        times.push(if alone { lap.cpu_ns } else { lap.wall_ns } / 1e6);
    }
    let mut update_ms = Vec::new();
    if let Some(spare) = index.take() {
        update_ms = measure_updates(spec, scene, &items, spare).map_err(not_built)?;
        index = Some(
            spec.build_with(&items, scene.own_tree.as_ref())
                .map_err(not_built)?,
        );
    }
    let Some(index) = index else {
        return Err(Verdict::new(Status::TimedOut, "no time left for a build"));
    };
    let boxes = scene.regions.boxes(&scene.items);
    let regions = if std::ptr::eq(boxes, &items[..]) {
        None
    } else {
        Some(
            spec.build_with(boxes, scene.own_tree.as_ref())
                .map_err(not_built)?,
        )
    };
    Ok(Built {
        memory: index.memory(),
        build_ms: median(&times).unwrap_or(f64::NAN),
        update_ms,
        items: index,
        regions,
    })
}

/// Moves a share of the items by their own size and times bringing the index
/// up to date; once for each share, on an index that is then thrown away.
fn measure_updates(
    spec: &StructureSpec,
    scene: &Scene,
    items: &[Aabb],
    mut index: Box<dyn DynIndex>,
) -> Result<Vec<f64>, BuildError> {
    if items.is_empty() || items.len() > MOST_UPDATED {
        return Ok(Vec::new());
    }
    let mut items = items.to_vec();
    let mut times = Vec::with_capacity(UPDATE_SHARES.len());
    for share in UPDATE_SHARES {
        let moved = move_share(&mut items, share);
        let watch = Stopwatch::start();
        spec.update(&mut index, &items, scene.own_tree.as_ref(), &moved)?;
        times.push(watch.lap().cpu_ns / 1e6);
    }
    Ok(times)
}

/// Moves evenly spread items by their own extent; which ones.
pub fn move_share(items: &mut [Aabb], share: f64) -> Vec<ItemId> {
    let count = ((items.len() as f64 * share).round() as usize).clamp(1, items.len());
    let moved: Vec<ItemId> = (0..count)
        .map(|i| (i * items.len() / count) as ItemId)
        .collect();
    for &id in &moved {
        let b = &mut items[id as usize];
        let step = b.extent();
        *b = Aabb::new(b.min + step, b.max + step);
    }
    moved
}

/// Runs foreign code; a panic becomes a verdict with its message.
pub fn guarded<T>(work: impl FnOnce() -> T) -> Result<T, Verdict> {
    caught(work).map_err(|text| Verdict::new(Status::Panicked, format!("panicked: {text}")))
}

/// Why there is nothing to ask.
fn not_built(error: BuildError) -> Verdict {
    let status = match error {
        BuildError::Panicked { .. } => Status::Panicked,
        _ => Status::Refused,
    };
    Verdict::new(status, error.to_string())
}
