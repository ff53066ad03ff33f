//! Test vectors on structures: the given planes bit for bit, the camera through
//! the default pipeline, points, and boxes that must be refused.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec3, Vec3};

use super::sheet::{Built, ORACLE, Sheet, slack};
use super::{Level, Name, Names, Row, Said, Status, Vector, VectorBox, VectorCamera};
use crate::camera::{CameraError, PlaneOptions, Surroundings};
use crate::culling::{Culling, CullingError, CullingTest, TESTS};
use crate::geometry::{Aabb, ConvexVolume};
use crate::index::{BuildError, DynIndex, StructureSpec};
use crate::oracle::Oracle;
use crate::verify::explain_visibility;

/// Checks one vector on all structures with the default planes.
pub fn replay(vector: &Vector, structures: &[StructureSpec]) -> Vec<Row> {
    Replay {
        structures,
        planes: PlaneOptions::default(),
    }
    .vector(vector)
}

/// Structures and planes that vectors are checked with.
///
/// Without the default planes (an epsilon of zero, say) failures are expected: tests of
/// the suite use it.
#[derive(Clone, Copy)]
pub struct Replay<'a> {
    /// Structures that are queried.
    pub structures: &'a [StructureSpec],
    /// Derivation of the planes of cameras.
    pub planes: PlaneOptions,
}

impl Replay<'_> {
    /// All rows of a vector: O(structures * tests) of them.
    pub fn vector(&self, vector: &Vector) -> Vec<Row> {
        let sound = vector.sound_boxes().map(|b| (b.id.clone(), b.bounds()));
        let (names, items): (Vec<Name>, Vec<Aabb>) = sound.unzip();
        let places = names.iter().zip(0..).collect();
        let sheet = |level| Sheet {
            vector,
            level,
            names: &names,
            items: &items,
            places: &places,
            rows: Vec::new(),
        };
        let (mut planes, mut camera) = (sheet(Level::Planes), sheet(Level::Camera));
        let built = self.built(&items);
        let given = vector.planes();
        if let Some(given) = &given {
            let volume = ConvexVolume::from_planes(given);
            given_planes(&mut planes, volume.map_err(|e| e.to_string()), &built);
        }
        points(&mut planes, &built);
        if let Some(stated) = &vector.camera {
            self.camera(&mut camera, stated, &built);
        }
        let at_load = match given {
            Some(_) => &mut planes,
            None => &mut camera,
        };
        self.rejected(at_load);
        claims(at_load);
        planes.unknown_names();
        camera.unknown_names();
        [planes.rows, camera.rows].concat()
    }

    fn built(&self, items: &[Aabb]) -> Vec<Built<'_>> {
        let build = |spec: &StructureSpec| spec.build(items);
        let specs = self.structures.iter();
        specs.map(|s| (s.label.as_str(), build(s))).collect()
    }

    /// Builds that must fail: each rejected box among some sound ones, and the
    /// first of them among all boxes.
    fn rejected(&self, sheet: &mut Sheet) {
        let vector = sheet.vector;
        let all: Vec<Aabb> = vector.boxes().map(VectorBox::bounds).collect();
        let places: BTreeMap<&Name, usize> = vector.boxes().map(|b| &b.id).zip(0..).collect();
        let is_bad = |b: &Aabb| !b.is_finite();
        for name in vector.expect_rejected_at_load.iter().flatten() {
            let mut scenes = Vec::new();
            if let Some(&index) = places.get(name) {
                let mut scene = sheet.items[..sheet.items.len().min(BESIDE)].to_vec();
                let item = index.min(scene.len());
                scene.insert(item, all[index]);
                scenes.push((scene, item));
                if all.iter().position(is_bad) == Some(index) {
                    scenes.push((all.clone(), index));
                }
            }
            for spec in self.structures {
                let build = |(scene, item): &(Vec<Aabb>, usize)| refused(spec.build(scene), *item);
                let refusals: Result<Vec<String>, String> = scenes.iter().map(build).collect();
                let (status, got) = match refusals {
                    Ok(texts) => match texts.into_iter().next() {
                        Some(text) => (Status::Refused, text),
                        None => (Status::Fail, "no such box".to_owned()),
                    },
                    Err(text) => (Status::Fail, text),
                };
                let expected = format!("refused at load: {}", name.0);
                sheet.row(Some(name), [&spec.label, "build"], status, expected, got);
            }
        }
    }

    fn camera(&self, sheet: &mut Sheet, stated: &VectorCamera, boxes: &[Built]) {
        let vector = sheet.vector;
        let around = Surroundings::of_boxes(sheet.items);
        let camera = stated.camera().map_err(CullingError::from);
        let sound = camera.as_ref().ok();
        let sound = sound.filter(|_| vector.camera_error().is_none());
        let oracle = sound.and_then(|c| Oracle::of_camera(&stated.pose(), &c.lens, DVec3::ZERO));
        // The oracle decides what is visible if the file does not say it.
        let truth = oracle.as_ref().map(|oracle| sheet.seen_by(oracle));
        let listed = vector.expected_visible_camera.clone();
        let wanted = listed.or(truth).unwrap_or_default();
        let cubes = self.built(&CullingTest::Sphere.items(sheet.items));
        for (test, name, _) in TESTS {
            let structures = match test {
                CullingTest::Sphere => &cubes[..],
                _ => boxes,
            };
            let culling = Culling {
                test,
                planes: self.planes,
                ..Culling::default()
            };
            let view = camera.clone();
            let view = view.and_then(|camera| culling.view(&camera, &around));
            let declared = match (vector.camera_error(), &view) {
                (Some(text), _) => Some(text.into()),
                (None, Err(CullingError::Camera(CameraError::Sums { .. }))) => {
                    Some("a view or, where sums could overflow, a refusal".into())
                }
                // A camera that cannot be made sees nothing.
                (None, Err(_)) if wanted.is_empty() && vector.expected_visible_camera.is_some() => {
                    Some(Said::of_names(&wanted))
                }
                _ => None,
            };
            let otherwise = Said::of_names(&wanted);
            let Some(view) = accepted(
                sheet,
                [name, "a camera"],
                view.map_err(|e| e.to_string()),
                declared,
                otherwise,
                structures,
            ) else {
                continue;
            };
            let exact = oracle.as_ref().zip(sound);
            let exact = exact.filter(|_| test == CullingTest::Exact);
            // More than is wanted may come; of the exact test, only within its margin.
            let fault = |b: &Aabb, is_wanted: bool| match (exact, is_wanted) {
                (None, true) => Some("dropped".to_owned()),
                (None, false) => None,
                (Some((oracle, _)), true) => Some(format!("dropped, {:e} deep", oracle.depth(b))),
                (Some((oracle, camera)), false) => {
                    let (away, slack) = (-oracle.depth(b), slack(camera, &around, b));
                    let text = format!("returned, {away:e} away; the margin is {slack:e}");
                    (away > slack).then_some(text)
                }
            };
            for (structure, built) in structures {
                let answer = sheet.query(built, view.as_any(), |_| true);
                sheet.compared([structure, name], &wanted, &answer, fault);
            }
        }
        if let Some(oracle) = &oracle {
            sheet.verdicts(
                oracle,
                &vector.expected_visible_camera,
                &vector.touch_camera,
            );
        }
    }
}

/// Sound boxes beside one that must be rejected.
const BESIDE: usize = 64;

/// Adds rows of what a file says about its own planes and empty boxes.
fn claims(sheet: &mut Sheet) {
    let vector = sheet.vector;
    let mut row = |about: &Name, expected: Said, got: Said| {
        let status = match expected == got {
            true => Status::Pass,
            false => Status::Fail,
        };
        let subject = [ORACLE, CullingTest::Exact.name()];
        sheet.row(Some(about), subject, status, expected, got);
    };
    if !vector.planes_agree() {
        let about = Name("planes".to_owned());
        row(&about, "planes_f32_hex".into(), "other numbers".into());
    }
    if let Some(wanted) = &vector.degenerate_planes {
        // The format's generator counts finite planes only.
        let planes = vector.planes().unwrap_or_default().into_iter();
        let finite = planes.filter(|p| p.normal.is_finite() && p.d.is_finite());
        let zero = finite.zip(0..).filter(|(p, _)| p.normal == Vec3::ZERO);
        let found: Names = zero.map(|(_, n): (_, u32)| Name(n.to_string())).collect();
        let about = Name("degenerate_planes".to_owned());
        row(&about, Said::of_names(wanted), Said::of_names(&found));
    }
    let boxes = vector.boxes().map(|b| (&b.id, b.bounds().is_empty()));
    let boxes: BTreeMap<&Name, bool> = boxes.collect();
    let sound = vector.sound_boxes().map(|b| &b.id);
    let inverted: BTreeSet<&Name> = sound.filter(|name| boxes[name]).collect();
    let listed = vector.expect_empty_boxes.iter();
    for names in listed.map(|names| names.iter().collect::<BTreeSet<&Name>>()) {
        let said = |is_inverted| {
            if is_inverted {
                "inverted"
            } else {
                "not inverted"
            }
        };
        for name in &names | &inverted {
            let got = boxes.get(name).map_or("no such box", |&is| said(is));
            row(name, said(names.contains(name)).into(), got.into());
        }
    }
}

/// Message of a build that must refuse this item, or what happened instead.
fn refused(built: Result<Box<dyn DynIndex>, BuildError>, wanted: usize) -> Result<String, String> {
    match built {
        Err(error @ BuildError::NonFiniteItem { item, .. }) if item == wanted => {
            Ok(error.to_string())
        }
        Err(other) => Err(other.to_string()),
        Ok(_) => Err("built with this box in it".to_owned()),
    }
}

/// Returns the volume if it exists and should, else adds a row for each structure.
///
/// `declared` is the declared refusal, `otherwise` the expected outcome without one.
fn accepted<V>(
    sheet: &mut Sheet,
    [test, kind]: [&str; 2],
    volume: Result<V, String>,
    declared: Option<Said>,
    otherwise: Said,
    structures: &[Built],
) -> Option<V> {
    let (status, got) = match (volume, &declared) {
        (Ok(volume), None) => return Some(volume),
        (Ok(_), Some(_)) => (Status::Fail, format!("accepted as {kind}")),
        (Err(error), Some(_)) => (Status::Refused, error),
        (Err(error), None) => (Status::Fail, error),
    };
    let expected = declared.unwrap_or(otherwise);
    for (structure, _) in structures {
        sheet.row(
            None,
            [structure, test],
            status,
            expected.clone(),
            got.clone(),
        );
    }
    None
}

fn given_planes(sheet: &mut Sheet, volume: Result<ConvexVolume, String>, built: &[Built]) {
    let vector = sheet.vector;
    let test = CullingTest::SixPlane.name();
    let declared = vector.planes_error().map(Said::from);
    let Some(volume) = accepted(
        sheet,
        [test, "planes"],
        volume,
        declared,
        "planes".into(),
        built,
    ) else {
        return;
    };
    let scalar = || sheet.names_of(|b| volume.sees(b));
    let observed = vector.observed_f32_pvertex_mul_add.clone();
    let wanted = observed.unwrap_or_else(scalar);
    for (structure, built) in built {
        let answer = sheet.query(built, (&volume).into(), |_| true);
        let explain = |b: &Aabb, _| Some(explain_visibility(b, &volume));
        sheet.compared([structure, test], &wanted, &answer, explain);
    }
    sheet.without_rounding(&volume);
    let oracle = Oracle::of_volume(&volume);
    sheet.verdicts(
        &oracle,
        &vector.expected_visible_planes,
        &vector.touch_planes,
    );
}

/// Region search. Boxes are f32, so that a point of f64 may find too many of them:
/// only those that hold the point as written count.
fn points(sheet: &mut Sheet, built: &[Built]) {
    let vector = sheet.vector;
    for (structure, built) in built {
        for point in vector.points() {
            let (p, wanted) = (point.p(), &point.expected_containing);
            let holds = |b: &Aabb| {
                let (min, max) = (b.min.as_dvec3(), b.max.as_dvec3());
                p.cmpge(min).all() && p.cmple(max).all()
            };
            let answer = sheet.query(built, p.as_vec3().into(), holds);
            let is_right = answer.iter().flatten().eq(wanted) && answer.is_ok();
            let subject = [*structure, "locate"];
            sheet.answered(Some(&point.id), subject, is_right, wanted, &answer);
        }
    }
}

#[cfg(test)]
mod tests {
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
                // Without a volume nothing is judged.
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
                // A list of touches is a claim without one of what is visible.
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

    /// The planes of `planes_f32_hex`, and one that is no constraint.
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
    fn the_six_plane_test_without_rounding_is_judged_beside_the_one_in_f32() {
        let structures = Registry::builtin().structures("linear").unwrap();
        let named = |rows: &[Row]| -> Vec<Status> {
            let test = CullingTest::SixPlane.name();
            let exact = rows
                .iter()
                .filter(|row| row.test == test && row.structure == ORACLE);
            exact.map(|row| row.status).collect()
        };
        let mut differ = 0;
        for mut vector in built_in().unwrap() {
            let Some(exact) = vector.p_vertex_exact_visible.clone() else {
                continue;
            };
            differ += u32::from(vector.observed_f32_pvertex_mul_add.as_ref() != Some(&exact));
            let passed = named(&replay(&vector, &structures));
            assert!(passed.iter().all(|&status| status == Status::Pass));
            if passed.is_empty() {
                continue;
            }
            vector.p_vertex_exact_visible = Some(Names::from([Name("no box".to_owned())]));
            assert_eq!(named(&replay(&vector, &structures)), [Status::Fail]);
        }
        assert_eq!(differ, 6, "vectors whose f32 answer is another one");
    }
}
