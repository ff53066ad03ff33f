//! The oracle against the verified vectors, planes level and camera level.

use std::collections::BTreeSet;

use cullbench::camera::Lens;
use cullbench::geometry::{Aabb, ConvexVolume, Plane};
use cullbench::oracle::{Oracle, Pose, Verdict};
use glam::{DVec3, Vec3};
use serde_json::Value;

fn number(value: &Value) -> f64 {
    match value.as_str() {
        None => value.as_f64().unwrap(),
        Some("NaN") => f64::NAN,
        Some("Infinity" | "inf") => f64::INFINITY,
        Some(_) => f64::NEG_INFINITY,
    }
}

fn numbers(value: &Value) -> DVec3 {
    let all: Vec<f64> = value.as_array().unwrap().iter().map(number).collect();
    DVec3::from_slice(&all)
}

#[test]
fn all_vectors() {
    let file: Value = serde_json::from_str(include_str!("../data/vectors.json")).unwrap();
    let mut failures = Vec::new();
    for v in file["vectors"].as_array().unwrap() {
        let id = v["id"].as_str().unwrap();
        let set = |f: &str| -> BTreeSet<&str> {
            v[f].as_array()
                .into_iter()
                .flatten()
                .map(|s| s.as_str().unwrap())
                .collect()
        };
        let boxes: Vec<(&str, Aabb)> = v["boxes"]
            .as_array()
            .unwrap()
            .iter()
            .map(|b| {
                (
                    b["id"].as_str().unwrap(),
                    Aabb::new(numbers(&b["lo"]).as_vec3(), numbers(&b["hi"]).as_vec3()),
                )
            })
            .filter(|(_, b)| b.is_finite())
            .collect();
        let mut check = |level: &str,
                         oracle: &Oracle,
                         visible: BTreeSet<&str>,
                         touch: BTreeSet<&str>| {
            for (name, b) in &boxes {
                let wanted = if touch.contains(name) {
                    Verdict::Touch
                } else if visible.contains(name) {
                    Verdict::In
                } else {
                    Verdict::Out
                };
                let found = oracle.judge(b);
                let margin = &v[format!("margin_{level}")][name];
                if found.verdict != wanted {
                    failures.push(format!("{id}/{name} {level}: {found:?}, wanted {wanted:?}, margin {margin}, depth {}", oracle.depth(b)));
                }
            }
        };
        if v.get("planes_f32_hex").is_some() {
            let bits = |t: &Value| {
                f32::from_bits(u32::from_str_radix(&t.as_str().unwrap()[2..], 16).unwrap())
            };
            let planes: Vec<Plane> = v["planes_f32_hex"]
                .as_array()
                .unwrap()
                .iter()
                .map(|r| {
                    Plane::new(
                        Vec3::new(bits(&r[0]), bits(&r[1]), bits(&r[2])),
                        bits(&r[3]),
                    )
                })
                .collect();
            if let Ok(volume) = ConvexVolume::from_planes(&planes) {
                check(
                    "planes",
                    &Oracle::of_volume(&volume),
                    set("expected_visible_planes"),
                    set("touch_planes"),
                );
            }
        }
        if v.get("expected_visible_camera").is_some() {
            let c = &v["camera"];
            let far = number(&c["far"]);
            let Ok(lens) = Lens::perspective(
                number(&c["fovy_deg"]),
                number(&c["aspect"]),
                number(&c["near"]),
                far.is_finite().then_some(far),
            ) else {
                println!("{id}: lens refused");
                continue;
            };
            let pose = Pose::LookAt {
                eye: numbers(&c["eye"]),
                look: numbers(&c["look"]),
                up: numbers(&c["up"]),
            };
            let oracle = Oracle::of_camera(&pose, &lens, DVec3::ZERO).unwrap();
            check(
                "camera",
                &oracle,
                set("expected_visible_camera"),
                set("touch_camera"),
            );
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}
