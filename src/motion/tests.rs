//! Laws stay within the scene and are repeatable; files are read or refused.

use super::*;
use crate::path::read_cameras_csv;
use crate::scene;
use glam::DVec3;

fn scene(source: &str) -> Scene {
    scene::load(source, &Default::default()).unwrap()
}

/// The bounds of all items after each frame.
fn frames(motion: &Motion, scene: &Scene) -> Vec<(Vec<ItemId>, Vec<Aabb>)> {
    let (mut items, mut replay) = (scene.items.clone(), motion.replay());
    let mut all = Vec::new();
    while let Some(ids) = replay.advance(&mut items) {
        let ids = ids.to_vec();
        all.push((ids, items.clone()));
    }
    all
}

#[test]
fn every_motion_repeats_itself_and_stays_within_the_scene() {
    for source in ["city:n=400", "uniform:n=50"] {
        let scene = scene(source);
        for family in MOTIONS {
            for same in [true, false] {
                let spec = format!("{}:share=0.2,step=0.73,frames=30,same={same}", family.name);
                let motion = match Motion::load(&spec, &scene) {
                    Err(error) => {
                        assert_eq!(
                            (family.name, source),
                            ("traffic", "uniform:n=50"),
                            "{error}"
                        );
                        continue;
                    }
                    Ok(motion) => motion,
                };
                let all = frames(&motion, &scene);
                assert!(all == frames(&motion, &scene), "{spec}");
                let other = Motion::load(&format!("{spec},seed=2"), &scene).unwrap();
                assert!(all != frames(&other, &scene), "{spec}");
                let mut before = &scene.items;
                for (ids, items) in &all {
                    assert!(ids.is_sorted_by(|a, b| a < b), "{spec}: {ids:?}");
                    for (id, b) in items.iter().enumerate() {
                        assert!(b.is_finite());
                        assert!(b.is_empty() || scene.bounds.contains(b), "{spec}: {b:?}");
                        let is_mover = ids.binary_search(&(id as ItemId)).is_ok();
                        assert!(is_mover || *b == before[id], "{spec}: {id}");
                    }
                    before = items;
                }
                assert_eq!(same, all[0].0 == all[1].0, "{spec}");
                assert!(all[29].1 != scene.items, "{spec}");
                let removed = all.iter().any(|(_, items)| items.contains(&REMOVED));
                assert_eq!(removed, family.name == "spawn");
            }
        }
    }
}

/// In the streets of the whole city, whatever part of it is loaded.
#[test]
fn the_same_items_of_a_part_of_a_city_move() {
    let whole = scene("city:n=4000");
    let mut part = whole.clone();
    part.items.truncate(40);
    let movers = |scene: &Scene| {
        let motion = Motion::load("traffic:share=1,frames=1", scene).unwrap();
        let ids = frames(&motion, scene)[0].0.clone();
        ids.into_iter().filter(|id| *id < 40).collect::<Vec<_>>()
    };
    assert_eq!(movers(&part), movers(&whole));
}

#[test]
fn a_step_is_as_long_as_it_says() {
    let scene = scene("uniform:n=300");
    // Reflections shorten the moves of a few.
    let whole = |of: &str, scene: &Scene| {
        let motion = Motion::load(&format!("{of}:share=1,step=0.1,frames=1"), scene).unwrap();
        let (moved, boxes) = &frames(&motion, scene)[0];
        let mut whole = 0;
        for &id in moved {
            let [start, end] = [scene.items[id as usize], boxes[id as usize]];
            let step = end.centre() - start.centre();
            let wanted = 0.1 * start.extent().max_element();
            assert!(step.length() <= wanted * 1.001, "{of}: {step} {wanted}");
            whole += usize::from(step.length() > wanted * 0.999);
            assert!(of == "drift" || step.x == 0.0 || step.y == 0.0, "{step}");
        }
        assert!(
            10 * whole > 9 * moved.len(),
            "{of}: {whole} of {}",
            moved.len()
        );
    };
    whole("drift", &scene);
    whole("traffic", &scene_of_cars());
}

/// The mean size and not the ulp that outward rounding makes of them.
#[test]
fn points_that_f32_rounds_move_as_others_do() {
    let moved = |fraction: f64| {
        let at = |n: usize| DVec3::new(n as f64 + fraction, (n % 7) as f64 + fraction, fraction);
        let boxes: Vec<WorldBox> = (0..50).map(|n| WorldBox::new(at(n), at(n))).collect();
        let scene = Scene::from_boxes("points", &boxes).unwrap();
        let motion = Motion::load("drift:share=1,step=0.9,frames=20", &scene).unwrap();
        let last = frames(&motion, &scene).pop().unwrap().1;
        let far = last
            .iter()
            .zip(&scene.items)
            .map(|(a, b)| a.centre().distance(b.centre()));
        far.fold(0.0, f32::max)
    };
    let exact = moved(0.5);
    assert!(
        exact > 0.1 && (moved(0.1) - exact).abs() < 0.1 * exact,
        "{exact} {}",
        moved(0.1)
    );
}

#[test]
fn traffic_keeps_to_the_streets_of_a_city_that_is_moved() {
    let movers = |source: &str| {
        let scene = scene(source);
        let motion = Motion::load("traffic:share=1,frames=1", &scene).unwrap();
        frames(&motion, &scene)[0].0.clone()
    };
    for city in ["city:n=500", "city:n=200,block=60,street=0.25"] {
        let here = movers(city);
        assert!(here.len() > 100, "{city}");
        for offset in ["40", "1e5", "-1e7"] {
            assert_eq!(movers(&format!("{city},offset={offset}")), here, "{city}");
        }
    }
}

fn scene_of_cars() -> Scene {
    scene("city:n=500,block=60,street=20")
}

#[test]
fn wrong_specs_are_refused() {
    let (some, none) = (scene("uniform:n=50"), scene("uniform:n=0"));
    for (spec, wanted) in [
        ("drfit", "did you mean 'drift'"),
        ("drift:speed=1", "unknown parameter of 'drift': 'speed'"),
        ("drift:share=0", "share=0; expected above 0, at most 1"),
        ("drift:share=200%", "share=2; expected above 0"),
        (
            "drift:step=-1",
            "step is '-1'; expected a number above 0 and below",
        ),
        ("drift:same=yes", "same=yes; expected true or false"),
        ("drift:frames=0", "frames is '0'; expected a whole number"),
        ("traffic", "expected a generated city"),
    ] {
        let error = Motion::load(spec, &some).err().unwrap().to_string();
        assert!(error.contains(wanted), "{spec}: {error}");
    }
    let error = Motion::load("shuffle", &none).err().unwrap().to_string();
    assert!(error.contains("expected a scene with items"), "{error}");
}

const HEADER: &str = "time_s,id,min_x,min_y,min_z,max_x,max_y,max_z\n";

#[test]
fn recorded_rows_move_and_remove_items() {
    let scene = scene("uniform:n=5");
    let text = format!("{HEADER}0,3,1,2,3,4,5,0.1e2\n0,1,,,,,,\n0.5,1,0,0,0,0.1,1,1\n");
    let motion = recorded_motion(&text, &scene);
    let all = frames(&motion, &scene);
    assert_eq!(all.len(), 2);
    assert_eq!((&all[0].0[..], &all[1].0[..]), (&[1, 3][..], &[1][..]));
    assert_eq!((all[0].1[1], all[0].1[3].max.z), (REMOVED, 10.0));
    // Outward: f32 cannot hold 0.1.
    assert!(f64::from(all[1].1[1].max.x) > 0.1);
    assert_eq!(all[1].1[0], scene.items[0]);
}

fn recorded_motion(text: &str, scene: &Scene) -> Motion {
    let recorded = recorded::read_motion_csv(text.as_bytes(), "m.csv", scene).unwrap();
    Motion {
        name: "m.csv".to_owned(),
        frames: recorded.frames(),
        items: scene.items.len(),
        source: Source::Recorded(recorded),
    }
}

/// A still frame, a camera between two moves, and moves after the last camera.
#[test]
fn frames_are_those_of_cameras_with_times() {
    let scene = scene("uniform:n=5");
    let rows = "0,1,0,0,0,1,1,1\n1,1,0,0,0,2,2,2\n1,2,,,,,,\n2,1,0,0,0,3,3,3\n9,0,,,,,,\n";
    let text = format!("{HEADER}{rows}");
    let seen = |times: &str, views| {
        let eyes = "eye_x,eye_y,eye_z,look_x,look_y,look_z";
        let row = |time: &str| format!("{time},0,0,0,1,0,0\n");
        let csv = format!(
            "time_s,{eyes}\n{}",
            times.split(' ').map(row).collect::<String>()
        );
        let path = read_cameras_csv(csv.as_bytes(), "c.csv", &Default::default()).unwrap();
        let whole = recorded_motion(&text, &scene).reach();
        let motion = recorded_motion(&text, &scene).seen_by(&path, views);
        // The margin is that of all rows, whichever are seen.
        assert_eq!(motion.reach(), whole);
        let again = recorded_motion(&text, &scene).seen_by(&path, views);
        assert_eq!(motion.digest(), again.seen_by(&path, views).digest());
        let frames = frames(&motion, &scene).into_iter();
        let shown = |(ids, items): (Vec<ItemId>, Vec<Aabb>)| (ids, items[1].max.x);
        frames.map(shown).collect::<Vec<_>>()
    };
    let first = scene.items[1].max.x;
    let wanted = [
        (vec![], first),
        (vec![1], 1.0),
        (vec![], 1.0),
        (vec![1, 2], 3.0),
    ];
    assert_eq!(seen("-1 0 0.5 2.5", 1), wanted);
    for times in ["0 0 1 1", "0 0 1 1 9"] {
        assert_eq!(seen(times, 2), [(vec![1], 1.0), (vec![1, 2], 2.0)]);
    }
    assert_eq!(seen("0", 2), [(vec![1], 1.0)]);
    // Without a time for each camera a frame has the rows of one time.
    assert_eq!(seen("0  1", 1).len(), 4);
}

/// Boxes that are equal in f32 but written differently are different truths.
#[test]
fn files_of_other_truths_have_other_digests() {
    let scene = scene("uniform:n=5");
    let digest = |high: &str| {
        let text = format!("{HEADER}0,1,0,0,0,{high},1,1\n");
        let motion = recorded::read_motion_csv(text.as_bytes(), "m.csv", &scene).unwrap();
        let mut hash = hmac_sha256::Hash::new();
        motion.digest(&mut hash);
        hash.finalize()
    };
    assert_ne!(digest("8.00000000001"), digest("8.00000000002"));
    assert_eq!(digest("8"), digest("8.0"));
    // A move after the last camera widens the margin of all frames.
    let paced = |late: &str| {
        let text = format!("{HEADER}0,1,0,0,0,1,1,1\n9,2,0,0,0,{late},1,1\n");
        let motion = recorded::read_motion_csv(text.as_bytes(), "m.csv", &scene).unwrap();
        let mut hash = hmac_sha256::Hash::new();
        motion.at([1.0].iter()).0.digest(&mut hash);
        hash.finalize()
    };
    assert_ne!(paced("1e6"), paced("1e7"));
    assert_eq!(paced("1"), paced("0.5"));
}

#[test]
fn errors_of_a_file_name_the_line() {
    let scene = scene("uniform:n=5");
    for (rows, wanted) in [
        ("", "line 2: no motion; expected at least one row"),
        (
            "0,5,0,0,0,1,1,1",
            "line 2: id '5'; expected an item of 'uniform:n=5', 0 to 4",
        ),
        ("0,-1,0,0,0,1,1,1", "line 2: id '-1'"),
        (
            "0,1,0,0,,1,1,1",
            "line 2: min_z ''; expected a finite number",
        ),
        ("0,1,0,0,nan,1,1,1", "line 2: min_z 'nan'"),
        ("x,1,0,0,0,1,1,1", "line 2: time_s 'x'"),
        ("0,1,2,0,0,1,1,1", "line 2: a box from [2.0, 0.0, 0.0]"),
        ("0,1,0,0,0,1e300,1,1", "line 2: a box from"),
        (
            "1,1,0,0,0,1,1,1\n0,1,0,0,0,1,1,1",
            "line 3: time_s 0 after 1",
        ),
        (
            "1,1,0,0,0,1,1,1\n1,1,0,0,0,1,1,1",
            "line 3: item 1 twice at one time",
        ),
        ("1,1,0,0", "line 2: 4 fields; expected 8"),
    ] {
        let text = format!("{HEADER}{rows}\n");
        let error = recorded::read_motion_csv(text.as_bytes(), "m.csv", &scene);
        let error = error.unwrap_err().to_string();
        assert!(
            error.starts_with("m.csv, ") && error.contains(wanted),
            "{rows}: {error}"
        );
    }
    let error = recorded::read_motion_csv(&b"time_s,id\n"[..], "m.csv", &scene).unwrap_err();
    assert!(error.to_string().contains("no column 'min_x'"), "{error}");
}
