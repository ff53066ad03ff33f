//! Proofs by the plan of a map: the search against brute force, and doctored chains.

use glam::DVec3;

use super::super::certificate::PlanWall;
use super::*;
use crate::camera::{Camera, Lens, look_at};
use crate::scene::SeededRng;
use crate::visibility::truth::{Prover, RayIndex};
use crate::visibility::{Rays, Solids};

type Point = [f64; 2];

fn rays(eye: Point) -> Rays {
    let eye = DVec3::new(eye[0], eye[1], 0.5);
    let frame = look_at(eye, eye + DVec3::X, DVec3::Z).unwrap();
    let lens = Lens::perspective(90.0, 1.0, 0.01, None).unwrap();
    Rays::of(&Camera { frame, lens }).unwrap()
}

fn wall(item: ItemId, ends: [Point; 2], is_solid: bool) -> PlanWall {
    PlanWall {
        item,
        ends,
        is_solid,
    }
}

/// Upright boxes about walls from above.
fn boxes(walls: &[PlanWall]) -> Vec<WorldBox> {
    let of = |wall: &PlanWall| {
        let [a, b] = wall.ends.map(|[x, y]| DVec3::new(x, y, 0.0));
        WorldBox::new(a.min(b), a.max(b) + DVec3::Z)
    };
    walls.iter().map(of).collect()
}

fn covered(
    eye: Point,
    walls: &[PlanWall],
    boxes: &[WorldBox],
    item: ItemId,
    chain: &[ItemId],
) -> Result<Counts, &'static str> {
    let view = View::of(&rays(eye));
    let proof = Proof::Walls(chain.to_vec());
    let mut certificates = Certificates::new("plan", boxes.len(), view, vec![(item, proof)]);
    certificates.hiders = Hiders::Within(Vec::new());
    let surfaces = crate::scene::Surfaces::about(DVec3::ZERO);
    let facts = Facts {
        walls,
        surfaces: Some(&surfaces),
        ..Facts::of_boxes(boxes)
    };
    check(&certificates, &facts).map_err(|rejected| rejected.reason)
}

fn searched(eye: Point, walls: &[PlanWall], boxes: &[WorldBox], item: ItemId) -> Proof {
    let mut scene = crate::scene::Scene::about("plan", boxes, DVec3::ZERO).unwrap();
    scene.name = "plan".to_owned();
    let solids = Solids::of(&scene);
    let index = RayIndex::build_of(&solids, &[]);
    let rays = rays(eye);
    let prover = Prover::hidden_by(Hiders::Within(Vec::new()), &solids, &index, &rays);
    prover.among(walls).prove(item)
}

/// A corner of two walls and a gap beside it; behind them a wall, and a box.
fn corner() -> (Vec<PlanWall>, Vec<WorldBox>) {
    let walls = vec![
        wall(0, [[2.0, -2.0], [2.0, 0.0]], true),
        wall(1, [[2.0, 0.0], [3.0, 1.0]], true),
        wall(2, [[5.0, 1.5], [5.0, -1.5]], true),
        wall(3, [[4.0, -1.0], [4.0, 1.0]], false),
        wall(4, [[2.0, 0.0], [5.0, 0.0]], true),
    ];
    let mut boxes = boxes(&walls);
    boxes.push(WorldBox::new(
        DVec3::new(6.0, -1.0, 0.0),
        DVec3::new(7.0, 1.0, 1.0),
    ));
    (walls, boxes)
}

#[test]
fn walls_one_after_the_other_hide_what_is_behind_them() {
    let (walls, boxes) = corner();
    let eye = [0.0, -0.25];
    let checked = |item, chain: &[ItemId]| covered(eye, &walls, &boxes, item, chain);
    for item in [2, 3, 5] {
        let counts = checked(item, &[0, 1]).unwrap();
        assert_eq!((counts.hidden, counts.along_lines), (1, 0), "{item}");
        let Proof::Walls(found) = searched(eye, &walls, &boxes, item) else {
            panic!("{item}: not found");
        };
        assert_eq!(found, [0, 1], "{item}");
    }
    // It touches the wall before it in a corner.
    let touching = checked(4, &[0]).unwrap();
    assert_eq!((touching.hidden, touching.along_lines), (0, 1));
    let gap = Err("there is a gap between the walls before it");
    assert_eq!(checked(2, &[1, 0]), gap);
    assert_eq!(checked(2, &[1]), gap);
    let short = Err("the walls before it end before it does");
    assert_eq!(checked(2, &[0]), short);
    assert_eq!(checked(2, &[]), Err("there are no walls before it"));
    let not_solid = Err("what stands before it is no solid wall");
    assert_eq!(checked(2, &[3]), not_solid, "open");
    assert_eq!(checked(2, &[2]), not_solid, "itself");
    assert_eq!(checked(2, &[5]), not_solid, "a box");
    assert_eq!(checked(2, &[9]), not_solid);
    let behind = Err("a wall is not before it throughout its part");
    assert_eq!(checked(3, &[2]), behind);
    assert_eq!(
        covered([0.0, 0.0], &walls, &boxes, 2, &[4]),
        Err("a wall before it is seen edge on")
    );
    let inside = Err("the eye is in the item, from above");
    assert_eq!(covered([6.5, 0.0], &walls, &boxes, 5, &[0]), inside);
    // Without the map's word that the eye is in it, nothing is proven.
    let outside = Err("the eye is in no region of a map");
    assert_eq!(covered(eye, &[], &boxes, 2, &[0, 1]), outside);
}

/// By many ways from the eye: whether a point of the item is met before any solid wall.
fn is_seen(eye: Point, walls: &[PlanWall], item: usize) -> bool {
    let cross = |a: Point, b: Point| a[0] * b[1] - a[1] * b[0];
    let less = |a: Point, b: Point| [a[0] - b[0], a[1] - b[1]];
    let [from, to] = walls[item].ends;
    if cross(less(from, eye), less(to, eye)) == 0.0 {
        // Edge on there is nothing of it to be seen.
        return false;
    }
    (1..200).any(|k| {
        let share = f64::from(k) / 200.0;
        let along = less(to, from);
        let target = [from[0] + along[0] * share, from[1] + along[1] * share];
        let way = less(target, eye);
        walls
            .iter()
            .filter(|w| w.is_solid && w.item as usize != item)
            .all(|w| {
                let [a, b] = w.ends;
                let side = less(b, a);
                let across = cross(way, side);
                let at = cross(less(a, eye), side) / across;
                let on = cross(less(a, eye), way) / across;
                across == 0.0
                    || !(at > 0.0 && at < 1.0 - 1e-9 && (-1e-9..=1.0 + 1e-9).contains(&on))
            })
    })
}

#[test]
fn what_is_proven_by_a_plan_is_seen_along_no_way() {
    let mut rng = SeededRng::new(5);
    let (mut hidden, mut seen, mut undecided) = (0, 0, 0);
    for _ in 0..300 {
        // Whole numbers: walls share corners, are in line, and cross.
        let mut whole = |most: u64| rng.below(most as usize) as f64;
        let walls: Vec<PlanWall> = (0..12)
            .map(|item| {
                let from = [whole(9), whole(9)];
                let to = [from[0] + whole(4) + 1.0, from[1] + whole(7) - 3.0];
                wall(item, [from, to], item % 4 != 3)
            })
            .collect();
        let boxes = boxes(&walls);
        let eye = [whole(9) + 0.375, whole(9) + 0.4375];
        for item in 0..walls.len() {
            let is_seen = is_seen(eye, &walls, item);
            seen += usize::from(is_seen);
            match searched(eye, &walls, &boxes, item as ItemId) {
                Proof::Walls(chain) => {
                    hidden += 1;
                    let counts = covered(eye, &walls, &boxes, item as ItemId, &chain).unwrap();
                    assert!(
                        counts.along_lines == 1 || !is_seen,
                        "{eye:?} {item} {walls:?}"
                    );
                    assert!(!is_seen, "{eye:?} {item} {chain:?} {walls:?}");
                }
                _ => undecided += usize::from(!is_seen),
            }
        }
    }
    assert!(
        hidden > 500 && seen > 500 && undecided * 10 < hidden,
        "{hidden} {seen} {undecided}"
    );
}
