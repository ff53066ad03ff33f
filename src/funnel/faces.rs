//! The triangle stage on what the chain leaves: the faces of those items in clusters, and
//! every back end that tells which of them are turned away. Of solid
//! boxes clusters are made for each view; of a mesh or a map once, and a back end passes
//! over those of other items. A map's floors and ceilings are of no item.

use std::rc::Rc;
use std::sync::Arc;

use glam::DVec3;

use super::judged::Judged;
use super::pass::Pass;
use super::triangle_rows::rows;
use super::world::World;
use crate::camera::Camera;
use crate::kernel::Kernel;
use crate::scene::{ItemShape, Scene, Surfaces};
use crate::visibility::triangle::{
    Clusters, Counts, Eye, MOST_TRIANGLES, Selection, TriangleCull, facing,
};

/// Bytes that the study of a mesh takes for each triangle, beside its scene: trees for
/// rays, clusters and every back end of both; 310 were measured.
pub const BYTES_PER_TRIANGLE: u64 = 350;

/// The zero of a view's triangles. Faces of boxes are rounded about the eye, so that none
/// changes its side; where f32 does not reach from there, about the scene's own origin.
fn origin_of(scene: &Scene, camera: &Camera) -> DVec3 {
    let eye = camera.frame.eye;
    let reach = scene.bounds.reach().as_dvec3() + (eye - scene.origin).abs();
    let is_near = reach.max_element() < f64::from(f32::MAX);
    match scene.item_shape() {
        ItemShape::Box if is_near => eye,
        _ => scene.origin,
    }
}

/// The eye of a camera about the zero of its view's triangles.
fn eye(scene: &Scene, camera: &Camera) -> Eye {
    Eye::of(camera, origin_of(scene, camera))
}

/// Triangles in clusters, ready for every back end.
struct Built {
    clusters: Arc<Clusters>,
    culls: Vec<Box<dyn TriangleCull>>,
}

impl Built {
    fn of(surfaces: Arc<Surfaces>) -> Rc<Built> {
        let clusters = Arc::new(Clusters::of(surfaces, MOST_TRIANGLES));
        Rc::new(Built {
            culls: rows().map(|row| (row.build)(&clusters)).collect(),
            clusters,
        })
    }
}

/// The faces of what is left of one view.
struct Left {
    built: Rc<Built>,
    given: Selection,
    eye: Eye,
    /// The triangles that should be left.
    truth: Selection,
}

/// The faces of what is left of every view.
pub struct Faces {
    views: Vec<Left>,
    kernel: Kernel,
}

impl Faces {
    /// Of a set of items of each view. Most views have few items left; where a stage
    /// before is left out, 12 triangles an item take memory.
    pub fn of(world: &World, pass: &Pass, set: usize) -> Faces {
        let whole = world.surfaces.as_ref().map(|all| Built::of(all.clone()));
        let views = (0..world.views()).map(|view| {
            let items = world.listed(pass.items(set, view));
            let built = whole.clone().unwrap_or_else(|| {
                let solids = world.solids.as_ref().expect("boxes or triangles");
                let origin = origin_of(world.scene, world.rays(view).camera());
                let boxes = items.iter().map(|&item| &solids.boxes[item as usize]);
                Built::of(Arc::new(Surfaces::of_boxes_about(origin, boxes)))
            });
            let clusters = &built.clusters;
            let given = match whole {
                Some(_) => Selection::of_items(clusters, items.iter().copied()),
                None => Selection::all(clusters),
            };
            let eye = eye(world.scene, world.rays(view).camera());
            Left {
                truth: facing(clusters, &eye, &given),
                given,
                eye,
                built,
            }
        });
        Faces {
            views: views.collect(),
            kernel: world.kernel,
        }
    }

    /// The faces of a view.
    pub fn clusters(&self, view: usize) -> &Arc<Clusters> {
        &self.views[view].built.clusters
    }

    /// What a back end leaves of the triangles of a view; `None` is no back end.
    fn selected(&self, back_end: Option<usize>, view: usize) -> Selection {
        let left = &self.views[view];
        let mut selection = left.given.clone();
        if let Some(back_end) = back_end {
            left.built.culls[back_end].cull(&left.eye, self.kernel, &mut selection);
        }
        selection
    }

    /// The clusters of a view that keep a triangle.
    pub fn cull(&self, back_end: usize, view: usize, out: &mut Vec<u32>) {
        let selection = self.selected(Some(back_end), view);
        let clusters = selection.words().iter().zip(0..);
        let kept = clusters.filter(|(word, _)| **word != 0);
        out.extend(kept.map(|(_, cluster)| cluster));
    }

    /// What a back end leaves of the triangles of a view, by their number among the
    /// surfaces; `None` is no back end.
    pub fn triangles(&self, back_end: Option<usize>, view: usize) -> Vec<u32> {
        let selection = self.selected(back_end, view);
        let clusters = self.clusters(view);
        let mut triangles = Vec::with_capacity(selection.triangles());
        for (cluster, word) in selection.words().iter().enumerate() {
            let all = clusters.triangles_of(cluster).iter().enumerate();
            triangles.extend(all.filter(|(bit, _)| word >> bit & 1 == 1).map(|(_, t)| t));
        }
        triangles
    }

    /// Every view, held against the exact side of each triangle.
    pub fn judged(&self, back_end: Option<usize>) -> Vec<Judged> {
        let judged = (0..self.views.len()).map(|view| {
            let left = &self.views[view];
            let counts = Counts::of(&left.given, &self.selected(back_end, view), &left.truth);
            Judged {
                input: counts.candidates as u64,
                hidden: (counts.candidates - counts.truth) as u64,
                output: counts.delivered as u64,
                truth: counts.truth as u64,
                false_positives: counts.false_positives as u64,
                false_negatives: counts.false_negatives as u64,
                ..Judged::default()
            }
        });
        judged.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Frame, Lens};
    use crate::scene::{SeededRng, WorldBox};
    use crate::visibility::triangle::TRIANGLE_ROWS;

    /// Sides of a box that an eye is in front of and that have an area: two triangles each.
    fn seen(b: &WorldBox, eye: DVec3) -> usize {
        let sides = (0..3).filter(|&axis| (0..3).all(|k| k == axis || b.min[k] < b.max[k]));
        let of_axis = |axis: usize| {
            usize::from(eye[axis] < b.min[axis]) + usize::from(eye[axis] > b.max[axis])
        };
        2 * sides.map(of_axis).sum::<usize>()
    }

    /// However coarse f32 is about the scene's origin.
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
                    // Some faces are in the plane of the eye.
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
            let about_eye = super::eye(&scene, &camera);
            let clusters = Arc::new(Clusters::of(Arc::new(surfaces), MOST_TRIANGLES));
            let truth = facing(&clusters, &about_eye, &Selection::all(&clusters));
            assert_eq!(truth.triangles(), wanted, "{round} {boxes:?} {eye}");
            for row in TRIANGLE_ROWS.iter().filter(|row| row.guarantee.is_safe()) {
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
