//! What each stage can be done by, for a scene, and what a chain takes of it.

use super::chain::Chain;
use super::fragment_rows;
use super::hiding::HIDING;
use super::left_out::LeftOutRow;
use super::stage::{BackEnd, StageKind};
use super::triangle_rows;
use crate::scene::{Regions, Scene};
use crate::visibility::region;

/// What a chain takes where there are rooms.
const PORTAL_CLIP: &str = "portal-clip";

/// What there is only where a claim was given.
const CLAIM: &str = region::STORED.name;
const EXACT: &str = region::EXACT.name;
/// Most rooms of which it is found out, exactly, what is seen from each.
const MOST_EXACT_ROOMS: usize = 4_096;

/// What finds a way through the rooms or sectors of a scene.
fn of_regions(scene: &Scene) -> &'static [&'static str] {
    const OF_ROOMS: &[&str] = &["flood", "portal-rect", PORTAL_CLIP, CLAIM, EXACT];
    const OF_SECTORS: &[&str] = &["flood", "portal-rect", PORTAL_CLIP, CLAIM, "reject"];
    match &scene.regions {
        Regions::Tiling(_) if has_exact(scene) => OF_ROOMS,
        // It is the last.
        Regions::Tiling(_) => &OF_ROOMS[..OF_ROOMS.len() - 1],
        Regions::Bsp(map) if map.disputes().is_empty() => OF_SECTORS,
        _ => &[],
    }
}

/// Whether it is found out, exactly, which rooms of a scene see each other.
pub fn has_exact(scene: &Scene) -> bool {
    matches!(&scene.regions, Regions::Tiling(rooms) if rooms.boxes.len() <= MOST_EXACT_ROOMS)
}

/// What the region stage of a map leaves out, and why.
pub fn left_out_of(scene: &Scene) -> Vec<LeftOutRow> {
    let Regions::Bsp(map) = &scene.regions else {
        return Vec::new();
    };
    let dispute = map.disputes().first().into_iter();
    dispute
        .map(|dispute| LeftOutRow::of("stages", "region", *dispute))
        .collect()
}

/// The back ends of a stage that a scene can have, with or without cut-outs among its
/// items; structures of the object stage are not among them.
pub fn back_ends(stage: StageKind, scene: &Scene, has_cut_outs: bool) -> Vec<BackEnd> {
    let mut rows = vec![BackEnd::left_out(stage)];
    match stage {
        StageKind::Region => {
            let names = of_regions(scene);
            let known = region::ROWS.iter().filter(|row| names.contains(&row.name));
            let declared =
                known.map(|row| BackEnd::of(stage, [row.name, row.summary], row.guarantee));
            rows.extend(declared);
        }
        StageKind::Occlusion => rows.extend(HIDING.iter().map(|row| row.back_end)),
        StageKind::Triangle => rows.extend(triangle_rows::back_ends()),
        StageKind::Fragment => rows.extend(fragment_rows::back_ends(scene, has_cut_outs)),
        _ => {}
    }
    rows
}

impl Chain {
    /// What suits a scene, but for the object stage: the safest back end of each stage
    /// that removes the most.
    pub fn for_scene(scene: &Scene, has_cut_outs: bool) -> Chain {
        let has = |stage, name: &'static str| {
            back_ends(stage, scene, has_cut_outs)
                .iter()
                .any(|row| row.name == name)
                .then_some(name)
        };
        [
            (StageKind::Region, PORTAL_CLIP),
            (StageKind::Occlusion, "masked-inner"),
            (StageKind::Triangle, triangle_rows::DEFAULT),
            (StageKind::Fragment, fragment_rows::default(has_cut_outs)),
        ]
        .into_iter()
        .fold(Chain::empty(), |chain, (stage, name)| {
            match has(stage, name) {
                Some(name) => chain.with(stage, name),
                None => chain,
            }
        })
    }
}
