//! Asking test vectors: the given planes bit for bit, the camera through the
//! default pipeline, points, and what must be refused. It defines what passes.

use glam::DVec3;

use super::sheet::{Built, Sheet};
use super::{Level, Names, Row, Said, Status, Vector, VectorCamera, surroundings};
use crate::camera::PlaneOptions;
use crate::culling::{Culling, CullingTest, TESTS};
use crate::geometry::{Aabb, ConvexVolume};
use crate::index::{BuildError, StructureSpec};
use crate::oracle::{Oracle, Pose};

/// Asks one vector of all structures with the default planes.
pub fn replay(vector: &Vector, structures: &[StructureSpec]) -> Vec<Row> {
    Replay {
        structures,
        planes: PlaneOptions::default(),
    }
    .vector(vector)
}

/// How vectors are asked. With anything but the default planes (an epsilon of
/// zero, say) failures are to be expected: that is how the suite is tested.
#[derive(Clone, Copy)]
pub struct Replay<'a> {
    /// Structures that are queried.
    pub structures: &'a [StructureSpec],
    /// How the planes of cameras are derived.
    pub planes: PlaneOptions,
}

impl Replay<'_> {
    /// All rows of a vector: O(structures * tests) of them.
    pub fn vector(&self, vector: &Vector) -> Vec<Row> {
        let (names, items) = vector.sound_boxes();
        let sheet = |level| Sheet {
            vector,
            level,
            names: &names,
            items: &items,
            rows: Vec::new(),
        };
        let (mut planes, mut camera) = (sheet(Level::Planes), sheet(Level::Camera));
        let built = self.built(&items);
        if let Some(given) = &vector.planes {
            planes.given_planes(ConvexVolume::from_planes(given), &built);
        }
        planes.points(&built);
        if let Some(stated) = &vector.camera {
            self.camera(&mut camera, stated, &built);
        }
        let at_load = match vector.planes {
            Some(_) => &mut planes,
            None => &mut camera,
        };
        self.rejected(at_load);
        [planes.rows, camera.rows].concat()
    }

    fn built(&self, items: &[Aabb]) -> Vec<Built<'_>> {
        let build = |spec: &StructureSpec| spec.build(items);
        let specs = self.structures.iter();
        specs.map(|s| (s.label.as_str(), build(s))).collect()
    }

    /// What must not be built: each such box among the sound ones, and the
    /// first of them among all.
    fn rejected(&self, sheet: &mut Sheet) {
        let vector = sheet.vector;
        let all: Vec<Aabb> = vector.boxes.iter().map(|(_, b)| *b).collect();
        for (name, spec) in vector
            .rejected_at_load
            .iter()
            .flat_map(|name| self.structures.iter().map(move |spec| (name, spec)))
        {
            let expected = format!("refused at load: {name}");
            let at = vector.boxes.iter().position(|(n, _)| n == name);
            let built = at.map(|at| {
                let before = vector.boxes[..at].iter();
                let before = before.filter(|(n, _)| !vector.rejected_at_load.contains(n));
                let item = before.count();
                let mut scene = sheet.items.to_vec();
                scene.insert(item, all[at]);
                let is_first = item == at;
                let over_all = is_first.then(|| spec.build(&all)).map(|built| (built, at));
                [Some((spec.build(&scene), item)), over_all]
            });
            let outcomes = built.into_iter().flatten().flatten();
            let told: Vec<Result<String, String>> = outcomes
                .map(|(built, wanted)| match built {
                    Err(BuildError::NonFiniteItem { item, bounds }) if item == wanted => {
                        Ok(BuildError::NonFiniteItem { item, bounds }.to_string())
                    }
                    Err(other) => Err(other.to_string()),
                    Ok(_) => Err("built with this box in it".to_owned()),
                })
                .collect();
            let (status, got) = match told.iter().find(|t| t.is_err()).or(told.first()) {
                Some(Ok(text)) => (Status::Refused, text.clone()),
                Some(Err(text)) => (Status::Fail, text.clone()),
                None => (Status::Fail, "no such box".to_owned()),
            };
            let id = format!("{}/{name}", vector.id);
            let spec = spec.label.as_str();
            sheet.row(id, spec, "build", status, expected.into(), got.into());
        }
    }

    fn camera(&self, sheet: &mut Sheet, stated: &VectorCamera, six: &[Built]) {
        let vector = sheet.vector;
        let around = surroundings(sheet.items);
        let pose = Pose::LookAt {
            eye: stated.eye,
            look: stated.look,
            up: stated.up,
        };
        let camera = stated.camera();
        let oracle = camera.as_ref().ok().and_then(|camera| {
            let is_camera = vector.camera_error.is_none();
            is_camera.then(|| Oracle::of_camera(&pose, &camera.lens, DVec3::ZERO))?
        });
        // Where the file does not say what is visible, the oracle does.
        let truth = oracle.as_ref().map(|oracle| sheet.seen_by(oracle));
        let wanted = vector.visible_camera.as_ref().or(truth.as_ref());
        let nothing = Names::new();
        let wanted = wanted.unwrap_or(&nothing);
        let spheres = self.built(&CullingTest::Sphere.items(sheet.items));
        for (test, name, _) in TESTS {
            let structures = match test {
                CullingTest::Sphere => &spheres,
                _ => six,
            };
            let culling = Culling {
                test,
                planes: self.planes,
                ..Culling::default()
            };
            let view = match &camera {
                Ok(camera) => culling.view(camera, &around).map_err(|e| e.to_string()),
                Err(error) => Err(error.to_string()),
            };
            let (status, expected, got) = match (view, &vector.camera_error) {
                (Err(error), Some(declared)) => (Status::Refused, declared.as_str().into(), error),
                // A camera that cannot be made sees nothing.
                (Err(error), None) if wanted.is_empty() && vector.visible_camera.is_some() => {
                    (Status::Refused, Said::from(wanted), error)
                }
                (Err(error), None) => (Status::Fail, Said::from(wanted), error),
                (Ok(_), Some(declared)) => {
                    let got = "accepted as a camera".to_owned();
                    (Status::Fail, declared.as_str().into(), got)
                }
                (Ok(view), None) => {
                    let exact = match (&camera, test) {
                        (Ok(camera), CullingTest::Exact) => oracle.as_ref().map(|o| (o, camera)),
                        _ => None,
                    };
                    for (spec, built) in structures {
                        sheet.seen(spec, built, name, view.as_any(), wanted, &around, exact);
                    }
                    continue;
                }
            };
            for (spec, _) in structures {
                let (id, expected) = (vector.id.clone(), expected.clone());
                sheet.row(id, spec, name, status, expected, got.clone().into());
            }
        }
        if let Some(oracle) = &oracle {
            sheet.verdicts(oracle, &vector.visible_camera, &vector.touch_camera);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::Registry;
    use crate::stress::built_in;

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
            if vector.planes_error.is_some() || !camera {
                // Without a volume nothing is judged.
                continue;
            }
            let (names, _) = vector.sound_boxes();
            let lists = [&vector.visible_planes, &vector.visible_camera];
            for (level, visible) in lists.into_iter().enumerate() {
                let outside = |name: &&String| !visible.iter().flatten().any(|v| v == *name);
                let (Some(_), Some(name)) = (visible, names.iter().find(outside)) else {
                    continue;
                };
                let mut vector = vector.clone();
                let touch = [&mut vector.touch_planes, &mut vector.touch_camera];
                let Some(touch) = touch.into_iter().nth(level).and_then(Option::as_mut) else {
                    continue;
                };
                touch.insert(name.clone());
                let wrong = format!("{}/{name}", vector.id);
                assert!(failed(&vector).contains(&wrong), "{wrong}");
                // A list of touches is a claim without one of what is visible.
                (vector.visible_planes, vector.visible_camera) = (None, None);
                assert!(failed(&vector).contains(&wrong), "{wrong} alone");
                declared += 1;
            }
        }
        assert!(declared > 20, "{declared}");
    }

    #[test]
    fn the_six_plane_test_without_rounding_is_judged_beside_the_one_in_f32() {
        let structures = Registry::builtin().structures("linear").unwrap();
        let named = |rows: &[Row]| -> Vec<Status> {
            let exact = rows.iter().filter(|row| row.test == "six-plane exact");
            exact.map(|row| row.status).collect()
        };
        let mut differ = 0;
        for mut vector in built_in().unwrap() {
            let Some(exact) = vector.six_plane_exact.clone() else {
                continue;
            };
            differ += u32::from(vector.six_plane.as_ref() != Some(&exact));
            let passed = named(&replay(&vector, &structures));
            assert!(passed.iter().all(|&status| status == Status::Pass));
            if passed.is_empty() {
                continue;
            }
            vector.six_plane_exact = Some(Names::from(["nobody".to_owned()]));
            assert_eq!(named(&replay(&vector, &structures)), [Status::Fail]);
        }
        assert_eq!(differ, 6, "vectors whose f32 answer is another one");
    }
}
