//! Which end of depth is near: every lens, hand of the world and clip space.

use cullbench::camera::{ClipSpace, Lens};
use glam::{DMat4, DVec3};
use serde_json::Value;

use super::EYE_LOOK;
use super::matrices::{camera, counts, csv, matrix};
use super::process::*;

/// Each hand and clip space, by its name and by that of the other end of depth.
#[test]
fn each_convention_says_which_end_is_near() {
    let folder = folder(&[]);
    let write = |name: &str, text: String| {
        std::fs::write(folder.path().join(name), text).expect("writable");
    };
    let (eye, look) = ([-20.0, 3.0, 30.0], [0.0, 0.0, 5.0]);
    let perspective = |far| Lens::perspective(50.0, 1.5, 1.0, far).expect("a lens");
    for (lens, written) in [
        (perspective(Some(400.0)), "50,,1.5,1,400"),
        (perspective(None), "50,,1.5,1,inf"),
        (
            Lens::orthographic(30.0, 1.5, 0.0, 399.0).expect("a lens"),
            ",30,1.5,0,399",
        ),
    ] {
        let parallel = lens.is_orthographic();
        let header = format!("{EYE_LOOK},fovy_deg,ortho_height,aspect,near,far\n");
        write("eye.csv", format!("{header}-20,3,30,0,0,5,{written}\n"));
        let scene = "city:n=150";
        let query = |cameras: &str| {
            let line = format!("query --scene {scene} --cameras {cameras} --structure bvh --ids");
            rows(&works(folder.path(), &line))[0]["visible_ids"].clone()
        };
        let wanted = counts(folder.path(), scene, "eye.csv", "column-gl");
        let seen = query("eye.csv");
        let own = camera(eye, look, lens);
        for (clip, turned, name, depth) in [
            (ClipSpace::OpenGl, 1.0, "column-gl", [-1.0, 1.0]),
            (ClipSpace::OpenGl, -1.0, "column-gl-reversed", [1.0, -1.0]),
            (ClipSpace::D3d, 1.0, "column-d3d", [0.0, 1.0]),
            (ClipSpace::ReversedZ, 1.0, "column-d3d-reversed", [1.0, 0.0]),
        ] {
            for hand in [1.0, -1.0] {
                let change = DMat4::from_scale(DVec3::new(hand, 1.0, turned));
                write("m.csv", csv([change * matrix(&own, clip)].into_iter()));
                let other = match name.strip_suffix("-reversed") {
                    Some(plain) => plain.to_owned(),
                    None => format!("{name}-reversed"),
                };
                for named in [name, &other] {
                    let what = format!("{lens:?} {name} read as {named}, hand {hand}");
                    let is_swapped = parallel && named != name;
                    let [near, far] = depth;
                    let line = format!("m.csv --matrix-convention {named}");
                    assert_eq!(query(&line), seen, "{what}");
                    let info = format!("scene info {scene} --path {line} --format json");
                    let info = json(&works(folder.path(), &info));
                    let lens = &info["cameras"]["lens"];
                    let found = &lens["matrix"];
                    let shown = if is_swapped { [far, near] } else { depth };
                    assert_eq!(found["depth"], serde_json::json!(shown), "{what}");
                    assert_eq!(found["is_orthographic"], parallel, "{what}");
                    let down = found["forward"][2].as_f64().expect("a number");
                    assert_eq!(down > 0.0, is_swapped, "{what}");
                    assert_eq!(found["is_mirrored"], (hand < 0.0) != is_swapped, "{what}");
                    let depths = [&lens["near"][0], &lens["far"][0]].map(Value::as_f64);
                    let ends = [Some(own.lens.near()), own.lens.far()];
                    let is_off = |(a, b): (&Option<f64>, &Option<f64>)| match (a, b) {
                        (Some(a), Some(b)) => (a - b).abs() > 1e-9,
                        (a, b) => a != b,
                    };
                    assert!(!depths.iter().zip(&ends).any(is_off), "{what}: {depths:?}");
                    let told = info["cameras"]["warnings"].to_string();
                    let advice = format!("not looking down; --matrix-convention {name} if near");
                    assert_eq!(told.contains(&advice), is_swapped, "{what}: {told}");
                    if !is_swapped {
                        let found = counts(folder.path(), scene, "m.csv", named);
                        assert_eq!(found, wanted, "{what}");
                    }
                }
            }
        }
    }
    let line = "scene info city:n=150 --path m.csv --matrix-convention column-d3d-reversed";
    let told = works(folder.path(), line).replace(['\n', ' '], "");
    let wanted = "thefirst:depth1to0bythisname,mirrored,centreofthenearplane(aseye)(-20,3,30)";
    assert!(told.contains(wanted), "{told}");
}
