//! Every doctored certificate is rejected.

use super::super::certificate::{Cell, Edge};
use super::line::Line;
use super::part::Part;
use super::*;
use crate::arithmetic::Expansion;
use crate::camera::{Camera, Lens, look_at};
use crate::visibility::truth::{Ends, Prover, RayIndex, SampleTruth, certify, judge};
use crate::visibility::{Rays, SampleGrid};
use glam::DVec3;

const POST: ItemId = 0;
const LEFT: ItemId = 1;
const HIDDEN: ItemId = 3;
const BACK: ItemId = 4;
/// The same box as the hidden one.
const TWIN: ItemId = 7;

/// From zero along x: a post, two halves of a wall, two things behind them.
fn boxes() -> Vec<WorldBox> {
    let b = |x: [f64; 2], y: [f64; 2], z: [f64; 2]| {
        WorldBox::new(DVec3::new(x[0], y[0], z[0]), DVec3::new(x[1], y[1], z[1]))
    };
    let around = b([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5]);
    let near = b([0.5, 0.75], [-5.0, 5.0], [-5.0, 5.0]);
    vec![
        b([1.5, 1.75], [-0.125, 0.125], [-2.0, 0.5]),
        b([2.0, 3.0], [0.0, 5.0], [-5.0, 5.0]),
        b([2.0, 3.0], [-5.0, 0.0], [-5.0, 5.0]),
        b([6.0, 7.0], [-1.0, 1.0], [-1.0, 1.0]),
        b([8.0, 9.0], [-2.0, 2.0], [-2.0, 2.0]),
        around,
        near,
        b([6.0, 7.0], [-1.0, 1.0], [-1.0, 1.0]),
    ]
}

fn rays(parallel: bool) -> Rays {
    let frame = look_at(DVec3::ZERO, DVec3::X, DVec3::Z).unwrap();
    let lens = match parallel {
        false => Lens::off_axis([-1.0, 1.0, -1.0, 1.0], 1.0, None),
        true => Lens::orthographic(4.0, 1.0, 1.0, 90.0),
    };
    Rays::of(&Camera {
        frame,
        lens: lens.unwrap(),
    })
    .unwrap()
}

fn certified(parallel: bool) -> Certificates {
    let solids = judge::solids(&boxes());
    let index = RayIndex::build(&solids);
    let rays = rays(parallel);
    let truth = SampleTruth::of(&solids, &index, &rays, SampleGrid::new(16, 16), 1);
    let prover = Prover::new(&solids, &index, &rays);
    certify(
        "wall",
        &prover,
        Ends::Boxes(&index),
        &rays,
        &truth,
        &[0, 1, 2, 3, 4],
        2,
    )
}

fn doctored(parallel: bool, what: impl Fn(&mut Certificates)) -> &'static str {
    let mut certificates = certified(parallel);
    what(&mut certificates);
    check(&certificates, &Facts::of_boxes(&boxes()))
        .expect_err("not noticed")
        .reason
}

fn cell(certificates: &mut Certificates, item: ItemId) -> &mut Cell {
    match &mut certificates.proofs[item as usize].1 {
        Proof::Cover { cell, .. } => cell,
        other => panic!("{other:?}"),
    }
}

#[test]
fn certificates_hold_and_survive_being_written() {
    for parallel in [false, true] {
        let certificates = certified(parallel);
        let text = serde_json::to_string(&certificates).unwrap();
        let read: Certificates = serde_json::from_str(&text).unwrap();
        assert_eq!(read, certificates);
        let counts = check(&read, &Facts::of_boxes(&boxes())).unwrap();
        assert_eq!((counts.visible, counts.hidden, counts.undecided), (3, 2, 0));
        assert!(
            counts.cells >= 4,
            "the premise: a cell for each half of the wall"
        );
        assert_eq!(read.view, View::of(&rays(parallel)));
    }
}

#[test]
fn a_witness_that_was_moved_is_rejected() {
    for parallel in [false, true] {
        let moved = |by: DVec3, item: ItemId| {
            doctored(parallel, move |certificates| {
                let Proof::Witness { origin, direction } =
                    &mut certificates.proofs[item as usize].1
                else {
                    panic!("the premise: visible");
                };
                let at = if parallel { origin } else { direction };
                (0..3).for_each(|k| at[k] += by[k]);
            })
        };
        assert_eq!(
            moved(DVec3::Y * 0.5, POST),
            "its ray does not meet the item"
        );
        assert_eq!(moved(DVec3::Y * 9.0, LEFT), "its ray is not in the view");
        if !parallel {
            assert_eq!(
                moved(DVec3::X, LEFT),
                "its ray does not count depth as the view does"
            );
        }
        // Onto the half of the wall that the post stands before.
        let hidden = doctored(parallel, |certificates| {
            certificates.proofs[LEFT as usize].1 = certificates.proofs[POST as usize].1.clone();
        });
        assert!(
            [
                "another item is in front of it",
                "its ray does not meet the item"
            ]
            .contains(&hidden)
        );
        let through = doctored(parallel, |certificates| {
            let (origin, direction) = ([0.0; 3], [1.0, 0.0, 0.0]);
            certificates.proofs[BACK as usize].1 = Proof::Witness { origin, direction };
        });
        assert_eq!(through, "another item is in front of it");
    }
}

#[test]
fn a_cover_that_was_doctored_is_rejected() {
    for parallel in [false, true] {
        let with = |item: ItemId, other: Cell| {
            doctored(parallel, |certificates| {
                *cell(certificates, item) = other.clone()
            })
        };
        let not_covering = "a box in front does not cover its cell";
        assert_eq!(with(HIDDEN, Cell::Behind(LEFT)), not_covering);
        assert_eq!(with(HIDDEN, Cell::Behind(POST)), not_covering);
        let behind = "a box in front is not nearer throughout its cell";
        assert_eq!(with(HIDDEN, Cell::Behind(BACK)), behind);
        assert_eq!(with(HIDDEN, Cell::Behind(HIDDEN)), behind);
        assert_eq!(
            with(HIDDEN, Cell::Behind(6)),
            "a box in front begins before the near plane"
        );
        assert_eq!(
            with(HIDDEN, Cell::Behind(99)),
            "there is no such box in front"
        );
        assert_eq!(
            with(HIDDEN, Cell::Empty),
            "a cell with rays is called empty"
        );
        let parts = |change: fn(&mut Edge, &mut [Cell; 2])| {
            doctored(parallel, |certificates| match cell(certificates, HIDDEN) {
                Cell::Parted { edge, cells, .. } => change(edge, cells),
                other => panic!("{other:?}"),
            })
        };
        assert_eq!(
            parts(|_, parts| parts[0] = Cell::Empty),
            "a cell with rays is called empty"
        );
        let other_lines = [not_covering, "a cell without rays claims something"];
        assert!(other_lines.contains(&parts(|_, parts| parts.swap(0, 1))));
        assert!(other_lines.contains(&parts(|edge, _| edge.upper[1] ^= true)));
        assert_eq!(parts(|edge, _| edge.axes = [1, 1]), "there is no such edge");
        let outlined = |change: fn(&mut Vec<u8>)| {
            doctored(parallel, |certificates| {
                match &mut certificates.proofs[HIDDEN as usize].1 {
                    Proof::Cover { outline, .. } => change(outline),
                    other => panic!("{other:?}"),
                }
            })
        };
        let around = "its outline does not go round the box";
        assert_eq!(outlined(|outline| outline.reverse()), around);
        assert_eq!(outlined(|outline| outline.truncate(3)), around);
        assert_eq!(outlined(|outline| outline.clear()), "its image has an area");
        assert_eq!(
            outlined(|outline| outline.push(outline[0])),
            "its outline is not one"
        );
    }
    // Boxes one behind the other, whose corners are one line of sight.
    let line = doctored(true, |certificates| {
        certificates.proofs[HIDDEN as usize].1 = Proof::Cover {
            outline: vec![0, 1, 3],
            except: Except::Nothing,
            cell: Cell::Empty,
        };
    });
    assert_eq!(line, "its outline does not go round the box");
}

#[test]
fn of_twins_only_the_first_hides_the_other() {
    for parallel in [false, true] {
        let with = |item: ItemId, front: ItemId, allowed: Except| {
            let mut certificates = certified(parallel);
            let Proof::Cover {
                outline,
                except,
                cell,
            } = &mut certificates.proofs[HIDDEN as usize].1
            else {
                panic!("the premise: hidden");
            };
            (*except, *cell) = (allowed, Cell::Behind(front));
            assert_eq!(outline.len(), 4);
            certificates.proofs[HIDDEN as usize].0 = item;
            check(&certificates, &Facts::of_boxes(&boxes()))
        };
        assert_eq!(
            with(TWIN, HIDDEN, Except::Ties).map(|counts| counts.tied),
            Ok(1)
        );
        assert!(with(TWIN, HIDDEN, Except::Nothing).is_err());
        assert!(with(HIDDEN, TWIN, Except::Lines).is_err());
        assert!(with(TWIN, TWIN, Except::Lines).is_err());
    }
}

#[test]
fn a_box_seen_edge_on_has_no_area() {
    let flat = WorldBox::new(DVec3::new(2.0, 0.0, -1.0), DVec3::new(3.0, 0.0, 1.0));
    let boxes = [flat, WorldBox::new(flat.min - DVec3::Y, flat.max)];
    let solids = judge::solids(&boxes);
    let index = RayIndex::build(&solids);
    for parallel in [false, true] {
        let rays = rays(parallel);
        let prover = Prover::new(&solids, &index, &rays);
        let with = |item: ItemId, proof: Proof| {
            let view = prover.view().clone();
            check(
                &Certificates::new("flat", 2, view, vec![(item, proof)]),
                &Facts::of_boxes(&boxes),
            )
        };
        let proof = prover.prove(0);
        assert_eq!(
            with(0, proof.clone()).map(|counts| counts.along_lines),
            Ok(1)
        );
        assert!(with(1, proof).is_err());
    }
}

#[test]
fn a_view_that_was_doctored_is_rejected() {
    for parallel in [false, true] {
        let near = doctored(parallel, |certificates| certificates.view.hides_from = 2.5);
        assert_eq!(near, "a box in front begins before the near plane");
        let wide = doctored(parallel, |certificates| {
            let item = &mut certificates.proofs[BACK as usize];
            item.1 = Proof::AroundEye;
        });
        assert_eq!(wide, "the eye is not in it");
        doctored(parallel, |certificates| certificates.view.near = f64::NAN);
        doctored(parallel, |certificates| certificates.boxes += 1);
        doctored(parallel, |certificates| certificates.proofs[0].0 = 77);
    }
}

#[test]
fn a_form_may_be_zero_along_one_open_side_only() {
    let view = certified(false).view;
    let corner = |k: usize, open: bool| {
        let numbers = [k as f64 + 1.0, 0.0, 0.0].map(Expansion::from);
        let side = Side {
            line: numbers.clone(),
            open,
        };
        (Line::new(&view, numbers), side)
    };
    let below = |open: [bool; 4], signs: [i32; 4]| {
        let corners = (0..4).map(|k| corner(k, open[k])).collect();
        let sign = |line: &Line| signs[line.numbers[0].estimate() as usize - 1];
        Part { corners }.below(sign)
    };
    let one = [true, false, false, false];
    assert!(below([false; 4], [-1; 4]) && below(one, [0, 0, -1, -1]));
    assert!(below(one, [-1, 0, -1, -1]) && below([true; 4], [0, -1, -1, 0]));
    assert!(!below([false; 4], [0, -1, -1, -1]));
    for signs in [
        [0, -1, -1, 0],
        [-1, -1, 0, -1],
        [0, 0, 0, -1],
        [1, 0, -1, -1],
    ] {
        assert!(!below(one, signs), "{signs:?}");
    }
    // Corners that face each other: zero along a line through the middle.
    assert!(!below([true; 4], [0, -1, 0, -1]));
}
