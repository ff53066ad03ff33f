//! Normal cones of clusters: a cluster all of whose triangles face away is removed by
//! one test. Pays unless the cones are so wide that there is hardly such an eye, or
//! triangles cost next to nothing. Predicted from the width of the cones.

use std::rc::Rc;
use std::sync::Arc;

use super::super::case::Case;
use super::super::omission::{By, Draft, Forced, LeftOutIf, Omission, Way};
use super::super::rule::{Rule, Unfit, not_applicable};
use super::hidden::{self, PROBED, Removal};
use crate::kernel::Kernel;
use crate::measure::Ask;
use crate::query::ItemId;
use crate::scene::{ItemShape, Surfaces};
use crate::visibility::triangle::{
    Clusters, Cone, Eye, MOST_TRIANGLES, SafeCones, Selection, TriangleCull,
};
use crate::visibility::{NoRays, Rays, surfaces_of};

pub(super) const RULE: Rule = Rule {
    name: "cones",
    left_out: "normal cones of clusters of triangles",
    advice: [
        "no normal cones: draw every triangle of what is left",
        "cull clusters that face away by their normal cones",
    ],
    statistic_name: "share of the triangles of the items in the view whose cluster faces away",
    left_out_if: LeftOutIf::AtMost,
    by: By::Rule,
    prepare,
};

/// Items of a camera whose triangles are looked at, evenly spread.
const MOST_ITEMS: usize = 1_024;
/// Clusters of a camera whose cones a prediction looks at.
const MOST_CONES: usize = 64;
/// Triangles of a cluster: a face of a box, a wall.
const OF_A_FACE: usize = 2;

/// Items that a camera meets as clusters, and the cones of these.
struct Seen {
    items: Vec<ItemId>,
    clusters: Arc<Clusters>,
    /// By cluster: the item that it is of.
    owners: Vec<ItemId>,
    cones: SafeCones,
    eye: Eye,
}

fn prepare<'c>(case: &'c Case<'c>, omission: Omission) -> Result<Draft<'c>, Unfit> {
    let cameras = case.workload.views.len();
    let surfaces = surfaces_of(case.scene());
    let few = hidden::frames(cameras, PROBED);
    let few = few.map(|frame| Seen::of(case, frame, surfaces.as_deref()));
    let Ok(few) = few.collect::<Result<Vec<Seen>, NoRays>>() else {
        let reason = "cameras without rays of their own";
        return Err(not_applicable(reason));
    };
    let sum = |of: fn(&Seen) -> usize| few.iter().map(of).sum::<usize>() as f64;
    let of_item = sum(|seen| seen.clusters.triangles.len()) / sum(|seen| seen.items.len());
    let kernel = case.spec.execution.kernel;
    let mean = |cones| {
        let left = few.iter().map(|seen| seen.left(cones).triangles() as f64);
        hidden::mean(left)
    };
    let removal = Removal {
        unit: ["triangle", "triangles"],
        with: mean(Some(kernel)),
        without: mean(None),
        cost_ns: case.options.draw_ns / of_item,
        predicted: turned_away(&few),
    };
    let few = Rc::new(few);
    let asked = |cones| Way::Other(asked(few.clone(), cameras, cones));
    let forced = Forced {
        on: format!(
            "cone-f32-safe, {}",
            match case.scene().item_shape() {
                ItemShape::Mesh => format!("clusters of up to {MOST_TRIANGLES} triangles"),
                _ => format!("{OF_A_FACE} triangles per cluster"),
            }
        ),
        kept: asked(Some(kernel)),
        left_out: asked(None),
        same: false,
        judged: false,
    };
    Ok(hidden::weighed(omission, forced, move || removal))
}

impl Seen {
    fn of(case: &Case, frame: usize, surfaces: Option<&Surfaces>) -> Result<Seen, NoRays> {
        let (scene, camera) = (case.scene(), &case.workload.cameras[frame]);
        Rays::of(camera)?;
        let mut met = Vec::new();
        case.query(frame, &mut met);
        let items = hidden::frames(met.len(), MOST_ITEMS).map(|n| met[n]);
        let items: Vec<ItemId> = items.collect();
        let surfaces = Arc::new(match surfaces {
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
        Ok(Seen {
            owners: owners
                .flat_map(|(own, &id)| own.clone().map(move |_| id))
                .collect(),
            cones: SafeCones::of(&clusters),
            clusters,
            items,
            eye: Eye::of(camera, scene.origin),
        })
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

/// Hands on the item of each cluster that has a triangle left. A few cameras stand for
/// those that follow them.
fn asked<'c>(few: Rc<Vec<Seen>>, cameras: usize, cones: Option<Kernel>) -> Ask<'c> {
    Box::new(move |n, out| {
        let seen = &few[n * few.len() / cameras];
        let selection = seen.left(cones);
        let clusters = selection.words().iter().zip(&seen.owners);
        out.extend(clusters.filter(|(word, _)| **word != 0).map(|(_, &id)| id));
    })
}

/// The share of all directions from which a triangle's whole cluster faces away, mean
/// of the triangles of some clusters.
fn turned_away(few: &[Seen]) -> f64 {
    let some = few.iter().flat_map(|seen| {
        let clusters = hidden::frames(seen.clusters.len(), MOST_CONES);
        clusters.map(|cluster| seen.clusters.corners_of(cluster).collect::<Vec<_>>())
    });
    let (mut triangles, mut away) = (0.0, 0.0);
    for corners in some {
        let cone = Cone::fit(&corners);
        triangles += corners.len() as f64;
        away += corners.len() as f64 * cone.map_or(0.0, |cone| cone.turned_away());
    }
    away / triangles
}
