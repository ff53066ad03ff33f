//! `run --resume` continues a run that was killed at any moment, and loses nothing.
//!
//! If something about the run has changed since, the error names the change.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::{Child, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::Value;

use super::process::*;
use super::runs::{cells, report};
use super::shards::edit_header;

const PLAN: &str = "run --scene city:n=300 --path orbit:frames=4 --path spin:frames=4 \
    --structure linear,bvh --processes 3 --no-bounds --out r";
/// Parts of that plan: two groups, three processes.
const PARTS: usize = 6;

fn start(folder: &Path, line: &str) -> Child {
    let mut command = command(folder, line);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().expect("the program starts")
}

/// Whole lines of a stream, but for the first.
fn lines(run: &Path) -> Vec<String> {
    let text = fs::read_to_string(run.join("stream.jsonl")).unwrap_or_default();
    let whole = text.rfind('\n').map_or("", |end| &text[..end]);
    whole.lines().skip(1).map(str::to_owned).collect()
}

/// The whole plan, each part once, and nothing else in the folder.
fn assert_complete(run: &Path) {
    let parts: Vec<Value> = lines(run).iter().map(|line| json(line)).collect();
    let parts: Vec<&Value> = parts.iter().filter(|line| line["line"] == "part").collect();
    let named = |part: &&Value| format!("{} {}", part["part"]["key"], part["part"]["process"]);
    let distinct: BTreeSet<String> = parts.iter().map(named).collect();
    assert_eq!((parts.len(), distinct.len()), (PARTS, PARTS));
    let report = report(run);
    assert!(report["run"]["finished_at"].is_string());
    assert_eq!(cells(&report).len(), 4);
    let samples = rows(&fs::read_to_string(run.join("samples.csv")).expect("samples"));
    let recorded = parts
        .iter()
        .flat_map(|part| part["rows"].as_object().expect("rows").values());
    let recorded: u64 = recorded.map(|rows| rows.as_u64().expect("a number")).sum();
    assert_eq!(samples.len() as u64, recorded);
    let names: BTreeSet<String> = fs::read_dir(run)
        .expect("readable")
        .map(|entry| entry.expect("readable").file_name().display().to_string())
        .collect();
    let names = names.iter().map(String::as_str);
    let names: BTreeSet<&str> = names.filter(|name| !name.ends_with(".svg")).collect();
    assert_eq!(
        names,
        set("report.html report.json samples.csv stream.jsonl summary.csv")
    );
}

#[test]
fn killed_at_any_moment_a_run_goes_on_and_loses_nothing() {
    let mut random = Random(0x51AB_2E07);
    let (mut kills, mut runs) = (0, 0);
    while kills < 30 {
        let folder = folder(&[]);
        let run = folder.path().join("r");
        let mut line = PLAN;
        // Longer and longer: a busy machine gets there as well.
        for longest in (300..).step_by(60) {
            let before = lines(&run);
            let mut child = start(folder.path(), line);
            let wait = Duration::from_millis(random.between(1, longest) as u64);
            let begin = Instant::now();
            while begin.elapsed() < wait && child.try_wait().expect("a child").is_none() {
                sleep(Duration::from_millis(1));
            }
            let ended = child.try_wait().expect("a child");
            child.kill().expect("kill");
            child.wait().expect("a child");
            let after = lines(&run);
            assert_eq!(after[..before.len()], before[..], "a finished part is gone");
            if let Some(status) = ended {
                assert_eq!(status.code(), Some(0), "{line}");
                break;
            }
            kills += 1;
            // As long as there is no stream no run was begun there.
            line = match run.join("stream.jsonl").exists() {
                true => "run --resume --out r",
                false => PLAN,
            };
        }
        runs += 1;
        assert_complete(&run);
    }
    assert!(runs > 0 && kills >= 30);
}

/// Ids of the workers that are children of no living run.
#[cfg(target_os = "linux")]
fn is_alive(id: &str) -> bool {
    let stat = fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
    let state = stat.rsplit(')').next().unwrap_or_default();
    !state.is_empty() && !state.trim_start().starts_with('Z')
}

#[cfg(target_os = "linux")]
#[test]
fn a_worker_ends_with_its_parent_also_in_the_middle_of_a_build() {
    let folder = folder(&[]);
    let line = "run --scene uniform:n=2000000 --path orbit:frames=1 --structure bvh --out r \
        --processes 1";
    let mut child = start(folder.path(), line);
    let children = format!("/proc/{0}/task/{0}/children", child.id());
    let begin = Instant::now();
    let worker = loop {
        let found = fs::read_to_string(&children).unwrap_or_default();
        if let Some(id) = found.split_whitespace().next() {
            break id.to_owned();
        }
        assert!(begin.elapsed() < Duration::from_secs(60), "no worker");
        sleep(Duration::from_millis(2));
    };
    // It makes its scene and builds for seconds.
    sleep(Duration::from_millis(300));
    assert!(is_alive(&worker));
    child.kill().expect("kill");
    child.wait().expect("a child");
    let begin = Instant::now();
    while is_alive(&worker) {
        assert!(begin.elapsed() < Duration::from_secs(2), "an orphan");
        sleep(Duration::from_millis(2));
    }
}

#[test]
fn a_live_run_is_not_resumed() {
    let folder = folder(&[]);
    let long = PLAN.replace("--processes 3", "--processes 500");
    let mut child = start(folder.path(), &long);
    let run = folder.path().join("r");
    let begin = Instant::now();
    while lines(&run).is_empty() {
        assert!(begin.elapsed() < Duration::from_secs(30), "no first part");
        sleep(Duration::from_millis(2));
    }
    let refused = cullbench(folder.path(), "run --resume --out r");
    assert_refused(
        &refused,
        "r: another run is writing here | expected",
        "a live run",
    );
    assert!(
        child.try_wait().expect("a child").is_none(),
        "ended by itself"
    );
    child.kill().expect("kill");
    child.wait().expect("a child");
}

/// A run that lacks its last line, as if it had been stopped.
fn stopped() -> tempfile::TempDir {
    let folder = folder(&[]);
    works(folder.path(), PLAN);
    cut(&folder.path().join("r"), 2);
    folder
}

/// Takes lines off the end of a stream.
fn cut(run: &Path, count: usize) {
    let text = fs::read_to_string(run.join("stream.jsonl")).expect("a stream");
    let kept = text.lines().count() - count;
    let kept: Vec<&str> = text.lines().take(kept).collect();
    fs::write(run.join("stream.jsonl"), kept.join("\n") + "\n").expect("writable");
}

#[test]
fn only_the_recorded_run_goes_on() {
    let folder = stopped();
    for (typed, wanted) in [
        ("--seed 2", "--seed is '2' | with '1'"),
        ("--processes 4", "--processes is '4' | with '3'"),
        (
            "--structure wide",
            "--structure is 'wide' | with 'linear,bvh'",
        ),
        ("--threads 2", "--threads is '2'"),
        ("--kernel portable", "--kernel is 'portable' | without it"),
        ("--suite quick", "--suite is 'quick' | without it"),
        ("--scene city:n=9", "--scene is 'city:n=9'"),
        ("--cold", "--cold"),
        ("--shard 1/2", "--shard is '1/2' | without it"),
        ("--test sphere", "--test is 'sphere'"),
    ] {
        let line = format!("run --resume --out r {typed}");
        all_refused(&folder, &[line], wanted);
    }
    let run = folder.path().join("r");
    let kept = fs::read(run.join("stream.jsonl")).expect("a stream");
    for (place, value, wanted) in [
        ("/binary", Value::from("00"), "digest '00'"),
        ("/source/dirty", Value::Null, "dirty 'unknown'"),
        ("/source/commit", "abc".into(), "commit 'abc'"),
        ("/machine/cpu", "Another".into(), "cpu 'Another'"),
        ("/machine/cores", 99.into(), "cores '99'"),
        (
            "/machine/caches",
            serde_json::json!([{"level": 3, "bytes": 3 << 20}]),
            "caches 'L3 3072 KiB'",
        ),
        (
            "/machine/memory_bytes",
            (5u64 << 40).into(),
            "memory '5120 GiB'",
        ),
        ("/machine/kernel", "2.4".into(), "os kernel '2.4'"),
        (
            "/machine/instruction_set",
            "mmx".into(),
            "instruction set 'mmx'",
        ),
        ("/toolchain/features", Value::Array(vec![]), "features ''"),
        ("/structures/0", "wide".into(), "another plan"),
        ("/schema_version", 1.into(), "schema version 1"),
    ] {
        edit_header(&run, |header| {
            *header.pointer_mut(place).expect(place) = value
        });
        all_refused(&folder, &["run --resume --out r"], wanted);
        fs::write(run.join("stream.jsonl"), &kept).expect("writable");
    }
    // From another folder the suite is not there, and has not changed.
    let suite = "[[scenes]]\nscene = \"city:n=50\"\npaths = [\"orbit:frames=2\"]\n";
    fs::write(folder.path().join("s.toml"), suite).expect("writable");
    works(
        folder.path(),
        "run --suite s.toml --structure linear --processes 2 --out s",
    );
    cut(&folder.path().join("s"), 1);
    let elsewhere = folder.path().join("r");
    let missing = cullbench(&elsewhere, "run --resume --out ../s");
    assert_refused(&missing, "s.toml: No such file | expected", "elsewhere");
    all_refused(
        &folder,
        &["run --resume --out nothing"],
        "nothing/stream.jsonl",
    );
    works(folder.path(), "run --resume --out r");
    assert_complete(&run);
}

#[test]
fn half_a_line_and_lost_samples_are_measured_again() {
    let folder = stopped();
    let run = folder.path().join("r");
    let (stream, samples) = (run.join("stream.jsonl"), run.join("samples.csv"));
    let text = fs::read(&stream).expect("a stream");
    fs::write(&stream, &text[..text.len() - 100]).expect("writable");
    works(folder.path(), "run --resume --out r");
    assert_complete(&run);

    let kept = lines(&run);
    let whole = fs::read(&samples).expect("samples");
    fs::write(&samples, &whole[..whole.len() / 2]).expect("writable");
    let done = cullbench(folder.path(), "run --resume --out r");
    assert_eq!(done.code, Some(0), "{done:?}");
    let told = |done: &Done| {
        assert!(
            done.err.starts_with("note: r: samples.csv lacks samples; ")
                && done.err.ends_with(" measured again\n"),
            "{}",
            done.err
        );
    };
    told(&done);
    assert_complete(&run);
    // After a power cut: as long as it was, and nothing in it.
    let mut whole = fs::read(&samples).expect("samples");
    let half = whole.len() / 2;
    whole[half..].fill(0);
    fs::write(&samples, &whole).expect("writable");
    told(&cullbench(folder.path(), "run --resume --out r"));
    assert_complete(&run);
    assert!(!fs::read(&samples).expect("samples").contains(&0));
    // What has its samples has not been touched.
    assert_eq!(lines(&run)[..2], kept[..2]);
    // Of the right length, and not what was written.
    let mut other = fs::read(&samples).expect("samples");
    other[..5].copy_from_slice(b"SCENE");
    fs::write(&samples, &other).expect("writable");
    told(&cullbench(folder.path(), "run --resume --out r"));
    assert_complete(&run);
    fs::remove_file(&samples).expect("removed");
    assert!(
        cullbench(folder.path(), "run --resume --out r")
            .err
            .contains("6 parts")
    );
    assert_complete(&run);
}

#[test]
fn recorded_options_hold_unless_others_are_typed() {
    let folder = folder(&[]);
    let plan = PLAN.replace(" --no-bounds", "");
    works(folder.path(), &format!("{plan} --all-columns --why bvh"));
    let resumed = |typed: &str| {
        cut(&folder.path().join("r"), 2);
        works(folder.path(), &format!("run --resume --out r {typed}"))
    };
    let all = resumed("");
    assert!(
        all.contains("bound-read") && all.contains("bvh takes "),
        "{all}"
    );
    let linear = resumed("--why linear --timeout 500");
    assert!(
        linear.contains("bound-read") && linear.contains("linear takes "),
        "{linear}"
    );
}

/// Among folders of any name, and a file.
#[test]
fn the_newest_unfinished_run_goes_on_whatever_its_folder_is_named() {
    let folder = folder(&[]);
    fs::create_dir(folder.path().join("results")).expect("made");
    fs::write(folder.path().join("results/9zzz"), "a file").expect("writable");
    let plan = PLAN.replace("--out r", "--out");
    for (name, started) in [
        ("9-older", "2020-01-01T00:00:00Z"),
        ("b", "2021-01-01T00:00:00Z"),
    ] {
        let run = folder.path().join("results").join(name);
        works(folder.path(), &format!("{plan} results/{name}"));
        edit_header(&run, |header| header["run"]["started_at"] = started.into());
        cut(&run, 2);
        fs::remove_file(run.join("report.json")).expect("removed");
    }
    works(folder.path(), "run --resume");
    assert_complete(&folder.path().join("results/b"));
    assert!(!folder.path().join("results/9-older/report.json").exists());
}

#[cfg(unix)]
#[test]
fn a_run_writes_through_no_link() {
    use std::os::unix::fs::symlink;

    let folder = stopped();
    let (run, other) = (folder.path().join("r"), folder.path().join("other"));
    let linked = |name: &str| {
        fs::rename(run.join(name), &other).expect("moved");
        symlink(&other, run.join(name)).expect("linked");
        fs::read(&other).expect("there")
    };
    for name in ["samples.csv", "stream.jsonl"] {
        let before = linked(name);
        let done = cullbench(folder.path(), "run --resume --out r");
        let wanted = format!("r/{name}: a link or a device; expected a file");
        assert_refused(&done, &wanted, name);
        assert_eq!(fs::read(&other).expect("there"), before, "{name}");
        fs::rename(&other, run.join(name)).expect("moved");
    }
    // The new file replaces the link.
    let before = linked("report.json");
    works(folder.path(), "run --resume --out r");
    assert_eq!(fs::read(&other).expect("there"), before);
    assert_complete(&run);
    // A link that leads nowhere is no free place.
    fs::create_dir(folder.path().join("new")).expect("made");
    symlink("nowhere", folder.path().join("new/samples.csv")).expect("linked");
    let line = PLAN.replace("--out r", "--out new");
    let wanted = "new already holds a run";
    assert_refused(&cullbench(folder.path(), &line), wanted, "a loose link");
}

#[test]
fn a_file_that_has_changed_since_is_refused_and_its_name_may_have_two_lines() {
    let boxes = format!("{}\n0,0,0,1,1,1\n5,0,0,6,1,1\n", super::BOXES);
    let cameras = format!("{}\n-9,0.5,0.5,0,0.5,0.5\n", super::EYE_LOOK);
    let name = "two\nlines.csv";
    let folder = folder(&[
        (name, boxes.as_bytes()),
        ("cameras.csv", cameras.as_bytes()),
    ]);
    let run = |more: &[&str]| {
        let mut command = command(folder.path(), "run --out r");
        let output = command.args(more).output().expect("the program starts");
        Done {
            code: output.status.code(),
            out: String::from_utf8(output.stdout).expect("UTF-8"),
            err: String::from_utf8(output.stderr).expect("UTF-8"),
        }
    };
    let what = [
        "--scene",
        name,
        "--path",
        "cameras.csv",
        "--structure",
        "linear",
    ];
    let done = run(&[&what[..], &["--processes", "2", "--no-bounds"]].concat());
    assert_eq!((done.code, done.err.as_str()), (Some(0), ""));
    cut(&folder.path().join("r"), 2);
    for (file, text, wanted) in [
        (
            name,
            boxes.replace('5', "4"),
            "scene 'two lines.csv' has changed",
        ),
        (
            "cameras.csv",
            cameras.replace("-9", "-8"),
            "path 'cameras.csv' has changed",
        ),
    ] {
        let kept = fs::read(folder.path().join(file)).expect("readable");
        fs::write(folder.path().join(file), text).expect("writable");
        let before = contents(folder.path());
        assert_refused(&run(&["--resume"]), &format!("{wanted} | digest was"), file);
        assert!(contents(folder.path()) == before, "{file}");
        fs::write(folder.path().join(file), kept).expect("writable");
    }
    let done = run(&["--resume"]);
    assert_eq!((done.code, done.err.as_str()), (Some(0), ""));
    let report = report(&folder.path().join("r"));
    assert_eq!(cells(&report)[0]["scene"]["name"], name);
    let samples = fs::read_to_string(folder.path().join("r/samples.csv")).expect("samples");
    assert!(rows(&samples).iter().all(|row| row["scene"] == name));
}
