//! Asking test vectors: the given planes bit for bit, the camera through the
//! default pipeline, points, and what must be refused. It owns what passes.

use glam::DVec3;

use super::{Level, Names, Row, Said, Status, Vector, VectorCamera, surroundings};
use crate::camera::{Camera, Lens, PlaneOptions, Surroundings};
use crate::culling::{Culling, CullingTest, TESTS};
use crate::geometry::{Aabb, ConvexVolume};
use crate::index::{BuildError, DynIndex, StructureSpec};
use crate::oracle::{Oracle, Pose, Verdict};
use crate::query::{AnyView, ItemId, QueryCost};
use crate::verify::explain_visibility;

/// The name that the oracle's own rows have in place of a structure.
const ORACLE: &str = "oracle";

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
    pub structures: &'a [StructureSpec],
    pub planes: PlaneOptions,
}

type Built<'a> = (&'a str, Result<Box<dyn DynIndex>, BuildError>);

/// One level of one vector.
struct Sheet<'a> {
    vector: &'a Vector,
    level: Level,
    names: &'a [String],
    items: &'a [Aabb],
    rows: Vec<Row>,
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

impl Sheet<'_> {
    fn row(
        &mut self,
        id: String,
        structure: &str,
        test: &str,
        status: Status,
        expected: Said,
        got: Said,
    ) {
        self.rows.push(Row {
            id,
            level: self.level,
            structure: structure.to_owned(),
            test: test.to_owned(),
            status,
            expected,
            got,
        });
    }

    fn box_named(&self, name: &str) -> Option<&Aabb> {
        let at = self.names.iter().position(|n| n == name)?;
        self.items.get(at)
    }

    /// The names of an answer; ids that come twice or do not exist show.
    fn named(&self, ids: &[ItemId]) -> Vec<String> {
        let name = |&id: &ItemId| match self.names.get(id as usize) {
            Some(name) => name.clone(),
            None => format!("(no item {id})"),
        };
        let mut names: Vec<String> = ids.iter().map(name).collect();
        names.sort_unstable();
        names
    }

    /// Asks for something twice, counted and not.
    fn answer(
        &self,
        built: &Result<Box<dyn DynIndex>, BuildError>,
        ask: impl Fn(&dyn DynIndex, Option<&mut QueryCost>, &mut Vec<ItemId>),
    ) -> Result<Vec<String>, String> {
        let index = built.as_ref().map_err(BuildError::to_string)?;
        let (mut plain, mut counted) = (Vec::new(), Vec::new());
        ask(index.as_ref(), None, &mut plain);
        ask(
            index.as_ref(),
            Some(&mut QueryCost::default()),
            &mut counted,
        );
        if plain != counted {
            return Err(format!(
                "counting changes the answer: {plain:?}, {counted:?}"
            ));
        }
        Ok(self.named(&plain))
    }

    fn see(
        &self,
        built: &Result<Box<dyn DynIndex>, BuildError>,
        view: AnyView<'_>,
    ) -> Result<Vec<String>, String> {
        self.answer(built, |index, cost, out| match cost {
            None => index.see(view, out),
            Some(cost) => index.see_counted(view, out, cost),
        })
    }

    fn given_planes<E: std::fmt::Display>(
        &mut self,
        volume: Result<ConvexVolume, E>,
        built: &[Built],
    ) {
        let vector = self.vector;
        let volume = match (volume, &vector.planes_error) {
            (Ok(volume), None) => volume,
            (volume, declared) => {
                let (status, got) = match (&volume, declared) {
                    (Err(error), Some(_)) => (Status::Refused, error.to_string()),
                    (Err(error), None) => (Status::Fail, error.to_string()),
                    (Ok(_), _) => (Status::Fail, "accepted as planes".to_owned()),
                };
                let expected = match declared {
                    Some(text) => Said::from(text.as_str()),
                    None => Said::from("planes"),
                };
                for (spec, _) in built {
                    let (id, got) = (vector.id.clone(), got.clone().into());
                    let six = CullingTest::SixPlane.name();
                    self.row(id, spec, six, status, expected.clone(), got);
                }
                return;
            }
        };
        let scalar = || {
            let boxes = self.names.iter().zip(self.items);
            let seen = boxes.filter(|(_, b)| volume.sees(b));
            seen.map(|(name, _)| name.clone()).collect()
        };
        let wanted: Names = vector.six_plane.clone().unwrap_or_else(scalar);
        for (spec, built) in built {
            let found = self.see(built, (&volume).into());
            let list: Vec<String> = wanted.iter().cloned().collect();
            let right = found.as_ref() == Ok(&list);
            self.answered(spec, CullingTest::SixPlane.name(), right, &wanted, &found);
            let Ok(found) = &found else { continue };
            let found: Names = found.iter().cloned().collect();
            for name in wanted.symmetric_difference(&found) {
                let got = match self.box_named(name) {
                    Some(b) => explain_visibility(b, &volume),
                    None => "no such box".to_owned(),
                };
                self.offending(spec, CullingTest::SixPlane.name(), name, &wanted, got);
            }
        }
        let oracle = Oracle::of_volume(&volume);
        self.verdicts(&oracle, &vector.visible_planes, &vector.touch_planes);
    }

    /// The row of an answer; empty boxes must not be in it.
    fn answered(
        &mut self,
        spec: &str,
        test: &str,
        right: bool,
        wanted: &Names,
        found: &Result<Vec<String>, String>,
    ) {
        let got = match found {
            Ok(names) => Said::Names(names.clone()),
            Err(text) => Said::Text(text.clone()),
        };
        let empty = &self.vector.empty_boxes;
        let ghost = found.iter().flatten().any(|name| empty.contains(name));
        let status = match right && !ghost {
            true => Status::Pass,
            false => Status::Fail,
        };
        let id = self.vector.id.clone();
        self.row(id, spec, test, status, Said::from(wanted), got);
    }

    /// The row of a box that is wrong in an answer.
    fn offending(&mut self, spec: &str, test: &str, name: &str, wanted: &Names, got: String) {
        let expected = match wanted.contains(name) {
            true => "visible",
            false => "not visible",
        };
        let id = format!("{}/{name}", self.vector.id);
        self.row(id, spec, test, Status::Fail, expected.into(), got.into());
    }

    /// A structure at camera level: all that is wanted must come. More may,
    /// but for the exact test only what lies within its margin.
    #[expect(
        clippy::too_many_arguments,
        reason = "one place calls it, in a row of loops"
    )]
    fn seen(
        &mut self,
        spec: &str,
        built: &Result<Box<dyn DynIndex>, BuildError>,
        test: &str,
        view: AnyView<'_>,
        wanted: &Names,
        around: &Surroundings,
        exact: Option<(&Oracle, &Camera)>,
    ) {
        let answer = self.see(built, view);
        let found: Names = answer.iter().flatten().cloned().collect();
        let mut offenders: Vec<(String, String)> = Vec::new();
        for name in wanted.difference(&found) {
            let got = match (self.box_named(name), exact) {
                (None, _) => "no such box".to_owned(),
                (Some(b), Some((oracle, _))) => {
                    format!("dropped, {:e} deep", oracle.depth(b))
                }
                _ => "dropped".to_owned(),
            };
            offenders.push((name.clone(), got));
        }
        if let Some((oracle, camera)) = exact {
            for name in found.difference(wanted) {
                let Some(b) = self.box_named(name) else {
                    offenders.push((name.clone(), "no such item".to_owned()));
                    continue;
                };
                let (depth, slack) = (oracle.depth(b), slack(camera, around, b));
                if depth < -slack {
                    let got = format!("returned, {:e} away; the margin is {slack:e}", -depth);
                    offenders.push((name.clone(), got));
                }
            }
        }
        let unique = answer.as_ref().is_ok_and(|list| list.len() == found.len());
        let known = found.iter().all(|name| self.box_named(name).is_some());
        let right = unique && known && offenders.is_empty();
        self.answered(spec, test, right, wanted, &answer);
        if answer.is_ok() {
            for (name, got) in offenders {
                self.offending(spec, test, &name, wanted, got);
            }
        }
    }

    fn seen_by(&self, oracle: &Oracle) -> Names {
        let boxes = self.names.iter().zip(self.items);
        // What is not finite is no box, and nothing is built with it.
        let boxes = boxes.filter(|(_, b)| b.is_finite());
        let seen = boxes.filter(|(_, b)| oracle.verdict(b) != Verdict::Out);
        seen.map(|(name, _)| name.clone()).collect()
    }

    /// The oracle's own verdicts: visible and touching exactly as stated.
    fn verdicts(&mut self, oracle: &Oracle, visible: &Option<Names>, touch: &Option<Names>) {
        let Some(visible) = visible else { return };
        let got = self.seen_by(oracle);
        let mut wrong = Vec::new();
        let boxes = self.names.iter().zip(self.items);
        for (name, b) in boxes.filter(|(_, b)| b.is_finite()) {
            let said = oracle.verdict(b);
            let touches = touch.as_ref().map(|names| names.contains(name));
            let wanted = match (visible.contains(name), touches) {
                (false, _) => Verdict::Out,
                (true, Some(true)) => Verdict::Touch,
                (true, Some(false)) => Verdict::In,
                // A file that does not tell touches is content with either.
                (true, None) if said == Verdict::Out => Verdict::In,
                (true, None) => said,
            };
            if said != wanted {
                wrong.push((name.clone(), format!("{wanted:?}"), format!("{said:?}")));
            }
        }
        let listed = visible.iter().chain(touch.iter().flatten());
        let unknown = listed.filter(|name| self.box_named(name).is_none());
        wrong.extend(unknown.map(|name| (name.clone(), "In".to_owned(), "no such box".to_owned())));
        let test = CullingTest::Exact.name();
        let got = Ok(got.into_iter().collect());
        self.answered(ORACLE, test, wrong.is_empty(), visible, &got);
        for (name, expected, got) in wrong {
            let id = format!("{}/{name}", self.vector.id);
            let (expected, got) = (expected.to_lowercase(), got.to_lowercase());
            let fail = Status::Fail;
            self.row(id, ORACLE, test, fail, expected.into(), got.into());
        }
    }

    /// Region search; the middle of an empty box must not find it either.
    fn points(&mut self, built: &[Built]) {
        let vector = self.vector;
        for (spec, built) in built {
            for point in &vector.points {
                let found = self.answer(built, |index, cost, out| match cost {
                    None => index.locate(point.p, out),
                    Some(cost) => index.locate_counted(point.p, out, cost),
                });
                let list: Vec<String> = point.containing.iter().cloned().collect();
                let right = found.as_ref() == Ok(&list);
                self.answered(spec, "locate", right, &point.containing, &found);
                if let Some(row) = self.rows.last_mut() {
                    row.id = format!("{}/{}", vector.id, point.id);
                }
            }
        }
    }
}

/// How far outside the camera's volume a box may lie that the exact test still
/// returns.
///
/// A plane of unit length is rounded (u of `|d|` and of each `|n_k| x_k`),
/// moved by c = 8 times u of `sum |n_k| A_k + |d|`, and evaluated with at most
/// 4 roundings of the magnitudes at the box's corner: 13 u of the sum over k
/// of the larger of A_k and the box's reach, and of `|d|`. The plane touches
/// the volume, whose points near the camera are among its corners, so `|d|`
/// is no more than the sum of A_k. 16 covers the sum of both; what is below
/// f32 altogether is 2^-140 at most. A view so wide that its sides are all
/// but parallel leaves f64 no digits for its bounds; what the exact test then
/// returns is not judged.
pub(super) fn slack(camera: &Camera, around: &Surroundings, b: &Aabb) -> f64 {
    const UNIT_ROUNDOFF: f64 = 1.0 / (1u64 << 24) as f64;
    const TINY: f64 = f64::from_bits((1023 - 140) << 52);
    const CANCELLED: f64 = 2e-9;
    if openness(&camera.lens) < CANCELLED {
        return f64::INFINITY;
    }
    let near = camera.lens.near();
    let nearby = camera.lens.with_far(camera.lens.far().or(Some(near * 2.0)));
    let corners = nearby.ok().and_then(|lens| lens.corners(&camera.frame));
    let reach = corners
        .iter()
        .flatten()
        .fold(around.reach.as_dvec3(), |reach, corner| {
            reach.max(corner.abs())
        });
    let size = reach.max(b.reach().as_dvec3()).element_sum() + reach.element_sum();
    16.0 * UNIT_ROUNDOFF * size + TINY
}

/// The determinant of near's, a side's and the bottom's or top's normals: what
/// is left when the three make a bound along an axis.
fn openness(lens: &Lens) -> f64 {
    let slopes = match *lens {
        Lens::Perspective {
            fovy_deg, aspect, ..
        } => {
            let y = libm::tan(fovy_deg.to_radians() / 2.0);
            [y * aspect, y]
        }
        Lens::OffAxis { window, near, .. } => {
            let [left, right, bottom, top] = window.map(|edge| edge.abs() / near);
            [left.max(right), bottom.max(top)]
        }
        Lens::Orthographic { .. } => [0.0; 2],
    };
    slopes.map(|s| 1.0 / libm::hypot(1.0, s)).iter().product()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::structures;
    use crate::stress::built_in;

    #[test]
    fn the_built_in_vectors_pass_on_every_structure() {
        let structures = structures("all").unwrap();
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
        let structures = structures("linear").unwrap();
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
}
