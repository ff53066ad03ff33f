//! Proofs about triangles and about boxes with holes, and every way to doctor them.

use glam::{DVec3, Vec3};

use super::super::certificate::Cell;
use super::*;
use crate::camera::{Camera, Lens, look_at};
use crate::geometry::Aabb;
use crate::scene::{Mesh, SurfaceKind, Surfaces};
use crate::visibility::truth::{
    Class, Ends, Prover, RayIndex, SampleTruth, SurfaceIndex, certify, judge,
};
use crate::visibility::{Rays, SampleGrid, Solids};

const WALL: usize = 0;
const HIDDEN: usize = 1;
const BESIDE: usize = 2;

fn rays(near: f64) -> Rays {
    let frame = look_at(DVec3::ZERO, DVec3::X, DVec3::Z).unwrap();
    let lens = Lens::off_axis([-1.0, 1.0, -1.0, 1.0], near, None).unwrap();
    Rays::of(&Camera { frame, lens }).unwrap()
}

/// Seen from zero along x: a block, one behind it, one beside it.
fn blocks() -> Vec<Aabb> {
    let b = |low: [f32; 3], high: [f32; 3]| Aabb::new(low.into(), high.into());
    vec![
        b([2.0, -0.75, -2.0], [3.0, 0.75, 2.0]),
        b([6.0, -1.0, -1.0], [7.0, 1.0, 1.0]),
        b([6.0, 4.0, -1.0], [7.0, 5.0, 1.0]),
    ]
}

/// The blocks as triangles.
fn surfaces(kind: SurfaceKind, two_sided: bool) -> Surfaces {
    let mut all = Surfaces::about(DVec3::ZERO);
    blocks()
        .iter()
        .for_each(|b| all.push_box(kind, two_sided, b));
    all
}

fn written() -> Vec<WorldBox> {
    let of = |b: &Aabb| WorldBox::new(b.min.as_dvec3(), b.max.as_dvec3());
    blocks().iter().map(of).collect()
}

/// Proofs of the three, with a box within the first that is a little smaller.
fn certified(surfaces: &Surfaces) -> Certificates {
    let inner = WorldBox::new(DVec3::new(2.25, -0.7, -1.75), DVec3::new(2.75, 0.7, 1.75));
    // A box of no use, as the first of the two.
    let aside = WorldBox::new(DVec3::new(2.5, 0.0, 1.5), DVec3::new(2.6, 0.1, 1.6));
    let mut solids = judge::solids(&written());
    solids.push(&aside);
    solids.push(&inner);
    let rays = rays(1.0);
    let index = SurfaceIndex::build(surfaces);
    let truth = SampleTruth::of_surfaces(&index, &rays, SampleGrid::new(32, 32), 1);
    let corners = [inner.min.to_array(), inner.max.to_array()];
    let of_no_use = [aside.min.to_array(), aside.max.to_array()];
    let hide = [of_no_use, corners].map(|corners| (Some(WALL as ItemId), corners));
    let hide = Hiders::Within(hide.to_vec());
    let hiders = RayIndex::build_of(&solids, &[3, 4]);
    let prover = Prover::hidden_by(hide, &solids, &hiders, &rays);
    let items = [0, 1, 2];
    certify(
        "blocks",
        &prover,
        Ends::Triangles(&index),
        &rays,
        &truth,
        &items,
        1,
    )
}

fn verify(certificates: &Certificates, surfaces: &Surfaces) -> Result<Counts, &'static str> {
    let boxes = written();
    let facts = Facts::of_surfaces(&boxes, surfaces);
    check(certificates, &facts).map_err(|rejected| rejected.reason)
}

fn within(certificates: &mut Certificates) -> &mut (Option<ItemId>, [[f64; 3]; 2]) {
    match &mut certificates.hiders {
        Hiders::Within(boxes) => &mut boxes[0],
        other => panic!("{other:?}"),
    }
}

#[test]
fn what_is_behind_a_box_within_triangles_is_proven_hidden() {
    let all = surfaces(SurfaceKind::Opaque, false);
    let certificates = certified(&all);
    let text = serde_json::to_string(&certificates).unwrap();
    let read: Certificates = serde_json::from_str(&text).unwrap();
    assert_eq!(read, certificates);
    // Only what a proof names is in the file.
    assert!(matches!(&read.hiders, Hiders::Within(boxes) if boxes.len() == 1));
    let counts = verify(&read, &all).unwrap();
    assert_eq!((counts.visible, counts.hidden, counts.undecided), (2, 1, 0));
    assert!(matches!(read.proofs[HIDDEN].1, Proof::Cover { .. }));
    // What does not hide has no box within it, but may be seen.
    let clear = surfaces(SurfaceKind::Clear, false);
    let not_opaque = "a box is within an item that does not hide";
    assert_eq!(verify(&certificates, &clear), Err(not_opaque));
}

#[test]
fn a_box_that_is_not_within_its_item_is_rejected() {
    let all = surfaces(SurfaceKind::Opaque, false);
    let with = |change: &dyn Fn(&mut Certificates)| {
        let mut certificates = certified(&all);
        change(&mut certificates);
        verify(&certificates, &all)
    };
    let not_inside = Err("a box is not inside the triangles of its item");
    let moved = |corner: usize, axis: usize, to: f64| {
        with(&|certificates| within(certificates).1[corner][axis] = to)
    };
    assert_eq!(moved(1, 1, 2.5), not_inside, "out of the side");
    assert_eq!(moved(0, 0, 1.5), not_inside, "out of the front");
    // All of the block is inside it, and one bit more is not.
    let whole = |certificates: &mut Certificates| {
        within(certificates).1 = [[2.0, -0.75, -2.0], [3.0, 0.75, 2.0]];
    };
    assert!(with(&whole).is_ok());
    let more = |certificates: &mut Certificates| {
        whole(certificates);
        within(certificates).1[1][2] = 2.0_f64.next_up();
    };
    assert_eq!(with(&more), not_inside);
    let elsewhere =
        |certificates: &mut Certificates| within(certificates).0 = Some(BESIDE as ItemId);
    assert_eq!(with(&elsewhere), not_inside);
    let none = Err("a box within an item is none");
    assert_eq!(moved(1, 0, f64::NAN), none);
    assert_eq!(moved(1, 0, 2.25), none);
    assert_eq!(with(&|c| within(c).0 = Some(9)), none);
    // A second box is as good as the first; what is of an earlier item, or more than
    // anybody needs, is not looked at.
    let again = |c: &mut Certificates, item: ItemId, times: usize| match &mut c.hiders {
        Hiders::Within(boxes) => {
            let corners = boxes[0].1;
            boxes.extend(std::iter::repeat_n((Some(item), corners), times));
        }
        other => panic!("{other:?}"),
    };
    assert!(with(&|c| again(c, WALL as ItemId, 15)).is_ok());
    let disorder =
        Err("boxes are not by ascending item, those below the ground first, or too many of one");
    assert_eq!(with(&|c| again(c, WALL as ItemId, 16)), disorder);
    let backward = |c: &mut Certificates| {
        within(c).0 = Some(BESIDE as ItemId);
        again(c, WALL as ItemId, 1);
    };
    assert_eq!(with(&backward), disorder);
    let boxes_hide = |c: &mut Certificates| c.hiders = Hiders::Items;
    let other = Err("what it says that hides is not what the items are");
    assert_eq!(with(&boxes_hide), other);
    // The box around triangles hides nothing; the one that is gone, neither.
    let named = |number: ItemId| {
        with(&|certificates| match &mut certificates.proofs[HIDDEN].1 {
            Proof::Cover { cell, .. } => *cell = Cell::Behind(number),
            other => panic!("{other:?}"),
        })
    };
    assert_eq!(named(0), Err("the box in front is one around triangles"));
    assert_eq!(named(4), Err("there is no such box in front"));
    let near = with(&|certificates| certificates.view.hides_from = 2.5);
    assert_eq!(
        near,
        Err("a box is within an item that reaches before the near plane")
    );
}

#[test]
fn an_open_or_turned_surface_holds_no_box() {
    let all = surfaces(SurfaceKind::Opaque, false);
    let certificates = certified(&all);
    let not_inside = Err("a box is not inside the triangles of its item");
    // Without its last triangle the first block is open.
    let mut open = all.clone();
    open.triangles[11] = open.triangles[10];
    assert_eq!(verify(&certificates, &open), not_inside);
    // Inside out there is nothing of it to be seen from before.
    let mut turned = all.clone();
    turned.triangles[..12].iter_mut().for_each(|t| t.swap(1, 2));
    assert_eq!(verify(&certificates, &turned), not_inside);
    // A triangle that sticks out of the box around the item.
    let mut out = all.clone();
    let point = out.points.iter_mut().find(|p| p.x == 3.0).unwrap();
    *point += Vec3::X;
    assert_eq!(verify(&certificates, &out), not_inside);
    // Another piece of the same item may go through the box; it hides no less.
    let mut two = Surfaces::about(DVec3::ZERO);
    let small = Aabb::new(Vec3::new(2.4, -0.1, -0.1), Vec3::new(2.6, 0.1, 0.1));
    let mut points: Vec<Vec3> = all.points[..8].to_vec();
    let mut triangles: Vec<[u32; 3]> = all.triangles[..12].to_vec();
    points.extend((0..8).map(|k| small.corner(k)));
    let more: Vec<_> = triangles.iter().map(|t| t.map(|p| p + 8)).collect();
    triangles.extend(more);
    two.push(SurfaceKind::Opaque, false, &points, &triangles);
    for b in &blocks()[1..] {
        two.push_box(SurfaceKind::Opaque, false, b);
    }
    assert!(verify(&certificates, &two).is_ok());
}

#[test]
fn a_witness_of_triangles_that_was_moved_is_rejected() {
    let all = surfaces(SurfaceKind::Opaque, false);
    let witness = |item: usize, to: [f64; 3]| {
        let mut certificates = certified(&all);
        let (origin, direction) = ([0.0; 3], to);
        certificates.proofs[item].1 = Proof::Witness { origin, direction };
        verify(&certificates, &all)
    };
    assert!(witness(WALL, [1.0, 0.0, 0.0]).is_ok());
    // Along the diagonal of its front, on the edge that two triangles share.
    assert!(witness(WALL, [1.0, 0.1875, 0.5]).is_ok());
    assert!(witness(WALL, [1.0, 0.375, 1.0]).is_ok(), "at its corner");
    let missed = Err("its ray does not meet the item");
    assert_eq!(witness(BESIDE, [1.0, 0.0, 0.0]), missed);
    assert_eq!(
        witness(HIDDEN, [1.0, 0.0, 0.0]),
        Err("another item is in front of it")
    );
    assert!(witness(BESIDE, [1.0, 0.75, 0.0]).is_ok());
    // From its back a one-sided triangle is not seen; from both sides it is.
    let mut turned = all.clone();
    turned.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    let mut certificates = certified(&all);
    certificates.hiders = Hiders::Within(Vec::new());
    certificates.proofs.truncate(1);
    let (origin, direction) = ([0.0; 3], [1.0, 0.0, 0.0]);
    certificates.proofs[0].1 = Proof::Witness { origin, direction };
    assert!(verify(&certificates, &all).is_ok());
    // The far side is met, as it faces the eye now.
    assert!(verify(&certificates, &turned).is_ok());
    let mut front_only = turned.clone();
    front_only.triangles[..12].rotate_left(4);
    let far = |t: &[u32; 3]| t.iter().all(|p| front_only.points[*p as usize].x == 3.0);
    let behind = front_only.triangles.iter().position(far).unwrap();
    front_only.triangles[behind] = front_only.triangles[behind + 2];
    front_only.triangles[behind + 1] = front_only.triangles[behind + 2];
    assert_eq!(verify(&certificates, &front_only), missed);
    front_only.two_sided[WALL] = true;
    assert!(verify(&certificates, &front_only).is_ok());
}

#[test]
fn an_eye_in_the_box_around_triangles_proves_nothing() {
    let all = surfaces(SurfaceKind::Opaque, false);
    let mut certificates = certified(&all);
    certificates.hiders = Hiders::Within(Vec::new());
    certificates.proofs.truncate(1);
    certificates.proofs[0].1 = Proof::AroundEye;
    certificates.view.eye = [2.5, 0.0, 0.0];
    assert_eq!(
        verify(&certificates, &all),
        Err("the eye is in a box around triangles")
    );
}

#[test]
fn what_has_holes_neither_hides_nor_shows_by_its_box() {
    let boxes = written();
    let solids = judge::solids(&boxes);
    let all = RayIndex::build(&solids);
    let rays = rays(1.0);
    let truth = SampleTruth::of(&solids, &all, &rays, SampleGrid::new(32, 32), 1);
    let certified = |cut_out: [bool; 3]| {
        let whole: Vec<ItemId> = (0..3).filter(|&k| !cut_out[k as usize]).collect();
        let hiders = RayIndex::build_of(&solids, &whole);
        let prover = Prover::hidden_by(Hiders::Uncut("fence".into()), &solids, &hiders, &rays);
        let ends = Ends::CutOuts(&all, &cut_out);
        certify("blocks", &prover, ends, &rays, &truth, &[0, 1, 2], 1)
    };
    let verify = |certificates: &Certificates, cut_out: &[bool]| {
        let facts = Facts {
            boxes: &boxes,
            cut_out,
            surfaces: None,
            walls: &[],
        };
        check(certificates, &facts).map_err(|rejected| rejected.reason)
    };
    let counts = |cut_out: [bool; 3]| {
        let counts = verify(&certified(cut_out), &cut_out).unwrap();
        [counts.visible, counts.hidden, counts.undecided]
    };
    assert_eq!(counts([false, false, true]), [1, 1, 1]);
    // Through the fence the block behind it may be seen, or not.
    assert_eq!(counts([true, false, false]), [1, 0, 2]);
    let hidden = certified([false, false, true]);
    assert_eq!(
        verify(&hidden, &[true, false, true]),
        Err("it has holes: its box does not show it")
    );
    let mut only_hidden = hidden.clone();
    only_hidden
        .proofs
        .retain(|(item, _)| *item as usize == HIDDEN);
    assert_eq!(
        verify(&only_hidden, &[true, false, false]),
        Err("what is in front has holes")
    );
    assert!(verify(&hidden, &[]).is_err(), "boxes without holes");
}

/// No ray between the samples sees what is proven hidden, and all that is visible at one
/// has a proof, in a wood whose trees stand before each other.
#[test]
fn proofs_hold_in_a_wood() {
    let surfaces = (Mesh::named("mesh:forest").unwrap().build)(20_000, 3);
    let scene = surfaces.clone().into_scene("wood").unwrap();
    let inner = crate::visibility::inscribed::InnerBoxes::of(&surfaces, 16, 4, 1);
    let boxes: Vec<WorldBox> = scene.written().collect();
    let mut solids = Solids::of(&scene);
    let mut within = Vec::new();
    let centre = scene.world_bounds();
    let eye = DVec3::new(centre.min.x, centre.min.y, centre.max.z * 0.5);
    let frame = look_at(eye, (centre.min + centre.max) / 2.0, DVec3::Z).unwrap();
    let lens = Lens::perspective(60.0, 1.5, 0.01, None).unwrap();
    let rays = Rays::of(&Camera { frame, lens }).unwrap();
    for (item, b) in &inner.boxes {
        let own = boxes[*item as usize];
        let nearest = DVec3::select(frame.forward().cmpgt(DVec3::ZERO), own.min, own.max);
        if (nearest - eye).dot(frame.forward()) > 0.02 {
            let b = WorldBox::within(b, scene.origin);
            solids.push(&b);
            within.push((Some(*item), [b.min.to_array(), b.max.to_array()]));
        }
    }
    assert!(within.len() > 20, "{}", within.len());
    let numbers: Vec<ItemId> = (boxes.len() as ItemId..solids.boxes.len() as ItemId).collect();
    let hiders = RayIndex::build_of(&solids, &numbers);
    let prover = Prover::hidden_by(Hiders::Within(within), &solids, &hiders, &rays);
    let index = SurfaceIndex::build(&surfaces);
    let truth = SampleTruth::of_surfaces(&index, &rays, SampleGrid::new(48, 32), 1);
    let items: Vec<ItemId> = (0..boxes.len() as ItemId).collect();
    let ends = Ends::Triangles(&index);
    let certificates = certify("wood", &prover, ends, &rays, &truth, &items, 1);
    let facts = Facts::of_surfaces(&boxes, &surfaces);
    let counts = check(&certificates, &facts).unwrap();
    assert!(counts.hidden > 0, "{counts:?}");
    assert!(counts.visible >= truth.visible.len(), "{counts:?}");
    let seen =
        crate::visibility::truth::visible_surfaces_by_random_rays(&index, &rays, 20_000, 1, 1);
    for (item, proof) in &certificates.proofs {
        let class = Class::of(&truth, *item, proof);
        assert!(class != Class::Hidden || !seen.contains(item), "{item}");
    }
}
