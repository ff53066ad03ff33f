//! Claims of vectors that hold, and claims that do not.

use super::*;
use crate::index::Registry;
use crate::stress::{built_in, read_vectors};

#[test]
fn the_built_in_vectors_pass_on_every_structure() {
    let structures = Registry::builtin().structures("all").unwrap();
    let (mut rows, mut refused) = (0, 0);
    for vector in built_in().unwrap() {
        for row in replay(&vector, &structures) {
            assert_ne!(row.status, Status::Fail, "{row:?}");
            rows += 1;
            refused += usize::from(row.status == Status::Refused);
        }
    }
    assert!(
        rows > 200 * structures.len() && refused >= 30,
        "{rows} {refused}"
    );
}

#[test]
fn without_the_epsilon_vectors_fail_at_camera_level() {
    let structures = Registry::builtin().structures("linear").unwrap();
    let replay = Replay {
        structures: &structures,
        planes: PlaneOptions {
            epsilon: 0.0,
            ..PlaneOptions::default()
        },
    };
    let vectors = built_in().unwrap();
    let rows: Vec<Row> = vectors.iter().flat_map(|v| replay.vector(v)).collect();
    let failed = |row: &&Row| row.status == Status::Fail;
    assert!(rows.iter().filter(failed).count() > 10);
    let planes = rows
        .iter()
        .filter(failed)
        .find(|r| r.level == Level::Planes);
    assert!(planes.is_none(), "{planes:?}");
}

#[test]
fn a_touch_that_is_declared_of_a_box_outside_fails() {
    let structures = Registry::builtin().structures("linear").unwrap();
    let failed = |vector: &Vector| -> Vec<String> {
        let rows = replay(vector, &structures).into_iter();
        let failed = rows.filter(|row| row.status == Status::Fail);
        failed.map(|row| row.id).collect()
    };
    let mut declared = 0;
    for vector in built_in().unwrap() {
        let camera = vector.camera.is_none_or(|camera| camera.camera().is_ok());
        if vector.planes_error().is_some() || !camera {
            // Without a volume no list can be checked.
            continue;
        }
        let names: Vec<Name> = vector.sound_boxes().map(|b| b.id.clone()).collect();
        let lists = [
            &vector.expected_visible_planes,
            &vector.expected_visible_camera,
        ];
        for (level, visible) in lists.into_iter().enumerate() {
            let outside = |name: &&Name| !visible.iter().flatten().any(|v| v == *name);
            let (Some(_), Some(name)) = (visible, names.iter().find(outside)) else {
                continue;
            };
            let mut vector = vector.clone();
            let touch = [&mut vector.touch_planes, &mut vector.touch_camera];
            let Some(touch) = touch.into_iter().nth(level).and_then(Option::as_mut) else {
                continue;
            };
            touch.insert(name.clone());
            let wrong = format!("{}/{}", vector.id.0, name.0);
            assert!(failed(&vector).contains(&wrong), "{wrong}");
            // A list of touches is a claim even without a list of visible boxes.
            (
                vector.expected_visible_planes,
                vector.expected_visible_camera,
            ) = (None, None);
            assert!(failed(&vector).contains(&wrong), "{wrong} alone");
            declared += 1;
        }
    }
    assert!(declared > 20, "{declared}");
}

fn failed(text: &str) -> Vec<String> {
    let structures = Registry::builtin().structures("linear").unwrap();
    let vectors = read_vectors(text.as_bytes(), "f.json").unwrap();
    let rows = vectors.iter().flat_map(|v| replay(v, &structures));
    let failed = rows.filter(|row| row.status == Status::Fail);
    failed.map(|row| row.id).collect()
}

#[test]
fn a_touch_that_is_declared_and_not_visible_fails() {
    let wedge = |visible: &str| {
        failed(&format!(
            r#"[{{"id":"v","planes":[[1,0,0,0]],"boxes":[{{"id":"b","lo":[-1,0,0],
            "hi":[0,1,1]}}],"expected_visible_planes":{visible},"touch_planes":["b"]}}]"#
        ))
    };
    assert!(wedge(r#"["b"]"#).is_empty());
    assert_eq!(wedge("[]"), ["v", "v/b"]);
    // The row of visible boxes does not depend on touches.
    let touches = |list: &str| {
        failed(&format!(
            r#"[{{"id":"v","planes":[[1,0,0,0]],"boxes":[{{"id":"b","lo":[-1,0,0],
            "hi":[0,1,1]}}],"expected_visible_planes":["b"],"touch_planes":{list}}}]"#
        ))
    };
    assert_eq!(touches("[]"), ["v/b"]);
}

/// A camera that cannot be made sees nothing and touches nothing.
#[test]
fn a_touch_of_a_refused_camera_fails() {
    let refused = |touched: &str| {
        failed(&format!(
            r#"[{{"id":"v","camera":{{"eye":[0,0,0],"look":[0,0,-1],"up":[0,1,0],"fovy_deg":90,
            "aspect":1,"near":8,"far":4}},"boxes":[{{"id":"b","lo":[-1,-1,-6],"hi":[1,1,-3]}}],
            "expected_visible_camera":[],"touch_camera":{touched}}}]"#
        ))
    };
    assert!(refused("[]").is_empty());
    assert!(!refused(r#"["b"]"#).is_empty());
}

#[test]
fn boxes_that_are_declared_empty_are_inverted() {
    let text = r#"[{"id":"v","boxes":[{"id":"b","lo":[0,0,0],"hi":[1,1,1]},
        {"id":"inv","lo":[0,0,0],"hi":[1,-1,1]}],"expect_empty_boxes":["b","inv","none"]}]"#;
    assert_eq!(failed(text), ["v/b", "v/none"]);
    assert_eq!(
        failed(&text.replace(r#","inv","none"]"#, r#","none"]"#)),
        ["v/b", "v/inv", "v/none"]
    );
}

/// Planes of `planes_f32_hex`, one of which is no constraint.
#[test]
fn claims_about_planes_and_names_are_judged() {
    let fails = |claims: &str| {
        failed(&format!(
            r#"[{{"id":"v","planes":[[1,0,0,0],[0,0,0,1]],"planes_f32_hex":[["0x3f800000",
            "0x00000000","0x00000000","0x00000000"],["0x00000000","0x00000000",
            "0x00000000","0x3f800000"]],"boxes":[{{"id":"b","lo":[0,0,0],"hi":[1,1,1]}}],
            {claims}}}]"#
        ))
    };
    for (claims, wanted) in [
        (r#""degenerate_planes":[1]"#, ""),
        (r#""degenerate_planes":[]"#, "v/degenerate_planes"),
        (r#""degenerate_planes":[0,1]"#, "v/degenerate_planes"),
        (r#""touch_planes":["c"],"expect_planes_error":"no""#, "v/c"),
        (r#""observed_f32_pvertex_fma":["c"]"#, "v/c"),
    ] {
        let failed = fails(claims);
        let is_right = wanted.is_empty() == failed.is_empty();
        let is_named = wanted.is_empty() || failed.iter().any(|id| id == wanted);
        assert!(is_right && is_named, "{claims}: {failed:?}");
    }
    let other = r#"[{"id":"v","planes":[[2,0,0,0]],"planes_f32_hex":[["0x3f800000",
        "0x00000000","0x00000000","0x00000000"]],"boxes":[]}]"#;
    assert_eq!(failed(other), ["v/planes"]);
}

#[test]
fn the_f32_test_is_held_to_no_exact_answer() {
    let mut judged = 0;
    for mut vector in built_in().unwrap() {
        let (observed, exact) = (
            vector.observed_f32_pvertex_mul_add.take(),
            &vector.p_vertex_exact_visible,
        );
        if observed.as_ref() == exact.as_ref() {
            continue;
        }
        let structures = Registry::builtin().structures("linear").unwrap();
        let rows = replay(&vector, &structures);
        assert!(
            rows.iter().all(|row| row.status != Status::Fail),
            "{rows:?}"
        );
        judged += 1;
    }
    assert!(judged > 0);
}

#[test]
fn a_lens_that_is_narrower_than_the_oracle_carries_fails_nothing() {
    let seen = |fovy: &str, aspect: &str, visible: &str| {
        failed(&format!(
            r#"[{{"id":"v","camera":{{"eye":[0,0,0],"look":[0,0,-1],"up":[0,1,0],
            "fovy_deg":{fovy},"aspect":{aspect},"near":1,"far":8}},"boxes":[{{"id":"b",
            "lo":[-1,-1,-4],"hi":[1,1,-2]}}],"expected_visible_camera":{visible},
            "touch_camera":[]}}]"#
        ))
    };
    for (fovy, aspect) in [("1e-9", "1"), ("1e-46", "1"), ("90", "1e-50"), ("90", "1")] {
        assert!(seen(fovy, aspect, r#"["b"]"#).is_empty(), "{fovy} {aspect}");
        assert!(seen(fovy, aspect, "[]").contains(&"v/b".to_owned()));
    }
}

#[test]
fn the_six_plane_test_fused_and_without_rounding_is_judged() {
    let structures = Registry::builtin().structures("linear").unwrap();
    let named = |rows: &[Row]| -> Vec<Status> {
        let test = CullingTest::SixPlane.name();
        let exact = rows
            .iter()
            .filter(|row| row.test == test && row.structure == ORACLE);
        exact.map(|row| row.status).collect()
    };
    let mut differ = [0; 2];
    for mut vector in built_in().unwrap() {
        let Some(exact) = vector.p_vertex_exact_visible.clone() else {
            continue;
        };
        let unfused = vector.observed_f32_pvertex_mul_add.as_ref();
        differ[0] += u32::from(unfused != Some(&exact));
        differ[1] += u32::from(unfused != vector.observed_f32_pvertex_fma.as_ref());
        let passed = named(&replay(&vector, &structures));
        assert!(passed.iter().all(|&status| status == Status::Pass));
        if passed.is_empty() {
            continue;
        }
        let wrong = Some(Names::from([Name("no box".to_owned())]));
        vector.p_vertex_exact_visible = wrong.clone();
        let one = [Status::Fail, Status::Pass];
        assert_eq!(named(&replay(&vector, &structures)), one);
        vector.observed_f32_pvertex_fma = wrong;
        assert_eq!(named(&replay(&vector, &structures)), [Status::Fail; 2]);
    }
    assert_eq!(differ, [6, 6], "vectors whose f32 answer is another one");
}
