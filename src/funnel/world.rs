//! What the stages of a funnel work on: a scene with everything built once, the views
//! of a path, and each back end as something that can be asked.

use std::borrow::Cow;
use std::cell::RefCell;
use std::sync::Arc;

use glam::DVec3;

use super::back_ends::back_ends;
use super::chain::Chain;
use super::error::FunnelError;
use super::hiding::{HIDING, HidingRow};
use super::judged::{Judged, judge_items};
use super::plan_view::{Fate, MOST_DRAWN, PlanView};
use super::regions::Regions;
use super::stage::{BackEnd, NONE, StageKind};
use super::truth::Truth;
use crate::camera::PlaneOptions;
use crate::geometry::ConvexVolume;
use crate::index::{BuildError, DynIndex, Execution, StructureSpec};
use crate::kernel::Kernel;
use crate::measure::{Protocol, WorkloadError, input_of};
use crate::path::CameraPath;
use crate::query::ItemId;
use crate::scene::{ItemShape, Scene, Surfaces};
use crate::visibility::fragment::{self, CutOuts};
use crate::visibility::hiders::Hiders;
use crate::visibility::inscribed::BOXES;
use crate::visibility::occlusion::{self, OccluderChoice, OccluderScene};
use crate::visibility::region::{EyePlace, Marks, Pvs, RegionRow, Scratch};
use crate::visibility::{Guarantee, Rays, SampleGrid, Solids, holes_of, surfaces_of};

/// What a funnel is studied on.
#[derive(Clone, Copy)]
pub struct FunnelInput<'a> {
    /// Items.
    pub scene: &'a Scene,
    /// Views.
    pub path: &'a CameraPath,
    /// Most views, evenly spread over the path.
    pub most_views: usize,
    /// Where it is looked whether an item is visible.
    pub samples: SampleGrid,
    /// Items that have holes.
    pub cut_outs: Option<&'a CutOuts>,
    /// The item whose face is a mirror.
    pub mirror: Option<ItemId>,
    /// What each stage is done by.
    pub chain: &'a Chain,
    /// Structures for the object stage; one of them is the chain's.
    pub structures: &'a [StructureSpec],
    /// Rounds and times of a process.
    pub protocol: &'a Protocol,
    /// What is claimed to be seen from each region: a back end of the region stage.
    pub claim: Option<&'a Arc<Pvs>>,
    /// What `hierarchical-z` draws.
    pub occluders: OccluderChoice,
    /// How many boxes are looked for inside each item of a mesh, at least 1; `None` for
    /// [`BOXES`].
    pub inner_boxes: Option<usize>,
    /// Instructions of every stage, and threads that look for the truth.
    pub execution: Execution,
}

/// Answers a stage in a view from what it is given (`None`: all items), appending to
/// an empty output.
pub type Run<'w> = Box<dyn Fn(usize, Option<&[ItemId]>, &mut Vec<ItemId>) + 'w>;

/// A scene and the views of a path, ready for every back end.
pub struct World<'a> {
    /// The scene itself.
    pub scene: &'a Scene,
    /// The instructions of every stage.
    pub kernel: Kernel,
    /// Where it is looked whether an item is visible.
    pub samples: SampleGrid,
    structures: Vec<(String, Box<dyn DynIndex>)>,
    views: Vec<View>,
    /// The items as they hide each other, if they are solid boxes.
    pub solids: Option<Solids>,
    /// Which items have holes, if any have.
    pub cut_outs: Option<fragment::Surfaces>,
    /// The triangles of the items, if they are no solid boxes; of a map also those of its
    /// floors and ceilings, behind the items.
    pub surfaces: Option<Arc<Surfaces>>,
    /// What hides the items.
    pub hiders: Hiders,
    choice: OccluderChoice,
    /// The regions of the scene.
    pub(super) regions: Option<Regions>,
}

/// A camera in every form that a stage needs.
struct View {
    /// Its place in the path.
    camera: usize,
    volume: ConvexVolume,
    rays: Rays,
}

impl<'a> World<'a> {
    /// Builds all that is asked for.
    ///
    /// # Errors
    /// A structure that refuses the scene, a camera without frustum or rays.
    pub fn new(input: &FunnelInput<'a>) -> Result<World<'a>, FunnelError> {
        let around = input.scene.surroundings();
        let all = &input.path.cameras;
        let count = all.len().min(input.most_views.max(1));
        let chosen = (0..count).map(|k| k * all.len() / count);
        let views = chosen.map(|index| {
            let camera = &all[index];
            let error = |error| FunnelError::Rays {
                place: input.path.place(index),
                error,
            };
            let volume = camera.volume(&PlaneOptions::default(), &around);
            Ok(View {
                camera: index,
                volume: volume.map_err(|error| WorkloadError {
                    place: input.path.place(index),
                    error: error.into(),
                })?,
                rays: Rays::of(camera).map_err(error)?,
            })
        });
        let built = input.structures.iter().map(|spec| {
            let index = spec.build(input_of(input.scene, &input.scene.items))?;
            Ok::<_, BuildError>((spec.label.clone(), index))
        });
        let is_boxes = input.scene.item_shape() == ItemShape::Box;
        let mut solids = is_boxes.then(|| Solids::of(input.scene));
        let regions = Regions::of(input.scene, input.claim)?;
        let refused = |option: &'static str, expected: ItemShape| FunnelError::Shape {
            scene: input.scene.name.clone(),
            shape: input.scene.item_shape(),
            expected,
            option,
        };
        if input.claim.is_some() && regions.is_none() {
            let scene = input.scene.name.clone();
            return Err(FunnelError::NoRegions { scene });
        }
        let cut_outs = match (input.cut_outs, &mut solids) {
            (None, _) => None,
            (Some(typed), Some(solids)) => {
                let graph = regions.as_ref().map(Regions::graph);
                let holes = holes_of(typed, input.scene, graph);
                let items = 0..input.scene.items.len() as ItemId;
                items
                    .filter(|&item| holes.of(item).is_some())
                    .for_each(|item| solids.hides_nothing(item));
                Some(holes)
            }
            (Some(_), None) => return Err(refused("--cut-out", ItemShape::Box)),
        };
        let surfaces = surfaces_of(input.scene);
        if let Some(item) = input.mirror {
            let Some(solids) = &solids else {
                return Err(refused("--mirror", ItemShape::Box));
            };
            if item as usize >= solids.boxes.len() {
                return Err(FunnelError::NoMirror {
                    item,
                    scene: input.scene.name.clone(),
                    items: solids.boxes.len(),
                });
            }
        }
        if input.inner_boxes.is_some() && input.scene.item_shape() != ItemShape::Mesh {
            return Err(refused("--inner-boxes", ItemShape::Mesh));
        }
        let hiders = Hiders::of(
            input.scene,
            solids.as_ref(),
            input.inner_boxes.unwrap_or(BOXES),
            input.execution.threads,
        );
        let world = World {
            scene: input.scene,
            kernel: input.execution.kernel,
            samples: input.samples,
            structures: built.collect::<Result<_, _>>()?,
            views: views.collect::<Result<_, FunnelError>>()?,
            solids,
            cut_outs,
            surfaces,
            hiders,
            choice: input.occluders,
            regions,
        };
        for stage in StageKind::OF_ITEMS {
            let (name, known) = (input.chain.of(stage), world.names(stage));
            if !known.iter().any(|other| other == name) {
                return Err(FunnelError::Absent {
                    stage,
                    name: name.to_owned(),
                    known: known.join(", "),
                });
            }
        }
        Ok(world)
    }

    /// How many views there are.
    pub fn views(&self) -> usize {
        self.views.len()
    }

    /// The items as the occlusion stage draws and tests them in a view.
    pub fn occluders(&self, view: usize) -> &OccluderScene {
        let is_open = self
            .hiders
            .is_open(self.rays(view), || self.is_inside(view));
        self.hiders.from_eye(is_open)
    }

    /// The six planes of a view.
    pub fn volume(&self, view: usize) -> &ConvexVolume {
        &self.views[view].volume
    }

    /// A back end of the region stage, if the scene has it.
    pub fn region_row(&self, name: &str) -> Option<&dyn RegionRow> {
        self.regions.as_ref()?.row(name)
    }

    /// The structures of the object stage under their labels.
    pub fn structures(&self) -> impl Iterator<Item = (&str, &dyn DynIndex)> {
        let structures = self.structures.iter();
        structures.map(|(label, index)| (&label[..], &**index))
    }

    /// Whether a view's eye, and all that is before its near plane, is in the regions of
    /// the scene.
    pub fn is_inside(&self, view: usize) -> bool {
        let regions = self.regions.as_ref();
        regions.is_some_and(|regions| regions.graph().homes(self.rays(view), &mut Vec::new()))
    }

    /// The place of a view's camera in the path.
    pub fn camera(&self, view: usize) -> usize {
        self.views[view].camera
    }

    /// The rays of a view.
    pub fn rays(&self, view: usize) -> &Rays {
        &self.views[view].rays
    }

    /// How many items there are.
    pub fn items(&self) -> usize {
        self.scene.items.len()
    }

    /// The back ends of a stage that the scene can have, but for structures.
    pub fn back_ends(&self, stage: StageKind) -> Vec<BackEnd> {
        back_ends(stage, self.scene, self.cut_outs.is_some())
    }

    /// The names of the back ends of a stage that are compared.
    pub fn names(&self, stage: StageKind) -> Vec<String> {
        let rows = self.back_ends(stage).into_iter();
        let mut names: Vec<String> = rows.map(|row| row.name.to_owned()).collect();
        if stage == StageKind::Object {
            names.extend(self.structures.iter().map(|(label, _)| label.clone()));
        }
        if stage == StageKind::Region {
            let there: Vec<_> = self.regions.iter().flat_map(Regions::names).collect();
            names.retain(|name| name == NONE || there.contains(&name.as_str()));
        }
        names
    }

    /// What a back end declares.
    pub fn back_end(&self, stage: StageKind, name: &str) -> BackEnd {
        let found = self
            .back_ends(stage)
            .into_iter()
            .find(|row| row.name == name);
        let frustum = ["frustum", "the six-plane test by a structure"];
        found.unwrap_or(BackEnd::of(stage, frustum, Guarantee::Conservative))
    }

    /// A back end, ready to be asked.
    ///
    /// # Panics
    /// If there is no such back end.
    pub fn run(&self, stage: StageKind, name: &str) -> Run<'_> {
        match stage {
            StageKind::Region => self.run_region(name),
            StageKind::Object => self.run_object(name),
            StageKind::Occlusion => self.run_occlusion(name),
            StageKind::Triangle | StageKind::Fragment => unreachable!("no stage of whole items"),
        }
    }

    fn run_region(&self, name: &str) -> Run<'_> {
        let regions = self.regions.as_ref().expect("a scene with regions");
        let row = regions.row(name).expect("a row of the region stage");
        let items = regions.items();
        let kept = RefCell::new((Scratch::default(), Marks::default(), Vec::new()));
        Box::new(move |view, _, out| {
            let (scratch, marks, seen) = &mut *kept.borrow_mut();
            match row.from_eye(&self.views[view].rays, scratch, seen) {
                EyePlace::Inside => items.of_regions(seen, marks, out),
                _ => out.extend(0..self.items() as ItemId),
            }
        })
    }

    fn run_object(&self, name: &str) -> Run<'_> {
        let found = self.structures.iter().find(|(label, _)| label == name);
        let (_, index) = found.expect("a structure that was built");
        let kept = RefCell::new((Marks::default(), Vec::new()));
        Box::new(move |view, input, out| {
            let volume = &self.views[view].volume;
            match input {
                None => index.visible(volume, out),
                // What the structure finds in the whole scene, of these.
                Some(items) => {
                    let (marks, found) = &mut *kept.borrow_mut();
                    found.clear();
                    index.visible(volume, found);
                    marks.clear(self.items());
                    for &id in found.iter() {
                        marks.insert(id);
                    }
                    out.extend(items.iter().filter(|&&id| marks.holds(id)));
                }
            }
        })
    }

    fn run_occlusion(&self, name: &str) -> Run<'_> {
        let row = HIDING.iter().find(|row| row.back_end.name == name);
        self.run_hiding(row.expect("a row of the occlusion stage"), self.samples)
    }

    /// A back end of the occlusion stage with a buffer of so many pixels.
    pub fn run_hiding(&self, row: &HidingRow, buffer: SampleGrid) -> Run<'_> {
        let hide = RefCell::new((row.make)(buffer, self.kernel, self.choice));
        let does_both = row.back_end.does_object_stage;
        let every: Vec<ItemId> = (0..self.items() as ItemId).collect();
        let views = 0..self.views();
        let occluders: Vec<_> = views.map(|view| self.occluders(view)).collect();
        Box::new(move |view, input, out| {
            let occluders = occluders[view];
            let View { rays, volume, .. } = &self.views[view];
            let view = occlusion::View::new(rays, volume, occluders, buffer);
            let items = input.unwrap_or(&every);
            hide.borrow_mut().hide(occluders, &view, items, out);
            // It has looked beyond the regions that are seen.
            if does_both && self.regions.is_some() && input.is_some() {
                out.retain(|id| items.binary_search(id).is_ok());
            }
        })
    }

    /// What a stage made of its input in a view: what it was given and what it handed on.
    pub fn judge(
        &self,
        view: usize,
        [input, output]: [Option<&[ItemId]>; 2],
        truth: &Truth,
    ) -> Judged {
        let output = self.listed(output);
        judge_items(input, self.items(), &output, truth.of_view(view))
    }

    /// The ids of a set; `None` is all items.
    pub fn listed<'i>(&self, items: Option<&'i [ItemId]>) -> Cow<'i, [ItemId]> {
        match items {
            Some(items) => items.into(),
            None => (0..self.items() as ItemId).collect::<Vec<_>>().into(),
        }
    }

    /// Whether a row of the occlusion stage does the object stage as well.
    pub fn does_object_stage(&self, name: &str) -> bool {
        self.back_end(StageKind::Occlusion, name).does_object_stage
    }

    /// The items about the eye of a view, each with its fate.
    pub fn plan_view(&self, view: usize, fate: impl Fn(ItemId) -> Fate) -> PlanView {
        let Some(view) = self.views.get(view) else {
            return PlanView::default();
        };
        let eye = view.rays.camera().frame.eye;
        let flat = |v: DVec3| [v.x, v.y];
        let boxes = self
            .scene
            .items
            .iter()
            .zip(0..)
            .filter(|(b, _)| !b.is_empty());
        let mut near: Vec<(f64, [f64; 4], ItemId)> = boxes
            .map(|(b, item)| {
                let (min, max) = b.in_world(self.scene.origin);
                let nearest = eye.clamp(min, max).with_z(eye.z);
                (nearest.distance(eye), [min.x, min.y, max.x, max.y], item)
            })
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
        near.truncate(MOST_DRAWN);
        PlanView {
            eye: flat(eye),
            edges: [0.0, 1.0].map(|x| flat(view.rays.through(x, 0.5).direction)),
            items: near
                .iter()
                .rev()
                .map(|(_, plan, item)| (*plan, fate(*item)))
                .collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::Row;
    use crate::path::{self, LensDefaults};
    use crate::scene;

    /// A structure that finds nothing, beside one that is right: what is behind a region
    /// stage is asked of each.
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
        let input = FunnelInput {
            scene: &scene,
            path: &path.expect("a path"),
            most_views: 3,
            samples: SampleGrid::new(8, 5),
            cut_outs: None,
            mirror: None,
            chain: &Chain::for_scene(&scene, false).with(StageKind::Object, "linear"),
            structures: &[LINEAR(), blind],
            protocol: &Protocol {
                rounds: [1, 1],
                task_ns: 1e6,
                cameras: 3,
                cold: false,
                seed: 1,
                cache_bytes: 0,
            },
            claim: None,
            occluders: OccluderChoice::All,
            inner_boxes: None,
            execution: Execution::default(),
        };
        let world = World::new(&input).expect("a world");
        let mut found = 0;
        for view in 0..world.views() {
            let (mut left, mut right, mut none) = (Vec::new(), Vec::new(), Vec::new());
            world.run(StageKind::Region, "flood")(view, None, &mut left);
            world.run(StageKind::Object, "linear")(view, Some(&left), &mut right);
            world.run(StageKind::Object, "blind")(view, Some(&left), &mut none);
            let sees = |id: &ItemId| world.volume(view).sees(&scene.items[*id as usize]);
            let wanted: Vec<ItemId> = left.iter().copied().filter(sees).collect();
            assert_eq!((right, none), (wanted.clone(), vec![]));
            found += wanted.len();
        }
        assert!(found > 0);
    }
}
