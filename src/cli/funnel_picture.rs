//! The picture of `cullbench funnel`: the first view from above, every item in the
//! colour of the stage that removed it.

use super::plan::{Class, Plan};
use crate::funnel::{Fate, FunnelReport, StageKind};
use crate::scene::Scene;

/// Every fate with its colour and its words.
const FATES: [(Fate, Class); 6] = [
    row(
        Fate::Removed(StageKind::Region),
        "#e4e4e4",
        "region: not reached through portals",
        false,
    ),
    row(
        Fate::Removed(StageKind::Object),
        "#c0c8d0",
        "object: outside of the frustum",
        false,
    ),
    row(
        Fate::Removed(StageKind::Occlusion),
        "#ecb566",
        "occlusion: behind others",
        false,
    ),
    row(Fate::Kept, "#56b4e9", "drawn, and not visible", true),
    row(Fate::Visible, "#009e73", "visible", true),
    row(Fate::Lost, "#d50000", "visible, and removed", true),
];

const fn row(fate: Fate, colour: &'static str, words: &'static str, is_key: bool) -> (Fate, Class) {
    (
        fate,
        Class {
            colour,
            words,
            is_key,
        },
    )
}

/// The picture as SVG.
pub fn draw(report: &FunnelReport, scene: &Scene) -> String {
    let view = &report.plan_view;
    let class_of = |item: usize| {
        let class = FATES
            .iter()
            .position(|(fate, _)| view.fates.get(item) == Some(fate));
        class.unwrap_or(0)
    };
    Plan {
        caption: format!(
            "{}, {}: the first view from above",
            report.scene, report.path
        ),
        scene,
        camera: view.camera.as_ref(),
        classes: &FATES.map(|(_, class)| class),
        class_of: &class_of,
        cells: None,
    }
    .svg()
}
