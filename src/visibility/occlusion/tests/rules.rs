//! Rules of the occlusion stage, each on a few boxes.

use glam::DVec3;

use super::super::{MaskedCentre, MaskedInner, NoOcclusion, OcclusionBuffer, ZBuffer};
use super::by_rays::{Ready, with_view};
use super::kept;
use crate::camera::{Camera, Frame, Lens};
use crate::kernel::Kernel;
use crate::query::ItemId;
use crate::scene::{Scene, WorldBox};
use crate::visibility::SampleGrid;

fn solid(min: [f64; 3], max: [f64; 3]) -> WorldBox {
    WorldBox::new(min.into(), max.into())
}

/// Items that both couplings keep; panics if their answers differ.
fn kept_of<B: OcclusionBuffer>(boxes: &[WorldBox], eye: DVec3, lens: Lens) -> Vec<ItemId> {
    let ready = Ready::of(Scene::from_boxes("few", boxes).unwrap());
    let frame = Frame::looking_along(eye, DVec3::X, DVec3::Z).unwrap();
    let grid = SampleGrid::new(64, 40);
    with_view(&ready, &Camera { frame, lens }, grid, |view, _| {
        let answers = kept::<B>(&ready, view, Kernel::best());
        assert!(answers.iter().all(|kept| *kept == answers[0]));
        answers[0].clone()
    })
}

fn perspective(near: f64) -> Lens {
    Lens::perspective(60.0, 1.6, near, None).unwrap()
}

/// Boxes far outside of every view, so that no other box is at the scene's bounds.
fn bounds() -> [WorldBox; 2] {
    [solid([-90.0; 3], [-89.0; 3]), solid([900.0; 3], [901.0; 3])]
}

fn within_bounds(boxes: &[WorldBox]) -> Vec<WorldBox> {
    boxes.iter().copied().chain(bounds()).collect()
}

const WALL: ([f64; 3], [f64; 3]) = ([10.0, -3.0, -3.0], [11.0, 3.0, 3.0]);

#[test]
fn a_wall_hides_what_is_behind_it_and_nothing_beside_it() {
    let behind = solid([20.0, -1.0, -1.0], [21.0, 1.0, 1.0]);
    let beside = solid([20.0, 5.0, -1.0], [21.0, 7.0, 1.0]);
    let boxes = within_bounds(&[solid(WALL.0, WALL.1), behind, beside]);
    let parallel = Lens::orthographic(20.0, 1.6, 0.5, 100.0).unwrap();
    let off_axis = Lens::off_axis([-0.4, 0.5, -0.2, 0.35], 0.5, Some(500.0)).unwrap();
    for lens in [perspective(0.5), parallel, off_axis] {
        assert_eq!(kept_of::<MaskedInner>(&boxes, DVec3::ZERO, lens), [0, 2]);
        assert_eq!(kept_of::<MaskedCentre>(&boxes, DVec3::ZERO, lens), [0, 2]);
        assert_eq!(kept_of::<ZBuffer>(&boxes, DVec3::ZERO, lens), [0, 2]);
        assert_eq!(kept_of::<NoOcclusion>(&boxes, DVec3::ZERO, lens), [0, 1, 2]);
    }
}

#[test]
fn what_is_as_near_is_not_hidden() {
    // The same wall twice, and a box flush with its front.
    let flush = solid([10.0, -1.0, -1.0], [12.0, 1.0, 1.0]);
    let wall = solid(WALL.0, WALL.1);
    let boxes = within_bounds(&[wall, wall, flush]);
    assert_eq!(
        kept_of::<MaskedInner>(&boxes, DVec3::ZERO, perspective(0.5)),
        [0, 1, 2]
    );
}

#[test]
fn what_is_as_large_in_the_image_is_not_hidden() {
    // Exactly as large as the wall's shadow: rays along its edge see it.
    let larger = solid([20.0, -6.0, -6.0], [21.0, 6.0, 6.0]);
    let boxes = within_bounds(&[solid(WALL.0, WALL.1), larger]);
    assert_eq!(
        kept_of::<MaskedInner>(&boxes, DVec3::ZERO, perspective(0.5)),
        [0, 1]
    );
}

#[test]
fn what_is_nearer_than_near_hides_nothing_but_beside_the_window_it_does() {
    let behind = solid([20.0, -1.0, -1.0], [21.0, 1.0, 1.0]);
    let boxes = within_bounds(&[solid(WALL.0, WALL.1), behind]);
    // The near plane cuts off the wall's front: rays do not meet the wall at all.
    assert_eq!(
        kept_of::<MaskedInner>(&boxes, DVec3::ZERO, perspective(10.5)),
        [0, 1]
    );
    // A long wall beside the eye crosses the near plane, and hides.
    let long = solid([-50.0, 2.0, -30.0], [80.0, 3.0, 30.0]);
    let beyond = solid([30.0, 8.0, -1.0], [31.0, 9.0, 1.0]);
    let boxes = within_bounds(&[long, beyond]);
    assert_eq!(
        kept_of::<MaskedInner>(&boxes, DVec3::ZERO, perspective(0.5)),
        [0]
    );
    let parallel = Lens::orthographic(20.0, 1.6, 0.5, 100.0).unwrap();
    // Parallel rays start inside the wall that crosses their near plane.
    let across = solid([0.0, -4.0, -4.0], [1.0, 4.0, 4.0]);
    let boxes = within_bounds(&[across, behind]);
    assert!(kept_of::<MaskedInner>(&boxes, DVec3::ZERO, parallel).contains(&1));
}

#[test]
fn what_stands_on_the_floor_hides_the_feet_behind_it() {
    // From this height the wall's lower edge falls inside a row of pixels.
    let wall = solid([10.0, -3.0, 0.0], [11.0, 3.0, 3.0]);
    let behind = solid([10.8, -1.0, 0.0], [11.2, 1.0, 1.0]);
    let eye = DVec3::new(0.0, 0.0, 1.7);
    let floor = [wall, behind, solid([0.0, 0.0, 0.0], [1.0, 1.0, 0.0])];
    assert!(!kept_of::<MaskedInner>(&floor, eye, perspective(0.1)).contains(&1));
    // With a box below the floor, that row of pixels is visible.
    let cellar = within_bounds(&floor);
    assert!(kept_of::<MaskedInner>(&cellar, eye, perspective(0.1)).contains(&1));
    // An eye below the floor sees from below what stands on it.
    let below = DVec3::new(0.0, 0.0, -1.7);
    assert!(kept_of::<MaskedInner>(&floor, below, perspective(0.1)).contains(&1));
}
