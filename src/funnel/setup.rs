//! Scene, views and structures of a study, built once for all back ends.

use std::ops::Range;
use std::sync::Arc;

use anyhow::{Result, bail, ensure};

use super::error::check_memory;
use super::stage::{BackEnd, Chain, NONE, PORTAL_RECT, StageKind, back_ends, left_out_of};
use crate::camera::{CameraError, PlaneOptions};
use crate::geometry::{Aabb, ConvexVolume};
use crate::index::{BuildError, DynIndex, Execution, StructureSpec};
use crate::kernel::Kernel;
use crate::measure::{Setting, WorkloadError, input_of};
use crate::path::evenly;
use crate::scene::{self, ItemShape, LoadOptions, Scene, Surfaces, WorldBox};
use crate::shown::{counted, significant};
use crate::visibility::fragment::{self, CutOuts};
use crate::visibility::inner_boxes::BOXES;
use crate::visibility::occluders::SceneOccluders;
use crate::visibility::occlusion::OccluderTree;
use crate::visibility::region::doom::DoomMap;
use crate::visibility::region::{Pvs, RegionGraph, RegionItems};
use crate::visibility::{Guarantee, Rays, SampleGrid, Solids, surfaces_of};

/// Bytes per item: structure, solids, occluders and trees for rays.
///
/// 730 were measured for boxes with one structure.
const BYTES_PER_ITEM: u64 = 750;

/// Bytes per pair of regions in a table and its list; all pairs may be stored.
const BYTES_PER_PAIR: u64 = 8;

/// Largest displacement by f32 without a warning, relative to the longest edge.
const MOST_MOVED: f64 = 1.0 / 64.0;

/// Scene, path and options of a study.
#[derive(Clone)]
pub struct FunnelInput<'a> {
    /// Scene, cameras, rounds and times of a process.
    pub setting: &'a Setting,
    /// Most views, evenly spread over the path.
    pub most_views: usize,
    /// Samples of a view, which decide which items are visible.
    pub samples: SampleGrid,
    /// Items that have holes.
    pub cut_outs: Option<&'a CutOuts>,
    /// Back end of each stage.
    pub chain: Chain,
    /// Structures for the object stage; the chain uses one of them.
    pub structures: &'a [StructureSpec],
    /// Most boxes inside each item of a mesh, at least 1; `None` for [`BOXES`].
    pub inner_boxes: Option<usize>,
    /// How the scene was loaded; the other levels of its file are loaded alike.
    pub loading: LoadOptions,
    /// Instruction set of every stage, and threads that compute the truth.
    pub execution: Execution,
    /// Measures every back end of every stage in addition to the chain.
    pub all: bool,
    /// Measures picking, if `all` is set.
    pub picks: bool,
}

impl<'a> FunnelInput<'a> {
    /// Input for all measurements around a chain, on at most `most_views` views.
    pub fn new(
        setting: &'a Setting,
        chain: Chain,
        (most_views, samples): (usize, SampleGrid),
        execution: Execution,
    ) -> FunnelInput<'a> {
        FunnelInput {
            setting,
            most_views,
            samples,
            cut_outs: None,
            chain,
            structures: &setting.structures,
            inner_boxes: None,
            loading: LoadOptions::default(),
            execution,
            all: true,
            picks: true,
        }
    }
}

/// Geometry of the items as rays meet them.
pub enum Shape {
    /// Solid boxes.
    Boxes(Solids),
    /// Triangles of a mesh, or of a map with floors and ceilings after the items.
    Triangles(Arc<Surfaces>),
}

impl Shape {
    /// Geometry of the items of a scene.
    pub fn of(scene: &Scene) -> Shape {
        match surfaces_of(scene) {
            None => Shape::Boxes(Solids::of(scene)),
            Some(surfaces) => Shape::Triangles(surfaces),
        }
    }

    /// Solid boxes, if the items are solid boxes.
    pub fn boxes(&self) -> Option<&Solids> {
        match self {
            Shape::Boxes(solids) => Some(solids),
            Shape::Triangles(_) => None,
        }
    }
}

/// A camera of the path.
pub struct PathView {
    /// Index in the path.
    pub camera: usize,
    pub volume: ConvexVolume,
    pub rays: Rays,
}

/// A scene and the views of a path, prepared for every back end.
pub struct Setup<'a> {
    pub scene: &'a Scene,
    pub kernel: Kernel,
    pub samples: SampleGrid,
    pub views: Vec<PathView>,
    pub shape: Shape,
    /// Items that have holes, if any.
    pub cut_outs: Option<fragment::AlphaMasks>,
    /// Occluders of the scene.
    pub occluders: SceneOccluders,
    pub regions: Option<Regions>,
    /// Structures of the object stage with their specs.
    pub structures: Vec<(&'a StructureSpec, Box<dyn DynIndex>)>,
    /// Chain whose back ends are the only ones; `None` for all.
    only: Option<Chain>,
}

impl<'a> Setup<'a> {
    /// Builds structures, regions and occluders; `begin` gets the name of each step.
    ///
    /// # Errors
    /// Options that do not fit the scene, a camera without frustum or rays, a structure that
    /// rejects the scene.
    pub fn new(input: &FunnelInput<'a>, begin: &dyn Fn(&str)) -> Result<Setup<'a>> {
        check_options(input)?;
        let scene = &input.setting.scene;
        let views = views(input)?;
        let regions = regions(input)?;
        check_chain(input, regions.as_ref())?;
        let ids = 2 * views.len() * (input.structures.len() + StageKind::ALL.len());
        let needed = (BYTES_PER_ITEM + ids as u64) * scene.items.len() as u64;
        check_memory(&scene.name, needed)?;
        let mut shape = Shape::of(scene);
        begin("structures");
        let built = input.structures.iter().map(|spec| {
            let index = spec.build(input_of(scene, &scene.items))?;
            Ok::<_, BuildError>((spec, index))
        });
        let structures = built.collect::<Result<_, _>>()?;
        let mut cut_outs = None;
        if let (Some(typed), Shape::Boxes(solids)) = (input.cut_outs, &mut shape) {
            // The next room is visible through portals only, so walls have no holes.
            let walls = regions.as_ref().map(|regions| regions.graph.borders(scene));
            let is_free = |item| walls.as_ref().is_none_or(|walls| !walls[item as usize]);
            let masks = typed.masks(scene.items.len(), is_free);
            // An item with holes may be hidden but hides nothing.
            let all = solids.inner.iter_mut().zip(&masks.of_item);
            for (inner, _) in all.filter(|(_, hole)| hole.is_some()) {
                *inner = Aabb::EMPTY;
            }
            cut_outs = Some(masks);
        }
        begin("occluders");
        let most = input.inner_boxes.unwrap_or(BOXES);
        Ok(Setup {
            occluders: SceneOccluders::of(scene, shape.boxes(), most, input.execution.threads),
            scene,
            kernel: input.execution.kernel,
            samples: input.samples,
            views,
            shape,
            cut_outs,
            regions,
            structures,
            only: (!input.all).then(|| input.chain.clone()),
        })
    }

    /// Indices of the views.
    pub fn views(&self) -> Range<usize> {
        0..self.views.len()
    }

    pub fn rays(&self, view: usize) -> &Rays {
        &self.views[view].rays
    }

    /// Number of items.
    pub fn items(&self) -> usize {
        self.scene.items.len()
    }

    /// Occluders valid for a view.
    pub fn occluders(&self, view: usize) -> &OccluderTree {
        let rays = self.rays(view);
        let is_inside = || {
            let regions = self.regions.as_ref();
            regions.is_some_and(|regions| regions.graph.homes(rays, &mut Vec::new()))
        };
        self.occluders
            .from_eye(self.occluders.is_open(rays, is_inside))
    }

    /// Warning about items in view that f32 moves by much of their longest edge.
    pub fn rounded(&self) -> Option<String> {
        let surfaces = self.scene.surfaces.as_ref()?;
        let share = |(item, b): (usize, WorldBox)| {
            let own = WorldBox::of(&surfaces.bounds(item), surfaces.origin);
            // A box may be wider than its triangles, like that of a patch's control points.
            let moved = (b.min - own.min).max(own.max - b.max);
            let share = moved.max_element() / (b.max - b.min).max_element();
            let is_seen = |view: &PathView| view.volume.sees(&self.scene.items[item]);
            // A point has no edge.
            let share = Some(share).filter(|share| share.is_finite() && *share > MOST_MOVED);
            share.filter(|_| self.views.iter().any(is_seen))
        };
        let shares: Vec<f64> = self.scene.written().enumerate().filter_map(share).collect();
        let most = shares.iter().copied().reduce(f64::max)?;
        Some(format!(
            "{}: f32 moves corners of {} in view by up to {} % of the longest edge: visible items may \
             count as hidden; expected a smaller extent",
            self.scene.name,
            counted(shares.len(), "item"),
            significant(most * 100.0)
        ))
    }

    /// Back ends that the scene can have in a stage, without structures.
    pub fn back_ends(&self, stage: StageKind) -> Vec<BackEnd> {
        back_ends(stage, self.scene, self.cut_outs.is_some())
    }

    /// Compared back ends of a stage, each with its own or its structure's name.
    pub fn rows(&self, stage: StageKind) -> Vec<(BackEnd, String)> {
        let labels = self.structures.iter().map(|(spec, _)| &spec.label);
        let mut rows = rows(self.back_ends(stage), self.regions.as_ref(), labels);
        if let Some(chain) = &self.only {
            rows.retain(|(_, name)| chain.of(stage) == name);
        }
        rows
    }
}

/// Back ends of a stage in a scene, with structures for the object stage.
fn rows<'l>(
    back_ends: Vec<BackEnd>,
    regions: Option<&Regions>,
    labels: impl Iterator<Item = &'l String>,
) -> Vec<(BackEnd, String)> {
    let stage = back_ends[0].stage;
    let is_there = |row: &BackEnd| {
        let is_row = || regions.is_some_and(|regions| regions.pairs(row.name).is_some());
        stage != StageKind::Region || row.name == NONE || is_row()
    };
    let there = back_ends.into_iter().filter(is_there);
    let frustum = ["frustum", "the six-plane test by a structure"];
    let frustum = BackEnd::new(stage, frustum, Guarantee::Conservative);
    let structures = labels.filter(|_| stage == StageKind::Object);
    let structures = structures.map(|label| (frustum, label.clone()));
    let there = there.map(|row| (row, row.name.to_owned()));
    there.chain(structures).collect()
}

/// Views evenly spread over the path.
fn views(input: &FunnelInput) -> Result<Vec<PathView>> {
    let Setting { scene, path, .. } = input.setting;
    let (around, all) = (scene.surroundings(), &path.cameras);
    let views = evenly(all.len(), input.most_views.max(1)).map(|index| {
        let refused = |error: CameraError| WorkloadError {
            place: path.place(index),
            error: error.into(),
        };
        let rays = Rays::of(&all[index]).map_err(refused)?;
        // Planes and rays come from the same numbers, also for a matrix camera.
        let volume = rays.camera.volume(&PlaneOptions::default(), &around);
        let volume = volume.map_err(refused)?;
        Ok(PathView {
            camera: index,
            volume,
            rays,
        })
    });
    views.collect()
}

/// Rejects back ends of the item stages that the scene cannot have.
fn check_chain(input: &FunnelInput, regions: Option<&Regions>) -> Result<()> {
    let scene = &input.setting.scene;
    for stage in StageKind::OF_ITEMS {
        let labels = input.structures.iter().map(|spec| &spec.label);
        let known = rows(back_ends(stage, scene, false), regions, labels);
        let name = input.chain.of(stage);
        if !known.iter().any(|(_, known)| known == name) {
            let known: Vec<String> = known.into_iter().map(|(_, name)| name).collect();
            let why = left_out_of(scene).filter(|row| row.name == name);
            let why = why.map_or(String::new(), |row| format!(" ({})", row.reason));
            let (stage, known) = (stage.name(), known.join(", "));
            bail!(
                "{stage} '{name}' needs what the scene does not have{why}; expected one of {known}"
            );
        }
    }
    Ok(())
}

/// Rejects options that the items of the scene cannot have.
fn check_options(input: &FunnelInput) -> Result<()> {
    let scene = &input.setting.scene;
    let (name, shape) = (&scene.name, scene.item_shape());
    let inner_boxes = input.inner_boxes.is_some();
    for (option, is_given, expected) in [
        ("--cut-out", input.cut_outs.is_some(), ItemShape::Box),
        ("--inner-boxes", inner_boxes, ItemShape::Mesh),
    ] {
        ensure!(
            !is_given || shape == expected,
            "the items of '{name}' are {}; expected a scene of {} for {option}",
            shape.name(),
            expected.name()
        );
    }
    Ok(())
}

/// Regions of the scene.
fn regions(input: &FunnelInput) -> Result<Option<Regions>> {
    let scene = &input.setting.scene;
    // A table of all pairs is large.
    let is_read = input.all || ![NONE, PORTAL_RECT].contains(&input.chain.of(StageKind::Region));
    let listed = match &scene.regions {
        scene::Regions::Bsp(map) if !map.reject.is_empty() => map.sectors.len() as u64,
        scene::Regions::Leaves(map) if map.sees().is_some() => map.clusters as u64,
        _ => 0,
    };
    let listed = listed * u64::from(is_read);
    check_memory(&scene.name, BYTES_PER_PAIR * listed.saturating_pow(2))?;
    Ok(Regions::of(scene, is_read))
}

/// Regions of a scene: rooms, or the sectors or clusters of its map.
pub struct Regions {
    /// Regions and the openings between them.
    pub graph: RegionGraph,
    /// Items of each region.
    pub items: RegionItems,
    /// Pairs of regions that the map stores.
    table: Option<Pvs>,
}

impl Regions {
    /// Regions of a scene, with the items of each.
    ///
    /// `None` without regions, and for a map whose linedefs contradict each other.
    pub fn of(scene: &Scene, with_table: bool) -> Option<Regions> {
        let (graph, table) = match (DoomMap::of_scene(scene), &scene.regions) {
            (Some(map), _) => (
                map.graph().ok()?,
                with_table.then(|| map.reject()).flatten(),
            ),
            (None, scene::Regions::Leaves(map)) => (
                RegionGraph::of_quake(map),
                with_table.then(|| Pvs::of_quake(map)).flatten(),
            ),
            (None, _) => (RegionGraph::of_scene(scene)?, None),
        };
        Some(Regions {
            items: RegionItems::of(&graph, scene),
            graph,
            table,
        })
    }

    /// Stored pairs that a back end reads: `Some(None)` for a search.
    ///
    /// `None` if the map lacks them.
    pub fn pairs(&self, name: &str) -> Option<Option<&Pvs>> {
        match name {
            PORTAL_RECT => Some(None),
            _ => self.table.as_ref().map(Some),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::Row;
    use crate::measure::Protocol;
    use crate::path::{self, LensDefaults};
    use crate::query::ItemId;
    use crate::scene;

    /// Runs a structure that finds nothing, and a correct one, after a region stage.
    #[test]
    fn an_object_row_behind_a_region_stage_asks_its_structure() {
        const LINEAR: fn() -> StructureSpec = || StructureSpec::parse("linear").expect("linear");
        let blind = StructureSpec {
            label: "blind".to_owned(),
            row: Row {
                build: |_, _, _| LINEAR().build(&[][..]),
                ..LINEAR().row
            },
            ..LINEAR()
        };
        let scene = scene::load("rooms:n=500", &Default::default()).expect("rooms");
        let path = path::load("street:frames=3", &scene, &LensDefaults::default());
        let setting = Setting {
            path: path.expect("a path"),
            scene,
            structures: vec![LINEAR(), blind],
            protocol: Protocol {
                rounds: [1, 1],
                task_ns: 1e6,
                cameras: 3,
                seed: 1,
                ..Protocol::default()
            },
        };
        let scene = &setting.scene;
        let chain = Chain::for_scene(scene, &setting.structures, false);
        let views = (3, SampleGrid::new(8, 5));
        let input = FunnelInput::new(&setting, chain, views, Execution::default());
        let setup = Setup::new(&input, &|_| ()).expect("a world");
        let run = |stage, name| setup.run(stage, name, &[]);
        let mut found = 0;
        for view in setup.views() {
            let (mut left, mut right, mut none) = (Vec::new(), Vec::new(), Vec::new());
            run(StageKind::Region, "portal-rect")(view, None, &mut left);
            run(StageKind::Object, "linear")(view, Some(&left), &mut right);
            run(StageKind::Object, "blind")(view, Some(&left), &mut none);
            let sees = |id: &ItemId| setup.views[view].volume.sees(&scene.items[*id as usize]);
            let wanted: Vec<ItemId> = left.iter().copied().filter(sees).collect();
            assert_eq!((right, none), (wanted.clone(), vec![]));
            found += wanted.len();
        }
        assert!(found > 0);
    }
}
