//! Every command in a pseudo-terminal of 80 columns: no line is wider.
//!
//! Standard output and standard error both go there.

use std::ffi::OsStr;
use std::fs::File;
use std::io::Read;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;
use std::process::Stdio;

use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcsetwinsize};

use super::process::*;

/// Text that a command writes to a terminal of some columns, and its exit code.
fn in_terminal(folder: &Path, line: &str, columns: u16) -> (String, Option<i32>) {
    let terminal = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a pseudo-terminal");
    grantpt(&terminal)
        .and_then(|()| unlockpt(&terminal))
        .expect("a pseudo-terminal");
    let name = ptsname(&terminal, Vec::new()).expect("its name");
    let size = Winsize {
        ws_row: 24,
        ws_col: columns,
        ws_xpixel: 0,
        ws_ypixel: 0,
    };
    tcsetwinsize(&terminal, size).expect("its size");
    let open = || {
        let name = OsStr::from_bytes(name.as_bytes());
        let file = File::options().read(true).write(true).open(name);
        Stdio::from(file.expect("the other end"))
    };
    let mut command = command(folder, line);
    command.env("TERM", "xterm").stdin(Stdio::null());
    command.stdout(open()).stderr(open());
    let mut child = command.spawn().expect("the program starts");
    // The terminal ends when the last process has closed it.
    drop(command);
    let (mut reader, mut text) = (File::from(terminal), Vec::new());
    let _ = reader.read_to_end(&mut text);
    let code = child.wait().expect("the program ends").code();
    (String::from_utf8_lossy(&text).into_owned(), code)
}

/// Lines without sequences that move the cursor.
///
/// A line that is drawn again is a line of its own.
fn lines(text: &str) -> Vec<String> {
    let lines = text.split(['\n', '\r']).map(|line| {
        let mut parts = line.split("\x1b[");
        let first = parts.next().unwrap_or_default().to_owned();
        parts.fold(first, |line, part| {
            let end = part.find(|c: char| c.is_ascii_alphabetic());
            line + end.map_or("", |end| &part[end + 1..])
        })
    });
    lines.collect()
}

fn assert_fits(folder: &Path, line: &str) -> String {
    let (text, code) = in_terminal(folder, line, 80);
    assert_eq!(code, Some(0), "{line}: {text}");
    assert!(text.lines().count() > 2, "{line}: {text}");
    for one in lines(&text) {
        assert!(one.chars().count() <= 80, "{line}:\n{one}");
    }
    text
}

#[test]
fn lists_and_every_help_fit() {
    let here = Path::new(".");
    let help = works(here, "help");
    let commands = help.lines().skip_while(|line| *line != "Commands:");
    let commands = commands.take_while(|line| !line.is_empty());
    let names = commands.filter_map(|line| line.strip_prefix("  ")?.split(' ').next());
    let names: Vec<&str> = names.filter(|name| !name.is_empty()).collect();
    assert!(
        names.contains(&"funnel") && names.contains(&"scene"),
        "{names:?}"
    );
    for name in names.iter().filter(|name| **name != "help") {
        assert_fits(here, &format!("{name} --help"));
    }
    for line in [
        "--help",
        "list",
        "env",
        "scene info city:n=200",
        "scene info freedm-map12",
    ] {
        assert_fits(here, line);
    }
    // A wider terminal is used.
    let (wide, _) = in_terminal(here, "list", 120);
    assert!(lines(&wide).iter().any(|line| line.chars().count() > 80));
}

#[test]
fn runs_and_comparisons_fit() {
    let folder = folder(&[]);
    let few = "run --processes 3 --structure linear,wide,bvh:leaf=4 --no-bounds";
    let one = format!("{few} --scene city:n=300,seed=12 --path orbit:frames=4");
    let told = assert_fits(folder.path(), &format!("{one} --out one --why bvh"));
    assert!(told.contains("bvh:leaf=4 takes "), "{told}");
    // A label as typed comes before the name of another one.
    let labels = format!("{one} --structure bvh --out labels --why bvh");
    let told = assert_fits(folder.path(), &labels);
    assert!(
        told.contains("bvh takes ") || told.contains("bvh is"),
        "{told}"
    );
    let two = "--scene rooms:n=300 --path flythrough:frames=4";
    let told = assert_fits(
        folder.path(),
        &format!("{one} {two} --out two --why linear"),
    );
    assert!(told.contains("linear takes "), "{told}");
    assert_fits(folder.path(), &format!("{one} --out three --all-columns"));
    // A terminal gets the tables of the run, a pipe Markdown; a wide one more columns.
    assert_fits(folder.path(), "report one");
    assert!(works(folder.path(), "report one").starts_with("# cullbench run "));
    let wide = in_terminal(folder.path(), "report one", 120).0;
    assert!(wide.contains("bytes/item  repaid after"), "{wide}");
    for more in ["", "--all", "--gate work --all"] {
        assert_fits(
            folder.path(),
            &format!("compare one/report.json two {more}"),
        );
    }
    let frames = format!("{one} --motion swarm:frames=12 --path spin:frames=3,fovy=70");
    let told = assert_fits(folder.path(), &format!("{frames} --out long --why bvh"));
    let why = lines(&told).join(" ").replace("  ", " ");
    assert!(why.contains(" of the frames, and "), "{told}");
    let told = assert_fits(folder.path(), "compare long long");
    assert!(told.contains(" swarm"), "{told}");
    let unknown = cullbench(folder.path(), &format!("{one} --why wid"));
    assert_refused(
        &unknown,
        "--why is 'wid' | linear, wide, bvh:leaf=4",
        "--why",
    );
}

#[test]
fn studies_fit() {
    let here = Path::new(".");
    let few = "--processes 3 --structure wide,bvh";
    let precision = format!("precision --scene city:n=100 {few} --frames 2 --cubes 2000");
    let funnel = "funnel --processes 3 --structure wide --frames 2 --samples 32x18";
    let drift = "drift --steps 1e3 --processes 3";
    for line in [
        format!("{precision} --all"),
        format!("{funnel} --scene rooms:n=300"),
        format!("{funnel} --scene freedm-map12 --all"),
        format!("{funnel} --scene city:n=300 --all --no-picks --cut-out fence"),
        format!("advise --scene city:n=300 --path orbit:frames=4 {few}"),
        format!("advise --scene rooms:n=300 --path street:frames=4 {few} --all-columns"),
        drift.to_owned(),
        format!("{drift} --all"),
        "stress --cases 0 --structure wide".to_owned(),
        "verify --cases 50".to_owned(),
        "verify --scene city:n=100 --path orbit:frames=2 --epsilon 0".to_owned(),
    ] {
        assert_fits(here, &line);
    }
}
