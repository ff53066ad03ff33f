//! `run --suite FILE.toml`: a suite that a user wrote, and files that are none.

use std::fs;

use super::process::*;

const SUITE: &str = r#"
like = "compare"
structures = "linear,bvh"
processes = 2
[[scenes]]
scene = "uniform:n=300"
paths = ["flythrough:frames=8,visible=20"]
[[scenes]]
scene = "uniform:n=900"
paths = ["flythrough:frames=8,visible=20"]
[[scenes]]
scene = "uniform:n=2700"
paths = ["flythrough:frames=8,visible=20", "orbit:frames=8"]
"#;

#[test]
fn a_suite_of_a_file_is_run_as_written_and_grows_over_its_sizes() {
    let folder = folder(&[("mine.toml", SUITE.as_bytes())]);
    works(folder.path(), "run --suite mine.toml --out r");
    let text = |name: &str| fs::read_to_string(folder.path().join("r").join(name)).expect(name);
    let report = json(&text("report.json"));
    assert_eq!(report["run"]["suite"], "mine.toml");
    assert_eq!(report["run"]["processes"], 2);
    let rows = rows(&text("summary.csv"));
    assert_eq!(rows.len(), 4 * 2);
    for row in &rows {
        // A slope needs three sizes: the orbit has one.
        let has_slope = row["path"].starts_with("flythrough");
        assert_eq!(
            row["growth_exponent"].parse::<f64>().is_ok(),
            has_slope,
            "{row:?}"
        );
        // The effort of the suite it is like: no region search.
        assert_eq!(row["locate_ns"], "", "{row:?}");
    }
    let pictures = fs::read_dir(folder.path().join("r")).expect("a folder");
    let pictures = pictures.map(|entry| entry.expect("an entry").file_name());
    let pictures = pictures.filter(|name| name.to_string_lossy().ends_with(".svg"));
    assert_eq!(pictures.count(), 4);
    // Options stand in for what the file has.
    let plan = works(
        folder.path(),
        "run --suite mine.toml --path spin:frames=4 --structure linear --plan",
    );
    let plan: Vec<_> = plan.lines().map(json).collect();
    assert_eq!(plan.len(), 3);
    assert!(plan.iter().all(|cell| cell["structure"] == "linear"));
    assert!(plan.iter().all(|cell| cell["path"] == "spin:frames=4"));
    // Two programs are compared by the structures that it states.
    let line = format!(
        "compare --suite mine.toml --gate work --against {}",
        super::PROGRAM
    );
    let compared = works(folder.path(), &line);
    assert!(compared.trim_end().ends_with("of 8 cells"), "{compared}");
    // A stopped run continues with the suite it was begun with.
    let stream = text("stream.jsonl");
    let begun: String = stream.split_inclusive('\n').take(3).collect();
    fs::write(folder.path().join("r/stream.jsonl"), begun).expect("writable");
    let other = SUITE.replace("processes = 2", "processes = 3");
    fs::write(folder.path().join("mine.toml"), other).expect("writable");
    let wanted = "suite 'mine.toml' has changed since the run was begun | expected the same";
    all_refused(&folder, &["run --resume --out r"], wanted);
    fs::write(folder.path().join("mine.toml"), SUITE).expect("writable");
    works(folder.path(), "run --resume --out r");
    assert_eq!(json(&text("report.json"))["run"]["processes"], 2);
}

#[test]
fn a_file_that_is_no_suite_is_refused_with_its_line() {
    for (text, wanted) in [
        ("x = 3", "bad.toml, line 1: | 'x' | expected one of"),
        (
            "processes = 3",
            "line 1: missing field 'scenes'; expected a suite: [[scenes]], each",
        ),
        ("scenes = []", "bad.toml: no scenes; expected"),
        (
            "[[scenes]]\nscene = 'uniform:n=9'\npaths = []",
            "bad.toml: 'uniform:n=9' has no paths; expected",
        ),
        (
            "[[scenes]]\npath = [3]",
            "bad.toml, line 2: | 'path' | 'paths'",
        ),
        (
            "[[scenes]]\nscene = 3",
            "bad.toml, line 2: '3'; expected a text",
        ),
        (
            "processes = 2.5\n[[scenes]]\nscene = 'city'",
            "bad.toml, line 1: '2.5'; expected a whole number from 0 to",
        ),
        (
            "processes = 0\n[[scenes]]\nscene = 'city'",
            "processes is 0; expected",
        ),
        (
            "like = 'quik'\n[[scenes]]\nscene = 'city'",
            "did you mean 'quick'",
        ),
        (
            "[[scenes]]\nscene = 'no.glb'",
            "error: bad.toml: no.glb: No such | expected an existing file",
        ),
        (
            "[[scenes]]\nscene = 'city'\npaths = ['no.csv']",
            "error: bad.toml: no.csv: No such | expected an existing file",
        ),
        (
            "structures = 'liner'\n[[scenes]]\nscene = 'city'",
            "error: bad.toml: unknown structure 'liner'",
        ),
        (
            "[[scenes]]\nscene = 'city:n=9'\npaths = ['orbitx']",
            "error: bad.toml: unknown path 'orbitx'",
        ),
        ("[[scenes", "bad.toml, line 1: | expected"),
    ] {
        let folder = with_good_files(&[("bad.toml", text.as_bytes())]);
        let run = "run --suite bad.toml";
        let lines = [format!("{run} --out new"), format!("{run} --plan")];
        all_refused(&folder, &lines, wanted);
    }
    let folder = with_good_files(&[]);
    all_refused(
        &folder,
        &["run --suite no.toml --out new"],
        "no.toml: | expected",
    );
    // What a plan names is there, by hand as well.
    for named in [
        "--scene no.csv",
        "--path no.csv",
        "--motion no.csv",
        "--scene no.pk3#a",
    ] {
        let wanted = "error: no. | : No such | expected an existing file";
        all_refused(&folder, &[format!("run {named} --plan")], wanted);
    }
}
