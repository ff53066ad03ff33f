//! Region search is exact: points and boxes are compared as they were written,
//! in f64, whatever f32 makes of them on the way through a structure.

use cullbench::index::Registry;
use cullbench::query::ItemId;
use cullbench::scene::{Scene, WorldBox};
use dashu_int::IBig;
use glam::DVec3;

/// A double as a whole number of 2^-1074.
fn units(x: f64) -> IBig {
    let bits = x.abs().to_bits();
    let exponent = (bits >> 52) as usize;
    let mantissa = bits & ((1 << 52) - 1) | u64::from(exponent > 0) << 52;
    let size = IBig::from(mantissa) << exponent.saturating_sub(1);
    if x < 0.0 { -size } else { size }
}

/// Points at the walls of tilings and boxes, one or no ulp of f64 away.
#[test]
fn every_structure_finds_what_f64_says_where_f32_cannot_tell() {
    let mut wrong_in_f32 = 0;
    for offset in [0.0, 1e4 + 0.3, 6.4e6 + 0.1, 1e9 + 0.7] {
        // Walls on a grid that f32 does not have, shared by neighbours.
        let wall = |i: usize| offset + i as f64 * 1.7 / 3.0;
        let cell = |i: usize| {
            let at = DVec3::new(wall(i % 9), wall(i / 9 % 9), offset);
            let next = DVec3::new(wall(i % 9 + 1), wall(i / 9 % 9 + 1), offset + 1.1);
            WorldBox::new(at, next)
        };
        let boxes: Vec<WorldBox> = (0..81).map(cell).collect();
        // About its own origin, and about zero, where f32 has few digits.
        for origin in [DVec3::ZERO, DVec3::splat(offset.round())] {
            let scene = Scene::about("grid", &boxes, origin).expect("a scene");
            assert!(scene.originals.boxes().is_some());
            let points: Vec<DVec3> = (0..10usize)
                .flat_map(|i| [wall(i).next_down(), wall(i), wall(i).next_up()])
                .flat_map(|x| (0..9).map(move |j| DVec3::new(x, wall(j) + 0.2, offset + 0.5)))
                .collect();
            for spec in Registry::builtin().structures("all").expect("structures") {
                let Ok(index) = spec.build(&scene.items) else {
                    continue;
                };
                for &p in &points {
                    let sought = scene.search_point(p);
                    let inside = |b: &WorldBox| {
                        (0..3).all(|k| {
                            let p = units(p[k]);
                            units(b.min[k]) <= p && p <= units(b.max[k])
                        })
                    };
                    let wanted = boxes.iter().zip(0..).filter(|(b, _)| inside(b));
                    let wanted: Vec<ItemId> = wanted.map(|(_, id)| id).collect();
                    assert_eq!(scene.holding(&sought), wanted);
                    let mut found = Vec::new();
                    index.locate(sought.local, &mut found);
                    wrong_in_f32 += usize::from(found.len() != wanted.len());
                    scene.refine(&sought, &mut found, 0);
                    found.sort_unstable();
                    assert_eq!(found, wanted, "{}: {p:?}", spec.label);
                }
            }
        }
    }
    assert!(wrong_in_f32 > 1000, "{wrong_in_f32}");
}

/// Boxes whose faces meet, or pass by each other by one ulp of f64.
#[test]
fn every_structure_finds_what_overlaps_a_box_as_written() {
    let structures = Registry::builtin().structures("all").expect("structures");
    let mut state = 3u64;
    let mut below = |n: u64| {
        state = state.wrapping_mul(0x5851_F42D_4C95_7F2D).wrapping_add(1);
        (state >> 33) % n
    };
    let (mut visible, mut refined) = (0, 0);
    for offset in [0.0, 1e6, -4e9] {
        let mut any = || {
            let mut corner = || {
                DVec3::from_array([0; 3].map(|_| {
                    let x = offset + below(9) as f64 * 0.1;
                    [x.next_up(), x.next_down(), x, x][below(4) as usize]
                }))
            };
            let (a, b) = (corner(), corner());
            WorldBox::new(a.min(b), a.max(b))
        };
        let boxes: Vec<WorldBox> = (0..300).map(|_| any()).collect();
        let scene = Scene::from_boxes("any", &boxes).expect("a scene");
        let indexes = structures.iter().map(|spec| spec.build(&scene.items));
        let indexes: Vec<_> = indexes.filter_map(Result::ok).collect();
        assert!(indexes.len() > 5);
        for _ in 0..100 {
            let sought = scene.search_box(any());
            let by = &sought.world;
            let overlaps = |b: &WorldBox| {
                (0..3).all(|k| {
                    units(b.min[k]) <= units(by.max[k]) && units(by.min[k]) <= units(b.max[k])
                })
            };
            let wanted = boxes.iter().zip(0..).filter(|(b, _)| overlaps(b));
            let wanted: Vec<ItemId> = wanted.map(|(_, id)| id).collect();
            let mut all: Vec<ItemId> = (0..boxes.len() as ItemId).collect();
            scene.refine_overlapping(&sought, &mut all);
            assert_eq!(all, wanted);
            visible += wanted.len();
            for index in &indexes {
                let mut found = Vec::new();
                index.visible(&sought.volume, &mut found);
                refined += found.len() - wanted.len();
                scene.refine_overlapping(&sought, &mut found);
                found.sort_unstable();
                assert_eq!(found, wanted);
            }
        }
    }
    // There was something to find, and something to take away again.
    assert!(visible > 5000 && refined > 1000, "{visible} {refined}");
}
