//! Scene, cameras and fastest tree, the input of all rules.

use anyhow::{Result, ensure};
use glam::{DVec3, Vec3};

use crate::camera::{Camera, PlaneOptions, Surroundings};
use crate::culling::{CameraView, Culling, CullingError, CullingTest};
use crate::funnel::check_memory;
use crate::geometry::ConvexVolume;
use crate::index::{BuildError, DynIndex, Execution, StructureSpec};
use crate::input::InputError;
use crate::measure::{Setting, Workload, input_for, input_of, spread};
use crate::motion::Motion;
use crate::path::{CameraPath, evenly};
use crate::scene::{Scene, WorldBox};
use crate::verify::Truth;

/// Most verdicts of the oracle, which take some 50 ns each.
const MAX_TRUTHS: usize = 1_000_000;

pub struct Case<'a> {
    pub workload: &'a Workload<'a>,
    pub path: &'a CameraPath,
    /// Fastest tree or grid.
    pub spec: StructureSpec,
    pub index: Box<dyn DynIndex>,
    /// Fastest scan.
    pub scan: StructureSpec,
    /// Structure taken by six planes.
    pub taken: StructureSpec,
}

impl<'a> Case<'a> {
    pub fn new(
        all: &AdviseInput<'a>,
        workload: &'a Workload<'a>,
        labels: &[String; 3],
    ) -> Result<Case<'a>, BuildError> {
        let setting = all.setting;
        let spec = |label| spec_of(&setting.structures, label);
        let [spec, scan, taken] = labels.each_ref().map(|label| spec(label));
        Ok(Case {
            index: spec.build(input_of(workload.scene, &workload.scene.items))?,
            workload,
            path: &setting.path,
            spec,
            scan,
            taken,
        })
    }

    /// Cameras of the path with their truth, evenly spread.
    pub fn truths(&self) -> Vec<(usize, Truth)> {
        let Workload { scene, cameras, .. } = self.workload;
        let judged = spread(scene.items.len(), MAX_TRUTHS, self.workload.views.len());
        let truths = judged.filter_map(|camera| {
            let truth = Truth::of_scene(&cameras[camera], scene)?;
            Some((camera, truth))
        });
        truths.collect()
    }

    /// Six-plane volumes of the path.
    pub fn volumes(&self) -> impl Iterator<Item = &ConvexVolume> {
        self.workload.views.iter().filter_map(|view| match view {
            CameraView::Volume(volume) => Some(volume),
            _ => None,
        })
    }

    /// Views of the path with another culling.
    pub fn views_by(&self, culling: &Culling) -> Result<Vec<CameraView>, CullingError> {
        let cameras = self.workload.cameras.iter();
        let view = |camera| culling.view(camera, &self.workload.around);
        cameras.map(view).collect()
    }

    /// Builds a structure over the items as a culling test indexes them.
    pub fn built(&self, spec: &StructureSpec, test: CullingTest) -> Result<Box<dyn DynIndex>> {
        let scene = self.workload.scene;
        let items = test.items(&scene.items);
        Ok(spec.build(input_for(test, scene, &items))?)
    }

    /// Depth of a camera's view, at most that of the scene.
    ///
    /// If the scene is a point, the eye's distance from it; never zero.
    fn depth(&self, camera: &Camera) -> f64 {
        let Scene { bounds, origin, .. } = self.workload.scene;
        let [low, high] = [bounds.min, bounds.max].map(Vec3::as_dvec3);
        let depths = [high, camera.frame.eye - *origin].map(|end| end.distance(low));
        let depth = depths.into_iter().find(|depth| *depth > 0.0);
        let depths = camera.lens.far().into_iter().chain(depth);
        depths.reduce(f64::min).unwrap_or(1.0)
    }

    /// Largest outward displacement of the planes for rounding, in view depths.
    ///
    /// The maximum over all cameras and planes.
    pub fn margin(&self, around: &Surroundings) -> f64 {
        let options = PlaneOptions::default();
        let margins = self.workload.cameras.iter().filter_map(|camera| {
            // A far plane may be far beyond all items.
            let lens = camera.lens.with_far(None).unwrap_or(camera.lens);
            let open = Camera { lens, ..*camera };
            let moved = open.volume(&options, around).ok()?;
            let derived = open.volume(&options.without_epsilon(), around).ok()?;
            let planes = moved.planes().iter().zip(derived.planes());
            let apart = planes.map(|(a, b)| f64::from(a.d) - f64::from(b.d));
            Some(apart.fold(0.0, f64::max) / self.depth(camera))
        });
        margins.fold(0.0, f64::max)
    }
}

/// Evenly spread boxes of a scene about another origin, rounded outward again.
pub fn subset(scene: &Scene, origin: DVec3, count: usize) -> Result<Scene, InputError> {
    let boxes = evenly(scene.items.len(), count);
    let boxes = boxes.map(|id| WorldBox::of(&scene.items[id], scene.origin));
    let boxes: Vec<WorldBox> = boxes.collect();
    Ok(Scene {
        up: scene.up,
        ..Scene::about(scene.name.clone(), &boxes, origin)?
    })
}

/// Largest acceptable error of planes (in view depths) and of a camera's axes.
pub(super) const TOLERANCE: f64 = 1e-5;
/// Reason why rules about nodes do not apply.
pub(super) const NO_NODES: &str = "the structure taken has no nodes";

/// Bytes per item of the structures and trees of all rules; 950 were measured.
const BYTES_PER_ITEM: u64 = 1000;

/// Scene, path and options.
#[derive(Clone, Copy)]
pub struct AdviseInput<'a> {
    /// Scene, cameras, structures to choose from, rounds and times of a process.
    pub setting: &'a Setting,
    /// Motion of the items, as a file or spec; `None` for a still scene.
    pub motion: Option<&'a str>,
    /// Number of queries per frame.
    pub views: usize,
    /// Cost of drawing an item that is not visible, ns.
    pub draw_ns: f64,
}

impl<'a> AdviseInput<'a> {
    /// Queries of the path.
    ///
    /// # Errors
    /// A path without cameras, an unfit motion.
    pub fn workload(&self) -> Result<Workload<'a>> {
        let Setting { scene, path, .. } = self.setting;
        ensure!(
            !path.cameras.is_empty(),
            "path '{}' has no cameras; expected at least one",
            path.name
        );
        check_memory(&scene.name, BYTES_PER_ITEM * scene.items.len() as u64)?;
        let motion = self.motion.map(|motion| Motion::load(motion, scene));
        let (motion, culling) = (motion.transpose()?, Culling::default());
        let motion = motion.inspect(|own| own.tell_numbers(path, self.views));
        Ok(Workload::moving(scene, path, &culling, motion, self.views)?)
    }
}

/// Structure that a plan names by its label.
///
/// From the list; else from the list with an added policy (`wide@rebuild`); else from this crate.
pub(super) fn spec_of(structures: &[StructureSpec], label: &str) -> StructureSpec {
    let (alone, policy) = label.split_once('@').unwrap_or((label, ""));
    let named = |name: &str| structures.iter().find(|spec| spec.label == name).cloned();
    let Some(mut spec) = named(label).or_else(|| named(alone)) else {
        let execution = structures.first().map(|spec| spec.execution);
        let name = if alone == SCAN { SCAN } else { TREE };
        return default_of(name, execution.unwrap_or_default());
    };
    spec.policy = policy.parse().unwrap_or(spec.policy);
    label.clone_into(&mut spec.label);
    spec
}

/// Structures used by the rules if the list has no tree or no scan.
pub(super) const TREE: &str = "wide";
pub(super) const SCAN: &str = "linear";

/// Structure of this crate with its default parameters.
pub(super) fn default_of(name: &'static str, execution: Execution) -> StructureSpec {
    let spec = StructureSpec::parse(name).expect("a name of this crate's own");
    spec.by(execution)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path;
    use crate::scene;

    #[test]
    fn the_tree_of_the_sphere_test_has_spheres() {
        let scene = scene::load("city:n=300", &Default::default()).unwrap();
        let path = path::load("orbit:frames=2", &scene, &Default::default()).unwrap();
        let workload = Workload::new(&scene, &path, &Culling::default()).unwrap();
        let spec = StructureSpec::parse("wide").unwrap();
        let case = Case {
            workload: &workload,
            path: &path,
            index: spec.build(&scene.items).unwrap(),
            scan: spec.clone(),
            taken: spec.clone(),
            spec: spec.clone(),
        };
        let bytes = |test| case.built(&spec, test).unwrap().memory().total();
        // Centre and radius of each item.
        assert!(bytes(CullingTest::Sphere) - bytes(CullingTest::SixPlane) >= 300 * 16);
    }
}
