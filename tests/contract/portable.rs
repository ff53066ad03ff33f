//! The portable path on all kinds of small scenes, without a file, a thread or
//! an instruction that an interpreter lacks: `scripts/check-miri.sh` runs this
//! under Miri, where plain arrays are the vectors. Under `cargo test` it is a
//! differential test like others, with more cases.

use std::ops::Range;

use cullbench::geometry::{Aabb, ConvexVolume, ConvexVolumeF64, Spheres, sphere_cube};
use cullbench::index::{
    BlockOrder, Bsp, Bvh, FrustumQuery, Input, Linear, Octree, Quadtree, RegionIndex, Wide,
    WideParams,
};
use cullbench::kernel::{Append, Isa, LANES, LaneMask, Plain};
use cullbench::query::{ItemId, Located, Predicate, QueryVolume};
use cullbench::verify::{RandomCase, edge_scenes, edge_volumes};
use glam::Vec3;

/// Cases, and the most items of one: an interpreter is a thousand times slower.
const SEEDS: u64 = if cfg!(miri) { 12 } else { 400 };
const MOST_ITEMS: usize = if cfg!(miri) { 70 } else { 600 };

fn those(items: &[Aabb], holds: impl Fn(&Aabb) -> bool) -> Vec<ItemId> {
    let all = items.iter().zip(0..);
    all.filter(|(b, _)| !b.is_empty() && holds(b))
        .map(|(_, id)| id)
        .collect()
}

/// Takes off what was there before and sorts the rest.
fn sorted_rest(mut ids: Vec<ItemId>, before: usize) -> Vec<ItemId> {
    assert!(ids[..before].iter().all(|&id| id == ItemId::MAX), "changed");
    ids.drain(..before);
    ids.sort_unstable();
    ids
}

fn sees<T: RegionIndex, V: QueryVolume>(index: &T, view: &V, before: usize, wanted: &[ItemId]) {
    // No spare room, and a start at any place of a cache line.
    let mut ids = vec![ItemId::MAX; before];
    let _ = index.query_into(view, &mut ids);
    assert_eq!(sorted_rest(ids, before), wanted, "{}", T::INFO.name);
}

fn queries<T: RegionIndex>(items: &[Aabb], volumes: &[ConvexVolume], points: &[Vec3]) -> T {
    let index = T::build(&Input::new(items), &Default::default()).expect(T::INFO.name);
    for (i, volume) in volumes.iter().enumerate() {
        let wanted = those(items, |b| volume.sees(b));
        sees(&index, volume, i, &wanted);
        let finer = ConvexVolumeF64::from(volume);
        let wanted = those(items, |b| finer.sees(b));
        sees(&index, &finer, i, &wanted);
    }
    let mut all = Located::default();
    index.query_many(Plain, points, &mut all);
    for (&p, batched) in points.iter().zip(all.iter()) {
        let wanted = those(items, |b| b.contains_point(p));
        assert_eq!(sorted_rest(index.locate(p), 0), wanted, "{}", T::INFO.name);
        assert_eq!(sorted_rest(batched.to_vec(), 0), wanted, "{}", T::INFO.name);
    }
    index
}

fn ranges<T: RegionIndex>(index: &T, items: &[Aabb], volumes: &[ConvexVolume]) {
    for volume in volumes {
        let mut ranges: Vec<Range<u32>> = Vec::new();
        let order = index.visible_ranges(volume, &mut ranges);
        let order = order.expect("declared");
        let of = |range: &Range<u32>| range.start as usize..range.end as usize;
        let held: Vec<ItemId> = ranges.iter().flat_map(|r| &order[of(r)]).copied().collect();
        let wanted = those(items, |b| volume.sees(b));
        assert_eq!(sorted_rest(held, 0), wanted, "{}", T::INFO.name);
    }
}

/// Checks the wide tree in its other order.
fn wide(items: &[Aabb], volumes: &[ConvexVolume]) {
    let params = WideParams {
        order: BlockOrder::Morton,
    };
    let morton = Wide::build(&Input::new(items), &params).expect("finite");
    for (i, volume) in volumes.iter().enumerate() {
        let wanted = those(items, |b| volume.sees(b));
        sees(&morton, volume, i, &wanted);
    }
}

/// Cubes about spheres, which is what a view of spheres asks about.
fn spheres<T: RegionIndex>(items: &[Aabb], volumes: &[ConvexVolume]) {
    let cubes: Vec<Aabb> = items.iter().map(sphere_cube).collect();
    let index = T::build(&Input::new(&cubes), &Default::default()).expect(T::INFO.name);
    for volume in volumes {
        let view = Spheres::new(volume);
        sees(&index, &view, 0, &those(&cubes, |b| view.sees(b)));
    }
}

fn every_structure(items: &[Aabb], volumes: &[ConvexVolume], points: &[Vec3]) {
    queries::<Linear>(items, volumes, points);
    spheres::<Linear>(items, volumes);
    macro_rules! trees {
        ($($tree:ty),*) => { $(
            let index = queries::<$tree>(items, volumes, points);
            ranges(&index, items, volumes);
            spheres::<$tree>(items, volumes);
        )* };
    }
    trees!(Bsp, Octree, Quadtree, Bvh, Wide);
    wide(items, volumes);
}

/// The volume with one plane a little farther out.
fn beside(volume: &ConvexVolume) -> ConvexVolume {
    let mut planes = volume.planes().to_vec();
    if let Some(plane) = planes.first_mut() {
        plane.d += plane.d.abs() * 1e-3;
    }
    ConvexVolume::from_planes(&planes).expect("finite")
}

/// Numbers of items about a block, a level of blocks and none.
fn sizes(most: usize) -> impl Iterator<Item = usize> {
    let sizes = [0, 1, 2, 15, 16, 17, 31, 32, 33, 255, 256, 257, 273];
    sizes.into_iter().filter(move |&size| size <= most)
}

#[test]
fn random_cases_are_right() {
    for seed in 0..SEEDS {
        let case = RandomCase::new(seed);
        let items = &case.items[..case.items.len().min(MOST_ITEMS)];
        // With its neighbour, which goes down the wide tree together with it.
        let volumes = [
            beside(&case.volume),
            case.volume,
            RandomCase::new(seed + 1000).volume,
        ];
        every_structure(items, &volumes, &[case.point, Vec3::ZERO]);
    }
}

#[test]
fn sizes_about_a_block_are_right() {
    let row = |i: usize| Aabb::around(Vec3::new(i as f32, 0.0, 0.0), Vec3::splat(0.25));
    for size in sizes(if cfg!(miri) { 33 } else { 273 }) {
        let items: Vec<Aabb> = (0..size).map(row).collect();
        // All of space, nothing, and half of the row.
        let volumes = edge_volumes(&items);
        let volumes: Vec<ConvexVolume> = volumes.into_iter().take(4).collect();
        every_structure(&items, &volumes, &[Vec3::ZERO, Vec3::splat(9.0)]);
    }
}

#[test]
fn scenes_at_the_edge_are_right() {
    for (_, mut items) in edge_scenes() {
        items.truncate(if cfg!(miri) { 20 } else { 300 });
        let volumes = edge_volumes(&items);
        let step = if cfg!(miri) { 9 } else { 3 };
        let volumes: Vec<ConvexVolume> = volumes.into_iter().step_by(step).collect();
        every_structure(&items, &volumes, &[Vec3::ZERO, Vec3::ONE]);
    }
}

fn packed<I: Isa>(isa: I, out: &mut Vec<u32>, words: usize, rows: &[([u32; LANES], LaneMask)]) {
    let mut appender = I::Appender::onto(out, words);
    for (row, lanes) in rows {
        appender.push(isa, row, *lanes);
    }
}

/// Appends rows and parts of rows to lists of all lengths.
///
/// Exactly the reserved room is used, with every mask that is one run of lanes.
#[test]
fn rows_go_into_any_place() {
    let row: [u32; LANES] = std::array::from_fn(|lane| 100 + lane as u32);
    for before in 0..=LANES {
        for (from, to) in (0..=LANES).flat_map(|to| (0..=to).map(move |from| (from, to))) {
            let lanes = ((1_u32 << to) - (1_u32 << from)) as LaneMask;
            let mut wanted: Vec<u32> = [&vec![7; before], &row[from..to], &row].concat();
            let mut out = vec![7; before];
            let rows = [(row, lanes), (row, LaneMask::MAX)];
            packed(Plain, &mut out, LANES + to - from, &rows);
            assert_eq!(out, wanted);
            Plain.append(&mut out, &row, lanes);
            wanted.extend_from_slice(&row[from..to]);
            assert_eq!(out, wanted);
        }
    }
}
