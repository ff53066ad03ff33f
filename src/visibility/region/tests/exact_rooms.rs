//! Exact sets of rooms against rays and witnesses.

use std::sync::Arc;

use super::super::*;
use super::worlds::*;
use crate::scene::SeededRng;

const WORLDS: [&str; 4] = [
    "rooms:n=1600,seed=1",
    "rooms:n=700,seed=2,storeys=6",
    "rooms:n=1000,seed=4,storeys=1,room=3",
    "rooms:n=64,seed=5,storeys=4",
];

#[test]
fn each_pair_has_a_witness_and_rays_find_no_other() {
    for world in WORLDS {
        let (_, graph) = rooms(world);
        let exact = RoomsPvs::of(graph.clone()).unwrap();
        let pvs = exact.pvs();
        let (mut flood, n) = (Vec::new(), graph.len() as u32);
        for a in 0..n {
            graph.component(a, &mut flood);
            for b in 0..n {
                assert_eq!(pvs.sees(a, b), pvs.sees(b, a), "{world} {a} {b}");
                if a == b || !pvs.sees(a, b) {
                    continue;
                }
                assert!(flood.binary_search(&b).is_ok());
                // Even between storeys, though nothing promises it there.
                let witness = exact.witness(a, b).expect("a line of sight");
                graph.check_witness(&witness).expect("a good one");
                // The same line proves nothing of other regions.
                let other = Witness {
                    regions: [a, (b + 1) % n],
                    ..witness
                };
                assert!(graph.check_witness(&other).is_err());
            }
        }
        let rays = joined_by_rays(&graph, 100_000, 3);
        for a in 0..n {
            for b in 0..n {
                assert!(pvs.sees(a, b) || !rays.sees(a, b), "{world} {a} {b}");
            }
        }
        // Rays find most of what there is.
        assert!(
            pairs(&rays) * 2 > pairs(pvs),
            "{} {}",
            pairs(&rays),
            pairs(pvs)
        );
        println!("{world}: {n} rooms, {} pairs", pairs(pvs));
    }
}

#[test]
fn a_search_that_forgets_an_opening_is_caught_by_rays() {
    let (_, graph) = rooms(WORLDS[0]);
    let wrong = RoomsPvs::of(Arc::new(without_opening(&graph, 7))).unwrap();
    let rays = joined_by_rays(&graph, 100_000, 3);
    let n = graph.len() as u32;
    let lost = |a: u32| {
        (0..n)
            .filter(|&b| rays.sees(a, b) && !wrong.pvs().sees(a, b))
            .count()
    };
    assert!((0..n).map(lost).sum::<usize>() > 0);
}

#[test]
fn an_audit_finds_each_doctored_bit_with_a_line_of_sight() {
    let (_, graph) = rooms(WORLDS[0]);
    let exact = RoomsPvs::of(graph.clone()).unwrap();
    let honest = audit(exact.pvs(), &exact, &graph).unwrap();
    assert!(honest.false_negatives.is_empty() && honest.asymmetric.is_empty());
    assert_eq!(
        (honest.false_positives, honest.claimed),
        (0, honest.visible)
    );

    let mut doctored = exact.pvs().clone();
    assert_eq!(&doctored, exact.pvs());
    let (mut rng, mut cleared, mut set) = (SeededRng::new(2), 0, 0);
    let n = graph.len();
    while cleared < 40 || set < 10 {
        let [a, b] = [rng.below(n) as u32, rng.below(n) as u32];
        if a != b && doctored.sees(a, b) == exact.pvs().sees(a, b) {
            if doctored.sees(a, b) && cleared < 40 {
                remove(&mut doctored, [a, b]);
                cleared += 1;
            } else if !doctored.sees(a, b) && set < 10 {
                doctored.insert(a, b);
                set += 1;
            }
        }
    }
    let found = audit(&doctored, &exact, &graph).unwrap();
    assert_eq!(found.false_negatives.len() + found.unproven.len(), 40);
    assert!(found.unproven.is_empty());
    assert_eq!(found.false_positives, 10);
    assert!(!found.asymmetric.is_empty());
    for witness in &found.false_negatives {
        let [a, b] = witness.regions;
        assert!(!doctored.sees(a, b) && graph.check_witness(witness).is_ok());
    }
    assert!(audit(&Pvs::alone(3), &exact, &graph).is_err());
}

#[test]
fn witnesses_that_touch_or_pass_walls_are_rejected() {
    let (_, graph) = rooms(WORLDS[0]);
    let exact = RoomsPvs::of(graph.clone()).unwrap();
    let [a, b] = graph.openings()[3].sides;
    let good = exact.witness(a, b).unwrap();
    assert_eq!(graph.check_witness(&good), Ok(()));
    // Through the very edge of the opening.
    let edge = graph.openings()[3].corners[0];
    let mut touching = good;
    touching.ends[1] = edge + (edge - good.ends[0]) * 2f64.powi(-20);
    assert!(graph.check_witness(&touching).is_err());
    let mut outside = good;
    outside.ends[0] = graph.parts(a)[0].min;
    assert_eq!(graph.check_witness(&outside), Err(Rejected::End(0)));
    let nowhere = Witness {
        regions: [a, 99_999],
        ..good
    };
    assert_eq!(graph.check_witness(&nowhere), Err(Rejected::Region));
}

#[test]
fn openings_at_all_heights_are_searched_in_three_dimensions() {
    let mut rng = SeededRng::new(31);
    let (mut all, mut open, mut by_rays) = (0, 0, 0);
    for count in [[5, 1, 1], [4, 4, 1], [3, 3, 3], [2, 2, 4], [6, 2, 1]] {
        let graph = cubes(count, &mut rng);
        let exact = RoomsPvs::of(graph.clone()).unwrap();
        let n = graph.len() as u32;
        let rays = joined_by_rays(&graph, 30_000, 3);
        for a in 0..n {
            for b in 0..n {
                let sees = exact.pvs().sees(a, b);
                assert_eq!(sees, exact.pvs().sees(b, a));
                assert!(sees || !rays.sees(a, b), "{count:?} {a} {b}");
            }
        }
        let ordered = (0..n).flat_map(|a| (a + 1..n).map(move |b| [a, b]));
        let seen = ordered.filter(|&[a, b]| exact.pvs().sees(a, b));
        open += seen.filter(|&[a, b]| exact.witness(a, b).is_none()).count() as u64;
        all += pairs(exact.pvs());
        by_rays += pairs(&rays);
    }
    println!("{all} pairs, {open} undecided, {by_rays} by rays");
    assert!(open * 50 < all, "{open} of {all}");
}
