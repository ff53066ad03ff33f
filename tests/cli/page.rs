//! The page that `run` writes: well-formed, whole, and a mark for each structure.

use std::collections::BTreeSet;
use std::fs;
use std::process::Command;

use serde_json::{Value, json};

use super::process::*;

/// Text between two texts, everywhere.
pub fn between<'t>(text: &'t str, begin: &str, end: &str) -> Vec<&'t str> {
    let parts = text.split(begin).skip(1);
    parts.filter_map(|part| part.split(end).next()).collect()
}

/// Every end tag closes the last element that is open, and none stays open.
pub fn assert_well_formed(page: &str) {
    let (mut open, mut rest) = (Vec::new(), page);
    while let Some((text, tag)) = rest.split_once('<') {
        assert!(!text.contains('>'), "a bare '>' after {open:?}: {text}");
        let (tag, after) = tag.split_once('>').expect("the end of a tag");
        rest = after;
        let name = tag.split([' ', '\n']).next().unwrap_or_default();
        assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
        if let Some(name) = name.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name), "after {open:?}");
        } else if !tag.ends_with('/') && name != "!DOCTYPE" {
            open.push(name);
        }
        if ["script", "style"].contains(&name) {
            let end = rest.find(&format!("</{name}>")).expect("its end");
            rest = &rest[end..];
        }
    }
    assert_eq!(open, [""; 0]);
}

#[test]
fn a_run_writes_one_whole_page_with_a_mark_for_each_structure() {
    let folder = folder(&[]);
    let run = "run --scene uniform:n=300 --scene city:n=300 --path orbit:frames=8 \
        --path outside:frames=8 --structure linear,bvh,wide --processes 3 --out run";
    works(folder.path(), run);
    let file = folder.path().join("run/report.html");
    let page = fs::read_to_string(&file).expect("a page");
    works(folder.path(), "report run --html again.html");
    let again = fs::read_to_string(folder.path().join("again.html")).expect("a page");
    assert!(page == again, "two pages of one run");

    assert_well_formed(&page);
    for outside in ["http", "@import", "url(", " src="] {
        assert!(!page.contains(outside), "loads something: {outside}");
    }
    let plots = between(&page, "<svg class=\"plot\"", "</figure>");
    let (speedups, views): (Vec<&str>, Vec<&str>) = plots
        .iter()
        .partition(|plot| plot.contains("aria-label=\"Speed-ups"));
    assert_eq!((speedups.len(), views.len()), (4, 4), "scenes and paths");
    let frames = |plot: &&str| between(plot, "points=\"", "\"")[0].split(' ').count() == 8;
    assert!(views.iter().all(frames), "visible items of 8 views");
    for plot in speedups {
        let marks: Vec<&str> = between(plot, "<g class=\"s ", "</g>");
        let names: BTreeSet<&str> = marks
            .iter()
            .flat_map(|g| between(g, "data-s=\"", "\""))
            .collect();
        assert_eq!((marks.len(), names), (3, set("bvh linear wide")));
        for mark in marks {
            assert_eq!(mark.matches("<polygon class=\"mark").count(), 1, "{mark}");
            assert!(
                mark.contains("data-query-ns=\"")
                    && mark.contains("class=\"interval\"") != mark.contains("\"linear\""),
                "{mark}"
            );
        }
    }
    works(folder.path(), "report run --svg charts");
    for (name, picture) in contents(&folder.path().join("charts")) {
        let picture = String::from_utf8(picture.expect("a file")).expect("UTF-8");
        assert_well_formed(&picture);
        let marks = picture.matches("<polygon class=\"mark").count();
        assert_eq!((marks, picture.contains("var(")), (3, false), "{name}");
    }
    let text = page.find(" in the geometric mean").expect("a conclusion");
    assert!(
        text < page.find("<h2>").expect("a heading"),
        "the conclusion is not first"
    );
    for heading in ["Statuses", "Machine and command", "Columns"] {
        assert!(page.contains(&format!("<h2>{heading}</h2>")), "{heading}");
    }

    let script = between(&page, "<script>", "</script>");
    let script_file = folder.path().join("page.js");
    fs::write(&script_file, script[0]).expect("writable");
    // Where there is a node.
    if let Ok(done) = Command::new("node")
        .arg("--check")
        .arg(&script_file)
        .output()
    {
        assert!(
            done.status.success(),
            "{}",
            String::from_utf8_lossy(&done.stderr)
        );
    }
}

/// No status is hidden; without linear, speed-ups refer to another structure.
#[test]
fn what_failed_is_on_the_page_with_its_reason_and_has_no_mark() {
    let folder = folder(&[]);
    let run = "run --scene city:n=300 --path orbit:frames=8 --structure bvh,wide,octree \
        --processes 3 --out run";
    works(folder.path(), run);
    let path = folder.path().join("run/report.json");
    let mut report = json(&fs::read_to_string(&path).expect("a report"));
    let cells = report["cells"].as_array_mut().expect("an array");
    for cell in cells.iter_mut() {
        cell["rank"] = json!(1);
        cell["metrics"]["break_even_queries"] = json!({ "value": 13.0, "unit": "queries" });
    }
    let wide = cells.iter_mut().find(|cell| cell["structure"] == "wide");
    let wide = wide.expect("a cell");
    (wide["status"], wide["reason"]) = (json!("wrong"), json!("item 3 <is> missing"));
    wide["rank"] = json!(null);
    fs::write(&path, report.to_string()).expect("writable");
    works(folder.path(), "report run --html page.html");
    let page = fs::read_to_string(folder.path().join("page.html")).expect("a page");
    assert_well_formed(&page);
    // Tied with the base, no build is repaid.
    assert!(page.contains("A tie: ") && !page.contains(" is repaid after "));
    assert!(page.contains("<p>wide: wrong: item 3 &lt;is&gt; missing</p>"));
    assert!(page.contains("Not ok, of 3 cells: 1 wrong."));
    assert_eq!(page.matches("<polygon class=\"mark").count(), 2);
    assert!(page.contains("Speed-ups over "));
    assert!(!page.contains("Speed-ups over linear"));
}

#[test]
fn a_history_has_the_times_of_all_runs_oldest_first() {
    let folder = folder(&[]);
    let run = "run --scene city:n=300 --path orbit:frames=8 --structure linear,bvh --no-bounds \
        --processes 3 --out old";
    works(folder.path(), run);
    let report =
        json(&fs::read_to_string(folder.path().join("old/report.json")).expect("a report"));
    let mut new = report.clone();
    new["run"]["id"] = json!("another");
    new["run"]["started_at"] = json!("2999-01-01T00:00:00Z");
    new["source"]["commit"] = json!("fedcba9876543210");
    new["source"]["dirty"] = json!(false);
    for cell in new["cells"].as_array_mut().expect("an array") {
        let ns = &mut cell["metrics"]["query_ns"];
        for end in ["value", "lower", "upper"] {
            ns[end] = json!(ns[end].as_f64().expect("a number") * 1000.0);
        }
    }
    fs::write(folder.path().join("new.json"), new.to_string()).expect("writable");
    works(folder.path(), "report new.json old --history page.html");
    let twice = cullbench(folder.path(), "report old old --history twice.html");
    assert_refused(&twice, "run | is named twice; expected each once", "twice");
    let page = fs::read_to_string(folder.path().join("page.html")).expect("a page");
    assert_well_formed(&page);
    assert!(
        page.contains(
            "Over 2 runs 2 cells take 1,000 x as long in their last run as in their first"
        )
    );
    assert_eq!(page.matches("1,000 x</td>").count(), 2, "last / first");
    assert!(
        page.find("fedcba9") > page.find("class=\"tick\""),
        "the newest is last"
    );
    let plots = between(&page, "<svg class=\"plot\"", "</figure>");
    assert_eq!(plots.len(), 1);
    assert_eq!(plots[0].matches("class=\"tick\"").count(), 2, "a run each");
    assert!(page.contains("<th scope=\"row\">2</th><td>fedcba9</td>"));
    assert!(page.contains("<th scope=\"row\">last / first</th>"));
    assert_eq!(plots[0].matches("<polygon class=\"mark").count(), 4);
    assert_eq!(plots[0].matches("class=\"interval\"").count(), 4);
    assert!(page.contains(": time per query in each run, 95 % interval</"));
    // Neither a wrong answer nor another one has a change.
    let mut wrong = new.clone();
    wrong["cells"][0]["answers"] = json!("other");
    wrong["cells"][1]["status"] = json!("wrong");
    fs::write(folder.path().join("wrong.json"), wrong.to_string()).expect("writable");
    works(folder.path(), "report wrong.json old --history wrong.html");
    let page = fs::read_to_string(folder.path().join("wrong.html")).expect("a page");
    assert!(page.contains("<p>The last run has 1 wrong answer. No structure has times in two"));
    assert!(page.contains("Of 1 cell questions or answers differ between the runs.</p>"));
    assert!(page.contains("other ids, as many as before</td>"), "{page}");
    assert!(!page.contains("1,000 x"));
    // Another question of the same name is left out, and says so.
    // Runs of one commit have their starts too.
    new["source"] = report["source"].clone();
    for cell in new["cells"].as_array_mut().expect("an array") {
        cell["path"]["camera_count"] = json!(80);
        // As in a run of one process.
        cell["metrics"]["query_ns"]["lower"] = Value::Null;
    }
    fs::write(folder.path().join("new.json"), new.to_string()).expect("writable");
    works(folder.path(), "report new.json old --history other.html");
    let page = fs::read_to_string(folder.path().join("other.html")).expect("a page");
    assert!(page.contains(": time per query in each run</"), "{page}");
    let others = "Of 2 cells questions or answers differ between the runs.";
    let none = "<p>No structure has times in two runs that can be compared.";
    assert!(page.contains(&format!("{none} {others}</p>")));
    assert_eq!(page.matches("8 cameras and 80</td>").count(), 2);
    let commits = usize::from(report["source"]["commit"].is_string());
    assert_eq!(
        page.matches(" 01-01 00:00:00 another</th>").count(),
        commits
    );
    // What tells two sections apart is in their headings.
    for cell in new["cells"].as_array_mut().expect("an array") {
        let own = &mut cell["path"];
        (own["motion"], own["arithmetic"]) = (json!("drift"), json!("f32-relative"));
        own["epsilon"] = json!(64);
        cell["metrics"]["frame_ns"] = cell["metrics"]["query_ns"].clone();
    }
    fs::write(folder.path().join("new.json"), new.to_string()).expect("writable");
    works(folder.path(), "report new.json old --history other.html");
    let page = fs::read_to_string(folder.path().join("other.html")).expect("a page");
    let heading = "city:n=300, orbit:frames=8, six-plane";
    assert!(
        page.contains(&format!("{heading}: time per query in each run")),
        "{page}"
    );
    let moving = format!("{heading}, drift, f32-relative, epsilon 64: time per frame in each run");
    assert!(page.contains(&moving), "{page}");
    let wanted = "2 reports; expected one, or --history FILE";
    all_refused(&folder, &["report old new.json".to_owned()], wanted);
}

/// Headings of tables that say all by themselves.
const PLAIN: [&str; 17] = [
    "boxes",
    "cameras",
    "column",
    "CPU time",
    "description",
    "found in",
    "meaning",
    "method",
    "of the volume, %",
    "order",
    "points",
    "question",
    "scene and path",
    "stage",
    "visible",
    "where",
    "why",
];

/// Headings without a number that the glossary does not explain.
fn unexplained(page: &str) -> BTreeSet<&str> {
    let (_, glossary) = page.split_once("<h2>Columns</h2>").expect("a glossary");
    let known = between(glossary, "<th scope=\"row\">", "</th>");
    let heads = between(page, "<th scope=\"col\"", "</th>").into_iter();
    let heads = heads.filter_map(|head| head.split('>').nth(1));
    let heads = heads.filter(|head| !head.contains(|own: char| own.is_ascii_digit()));
    heads
        .filter(|head| !known.contains(head) && !PLAIN.contains(head))
        .collect()
}

#[test]
fn speed_ups_within_an_octave_have_a_scale() {
    let folder = folder(&[]);
    let run =
        "run --scene city:n=50 --path orbit:frames=4 --structure linear --processes 1 --out r";
    works(folder.path(), run);
    let page = fs::read_to_string(folder.path().join("r/report.html")).expect("a page");
    let (_, chart) = page.split_once("<svg class=\"plot\"").expect("a chart");
    let chart = chart.split("</figure>").next().unwrap_or_default();
    let names: Vec<&str> = between(chart, "class=\"tick\"", "</text>");
    let named = |name: &str| names.iter().any(|tick| tick.ends_with(name));
    assert!(
        named(">0.9 x") && named(">1 x") && named(">1.1 x"),
        "{names:?}"
    );
}

/// The conclusion, then figures with marks, then tables.
#[test]
fn studies_and_comparisons_have_pages_that_begin_with_their_conclusions() {
    let folder = folder(&[]);
    let run = "run --scene city:n=300 --path orbit:frames=4 --structure linear,bvh,octree,bsp \
        --no-bounds --processes 3 --out run";
    works(folder.path(), run);
    // Rows of several scenes name theirs.
    let two = format!("{run}2 --scene city:n=400");
    works(folder.path(), &two);
    works(folder.path(), "compare run2 run2 --html page.html");
    let page = fs::read_to_string(folder.path().join("page.html")).expect("a page");
    for label in ["bvh city 300 orbit +0.0 %", "bvh city 400 orbit +0.0 %"] {
        assert!(
            page.contains(&format!(">{label}</text>")),
            "{label}: {page}"
        );
    }
    assert!(
        page.contains(
            "NEW relative to the other structures with its 95 % interval, 8 of 8 figures; "
        ),
        "{page}"
    );
    let meaning =
        "<th scope=\"row\">vs the others [95 %]</th><td>change of the time from OLD to NEW";
    assert!(page.contains(meaning) && !page.contains("time of that structure"));
    // Counts have no intervals; each row names its own.
    works(
        folder.path(),
        "compare run run --gate work --html work.html",
    );
    let work = fs::read_to_string(folder.path().join("work.html")).expect("a page");
    for label in ["bvh items_tested +0.0 %", "bvh nodes_tested +0.0 %"] {
        assert!(
            work.contains(&format!(">{label}</text>")),
            "{label}: {work}"
        );
    }
    assert!(work.contains("Change from OLD to NEW, ") && !work.contains("the worst "));
    // The three limits have lines, and the axis its own ticks.
    assert_eq!(page.matches("<line class=\"tie\"").count(), 2);
    assert!(page.matches("class=\"tick\"").count() > 2, "{page}");
    let small = "--scene city:n=300 --path orbit:frames=4 --structure wide,linear --processes 1";
    for (line, told, marks) in [
        (
            format!("funnel {small} --samples 32x18"),
            " remain to be drawn and ",
            "<rect class=\"bar\"",
        ),
        (
            format!("precision {small} --cubes 0"),
            "Fastest point that cannot miss",
            "class=\"mark",
        ),
        (
            "drift --steps 1000 --processes 1".to_owned(),
            "Recommended for a camera basis",
            "class=\"mark",
        ),
        (
            "compare run run".to_owned(),
            "No regression: ",
            "class=\"mark",
        ),
    ] {
        works(folder.path(), &format!("{line} --html page.html"));
        let page = fs::read_to_string(folder.path().join("page.html")).expect("a page");
        assert_well_formed(&page);
        let first = between(&page, "</h1>\n<p>", "</p>")[0];
        assert!(first.contains(told), "{line}: {first}");
        let [figure, table] = ["<figure>", "<table>"].map(|tag| page.find(tag));
        assert!(figure.is_some() && figure < table, "{line}");
        assert!(page.contains(marks), "{line}");
        // What a colour stands for is said once: triangles are no items.
        for bar in between(&page, "<rect class=\"bar\"", "/>") {
            let (_, colour) = bar.split_once("fill=").expect("a colour");
            let key = format!("<i style=\"background:{}\"></i>", colour.trim_matches('"'));
            assert_eq!(page.matches(&key).count(), 1, "{bar}");
        }
        let triangles = page.split_once(">triangle: ").map_or("", |found| found.1);
        let triangles = triangles.split(">fragment: ").next().unwrap_or_default();
        assert!(
            !["#e4e4e4", "#56b4e9"]
                .iter()
                .any(|own| triangles.contains(own)),
            "{triangles}"
        );
        assert_eq!(unexplained(&page), set(""), "{line}");
        assert!(page.contains("svg.plot") && page.contains("aria-sort"));
    }
}
