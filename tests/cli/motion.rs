//! Items that move: `query --motion`, and motions as an axis of `run`.

use std::fs;

use serde_json::json;

use super::process::*;
use super::runs::{cells, report};
use super::{BOXES, EYE_LOOK};

const BOUNDS: &str = "min_x,min_y,min_z,max_x,max_y,max_z";

#[test]
fn query_shows_the_world_after_a_frame() {
    let scene = format!("{BOXES}\n0,0,0,1,1,1\n5,0,0,6,1,1\n");
    let cameras = format!("{EYE_LOOK}\n-9,0.5,0.5,0,0.5,0.5\n");
    // Item 1 leaves the view, item 0 disappears, item 1 returns.
    let motion = format!("time_s,id,{BOUNDS}\n0,1,-20,0,0,-19,1,1\n1,0,,,,,,\n2.5,1,5,0,0,6,1,1\n");
    let folder = folder(&[
        ("scene.csv", scene.as_bytes()),
        ("cameras.csv", cameras.as_bytes()),
        ("motion.csv", motion.as_bytes()),
    ]);
    let query = "query --scene scene.csv --cameras cameras.csv --ids";
    for (options, wanted) in [
        ("", "0 1"),
        ("--motion motion.csv --frame 0", "0 1"),
        ("--motion motion.csv --frame 1", "0"),
        ("--motion motion.csv --frame 2", ""),
        ("--motion motion.csv", "1"),
    ] {
        let all = rows(&works(folder.path(), &format!("{query} {options}")));
        assert_eq!(all.len(), structure_names().len());
        assert!(
            all.iter().all(|row| row["visible_ids"] == wanted),
            "{options}"
        );
    }
    let refused = |options: &str, wanted: &str| {
        let line = format!("{query} {options}");
        assert_refused(&cullbench(folder.path(), &line), wanted, &line);
    };
    refused("--motion motion.csv --frame 4", "--frame is 4 | at most 3");
    refused(
        "--motion drfit",
        "unknown motion 'drfit' | did you mean 'drift'",
    );
    refused("--motion none.csv", "none.csv");
    fs::write(
        folder.path().join("motion.csv"),
        format!("time_s,id,{BOUNDS}\n0,7,,,,,,\n"),
    )
    .expect("writable");
    refused("--motion motion.csv", "motion.csv, line 2: id '7' | 0 to 1");
}

#[test]
fn a_file_named_city_has_no_streets() {
    let boxes = format!("{BOXES}\n47,0,0,48,1,1\n");
    let folder = folder(&[("city", boxes.as_bytes())]);
    let line = "query --scene city --cameras spin:frames=1 --motion traffic";
    let wanted = "no item of 'city' can move so | expected a generated city";
    assert_refused(&cullbench(folder.path(), line), wanted, line);
}

/// The item lies 0.03 inside a side plane, where f32 planes err by 0.06.
///
/// Planes that are rounded for the still scene drop it.
#[test]
fn items_that_a_file_moves_far_away_are_still_found() {
    let scene = format!("{BOXES}\n-10,-10,-10,-9,-9,-9\n9,9,9,10,10,10\n");
    let cameras = format!("{EYE_LOOK},aspect,near,far\n0,0,0,-7,1,5,1.5,1,inf\n");
    let place = "-518428.0625,735361.1875,436435.8125";
    let folder = folder(&[
        ("scene.csv", scene.as_bytes()),
        ("cameras.csv", cameras.as_bytes()),
        (
            "motion.csv",
            format!("time_s,id,{BOUNDS}\n0,1,{place},{place}\n").as_bytes(),
        ),
    ]);
    let query = "query --cameras cameras.csv --motion motion.csv --ids";
    for row in rows(&works(folder.path(), &format!("{query} --scene scene.csv"))) {
        assert_eq!(row["visible_ids"], "1", "{}", row["structure"]);
    }
}

#[test]
fn rows_keep_their_ids_beside_bad_ones() {
    let scene = format!("{BOXES}\n3,3,3,2,2,2\n-1,-1,-1,1,1,1\n9,9,9,0,0,0\n4,-1,-1,5,1,1\n");
    let folder = folder(&[
        ("bad.csv", scene.as_bytes()),
        (
            "cameras.csv",
            format!("{EYE_LOOK}\n-9,0,0,0,0,0\n").as_bytes(),
        ),
        ("points.csv", b"x,y,z\n4.5,0,0\n"),
        (
            "motion.csv",
            format!("time_s,id,{BOUNDS}\n0,1,,,,,,\n").as_bytes(),
        ),
        (
            "gone.csv",
            format!("time_s,id,{BOUNDS}\n0,2,,,,,,\n").as_bytes(),
        ),
    ]);
    let query = "query --scene bad.csv --skip-bad-items --cameras cameras.csv --ids";
    let motion = format!("{query} --motion motion.csv");
    let locate = "locate --scene bad.csv --skip-bad-items --points points.csv";
    for (line, ids, sum) in [
        (query, "visible_ids=1 3", "visible_id_sum=4"),
        (&motion, "visible_ids=3", "visible_id_sum=3"),
        (locate, "region_ids=3", "region_id_sum=3"),
    ] {
        for row in rows(&cullbench(folder.path(), line).out) {
            for wanted in [ids, sum].map(|pair| pair.split_once('=').expect("a pair")) {
                assert_eq!(row[wanted.0], wanted.1, "{line}");
            }
        }
    }
    let refused = cullbench(folder.path(), &format!("{query} --motion gone.csv"));
    let wanted = "gone.csv, line 2: id '2'; expected an item of 'bad.csv', 0 to 3";
    assert!(
        refused.code == Some(2) && refused.err.contains(wanted),
        "{refused:?}"
    );
}

#[test]
fn times_and_cameras_that_are_not_used_are_said() {
    let cameras = |times: [&str; 3]| {
        let rows = times.map(|time| format!("-9,0.5,0.5,0,0.5,0.5,{time}\n"));
        format!("{EYE_LOOK},time_s\n{}", rows.concat())
    };
    let [zero, one] = ["0", "1"].map(|time| cameras([time; 3]));
    let threes = zero + one.split_once('\n').expect("a header").1;
    let folder = folder(&[
        ("scene.csv", format!("{BOXES}\n0,0,0,1,1,1\n").as_bytes()),
        (
            "one.csv",
            format!("{EYE_LOOK},time_s\n-9,0.5,0.5,0,0.5,0.5,0\n").as_bytes(),
        ),
        ("all.csv", cameras(["0", "1", "2"]).as_bytes()),
        ("some.csv", cameras(["0", "", "2"]).as_bytes()),
        ("threes.csv", threes.as_bytes()),
        (
            "motion.csv",
            format!("time_s,id,{BOUNDS}\n0,0,0,0,0,1,1,2\n").as_bytes(),
        ),
    ]);
    let run =
        "run --scene scene.csv --structure linear --processes 1 --motion motion.csv --views 2";
    for (path, wanted) in [
        (
            "one",
            "a frame of 2 views repeats the 1 camera of 'one.csv'",
        ),
        (
            "all",
            "the last 1 of 3 cameras of 'all.csv' fill no frame of 2",
        ),
        ("some", "some.csv: time_s is empty in 1 of 3 rows"),
        (
            "threes",
            "threes.csv: 3 cameras at each time_s and 2 to a frame; expected --views 3",
        ),
    ] {
        let done = cullbench(
            folder.path(),
            &format!("{run} --path {path}.csv --out {path}"),
        );
        assert_eq!(done.code, Some(0), "{done:?}");
        assert!(unwrapped(&done.err).contains(wanted), "{}", done.err);
    }
    let early =
        format!("time_s,id,{BOUNDS}\n-2,0,0,0,0,1,1,2\n-1,0,0,0,0,1,1,3\n2,0,0,0,0,1,1,4\n");
    fs::write(folder.path().join("early.csv"), early).expect("writable");
    let line = "run --plan --scene scene.csv --path all.csv --motion early.csv";
    let done = cullbench(folder.path(), line);
    let wanted =
        "2 of 3 moves come before the first frame of 'all.csv' and happen in it, all at once";
    assert!(unwrapped(&done.err).contains(wanted), "{}", done.err);
    // Without times cameras see the frames of a run in turn, in a query all see one.
    fs::write(
        folder.path().join("still.csv"),
        format!("{EYE_LOOK}\n{0}{0}", "-9,0.5,0.5,0,0.5,0.5\n"),
    )
    .expect("writable");
    let frames = "--scene scene.csv --structure linear --motion motion.csv";
    let run = cullbench(
        folder.path(),
        &format!("run {frames} --path still.csv --processes 1"),
    );
    assert!(unwrapped(&run.err).contains("they are paired by their numbers"));
    let run = cullbench(
        folder.path(),
        "run --plan --scene city:n=20 --path orbit:frames=9 --motion drift:frames=2 --views 3",
    );
    for (path, wanted) in [
        (
            "orbit:frames=1",
            "its frames have 2 views, which repeat the 1 camera of 'orbit:frames=1'",
        ),
        (
            "orbit:frames=5",
            "its frames have 2 views: the last 3 of 5 cameras of 'orbit:frames=5' are not used",
        ),
    ] {
        let planned = cullbench(
            folder.path(),
            &format!("run --plan {frames} --views 2 --path {path}"),
        );
        assert!(unwrapped(&planned.err).contains(wanted), "{}", planned.err);
    }
    let wanted = "drift:frames=2: its frames have 6 views: the last 3 of 9 cameras of \
        'orbit:frames=9' are not used";
    assert!(unwrapped(&run.err).contains(wanted), "{}", run.err);
    let query = cullbench(
        folder.path(),
        &format!("query {frames} --cameras still.csv --frame 1"),
    );
    assert_eq!(query.code, Some(0), "{query:?}");
    assert!(!query.err.contains("paired"), "{}", query.err);
}

const PLAN: &str = "run --scene city:n=300 --path orbit:frames=4 --structure linear,wide,octree,bvh \
    --motion spawn:share=0.1,frames=12 --motion swarm:frames=10 --views 2 --processes 3";

#[test]
fn a_motion_is_an_axis_of_a_run() {
    let folder = folder(&[]);
    let at = |name: &str| folder.path().join(name);
    let told = works(folder.path(), &format!("{PLAN} --out r"));
    let told = unwrapped(&told);
    for part in ["queries of the frames", "linear: time per frame"] {
        assert!(told.contains(part), "{told}");
    }
    let whole = report(&at("r"));
    assert_eq!(cells(&whole).len(), 8);
    let mut aged = whole.clone();
    for cell in aged["cells"].as_array_mut().expect("cells") {
        let swarms = cell["path"]["motion"].to_string().contains("swarm");
        let name = cell["structure"].as_str().expect("a name");
        let ratio = match name {
            "wide" if swarms => 29.04,
            "wide" | "octree" => 2.5,
            _ => 1.9,
        };
        let own = json!({"value": ratio, "lower": null, "upper": null, "unit": "1"});
        cell["metrics"]["ageing_10"] = own;
    }
    fs::create_dir(at("aged")).expect("a folder");
    fs::write(at("aged/report.json"), aged.to_string()).expect("writable");
    let wanted = "Queries age: after 10 frames they take up to 29.0 x (wide) and 2.50 x (octree) \
        as long as on a fresh build; bvh stays at 1.90 x.";
    let found = unwrapped(&works(folder.path(), "report aged"));
    assert!(found.contains(wanted), "{found}");
    for cell in cells(&whole) {
        assert_eq!(cell["status"], "ok", "{cell}");
        let of = |name: &str| number(&cell["metrics"][name], "value");
        for name in [
            "frame_ns",
            "update_ns",
            "query_ns",
            "further_query_ns",
            "speedup",
        ] {
            assert!(of(name) > 0.0, "{name} in {cell}");
        }
        assert!(of("worst_frame_ns") > 0.0);
        assert!(cell["structure"] != "wide" || of("ageing_10") > 0.0);
        assert_eq!(cell["path"]["views_per_frame"], 2);
    }
    // Of several views samples.csv has rows of queries too: the page's are of frames.
    let sampled = rows(&fs::read_to_string(at("r/samples.csv")).expect("samples.csv"));
    let least = |task: &str| {
        let own = sampled
            .iter()
            .filter(|row| row["structure"] == "wide" && row["task"] == task);
        let ns = own.map(|row| row["cpu_ns"].parse::<f64>().expect("a number"));
        ns.fold(f64::INFINITY, f64::min)
    };
    let read = cullbench::report::read_report(&at("r/report.json")).expect("a report");
    let views = cullbench::report::views(&at("r"), &read);
    assert_eq!(views.len(), 2);
    for group in views.values() {
        let readings = group.times["wide"].iter();
        assert!(readings.clone().count() >= 10, "{group:?}");
        assert!(
            readings.clone().all(|r| r.ns >= least("frame")),
            "{group:?}"
        );
    }
    assert!(least("query") < least("frame"));
    let summary = rows(&fs::read_to_string(at("r/summary.csv")).expect("summary.csv"));
    assert_eq!(summary[0]["motion"], "spawn:share=0.1,frames=12");
    assert_eq!(summary[7]["motion"], "swarm:frames=10");
    assert!(summary.iter().all(|row| !row["frame_ns"].is_empty()));

    // A run that was cut short continues and has the same cells.
    fs::create_dir(at("cut")).expect("a folder");
    let stream = fs::read_to_string(at("r/stream.jsonl")).expect("a stream");
    let first: Vec<&str> = stream.lines().take(3).collect();
    fs::write(at("cut/stream.jsonl"), first.join("\n") + "\n").expect("writable");
    fs::copy(at("r/samples.csv"), at("cut/samples.csv")).expect("a copy");
    works(folder.path(), "run --resume --out cut");
    let resumed = report(&at("cut"));
    for (a, b) in cells(&whole).iter().zip(cells(&resumed)) {
        assert_eq!((&a["path"], &a["structure"]), (&b["path"], &b["structure"]));
        assert_eq!(a["metrics"]["visible_count"], b["metrics"]["visible_count"]);
    }
    // Shards are pairs of scene and path.
    works(
        folder.path(),
        &format!("{PLAN} --path spin:frames=4 --shard 1/2 --out a"),
    );
    works(
        folder.path(),
        &format!("{PLAN} --path spin:frames=4 --shard 2/2 --out b"),
    );
    works(folder.path(), "merge a b --out both");
    let none = cullbench(folder.path(), &format!("{PLAN} --shard 2/2 --out none"));
    let wanted = "this shard has no scene; expected a shard per scene and path at most";
    assert_refused(&none, wanted, "none");
    assert_eq!(cells(&report(&at("both"))).len(), 16);

    let same = works(folder.path(), "compare r r --format json");
    let compared = json(&same);
    let of = |metric: &str| {
        let rows = array(&compared, "rows").iter();
        rows.filter(|row| row["metric"] == metric).count()
    };
    assert_eq!((of("query_ns"), of("frame_ns")), (8, 8), "{same}");
    let page = fs::read_to_string(at("r/report.html")).expect("a page");
    for figure in [
        "time per frame, update and queries, of the motion</figcaption>",
        "visible items of the motion</figcaption>",
    ] {
        assert_eq!(page.matches(figure).count(), 2, "{figure}");
    }
    assert!(page.contains("swarm:frames=10"), "no motion on the page");
}

#[test]
fn what_auto_has_chosen_stands_in_cell_summary_and_notes() {
    let folder = folder(&[]);
    let run = "run --scene city:n=300 --path orbit:frames=4 --processes 1 --out r --structure \
        linear,auto,auto:use=wide,auto:use=linear";
    let forced = [
        ("auto:use=wide", "tree, not scan of all items ("),
        ("auto:use=linear", "scan of all items, not "),
    ];
    let check = |options: &str, built: &str, updates: [&str; 2]| {
        let line = format!("{run} {options}");
        let told = unwrapped(&works(folder.path(), &line));
        let whole = report(&folder.path().join("r"));
        let chose = |cell: usize| cells(&whole)[cell]["chose"].as_str();
        assert_eq!(chose(0), None, "linear chooses nothing");
        assert!(chose(1).is_some_and(|chose| chose.contains(" x)")));
        for (cell, ((name, wanted), update)) in forced.iter().zip(updates).enumerate() {
            let chose = chose(2 + cell).expect("a choice");
            assert!(
                chose.starts_with(&format!("{built}{wanted}")) && chose.contains(update),
                "{chose}"
            );
            assert!(told.contains(&format!("{name}: {chose}")), "{told}");
        }
        let summary = fs::read_to_string(folder.path().join("r/summary.csv"));
        let summary = rows(&summary.expect("summary.csv"));
        assert_eq!(summary[0]["chose"], "");
        assert_eq!(Some(summary[1]["chose"].as_str()), chose(1));
    };
    check("", "", ["", ""]);
    // Of several scenes each line says on which.
    let two = run.replace("--scene", "--scene uniform:n=300 --scene");
    let told = unwrapped(&works(folder.path(), &two.replace("--out r", "--out two")));
    let places = ["(on all)", "(on city 300 orbit)", "(on uniform 300 orbit)"];
    let of_auto = told.matches("scan of all items, not ").count();
    let placed: usize = places.map(|place| told.matches(place).count()).iter().sum();
    assert!(of_auto > 0 && placed >= of_auto, "{told}");
    fs::remove_dir_all(folder.path().join("r")).expect("removable");
    check(
        "--motion drift:share=50%,frames=6",
        "built as ",
        [
            "; refit in 6 of 6 updates, not",
            "; scan of overwritten boxes in 6 of 6 updates, not",
        ],
    );
}

#[test]
fn a_run_does_not_continue_with_another_motion() {
    let rows = |x: u32| format!("time_s,id,{BOUNDS}\n0,1,{x},0,0,9,1,1\n");
    let folder = folder(&[("motion.csv", rows(1).as_bytes())]);
    let line = "run --scene uniform:n=50 --path orbit:frames=1 --structure linear \
        --motion motion.csv --processes 1 --out r";
    works(folder.path(), line);
    fs::write(folder.path().join("motion.csv"), rows(2)).expect("writable");
    let done = cullbench(folder.path(), "run --resume --out r");
    assert_refused(
        &done,
        "motion 'motion.csv' has changed | expected the same",
        line,
    );
}

#[test]
fn motions_that_cannot_be_measured_are_refused() {
    let folder = folder(&[]);
    let run = "run --scene uniform:n=50 --path orbit:frames=4 --out r";
    for (options, wanted) in [
        ("--motion drift --cold", "--motion | --cold"),
        ("--views 2", "--motion"),
        ("--motion drift --views 0", "--views | 1 to 1000"),
        ("--motion drift --motion drift", "named twice"),
        ("--motion traffic", "expected a generated city"),
        ("--motion drift:share=2", "share=2; expected above 0"),
        ("--suite full --motion drift", "cold caches"),
    ] {
        let line = match options.starts_with("--suite") {
            true => format!("run {options} --out r"),
            false => format!("{run} {options}"),
        };
        let done = cullbench(folder.path(), &line);
        assert_eq!(done.code, Some(2), "{line}: {done:?}");
        let err = unwrapped(&done.err);
        assert!(
            wanted.split(" | ").all(|part| err.contains(part)),
            "{line}: {err}"
        );
        assert!(!folder.path().join("r").exists());
    }
}

#[test]
fn figures_follow_the_samples_and_rebuilds_that_do_not_come_are_told() {
    let folder = folder(&[]);
    let line = "run --scene city:n=300 --path orbit:frames=4 --structure linear,wide --no-bounds \
                --motion drift:share=0.5,frames=6 --processes 1 --update refit,every=50 --out r";
    let told = unwrapped(&works(folder.path(), line));
    let late = "@every=50: no rebuild in 6 frames";
    assert!(told.contains(late), "{told}");
    let read = |name| fs::read_to_string(folder.path().join("r").join(name)).expect("there");
    let (whole, samples) = (json(&read("report.json")), rows(&read("samples.csv")));
    for cell in cells(&whole) {
        let value = |name: &str| cell["metrics"][name]["value"].as_f64();
        let name = cell["structure"].as_str().expect("a name");
        let frames = samples.iter().filter(|row| {
            row["structure"] == name && row["task"] == "frame" && row["round"] == "0"
        });
        let returned: Vec<f64> = frames.map(|row| row["returned"].parse().unwrap()).collect();
        let mean = returned.iter().sum::<f64>() / returned.len() as f64;
        assert_eq!(value("visible_count"), Some(mean), "{cell}");
        let per = value("query_ns").unwrap() / mean;
        let found = value("ns_per_visible").unwrap();
        assert!((found / per - 1.0).abs() < 1e-9, "{cell}");
    }
}
