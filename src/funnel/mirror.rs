//! An item as a mirror: what is seen in it is drawn by the reflected camera, on the samples
//! that see the mirror (the stencil) or on all of them. Both show the same there.

use serde::Serialize;

use super::fragments::FragmentCounts;
use super::left_out::{Reason, fits_drawing};
use super::pass::Pass;
use super::world::World;
use crate::camera::Camera;
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::Solids;
use crate::visibility::fragment::{Canvas, Piece, Stencil, Tests, draw};

/// What a mirror shows. Counts are means per view.
#[derive(Clone, PartialEq, Debug, Serialize)]
#[non_exhaustive]
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
    /// Drawn on these samples only, with those asked to find them.
    pub with_stencil: FragmentCounts,
    /// Drawn on the whole image.
    pub without_stencil: FragmentCounts,
    /// Samples of the mirror that the two show differently: none.
    pub wrong_sample_count: u64,
}

/// The mirror in every view; `set` is what the chain leaves of each, which may hide it. It
/// shows any other item. `None` if stopped.
///
/// # Errors
/// More items than are drawn.
pub fn mirrored(
    item: ItemId,
    world: &World,
    solids: &Solids,
    pass: &Pass,
    set: usize,
    stop: &dyn Fn() -> bool,
) -> Result<Option<MirrorRow>, Reason> {
    let own = &solids.boxes[item as usize];
    let axis = (own.max - own.min).min_position();
    let others = (0..solids.boxes.len() as ItemId).filter(|&other| other != item);
    let others: Vec<Piece> = others.map(Piece::whole).collect();
    let [mut with, mut without] = [(); 2].map(|()| Vec::new());
    let (mut views, mut marked, mut shown, mut wrong) = (0, 0, 0, 0);
    for view in 0..world.views() {
        if stop() {
            return Ok(None);
        }
        let rays = world.rays(view);
        let Some(face) = face_towards(rays.camera(), own, axis) else {
            with.push(Default::default());
            without.push(Default::default());
            continue;
        };
        let at = face.min[axis];
        let canvas = Canvas::of(rays, world.samples);
        let left: Vec<Piece> = world
            .listed(pass.items(set, view))
            .iter()
            .map(|&item| Piece::whole(item))
            .collect();
        let direct = draw(&canvas, solids, &left, &Tests::default());
        let stencil = Stencil::of_rectangle(&canvas, &face, &direct.depth);
        let reflected = canvas.mirrored(axis, at);
        let all = solids.boxes.iter();
        fits_drawing(
            world.samples,
            all.filter_map(|b| reflected.screen().rectangle(b)),
        )?;
        let tests = Tests {
            stencil: Some(&stencil),
            surfaces: None,
        };
        let mut seen = draw(&reflected, solids, &others, &tests);
        let all = draw(&reflected, solids, &others, &Tests::default());
        seen.tally.asked += stencil.asked();
        let [own, other] = [&seen, &all].map(|drawn| drawn.depth.ids());
        let marks = (0..own.len()).filter(|&sample| stencil.holds(sample));
        wrong += marks.filter(|&sample| own[sample] != other[sample]).count() as u64;
        views += usize::from(stencil.count() > 0);
        marked += stencil.count();
        shown += seen.depth.visible(&reflected).len();
        with.push(seen.tally);
        without.push(all.tally);
    }
    let mean = |sum: usize| sum as f64 / world.views() as f64;
    let of = FragmentCounts::of;
    let row = of(&with)
        .zip(of(&without))
        .map(|(with_stencil, without_stencil)| MirrorRow {
            item,
            axis: ['x', 'y', 'z'][axis],
            view_count: views,
            marked_count: mean(marked),
            shown_count: mean(shown),
            with_stencil,
            without_stencil,
            wrong_sample_count: wrong,
        });
    Ok(row)
}

/// The face of a box across an axis that a camera sees the front of.
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
