//! Wrong usage: unknown names, wrong values of options, paths without write access.

use std::fs;

use super::process::*;

#[test]
fn options_that_name_nothing_are_refused_with_the_nearest_name() {
    let cases: [(&str, &str); 17] = [
        (
            "--structure bhv",
            "unknown structure 'bhv' | did you mean 'bvh' | linear",
        ),
        ("--structure ''", "no structure | expected"),
        ("--structure linear,linear", "'linear' | twice"),
        ("--structure all,linear", "'linear' | twice"),
        ("--structure bvh:leaf=many", "leaf | many"),
        ("--structure bvh:leaf=0", "leaf=0 | expected 1 to"),
        ("--structure bvh:leave=4", "'leave' | 'leaf'"),
        (
            "--structure bvh:layout=cwbvh",
            "'layout' | 'preset' or 'leaf'",
        ),
        ("--structure linear:leaf=4", "linear | 'leaf'"),
        (
            "--test six-plain",
            "unknown test 'six-plain' | did you mean 'six-plane'",
        ),
        (
            "--planes frame-f16",
            "unknown plane method | did you mean 'frame-f",
        ),
        ("--epsilon -1", "--epsilon is '-1'; expected"),
        ("--epsilon nan", "--epsilon is 'nan'; expected"),
        ("--far away", "--far is 'away' | expected"),
        ("--fovy 0", "--fovy is '0' | above 0 and below 180"),
        ("--near 0", "--near is '0' | expected"),
        ("--near 7 --far 7", "expected near < far"),
    ];
    let folder = with_good_files(&[]);
    let commands: [&str; 3] = [
        "query --scene scene.csv --cameras cameras.csv",
        "run --scene scene.csv --path orbit:frames=4 --out new",
        // The suite's own scenes: nothing to check but the options.
        "run --out new",
    ];
    for (options, wanted) in cases {
        let all = commands.map(|command| format!("{command} {options}"));
        all_refused(&folder, &all, wanted);
    }
    let all = [
        "locate --scene scene.csv --points points.csv --structure bhv",
        "verify --cases 1 --structure bhv",
    ];
    all_refused(&folder, &all, "did you mean 'bvh'");
    all_refused(
        &folder,
        &["run --suite quik --out new"],
        "unknown suite 'quik' | did you mean 'quick'",
    );
    all_refused(
        &folder,
        &["verify --cases 0"],
        "nothing to verify | expected",
    );
    let twice = "run --out new --path orbit --scene scene.csv --scene scene.csv";
    all_refused(
        &folder,
        &[twice],
        "scene 'scene.csv' is named twice; expected each once",
    );
    let twice = "run --scene scene.csv --path orbit --threads 1,2,1";
    all_refused(
        &folder,
        &[twice],
        "--threads '1' is named twice; expected each once",
    );
}

#[test]
fn usage_errors_are_one_line_that_says_what_was_expected() {
    let folder = with_good_files(&[]);
    let cases = [
        ("rnu", "'rnu' | expected cullbench <COMMAND>"),
        ("rum", "'rum' | did you mean 'run'"),
        (
            "run --no-such-option",
            "'--no-such-option' | expected cullbench run [OPTIONS]",
        ),
        ("run --sead 3", "'--sead' | did you mean '--seed'"),
        (
            "run scene.csv",
            "'scene.csv' | did you mean '--scene scene.csv'",
        ),
        (
            "run --scene scenes.csv",
            "scenes.csv | existing file; did you mean 'scene.csv'",
        ),
        (
            "run --seed x --out new",
            "--seed is 'x'; expected a whole number from 0 to 18446744073709551615",
        ),
        (
            "run --plan --resume",
            "'--plan' cannot be used with '--resume' | expected",
        ),
        (
            "run --plan --out new",
            "'--plan' cannot be used with '--out <DIR>' | expected",
        ),
        (
            "verify --scene scene.csv --seed 9",
            "--seed is for generated cases, of which there are none; expected --cases above 0",
        ),
        (
            "run --seed -1 --out new",
            "--seed is '-1'; expected a whole number from 0 to 18446744073709551615",
        ),
        (
            "run --processes 0 --out new",
            "--processes is '0'; expected a whole number from 1 to 1000",
        ),
        (
            "run --timeout -3 --out new",
            "--timeout is '-3'; expected a whole number from 1 to 18446744073709551615",
        ),
        (
            "verify --cases -1",
            "--cases is '-1'; expected a whole number from 0 to 18446744073709551615",
        ),
        (
            "precision --scene scene.csv --frames 0",
            "--frames is '0'; expected a whole number from 1",
        ),
        (
            "query --scene scene.csv --cameras orbit --threads 0",
            "--threads is '0'; expected a whole number from 1 to 256",
        ),
        (
            "query --scene scene.csv --cameras orbit --fovy nan",
            "--fovy is 'nan'; expected a number above 0 and below 180",
        ),
        (
            "query --scene scene.csv --cameras orbit --near=-4",
            "--near is '-4'; expected a number above 0",
        ),
        (
            "query --scene scene.csv --cameras orbit --near 9 --far 3",
            "--near is 9 and --far 3; expected near < far",
        ),
        (
            "query --scene scene.csv --cameras orbit --epsilon 1e300",
            "--epsilon is '1e300'; expected a number from 0 to 1e9",
        ),
        (
            "query --scene scene.csv --cameras orbit:frames=0",
            "in 'orbit': frames is '0'; expected a whole number from 1 to 1000000",
        ),
        (
            "funnel --scene city:n=9 --triangle x --region portals",
            "--region is 'portals'; expected none | 'city:n=9' has nothing for that stage",
        ),
        (
            "funnel --scene city:n=9 --fragment alpha-test",
            "--fragment is 'alpha-test'; expected --cut-out as well",
        ),
        (
            "compare a.json b.json --seed 3 --test sphere",
            "--test says what --against BINARY measures | expected no --test",
        ),
        (
            "compare --against scene.csv --metric build_ms",
            "'--metric <LIST>' | cannot be used with | '--against <BINARY>' | expected cullbench \
             compare --against <BINARY>",
        ),
        (
            "advise --scene scene.csv --path orbit --draw-ns x",
            "--draw-ns is 'x'; expected a number",
        ),
        ("query", "--scene <SCENE>, --cameras <CAMERAS> | expected"),
        ("query --scene scene.csv", "--cameras <CAMERAS> | expected"),
        (
            "query --scene scene.csv --cameras orbit --format xml",
            "'xml' for '--format <FORMAT>'; expected one of csv, json",
        ),
        (
            "query --scene a --scene b",
            "'--scene <SCENE>' | multiple times | expected",
        ),
        ("scene generate uniform:n=3 --out", "'--out <FILE>'"),
        ("scene generate uniform:n=3 --out ''", "'--out <FILE>'"),
        (
            "scene convert a b --out c",
            "'[OUTPUT]' cannot be used with '--out <FILE>' | expected",
        ),
        (
            "list everything",
            "'everything' for '[TOPIC]'; expected one of structures, scenes",
        ),
        ("list two\nlines\r", "'two lines ' for '[TOPIC]'"),
        ("run --cold=3", "'3' for '--cold' | expected"),
    ];
    for (line, wanted) in cases {
        all_refused(&folder, &[line], wanted);
    }
    // No command at all is a question, and its answer is the help.
    for line in ["", "scene"] {
        let done = cullbench(folder.path(), line);
        assert_eq!((done.code, done.out.as_str()), (Some(2), ""), "{line}");
        assert!(done.err.contains("Usage: cullbench"), "{done:?}");
    }
}

#[test]
fn places_that_cannot_be_written_to_are_named_and_stay_as_they_are() {
    let folder = with_good_files(&[]);
    let generate = "scene generate uniform:n=5 --out";
    let run = "run --scene uniform:n=5 --path orbit:frames=2 --out";
    let cases = [
        (
            generate,
            "no/where.csv",
            "no: expected an existing folder for --out",
        ),
        (
            generate,
            "folder.csv",
            "folder.csv: a folder; expected a file for --out",
        ),
        (
            generate,
            "kept.csv/x.csv",
            "kept.csv: expected an existing folder for --out",
        ),
        (
            run,
            "kept.csv",
            "kept.csv: not a folder; expected a folder for --out",
        ),
        (run, "kept.csv/run", "kept.csv/run: Not a directory"),
        (run, "-", "--out is '-' | expected a folder"),
        (
            "funnel --scene uniform:n=5 --path orbit:frames=2 --svg",
            "-",
            "--svg is '-' | expected a file",
        ),
    ];
    for (command, out, wanted) in cases {
        all_refused(&folder, &[format!("{command} {out}")], wanted);
    }
    // The folder has a file that is not of a run.
    fs::create_dir(folder.path().join("mine")).expect("writable");
    fs::write(folder.path().join("mine/samples.csv"), "mine").expect("writable");
    let mine = format!("{run} mine");
    all_refused(&folder, &[mine], "mine | expected an empty or new folder");
    let resume = format!("{run} nowhere --resume");
    all_refused(&folder, &[resume], "nowhere/stream.jsonl: No such file");
    let wanted = "no unfinished run in results; expected one | --out DIR";
    all_refused(&folder, &["run --resume"], wanted);
}
