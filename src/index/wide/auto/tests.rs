//! Answers, fixed choices, and choices by motion, queries and age of the tree.

use super::*;
use crate::index::{FrustumQuery, StructureSpec};
use glam::Vec3;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

const WORLD: u32 = 64;

/// The frusta whose work is counted.
fn views(index: &Auto, items: &[Aabb]) -> Vec<ConvexVolume> {
    (0..VIEWS).filter_map(|i| index.view(items, i)).collect()
}

/// Ids of the items for which the test holds.
fn scan(items: &[Aabb], sees: impl Fn(&Aabb) -> bool) -> Vec<ItemId> {
    let seen = items.iter().zip(0..).filter(|(b, _)| sees(b));
    seen.map(|(_, id)| id).collect()
}

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

fn built(items: &[Aabb], params: &str) -> Auto {
    let spec = StructureSpec::parse(&format!("auto{params}")).unwrap();
    let params = serde_json::from_value(spec.params).unwrap();
    Auto::build(&Input::new(items), &params).unwrap()
}

/// Compares answers to a wedge, a half-space, everything and a point with a scan.
fn assert_right(index: &Auto, items: &[Aabb], rng: &mut Pcg64, told: &str) {
    let corner = point(rng);
    let wedge = [
        Vec3::new(0.8, 0.1, -0.3),
        Vec3::new(-0.2, 0.9, 0.4),
        -Vec3::Z,
    ];
    let wedge = wedge.map(|normal| Plane::new(normal, -normal.dot(corner)));
    for planes in [&wedge[..], &wedge[..1], &[]] {
        let volume = ConvexVolume::from_planes(planes).unwrap();
        let mut seen = index.visible(&volume);
        seen.sort_unstable();
        let wanted = scan(items, |b| volume.sees(b));
        assert_eq!(seen, wanted, "{told}");
        assert_eq!(index.counted(&volume).0.len(), wanted.len(), "{told}");
    }
    let p = items[rng.next_u32() as usize % items.len()].min;
    let mut found = index.locate(p);
    found.sort_unstable();
    let wanted = scan(items, |b| !b.is_empty() && b.contains_point(p));
    assert_eq!(found, wanted, "{told} at {p}");
}

#[test]
fn answers_are_those_of_a_scan_whatever_is_chosen_and_moves() {
    let structures = ["auto", "linear", "wide", "moving"];
    for (seed, structure) in structures.into_iter().enumerate() {
        let updates = ["auto", "refit", "rebuild"];
        for update in &updates[..if structure == "moving" { 2 } else { 3 }] {
            let mut rng = Pcg64::seed_from_u64(seed as u64);
            for count in [0, 1, 17, 300, 5000] {
                let mut items = cubes(&mut rng, count + 40);
                // The rest appear later.
                items[count..].fill(GONE);
                let told = format!(":use={structure},update={update}");
                let mut index = built(&items, &told);
                for round in 0..20u32 {
                    let share = [300, 1, 40, 1, 300][round as usize / 4];
                    let some = |_| rng.next_u32() % items.len() as u32;
                    let moved: Vec<ItemId> = (0..items.len() / share).map(some).collect();
                    // Only in half of the rounds do items come and go.
                    let fates = if round % 4 < 2 { 8 } else { 1 };
                    for &id in &moved {
                        let b = &mut items[id as usize];
                        *b = match rng.next_u32() % fates {
                            1 => GONE,
                            2 | 3 => Aabb::around(point(&mut rng), Vec3::splat(0.7)),
                            _ if b.is_empty() => *b,
                            _ => Aabb::new(b.min + 0.5, b.max + 0.5),
                        };
                    }
                    assert!(index.refit(&items, &moved));
                    assert_right(&index, &items, &mut rng, &told);
                }
            }
        }
    }
}

#[test]
fn answers_are_right_through_every_change_of_kind() {
    let mut rng = Pcg64::seed_from_u64(11);
    let mut items = cubes(&mut rng, 5200);
    let mut index = built(&items, "");
    index.updates[REFIT] = 2;
    let some = [OVERWRITE, OVERWRITE, REFIT, OVERWRITE, MOVING, MOVING];
    let others = [REFIT, MOVING, OVERWRITE, OVERWRITE, REBUILD, OVERWRITE];
    for (round, kind) in some.into_iter().chain(others).enumerate() {
        (index.update, index.weighing) = (kind, 0);
        // Some twice, in no order; a quarter disappears or stays away.
        let some = |_| rng.next_u32() % items.len() as u32;
        let moved: Vec<ItemId> = (0..300).map(some).collect();
        for &id in &moved {
            let at = Aabb::around(point(&mut rng), Vec3::splat(0.7));
            items[id as usize] = [GONE, at, at, at][rng.next_u32() as usize % 4];
        }
        assert!(index.refit(&items, &moved));
        let told = format!("update {round}");
        assert_right(&index, &items, &mut rng, &told);
        assert!(index.refit(&items, &[]));
        assert_right(&index, &items, &mut rng, &told);
        assert_eq!(index.two_trees, kind == MOVING, "{told}");
    }
    assert!(index.scan.is_some() && index.updates.iter().all(|&count| count > 0));
}

#[test]
fn what_is_forced_is_taken_and_said() {
    let mut rng = Pcg64::seed_from_u64(6);
    let mut items = cubes(&mut rng, 2000);
    let (scan, tree) = (
        "scan of all items, not tree (modelled ",
        "tree, not scan of all items (modelled ",
    );
    for (params, search, update) in [
        (":use=linear", scan, "scan of overwritten boxes"),
        (
            ":use=linear,update=refit",
            scan,
            "scan of overwritten boxes",
        ),
        (":use=linear,update=rebuild", scan, "rebuild"),
        (":use=wide", tree, "refit"),
        (":use=moving", tree, "two trees"),
        (":update=rebuild", tree, "rebuild"),
        (":update=refit", tree, "refit"),
    ] {
        let mut index = built(&items, params);
        assert!(
            index.chose().unwrap().starts_with(search),
            "{params}: {:?}",
            index.chose()
        );
        for _ in 0..2 {
            items[7] = Aabb::around(point(&mut rng), Vec3::ONE);
            assert!(index.refit(&items, &[7]));
        }
        let told = index.chose().unwrap();
        let update = format!("; {update} in 2 of 2 updates, not ");
        let search = format!("built as {search}");
        assert!(
            told.starts_with(&search) && told.contains(&update),
            "{params}: {told}"
        );
        let has_movers = !index.trees.movers.ids.is_empty();
        assert_eq!(has_movers, params == ":use=moving");
    }
    for params in [
        "use=bvh",
        "update=fat",
        "order=random",
        "use=moving,update=rebuild",
    ] {
        let params = format!("auto:{params}");
        assert!(StructureSpec::parse(&params).is_err(), "{params}");
    }
}

#[test]
fn a_world_is_searched_by_its_tree_and_a_heap_as_a_whole() {
    let mut rng = Pcg64::seed_from_u64(7);
    let built = |items: &[Aabb]| SEARCHES[built(items, "").built];
    assert_eq!(built(&cubes(&mut rng, 30_000)), "tree");
    // Each box spans the whole world.
    let heap = |_| Aabb::around(0.1 * point(&mut rng), Vec3::splat(90.0));
    let heap: Vec<Aabb> = (0..30_000).map(heap).collect();
    assert_eq!(built(&heap), "scan of all items");
    assert_eq!(built(&[GONE, GONE]), "scan of all items");
}

#[test]
fn a_view_tests_no_more_than_all_items_and_nodes() {
    let mut rng = Pcg64::seed_from_u64(8);
    for half in [0.7, 90.0] {
        let cube = |_| Aabb::around(point(&mut rng), Vec3::splat(half));
        let items: Vec<Aabb> = (0..20_000).map(cube).collect();
        let index = built(&items, ":use=wide");
        let views = views(&index, &items);
        assert_eq!(views.len(), VIEWS);
        for view in &views {
            let tested = index.counted(view).1.comparisons();
            assert!((1..=22_000).contains(&tested), "{tested}");
        }
    }
}

#[test]
fn all_moving_is_overwritten_few_are_refitted_and_an_exception_changes_nothing() {
    let mut rng = Pcg64::seed_from_u64(9);
    let items = cubes(&mut rng, 20_000);
    let all: Vec<ItemId> = (0..20_000).collect();
    let mut index = built(&items, "");
    let mut update = |moved: usize, times: usize| {
        for _ in 0..times {
            assert!(index.refit(&items, &all[..moved]));
        }
        UPDATES[index.update]
    };
    assert_eq!(update(20, 3), "refit");
    assert_eq!(update(20_000, 1), "refit");
    assert_eq!(update(20, 16), "refit");
    assert_eq!(update(20_000, 50), "scan of overwritten boxes");
    assert_eq!(update(20, 90), "refit");
    let told = index.chose().unwrap();
    assert!(
        told.contains("; refit in ") && told.contains(" of 160 updates"),
        "{told}"
    );
}

#[test]
fn many_queries_between_updates_keep_the_tree() {
    let mut rng = Pcg64::seed_from_u64(11);
    let items = cubes(&mut rng, 20_000);
    let all: Vec<ItemId> = (0..20_000).collect();
    let mut index = built(&items, "");
    let wedge = ConvexVolume::from_planes(&[Plane::new(Vec3::X, -60.0)]).unwrap();
    for (queries, wanted) in [
        (1, "scan of overwritten boxes"),
        (20, "refit"),
        (1, "scan of overwritten boxes"),
    ] {
        for _ in 0..40 {
            assert!(index.refit(&items, &all));
            for _ in 0..queries {
                index.visible(&wedge);
            }
        }
        assert_eq!(UPDATES[index.update], wanted, "{queries}");
    }
}

#[test]
fn a_tree_that_has_aged_is_built_again() {
    let mut rng = Pcg64::seed_from_u64(12);
    let mut items = cubes(&mut rng, 4000);
    let mut index = built(&items, ":use=wide");
    let volume = ConvexVolume::from_planes(&[Plane::new(Vec3::X, -60.0)]).unwrap();
    for round in 0..2000 {
        // Two items go anywhere.
        let moved = [round * 2 % 4000, (round * 2 + 1) % 4000].map(|id| id as ItemId);
        for id in moved {
            items[id as usize] = Aabb::around(point(&mut rng), Vec3::splat(0.7));
        }
        assert!(index.refit(&items, &moved));
        for _ in 0..4 {
            index.visible(&volume);
        }
    }
    let [_, refits, rebuilds, _] = index.updates;
    assert!(
        (1..20).contains(&rebuilds) && refits > 1900,
        "{:?}",
        index.updates
    );
    assert_right(&index, &items, &mut rng, "aged");
}

#[test]
fn items_that_come_and_go_have_a_lane_after_each_build() {
    let mut rng = Pcg64::seed_from_u64(13);
    let mut items = cubes(&mut rng, 20_000);
    items[10_000..].fill(GONE);
    let mut index = built(&items, ":use=wide");
    for round in 0..60 {
        let moved: Vec<ItemId> = (0..100).map(|i| (i * 200 + round) % 20_000).collect();
        for &id in &moved {
            let b = &mut items[id as usize];
            let at = Aabb::around(point(&mut rng), Vec3::splat(0.7));
            *b = if b.is_empty() { at } else { GONE };
        }
        if round == 30 {
            assert!(index.rebuild(&items));
        }
        assert!(index.refit(&items, &moved));
        assert_right(&index, &items, &mut rng, "come and gone");
    }
    // The first build has lanes only for the items present then.
    assert_eq!(index.updates, [0, 59, 2, 0]);
    // No frustum starts at an item that is gone.
    let last = items.len() - 1;
    items[..last].fill(GONE);
    assert_eq!(views(&index, &items).len(), 0);
    items[..100].copy_from_slice(&cubes(&mut rng, 100));
    assert_eq!(views(&index, &items).len(), VIEWS);
}

#[test]
fn queries_between_updates_are_counted_up_to_a_number() {
    let mut rng = Pcg64::seed_from_u64(10);
    let items = cubes(&mut rng, 100);
    let mut index = built(&items, "");
    for queries in [3, 2 * MOST_QUERIES] {
        for _ in 0..queries {
            index.locate(Vec3::ONE);
            index.counted(&Vec3::ONE);
        }
        assert_eq!(index.queries.load(Relaxed), queries.min(MOST_QUERIES));
        assert!(index.refit(&items, &[1]));
    }
}

/// A tree of few leaves costs more than it saves.
#[test]
fn few_items_are_scanned_and_many_searched() {
    let mut rng = Pcg64::seed_from_u64(9);
    for (count, search) in [
        (16, "scan of all"),
        (50, "scan of all"),
        (2000, "tree, not"),
    ] {
        let told = built(&cubes(&mut rng, count), "").chose().unwrap();
        assert!(told.starts_with(search), "{count}: {told}");
    }
}

/// The second update takes the scan in reserve or drops it.
#[test]
fn a_scan_in_reserve_answers_from_the_second_update_on() {
    let rng = &mut Pcg64::seed_from_u64(17);
    for (share, queries) in [(1, 1), (100, 1), (100, 200)] {
        let mut items = cubes(rng, 3_000);
        let mut index = built(&items, "");
        let mut reserve = || {
            assert!(index.refit(&items, &[]));
            index.reserve.as_ref().map(|scan| scan.ids.as_ptr())
        };
        let first = reserve();
        assert!(first.is_some() && reserve() == first, "not built again");
        for update in 0..3 {
            let moved: Vec<ItemId> = (0..items.len() as ItemId).step_by(share).collect();
            for &id in &moved {
                items[id as usize] = Aabb::around(point(rng), Vec3::splat(0.7));
            }
            assert!(index.refit(&items, &moved));
            for volume in views(&index, &items).iter().cycle().take(queries) {
                index.visible(volume);
            }
            let told = format!("every {share}th moved, {queries} queries, update {update}");
            assert_eq!(index.reserve.is_some(), update == 0, "{told}");
            let scans = share == 1 && update > 0;
            assert_eq!(index.scan.is_some(), scans, "{told}");
            assert_right(&index, &items, rng, &told);
        }
    }
}

/// Views do not depend on scale, even where the square of a length overflows.
#[test]
fn the_size_of_the_world_changes_no_choice() {
    let mut rng = Pcg64::seed_from_u64(5);
    let items = cubes(&mut rng, 3000);
    let grown = |by: f32| -> Vec<Aabb> {
        let b = items.iter().map(|b| Aabb::new(b.min * by, b.max * by));
        b.collect()
    };
    let told = built(&items, "").chose().unwrap();
    for exponent in [-60, 60, 70] {
        let same = built(&grown(2_f32.powi(exponent)), "").chose().unwrap();
        assert_eq!(same, told, "2^{exponent}");
    }
}
