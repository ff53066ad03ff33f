use std::sync::Arc;

use super::super::doom::{DoomMap, SectorPvs};
use super::super::*;
use super::worlds::*;
use crate::scene::{Sample, SeededRng};

fn sample(name: &str) -> (Arc<DoomMap>, Arc<RegionGraph>) {
    let sample = Sample::named(name).unwrap();
    let map = Arc::new(DoomMap::read(sample.bytes, sample.file, None).unwrap());
    let graph = Arc::new(map.graph());
    (map, graph)
}

#[test]
fn the_small_maps_set_is_proven_pair_by_pair() {
    let (map, graph) = sample("freedm-map12");
    let exact = SectorPvs::of(map.clone(), graph.clone());
    let pvs = exact.pvs();
    assert_eq!(exact.crossings(), 0);
    let n = pvs.len() as u32;
    let mut unproven = 0;
    for a in 0..n {
        for b in 0..n {
            assert_eq!(pvs.sees(a, b), pvs.sees(b, a), "{a} {b}");
            if a != b && pvs.sees(a, b) {
                unproven += usize::from(exact.witness(a, b).is_none());
            }
        }
    }
    println!("map12: {} pairs, {unproven} without a witness", pvs.pairs());
    assert_eq!(unproven, 0);
    let rays = joined_by_rays(&graph, 40_000, 3);
    for a in 0..n {
        for b in 0..n {
            assert!(pvs.sees(a, b) || !rays.sees(a, b), "{a} {b}");
        }
    }
    println!("rays {}", rays.pairs());
}

#[test]
fn reject_tables_of_the_samples_under_audit() {
    for name in ["freedm-map12", "freedm-map20"] {
        let (map, graph) = sample(name);
        let start = std::time::Instant::now();
        let exact = SectorPvs::of(map.clone(), graph.clone());
        let time = start.elapsed();
        let found = audit(map.reject().unwrap(), &exact, &graph).unwrap();
        println!(
            "{name}: crossings {} pairs {} claimed {} visible {} asymmetric {} fn {} unproven {} fp {} in {time:?}",
            exact.crossings(),
            found.pairs,
            found.claimed,
            found.visible,
            found.asymmetric.len(),
            found.false_negatives.len(),
            found.unproven.len(),
            found.false_positives
        );
    }
}
