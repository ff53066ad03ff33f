//! Triangle stage: clusters of triangles of the items that the chain leaves.
//!
//! Clusters of solid boxes are built for each view; those of a mesh or a map once, without its
//! floors and ceilings, and a back end skips those of other items.

use std::rc::Rc;
use std::sync::Arc;

use glam::DVec3;

use super::item_stages::ItemStages;
use super::setup::{Setup, Shape};
use super::stage::StageKind;
use super::task::{FunnelKey, KeyedTask};
use super::visible_items::ViewCounts;
use crate::camera::Camera;
use crate::kernel::Kernel;
use crate::measure::QueryFn;
use crate::scene::{ItemShape, Scene, Surfaces};
use crate::visibility::triangle::{
    Clusters, Eye, MOST_TRIANGLES, Selection, TRIANGLE_ROWS, TriangleCull, TriangleRow, facing,
};

/// Bytes per triangle of a mesh in addition to its scene; 310 were measured.
///
/// Includes trees for rays, clusters and every back end of both.
pub const BYTES_PER_TRIANGLE: u64 = 350;

/// Origin of a view's triangles.
///
/// Faces of boxes are rounded relative to the eye, so that none changes its side; if f32 does not
/// reach that far, relative to the scene's origin.
fn origin_of(scene: &Scene, camera: &Camera) -> DVec3 {
    let eye = camera.frame.eye;
    let reach = scene.bounds.reach().as_dvec3() + (eye - scene.origin).abs();
    let is_near = reach.max_element() < f64::from(f32::MAX);
    match scene.item_shape() {
        ItemShape::Box if is_near => eye,
        _ => scene.origin,
    }
}

/// Clusters and the compared back ends over them.
struct ClusterBackEnds {
    clusters: Arc<Clusters>,
    culls: Vec<(&'static str, Box<dyn TriangleCull>)>,
}

impl ClusterBackEnds {
    fn of(setup: &Setup, surfaces: Arc<Surfaces>) -> Rc<ClusterBackEnds> {
        let clusters = Arc::new(Clusters::of(surfaces, MOST_TRIANGLES));
        let compared = setup.rows(StageKind::Triangle);
        let is_compared = |row: &&TriangleRow| compared.iter().any(|(own, _)| own.name == row.name);
        let rows = TRIANGLE_ROWS.iter().filter(is_compared);
        let culls = rows.map(|row| (row.name, (row.build)(&clusters)));
        Rc::new(ClusterBackEnds {
            culls: culls.collect(),
            clusters,
        })
    }
}

/// Triangles of one view.
struct TriangleView {
    back_ends: Rc<ClusterBackEnds>,
    given: Selection,
    eye: Eye,
    /// Triangles that face the eye.
    truth: Selection,
}

/// Triangles of the remaining items in every view.
pub struct TriangleStage {
    views: Vec<TriangleView>,
    kernel: Kernel,
}

impl TriangleStage {
    /// Builds clusters of the remaining items.
    ///
    /// A box has 12 triangles, which takes much memory if an earlier stage is left out.
    pub fn new(stages: &ItemStages) -> TriangleStage {
        let setup = stages.setup;
        let whole = match &setup.shape {
            Shape::Triangles(all) => Ok(ClusterBackEnds::of(setup, all.clone())),
            Shape::Boxes(solids) => Err(solids),
        };
        let views = setup.views().map(|view| {
            let items = stages.remaining(view);
            let camera = &setup.rays(view).camera;
            let back_ends = whole.clone().unwrap_or_else(|solids| {
                let boxes = items.iter().map(|&item| &solids.boxes[item as usize]);
                let origin = origin_of(setup.scene, camera);
                ClusterBackEnds::of(setup, Arc::new(Surfaces::of_boxes_about(origin, boxes)))
            });
            let given = match whole.is_ok() {
                true => Selection::of_items(&back_ends.clusters, items.iter().copied()),
                false => Selection::all(&back_ends.clusters),
            };
            let eye = Eye::of(camera, origin_of(setup.scene, camera));
            TriangleView {
                truth: facing(&back_ends.clusters, &eye, &given),
                given,
                eye,
                back_ends,
            }
        });
        TriangleStage {
            views: views.collect(),
            kernel: setup.kernel,
        }
    }

    /// Triangles that a back end leaves; all of them for `none`.
    fn kept(&self, name: &str, view: usize) -> Selection {
        let view = &self.views[view];
        let mut kept = view.given.clone();
        let mut culls = view.back_ends.culls.iter();
        if let Some((_, cull)) = culls.find(|(own, _)| *own == name) {
            cull.cull(&view.eye, self.kernel, &mut kept);
        }
        kept
    }

    /// Tasks of all back ends; the ids are of clusters with a triangle left.
    pub fn tasks(&self) -> impl Iterator<Item = KeyedTask<'_>> {
        let back_ends = self.views.first().map(|view| &view.back_ends.culls);
        back_ends.into_iter().flatten().map(move |(name, _)| {
            let key = FunnelKey::Stage(StageKind::Triangle, (*name).to_owned());
            let ask: QueryFn = Box::new(move |view, out| {
                let kept = self.kept(name, view);
                let clusters = kept.words().iter().zip(0..);
                let left = clusters.filter(|(word, _)| **word != 0);
                out.extend(left.map(|(_, cluster)| cluster));
            });
            (key, ask)
        })
    }

    /// Indices of the triangles that a back end leaves in a view, among the surfaces.
    pub fn triangles(&self, name: &str, view: usize) -> Vec<u32> {
        let kept = self.kept(name, view);
        let clusters = &self.views[view].back_ends.clusters;
        let mut triangles = Vec::with_capacity(kept.triangles());
        for (cluster, word) in kept.words().iter().enumerate() {
            let all = clusters.triangles_of(cluster).iter().enumerate();
            triangles.extend(all.filter(|(bit, _)| word >> bit & 1 == 1).map(|(_, t)| t));
        }
        triangles
    }

    /// Counts of a back end in each view, compared with the exact facing test.
    pub fn counts(&self, name: &str) -> Vec<ViewCounts> {
        let count = |(n, view): (usize, &TriangleView)| {
            let (kept, right) = (self.kept(name, n), &view.truth);
            let [input, output, truth] =
                [&view.given, &kept, right].map(|of| of.triangles() as u64);
            ViewCounts {
                input,
                output,
                truth,
                false_negatives: right.without(&kept) as u64,
                ..ViewCounts::default()
            }
        };
        self.views.iter().enumerate().map(count).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Frame, Lens};
    use crate::scene::{SeededRng, WorldBox};
    use crate::visibility::Guarantee;
    use crate::visibility::triangle::TRIANGLE_ROWS;

    /// Number of triangles of a box that face an eye, two per side with an area.
    fn seen(b: &WorldBox, eye: DVec3) -> usize {
        let sides = (0..3).filter(|&axis| (0..3).all(|k| k == axis || b.min[k] < b.max[k]));
        let of_axis = |axis: usize| {
            usize::from(eye[axis] < b.min[axis]) + usize::from(eye[axis] > b.max[axis])
        };
        2 * sides.map(of_axis).sum::<usize>()
    }

    /// Holds however coarse f32 is about the scene's origin.
    #[test]
    fn triangles_face_the_eye_where_faces_of_the_written_boxes_do() {
        let mut rng = SeededRng::new(6);
        let mut about_origin = 0;
        for round in 0..300 {
            let far = [0.0, 1e6, 1e8, 1e15, 1e30][round % 5];
            let eye = rng.normal3() * 5.0 + far;
            let boxes: Vec<WorldBox> = (0..8)
                .map(|n| {
                    let at = eye + rng.normal3() * [1e-7, 1.0, 30.0][n % 3];
                    let thin = [(); 3].map(|()| rng.below(3) as f64 / 2.0);
                    let size = rng.point() * DVec3::from(thin) * 3.0;
                    // The eye is in the plane of some faces.
                    let at = if n == 3 { at.with_y(eye.y) } else { at };
                    WorldBox::new(at, at + size)
                })
                .chain([WorldBox::new(
                    DVec3::splat(-far - 9.0),
                    DVec3::splat(-far - 8.0),
                )])
                .collect();
            let scene = Scene::from_boxes("few", &boxes).unwrap();
            let frame = Frame::looking_along(eye, DVec3::X, DVec3::Z).unwrap();
            let lens = Lens::perspective(60.0, 1.5, 0.1, None).unwrap();
            let camera = Camera { frame, lens };
            let wanted: usize = boxes.iter().map(|b| seen(b, eye)).sum();
            let surfaces = Surfaces::of_boxes_about(eye, boxes.iter());
            let about_eye = Eye::of(&camera, super::origin_of(&scene, &camera));
            let clusters = Arc::new(Clusters::of(Arc::new(surfaces), MOST_TRIANGLES));
            let truth = facing(&clusters, &about_eye, &Selection::all(&clusters));
            assert_eq!(truth.triangles(), wanted, "{round} {boxes:?} {eye}");
            for row in TRIANGLE_ROWS
                .iter()
                .filter(|row| row.guarantee <= Guarantee::Conservative)
            {
                let mut kept = Selection::all(&clusters);
                (row.build)(&clusters).cull(&about_eye, Kernel::best(), &mut kept);
                assert_eq!(truth.without(&kept), 0, "{round} {}", row.name);
            }
            let rounded = Arc::new(Surfaces::from_boxes(&scene));
            let rounded = Arc::new(Clusters::of(rounded, MOST_TRIANGLES));
            let about_zero = Eye::of(&camera, scene.origin);
            let found = facing(&rounded, &about_zero, &Selection::all(&rounded));
            about_origin += usize::from(found.triangles() != wanted);
        }
        assert!(about_origin > 50, "the premise: {about_origin}");
    }
}
