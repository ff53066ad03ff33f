//! What the stages of a funnel work on: a scene with everything built once, the views
//! of a path, and each back end as something that can be asked.

use glam::DVec3;

use super::chain::Chain;
use super::judged::{Judged, judge_items};
use super::pass::{Step, Walked};
use super::plan_view::{Fate, MOST_DRAWN, PlanView};
use super::stage::{BackEnd, NONE, StageKind};
use crate::culling::{CameraView, Culling};
use crate::index::{BuildError, DynIndex, Execution, StructureSpec};
use crate::input::InputError;
use crate::measure::{Protocol, WorkloadError, input_of};
use crate::path::CameraPath;
use crate::query::ItemId;
use crate::scene::Scene;
use crate::visibility::truth::{RayIndex, SampleTruth};
use crate::visibility::{Guarantee, NoRays, Rays, SampleGrid, Solids};

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
    /// What each stage is done by.
    pub chain: &'a Chain,
    /// Structures for the object stage; one of them is the chain's.
    pub structures: &'a [StructureSpec],
    /// Rounds and times of a process.
    pub protocol: &'a Protocol,
    /// Instructions of every stage, and threads that look for the truth.
    pub execution: Execution,
}

/// Why there is no funnel.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FunnelError {
    /// A structure that refuses the scene.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// A camera without a frustum.
    #[error(transparent)]
    View(#[from] WorkloadError),
    /// A camera without rays.
    #[error("camera {index}: {error}")]
    Rays {
        /// Its index in the path.
        index: usize,
        /// Why.
        error: NoRays,
    },
    /// The scene's file, read a second time.
    #[error(transparent)]
    Input(#[from] InputError),
}

/// Answers a stage in a view from what it is given (`None`: all items), appending to
/// an empty output.
pub type Run<'w> = Box<dyn Fn(usize, Option<&[ItemId]>, &mut Vec<ItemId>) + 'w>;

/// A scene and the views of a path, ready for every back end.
pub struct World<'a> {
    scene: &'a Scene,
    structures: Vec<(String, Box<dyn DynIndex>)>,
    views: Vec<View>,
}

/// A camera in every form that a stage needs.
struct View {
    frustum: CameraView,
    rays: Rays,
}

/// What is visible in each view: items with the samples of each, ascending.
pub struct Truth {
    visible: Vec<Vec<(ItemId, u32)>>,
}

impl Truth {
    /// Whether an item is in front at a sample of a view.
    pub fn sees(&self, view: usize, item: ItemId) -> bool {
        let found = self.visible[view].binary_search_by_key(&item, |(item, _)| *item);
        found.is_ok()
    }
}

impl<'a> World<'a> {
    /// Builds all that is asked for.
    ///
    /// # Errors
    /// A structure that refuses the scene, a camera without frustum or rays.
    pub fn new(input: &FunnelInput<'a>) -> Result<World<'a>, FunnelError> {
        let around = input.scene.surroundings();
        let culling = Culling::default();
        let all = &input.path.cameras;
        let count = all.len().min(input.most_views.max(1));
        let chosen = (0..count).map(|k| k * all.len() / count);
        let views = chosen.map(|index| {
            let camera = &all[index];
            let error = |error| WorkloadError {
                path: input.path.name.clone(),
                index,
                error,
            };
            Ok(View {
                frustum: culling.view(camera, &around).map_err(error)?,
                rays: Rays::of(camera).map_err(|error| FunnelError::Rays { index, error })?,
            })
        });
        let built = input.structures.iter().map(|spec| {
            let index = spec.build(input_of(input.scene, &input.scene.items))?;
            Ok::<_, BuildError>((spec.label.clone(), index))
        });
        Ok(World {
            scene: input.scene,
            structures: built.collect::<Result<_, _>>()?,
            views: views.collect::<Result<_, FunnelError>>()?,
        })
    }

    /// How many views there are.
    pub fn views(&self) -> usize {
        self.views.len()
    }

    /// How many items there are.
    pub fn items(&self) -> usize {
        self.scene.items.len()
    }

    /// What each view shows at its samples; `None` if stopped.
    pub fn truth(&self, input: &FunnelInput, stop: &dyn Fn() -> bool) -> Option<Truth> {
        let solids = Solids::of(self.scene);
        let index = RayIndex::build(&solids);
        let mut visible = Vec::with_capacity(self.views());
        for view in &self.views {
            if stop() {
                return None;
            }
            let truth = SampleTruth::of(
                &solids,
                &index,
                &view.rays,
                input.samples,
                input.execution.threads,
            );
            let counts = truth.visible.into_iter().zip(truth.samples_of);
            visible.push(counts.collect());
        }
        Some(Truth { visible })
    }

    /// The back ends of a stage that are compared, the chain's among them.
    pub fn names(&self, stage: StageKind, chain: &Chain) -> Vec<String> {
        let mut names: Vec<String> = names(stage, self.scene)
            .into_iter()
            .map(str::to_owned)
            .collect();
        if stage == StageKind::Object {
            names.extend(self.structures.iter().map(|(label, _)| label.clone()));
        }
        debug_assert!(names.iter().any(|name| name == chain.of(stage)));
        names
    }

    /// What a back end declares.
    pub fn back_end(&self, stage: StageKind, name: &str) -> BackEnd {
        match (stage, name) {
            (_, NONE) => BackEnd {
                stage,
                name: NONE,
                summary: "the stage is left out",
                guarantee: Guarantee::Conservative,
                does_object_stage: false,
            },
            _ => BackEnd {
                stage,
                name: "frustum",
                summary: "the six-plane test",
                guarantee: Guarantee::Conservative,
                does_object_stage: false,
            },
        }
    }

    /// A back end, ready to be asked.
    ///
    /// # Panics
    /// If there is no such back end.
    pub fn run(&self, stage: StageKind, name: &str) -> Run<'_> {
        match stage {
            StageKind::Object => {
                let found = self.structures.iter().find(|(label, _)| label == name);
                let (_, index) = found.expect("a structure that was built");
                Box::new(move |view, input, out| {
                    let frustum = self.views[view].frustum.as_any();
                    match input {
                        None => index.query(frustum, out),
                        // What is left of a scene by other means is a short list.
                        Some(items) => out.extend(
                            items
                                .iter()
                                .filter(|&&id| frustum.sees(&self.scene.items[id as usize])),
                        ),
                    }
                })
            }
            _ => unreachable!("no back end {name}"),
        }
    }

    /// What a stage made of its input in a view.
    pub fn judge(
        &self,
        _stage: StageKind,
        view: usize,
        [input, output]: [Option<&[ItemId]>; 2],
        _is_done: bool,
        truth: &Truth,
    ) -> Judged {
        let every: Vec<ItemId>;
        let output = match output {
            Some(output) => output,
            None => {
                every = (0..self.items() as ItemId).collect();
                &every
            }
        };
        judge_items(input, self.items(), output, &truth.visible[view])
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

    /// The steps of a chain whose times add up: not the object stage where the
    /// occlusion stage does it as well.
    pub fn timed_steps(&self, walked: &Walked, steps: &[Step]) -> Vec<usize> {
        let of = |stage: StageKind| walked.steps[stage as usize];
        let occlusion = of(StageKind::Occlusion);
        let does_both = occlusion.is_some_and(|step| {
            let name = &steps[step].back_end;
            self.back_end(StageKind::Occlusion, name).does_object_stage
        });
        let object = of(StageKind::Object).filter(|_| !does_both);
        [of(StageKind::Region), object, occlusion]
            .into_iter()
            .flatten()
            .collect()
    }
}

/// The back ends of a stage that a scene can have; structures of the object stage are
/// not among them.
pub fn names(stage: StageKind, _scene: &Scene) -> Vec<&'static str> {
    let _ = stage;
    vec![NONE]
}

impl Chain {
    /// What suits a scene, but for the object stage.
    pub fn for_scene(_scene: &Scene) -> Chain {
        Chain::empty()
    }
}
