//! Exact sets of rooms against rays.

use super::super::*;
use super::worlds::*;
use crate::scene::SeededRng;

const WORLDS: [&str; 4] = [
    "rooms:n=1600,seed=1",
    "rooms:n=700,seed=2,storeys=6",
    "rooms:n=1000,seed=4,storeys=1,room=3",
    "rooms:n=64,seed=5,storeys=4",
];

/// Pairs that rays find and a set lacks; sets hold both directions or neither.
fn missing(pvs: &Pvs, rays: &Pvs) -> usize {
    let n = pvs.len() as u32;
    let pairs = (0..n).flat_map(|a| (0..n).map(move |b| [a, b]));
    let lost = pairs.filter(|&[a, b]| {
        assert_eq!(pvs.row(a).holds(b), pvs.row(b).holds(a), "{a} {b}");
        rays.row(a).holds(b) && !pvs.row(a).holds(b)
    });
    lost.count()
}

#[test]
fn rays_find_no_pair_that_is_missing_and_most_of_those_that_are_there() {
    for world in WORLDS {
        let (_, graph) = rooms(world);
        let pvs = Pvs::of_rooms(&graph).unwrap();
        let rays = joined_by_rays(&graph, 100_000, 3);
        assert_eq!(missing(&pvs, &rays), 0, "{world}");
        let [all, by_rays] = [&pvs, &rays].map(pairs);
        assert!(by_rays * 2 > all, "{world}: {by_rays} of {all}");
    }
}

#[test]
fn a_search_that_forgets_an_opening_is_caught_by_rays() {
    let (_, graph) = rooms(WORLDS[0]);
    let wrong = Pvs::of_rooms(&without_opening(&graph, 7)).unwrap();
    assert!(missing(&wrong, &joined_by_rays(&graph, 100_000, 3)) > 0);
}

#[test]
fn openings_at_all_heights_are_searched_in_three_dimensions() {
    let mut rng = SeededRng::new(31);
    for count in [[5, 1, 1], [4, 4, 1], [3, 3, 3], [2, 2, 4], [6, 2, 1]] {
        let graph = cubes(count, &mut rng);
        let pvs = Pvs::of_rooms(&graph).unwrap();
        let rays = joined_by_rays(&graph, 30_000, 3);
        assert_eq!(missing(&pvs, &rays), 0, "{count:?}");
    }
}
