//! The occlusion stage: pays where the eye is among things that hide others, and is
//! left out where it looks down on them. Predicted from a few of the cameras.

use std::cell::RefCell;
use std::rc::Rc;

use super::super::case::Case;
use super::super::omission::{By, Draft, LeftOutIf, Omission, Way};
use super::super::rule::{Rule, Unfit, not_applicable};
use super::hidden::{self, PROBED};
use crate::geometry::ConvexVolume;
use crate::measure::Ask;
use crate::scene::ItemShape;
use crate::visibility::hiders::Hiders;
use crate::visibility::occlusion::{self, Interleaved, MaskedInner, OcclusionBuffer};
use crate::visibility::region::doom::DoomMap;
use crate::visibility::{Rays, SampleGrid, Solids, inscribed};

pub(super) const RULE: Rule = Rule {
    name: "occlusion",
    left_out: "occlusion culling",
    advice: [
        "no occlusion culling: too little is hidden",
        "cull what is hidden (masked-inner)",
    ],
    statistic_name: "share of the items in the view that others hide",
    left_out_if: LeftOutIf::AtMost,
    by: By::Rule,
    prepare,
};

pub(super) const BUFFER_RULE: Rule = Rule {
    name: "occlusion-buffer",
    left_out: "half of the occlusion buffer's columns and rows",
    advice: ["a buffer of 160x90 is enough", "use a buffer of 320x180"],
    statistic_name: "share of the items left by 160x90 that 320x180 removes as well",
    left_out_if: LeftOutIf::AtMost,
    by: By::Rule,
    prepare: prepare_buffer,
};

/// Pixels of the buffer that is usual, and of the smaller one.
const USUAL: SampleGrid = SampleGrid::new(320, 180);
const SMALL: SampleGrid = SampleGrid::new(160, 90);

/// Everything that is asked, and shared by both sides.
struct Occlusion {
    hiders: Hiders,
    views: Vec<View>,
}

/// A camera, and whether its eye is in the open.
struct View {
    rays: Rays,
    volume: ConvexVolume,
    is_open: bool,
}

impl Occlusion {
    /// Or why there is nothing to ask.
    fn of(case: &Case) -> Result<Occlusion, Unfit> {
        let scene = case.scene();
        let solids = (scene.item_shape() == ItemShape::Box).then(|| Solids::of(scene));
        let views = hidden::sights(case).map_err(not_applicable)?;
        let hiders = Hiders::of(
            scene,
            solids.as_ref(),
            inscribed::BOXES,
            case.spec.execution.threads,
        );
        if hiders.blocks.as_ref().is_some_and(|row| row.box_count == 0) {
            return Err(not_applicable(
                "no boxes are known in the solid between the map's rooms",
            ));
        }
        let rooms = DoomMap::of_scene(scene).and_then(|map| map.graph().ok());
        let mut homes = Vec::new();
        let views = views.into_iter().map(|(rays, volume)| View {
            is_open: hiders.is_open(&rays, || {
                let rooms = rooms.as_ref();
                rooms.is_some_and(|rooms| rooms.homes(&rays, &mut homes))
            }),
            rays,
            volume,
        });
        let views = views.collect();
        Ok(Occlusion { hiders, views })
    }
}

/// By the tree of the occluders, in a buffer of so many pixels.
fn asked<'c>(case: &Case, all: Rc<Occlusion>, grid: SampleGrid) -> Ask<'c> {
    let kernel = case.spec.execution.kernel;
    let culling = RefCell::new(Interleaved::new(MaskedInner::new(grid), kernel));
    Box::new(move |n, out| {
        let View {
            rays,
            volume,
            is_open,
        } = &all.views[n];
        let occluders = all.hiders.from_eye(*is_open);
        let view = occlusion::View::new(rays, volume, occluders, grid);
        culling.borrow_mut().cull(occluders, &view, out);
    })
}

fn prepare<'c>(case: &'c Case<'c>, omission: Omission) -> Result<Draft<'c>, Unfit> {
    let all = Rc::new(Occlusion::of(case)?);
    let predicted = predicted(case, &all);
    let on = format!(
        "masked-inner {}x{} against {}",
        USUAL.width, USUAL.height, case.spec.label
    );
    let kept = asked(case, all, USUAL);
    Ok(hidden::draft(
        case,
        omission,
        on,
        kept,
        Way::Base,
        predicted,
    ))
}

fn prepare_buffer<'c>(case: &'c Case<'c>, omission: Omission) -> Result<Draft<'c>, Unfit> {
    let all = Rc::new(Occlusion::of(case)?);
    let on = "masked-inner 320x180 against 160x90".to_owned();
    let left_out = Way::Other(asked(case, all.clone(), SMALL));
    let kept = asked(case, all.clone(), USUAL);
    let few = [SMALL, USUAL].map(|grid| {
        let ask = asked(case, all.clone(), grid);
        hidden::mean_count(&ask, all.views.len(), PROBED)
    });
    let predicted = 1.0 - few[1] / few[0];
    Ok(hidden::draft(case, omission, on, kept, left_out, predicted))
}

/// The share that is removed in a few of the cameras. (Rays to a few items said 68 % of a
/// wood, of which 28 % is removed: many a thing there hides a part of a pixel or of an item.)
fn predicted(case: &Case, all: &Rc<Occlusion>) -> f64 {
    let kept = asked(case, all.clone(), USUAL);
    let in_view: Ask = Box::new(|frame, out| case.query(frame, out));
    let [left, given] =
        [&kept, &in_view].map(|ask| hidden::mean_count(ask, all.views.len(), PROBED));
    match given > 0.0 {
        true => 1.0 - left / given,
        false => 0.0,
    }
}
