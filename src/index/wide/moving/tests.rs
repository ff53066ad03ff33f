//! Tests of the structure `moving`.

use super::*;
use crate::geometry::{ConvexVolume, Plane};
use crate::index::Query;
use crate::kernel::Kernel;
use crate::query::NoRecorder;
use glam::Vec3;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

const WORLD: u32 = 64;

/// An empty item; its bounds are finite, as those of all items.
const GONE: Aabb = Aabb::new(Vec3::ONE, Vec3::ZERO);

fn point(rng: &mut Pcg64) -> Vec3 {
    let mut x = || (rng.next_u32() % (16 * WORLD)) as f32 / 16.0;
    Vec3::new(x(), x(), x())
}

fn cubes(rng: &mut Pcg64, count: usize) -> Vec<Aabb> {
    let cube = |_| Aabb::around(point(rng), Vec3::splat(0.7));
    (0..count).map(cube).collect()
}

fn count_of_movers(index: &Moving) -> usize {
    index.movers.ids.len() - index.movers.vacant
}

/// Compares the answers of all kernels with a scan, and the lanes with the items.
fn assert_right(index: &Moving, items: &[Aabb], rng: &mut Pcg64) {
    fn ask(index: &Moving, volume: &impl QueryVolume, kernel: Kernel) -> Vec<ItemId> {
        let (sink, recorder) = (&mut Vec::new(), &mut NoRecorder);
        let _ = kernel.run(Query {
            index,
            volume,
            sink,
            recorder,
        });
        sink.sort_unstable();
        std::mem::take(sink)
    }
    fn seen(items: &[Aabb], sees: impl Fn(&Aabb) -> bool) -> Vec<ItemId> {
        let seen = items.iter().zip(0..).filter(|(b, _)| sees(b));
        seen.map(|(_, id)| id).collect()
    }
    let corner = point(rng);
    let wedge = [
        Plane::new(Vec3::new(0.8, 0.1, -0.3), 0.0),
        Plane::new(Vec3::new(-0.2, 0.9, 0.4), 0.0),
        Plane::new(-Vec3::Z, corner.z),
    ];
    let wedge = wedge.map(|p| Plane::new(p.normal, p.d - p.normal.dot(corner)));
    let volumes = [&wedge[..], &wedge[..1], &[]].map(ConvexVolume::from_planes);
    for kernel in Kernel::available() {
        for volume in volumes.iter().flatten() {
            let scan = seen(items, |b| !b.is_empty() && volume.sees(b));
            assert_eq!(ask(index, volume, kernel), scan, "{kernel}");
        }
        let p = items[rng.next_u32() as usize % items.len()].min;
        let scan = seen(items, |b| b.contains_point(p));
        assert_eq!(ask(index, &p, kernel), scan, "{kernel} at {p}");
    }
    for tree in [&index.still, &index.movers] {
        let held = tree.ids.iter().filter(|&&id| id != ABSENT).count();
        assert_eq!(tree.ids.len() - tree.vacant, held);
    }
    let movers: usize = index.regions.iter().map(|r| r.movers).sum();
    assert_eq!(movers, count_of_movers(index));
    let is_divided = |r: &Region| r.span == index.finest || r.movers <= LANES;
    assert!(index.regions.iter().all(is_divided));
    // Leaves of the still tree never outgrow their homes beyond the margin.
    for leaf in 0..index.still.levels.first().map_or(0, |level| level.blocks) {
        let first = leaf * LANES;
        for (at, _) in (first..).zip(index.still.ids[first..].iter().take(LANES)) {
            let held = index.still.ids[at] != ABSENT;
            assert!(!held || index.fits(leaf, &index.still.blocks[leaf].get(at % LANES)));
        }
    }
}

#[test]
fn answers_are_those_of_a_scan_whatever_moves_comes_and_goes() {
    let mut rng = Pcg64::seed_from_u64(7);
    for count in [0, 1, 20, 300, 3000] {
        let mut items = cubes(&mut rng, count + 40);
        // The rest appear later.
        items[count..].fill(GONE);
        let mut index = Moving::build(&Input::new(&items), &Default::default()).unwrap();
        for round in 0..60u32 {
            let share = [300, 1, 40, 3][round as usize / 15];
            let some = |_| rng.next_u32() % items.len() as u32;
            let moved: Vec<ItemId> = (0..items.len() / share).map(some).collect();
            for &id in &moved {
                let b = &mut items[id as usize];
                *b = match rng.next_u32() % 8 {
                    0 => GONE,
                    1 | 2 => Aabb::around(point(&mut rng), Vec3::splat(0.7)),
                    _ if b.is_empty() => Aabb::around(Vec3::splat(9.0), Vec3::ONE),
                    _ => Aabb::new(b.min + 0.5, b.max + 0.5),
                };
            }
            if !index.refit(&items, &moved) {
                index = Moving::build(&Input::new(&items), &Default::default()).unwrap();
            }
            assert_right(&index, &items, &mut rng);
        }
    }
}

#[test]
fn movers_that_rest_return_to_the_still_tree() {
    let mut rng = Pcg64::seed_from_u64(8);
    let mut items = cubes(&mut rng, 5000);
    let mut index = Moving::build(&Input::new(&items), &Default::default()).unwrap();
    let all: Vec<ItemId> = (0..5000).collect();
    for _ in 0..LEAVE_EVERY + 2 {
        for b in &mut items {
            *b = Aabb::new(b.min + 0.1, b.max + 0.1);
        }
        assert!(index.refit(&items, &all));
    }
    assert_eq!(count_of_movers(&index), 5000);
    assert_right(&index, &items, &mut rng);
    // More updates than `now` can count.
    for _ in 0..900 {
        assert!(index.refit(&items, &[17]));
    }
    let movers = count_of_movers(&index);
    assert!(movers < 800, "{movers} movers");
    assert_right(&index, &items, &mut rng);
}

#[test]
fn an_item_that_moves_now_and_then_stays_in_the_still_tree() {
    let mut rng = Pcg64::seed_from_u64(10);
    let mut items = cubes(&mut rng, 5000);
    let mut index = Moving::build(&Input::new(&items), &Default::default()).unwrap();
    for round in 0..300 {
        let moved: Vec<ItemId> = (round % 50..5000).step_by(50).collect();
        for &id in &moved {
            items[id as usize] = Aabb::around(point(&mut rng), Vec3::splat(0.7));
        }
        assert!(index.refit(&items, &moved));
    }
    // Each has been at six random positions.
    let movers = count_of_movers(&index);
    assert!(movers < 800, "{movers} movers");
    assert_right(&index, &items, &mut rng);
}

#[test]
fn a_crowd_in_one_place_needs_a_rebuild() {
    let mut rng = Pcg64::seed_from_u64(9);
    let mut items = cubes(&mut rng, 5000);
    let mut index = Moving::build(&Input::new(&items), &Default::default()).unwrap();
    let all: Vec<ItemId> = (0..5000).collect();
    items.fill(Aabb::around(Vec3::splat(9.0), Vec3::ONE));
    assert!(index.refit(&items, &all));
    assert_right(&index, &items, &mut rng);
    assert!(!index.refit(&items, &all));
    assert_right(&index, &items, &mut rng);
}
