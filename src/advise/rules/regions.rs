//! The region stage: pays where walls close off most of what the frustum meets, and is
//! left out where the eye is in the open. Predicted from the regions that a few rays
//! pass.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;

use super::super::case::Case;
use super::super::omission::{By, Draft, LeftOutIf, Omission, Way};
use super::super::rule::{Rule, Unfit, not_applicable};
use super::hidden::{self, PROBED, PROBES};
use crate::geometry::ConvexVolume;
use crate::measure::Ask;
use crate::scene::Scene;
use crate::visibility::Rays;
use crate::visibility::region::doom::DoomMap;
use crate::visibility::region::{
    EyePlace, IdSet, RegionGraph, RegionItems, RegionRow, Scratch, Source, seen_by_samples,
};

pub(super) const RULE: Rule = Rule {
    name: "regions",
    left_out: "the region stage (portals)",
    advice: [
        "no region stage: portals close off too little",
        "find the regions that are seen before their items (portal-clip)",
    ],
    statistic_name: "share of the items in the view that lie in no region that is seen",
    left_out_if: LeftOutIf::AtMost,
    by: By::Rule,
    prepare,
};

/// The regions of the scene with their items, and what is asked of them.
struct Regions {
    row: RegionRow,
    items: RegionItems,
    views: Vec<(Rays, ConvexVolume)>,
}

/// The rooms of a scene or the sectors of its map.
fn graph_of(scene: &Scene) -> Result<Arc<RegionGraph>, Unfit> {
    let graph = match DoomMap::of_scene(scene) {
        Some(map) => Some(
            map.graph()
                .map_err(|dispute| not_applicable(dispute.to_string()))?,
        ),
        None => RegionGraph::of_scene(scene).ok(),
    };
    let joined = graph.filter(|graph| !graph.openings().is_empty());
    let without = || not_applicable("the scene has no rooms or sectors that portals join");
    joined.map(Arc::new).ok_or_else(without)
}

fn prepare<'c>(case: &'c Case<'c>, omission: Omission) -> Result<Draft<'c>, Unfit> {
    let graph = graph_of(case.scene())?;
    let views = hidden::sights(case).map_err(not_applicable)?;
    let regions = Rc::new(Regions {
        items: RegionItems::of(&graph, case.scene()),
        row: RegionRow::search(Source::PortalClip, graph),
        views,
    });
    let predicted = predicted(case, &regions);
    let on = format!("portal-clip against {}", case.spec.label);
    let kept = asked(case, regions);
    Ok(hidden::draft(
        case,
        omission,
        on,
        kept,
        Way::Base,
        predicted,
    ))
}

/// The items of the regions that are seen, each tested against the six planes; all
/// items by the tree where the eye is in no region.
fn asked<'c>(case: &'c Case<'c>, regions: Rc<Regions>) -> Ask<'c> {
    let memory = RefCell::new((Scratch::default(), IdSet::default(), Vec::new()));
    let items = &case.scene().items;
    Box::new(move |n, out| {
        let (rays, volume) = &regions.views[n];
        let (scratch, marks, seen) = &mut *memory.borrow_mut();
        match regions.row.from_eye(rays, scratch, seen) {
            EyePlace::Inside => {
                regions.items.of_regions(seen, marks, out);
                out.retain(|&id| volume.sees(&items[id as usize]));
            }
            EyePlace::Outside => case.query(n, out),
        }
    })
}

/// Of the items that a few cameras meet, those in no region that a few rays pass.
fn predicted(case: &Case, regions: &Regions) -> f64 {
    let graph = &*regions.row.graph;
    let (mut met, mut gone) = (0, 0);
    let (mut found, mut listed) = (Vec::new(), Vec::new());
    let (mut homes, mut seen, mut marks) = (Vec::new(), Vec::new(), IdSet::default());
    for frame in hidden::frames(regions.views.len(), PROBED) {
        found.clear();
        case.query(frame, &mut found);
        met += found.len();
        let rays = &regions.views[frame].0;
        if graph.homes(rays, &mut homes) {
            seen_by_samples(graph, rays, PROBES, &mut seen);
            regions.items.of_regions(&seen, &mut marks, &mut listed);
            let is_gone = |id: &&u32| listed.binary_search(id).is_err();
            gone += found.iter().filter(is_gone).count();
        }
    }
    gone as f64 / met.max(1) as f64
}
