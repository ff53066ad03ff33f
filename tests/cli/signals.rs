//! Ctrl-C, sent by the system's own `kill`: a run keeps what it has finished,
//! everything else ends at once and leaves nothing.

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::Value;

use super::process::*;
use super::runs::{cells, report};
use super::{BOXES, PROGRAM};

fn start(folder: &Path, line: &str) -> Child {
    let mut command = command(folder, line);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().expect("the program starts")
}

fn wait_until(what: &str, mut ready: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !ready() {
        assert!(begin.elapsed() < Duration::from_secs(30), "{what}");
        sleep(Duration::from_millis(2));
    }
}

/// Sends Ctrl-C and waits for the end. The output is not read until then.
fn interrupt(child: Child) -> Done {
    signal(child, "-INT")
}

fn signal(mut child: Child, signal: &str) -> Done {
    let ended = child.try_wait().expect("a child");
    assert!(ended.is_none(), "ended by itself: {ended:?}");
    let id = child.id().to_string();
    let sent = Command::new("kill").args([signal, &id]).status();
    assert!(sent.expect("kill").success());
    let begin = Instant::now();
    while child.try_wait().expect("a child").is_none() {
        if begin.elapsed() > Duration::from_secs(20) {
            let _ = child.kill();
            panic!("Ctrl-C does not end the program");
        }
        sleep(Duration::from_millis(2));
    }
    let output = child.wait_with_output().expect("a child");
    Done {
        code: output.status.code(),
        out: String::from_utf8(output.stdout).expect("UTF-8"),
        err: String::from_utf8(output.stderr).expect("UTF-8"),
    }
}

/// The answer to the first signal, where something is to be kept.
const STOPPING: &str = "stopping at the next safe place; again ends at once\n";
const NOTHING: &str = "interrupted: nothing was saved; anything printed is incomplete\n";

fn assert_stopped(done: &Done, what: &str) {
    assert_eq!(done.code, Some(130), "{what}");
    let told = besides_work(&done.err);
    assert_eq!(told.trim_start_matches(STOPPING), NOTHING, "{what}");
}

#[test]
fn an_interrupted_run_keeps_its_finished_cells_and_goes_on() {
    let folder = folder(&[]);
    let run = folder.path().join("r");
    let paths = ["orbit", "spin", "outside", "zoom"].map(|p| format!(" --path {p}:frames=8"));
    let line = format!(
        "run --scene uniform:n=2000 --structure linear,bvh --processes 2 --out r{}",
        paths.concat()
    );
    let read = |file: &str| fs::read(run.join(file)).unwrap_or_default();
    let lines = || read("stream.jsonl").iter().filter(|b| **b == b'\n').count();
    let child = start(folder.path(), &line);
    // The first line is the header.
    wait_until("no first part", || lines() >= 2);
    let done = interrupt(child);
    let again = "continue with cullbench run --resume --out r";
    let told = format!(
        "{STOPPING}interrupted: finished cells were saved; {again}
"
    );
    assert_eq!((done.code, &done.err), (Some(130), &told), "{line}");
    assert!(
        done.out.contains("1 of 2 processes: times without"),
        "{}",
        done.out
    );

    let stopped = report(&run);
    let all = paths.len() * 2;
    let kept = cells(&stopped).len();
    assert!(kept > 0 && kept <= all && lines() < 1 + 2 * paths.len());
    assert_eq!(stopped["run"]["finished_at"], Value::Null);
    let (samples, stream) = (read("samples.csv"), read("stream.jsonl"));
    let refused = cullbench(folder.path(), &line);
    assert_refused(&refused, "already holds a run | --resume", "run again");
    // A stop may fall between samples and the line that refers to them.
    let rubbish =
        b"uniform:n=2000,spin:frames=8,warm,bvh,six-plane,query,0,0,0,1,1.0,1.0,0\nhalf a r";
    fs::write(run.join("samples.csv"), [&samples[..], rubbish].concat()).expect("writable");

    works(folder.path(), "run --resume --out r");
    let finished = report(&run);
    assert_eq!(cells(&finished).len(), all);
    assert_eq!(finished["run"]["id"], stopped["run"]["id"]);
    assert!(finished["run"]["finished_at"].is_string());
    // Not a digit of the finished parts has changed.
    assert!(read("samples.csv").starts_with(&samples));
    assert!(read("stream.jsonl").starts_with(&stream));
    let rows = rows(&String::from_utf8(read("samples.csv")).expect("UTF-8"));
    assert!(
        rows.iter()
            .all(|row| row["returned"].parse::<u64>().is_ok())
    );
}

/// A limit on the size of files stands for a full disk.
#[cfg(target_os = "linux")]
#[test]
fn a_run_that_cannot_be_written_says_how_it_goes_on() {
    let folder = folder(&[]);
    let line = "run --scene city:n=50 --path orbit:frames=2 --structure linear,bvh --no-bounds \
        --processes 200 --out r";
    let script = format!("trap '' XFSZ; ulimit -f 100; exec {PROGRAM} {line}");
    let shell = Command::new("sh")
        .args(["-c", &script])
        .current_dir(folder.path())
        .output();
    let err = String::from_utf8(shell.expect("a shell").stderr).expect("UTF-8");
    let note = "note: finished cells were saved; continue with cullbench run --resume --out r\n";
    let told = err
        .split_once(note)
        .map(|(_, rest)| rest.starts_with("error: r/"));
    assert_eq!(told, Some(true), "{err}");
}

#[test]
fn ctrl_c_ends_commands_that_keep_nothing() {
    let folder = folder(&[("kept.csv", b"kept")]);
    let before = contents(folder.path());
    let commands = [
        "query --scene uniform:n=2000000 --cameras orbit:frames=1000",
        "query --scene uniform:n=20000 --cameras orbit:frames=1000 --structure linear --ids",
        "scene generate uniform:n=2000000",
        "scene generate uniform:n=2000000 --out kept.csv",
        "advise --scene uniform:n=3000 --processes 1000",
        "precision --scene uniform:n=300 --cubes 0 --processes 1000",
        // Before anything is timed it is judged, which takes minutes.
        "precision --scene uniform:n=100000 --structure bvh",
        "precision --scene uniform:n=300 --structure linear --processes 1",
    ];
    for line in commands {
        let child = start(folder.path(), line);
        sleep(Duration::from_millis(300));
        let begin = Instant::now();
        assert_stopped(&interrupt(child), line);
        assert!(begin.elapsed() < Duration::from_secs(2), "{line}");
        assert!(contents(folder.path()) == before, "{line}");
    }
}

/// Whose workers are found where Linux lists them.
#[cfg(target_os = "linux")]
#[test]
fn a_worker_that_is_killed_is_told_in_one_line() {
    for line in [
        "advise --scene uniform:n=3000 --processes 1000",
        "precision --scene uniform:n=300 --cubes 0 --processes 1000",
    ] {
        let mut child = start(Path::new("."), line);
        let listed = format!("/proc/{0}/task/{0}/children", child.id());
        wait_until("no worker could be killed", || {
            let workers = fs::read_to_string(&listed).unwrap_or_default();
            // In a group of its own, as Ctrl-C of a terminal is the parent's to answer.
            let is_apart = |worker: &&str| {
                let about = fs::read_to_string(format!("/proc/{worker}/stat")).unwrap_or_default();
                let group = about
                    .rsplit(')')
                    .next()
                    .and_then(|rest| rest.split(' ').nth(3));
                group == Some(worker)
            };
            if let Some(worker) = workers.split_whitespace().find(is_apart) {
                let killed = Command::new("kill").args(["-KILL", worker]).status();
                assert!(killed.is_ok(), "{line}");
            }
            child.try_wait().expect("a child").is_some()
        });
        let output = child.wait_with_output().expect("a child");
        let err = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(output.status.code(), Some(2), "{line}: {err}");
        let err = besides_work(&err);
        assert_eq!(err.lines().count(), 1, "{line}: {err}");
        let told = "expected one that finishes";
        assert!(
            err.starts_with("error: process ") && err.contains(told),
            "{line}: {err}"
        );
    }
}

#[test]
fn a_signal_while_a_file_is_written_leaves_the_old_one() {
    let folder = folder(&[("kept.csv", b"kept")]);
    let before = contents(folder.path());
    let line = "scene generate uniform:n=500000 --out kept.csv";
    let files = || fs::read_dir(folder.path()).expect("readable").count();
    let begun = || {
        let child = start(folder.path(), line);
        // A place is tried before the work: the file that stays has something in it.
        wait_until("no temporary file", || {
            let entries = fs::read_dir(folder.path()).expect("readable").flatten();
            let lengths = entries.filter_map(|e| Some(e.metadata().ok()?.len()));
            lengths.max() > Some(4096)
        });
        child
    };
    for kind in ["-INT", "-TERM", "-HUP"] {
        let done = signal(begun(), kind);
        assert_stopped(&done, kind);
        assert!(contents(folder.path()) == before, "{kind}");
    }
    // A killed process cannot: the next one that writes there does.
    assert_eq!(signal(begun(), "-KILL").code, None);
    assert_eq!(files(), 2);
    cullbench(folder.path(), "scene generate uniform:n=5 --out other.csv");
    let left = contents(folder.path());
    let names: Vec<_> = left.keys().map(|name| name.rsplit('/').next()).collect();
    assert_eq!(names, [Some("kept.csv"), Some("other.csv")]);
}

#[cfg(target_os = "linux")]
#[test]
fn what_is_to_outlive_its_terminal_does() {
    let mut child = Command::new("nohup")
        .args([super::PROGRAM, "verify", "--cases", "100000000"])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("nohup");
    sleep(Duration::from_millis(300));
    let id = child.id().to_string();
    let sent = Command::new("kill").args(["-HUP", &id]).status();
    assert!(sent.expect("kill").success());
    sleep(Duration::from_millis(300));
    assert!(child.try_wait().expect("a child").is_none());
    child.kill().expect("killed");
    child.wait().expect("a child");
}

#[test]
fn a_stopped_check_does_not_claim_success() {
    for line in ["verify", "stress"] {
        let child = start(Path::new("."), &format!("{line} --cases 100000"));
        sleep(Duration::from_millis(300));
        let done = interrupt(child);
        assert_eq!(done.code, Some(130), "{line}");
        assert!(done.err.contains("interrupted"), "{line}: {}", done.err);
        let is_told = unwrapped(&done.out).contains("; interrupted: others were left out");
        assert!(is_told || line == "verify", "{}", done.out);
    }
}

/// Processes that read different scenes measure nothing.
#[test]
fn a_scene_that_changes_during_a_run_is_named() {
    let folder = with_good_files(&[]);
    let line = "run --scene scene.csv --path orbit:frames=4 --structure linear --processes 300 \
        --no-bounds --out r";
    let mut child = start(folder.path(), line);
    let stream = folder.path().join("r/stream.jsonl");
    wait_until("no part was kept", || {
        fs::read_to_string(&stream).is_ok_and(|text| text.lines().count() > 2)
    });
    fs::write(
        folder.path().join("scene.csv"),
        format!("{BOXES}\n9,9,9,9,9,9\n"),
    )
    .expect("written");
    wait_until("the run continues", || {
        child.try_wait().expect("a child").is_some()
    });
    let output = child.wait_with_output().expect("a child");
    let err = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(2), "{err}");
    assert!(
        err.starts_with("error: scene.csv: has changed since"),
        "{err}"
    );
}
