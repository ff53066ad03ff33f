//! `run --shard` and `merge`: the shards of a plan are together what one run of
//! it is, and what is no shard of it is refused by name.

use std::fs;
use std::path::Path;
#[cfg(unix)]
use std::process::Command;

use serde_json::Value;

use super::process::*;
use super::runs::{cells, report};

const PLAN: &str = "run --scene city:n=300 --scene uniform:n=200 --path orbit:frames=4 \
    --path spin:frames=4 --structure linear,bvh --processes 2 --no-bounds";

/// Questions and answers of the cells: everything but times.
fn answers(run: &Path) -> Vec<Value> {
    let of_cell = |cell: &Value| {
        let counted = [
            "visible_count",
            "cull_rate",
            "excess",
            "nodes_tested",
            "regions_found",
        ];
        let counted = counted.map(|name| cell["metrics"][name]["value"].clone());
        let named = [
            "scene",
            "path",
            "structure",
            "test",
            "status",
            "error",
            "left_out",
        ];
        Value::from_iter(
            named
                .map(|name| cell[name].clone())
                .into_iter()
                .chain(counted),
        )
    };
    cells(&report(run)).iter().map(of_cell).collect()
}

/// Keys of the parts of a stream, and their counts of visible items per camera.
fn streamed(run: &Path) -> Vec<(Value, Value)> {
    let text = fs::read_to_string(run.join("stream.jsonl")).expect("a stream");
    let parts = text.lines().map(json).filter(|line| line["line"] == "part");
    parts
        .map(|line| {
            (
                line["part"]["key"].clone(),
                line["part"]["known"]["visible"].clone(),
            )
        })
        .collect()
}

#[test]
fn shards_together_are_the_run_of_the_whole_plan() {
    let folder = folder(&[]);
    let at = |name: &str| folder.path().join(name);
    works(folder.path(), &format!("{PLAN} --out whole"));
    for i in 1..=3 {
        works(
            folder.path(),
            &format!("{PLAN} --shard {i}/3 --out part{i}"),
        );
    }
    // In any order.
    let told = works(folder.path(), "merge part3 part1 part2 --out merged");
    // The folder that one stands in, which keeps being it.
    fs::create_dir(at("here")).expect("a folder");
    works(&at("here"), "merge ../part3 ../part1 ../part2 --out .");
    assert_eq!(answers(&at("here")), answers(&at("merged")));
    assert!(at("here/report.html").is_file());
    assert!(told.contains("8 cells of 3 shards"), "{told}");
    assert_eq!(answers(&at("merged")), answers(&at("whole")));
    assert_eq!(streamed(&at("merged")), streamed(&at("whole")));
    let names = |run: &str| {
        let mut names: Vec<_> = fs::read_dir(at(run)).expect("readable").collect();
        names.sort_by_key(|entry| entry.as_ref().expect("readable").file_name());
        let names = names
            .into_iter()
            .map(|entry| entry.expect("readable").file_name());
        names.collect::<Vec<_>>()
    };
    assert_eq!(names("merged"), names("whole"));

    // Every cell has the samples of its shard, digit by digit.
    let samples = |run: &str| fs::read_to_string(at(run).join("samples.csv")).expect("samples");
    let sorted = |runs: &[&str]| {
        let mut lines: Vec<String> = Vec::new();
        for run in runs {
            lines.extend(samples(run).lines().skip(1).map(str::to_owned));
        }
        lines.sort();
        lines
    };
    assert_eq!(sorted(&["merged"]), sorted(&["part1", "part2", "part3"]));
    let all = rows(&samples("merged"));
    for cell in cells(&report(&at("merged"))) {
        let own = all.iter().filter(|row| {
            row["scene"] == cell["scene"]["name"].as_str().expect("a name")
                && row["path"] == cell["path"]["name"].as_str().expect("a name")
                && row["structure"] == cell["structure"].as_str().expect("a name")
        });
        assert_eq!(own.count() as f64, number(&cell["samples_ref"], "rows"));
    }
    let merged = report(&at("merged"));
    assert_eq!(merged["run"]["shard"], Value::Null);
    assert!(merged["run"]["finished_at"].is_string());
    let command = merged["run"]["command"].as_str().expect("a command");
    let is_placed = ["--shard", "--out"].map(|option| command.contains(option));
    assert!(command.contains(" run --") && command.contains("=city:n=300 "));
    assert!(is_placed == [false; 2], "{command}");
    // It is a run like any other, and a finished one.
    let before = contents(&at("merged"));
    works(folder.path(), "run --resume --out merged");
    assert!(contents(&at("merged")) == before, "resuming changed files");
    works(folder.path(), "report merged");

    let stream = at("part1").join("stream.jsonl");
    let text = fs::read_to_string(&stream).expect("a stream");
    let (before, end) = text.rsplit_once("\"samples_end\":").expect("a part");
    let after = end.trim_start_matches(|c: char| c.is_ascii_digit());
    fs::write(&stream, format!("{before}\"samples_end\":5{after}")).expect("writable");
    let wanted = "part1/stream.jsonl, line | samples that end at byte 5 | expected an end behind";
    all_refused(&folder, &["merge part1 part2 part3 --out again"], wanted);
}

#[test]
fn missing_shards_are_named() {
    let folder = folder(&[]);
    for i in [1, 3, 4] {
        works(
            folder.path(),
            &format!("{PLAN} --shard {i}/4 --out part{i}"),
        );
    }
    let missing = "no shard has city:n=300 along spin:frames=4 | expected all of the plan";
    all_refused(&folder, &["merge part1 part3 part4 --out merged"], missing);
}

/// Changes the first line of a stream.
pub fn edit_header(run: &Path, edit: impl FnOnce(&mut Value)) {
    let file = run.join("stream.jsonl");
    let text = fs::read_to_string(&file).expect("a stream");
    let (first, rest) = text.split_once('\n').expect("lines");
    let mut header = json(first);
    edit(&mut header);
    fs::write(&file, format!("{header}\n{rest}")).expect("writable");
}

#[test]
fn what_must_not_be_mixed_is_refused_by_name() {
    let folder = folder(&[]);
    for i in [1, 2] {
        works(
            folder.path(),
            &format!("{PLAN} --shard {i}/2 --out part{i}"),
        );
    }
    let refused = |wanted: &str| all_refused(&folder, &["merge part1 part2 --out merged"], wanted);
    let part2 = folder.path().join("part2");
    let kept = fs::read(part2.join("stream.jsonl")).expect("a stream");
    let restore = || fs::write(part2.join("stream.jsonl"), &kept).expect("writable");
    for (place, value, wanted) in [
        ("/run/seed", Value::from(9), "part2 | seed '9'"),
        ("/run/suite", "quick".into(), "suite 'quick'"),
        (
            "/run/processes",
            1.into(),
            "stream.jsonl, line | process 2 of city:n=300 | expected a part of the plan",
        ),
        ("/structures/1", "bsp".into(), "structures 'linear,bsp'"),
        ("/machine/cpu", "Another".into(), "cpu 'Another'"),
        ("/machine/cores", 99.into(), "cores '99'"),
        ("/machine/os", "Plan 9".into(), "system 'Plan 9'"),
        (
            "/machine/instruction_set",
            "mmx".into(),
            "instruction set 'mmx'",
        ),
        ("/toolchain/rustc", "rustc 1.0".into(), "rustc 'rustc 1.0'"),
        ("/source/commit", "abc".into(), "commit 'abc'"),
        ("/source/dirty", Value::Null, "dirty | 'unknown'"),
        ("/binary", "00".into(), "digest '00'"),
        ("/schema_version", 1.into(), "schema version 1; expected"),
        ("/whole/0/path", "zoom".into(), "a shard of another plan"),
        ("/args/6", "zoom".into(), "part2 | --path"),
    ] {
        edit_header(&part2, |header| {
            *header.pointer_mut(place).expect(place) = value;
        });
        refused(wanted);
        restore();
    }
    // The same name, another scene.
    let text = String::from_utf8(kept.clone()).expect("UTF-8");
    let digest = json(text.lines().nth(1).expect("a part"));
    let digest = digest["part"]["scene"]["digest"]
        .as_str()
        .expect("a digest");
    let other = text.replace(digest, "0123");
    fs::write(part2.join("stream.jsonl"), other).expect("writable");
    refused("scene 'city:n=300' is another one than in part1");
    restore();
    // Stopped, or with a part that is not there.
    let cut = |lines: usize| {
        let kept: Vec<&str> = text.lines().take(lines).collect();
        fs::write(part2.join("stream.jsonl"), kept.join("\n") + "\n").expect("writable");
    };
    cut(text.lines().count() - 1);
    refused("part2 | not finished | run --resume --out part2");
    cut(2);
    refused("part2 | not finished");
    restore();
    // Counted twice, a process would be two.
    let lines: Vec<&str> = text.lines().collect();
    for (twice, wanted) in [
        (lines[0], "line 2: a second header; expected one"),
        (
            lines[1],
            "line 3: process 1 of city:n=300 | a second time; expected each part once",
        ),
    ] {
        let more = text.replace(twice, &format!("{twice}\n{twice}"));
        fs::write(part2.join("stream.jsonl"), more).expect("writable");
        refused(&format!("part2/stream.jsonl, {wanted}"));
    }
    // Only the first process has the answers and the plan.
    let second = text.replace(&format!("{}\n", lines[1]), "");
    fs::write(part2.join("stream.jsonl"), second).expect("writable");
    refused("stream.jsonl, line 3: process 2 of city | expected the part of its process 1 before");
    let bad = text.replacen("\"process\":0", "\"process\":-7", 1);
    fs::write(part2.join("stream.jsonl"), bad).expect("writable");
    refused("stream.jsonl, line 2, column | part.process: '-7'; expected | a whole number from 0");
    restore();
    let samples = fs::read(part2.join("samples.csv")).expect("samples");
    fs::write(part2.join("samples.csv"), &samples[..samples.len() - 1]).expect("writable");
    refused("part2/samples.csv | bytes; expected");
    let nothing = vec![0; samples.len()];
    fs::write(part2.join("samples.csv"), nothing).expect("writable");
    refused("part2/samples.csv: 0 sound bytes; expected");
    fs::write(part2.join("samples.csv"), &samples).expect("writable");
    fs::create_dir(folder.path().join("mine")).expect("made");
    fs::write(folder.path().join("mine/notes"), "mine").expect("writable");
    let wanted = "mine: has other files; expected an empty or new folder";
    all_refused(&folder, &["merge part1 part2 --out mine"], wanted);

    works(folder.path(), &format!("{PLAN} --out whole"));
    let wanted = "whole: a whole run; expected a shard (run --shard i/n)";
    for runs in ["whole", "part1 whole", "whole part1 part2"] {
        all_refused(&folder, &[format!("merge {runs} --out merged")], wanted);
    }

    let twice = ["merge part1 part2 part1 --out merged"];
    all_refused(
        &folder,
        &twice,
        "part1: city:n=300 along orbit:frames=4 is in part1 as well",
    );
    all_refused(
        &folder,
        &["merge part1 part2 --out part1"],
        "already holds a run",
    );
    all_refused(
        &folder,
        &["merge part1 nowhere --out merged"],
        "nowhere/stream.jsonl",
    );
    // An empty folder is as good as a new one; what a killed merge has left goes.
    fs::create_dir_all(folder.path().join("merged")).expect("made");
    let left = folder.path().join(".cullbench-left.tmp");
    fs::create_dir(&left).expect("made");
    fs::write(left.join("samples.csv"), "half").expect("writable");
    works(folder.path(), "merge part1 part2 --out merged");
    assert!(!left.exists());
    assert_eq!(cells(&report(&folder.path().join("merged"))).len(), 8);
}

#[test]
fn files_of_cameras_and_motions_are_the_same_in_all_shards() {
    let cameras = format!("{}\n-9,0.5,0.5,0,0.5,0.5\n", super::EYE_LOOK);
    let folder = folder(&[("cameras.csv", cameras.as_bytes())]);
    let plan = "run --scene city:n=300 --scene uniform:n=200 --path cameras.csv \
        --structure linear,bvh --processes 1 --no-bounds --shard";
    works(folder.path(), &format!("{plan} 1/2 --out part1"));
    works(folder.path(), &format!("{plan} 2/2 --out part2"));
    works(folder.path(), "merge part1 part2 --out whole");
    let other = cameras.replace("-9", "-8");
    fs::write(folder.path().join("cameras.csv"), other).expect("writable");
    works(folder.path(), &format!("{plan} 2/2 --out other"));
    let wanted = "other: plan differs: files 'cameras.csv | and 'cameras.csv | in part1";
    all_refused(&folder, &["merge part1 other --out merged"], wanted);
}

#[cfg(unix)]
#[test]
fn a_task_of_an_array_has_its_options_also_when_it_goes_on() {
    let folder = folder(&[]);
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/scripts/slurm-array.sh");
    let asked = || {
        let mut task = Command::new("sh");
        task.args([script, "r", "--timeout", "9"]);
        task.env("CULLBENCH", "echo")
            .env("SLURM_ARRAY_TASK_ID", "3");
        task.env("SLURM_ARRAY_TASK_COUNT", "8");
        let done = task.current_dir(folder.path()).output().expect("a shell");
        String::from_utf8(done.stdout).expect("UTF-8")
    };
    assert_eq!(asked(), "run --timeout 9 --shard 3/8 --out r/shard-3\n");
    let begun = folder.path().join("r/shard-3");
    fs::create_dir_all(&begun).expect("made");
    fs::write(begun.join("stream.jsonl"), "").expect("writable");
    assert_eq!(asked(), "run --timeout 9 --resume --out r/shard-3\n");
}
