//! Cross-checking structures: the reference answer by the plainest loop there
//! is, the comparison with it, and the first difference in words. Random
//! differential cases live in `random`, degenerate scenes in `edges`, and the
//! contract of a structure as tests in [`conformance`]. Nothing here is timed.

pub mod conformance;
mod edges;
mod random;
mod trial;
mod truth;
mod variants;

use std::fmt;

use glam::Vec3;

use crate::geometry::Aabb;
use crate::query::{AnyVolume, ItemId};

pub use edges::{edge_scenes, edge_volumes, points_on_faces};
pub use random::{RandomCase, VOLUME_KINDS};
pub use trial::{Fault, Trial};
pub use truth::{ErrorCount, Truth};
pub use variants::variants;

/// The reference: each box against each plane with [`AnyVolume::sees`], no
/// structure, no mask, no early way out. O(items * planes) per volume.
///
/// Reuses its memory from query to query.
pub struct Reference {
    /// Per item: the number of the query that marked it last, twice: +0 if
    /// the reference wants it, +1 once a structure has returned it.
    marks: Vec<u64>,
    stamp: u64,
    expected: usize,
}

/// How a structure's answer differs from the reference.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub struct Difference {
    /// Wanted by the reference, not returned (false negatives).
    pub missing: usize,
    /// Returned, not wanted.
    pub extra: usize,
    /// Returned a second time, or an id that does not exist.
    pub invalid: usize,
    /// The first item concerned.
    pub first: Option<ItemId>,
}

impl Difference {
    /// Whether the answer is the reference's.
    pub fn is_none(&self) -> bool {
        *self == Difference::default()
    }
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} missing, {} extra, {} repeated or unknown",
            self.missing, self.extra, self.invalid
        )?;
        match self.first {
            Some(id) => write!(f, "; first: item {id}"),
            None => Ok(()),
        }
    }
}

impl Reference {
    /// A reference for scenes of so many items.
    pub fn new(item_count: usize) -> Self {
        Reference {
            marks: vec![0; item_count],
            stamp: 0,
            expected: 0,
        }
    }

    /// Computes the reference answer to a frustum query; its size.
    pub fn see<'v>(&mut self, items: &[Aabb], view: impl Into<AnyVolume<'v>>) -> usize {
        let view = view.into();
        let wanted = items.iter().zip(0..).filter(|(b, _)| view.sees(b));
        self.expect(wanted.map(|(_, id)| id))
    }

    /// Takes over a reference answer found by other means; its size.
    pub fn expect(&mut self, wanted: impl Iterator<Item = ItemId>) -> usize {
        self.stamp += 2;
        self.expected = 0;
        for id in wanted {
            self.marks[id as usize] = self.stamp;
            self.expected += 1;
        }
        self.expected
    }

    /// Compares a structure's answer, in any order, with the reference. May
    /// be called for one structure after another. O(items) in the worst case,
    /// O(answer) if the answer is right.
    pub fn compare(&mut self, found: &[ItemId]) -> Difference {
        let mut difference = Difference::default();
        let mut right = 0;
        for &id in found {
            let bad = match self.marks.get_mut(id as usize) {
                Some(mark) if *mark == self.stamp => {
                    *mark += 1;
                    right += 1;
                    continue;
                }
                Some(mark) if *mark == self.stamp + 1 => &mut difference.invalid,
                Some(_) => &mut difference.extra,
                None => &mut difference.invalid,
            };
            *bad += 1;
            difference.first.get_or_insert(id);
        }
        difference.missing = self.expected - right;
        if difference.missing > 0 {
            let lost = self.marks.iter().position(|mark| *mark == self.stamp);
            difference.first = lost.map(|id| id as ItemId);
        }
        // Ready for the next structure.
        for &id in found {
            let mark = self.marks.get_mut(id as usize);
            if let Some(mark) = mark.filter(|m| **m == self.stamp + 1) {
                *mark = self.stamp;
            }
        }
        difference
    }
}

/// The verdict of a volume about one box in words: each plane that matters
/// with the value of the box's p-vertex, so that a reader can check by hand.
pub fn explain_visibility<'v>(b: &Aabb, view: impl Into<AnyVolume<'v>>) -> String {
    let view = view.into();
    let [low, high] = [b.min, b.max].map(|v| format!("({}, {}, {})", v.x, v.y, v.z));
    let bounds = format!("box {low} to {high}");
    if b.is_empty() {
        return format!("{bounds} is empty");
    }
    let AnyVolume::Planes(volume) = view else {
        let seen = if view.sees(b) { "" } else { "not " };
        return format!("{bounds} is {seen}visible to {view:?}");
    };
    let planes = volume.planes().iter();
    let values = planes.map(|plane| plane.value_at(plane.p_vertex(b)));
    let lowest = values.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
    let Some((index, value)) = lowest else {
        return format!("{bounds}: the volume has no plane");
    };
    let plane = volume.planes()[index];
    format!(
        "{bounds}: {} ({}, {}, {}, {}) has the lowest p-vertex value {value:e} (n-vertex {:e}), so the box is {}",
        volume.plane_label(index),
        plane.normal.x,
        plane.normal.y,
        plane.normal.z,
        plane.d,
        plane.value_at(plane.n_vertex(b)),
        if value < 0.0 {
            "not visible"
        } else {
            "visible"
        }
    )
}

/// The same for region search.
pub fn explain_containment(b: &Aabb, p: Vec3) -> String {
    let [min, max] = [b.min, b.max].map(|corner| corner.to_array());
    let holds = if b.contains_point(p) {
        "holds"
    } else {
        "does not hold"
    };
    format!("box {min:?} to {max:?} {holds} the point {p:?}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{ConvexVolume, Plane};

    #[test]
    fn each_kind_of_wrong_answer_is_told_apart() {
        let items: Vec<Aabb> = (0..6)
            .map(|i| Aabb::around(Vec3::new(i as f32, 0.0, 0.0), Vec3::splat(0.25)))
            .collect();
        let half = ConvexVolume::from_planes(&[Plane::new(Vec3::X, -2.5)]).unwrap();
        let mut reference = Reference::new(items.len());
        assert_eq!(reference.see(&items, &half), 3);
        assert!(reference.compare(&[5, 3, 4]).is_none());
        let cases: [(&[ItemId], Difference); 5] = [
            (
                &[3, 4],
                Difference {
                    missing: 1,
                    first: Some(5),
                    ..Default::default()
                },
            ),
            (
                &[3, 4, 5, 1],
                Difference {
                    extra: 1,
                    first: Some(1),
                    ..Default::default()
                },
            ),
            (
                &[3, 4, 5, 4],
                Difference {
                    invalid: 1,
                    first: Some(4),
                    ..Default::default()
                },
            ),
            (
                &[3, 4, 5, 99],
                Difference {
                    invalid: 1,
                    first: Some(99),
                    ..Default::default()
                },
            ),
            (
                &[],
                Difference {
                    missing: 3,
                    first: Some(3),
                    ..Default::default()
                },
            ),
        ];
        for (answer, wanted) in cases {
            assert_eq!(reference.compare(answer), wanted, "{answer:?}");
            assert!(reference.compare(&[3, 4, 5]).is_none(), "state is restored");
        }
    }

    #[test]
    fn explanations_name_the_deciding_plane() {
        let volume =
            ConvexVolume::from_planes(&[Plane::new(Vec3::X, 0.0), Plane::new(-Vec3::X, 10.0)])
                .unwrap();
        let text = explain_visibility(&Aabb::new(Vec3::splat(12.0), Vec3::splat(13.0)), &volume);
        assert!(
            text.contains("plane 1") && text.contains("-2e0") && text.contains("not visible"),
            "{text}"
        );
    }
}
