//! `--kernel` and `--threads`: the same bytes whatever is chosen, what reports say
//! of it, and what is refused.

use super::process::*;

/// The kernels that this machine has, as `env` and the program tell.
fn available() -> Vec<&'static str> {
    let all = ["portable", "avx2", "avx512"];
    let here = folder(&[]);
    let takes = |name: &&str| {
        let line = "query --scene helsinki --cameras orbit:frames=1 --structure linear --kernel";
        cullbench(here.path(), &format!("{line} {name}")).code == Some(0)
    };
    all.into_iter().filter(takes).collect()
}

#[test]
fn ids_are_the_same_bytes_from_every_kernel() {
    let here = folder(&[]);
    let kernels = available();
    assert_eq!(kernels[0], "portable");
    for (scene, cameras) in [
        ("helsinki", "flythrough:frames=4"),
        ("city:n=3000,seed=3", "teleport:frames=6"),
        ("freedm-map12", "flythrough:frames=4"),
    ] {
        let line = format!("query --scene {scene} --cameras {cameras} --ids");
        let wanted = works(here.path(), &line);
        assert!(wanted.lines().count() > 20);
        for kernel in &kernels {
            let text = works(here.path(), &format!("{line} --kernel {kernel}"));
            assert!(text == wanted, "{scene}, {kernel}");
        }
    }
}

#[test]
fn a_kernel_that_is_none_is_refused_in_one_line() {
    let here = folder(&[("p.csv", b"x,y,z\n1,2,3\n")]);
    for command in [
        "run --suite quick",
        "query --scene helsinki --cameras orbit:frames=1",
        "locate --scene freedm-map12 --points p.csv",
        "verify --cases 1",
    ] {
        let done = cullbench(here.path(), &format!("{command} --kernel avx3"));
        assert_refused(
            &done,
            "unknown kernel 'avx3' | did you mean 'avx2'",
            command,
        );
    }
    let kernels = available();
    for missing in ["avx2", "avx512"] {
        if !kernels.contains(&missing) {
            let line = format!("verify --cases 1 --kernel {missing}");
            let done = cullbench(here.path(), &line);
            assert_refused(&done, &format!("'{missing}' | available: portable"), &line);
        }
    }
}

#[test]
fn a_report_says_which_kernel_and_goes_on_with_no_other() {
    let here = folder(&[]);
    let line = "run --scene uniform:n=50 --path orbit:frames=2 --structure linear --out o";
    let told = works(here.path(), &format!("{line} --kernel portable"));
    let next = told.lines().skip_while(|line| !line.starts_with("next"));
    let next: Vec<&str> = next.collect();
    assert!(next.join(" ").contains("--kernel=portable"), "{told}");
    let report = std::fs::read_to_string(here.path().join("o/report.json")).expect("a report");
    assert_eq!(json(&report)["machine"]["instruction_set"], "portable");
    works(here.path(), &format!("{line} --resume --kernel portable"));
    let env = json(&works(here.path(), "env --format json"));
    let best = env["machine"]["instruction_set"].as_str().expect("a name");
    assert_eq!(Some(&best), available().last());
    if best != "portable" {
        let done = cullbench(here.path(), &format!("{line} --resume --kernel {best}"));
        let wanted = format!("--kernel is '{best}' | with 'portable' | expected");
        assert_refused(&done, &wanted, "another kernel");
    }
}

#[test]
fn threads_change_no_byte_and_a_number_that_is_none_is_refused() {
    let here = folder(&[("p.csv", b"x,y,z\n1,2,3\n100,-200,30\n")]);
    for line in [
        "query --scene city:n=40000 --cameras teleport:frames=7 --ids",
        "query --scene helsinki --cameras orbit:frames=5 --test sphere --format json",
        "locate --scene freedm-map12 --points p.csv",
    ] {
        let wanted = works(here.path(), line);
        for threads in [1, 2, 5] {
            let text = works(here.path(), &format!("{line} --threads {threads}"));
            assert!(text == wanted, "{line}, {threads}");
        }
    }
    for bad in ["0", "257", "-1", "two"] {
        let line = format!("query --scene helsinki --cameras orbit:frames=1 --threads={bad}");
        let done = cullbench(here.path(), &line);
        assert_refused(&done, &format!("--threads is '{bad}'; expected"), &line);
    }
}

#[test]
fn a_list_of_threads_enters_structures_that_share_a_query() {
    let here = folder(&[]);
    let line = "run --scene uniform:n=40000 --path orbit:frames=6 --structure linear,bvh \
                --threads 1,2 --processes 2 --cold --out o";
    let told = unwrapped(&works(here.path(), line));
    for part in [
        " threads share ",
        " 2 threads: ",
        " from sharing the views, ",
        " from sharing each query",
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
    let report = std::fs::read_to_string(here.path().join("o/report.json")).expect("a report");
    let report = json(&report);
    let cells = report["cells"].as_array().expect("an array");
    // One sweep for all shared views would compare warm ones with cold queries.
    let is_cold = |cell: &&serde_json::Value| cell["path"]["cache"] == "cold";
    let (cold, cells): (Vec<_>, Vec<_>) = cells.iter().partition(is_cold);
    assert_eq!(cold.len(), 3);
    assert!(
        cold.iter()
            .all(|cell| cell["metrics"]["views_wall_ns"].is_null())
    );
    let names = |cell: &&serde_json::Value| cell["structure"].as_str().map(str::to_owned);
    let mut entered: Vec<String> = cells.iter().filter_map(names).collect();
    entered.sort();
    assert_eq!(entered, ["bvh", "linear", "linear:threads=2"]);
    for cell in cells {
        assert_eq!(cell["status"], "ok", "{cell}");
        let is_shared = cell["structure"] == "linear:threads=2";
        assert!(cell["metrics"]["query_wall_ns"]["value"].is_number());
        assert_eq!(
            cell["metrics"]["views_wall_ns"].is_null(),
            is_shared,
            "{cell}"
        );
    }
    let done = cullbench(here.path(), &format!("{line} --resume"));
    assert_eq!(done.code, Some(0));
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let few = "run --scene uniform:n=200 --path orbit:frames=2 --structure linear --processes 1";
    let text = works(
        here.path(),
        &format!("{few} --out p --threads {}", cores + 1),
    );
    assert!(text.contains(" threads shared "), "{text}");
    let query = "query --scene uniform:n=40000 --cameras orbit:frames=3 --structure linear";
    let both = works(here.path(), &format!("{query} --ids --threads 1,2"));
    let rows: Vec<&str> = both.lines().skip(1).collect();
    let ids = |name: &str| -> Vec<&str> {
        let own = rows.iter().filter(|row| row.contains(name));
        own.map(|row| row.rsplit(',').next().unwrap_or_default())
            .collect()
    };
    assert_eq!(rows.len(), 6);
    assert_eq!(ids(",linear,"), ids(",linear:threads=2,"));
}
