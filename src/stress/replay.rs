//! Checks of test vectors on structures.
//!
//! The given planes bit for bit, the camera through the default pipeline, points, and boxes that
//! must be refused.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec3, Vec3};

use super::level_results::{Built, LevelResults, ORACLE, sees_exactly, sees_fused, slack};
use super::{Answer, Level, Name, Names, Row, Status, Vector, VectorBox, VectorCamera};
use crate::camera::{CameraError, PlaneOptions, Surroundings};
use crate::culling::{Arithmetic, Culling, CullingError, CullingTest, TESTS};
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

/// Structures and planes for checking vectors.
///
/// With other planes than the default (an epsilon of zero, say) failures are expected: tests of the
/// suite use this.
#[derive(Clone, Copy)]
pub struct Replay<'a> {
    /// Structures under test.
    pub structures: &'a [StructureSpec],
    /// Derivation of the planes of cameras.
    pub planes: PlaneOptions,
}

impl Replay<'_> {
    /// Checks a vector; returns O(structures * tests) rows.
    pub fn vector(&self, vector: &Vector) -> Vec<Row> {
        let sound = vector.sound_boxes().map(|b| (b.id.clone(), b.bounds()));
        let (names, items): (Vec<Name>, Vec<Aabb>) = sound.unzip();
        let indices = names.iter().zip(0..).collect();
        let results = |level| LevelResults {
            vector,
            level,
            names: &names,
            items: &items,
            indices: &indices,
            rows: Vec::new(),
        };
        let (mut planes, mut camera) = (results(Level::Planes), results(Level::Camera));
        let built = self.build_all(&items);
        let given = vector.planes();
        if let Some(given) = &given {
            let volume = ConvexVolume::from_planes(given);
            check_planes(&mut planes, volume.map_err(|e| e.to_string()), &built);
        }
        check_points(&mut planes, &built);
        if let Some(stated) = &vector.camera {
            self.camera(&mut camera, stated, &built);
        }
        let at_load = match given {
            Some(_) => &mut planes,
            None => &mut camera,
        };
        self.check_rejections(at_load);
        check_claims(at_load);
        planes.add_unknown_names();
        camera.add_unknown_names();
        [planes.rows, camera.rows].concat()
    }

    fn build_all(&self, items: &[Aabb]) -> Vec<Built<'_>> {
        let build = |spec: &StructureSpec| spec.build(items);
        let specs = self.structures.iter();
        specs.map(|s| (s.label.as_str(), build(s))).collect()
    }

    /// Checks builds that must fail.
    ///
    /// Each rejected box is built among some sound ones, and the first non-finite one among all
    /// boxes.
    fn check_rejections(&self, results: &mut LevelResults) {
        let vector = results.vector;
        let all: Vec<Aabb> = vector.boxes().map(VectorBox::bounds).collect();
        let indices: BTreeMap<&Name, usize> = vector.boxes().map(|b| &b.id).zip(0..).collect();
        let is_bad = |b: &Aabb| !b.is_finite();
        for name in vector.expect_rejected_at_load.iter().flatten() {
            let mut scenes = Vec::new();
            if let Some(&index) = indices.get(name) {
                let mut scene = results.items[..results.items.len().min(NEIGHBOURS)].to_vec();
                let item = index.min(scene.len());
                scene.insert(item, all[index]);
                scenes.push((scene, item));
                if all.iter().position(is_bad) == Some(index) {
                    scenes.push((all.clone(), index));
                }
            }
            for spec in self.structures {
                let build = |(scene, item): &(Vec<Aabb>, usize)| refusal(spec.build(scene), *item);
                let refusals: Result<Vec<String>, String> = scenes.iter().map(build).collect();
                let (status, got) = match refusals.map(|texts| texts.into_iter().next()) {
                    Ok(Some(text)) => (Status::Refused, text),
                    Ok(None) => (Status::Fail, "no such box".to_owned()),
                    Err(text) => (Status::Fail, text),
                };
                let expected = format!("refused at load: {}", name.0);
                results.add_row(Some(name), [&spec.label, "build"], status, expected, got);
            }
        }
    }

    fn camera(&self, results: &mut LevelResults, stated: &VectorCamera, boxes: &[Built]) {
        let vector = results.vector;
        let around = Surroundings::of_boxes(results.items);
        let camera = stated.camera().map_err(CullingError::from);
        let sound = camera.as_ref().ok();
        let sound = sound.filter(|_| vector.camera_error().is_none());
        let oracle = sound.and_then(|c| Oracle::of_camera(&stated.pose(), &c.lens, DVec3::ZERO));
        // The oracle decides what is visible if the file does not state it.
        let truth = oracle.as_ref().map(|oracle| results.visible_to(oracle));
        let listed = &vector.expected_visible_camera;
        let wanted = listed.clone().or(truth).unwrap_or_default();
        let mut touched = vector.touch_camera.iter().flatten();
        let sees_nothing = wanted.is_empty() && listed.is_some() && touched.next().is_none();
        let cubes = self.build_all(&CullingTest::Sphere.items(results.items));
        for (test, name, _) in TESTS {
            let structures = match test {
                CullingTest::Sphere => &cubes[..],
                _ => boxes,
            };
            let culling = Culling::new(test, Arithmetic::F32, self.planes);
            let camera = camera.clone();
            let view = camera.and_then(|camera| culling.view(&camera, &around));
            let declared = match (vector.camera_error(), &view) {
                (Some(text), _) => Some(text.into()),
                (None, Err(CullingError::Camera(CameraError::Sums { .. }))) => {
                    Some("a view or, where sums could overflow, a refusal".into())
                }
                // A camera that cannot be made sees nothing.
                (None, Err(_)) if sees_nothing => Some(Answer::of_names(&wanted)),
                _ => None,
            };
            let (view, visible) = (view.map_err(|e| e.to_string()), Answer::of_names(&wanted));
            let subject = [name, "a camera"];
            let Some(view) = accept(results, subject, view, declared, visible, structures) else {
                continue;
            };
            let exact = oracle.as_ref().zip(sound);
            let exact = exact.filter(|_| test == CullingTest::Exact);
            // Extra boxes are allowed; for the exact test, only within its margin.
            let fault = |b: &Aabb, is_wanted: bool| match (exact, is_wanted) {
                (None, true) => Some("dropped".to_owned()),
                (None, false) => None,
                (Some((oracle, _)), true) => Some(match oracle.depth(b) {
                    away if away < 0.0 => format!("dropped, {:e} away", -away),
                    depth => format!("dropped, {depth:e} deep"),
                }),
                (Some((oracle, camera)), false) => {
                    let (away, slack) = (-oracle.depth(b), slack(camera, &around, b));
                    let text = format!("returned, {away:e} away; the margin is {slack:e}");
                    (away > slack).then_some(text)
                }
            };
            for (structure, built) in structures {
                let answer = results.query(built, view.as_any(), |_| true);
                results.add_comparison([structure, name], &wanted, &answer, fault);
            }
        }
        if let Some(oracle) = &oracle {
            results.add_oracle(oracle, listed, &vector.touch_camera);
        }
    }
}

/// Number of sound boxes around one that must be rejected.
const NEIGHBOURS: usize = 64;

/// Adds rows for a file's claims about its own planes and empty boxes.
fn check_claims(results: &mut LevelResults) {
    let vector = results.vector;
    let mut row = |about: &Name, expected: Answer, got: Answer| {
        let subject = [ORACLE, CullingTest::Exact.name()];
        let status = Status::of(expected == got);
        results.add_row(Some(about), subject, status, expected, got);
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
        row(&about, Answer::of_names(wanted), Answer::of_names(&found));
    }
    let boxes = vector.boxes().map(|b| (&b.id, b.bounds().is_empty()));
    let boxes: BTreeMap<&Name, bool> = boxes.collect();
    let sound = vector.sound_boxes().map(|b| &b.id);
    let inverted: BTreeSet<&Name> = sound.filter(|name| boxes[name]).collect();
    let listed = vector.expect_empty_boxes.iter();
    for names in listed.map(|names| names.iter().collect::<BTreeSet<&Name>>()) {
        let said = |is_inverted| ["not inverted", "inverted"][usize::from(is_inverted)];
        for name in &names | &inverted {
            let got = boxes.get(name).map_or("no such box", |&is| said(is));
            row(name, said(names.contains(name)).into(), got.into());
        }
    }
}

/// Returns the message of a build that must refuse this item, or the wrong outcome.
fn refusal(built: Result<Box<dyn DynIndex>, BuildError>, wanted: usize) -> Result<String, String> {
    match built {
        Err(error @ BuildError::NonFiniteItem { item, .. }) if item == wanted => {
            Ok(error.to_string())
        }
        Err(other) => Err(other.to_string()),
        Ok(_) => Err("built with this box in it".to_owned()),
    }
}

/// Returns the volume if it exists and should; else adds a row per structure.
///
/// `declared` is the declared refusal, `otherwise` the expected outcome without one.
fn accept<V>(
    results: &mut LevelResults,
    [test, kind]: [&str; 2],
    volume: Result<V, String>,
    declared: Option<Answer>,
    otherwise: Answer,
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
        let subject = [*structure, test];
        results.add_row(None, subject, status, expected.clone(), got.clone());
    }
    None
}

fn check_planes(results: &mut LevelResults, volume: Result<ConvexVolume, String>, built: &[Built]) {
    let vector = results.vector;
    let test = CullingTest::SixPlane.name();
    let declared = vector.planes_error().map(Answer::from);
    let wanted = "planes".into();
    let Some(volume) = accept(results, [test, "planes"], volume, declared, wanted, built) else {
        return;
    };
    let scalar = || results.names_of(|b| volume.sees(b));
    let observed = vector.observed_f32_pvertex_mul_add.clone();
    let wanted = observed.unwrap_or_else(scalar);
    for (structure, built) in built {
        let answer = results.query(built, (&volume).into(), |_| true);
        let explain = |b: &Aabb, _| Some(explain_visibility(b, &volume));
        results.add_comparison([structure, test], &wanted, &answer, explain);
    }
    let (six, exact) = (CullingTest::SixPlane, &vector.p_vertex_exact_visible);
    // Exact sums require finite numbers.
    if exact.is_some() {
        results.add_visible(six, exact, results.names_of(|b| sees_exactly(&volume, b)));
    }
    let fused = &vector.observed_f32_pvertex_fma;
    results.add_visible(six, fused, results.names_of(|b| sees_fused(&volume, b)));
    let (visible, touch) = (&vector.expected_visible_planes, &vector.touch_planes);
    results.add_oracle(&Oracle::of_volume(&volume), visible, touch);
}

/// Checks point location.
///
/// The query is rounded to f32, so it may find too many boxes for an f64 point: only those that
/// contain the point as written count.
fn check_points(results: &mut LevelResults, built: &[Built]) {
    let vector = results.vector;
    for (structure, built) in built {
        for point in vector.points() {
            let (p, wanted) = (point.p(), &point.expected_containing);
            let holds = |b: &Aabb| {
                let (min, max) = (b.min.as_dvec3(), b.max.as_dvec3());
                p.cmpge(min).all() && p.cmple(max).all()
            };
            let answer = results.query(built, p.as_vec3().into(), holds);
            let is_right = answer.iter().flatten().eq(wanted) && answer.is_ok();
            let subject = [*structure, "locate"];
            results.add_answer(Some(&point.id), subject, is_right, wanted, &answer);
        }
    }
}

#[cfg(test)]
mod tests;
