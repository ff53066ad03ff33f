//! The rows of one vector at one level: asking structures, comparing sets of
//! names, and the rows that come of it. Which questions a vector has is decided in
//! `replay`.

use super::margin::slack;
use super::{Level, Names, Row, Said, Status, Vector};
use crate::arithmetic::Expansion;
use crate::camera::{Camera, Surroundings};
use crate::culling::CullingTest;
use crate::geometry::{Aabb, ConvexVolume, Plane};
use crate::index::{BuildError, DynIndex, caught};
use crate::oracle::{Oracle, Verdict};
use crate::query::{AnyVolume, ItemId, QueryCost};
use crate::verify::explain_visibility;
use glam::Vec3;

/// The name that the oracle's own rows have in place of a structure.
const ORACLE: &str = "oracle";

/// A structure by its label, built over the boxes of a vector or not.
pub(super) type Built<'a> = (&'a str, Result<Box<dyn DynIndex>, BuildError>);

/// One level of one vector.
pub struct Sheet<'a> {
    pub vector: &'a Vector,
    pub level: Level,
    pub names: &'a [String],
    pub items: &'a [Aabb],
    pub rows: Vec<Row>,
}

impl Sheet<'_> {
    pub fn row(
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

    /// The names of those boxes.
    fn names_of(&self, is_one: impl Fn(&Aabb) -> bool) -> Names {
        let boxes = self.names.iter().zip(self.items);
        let those = boxes.filter(|(_, b)| is_one(b));
        those.map(|(name, _)| name.clone()).collect()
    }

    pub fn box_named(&self, name: &str) -> Option<&Aabb> {
        let at = self.names.iter().position(|n| n == name)?;
        self.items.get(at)
    }

    /// The names of an answer; ids that come twice or do not exist show.
    pub fn named(&self, ids: &[ItemId]) -> Vec<String> {
        let name = |&id: &ItemId| match self.names.get(id as usize) {
            Some(name) => name.clone(),
            None => format!("(no item {id})"),
        };
        let mut names: Vec<String> = ids.iter().map(name).collect();
        names.sort_unstable();
        names
    }

    /// Asks for something twice, counted and not.
    pub fn answer(
        &self,
        built: &Result<Box<dyn DynIndex>, BuildError>,
        ask: impl Fn(&dyn DynIndex, Option<&mut QueryCost>, &mut Vec<ItemId>),
    ) -> Result<Vec<String>, String> {
        let index = built.as_ref().map_err(BuildError::to_string)?;
        let (mut plain, mut counted) = (Vec::new(), Vec::new());
        caught(|| {
            ask(index.as_ref(), None, &mut plain);
            let cost = &mut QueryCost::default();
            ask(index.as_ref(), Some(cost), &mut counted);
        })
        .map_err(|text| format!("panicked: {text}"))?;
        if plain != counted {
            return Err(format!(
                "counting changes the answer: {plain:?}, {counted:?}"
            ));
        }
        Ok(self.named(&plain))
    }

    pub fn see(
        &self,
        built: &Result<Box<dyn DynIndex>, BuildError>,
        view: AnyVolume<'_>,
    ) -> Result<Vec<String>, String> {
        self.answer(built, |index, cost, out| match cost {
            None => index.query(view, out),
            Some(cost) => index.query_counted(view, out, cost),
        })
    }

    pub fn given_planes<E: std::fmt::Display>(
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
        let scalar = || self.names_of(|b| volume.sees(b));
        let wanted = vector.six_plane.clone().unwrap_or_else(scalar);
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
        self.without_rounding(&volume);
        let oracle = Oracle::of_volume(&volume);
        self.verdicts(&oracle, &vector.visible_planes, &vector.touch_planes);
    }

    /// What the file says of the six-plane test in real numbers, beside what it
    /// says of f32.
    fn without_rounding(&mut self, volume: &ConvexVolume) {
        let Some(wanted) = &self.vector.six_plane_exact else {
            return;
        };
        let seen = self.names_of(|b| {
            let excluded = |plane: &Plane| value_at(plane, plane.p_vertex(b)).sign() < 0;
            !b.is_empty() && !volume.planes().iter().any(excluded)
        });
        let got = Ok(seen.iter().cloned().collect());
        self.answered(ORACLE, "six-plane exact", seen == *wanted, wanted, &got);
    }

    /// The row of an answer; empty boxes must not be in it.
    pub fn answered(
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
    pub fn offending(&mut self, spec: &str, test: &str, name: &str, wanted: &Names, got: String) {
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
    pub fn seen(
        &mut self,
        spec: &str,
        built: &Result<Box<dyn DynIndex>, BuildError>,
        test: &str,
        view: AnyVolume<'_>,
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

    pub fn seen_by(&self, oracle: &Oracle) -> Names {
        // What is not finite is no box, and nothing is built with it.
        self.names_of(|b| b.is_finite() && oracle.verdict(b) != Verdict::Out)
    }

    /// The oracle's own verdicts: visible and touching exactly as stated.
    pub fn verdicts(&mut self, oracle: &Oracle, visible: &Option<Names>, touch: &Option<Names>) {
        let Some(listed) = visible.as_ref().or(touch.as_ref()) else {
            return;
        };
        let got = self.seen_by(oracle);
        let mut wrong = Vec::new();
        let boxes = self.names.iter().zip(self.items);
        for (name, b) in boxes.filter(|(_, b)| b.is_finite()) {
            let said = oracle.verdict(b);
            let names = |list: &Option<Names>| list.as_ref().map(|names| names.contains(name));
            let wanted = match (names(visible), names(touch)) {
                (_, Some(true)) => Verdict::Touch,
                (Some(false), _) => Verdict::Out,
                (Some(true), Some(false)) => Verdict::In,
                // A file that does not tell one of the two is content with either.
                (Some(true), None) if said == Verdict::Out => Verdict::In,
                (None, Some(false)) if said == Verdict::Touch => Verdict::In,
                _ => said,
            };
            if said != wanted {
                wrong.push((name.clone(), format!("{wanted:?}"), format!("{said:?}")));
            }
        }
        let names = visible.iter().chain(touch).flatten();
        let unknown = names.filter(|name| self.box_named(name).is_none());
        wrong.extend(unknown.map(|name| (name.clone(), "In".to_owned(), "no such box".to_owned())));
        let test = CullingTest::Exact.name();
        let got = Ok(got.into_iter().collect());
        self.answered(ORACLE, test, wrong.is_empty(), listed, &got);
        for (name, expected, got) in wrong {
            let id = format!("{}/{name}", self.vector.id);
            let (expected, got) = (expected.to_lowercase(), got.to_lowercase());
            let fail = Status::Fail;
            self.row(id, ORACLE, test, fail, expected.into(), got.into());
        }
    }

    /// Region search; the middle of an empty box must not find it either.
    pub fn points(&mut self, built: &[Built]) {
        let vector = self.vector;
        for (spec, built) in built {
            for point in &vector.points {
                let holds = |id: &ItemId| {
                    let b = &self.items[*id as usize];
                    let (min, max) = (b.min.as_dvec3(), b.max.as_dvec3());
                    point.p.cmpge(min).all() && point.p.cmple(max).all()
                };
                // Boxes are f32: a point that is none can only find too many.
                let found = self.answer(built, |index, cost, out| {
                    match cost {
                        None => index.locate(point.p.as_vec3(), out),
                        Some(cost) => index.query_counted(point.p.as_vec3().into(), out, cost),
                    }
                    out.retain(holds);
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

/// A plane's value at a point without any rounding: f64 holds the products.
fn value_at(plane: &Plane, p: Vec3) -> Expansion {
    let products = plane.normal.as_dvec3() * p.as_dvec3();
    let mut value = Expansion::from(plane.d);
    products
        .to_array()
        .into_iter()
        .for_each(|part| value.grow(part));
    value
}
