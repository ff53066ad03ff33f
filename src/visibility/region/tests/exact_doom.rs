//! Exact sets of sectors, REJECT and its audit.

use std::sync::Arc;

use super::super::doom::{DoomMap, MapLine, Sector, SectorPvs};
use super::super::*;
use super::worlds::*;
use crate::scene::{Sample, SeededRng};

fn sample(name: &str) -> (Arc<DoomMap>, Arc<RegionGraph>) {
    let sample = Sample::named(name).unwrap();
    let map = Arc::new(DoomMap::read(sample.bytes, sample.file, None).unwrap());
    let graph = Arc::new(map.graph().unwrap());
    (map, graph)
}

/// How many pairs of linedefs cross where there is no vertex. The search is exact if
/// there are none, as in any map that a node builder has seen.
fn crossings(map: &DoomMap) -> usize {
    let borders = |line: &&MapLine| line.open.is_none() || line.sectors[0] != line.sectors[1];
    let lines = map.lines.iter().filter(borders);
    let ends: Vec<_> = lines.map(|l| l.ends.map(|e| e.map(i64::from))).collect();
    let side = |a: [i64; 2], b: [i64; 2], c: [i64; 2]| {
        ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).signum()
    };
    let crosses = |[a, b]: [[i64; 2]; 2], [c, d]: [[i64; 2]; 2]| {
        side(a, b, c) * side(a, b, d) < 0 && side(c, d, a) * side(c, d, b) < 0
    };
    let before = |(i, one): (usize, &[[i64; 2]; 2])| {
        let others = ends[..i].iter();
        others.filter(|other| crosses(*one, **other)).count()
    };
    ends.iter().enumerate().map(before).sum()
}

/// The same map with all heights left out: each linedef of two sides is open, as
/// builders of REJECT tables take it.
fn without_heights(map: &DoomMap) -> DoomMap {
    const HIGHEST: f64 = 32768.0;
    let mut map = map.clone();
    for line in &mut map.lines {
        if let [Some(_), Some(_)] = line.sectors {
            line.open = Some([-HIGHEST, HIGHEST]);
        }
    }
    map.sectors.fill(Sector {
        floor: -HIGHEST,
        ceiling: HIGHEST,
    });
    map
}

#[test]
fn the_small_maps_set_is_proven_pair_by_pair() {
    let (map, graph) = sample("freedm-map12");
    let exact = SectorPvs::of(map.clone(), graph.clone());
    let pvs = exact.pvs();
    assert_eq!(crossings(&map), 0);
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
    println!("map12: {} pairs, {unproven} without a witness", pairs(pvs));
    assert_eq!(unproven, 0);
    // Rays of all heights: on a map without heights they are blocked by walls alone.
    let flat = Arc::new(Arc::new(without_heights(&map)).graph().unwrap());
    let rays = joined_by_rays(&flat, 40_000, 3);
    for a in 0..n {
        for b in 0..n {
            assert!(pvs.sees(a, b) || !rays.sees(a, b), "{a} {b}");
        }
    }
    println!("rays {}", pairs(&rays));
}

#[test]
fn reject_tables_of_the_samples_under_audit() {
    // A pair that only heights hide is a false positive of the table, not an error.
    for (name, sectors, claimed, hidden_by_heights) in [
        ("freedm-map12", 49, 1400, 0),
        ("freedm-map20", 191, 12_744, 460),
    ] {
        let (map, graph) = sample(name);
        assert_eq!(graph.len(), sectors);
        let exact = SectorPvs::of(map.clone(), graph.clone());
        let found = audit(map.reject().unwrap(), &exact, &graph).unwrap();
        assert_eq!(crossings(&map), 0, "{name}");
        assert_eq!((found.claimed, found.asymmetric.len()), (claimed, 0));
        assert!(found.false_negatives.is_empty() && found.unproven.is_empty());
        assert_eq!(found.false_positives, hidden_by_heights, "{name}");
    }
}

#[test]
fn without_heights_the_search_and_the_maps_own_table_agree_pair_by_pair() {
    let (map, _) = sample("freedm-map12");
    let map = Arc::new(without_heights(&map));
    let exact = SectorPvs::of(map.clone(), Arc::new(map.graph().unwrap()));
    assert_eq!(exact.pvs(), map.reject().unwrap());
}

#[test]
fn a_doctored_table_is_caught_with_lines_of_sight() {
    let (map, graph) = sample("freedm-map12");
    let exact = SectorPvs::of(map.clone(), graph.clone());
    let (mut doctored, mut rng) = (map.reject().unwrap().clone(), SeededRng::new(6));
    let mut cleared = 0;
    while cleared < 60 {
        let [a, b] = [rng.below(49) as u32, rng.below(49) as u32];
        if a != b && doctored.sees(a, b) {
            remove(&mut doctored, [a, b]);
            cleared += 1;
        }
    }
    let found = audit(&doctored, &exact, &graph).unwrap();
    assert_eq!((found.false_negatives.len(), found.unproven.len()), (60, 0));
    assert!(found.asymmetric.len() > 40);
    for witness in &found.false_negatives {
        assert_eq!(graph.check_witness(witness), Ok(()));
        // A line of sight between two sectors is none between others, nor from
        // somewhere between two whole numbers of units.
        let [a, b] = witness.regions;
        let other = Witness {
            regions: [a, (b + 1) % 49],
            ..*witness
        };
        assert_eq!(graph.check_witness(&other), Err(Rejected::End(1)));
        let mut between = *witness;
        between.ends[0].x = between.ends[0].x.next_up();
        assert_eq!(graph.check_witness(&between), Err(Rejected::End(0)));
    }
}

#[test]
fn a_line_of_sight_through_a_wall_is_rejected() {
    let (map, graph) = sample("freedm-map12");
    let exact = SectorPvs::of(map.clone(), graph.clone());
    let n = graph.len() as u32;
    let pairs = (0..n).flat_map(|a| (0..n).map(move |b| [a, b]));
    let mut rejected = 0;
    for [a, b] in pairs.filter(|[a, b]| !exact.pvs().sees(*a, *b)) {
        let end = |r: u32| (0..n).filter(|s| *s != r).find_map(|s| exact.witness(r, s));
        if let (Some(from), Some(to)) = (end(a), end(b)) {
            let witness = Witness {
                regions: [a, b],
                ends: [from.ends[0], to.ends[0]],
            };
            let answer = graph.check_witness(&witness);
            assert!(matches!(answer, Err(Rejected::Blocked(_))), "{answer:?}");
            rejected += 1;
        }
    }
    assert!(rejected > 500);
}

#[test]
fn no_row_misses_a_sector_that_a_ray_passes() {
    for name in ["freedm-map12", "freedm-map20"] {
        let sample = Sample::named(name).unwrap();
        let scene = crate::scene::load(name, &Default::default()).unwrap();
        let map = Arc::new(DoomMap::read(sample.bytes, sample.file, None).unwrap());
        let graph = Arc::new(map.graph().unwrap());
        let mut rows = super::from_eye::rows(&graph);
        let reject = Arc::new(map.reject().unwrap().clone());
        rows.push(Box::new(
            StoredPvs::of(graph.clone(), reject, REJECT).unwrap(),
        ));
        let mut rng = SeededRng::new(8);
        let (mut scratch, mut out) = (Scratch::default(), Vec::new());
        let mut sums = vec![0; rows.len() + 1];
        for place in scene.places.iter().take(30) {
            let rays = looking(place.eye, &mut rng);
            let mut seen = Marks::default();
            seen.clear(graph.len());
            for _ in 0..300 {
                let ray = rays.through(rng.unit(), rng.unit());
                graph.ground().follow(&graph, &ray, &mut seen);
            }
            let mut truth = Vec::new();
            seen.list(&mut truth);
            sums[rows.len()] += truth.len();
            for (i, row) in rows.iter().enumerate() {
                row.from_eye(&rays, &mut scratch, &mut out);
                let lost = truth
                    .iter()
                    .filter(|r| out.binary_search(r).is_err())
                    .count();
                assert_eq!(lost, 0, "{name} {}", row.about().name);
                sums[i] += out.len();
            }
        }
        println!("{name} {sums:?}");
        // Every row narrows the answer down, and rays see something.
        assert!(sums[..4].is_sorted_by(|a, b| a > b), "{sums:?}");
        assert!(sums[3] >= sums[rows.len()] && sums[rows.len()] > 60);
    }
}

#[test]
fn an_eye_at_a_wall_or_below_the_floor_is_nowhere() {
    let (map, graph) = sample("freedm-map12");
    let wall = map.lines.iter().find(|l| l.sectors[1].is_none()).unwrap();
    let [from, to] = wall.ends.map(|[x, y]| glam::DVec2::new(x.into(), y.into()));
    let sector = map.sectors[wall.sectors[0].unwrap() as usize];
    let (middle, right) = ((from + to) * 0.5, -(to - from).perp().normalize());
    let mut rng = SeededRng::new(1);
    // The near window is some 0.1 wide; right of a linedef is its front.
    for (away, height, place) in [
        (4.0, 41.0, EyePlace::Inside),
        (0.01, 41.0, EyePlace::Outside),
        (-4.0, 41.0, EyePlace::Outside),
        (4.0, -1.0, EyePlace::Outside),
    ] {
        let eye = (middle + right * away).extend(sector.floor + height);
        let rays = looking(eye, &mut rng);
        for row in super::from_eye::rows(&graph) {
            let mut out = Vec::new();
            let answer = row.from_eye(&rays, &mut Scratch::default(), &mut out);
            assert_eq!(answer, place, "{away} {height} {}", row.about().name);
        }
    }
}
