//! Targets of output: a pipe that is closed early, a full disk, links and pipes.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::Stdio;

use super::BOXES;
use super::process::*;
use super::queries::QUERY;
use super::runs::{cells, check_run};

/// Runs a command and closes its output after `lines` lines.
fn cut_off(folder: &Path, line: &str, lines: usize) -> Done {
    let (reader, writer) = std::io::pipe().expect("a pipe");
    let mut reader = (lines > 0).then(|| BufReader::new(reader));
    let mut command = command(folder, line);
    command.stdout(writer).stderr(Stdio::piped());
    let child = command.spawn().expect("the program starts");
    // The command holds a writing end of its own.
    drop(command);
    let mut out = String::new();
    for _ in 0..lines {
        let reader = reader.as_mut().expect("open");
        reader.read_line(&mut out).expect("a line");
    }
    drop(reader);
    let output = child.wait_with_output().expect("a child");
    Done {
        code: output.status.code(),
        out,
        err: String::from_utf8(output.stderr).expect("UTF-8"),
    }
}

#[test]
fn a_reader_who_leaves_early_is_no_error() {
    let folder = with_good_files(&[]);
    let commands = [
        "list",
        "list --format json",
        "env",
        "env --format json",
        "man",
        "licences",
        "completions bash",
        "completions zsh",
        "completions fish",
        "completions elvish",
        "completions powershell",
        "--help",
        "run --help",
        "--version",
        "query --scene scene.csv --cameras cameras.csv",
        "query --scene uniform:n=50 --cameras orbit:frames=20000",
        "query --scene uniform:n=50 --cameras orbit:frames=20000 --format json",
        "locate --scene scene.csv --points points.csv",
        "locate --scene scene.csv --points points.csv --format json",
        "verify --scene scene.csv --path orbit:frames=2",
        "verify --scene scene.csv --path orbit:frames=2 --format json",
        "scene info scene.csv",
        "scene generate uniform:n=20000",
        "scene convert uniform:n=20000",
        "run --scene uniform:n=50 --scene city:n=50 --path orbit:frames=8 --out run",
        "compare run run",
        "compare run run --format json",
    ];
    for line in commands {
        let done = cut_off(folder.path(), line, 0);
        assert_eq!((done.code, done.err.as_str()), (Some(0), ""), "{line}");
    }
    // The figures are on disk although the table could not be printed.
    let report = check_run(&folder.path().join("run"));
    assert_eq!(cells(&report).len(), 2 * timed_names().len());
    assert!(report["run"]["finished_at"].is_string());
    // `| head -1`, with far more to come than a pipe holds.
    for (line, first) in [
        (
            "query --scene uniform:n=50 --cameras orbit:frames=20000",
            QUERY,
        ),
        ("scene generate uniform:n=20000", BOXES),
    ] {
        let done = cut_off(folder.path(), line, 1);
        assert_eq!((done.code, done.err.as_str()), (Some(0), ""), "{line}");
        assert_eq!(done.out.trim_end(), first);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_one_error_line() {
    let folder = with_good_files(&[]);
    let full = || {
        let mut options = std::fs::OpenOptions::new();
        options.write(true).open("/dev/full").expect("/dev/full")
    };
    let commands = [
        "--version",
        "run --help",
        "list",
        "env --format json",
        "man",
        "licences",
        "completions bash",
        "query --scene scene.csv --cameras cameras.csv",
        "locate --scene scene.csv --points points.csv --format json",
        "query --scene scene.csv --cameras cameras.csv --format json",
        "verify --cases 5",
        "drift --steps 1000 --processes 1",
        "scene generate uniform:n=20000",
        "scene info scene.csv",
        "run --scene scene.csv --path orbit:frames=2 --out run",
    ];
    for line in commands {
        let output = command(folder.path(), line).stdout(full()).output();
        let output = output.expect("the program starts");
        let err = String::from_utf8(output.stderr).expect("UTF-8");
        let done = Done {
            code: output.status.code(),
            out: String::new(),
            err: besides_work(&err).to_owned(),
        };
        let wanted = "standard output: No space left | expected room on the disk";
        assert_refused(&done, wanted, line);
    }
    // The table is lost, the cells are not.
    check_run(&folder.path().join("run"));
    // Not even the error can be printed: still no panic.
    let mut command = command(folder.path(), "scene info nothing");
    let status = command.stderr(full()).status();
    assert_eq!(status.expect("the program starts").code(), Some(2));
}

/// Work that would take minutes: what cannot be written is found before it.
#[cfg(target_os = "linux")]
#[test]
fn an_output_that_cannot_be_written_is_found_before_the_work() {
    let folder = folder(&[]);
    let commands = [
        "scene generate uniform:n=9000000 --out",
        "precision --scene uniform:n=100000 --svg",
        "precision --scene uniform:n=100000 --html",
        "drift --svg",
        "drift --html",
        "funnel --scene city:n=10000 --html",
        "funnel --scene city:n=10000 --svg",
        "run --suite full --out",
    ];
    let begin = std::time::Instant::now();
    for line in commands {
        let done = cullbench(folder.path(), &format!("{line} /proc/out"));
        assert_refused(&done, "/proc/out: No such file", line);
    }
    assert!(begin.elapsed().as_secs() < 10, "{:?}", begin.elapsed());
}

#[cfg(unix)]
#[test]
fn links_and_pipes_are_written_to_and_not_replaced() {
    use std::fs;
    use std::os::unix::fs::{FileTypeExt, symlink};

    let folder = folder(&[("file.csv", b"old")]);
    let at = |name: &str| folder.path().join(name);
    let generate = |out: &str| {
        let done = cullbench(
            folder.path(),
            &format!("scene generate uniform:n=5 --out {out}"),
        );
        assert_eq!(done.code, Some(0), "{done:?}");
    };
    symlink("file.csv", at("link.csv")).expect("writable");
    generate("link.csv");
    let link = fs::symlink_metadata(at("link.csv")).expect("there");
    assert!(link.is_symlink());
    let written = fs::read_to_string(at("file.csv")).expect("there");
    assert!(written.starts_with(BOXES), "{written}");

    let mut mkfifo = std::process::Command::new("mkfifo");
    let made = mkfifo.arg(at("pipe")).status().expect("mkfifo");
    assert!(made.success());
    let pipe = at("pipe");
    let reader = std::thread::spawn(move || fs::read_to_string(pipe).expect("readable"));
    generate("pipe");
    let pipe = fs::metadata(at("pipe")).expect("there");
    assert!(pipe.file_type().is_fifo());
    assert_eq!(reader.join().expect("no panic"), written);
}

/// Runs a command that reads standard input by its name.
#[cfg(unix)]
fn fed(folder: &Path, line: &str, input: &[u8]) -> Done {
    let output = assert_cmd::Command::from_std(command(folder, line))
        .write_stdin(input)
        .output()
        .expect("the program starts");
    Done {
        code: output.status.code(),
        out: String::from_utf8(output.stdout).expect("UTF-8"),
        err: String::from_utf8(output.stderr).expect("UTF-8"),
    }
}

/// Some commands look at their inputs twice, which a pipe does not allow.
#[cfg(unix)]
#[test]
fn scenes_and_cameras_come_from_pipes() {
    let folder = with_good_files(&[("map.wad", &map12())]);
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).expect(name);
    let run = "--path orbit:frames=2 --structure linear,bvh --no-bounds --out";
    for (line, input, wanted) in [
        ("scene info /dev/stdin", "scene.csv", "items"),
        ("scene info /dev/stdin", "map.wad", "items"),
        (
            "query --scene /dev/stdin --cameras cameras.csv --structure linear",
            "scene.csv",
            "0,linear,six-plane,2,2,1,",
        ),
        (
            &format!("run --scene /dev/stdin {run} one"),
            "scene.csv",
            "bvh",
        ),
        (
            "run --scene scene.csv --scene uniform:n=9 --path /dev/stdin --structure linear \
             --no-bounds --out two",
            "cameras.csv",
            "linear",
        ),
    ] {
        let done = fed(folder.path(), line, &bytes(input));
        assert_eq!((done.code, done.err.as_str()), (Some(0), ""), "{line}");
        assert!(done.out.contains(wanted), "{line}: {}", done.out);
    }
    let none = fed(folder.path(), "scene info /dev/stdin", b"");
    assert_refused(
        &none,
        "/dev/stdin, line 1 | an empty file | expected",
        "none",
    );
}

/// A program that hangs once the pairs have begun is given up.
#[cfg(unix)]
#[test]
fn a_program_that_hangs_in_a_pair_is_one_error_line() {
    use std::os::unix::fs::PermissionsExt;

    let folder = tempfile::tempdir().expect("a folder");
    let program = folder.path().join("other");
    let script = format!(
        "#!/bin/sh\nif [ -e counted ]; then\n  printf '{{\"ready\":{{\"protocol\":7}}}}\\n'\n  \
         exec sleep 60\nfi\n: > counted\nexec {} \"$@\"\n",
        crate::PROGRAM
    );
    std::fs::write(&program, script).expect("written");
    let executable = std::fs::Permissions::from_mode(0o755);
    std::fs::set_permissions(&program, executable).expect("executable");
    let line = "compare --against ./other --scene city:n=100 --structure linear --timeout 1";
    let done = cullbench(folder.path(), line);
    assert_refused(
        &done,
        "took longer than 2 s; expected one that finishes",
        "a hang",
    );
}

/// Output that is not of a worker is one error line that quotes it, and no times.
#[cfg(unix)]
#[test]
fn a_program_that_speaks_another_protocol_is_one_error_line() {
    use std::os::unix::fs::PermissionsExt;

    let folder = tempfile::tempdir().expect("a folder");
    let program = folder.path().join("other");
    for said in [
        r"hello",
        // A message but for the byte that is no UTF-8.
        r#"{"doing":{"structure":null,"step":"\377"}}"#,
        r#"{"ready":{"protocol":0}}"#,
        // Not a line, and without an end.
        "ENDLESS",
    ] {
        let script = match said {
            "ENDLESS" => "#!/bin/sh\nexec cat /dev/zero\n".to_owned(),
            _ => format!("#!/bin/sh\nprintf '{said}\\n'\nsleep 1\n"),
        };
        std::fs::write(&program, script).expect("written");
        let executable = std::fs::Permissions::from_mode(0o755);
        std::fs::set_permissions(&program, executable).expect("executable");
        let line = "compare --against ./other --scene city:n=100 --structure linear";
        let done = cullbench(folder.path(), line);
        assert_refused(&done, "expected | of another version", said);
    }
}
