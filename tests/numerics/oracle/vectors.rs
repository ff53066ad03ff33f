//! The oracle against the verified vectors, at planes level and at camera
//! level: every box of every vector.

use std::collections::BTreeSet;

use cullbench::camera::Lens;
use cullbench::geometry::{Aabb, ConvexVolume, Plane};
use cullbench::oracle::{Oracle, Pose, Verdict};
use glam::{DVec3, Vec3};
use serde_json::Value;

fn vectors() -> Vec<Value> {
    let text = include_str!("../../../datasets/vectors.json");
    let file: Value = serde_json::from_str(text).expect("vectors.json");
    file["vectors"].as_array().expect("vectors").clone()
}

fn number(value: &Value) -> f64 {
    match value.as_str() {
        None => value.as_f64().expect("a number"),
        Some("NaN") => f64::NAN,
        Some("Infinity" | "inf") => f64::INFINITY,
        Some(_) => f64::NEG_INFINITY,
    }
}

fn list(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

fn numbers(value: &Value) -> DVec3 {
    let all: Vec<f64> = list(value).iter().map(number).collect();
    DVec3::from_slice(&all)
}

fn bits(value: &Value) -> f32 {
    let hex = value
        .as_str()
        .expect("hexadecimal")
        .trim_start_matches("0x");
    f32::from_bits(u32::from_str_radix(hex, 16).expect("hexadecimal"))
}

/// All boxes whose verdict at `level` is not the vector's; how many there were.
fn compare(vector: &Value, level: &str, oracle: &Oracle, failures: &mut Vec<String>) -> usize {
    let names = |field: String| -> BTreeSet<&str> {
        list(&vector[field])
            .iter()
            .filter_map(Value::as_str)
            .collect()
    };
    let visible = names(format!("expected_visible_{level}"));
    let touching = names(format!("touch_{level}"));
    let mut count = 0;
    for stated in list(&vector["boxes"]) {
        let name = stated["id"].as_str().expect("a name");
        let (low, high) = (numbers(&stated["lo"]), numbers(&stated["hi"]));
        let b = Aabb::new(low.as_vec3(), high.as_vec3());
        if !b.is_finite() {
            continue; // Refused when a scene is loaded.
        }
        let wanted = match (visible.contains(name), touching.contains(name)) {
            (true, false) => Verdict::In,
            (true, true) => Verdict::Touch,
            (false, _) => Verdict::Out,
        };
        let found = oracle.classify(&b);
        let undecided = level == "camera" && wanted == Verdict::Touch;
        if found.verdict != wanted || found.undecided != undecided {
            failures.push(format!(
                "{}/{name}, {level}: {found:?}, wanted {wanted:?}; depth {}, stated {}",
                vector["id"],
                oracle.depth(&b),
                vector[format!("margin_{level}")][name]
            ));
        }
        count += 1;
    }
    count
}

#[test]
fn all_vectors_at_planes_level() {
    let (mut failures, mut count) = (Vec::new(), 0);
    for vector in vectors() {
        let planes: Vec<Plane> = list(&vector["planes_f32_hex"])
            .iter()
            .map(|row| {
                let [x, y, z, d] = [0, 1, 2, 3].map(|k| bits(&row[k]));
                Plane::new(Vec3::new(x, y, z), d)
            })
            .collect();
        // Planes that are not finite are refused, as other tests show.
        let finite = planes.iter().all(Plane::is_finite);
        if planes.is_empty() || !finite {
            continue;
        }
        let volume = ConvexVolume::from_planes(&planes).expect("finite planes");
        count += compare(
            &vector,
            "planes",
            &Oracle::of_volume(&volume),
            &mut failures,
        );
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    assert!(count >= PLANES_BOXES, "{count}");
}

#[test]
fn all_vectors_at_camera_level() {
    let (mut failures, mut count) = (Vec::new(), 0);
    for vector in vectors() {
        let refused = vector["expect_camera_error"].is_string();
        if vector["expected_visible_camera"].is_null() && !refused {
            continue;
        }
        let camera = &vector["camera"];
        let get = |name: &str| number(&camera[name]);
        let far = get("far");
        let far = far.is_finite().then_some(far);
        let lens = Lens::perspective(get("fovy_deg"), get("aspect"), get("near"), far);
        let pose = Pose::LookAt {
            eye: numbers(&camera["eye"]),
            look: numbers(&camera["look"]),
            up: numbers(&camera["up"]),
        };
        let oracle = lens
            .ok()
            .and_then(|lens| Oracle::of_camera(&pose, &lens, DVec3::ZERO));
        match oracle {
            Some(oracle) if !refused => {
                count += compare(&vector, "camera", &oracle, &mut failures);
            }
            // No camera: refused, or nothing that it could see.
            oracle => assert!(
                oracle.is_none() && list(&vector["expected_visible_camera"]).is_empty(),
                "{}",
                vector["id"]
            ),
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    assert!(count >= CAMERA_BOXES, "{count}");
}

/// Minimum number of boxes in the file.
const PLANES_BOXES: usize = 672;
const CAMERA_BOXES: usize = 656;
