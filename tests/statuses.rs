//! Every status of a report, by structures with faults.
//!
//! Structures that allocate without end, hang, abort or panic fail their own rows and no
//! others. This file is both the program and its test (`harness = false`): with [`CHILD`]
//! set it is `cullbench` with those structures, else it starts itself.

use std::env;
use std::fs::OpenOptions;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::Path;
use std::process::{Command, ExitCode, Output, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use cullbench::geometry::Aabb;
use cullbench::index::{BuildError, Info, Input, Kind, MemoryUsage, Origin, RegionIndex, Registry};
use cullbench::query::{Context, ItemId, QueryVolume, Recorder};
use serde_json::{Value, json};

/// Set for the processes that are the program.
const CHILD: &str = "CULLBENCH_TEST_STATUSES_CHILD";

/// Fault of a structure at its build or its queries.
trait Mishap: Send + Sync + 'static {
    const NAME: &'static str;
    /// True for a refit that does nothing.
    const KEEPS_BOXES: bool = false;
    /// True for an answer with one more id, of no item.
    const NAMES_ONE_MORE: bool = false;
    fn at_build() {}
    fn at_query() {}
    fn at_chose() {}
}

/// A scan with a mishap.
struct Broken<M> {
    boxes: Vec<Aabb>,
    mishap: std::marker::PhantomData<M>,
}

impl<M: Mishap> RegionIndex for Broken<M> {
    const INFO: Info = Info::new(
        M::NAME,
        "a scan with a mishap",
        Kind::Grid,
        Origin::Crate("test"),
    )
    .refits();
    type Params = ();

    fn build(input: &Input<'_>, (): &()) -> Result<Self, BuildError> {
        let items = input.items;
        // Parameters are tried on no items.
        if !items.is_empty() {
            M::at_build();
        }
        Ok(Broken {
            boxes: items.to_vec(),
            mishap: std::marker::PhantomData,
        })
    }
    fn refit(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        for &id in moved.iter().filter(|_| !M::KEEPS_BOXES) {
            self.boxes[id as usize] = items[id as usize];
        }
        true
    }
    fn chose(&self) -> Option<String> {
        M::at_chose();
        None
    }
    fn memory(&self) -> MemoryUsage {
        MemoryUsage {
            node_bytes: 0,
            item_bytes: size_of_val(&self.boxes[..]),
        }
    }
    fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, cx: &mut C) -> ControlFlow<()> {
        if !Q::IS_POINT {
            M::at_query();
        }
        cx.recorder().items_tested(self.boxes.len() as u32);
        for (id, item) in (0..).zip(&self.boxes) {
            if !item.is_empty() && volume.admits(item, volume.mask(), cx.recorder()) {
                cx.accept(&[id as ItemId])?;
            }
        }
        if M::NAMES_ONE_MORE {
            cx.accept(&[self.boxes.len() as ItemId])?;
        }
        ControlFlow::Continue(())
    }
}

fn for_ever() {
    loop {
        std::thread::sleep(Duration::from_millis(50));
    }
}

static ASKED: AtomicUsize = AtomicUsize::new(0);

/// A line in a file for every build that was tried.
fn note_try() {
    let tried = OpenOptions::new().create(true).append(true).open("tried");
    writeln!(tried.expect("writable"), "{}", std::process::id()).expect("written");
}

macro_rules! mishaps {
    ($($kind:ident $name:literal $step:ident $what:expr;)*) => {
        $(struct $kind;
        impl Mishap for $kind {
            const NAME: &'static str = $name;
            fn $step() {
                $what
            }
        })*
        fn registry() -> Registry {
            Registry::builtin()$(.with::<Broken<$kind>>())*
        }
    };
}

mishaps! {
    // Of memory there is not that much anywhere.
    Greedy "greedy" at_build drop(std::hint::black_box(Vec::<u8>::with_capacity(1 << 46)));
    // As much as a limit forbids and a machine has.
    Hungry "hungry" at_build drop(std::hint::black_box(vec![1_u8; 3 << 30]));
    HangsBuilding "hangs-building" at_build {
        note_try();
        for_ever();
    };
    HangsAsked "hangs-asked" at_query for_ever();
    // Not before it is timed: to count and to compare takes 16.
    HangsTimed "hangs-timed" at_query if ASKED.fetch_add(1, Ordering::Relaxed) > 24 {
        for_ever();
    };
    Aborts "aborts" at_query std::process::abort();
    Panics "panics" at_query panic!("no such luck\nin two lines");
    Prints "prints" at_query println!("hello there");
    PanicsChose "panics-chose" at_chose panic!("no choice");
    // As a Ctrl-C that falls into a build.
    Interrupts "interrupts" at_build {
        let id = std::process::id().to_string();
        let _ = Command::new("kill").args(["-INT", &id]).status();
        std::thread::sleep(Duration::from_millis(200));
    };
}

struct Stale;
impl Mishap for Stale {
    const NAME: &'static str = "stale";
    const KEEPS_BOXES: bool = true;
}

struct Beyond;
impl Mishap for Beyond {
    const NAME: &'static str = "beyond";
    const NAMES_ONE_MORE: bool = true;
}

const RUN: &str = "run --scene city:n=300 --path orbit:frames=4 --path spin:frames=4 \
    --processes 2 --no-bounds --timeout 60 --structure linear,bvh,";

fn program(folder: &Path) -> Command {
    let mut command = Command::new(env::current_exe().expect("this test"));
    command.env(CHILD, "1").current_dir(folder);
    // Writing one takes seconds.
    command.env_remove("RUST_BACKTRACE");
    command
}

fn cells(folder: &Path, run: &str) -> Vec<Value> {
    let file = folder.join(run).join("report.json");
    let text = std::fs::read_to_string(file).expect("a report");
    let report: Value = serde_json::from_str(&text).expect("JSON");
    report["cells"].as_array().expect("cells").clone()
}

/// The rows of `structure` have that status with that reason, all others are ok.
fn assert_alone(cells: &[Value], structure: &str, status: &str, reason: &str) {
    assert_eq!(cells.len(), 6, "{structure}");
    for cell in cells {
        let told = cell["reason"].as_str().unwrap_or_default();
        match cell["structure"] == structure {
            true => {
                assert_eq!(cell["status"], status, "{cell}");
                assert!(told.contains(reason), "{structure}: {told}");
                assert!(!told.starts_with("panicked"), "{structure}: {told}");
            }
            false => {
                assert_eq!(cell["status"], "ok", "{structure}: {cell}");
                assert_eq!(cell["times"]["processes"], 2, "{structure}: {cell}");
            }
        }
    }
}

fn each_mishap_fails_its_own_rows() {
    for (structure, status, reason, code) in [
        (
            "greedy",
            "out_of_memory",
            "building: memory allocation of 70368744177664 bytes",
            0,
        ),
        (
            "hangs-building",
            "timed_out",
            "building took longer than 2 s",
            0,
        ),
        ("hangs-asked", "timed_out", "took longer than 2 s", 0),
        ("hangs-timed", "timed_out", "timing took longer than 2 s", 0),
        ("aborts", "panicked", "ended by signal 6 while", 1),
        ("panics", "panicked", "no such luck in two lines", 1),
        ("panics-chose", "panicked", "no choice", 1),
        ("beyond", "wrong", "1 repeated or unknown", 1),
        ("stale", "unsafe", "a search after updates: ", 1),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let mut line = format!("{RUN}{structure} --out r");
        if status == "timed_out" {
            line = line.replace("--timeout 60", "--timeout 2");
        }
        let done = program(folder.path())
            .args(line.split_whitespace())
            .output();
        let done = done.expect("started");
        let error = String::from_utf8_lossy(&done.stderr);
        assert_eq!(
            (done.status.code(), &*error),
            (Some(code), ""),
            "{structure}"
        );
        assert_alone(&cells(folder.path(), "r"), structure, status, reason);
    }
}

/// A panic is a wrong answer in every command; printed text is no message.
fn structures_that_panic_or_print_are_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = "--scene city:n=20 --structure";
    for (line, code, wanted) in [
        (
            format!("query {scene} panics --cameras orbit:frames=1"),
            1,
            "error: structure 'panics': panicked: no such luck in two lines; expected an answer\n",
        ),
        (
            format!("run {scene} prints --path orbit:frames=1 --processes 1 --out r"),
            2,
            "prints printed 'hello there'; expected messages of protocol",
        ),
    ] {
        let mut command = program(folder.path());
        let done = command.args(line.split_whitespace()).output();
        let done = done.expect("started");
        let error = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), Some(code), "{line}: {error}");
        assert!(error.contains(wanted), "{line}: {error}");
    }
}

/// A limit of the shell stands for a machine with less memory.
#[cfg(unix)]
fn a_limit_is_a_lack_of_memory() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut command = Command::new("sh");
    command
        .args(["-c", "ulimit -v 2000000; exec \"$0\" \"$@\""])
        .arg(env::current_exe().expect("this test"));
    let line = format!("{RUN}hungry --out r");
    let done = command
        .args(line.split_whitespace())
        .env(CHILD, "1")
        .env_remove("RUST_BACKTRACE")
        .current_dir(folder.path())
        .output()
        .expect("started");
    let error = String::from_utf8_lossy(&done.stderr);
    assert_eq!((done.status.code(), &*error), (Some(0), ""));
    let cells = cells(folder.path(), "r");
    assert_alone(
        &cells,
        "hungry",
        "out_of_memory",
        "memory allocation of 3221225472 bytes",
    );
}

/// Ctrl-C, as `kill` sends it.
#[cfg(unix)]
fn ctrl_c_is_answered_at_once_in_the_middle_of_a_build() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut line = RUN.replace("--timeout 60", "--timeout 600");
    line = line.replace("--scene", "--scene city:n=200 --scene");
    let line = format!("{line}hangs-building --out r");
    // The first scene is done without that structure; then it hangs.
    let started = |line: &str| {
        let mut command = program(folder.path());
        command.args(line.split_whitespace());
        let child = command
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn();
        child.expect("started")
    };
    let interrupted = |child: std::process::Child| -> (Output, Duration) {
        let id = child.id().to_string();
        let sent = Command::new("kill").args(["-INT", &id]).status();
        assert!(sent.expect("kill").success());
        let begin = Instant::now();
        let output = child.wait_with_output().expect("a child");
        (output, begin.elapsed())
    };
    let child = started(&line);
    std::thread::sleep(Duration::from_millis(1500));
    let (output, took) = interrupted(child);
    assert_eq!(output.status.code(), Some(130));
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(
        told,
        "stopping at the next safe place; again ends at once\n\
         interrupted: no cell was finished, and nothing was saved\n"
    );
    assert!(took < Duration::from_secs(1), "{took:?}");
    // Nothing was finished: nothing is left.
    assert!(!folder.path().join("r").exists());

    // With a finished scene: it is kept.
    let two = "run --scene city:n=300 --path orbit:frames=4 --processes 2 --no-bounds \
        --timeout 600 --structure linear,hangs-late --out r";
    let child = started(two);
    let stream = folder.path().join("r/stream.jsonl");
    let begin = Instant::now();
    let lines = || std::fs::read_to_string(&stream).map_or(0, |text| text.lines().count());
    while lines() < 2 {
        assert!(begin.elapsed() < Duration::from_secs(30), "no first part");
        std::thread::sleep(Duration::from_millis(5));
    }
    std::thread::sleep(Duration::from_millis(300));
    let (output, took) = interrupted(child);
    assert_eq!(output.status.code(), Some(130));
    assert!(took < Duration::from_secs(1), "{took:?}");
    assert_eq!(cells(folder.path(), "r").len(), 2);
    assert_eq!(lines(), 2);
}

/// A check is stopped only if something is left out.
fn ctrl_c_in_the_last_case_leaves_nothing_out() {
    for (cases, code) in [("1", 0), ("2", 130)] {
        let mut verify = program(Path::new("."));
        verify.args(["verify", "--structure", "linear,interrupts", "--seed", "1"]);
        let done = verify.args(["--cases", cases]).output().expect("started");
        assert_eq!(done.status.code(), Some(code), "{cases}: {done:?}");
    }
}

/// Hangs in every build but those of the first process.
struct HangsLate;
impl Mishap for HangsLate {
    const NAME: &'static str = "hangs-late";
    fn at_build() {
        let first = Path::new("first-process");
        let id = std::process::id().to_string();
        match std::fs::read_to_string(first) {
            Ok(other) if other != id => for_ever(),
            _ => std::fs::write(first, id).expect("writable"),
        }
    }
}

/// `--resume` skips the structure that ended a process: no second `--timeout`.
fn a_resumed_run_does_not_try_again_what_has_ended_a_process() {
    let folder = tempfile::tempdir().expect("a folder");
    let line = "run --scene city:n=300 --path orbit:frames=4 --processes 60 --no-bounds \
        --timeout 2 --structure linear,hangs-building --out r";
    let run = |more: &[&str]| {
        let mut command = program(folder.path());
        command.args(line.split_whitespace()).args(more);
        command.stdout(Stdio::null());
        command.spawn().expect("started")
    };
    let lines = |file: &str| {
        let text = std::fs::read_to_string(folder.path().join(file));
        text.map_or(0, |text| text.lines().count())
    };
    let mut child = run(&[]);
    let begin = Instant::now();
    while lines("r/stream.jsonl") < 3 {
        assert!(begin.elapsed() < Duration::from_secs(60), "no part");
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill().expect("killed");
    child.wait().expect("ended");
    assert!(lines("r/stream.jsonl") < 61, "it was too fast");
    let done = run(&["--resume"]).wait().expect("ended");
    assert_eq!((done.code(), lines("r/stream.jsonl")), (Some(0), 62));
    assert_eq!(lines("tried"), 1);
}

fn a_run_without_any_answer_is_no_success() {
    let folder = tempfile::tempdir().expect("a folder");
    let line = "run --scene city:n=300 --path orbit:frames=4 --processes 2 --no-bounds \
        --structure greedy --out r";
    let done = program(folder.path())
        .args(line.split_whitespace())
        .output();
    assert_eq!(done.expect("started").status.code(), Some(1));
    let cells = cells(folder.path(), "r");
    assert_eq!(
        (cells.len(), &cells[0]["status"]),
        (1, &json!("out_of_memory"))
    );
}

fn a_scene_without_items_is_left_out() {
    let folder = tempfile::tempdir().expect("a folder");
    let line = "run --scene city:n=0 --path outside:frames=2 --processes 2 --structure linear,bvh \
        --out r";
    let done = program(folder.path())
        .args(line.split_whitespace())
        .output();
    assert_eq!(done.expect("started").status.code(), Some(0));
    let cells = cells(folder.path(), "r");
    assert_eq!(cells.len(), 2);
    for cell in cells {
        assert_eq!(
            (&cell["status"], &cell["rank"]),
            (&json!("left_out"), &Value::Null)
        );
        let reason = cell["reason"].as_str().expect("a reason");
        assert!(reason.contains("no items"), "{reason}");
    }
    let line = "run --suite compare --scene city:n=50 --path orbit:frames=2 --processes 1 \
        --structure linear --out s";
    let done = program(folder.path())
        .args(line.split_whitespace())
        .output();
    assert_eq!(done.expect("started").status.code(), Some(0));
    let cell = &self::cells(folder.path(), "s")[0];
    let left_out = cell["left_out"].as_array().expect("a list").iter();
    let left_out: Vec<&str> = left_out.filter_map(Value::as_str).collect();
    assert_eq!(
        left_out,
        [
            "locate_ns: this suite times frustum queries only",
            "query_ns_p95: fewer than 20 comparable groups of cameras"
        ]
    );
}

fn main() -> ExitCode {
    if env::var_os(CHILD).is_some() {
        return cullbench::cli::main_with(
            registry()
                .with::<Broken<HangsLate>>()
                .with::<Broken<Stale>>()
                .with::<Broken<Beyond>>(),
        );
    }
    a_scene_without_items_is_left_out();
    a_run_without_any_answer_is_no_success();
    each_mishap_fails_its_own_rows();
    structures_that_panic_or_print_are_named();
    #[cfg(unix)]
    {
        a_limit_is_a_lack_of_memory();
        ctrl_c_is_answered_at_once_in_the_middle_of_a_build();
        ctrl_c_in_the_last_case_leaves_nothing_out();
        a_resumed_run_does_not_try_again_what_has_ended_a_process();
    }
    println!("statuses: out_of_memory, timed_out, panicked, left_out; Ctrl-C; what fits");
    ExitCode::SUCCESS
}
