//! The triangle stage on what the chain leaves: the faces of those items, in clusters
//! made for each view, and every back end that tells which of them are turned away.

use std::sync::Arc;

use super::judged::Judged;
use super::pass::Pass;
use super::triangle_rows::sides;
use super::world::World;
use crate::kernel::Kernel;
use crate::visibility::Surfaces;
use crate::visibility::triangle::{
    Clusters, Counts, MOST_TRIANGLES, Selection, TriangleCull, View, facing,
};

/// The faces of what is left of one view.
struct Left {
    clusters: Arc<Clusters>,
    view: View,
    culls: Vec<Box<dyn TriangleCull>>,
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
        let views = (0..world.views()).map(|view| {
            let items = world.listed(pass.items(set, view));
            let surfaces = Surfaces::of_items(world.scene(), &items);
            let clusters = Arc::new(Clusters::of(Arc::new(surfaces), MOST_TRIANGLES));
            Left {
                culls: sides().map(|row| (row.build)(&clusters)).collect(),
                view: *world.triangle_view(view),
                clusters,
            }
        });
        Faces {
            views: views.collect(),
            kernel: world.kernel(),
        }
    }

    /// The faces of a view.
    pub fn clusters(&self, view: usize) -> &Arc<Clusters> {
        &self.views[view].clusters
    }

    /// What a back end leaves of the triangles of a view; `None` is no back end.
    fn selected(&self, back_end: Option<usize>, view: usize) -> Selection {
        let left = &self.views[view];
        let mut selection = Selection::all(&left.clusters);
        if let Some(back_end) = back_end {
            left.culls[back_end].cull(&left.view, self.kernel, &mut selection);
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

    /// Every view, held against the exact side of each triangle.
    pub fn judged(&self, back_end: Option<usize>) -> Vec<Judged> {
        let judged = (0..self.views.len()).map(|view| {
            let left = &self.views[view];
            let all = Selection::all(&left.clusters);
            let truth = facing(&left.clusters, &left.view, &all);
            let counts = Counts::of(&all, &self.selected(back_end, view), &truth);
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
