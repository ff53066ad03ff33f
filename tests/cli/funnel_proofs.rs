//! `funnel --certificates` and `check`: proofs of what is visible and hidden, and of the
//! errors of a claim; doctored ones are rejected or refused.

use std::fs;

use super::funnel::{LINE, folder, row};
use super::process::*;

#[test]
fn proofs_are_checked_and_doctored_ones_rejected() {
    let folder = folder();
    let line = LINE.replace("--format json", "--certificates proofs.jsonl");
    works(folder.path(), &line);
    let done = works(folder.path(), "check proofs.jsonl --format json");
    let checked = json(&done);
    // The wall and the box beside it; the one behind the wall and the one around the eye.
    let counts = [
        "view_count",
        "visible_count",
        "hidden_count",
        "undecided_count",
    ];
    assert_eq!(
        counts.map(|name| number(&checked, name)),
        [1.0, 2.0, 1.0, 0.0],
        "{done}"
    );
    let proofs = fs::read_to_string(folder.path().join("proofs.jsonl")).expect("proofs");
    let mut told = 0;
    for (from, to) in [
        ("{\"behind\":0}", "{\"behind\":2}"),
        ("{\"behind\":0}", "\"empty\""),
        ("\"near\":0.1", "\"near\":15.0"),
    ] {
        let doctored = proofs.replace(from, to);
        assert_ne!(doctored, proofs, "{from} in {proofs}");
        fs::write(folder.path().join("doctored.jsonl"), doctored).expect("written");
        let done = cullbench(folder.path(), "check doctored.jsonl");
        assert_eq!(done.code, Some(1), "{to}: {done:?}");
        told += usize::from(done.out.contains("rejected"));
    }
    assert_eq!(told, 3);
    // A view of another camera proves nothing of this one, and one of no camera nothing
    // at all; nor do proofs of some of the items in question, or of one item twice.
    let other = proofs.replace("\"near\":0.1", "\"near\":0.0625");
    let (from, to) = (
        other.find("\"camera\"").expect("a camera"),
        other.find("\"view\""),
    );
    let mut bare = other.clone();
    bare.replace_range(from..to.expect("a view"), "");
    let first = proofs.find("\"proofs\":[").expect("proofs") + "\"proofs\":[".len();
    let mut none = proofs.clone();
    none.replace_range(first..proofs.trim_end().len() - 2, "");
    let mut twice = proofs.clone();
    let all = &proofs[first..proofs.trim_end().len() - 2];
    twice.insert_str(first, &format!("{all},"));
    for (content, wanted) in [
        (&other, "not that of its camera"),
        (&none, "0 proofs of 0 items"),
        (&twice, "expected one of each"),
    ] {
        fs::write(folder.path().join("other.jsonl"), content).expect("written");
        let done = cullbench(folder.path(), "check other.jsonl");
        assert_eq!(done.code, Some(1), "{content}: {done:?}");
        assert!(done.out.contains(wanted), "{content}: {done:?}");
    }
    for (content, wanted) in [
        (&bare[..], "line 1 | no camera | 'camera'"),
        (&format!("{proofs}{proofs}"), "line 2 | second time"),
        ("", "no certificate"),
        ("{}", "line 1 | certificates"),
        ("\u{7f}ELF", "line 1"),
        (
            &proofs.replace("\"boxes\":5", "\"boxes\":7"),
            "7 boxes | 5 of scene",
        ),
        (&proofs.replace("scene.csv", "gone.csv"), "gone.csv"),
        (
            &proofs.replace("\"index\":0", "\"index\":7"),
            "line 1 | camera 7",
        ),
        (&proofs[..proofs.len() / 2], "line 1"),
    ] {
        fs::write(folder.path().join("bad.jsonl"), content).expect("written");
        assert_refused(
            &cullbench(folder.path(), "check bad.jsonl"),
            wanted,
            content,
        );
    }
}

/// A number of a WAD file.
fn word(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]) as usize
}

/// Where in its directory the table is: place, size and name follow each other.
fn reject_entry(bytes: &[u8]) -> usize {
    let [count, directory] = [4, 8].map(|at| word(bytes, at));
    let mut entries = (0..count).map(|entry| directory + 16 * entry);
    let found = entries.find(|at| bytes[at + 8..].starts_with(b"REJECT"));
    found.expect("a REJECT lump")
}

/// The map with a table that calls every pair of sectors invisible, a sector and itself too.
fn map_that_hides_everything() -> Vec<u8> {
    let mut bytes = fs::read("datasets/freedm_map12.wad").expect("a map");
    let entry = reject_entry(&bytes);
    let (place, size) = (word(&bytes, entry), word(&bytes, entry + 4));
    assert!(size > 0, "an empty REJECT lump");
    bytes[place..place + size].fill(0xff);
    bytes
}

#[test]
fn what_a_claim_hides_is_proven_to_be_seen() {
    let folder = folder();
    let at = folder.path();
    fs::write(at.join("dark.wad"), map_that_hides_everything()).expect("written");
    let line = "funnel --scene dark.wad --path street:frames=2 --processes 1 --format json \
                --certificates errors.jsonl";
    let done = cullbench(at, line);
    // The claim promises nothing, so what it loses is no failure.
    assert_eq!(done.code, Some(0), "{done:?}");
    let report = json(&done.out);
    let audits = array(&report, "audits");
    assert_eq!((audits.len(), &audits[0]["claim"]), (1, &"reject".into()));
    let lost = array(&audits[0], "false_negatives").len() as f64;
    assert!(lost > 100.0, "{lost}");
    let checked = json(&works(at, "check errors.jsonl --format json"));
    assert_eq!(number(&checked, "false_negative_count"), lost);
    assert_eq!(number(&checked, "claim_count"), 1.0);
    let errors = fs::read_to_string(at.join("errors.jsonl")).expect("errors");
    let doctored = errors.replacen("\"ends\":[[", "\"ends\":[[9", 1);
    assert_ne!(doctored, errors);
    fs::write(at.join("doctored.jsonl"), doctored).expect("written");
    let done = cullbench(at, "check doctored.jsonl");
    assert_eq!(done.code, Some(1), "{done:?}");
    assert!(done.out.contains("rejected, regions"), "{done:?}");
    // The true map's table does not say that.
    let true_map = "check errors.jsonl --scene freedm-map12";
    assert_eq!(cullbench(at, true_map).code, Some(1));

    // A map without a table claims nothing: what is proven is what its views show.
    let mut bare = fs::read("datasets/freedm_map12.wad").expect("a map");
    let entry = reject_entry(&bare);
    bare[entry + 4..entry + 8].fill(0);
    fs::write(at.join("bare.wad"), bare).expect("written");
    let line = "funnel --scene bare.wad --path street:frames=2 --processes 1 \
                --certificates none.jsonl";
    works(at, line);
    let checked = json(&works(at, "check none.jsonl --format json"));
    assert_eq!(number(&checked, "claim_count"), 0.0);
    assert_eq!(number(&checked, "view_count"), 2.0);

    // The same by a file, of which stored-pvs is the back end.
    let regions = number(&json(errors.lines().next().expect("a line")), "regions");
    let none = format!("{{\"regions\": {regions}, \"sees\": []}}");
    fs::write(at.join("none.json"), none).expect("written");
    let line = "funnel --scene freedm-map12 --path street:frames=2 --processes 1 --format json \
                --pvs none.json --region stored-pvs --certificates stored.jsonl";
    let report = json(&works(at, line));
    let claims: Vec<_> = array(&report, "audits")
        .iter()
        .map(|a| &a["claim"])
        .collect();
    assert_eq!(claims, ["reject", "stored-pvs"]);
    assert!(number(row(&report, "region", "stored-pvs"), "false_negative_count") > 0.0);
    let checked = json(&works(
        at,
        "check stored.jsonl --pvs none.json --format json",
    ));
    assert_eq!(number(&checked, "false_negative_count"), lost);
    assert_refused(
        &cullbench(at, "check stored.jsonl"),
        "line 2 | --pvs FILE",
        "no claim",
    );
    for (content, wanted) in [
        (
            "{\"regions\": 3, \"sees\": []}",
            "3 regions | the scene's 49",
        ),
        (
            "{\"regions\": 3, \"sees\": [[0, 9]]}",
            "bad.json | region 9",
        ),
        ("[]", "bad.json | regions"),
        ("\u{7f}", "bad.json"),
    ] {
        fs::write(at.join("bad.json"), content).expect("written");
        let line = "funnel --scene freedm-map12 --path street:frames=2 --pvs bad.json";
        assert_refused(&cullbench(at, line), wanted, content);
    }
    let line = "funnel --scene city:n=50 --path street:frames=2 --pvs none.json";
    assert_refused(
        &cullbench(at, line),
        "city:n=50 | rooms or sectors | --pvs",
        "a city",
    );
}

/// Of triangles, of walls and of boxes with holes: whatever a conservative back end removed
/// is proven hidden, what is visible at a sample has a witness, and neither survives being
/// doctored.
#[test]
fn what_is_removed_of_meshes_maps_and_cut_outs_is_proven() {
    let folder = folder();
    let at = folder.path();
    let mut doctored_count = 0;
    for (scene, more, proofs) in [
        ("mesh:forest:n=20k", "", [80, 3]),
        ("mesh:spheres:n=30k", "", [4, 0]),
        ("mesh:terrain:n=60k", "", [40, 8]),
        ("freedm-map12", "", [20, 60]),
        ("freedm-map20", "", [30, 100]),
        ("city:n=1000", "--cut-out fence:share=0.3", [20, 200]),
        ("rooms:n=500", "--cut-out foliage", [10, 50]),
    ] {
        let line = format!(
            "funnel --scene {scene} {more} --path street:frames=4 --processes 1 --samples 160x90 \
             --format json --certificates proofs.jsonl"
        );
        let report = json(&works(at, &line));
        let checked = json(&works(at, "check proofs.jsonl --format json"));
        let found = ["visible_count", "hidden_count"].map(|name| number(&checked, name));
        let wanted = proofs.map(f64::from);
        assert!(
            found[0] >= wanted[0] && found[1] >= wanted[1],
            "{scene}: {found:?}"
        );
        let mut rows = 0;
        for row in array(&report, "stages") {
            let counts = &row["proofs"];
            if counts.is_null() || row["guarantee"] == "unproven" {
                continue;
            }
            rows += 1;
            let what = format!("{scene} {} {counts}", row["name"]);
            let of = |name: &str| number(counts, name);
            assert_eq!(of("visible_count") + of("sub_sample_count"), 0.0, "{what}");
            // Walls that only their ends hide may be seen through them: not decided.
            let decided = of("hidden_count") + of("tied_count") + of("along_lines_count");
            assert!(of("undecided_count") <= 0.1 * decided, "{what}");
        }
        assert!(
            rows >= 1 || scene.starts_with("mesh:spheres"),
            "{scene}: {rows}"
        );
        let text = fs::read_to_string(at.join("proofs.jsonl")).expect("proofs");
        for (from, to) in [
            ("\"behind\":", "\"behind\":9"),
            ("\"walls\":[", "\"walls\":[0,"),
            // Of no item, or of one with another number.
            match text.contains("\"within\":[[null,") {
                true => ("\"within\":[[null,", "\"within\":[[0,"),
                false => ("\"within\":[[", "\"within\":[[1"),
            },
            (
                "\"uncut\":\"fence:share=0.3,tile=1,seed=1",
                "\"uncut\":\"fence:share=0.9",
            ),
            ("\"direction\":[-", "\"direction\":["),
        ] {
            let doctored = text.replacen(from, to, 1);
            if doctored != text {
                fs::write(at.join("doctored.jsonl"), doctored).expect("written");
                let done = cullbench(at, "check doctored.jsonl");
                assert_eq!(done.code, Some(1), "{scene} {to}: {done:?}");
                doctored_count += 1;
            }
        }
    }
    assert!(doctored_count >= 12, "{doctored_count}");
}
