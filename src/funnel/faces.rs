//! The triangle stage on what the chain leaves: the faces of those items in clusters, and
//! every back end that tells which of them are turned away or beside the image. Of solid
//! boxes clusters are made for each view; of a mesh or a map once, and a back end passes
//! over those of other items. A map's floors and ceilings are of no item.

use std::cell::OnceCell;
use std::rc::Rc;
use std::sync::Arc;

use super::judged::Judged;
use super::pass::Pass;
use super::triangle_rows::rows;
use super::world::World;
use crate::kernel::Kernel;
use crate::scene::Surfaces;
use crate::visibility::triangle::{
    Clusters, Counts, Criterion, MOST_TRIANGLES, Selection, TriangleCull, View, truth,
};

/// Bytes that the study of a mesh takes for each triangle, beside its scene: trees for
/// rays, clusters and every back end of both; 310 were measured.
pub const BYTES_PER_TRIANGLE: u64 = 350;

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
    view: View,
    /// By criterion: what should be left, found where it is asked for.
    truths: [OnceCell<Selection>; Criterion::ALL.len()],
}

impl Left {
    fn truth(&self, criterion: Criterion) -> &Selection {
        let find = || truth(criterion, &self.built.clusters, &self.view, &self.given);
        self.truths[criterion as usize].get_or_init(find)
    }
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
                let surfaces = Surfaces::of_items(world.scene, &items);
                Built::of(Arc::new(surfaces))
            });
            let clusters = &built.clusters;
            Left {
                given: match whole {
                    Some(_) => Selection::of_items(clusters, items.iter().copied()),
                    None => Selection::all(clusters),
                },
                view: *world.triangle_view(view),
                truths: Default::default(),
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
            left.built.culls[back_end].cull(&left.view, self.kernel, &mut selection);
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

    /// Every view, held against what a back end is to decide by: the exact side of each
    /// triangle, the window or the samples.
    pub fn judged(&self, back_end: Option<usize>) -> Vec<Judged> {
        let row = back_end.and_then(|back_end| rows().nth(back_end));
        let criterion = row.map_or(Criterion::Facing, |row| row.criterion);
        let judged = (0..self.views.len()).map(|view| {
            let left = &self.views[view];
            let truth = left.truth(criterion);
            let counts = Counts::of(&left.given, &self.selected(back_end, view), truth);
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
