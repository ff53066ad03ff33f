//! Normal cones of clusters: one test removes a cluster that faces away.
//!
//! They pay unless the cones are so wide that there is hardly such an eye, or triangles
//! cost next to nothing. Predicted from the width of the cones.

use std::rc::Rc;
use std::sync::Arc;

use super::super::case::{Case, some_of};
use super::super::rule::{Draft, Unfit, not_applicable};
use super::super::trials::{Sides, Trials, mean};
use super::removal::{PROBED, Removal, weighed};
use crate::funnel::World;
use crate::kernel::Kernel;
use crate::query::ItemId;
use crate::scene::{ItemShape, Surfaces};
use crate::visibility::triangle::{
    Clusters, Cone, Eye, MOST_TRIANGLES, SafeCones, Selection, TriangleCull,
};

/// Items of a camera whose triangles are looked at, evenly spread.
const MOST_ITEMS: usize = 1_024;
/// Clusters of a camera whose cones a prediction looks at.
const MOST_CONES: usize = 64;
/// Triangles of a cluster: a face of a box, a wall.
const OF_A_FACE: usize = 2;

/// Items in view of a camera as clusters, with their cones.
struct Seen {
    items: Vec<ItemId>,
    clusters: Arc<Clusters>,
    /// Item of each cluster.
    owners: Vec<ItemId>,
    cones: SafeCones,
    eye: Eye,
}

/// Enters both sides on a few cameras, which stand for those that follow them.
///
/// An answer has the item of each cluster with a triangle left.
pub(super) fn prepare(trials: &mut Trials) -> Result<Draft, Unfit> {
    let case = trials.case;
    let world = case.world.as_ref().map_err(not_applicable)?;
    let cameras = case.cameras();
    let few: Rc<[Seen]> = some_of(cameras, PROBED)
        .map(|camera| Seen::of(case, world, camera))
        .collect();
    let sum = |of: fn(&Seen) -> usize| few.iter().map(of).sum::<usize>() as f64;
    let of_item = sum(|seen| seen.clusters.triangles.len()) / sum(|seen| seen.items.len());
    let kernel = case.spec.execution.kernel;
    let left = |cones| mean(few.iter().map(|seen| seen.left(cones).triangles() as f64));
    let removal = Removal {
        unit: ["triangle", "triangles"],
        with: left(Some(kernel)),
        without: left(None),
        cost_ns: case.options.draw_ns / of_item,
        predicted: turned_away(&few),
    };
    let on = match case.scene().item_shape() {
        ItemShape::Mesh => format!("clusters of up to {MOST_TRIANGLES} triangles"),
        _ => format!("{OF_A_FACE} triangles per cluster"),
    };
    let [kept, left_out] = [Some(kernel), None].map(|cones| {
        let few = few.clone();
        trials.unjudged(move |n, out| {
            let seen = &few[n * few.len() / cameras];
            let selection = seen.left(cones);
            let clusters = selection.words().iter().zip(&seen.owners);
            out.extend(clusters.filter(|(word, _)| **word != 0).map(|(_, &id)| id));
        })
    });
    let sides = Sides::new(format!("cone-f32-safe, {on}"), kept, left_out);
    Ok(weighed(sides, move || removal))
}

impl Seen {
    fn of(case: &Case, world: &World, camera: usize) -> Seen {
        let scene = case.scene();
        let met = case.found(camera);
        let items: Vec<ItemId> = some_of(met.len(), MOST_ITEMS).map(|n| met[n]).collect();
        let surfaces = Arc::new(match world.shape.triangles() {
            Some(all) => all.some(&items),
            None => {
                let boxes = items.iter().map(|&id| scene.items[id as usize]);
                Surfaces::of_boxes(scene.origin, boxes)
            }
        });
        let clusters = Arc::new(match scene.item_shape() {
            ItemShape::Mesh => Clusters::of(surfaces, MOST_TRIANGLES),
            _ => Clusters::as_listed(surfaces, OF_A_FACE),
        });
        let owners = clusters.of_item.iter().zip(&items);
        let owners = owners.flat_map(|(own, &id)| own.clone().map(move |_| id));
        Seen {
            owners: owners.collect(),
            cones: SafeCones::of(&clusters),
            clusters,
            items,
            eye: Eye::of(&case.workload.cameras[camera], scene.origin),
        }
    }

    /// All triangles, or those that the cones leave.
    fn left(&self, cones: Option<Kernel>) -> Selection {
        let mut selection = Selection::all(&self.clusters);
        if let Some(kernel) = cones {
            self.cones.cull(&self.eye, kernel, &mut selection);
        }
        selection
    }
}

/// Share of all directions from which a triangle's whole cluster faces away.
///
/// The mean over the triangles of some clusters.
fn turned_away(few: &[Seen]) -> f64 {
    let (mut triangles, mut away) = (0.0, 0.0);
    for seen in few {
        for cluster in some_of(seen.clusters.len(), MOST_CONES) {
            let corners: Vec<_> = seen.clusters.corners_of(cluster).collect();
            let count = corners.len() as f64;
            triangles += count;
            away += Cone::fit(&corners).map_or(0.0, |cone| count * cone.turned_away());
        }
    }
    away / triangles
}
