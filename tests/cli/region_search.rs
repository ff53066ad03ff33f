//! `locate`: on a map the one leaf that the engine's own descent finds, coded
//! here from the bytes of the file; on boxes every closed box.

use std::collections::BTreeSet;
use std::fs;

use serde_json::Value;
use tempfile::TempDir;

use super::BOXES;
use super::process::*;
use super::queries::number;

/// A map's BSP read from the bytes by code of its own, after the unofficial
/// Doom specs and linuxdoom 1.10 (r_main.c, R_PointInSubsector).
struct Map {
    things: Vec<[i64; 2]>,
    nodes: Vec<Node>,
    leaves: usize,
}

struct Node {
    line: [i64; 4],
    children: [u16; 2],
}

impl Map {
    fn read(bytes: &[u8]) -> Map {
        let word = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        let short = |at: usize| i64::from(word(at) as i16);
        let long = |at: usize| (usize::from(word(at + 2)) << 16) + usize::from(word(at));
        let lump = |name: &str, size: usize| -> Vec<usize> {
            let entries = (0..long(4)).map(|i| long(8) + 16 * i);
            let named = |at: &usize| bytes[at + 8..at + 16].starts_with(name.as_bytes());
            let entry = entries.clone().find(named).expect(name);
            let (start, length) = (long(entry), long(entry + 4));
            (start..start + length).step_by(size).collect()
        };
        Map {
            things: lump("THINGS", 10)
                .iter()
                .map(|&at| [short(at), short(at + 2)])
                .collect(),
            nodes: lump("NODES", 28)
                .iter()
                .map(|&at| Node {
                    line: [0, 2, 4, 6].map(|k| short(at + k)),
                    children: [word(at + 24), word(at + 26)],
                })
                .collect(),
            leaves: lump("SSECTORS", 4).len(),
        }
    }

    /// R_PointInSubsector.
    fn leaf(&self, [x, y]: [i64; 2]) -> usize {
        let mut child = self.nodes.len() as u16 - 1;
        while child & 0x8000 == 0 {
            let node = &self.nodes[usize::from(child)];
            child = node.children[usize::from(node.behind(x, y))];
        }
        usize::from(child & 0x7FFF)
    }
}

impl Node {
    /// R_PointOnSide, on whole map units.
    fn behind(&self, x: i64, y: i64) -> bool {
        let [node_x, node_y, node_dx, node_dy] = self.line;
        if node_dx == 0 {
            return if x <= node_x {
                node_dy > 0
            } else {
                node_dy < 0
            };
        }
        if node_dy == 0 {
            return if y <= node_y {
                node_dx < 0
            } else {
                node_dx > 0
            };
        }
        let (dx, dy) = (x - node_x, y - node_y);
        if (node_dy ^ node_dx ^ dx ^ dy) < 0 {
            return (node_dy ^ dx) < 0;
        }
        let (left, right) = (node_dy * dx, dy * node_dx);
        right >= left
    }
}

const LOCATE: &str = ",structure,region_count,region_id_sum,region_ids,nodes_tested";

fn check_locate(folder: &TempDir, scene: &str, points: &[([f64; 3], Vec<usize>)]) {
    check_search(folder, scene, ["point", "--points", "x,y,z"], points);
}

/// Runs `locate` and checks that every structure gives the wanted ids.
fn check_search<const N: usize>(
    folder: &TempDir,
    scene: &str,
    [column, option, header]: [&str; 3],
    sought: &[([f64; N], Vec<usize>)],
) {
    let lines: Vec<String> = sought
        .iter()
        .map(|(p, _)| p.map(|c| c.to_string()).join(","))
        .collect();
    let text = format!("{header}\n{}\n", lines.join("\n"));
    fs::write(folder.path().join("sought.csv"), text).expect("writable");
    let line = format!("locate --scene {scene} {option} sought.csv");
    let out = works(folder.path(), &line);
    assert_eq!(
        out.lines().next(),
        Some(format!("{column}{LOCATE}").as_str())
    );
    let (rows, names) = (rows(&out), structure_names());
    assert_eq!(rows.len(), sought.len() * names.len());
    let objects = json(&works(folder.path(), &format!("{line} --format json")));
    for (i, row) in rows.iter().enumerate() {
        let (question, name) = (i / names.len(), &names[i % names.len()]);
        let (at, wanted) = &sought[question];
        let what = format!("{scene}: {name} at {at:?}");
        assert_eq!(
            (&row[column], &row["structure"]),
            (&question.to_string(), name)
        );
        let ids: Vec<String> = wanted.iter().map(usize::to_string).collect();
        assert_eq!(row["region_ids"], ids.join(" "), "{what}");
        assert_eq!(number(row, "region_count"), wanted.len() as u64, "{what}");
        assert_eq!(
            number(row, "region_id_sum"),
            wanted.iter().sum::<usize>() as u64,
            "{what}"
        );
        let object = &objects[i];
        assert_eq!(keys(object), row.keys().map(String::as_str).collect());
        assert_eq!(object["region_ids"], Value::from(wanted.clone()), "{what}");
        assert_eq!(object["nodes_tested"].to_string(), row["nodes_tested"]);
    }
}

#[test]
fn every_point_of_a_map_lies_in_the_leaf_that_the_engine_finds() {
    let mut random = Random(12);
    for file in ["freedm_map12.wad", "freedm_map20.wad"] {
        let bytes = fs::read(datasets().join(file)).expect("part of the repository");
        let (map, folder) = (Map::read(&bytes), folder(&[(file, &bytes)]));
        assert!(map.things.len() > 20 && map.leaves > 80, "{file}");
        let mut places = map.things.clone();
        // Points exactly on the lines and at their ends.
        places.extend(map.nodes.iter().flat_map(|node| {
            let [x, y, dx, dy] = node.line;
            [[x, y], [x + dx, y + dy], [x - dx, y - dy], [x, y + 1]]
        }));
        let (low, high) = (i64::from(i16::MIN), i64::from(i16::MAX));
        places.extend((0..2000).map(|_| [0; 2].map(|_| random.between(low, high))));
        // Within the map, where the leaves are small.
        places.extend((0..1000).map(|_| [random.between(-600, 1000), random.between(-900, 600)]));
        places.extend([[low, low], [low, high], [high, low], [high, high]]);
        let mut points: Vec<([f64; 3], Vec<usize>)> = places
            .into_iter()
            .map(|at| {
                let height = random.between(-500, 500);
                let leaf = map.leaf(at);
                assert!(leaf < map.leaves);
                ([at[0] as f64, at[1] as f64, height as f64], vec![leaf])
            })
            .collect();
        let found: BTreeSet<usize> = points.iter().map(|p| p.1[0]).collect();
        assert!(
            found.len() * 2 > map.leaves,
            "{file}: {} leaves",
            found.len()
        );
        // Outside of what 16 bits can say there is no map.
        for outside in [
            [40_000.0, 0.0],
            [0.0, -40_000.0],
            [1e300, 1e300],
            [f64::MAX, 0.0],
        ] {
            points.push(([outside[0], outside[1], 0.0], vec![]));
        }
        check_locate(&folder, file, &points);
    }
}

#[test]
fn boxes_are_closed_and_share_their_faces() {
    let boxes: [[i64; 6]; 6] = [
        [0, 0, 0, 2, 2, 2],
        [2, 0, 0, 4, 2, 2],
        [0, 2, 0, 2, 4, 2],
        [2, 2, 0, 4, 4, 2],
        [1, 1, 1, 3, 3, 3],
        [5, 5, 5, 5, 5, 5],
    ];
    let lines: Vec<String> = boxes
        .iter()
        .map(|b| b.map(|v| v.to_string()).join(","))
        .collect();
    let scene = format!("{BOXES}\n{}\n", lines.join("\n"));
    // Every half step of a grid that is larger than the scene.
    let mut points = Vec::new();
    for (x, y, z) in
        (-1..=12).flat_map(|x| (-1..=12).flat_map(move |y| (-1..=12).map(move |z| (x, y, z))))
    {
        let doubled = [x, y, z];
        let holds = |b: &[i64; 6]| (0..3).all(|k| (2 * b[k]..=2 * b[k + 3]).contains(&doubled[k]));
        let wanted: Vec<usize> = (0..boxes.len()).filter(|&i| holds(&boxes[i])).collect();
        points.push((doubled.map(|v| v as f64 / 2.0), wanted));
    }
    // The corner of five boxes, and far away.
    let five = points.iter().find(|(p, _)| *p == [2.0, 2.0, 1.0]);
    assert_eq!(five.map(|(_, ids)| ids.len()), Some(5));
    points.push(([1e308, -1e308, 0.0], vec![]));
    points.push(([2.0, 1.0, 2.000_001], vec![4]));
    check_locate(
        &folder(&[("boxes.csv", scene.as_bytes())]),
        "boxes.csv",
        &points,
    );
}

#[test]
fn a_box_finds_what_it_touches_and_nothing_an_ulp_away() {
    let mut random = Random(5);
    let mut any = || -> [i64; 6] {
        let (low, size) = (
            [0; 3].map(|_| random.between(-9, 9)),
            [0; 3].map(|_| random.between(0, 4)),
        );
        [0, 1, 2, 3, 4, 5].map(|k| {
            if k < 3 {
                low[k]
            } else {
                low[k - 3] + size[k - 3]
            }
        })
    };
    let items: Vec<[i64; 6]> = (0..200).map(|_| any()).collect();
    // Tenths, far from zero: f32 holds none of them.
    let tenths = |v: i64| 1e8 + v as f64 / 10.0;
    let lines = items
        .iter()
        .map(|b| b.map(|v| tenths(v).to_string()).join(","));
    let scene = format!("{BOXES}\n{}\n", lines.collect::<Vec<_>>().join("\n"));
    let mut sought = Vec::new();
    for _ in 0..100 {
        let b = any();
        let found = |apart: i64| -> Vec<usize> {
            let overlaps = |item: &[i64; 6]| {
                (0..3).all(|k| item[k] + apart <= b[k + 3] && b[k] + apart <= item[k + 3])
            };
            (0..items.len()).filter(|&i| overlaps(&items[i])).collect()
        };
        let bounds = b.map(tenths);
        sought.push((bounds, found(0)));
        if (0..3).all(|k| b[k] < b[k + 3]) {
            // An ulp smaller on all sides: what only touched is beside it.
            let smaller = [0, 1, 2, 3, 4, 5].map(|k| match k {
                0..3 => bounds[k].next_up(),
                _ => bounds[k].next_down(),
            });
            sought.push((smaller, found(1)));
        }
    }
    assert!(sought.iter().filter(|s| s.1.len() > 1).count() > 50);
    let folder = folder(&[("boxes.csv", scene.as_bytes())]);
    check_search(&folder, "boxes.csv", ["box", "--boxes", BOXES], &sought);
    // Any finite f64 can be searched for; a bad box is reported by its line alone.
    let all: Vec<usize> = (0..items.len()).collect();
    let wide = ([-1e300, -1e300, -1e300, 1e300, 1e300, 1e300], all);
    check_search(&folder, "boxes.csv", ["box", "--boxes", BOXES], &[wide]);
    let bad = format!("{BOXES}\n0,0,0,-1,0,0\n0,0,0,0,-1,0\n");
    std::fs::write(folder.path().join("bad.csv"), bad).expect("written");
    let line = "locate --scene boxes.csv --boxes bad.csv --skip-bad-items";
    let done = cullbench(folder.path(), line);
    assert_refused(&done, "bad.csv, line 2 | inverted | min_x <= max_x", line);
    assert!(!done.err.contains("--skip-bad-items"), "{done:?}");
}
