//! `advise`: the stages behind the frustum, on scenes where they pay and where not.

use std::path::Path;

use super::advise::{advice, rule};
use super::process::*;

#[test]
fn occlusion_is_left_out_from_the_air_and_kept_on_the_street() {
    let of = |path: &str| {
        let line = format!("advise --scene city:n=4000 --structure linear,wide --path {path}");
        let advice = advice(Path::new("."), &line);
        let rule = rule(&advice, "occlusion");
        (rule["decision"].clone(), number(rule, "statistic"))
    };
    let (street, hidden) = of("street:frames=12 --draw-ns 5000");
    assert_eq!(street, "keep");
    assert!(hidden > 0.5, "{hidden}");
    let (air, hidden) = of("outside:frames=12 --draw-ns 50");
    assert_eq!(air, "leave_out");
    assert!(hidden < 0.5, "{hidden}");
}

/// The decision of a rule with its statistic, for a scene and path.
fn decided(name: &str, line: &str) -> (String, f64) {
    let line = format!("advise --structure linear,wide {line}");
    let advice = advice(Path::new("."), &line);
    let rule = rule(&advice, name);
    let decision = rule["decision"].as_str().expect("a decision");
    (decision.to_owned(), number(rule, "statistic"))
}

#[test]
fn regions_are_kept_where_they_remove_what_occlusion_leaves() {
    let of = |line: &str| decided("regions", &format!("{line} --draw-ns 1e6"));
    for scene in ["rooms:n=4000", "freedm-map12"] {
        let (indoors, hidden) = of(&format!("--scene {scene} --path street:frames=12"));
        assert!(indoors == "keep" && hidden > 0.01, "{scene} {hidden}");
    }
    // Eyes in no room: all rooms may be seen.
    let (outside, hidden) = of("--scene rooms:n=4000 --path outside:frames=12");
    assert_eq!((outside.as_str(), hidden), ("leave_out", 0.0));
}

#[test]
fn back_faces_are_tested_where_triangles_cost_something() {
    let of = |more: &str| decided("back-faces", &format!("--scene city:n=2000 {more}"));
    let (kept, away) = of("--path street:frames=12 --draw-ns 1e5");
    assert_eq!(kept, "keep");
    // Of a box one sees one to three of six faces.
    assert!((0.1..0.84).contains(&away), "{away}");
    assert_eq!(of("--path street:frames=12 --draw-ns 0").0, "leave_out");
}

#[test]
fn the_stages_behind_the_frustum_are_weighed_on_maps_and_meshes_too() {
    let of = |more: &str| {
        let line = format!("advise --structure linear,wide --path street:frames=8 {more}");
        let advice = advice(Path::new("."), &line);
        ["occlusion", "back-faces"].map(|name| {
            let rule = rule(&advice, name);
            (rule["decision"].clone(), number(rule, "statistic"))
        })
    };
    // Free drawing is worth no stage, dear drawing is worth one that removes much.
    let dear = of("--scene freedm-map20 --draw-ns 1e7");
    let free = of("--scene freedm-map20 --draw-ns 0");
    for (i, least) in [0.2, 0.2].into_iter().enumerate() {
        assert!(dear[i].0 == "keep" && dear[i].1 > least, "{i} {dear:?}");
        assert!(
            free[i].0 == "leave_out" && free[i].1 == dear[i].1,
            "{i} {free:?}"
        );
    }
    let mesh = of("--scene mesh:spheres:n=40000");
    let shares = mesh.iter().all(|(_, removed)| (0.0..1.0).contains(removed));
    assert!(shares, "{mesh:?}");
}
