//! Rows of one vector at one level: answers as sets of names.
//!
//! Also computes the margin of the exact test's planes, for vectors and extremes.

use std::collections::BTreeMap;

use super::{Answer, Level, Name, Names, Row, Status, Vector};
use glam::DVec3;

use crate::arithmetic::Expansion;
use crate::camera::{Camera, Lens, Surroundings};
use crate::culling::CullingTest;
use crate::geometry::{Aabb, ConvexVolume, Plane};
use crate::index::{BuildError, DynIndex, caught};
use crate::oracle::{Oracle, Verdict};
use crate::query::{AnyVolume, QueryCost};

/// Distance outside the camera's volume up to which the exact test returns a box.
///
/// A plane of unit length is rounded (u of `|d|` and of each `|n_k| x_k`), moved by c = 8 times u
/// of `sum |n_k| A_k + |d|`, and evaluated with at most 4 roundings of the magnitudes at the box's
/// corner. `|d|` is at most the magnitudes there plus the distance by which the box is outside; A_k
/// is at most the scene's reach. Together this is 26 u of the larger of that reach and of the box's
/// own; 32 covers it for all depths of near and far. Underflow in f32 adds at most 2^-140 in total.
///
/// An eye far away from everything it sees costs 2^-49 of its coordinates, by the derivation in f64
/// and by the margin for it; the code allows four times that, for planes that are sums of others.
/// A view so wide that its sides are nearly parallel leaves f64 no digits for its bounds; its
/// margin is infinite, so that nothing is checked.
pub fn slack(camera: &Camera, around: &Surroundings, b: &Aabb) -> f64 {
    const UNIT_ROUNDOFF: f64 = 1.0 / (1u64 << 24) as f64;
    const TINY: f64 = f64::from_bits((1023 - 140) << 52);
    const DERIVED: f64 = 1.0 / (1u64 << 47) as f64;
    const CANCELLED: f64 = 2e-9;
    if openness(&camera.lens) < CANCELLED {
        return f64::INFINITY;
    }
    // A scene without extent gets the reach of the volume.
    let mut reach = around.reach.as_dvec3();
    if let (DVec3::ZERO, Some(corners)) = (reach, camera.lens.corners(&camera.frame)) {
        let away = corners.map(|corner| (corner - around.origin).abs());
        reach = away.into_iter().fold(reach, DVec3::max);
    }
    let size = reach.max(b.reach().as_dvec3()).element_sum();
    let eye = camera.frame.eye;
    let far_away = (eye.abs() + (eye - around.origin).abs()).element_sum();
    32.0 * UNIT_ROUNDOFF * size + DERIVED * far_away + TINY
}

/// Determinant of the normals of near, a side, and the bottom or top.
///
/// Its size is what remains when these three planes make a bound along an axis.
fn openness(lens: &Lens) -> f64 {
    // Matrix cameras are not generated here.
    if lens.is_orthographic() || lens.matrix().is_some() {
        return 1.0;
    }
    let [left, right, bottom, top] = lens.window().map(f64::abs);
    let slopes = [left.max(right), bottom.max(top)];
    slopes.map(|s| 1.0 / libm::hypot(1.0, s)).iter().product()
}

/// Six-plane test without any rounding.
pub fn sees_exactly(volume: &ConvexVolume, b: &Aabb) -> bool {
    let excludes = |plane: &Plane| {
        // f64 holds the products exactly.
        let products = plane.normal.as_dvec3() * plane.p_vertex(b).as_dvec3();
        let mut value = Expansion::from(plane.d);
        for product in products.to_array() {
            value.grow(product);
        }
        value.sign() < 0
    };
    !b.is_empty() && !volume.planes().iter().any(excludes)
}

/// Six-plane test in f32 with fused sums, from the offset to z, y and x.
pub fn sees_fused(volume: &ConvexVolume, b: &Aabb) -> bool {
    let excludes = |plane: &Plane| {
        let (n, x) = (plane.normal, plane.p_vertex(b));
        n.x.mul_add(x.x, n.y.mul_add(x.y, n.z.mul_add(x.z, plane.d))) < 0.0
    };
    !b.is_empty() && !volume.planes().iter().any(excludes)
}

/// Name of the oracle's own rows in the column of structures.
pub const ORACLE: &str = "oracle";

/// Label of a structure; its index over a vector's boxes, or its refusal.
pub type Built<'a> = (&'a str, Result<Box<dyn DynIndex>, BuildError>);

/// Sorted names of the boxes that a query returned, or the reason for none.
pub type Returned = Result<Vec<Name>, String>;

/// Results of one level of one vector.
pub struct LevelResults<'a> {
    pub vector: &'a Vector,
    pub level: Level,
    pub names: &'a [Name],
    pub items: &'a [Aabb],
    /// Index of each name.
    pub indices: &'a BTreeMap<&'a Name, usize>,
    pub rows: Vec<Row>,
}

impl LevelResults<'_> {
    /// Adds a row about the whole vector, or about one of its boxes or points.
    pub fn add_row(
        &mut self,
        about: Option<&Name>,
        [structure, test]: [&str; 2],
        status: Status,
        expected: impl Into<Answer>,
        got: impl Into<Answer>,
    ) {
        let id = &self.vector.id.0;
        self.rows.push(Row {
            id: about.map_or(id.clone(), |name| format!("{id}/{}", name.0)),
            level: self.level,
            structure: structure.to_owned(),
            test: test.to_owned(),
            status,
            expected: expected.into(),
            got: got.into(),
            kernel: None,
        });
    }

    /// Adds the row of an answer; it fails if the answer has an empty box.
    pub fn add_answer(
        &mut self,
        about: Option<&Name>,
        subject: [&str; 2],
        is_right: bool,
        wanted: &Names,
        answer: &Returned,
    ) {
        let empty = self.vector.expect_empty_boxes.as_ref();
        let is_empty = |name: &Name| empty.is_some_and(|names| names.contains(name));
        let has_empty = answer.iter().flatten().any(is_empty);
        let status = Status::of(is_right && !has_empty);
        let got = answer.as_ref().map_or_else(Answer::from, Answer::of_names);
        self.add_row(about, subject, status, Answer::of_names(wanted), got);
    }

    /// Adds the row of an answer, and a row for each wrong box in it.
    ///
    /// `fault` describes a difference: a box, and whether it is wanted; `None` if the difference is
    /// allowed.
    pub fn add_comparison(
        &mut self,
        subject: [&str; 2],
        wanted: &Names,
        answer: &Returned,
        fault: impl Fn(&Aabb, bool) -> Option<String>,
    ) {
        let found: Names = answer.iter().flatten().cloned().collect();
        let mut faults = Vec::new();
        for name in wanted.symmetric_difference(&found) {
            let is_wanted = wanted.contains(name);
            let got = match self.box_named(name) {
                Some(b) => fault(b, is_wanted),
                None => Some("no such box".to_owned()),
            };
            faults.extend(got.map(|got| (name, is_wanted, got)));
        }
        let is_unique = |names: &Vec<Name>| names.len() == found.len();
        let is_right = faults.is_empty() && answer.as_ref().is_ok_and(is_unique);
        self.add_answer(None, subject, is_right, wanted, answer);
        for (name, is_wanted, got) in faults.into_iter().filter(|_| answer.is_ok()) {
            let expected = if is_wanted { "visible" } else { "not visible" };
            self.add_row(Some(name), subject, Status::Fail, expected, got);
        }
    }

    /// Adds a row for each name in the level's lists that no sound box has.
    pub fn add_unknown_names(&mut self) {
        let vector = self.vector;
        for name in vector.named(self.level) {
            if self.box_named(name).is_none() {
                let subject = [ORACLE, CullingTest::Exact.name()];
                self.add_row(Some(name), subject, Status::Fail, "a box", "no such box");
            }
        }
    }

    fn box_named(&self, name: &Name) -> Option<&Aabb> {
        self.items.get(*self.indices.get(name)?)
    }

    /// Names of the boxes that satisfy a condition.
    pub fn names_of(&self, is_one: impl Fn(&Aabb) -> bool) -> Names {
        let boxes = self.names.iter().zip(self.items);
        let those = boxes.filter(|(_, b)| is_one(b));
        those.map(|(name, _)| name.clone()).collect()
    }

    /// Names of the finite boxes that the oracle sees.
    pub fn visible_to(&self, oracle: &Oracle) -> Names {
        self.names_of(|b| b.is_finite() && oracle.verdict(b) != Verdict::Out)
    }

    /// Queries a structure, with counting and without.
    ///
    /// Drops returned items that `keep` rejects; unknown ids show in the answer.
    pub fn query(
        &self,
        built: &Result<Box<dyn DynIndex>, BuildError>,
        volume: AnyVolume<'_>,
        keep: impl Fn(&Aabb) -> bool,
    ) -> Returned {
        let index = built.as_ref().map_err(BuildError::to_string)?;
        let (mut plain, mut counted) = (Vec::new(), Vec::new());
        caught(|| {
            index.query(volume, &mut plain);
            index.query_counted(volume, &mut counted, &mut QueryCost::default());
        })
        .map_err(|text| format!("panicked: {text}"))?;
        if plain != counted {
            let both = format!("{plain:?}, {counted:?}");
            return Err(format!("counting changes the answer: {both}"));
        }
        let name = |id: u32| match (self.items.get(id as usize), self.names.get(id as usize)) {
            (Some(b), Some(name)) => keep(b).then(|| name.clone()),
            _ => Some(Name(format!("(no item {id})"))),
        };
        let mut names: Vec<Name> = plain.into_iter().filter_map(name).collect();
        names.sort_unstable();
        Ok(names)
    }

    /// Adds the row of the boxes that a test sees, if the file lists them.
    pub fn add_visible(&mut self, test: CullingTest, listed: &Option<Names>, seen: Names) {
        if let Some(listed) = listed {
            let got = Ok(seen.iter().cloned().collect());
            self.add_answer(None, [ORACLE, test.name()], seen == *listed, listed, &got);
        }
    }

    /// Adds rows that compare the oracle's verdicts with the lists of the file.
    pub fn add_oracle(&mut self, oracle: &Oracle, visible: &Option<Names>, touch: &Option<Names>) {
        let mut wrong = Vec::new();
        let boxes = self.names.iter().zip(self.items);
        for (name, b) in boxes.filter(|(_, b)| b.is_finite()) {
            let class = oracle.classify(b);
            let found = class.verdict;
            let lists = |list: &Option<Names>| list.as_ref().map(|names| names.contains(name));
            let wanted = match (lists(visible), lists(touch)) {
                // A touch counts as visible, so the two lists contradict each other.
                (Some(false), Some(true)) if found == Verdict::Touch => Verdict::Out,
                (_, Some(true)) => Verdict::Touch,
                (Some(false), _) => Verdict::Out,
                (Some(true), Some(false)) => Verdict::In,
                // A file without one of the two lists accepts either verdict.
                (Some(true), None) if found == Verdict::Out => Verdict::In,
                (None, Some(false)) if found == Verdict::Touch => Verdict::In,
                _ => found,
            };
            // The view is narrower than the oracle's precision: an undecided touch counts as
            // visible.
            let is_narrow = || self.vector.camera.is_some_and(|c| !c.is_supported());
            let is_visible = class.undecided && wanted != Verdict::Out && is_narrow();
            if found != wanted && !is_visible {
                wrong.push((name, wanted, format!("{found:?}").to_lowercase()));
            }
        }
        self.add_visible(CullingTest::Exact, visible, self.visible_to(oracle));
        let subject = [ORACLE, CullingTest::Exact.name()];
        for (name, expected, got) in wrong {
            let expected = format!("{expected:?}").to_lowercase();
            self.add_row(Some(name), subject, Status::Fail, expected, got);
        }
    }
}
