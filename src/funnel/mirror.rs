//! An item as a mirror.
//!
//! The reflected camera draws the samples that see the mirror (the stencil), or all of
//! them. Both show the same there.

use serde::Serialize;

use super::error::fits_drawing;
use super::fragment_stage::FragmentCounts;
use super::item_stages::ItemStages;
use super::stage::Step;
use super::world::World;
use crate::camera::Camera;
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::fragment::{Canvas, Piece, Tests, draw};

/// Items in a mirror. Counts are means per view.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct MirrorRow {
    /// The item whose face it is.
    pub item: ItemId,
    /// The axis that the face is across: that of the item's shortest edge.
    pub axis: char,
    /// Views in which it is in front at a sample.
    pub view_count: usize,
    /// Samples at which it is in front.
    pub marked_count: f64,
    /// Items that are in front in it at one of them.
    pub shown_count: f64,
    /// Counts of these samples only, with those that find them.
    pub with_stencil: FragmentCounts,
    /// Counts of the whole image.
    pub without_stencil: FragmentCounts,
    /// Samples of the mirror that the two show differently: none.
    pub wrong_sample_count: u64,
}

/// The mirror in every view, behind the items that `steps` leave.
///
/// It shows every other item of the scene. `None` without views or for triangles.
///
/// # Errors
/// Items that cover too many samples.
pub fn mirrored(
    item: ItemId,
    world: &World,
    stages: &ItemStages,
    steps: &[Step],
) -> Result<Option<MirrorRow>, String> {
    let Some(solids) = world.shape.boxes() else {
        return Ok(None);
    };
    let own = &solids.boxes[item as usize];
    let axis = (own.max - own.min).min_position();
    let others = (0..solids.boxes.len() as ItemId).filter(|&other| other != item);
    let others: Vec<Piece> = others.map(Piece::whole).collect();
    let (mut with, mut without) = (Vec::new(), Vec::new());
    let (mut views, mut marked, mut shown, mut wrong) = (0, 0, 0, 0);
    for view in world.views() {
        let rays = world.rays(view);
        let Some(face) = face_towards(rays.camera(), own, axis) else {
            with.push(Default::default());
            without.push(Default::default());
            continue;
        };
        let canvas = Canvas::of(rays, world.samples);
        let left = world.listed(stages.items(steps, view));
        let left: Vec<Piece> = left.iter().copied().map(Piece::whole).collect();
        let direct = draw(&canvas, solids, &left, &Tests::default());
        let stencil = direct.depth.stencil(&canvas, &[face]);
        let reflected = canvas.mirrored(axis, face.min[axis]);
        let screen = reflected.screen();
        let rectangles = solids.boxes.iter().filter_map(|b| screen.rectangle(b));
        fits_drawing(world.samples, rectangles)?;
        let tests = Tests {
            stencil: Some(&stencil),
            surfaces: None,
        };
        let mut seen = draw(&reflected, solids, &others, &tests);
        let all = draw(&reflected, solids, &others, &Tests::default());
        seen.tally.asked += stencil.tested;
        let [own, other] = [&seen, &all].map(|drawn| drawn.depth.ids());
        let marks = (0..own.len()).filter(|&sample| stencil.holds(sample));
        wrong += marks.filter(|&sample| own[sample] != other[sample]).count() as u64;
        views += usize::from(stencil.count() > 0);
        marked += stencil.count();
        shown += seen.depth.visible(&reflected).len();
        with.push(seen.tally);
        without.push(all.tally);
    }
    let mean = |sum: usize| sum as f64 / world.views.len() as f64;
    let counts = FragmentCounts::of(&with).zip(FragmentCounts::of(&without));
    Ok(counts.map(|(with_stencil, without_stencil)| MirrorRow {
        item,
        axis: ['x', 'y', 'z'][axis],
        view_count: views,
        marked_count: mean(marked),
        shown_count: mean(shown),
        with_stencil,
        without_stencil,
        wrong_sample_count: wrong,
    }))
}

/// The face of a box across an axis whose front a camera sees.
fn face_towards(camera: &Camera, b: &WorldBox, axis: usize) -> Option<WorldBox> {
    let (eye, forward) = (camera.frame.eye[axis], camera.frame.forward()[axis]);
    let [is_low, is_high] = match camera.lens.is_orthographic() {
        true => [forward > 0.0, forward < 0.0],
        false => [eye < b.min[axis], eye > b.max[axis]],
    };
    let at = match (is_low, is_high) {
        (true, _) => b.min[axis],
        (_, true) => b.max[axis],
        _ => return None,
    };
    let mut face = *b;
    (face.min[axis], face.max[axis]) = (at, at);
    Some(face)
}
