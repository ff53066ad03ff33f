//! What every rule looks at: scene, cameras, the fastest tree built over the
//! items, and on request the truth about some of the cameras. It decides nothing.

use super::AdviseOptions;
use crate::camera::PlaneOptions;
use crate::culling::{CameraView, Culling, CullingTest};
use crate::geometry::ConvexVolume;
use crate::index::{BuildError, DynIndex, StructureSpec};
use crate::measure::{Ask, Workload, WorkloadError, input_of};
use crate::path::CameraPath;
use crate::query::ItemId;
use crate::scene::Scene;
use crate::verify::Truth;

/// Verdicts of the oracle that are asked for: some 50 ns each.
const MOST_JUDGED: usize = 1_000_000;
/// Cameras that are judged at most.
const MOST_TRUTHS: usize = 16;

pub(super) struct Case<'a> {
    pub workload: &'a Workload<'a>,
    pub path: &'a CameraPath,
    /// The fastest tree.
    pub spec: StructureSpec,
    pub index: Box<dyn DynIndex>,
    /// The fastest scan.
    pub scan: StructureSpec,
    pub options: AdviseOptions,
}

impl<'a> Case<'a> {
    pub fn new(
        workload: &'a Workload<'a>,
        path: &'a CameraPath,
        [spec, scan]: [StructureSpec; 2],
        options: &AdviseOptions,
    ) -> Result<Case<'a>, BuildError> {
        let scene = workload.scene;
        Ok(Case {
            index: spec.build(input_of(scene, &scene.items))?,
            workload,
            path,
            spec,
            scan,
            options: *options,
        })
    }

    /// Cameras of the path with the truth about them, evenly spread.
    pub fn truths(&self) -> Vec<(usize, Truth)> {
        let cameras = &self.workload.cameras;
        let most = (MOST_JUDGED / self.scene().items.len().max(1)).clamp(1, MOST_TRUTHS);
        let wanted = most.min(cameras.len());
        let frames = (0..wanted).map(|n| n * cameras.len() / wanted);
        let judged = frames.filter_map(|frame| {
            let truth = Truth::of_scene(&cameras[frame], self.scene())?;
            Some((frame, truth))
        });
        judged.collect()
    }

    /// What the tree hands on for a camera of the path, appended.
    pub fn query(&self, camera: usize, out: &mut Vec<ItemId>) {
        let view = self.workload.views[camera].as_any();
        self.index.query(view, out);
    }

    pub fn scene(&self) -> &'a Scene {
        self.workload.scene
    }

    /// The six-plane volumes of the path.
    pub fn volumes(&self) -> impl Iterator<Item = &ConvexVolume> {
        self.workload.views.iter().filter_map(|view| match view {
            CameraView::Volume(volume) => Some(volume),
            _ => None,
        })
    }

    /// The views of the path by another culling.
    pub fn views(&self, culling: &Culling) -> Result<Vec<CameraView>, WorkloadError> {
        Ok(Workload::new(self.scene(), self.path, culling)?.views)
    }

    /// The tree over other items, as a culling test has them.
    pub fn tree_for(&self, test: CullingTest) -> Result<Box<dyn DynIndex>, BuildError> {
        let scene = self.scene();
        let items = test.items(&scene.items);
        self.spec.build(input_of(scene, &items))
    }

    /// The depth of a camera's view, or of the scene where that is infinite.
    pub fn depth(&self, frame: usize) -> f64 {
        let far = self.workload.cameras[frame].lens.far();
        far.unwrap_or_else(|| f64::from(self.scene().bounds.extent().length()))
    }

    /// How far rounding moves planes outward about an origin, in depths: the
    /// largest of all cameras and planes.
    pub fn margin(&self, scene: &Scene) -> f64 {
        let around = scene.surroundings();
        let bare = PlaneOptions {
            epsilon: 0.0,
            ..PlaneOptions::default()
        };
        let cameras = self.workload.cameras.iter().enumerate();
        let margins = cameras.filter_map(|(frame, camera)| {
            let moved = camera.volume(&PlaneOptions::default(), &around).ok()?;
            let derived = camera.volume(&bare, &around).ok()?;
            let planes = moved.planes().iter().zip(derived.planes());
            let apart = planes.map(|(a, b)| f64::from(a.d) - f64::from(b.d));
            Some(apart.fold(0.0, f64::max) / self.depth(frame))
        });
        margins.fold(0.0, f64::max)
    }
}

/// An index of one's own, asked with views of one's own.
pub(super) fn asked<'c>(index: Box<dyn DynIndex>, views: Vec<CameraView>) -> Ask<'c> {
    Box::new(move |n, out| index.query(views[n].as_any(), out))
}
