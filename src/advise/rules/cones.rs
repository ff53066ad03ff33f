//! Normal cones of clusters: a cluster all of whose triangles face away is removed by
//! one test. Pays unless the cones are so wide that there is hardly such an eye, or
//! triangles cost next to nothing. Predicted from the width of the cones.

use std::rc::Rc;
use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::super::AdviseError;
use super::super::case::Case;
use super::super::omission::{By, Draft, Forced, LeftOutIf, Omission, Way};
use super::hidden::{self, PROBED, PROBES, Removal};
use crate::geometry::Aabb;
use crate::index::DynIndex;
use crate::measure::Ask;
use crate::query::ItemId;
use crate::scene::Scene;
use crate::visibility::triangle::{Clusters, Cone, SafeCones, Selection, TriangleCull, View};
use crate::visibility::{Solids, Surfaces};

pub(super) const NAME: &str = "cones";

/// Items whose triangles are looked at, evenly spread: a share of them is enough.
const MOST_ITEMS: usize = 4_096;
/// Clusters whose cones a prediction looks at.
const MOST_CONES: usize = 512;
/// Triangles of a cluster: a face of a box.
const OF_A_FACE: usize = 2;

/// Part of the items, their clusters, and the cones of these.
struct Cones {
    part: Box<dyn DynIndex>,
    clusters: Arc<Clusters>,
    /// By cluster: the item that it is of.
    owners: Vec<ItemId>,
    cones: SafeCones,
    views: Vec<View>,
}

pub(super) fn prepare<'c>(case: &'c Case<'c>) -> Result<Draft<'c>, AdviseError> {
    let omission = Omission::new(
        NAME,
        "normal cones of clusters of triangles",
        [
            "no normal cones: draw every triangle of what is left",
            "cull clusters that face away by their normal cones",
        ],
        "share of the triangles of the items in the view whose cluster faces away",
        LeftOutIf::AtMost,
        By::Rule,
    );
    let scene = case.scene();
    if !Solids::are_items_of(scene) {
        let reason = "items are walls, not solid boxes with faces";
        return Ok(omission.because(reason).draft(Vec::new()));
    }
    let cameras = case.workload.cameras.iter();
    let views = cameras.map(|camera| View::of(camera, scene.origin, PROBES));
    let Ok(views) = views.collect::<Result<Vec<View>, _>>() else {
        let reason = "cameras without rays of their own";
        return Ok(omission.because(reason).draft(Vec::new()));
    };
    let items = part_of(scene);
    let boxes: Vec<Aabb> = items.iter().map(|&id| scene.items[id as usize]).collect();
    let surfaces = Surfaces::of_items(scene, &items);
    let clusters = Arc::new(Clusters::as_listed(Arc::new(surfaces), OF_A_FACE));
    let all = Rc::new(Cones {
        part: case.spec.build(&boxes)?,
        cones: SafeCones::of(&clusters),
        owners: owners_of(&clusters, &items),
        clusters,
        views,
    });
    let forced = Forced {
        on: format!(
            "cone-f32-safe, {} triangles per cluster, after {}",
            OF_A_FACE, case.spec.label
        ),
        kept: Way::Other(asked(case, all.clone(), true)),
        left_out: Way::Other(asked(case, all.clone(), false)),
        same: false,
        judged: false,
    };
    let [with, without] = [true, false].map(|by_cones| {
        let frames = hidden::frames(all.views.len(), PROBED);
        let selected = frames.map(|n| selected(case, &all, n, by_cones).triangles() as f64);
        hidden::mean(selected)
    });
    let removal = Removal {
        unit: ["triangle", "triangles"],
        with,
        without,
        cost_ns: case.options.draw_ns * items.len() as f64 / all.clusters.triangles.len() as f64,
        predicted: turned_away(&all.clusters),
    };
    Ok(hidden::weighed(omission, forced, move || removal))
}

/// At most [`MOST_ITEMS`] items, evenly spread.
fn part_of(scene: &Scene) -> Vec<ItemId> {
    let items = scene.items.len();
    let count = items.min(MOST_ITEMS);
    (0..count).map(|k| (k * items / count) as ItemId).collect()
}

/// The item of each cluster.
fn owners_of(clusters: &Clusters, items: &[ItemId]) -> Vec<ItemId> {
    let of_items = clusters.of_item.iter().zip(items);
    of_items
        .flat_map(|(own, &id)| own.clone().map(move |_| id))
        .collect()
}

/// The triangles of what the frustum meets, all or those that the cones leave.
fn selected(case: &Case, all: &Cones, n: usize, by_cones: bool) -> Selection {
    let mut items = Vec::new();
    all.part.query(case.workload.views[n].as_any(), &mut items);
    let mut selection = Selection::of_items(&all.clusters, items);
    if by_cones {
        let kernel = case.spec.execution.kernel;
        all.cones.cull(&all.views[n], kernel, &mut selection);
    }
    selection
}

/// Hands on the item of each cluster that has a triangle left.
fn asked<'c>(case: &'c Case<'c>, all: Rc<Cones>, by_cones: bool) -> Ask<'c> {
    Box::new(move |n, out| {
        let selection = selected(case, &all, n, by_cones);
        let clusters = selection.words().iter().zip(&all.owners);
        out.extend(clusters.filter(|(word, _)| **word != 0).map(|(_, &id)| id));
    })
}

/// The share of all directions from which a triangle's whole cluster faces away, mean
/// of the triangles of some clusters.
fn turned_away(clusters: &Clusters) -> f64 {
    let (mut triangles, mut away) = (0.0, 0.0);
    for cluster in hidden::frames(clusters.len(), MOST_CONES) {
        let corners: Vec<[Vec3; 3]> = clusters.corners_of(cluster).collect();
        let cone = Cone::fit(&corners, |axis: DVec3| axis.as_vec3());
        triangles += corners.len() as f64;
        away += corners.len() as f64 * cone.map_or(0.0, |cone| cone.turned_away());
    }
    away / triangles
}
