//! A structure from outside gets the whole program: the one of
//! examples/enter_your_crate.rs, asked as its users would. This file is the
//! program and its test in one (`harness = false`): with [`CHILD`] set it is
//! the example, else it starts itself with arguments and looks at what comes.

#[path = "../examples/enter_your_crate.rs"]
mod enter_your_crate;

use std::env;
use std::path::Path;
use std::process::{Command, ExitCode};

use serde_json::{Value, json};

/// Set for the processes that are the example.
const CHILD: &str = "CULLBENCH_TEST_OUTSIDE_CHILD";

/// The output of the example, which has to end well.
fn works(folder: &Path, line: &str) -> String {
    let mut command = Command::new(env::current_exe().expect("this test"));
    command.env(CHILD, "1").current_dir(folder);
    let output = command.args(line.split(' ')).output().expect("started");
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{line}: {error}");
    String::from_utf8(output.stdout).expect("text")
}

fn main() -> ExitCode {
    if env::var_os(CHILD).is_some() {
        return enter_your_crate::main();
    }
    let folder = tempfile::tempdir().expect("a folder");
    let works = |line: &str| works(folder.path(), line);
    let parsed = |text: &str| -> Value { serde_json::from_str(text).expect("JSON") };

    let list = parsed(&works("list structures --format json"));
    let row = list.as_array().and_then(|rows| rows.last()).cloned();
    let row = row.expect("a row");
    assert_eq!(row["name"], "tiles", "after those that are built in");
    assert_eq!(
        (&row["kind"], &row["capabilities"]),
        (&json!("grid"), &json!([]))
    );
    assert_eq!(row["origin"], "crate enter_your_crate");
    assert!(works("list structures").contains("tiles of 32"));

    // The program speaks of itself, not of this crate.
    let version = concat!(
        "enter_your_crate 1.2.0 (cullbench ",
        env!("CARGO_PKG_VERSION"),
        ")\n"
    );
    assert_eq!(works("--version"), version);
    for topic in [
        "",
        "run ",
        "locate ",
        "merge ",
        "compare ",
        "scene convert ",
        "scene draw ",
    ] {
        let help = works(&format!("{topic}--help"));
        let usage = format!("Usage: enter_your_crate {topic}");
        assert!(
            help.contains(usage.trim_end()) && !help.contains("cullbench"),
            "{help}"
        );
    }
    for topic in ["completions bash", "man", "list"] {
        let text = works(topic).replace("(cullbench ", "(");
        let is_own = text.contains("enter_your_crate") && !text.contains("cullbench");
        assert!(is_own, "{topic}: {text}");
    }

    let verified = parsed(&works(
        "verify --scene city:n=500 --path orbit:frames=4 --cases 50 --structure tiles --format json",
    ));
    assert_eq!(
        (&verified["ok"], &verified["mismatches"]),
        (&json!(true), &json!(0))
    );

    let asked = works(
        "query --scene city:n=500 --cameras orbit:frames=4 --structure linear,tiles --format json",
    );
    let answers = parsed(&asked);
    let of = |name: &str| -> Vec<&Value> {
        let rows = answers.as_array().expect("rows").iter();
        let own = rows.filter(|row| row["structure"] == name);
        own.map(|row| &row["visible_id_sum"]).collect()
    };
    assert!(of("tiles").len() == 4 && of("tiles") == of("linear"));
    let points = folder.path().join("points.csv");
    std::fs::write(points, "x,y,z\n0,0,0\n").expect("writable");
    let located = works("locate --scene city:n=500 --points points.csv --structure tiles");
    assert_eq!(located.matches(",tiles,").count(), 1, "{located}");

    let run = "run --scene city:n=500 --path orbit:frames=4 --structure linear,tiles --no-bounds";
    let said = works(&format!("{run} --out run"));
    let next = "next    enter_your_crate advise --scene city:n=500 --path orbit:frames=4";
    assert!(said.contains(next), "{said}");
    let written = std::fs::read_to_string(folder.path().join("run/report.json"));
    let report = parsed(&written.expect("a report"));
    assert_eq!(
        report["run"]["command"],
        format!("enter_your_crate {run} --out run")
    );
    let own = report["source"]["version"].as_str();
    assert!(
        own.is_some_and(|own| own.starts_with("1.2.0 (cullbench ")),
        "{own:?}"
    );
    let cells = report["cells"].as_array().expect("cells");
    let cell = cells.iter().find(|cell| cell["structure"] == "tiles");
    let cell = cell.expect("a cell of its own");
    assert_eq!(
        (&cell["status"], &cell["kind"]),
        (&json!("ok"), &json!("grid"))
    );
    assert_eq!(cell["origin"], json!({ "crate": "enter_your_crate" }));
    assert!(works("report run").contains("tiles"));
    assert!(works("compare run run").contains("cells"));
    let advised = works(
        "advise --scene city:n=300 --path orbit:frames=2 --structure linear,tiles --processes 1",
    );
    assert!(advised.contains("tiles"), "{advised}");
    let stressed = works("stress --structure tiles --cases 1");
    assert!(!stressed.is_empty());
    let precise = works(
        "precision --scene city:n=300 --path orbit:frames=2 --structure tiles --cubes 200 --processes 1",
    );
    assert!(precise.contains("tiles"), "{precise}");
    works("view --scene city:n=300 --path orbit:frames=2 --structure tiles --out view.html");
    let page = std::fs::read_to_string(folder.path().join("view.html")).expect("a page");
    let (heading, title) = ("<h1>enter_your_crate view", "<title>enter_your_crate view");
    assert!(page.contains(heading) && page.contains(title));
    println!(
        "outside: list, verify, query, locate, run, report, compare, advise, stress, precision, \
         view"
    );
    ExitCode::SUCCESS
}
