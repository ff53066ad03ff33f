//! Cross-checks of structures: the reference answer, and comparisons with it.
//!
//! The reference is a linear loop; the first difference is described in words. Random and
//! degenerate scenes and volumes are in `cases`, the contract of a structure as tests in
//! [`conformance`]. Nothing here is timed.

mod cases;
pub mod conformance;
mod trial;
mod truth;

use std::fmt;

use glam::Vec3;

use crate::geometry::Aabb;
use crate::query::{AnyVolume, ItemId};

pub(crate) use cases::variants;
pub use cases::{RandomCase, VOLUME_KINDS, edge_scenes, edge_volumes, points_on_faces};
pub use trial::{Fault, Trial};
pub use truth::{ErrorCount, Truth};

/// Reference answer: the ids of the items that satisfy a test, by a linear loop.
pub fn scan(items: &[Aabb], sees: impl Fn(&Aabb) -> bool) -> impl Iterator<Item = ItemId> {
    let seen = items.iter().zip(0..).filter(move |(b, _)| sees(b));
    seen.map(|(_, id)| id)
}

/// Difference between a structure's answer and the reference.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug)]
pub struct Difference {
    /// Items of the reference that were not returned (false negatives).
    pub missing: usize,
    /// Returned items that are not in the reference.
    pub extra: usize,
    /// Repeated items, and ids that do not exist.
    pub invalid: usize,
    /// First differing item.
    pub first: Option<ItemId>,
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

/// Describes a view's verdict about one box.
///
/// For a volume of f32 planes it gives the plane with the lowest p-vertex value, so that a reader
/// can check by hand.
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
        return format!("{bounds}: the volume has no plane, so it sees every box");
    };
    let (plane, label) = (volume.planes()[index], volume.plane_label(index));
    let ([x, y, z], d) = (plane.normal.to_array(), plane.d);
    let highest = plane.value_at(plane.n_vertex(b));
    let not = if value < 0.0 { "not " } else { "" };
    format!(
        "{bounds}: {label} ({x}, {y}, {z}, {d}) has the lowest p-vertex value {value:e} \
         (n-vertex {highest:e}), so the box is {not}visible"
    )
}

/// Describes whether a box contains a point, for region search.
pub fn explain_containment(b: &Aabb, p: Vec3) -> String {
    let [min, max] = [b.min, b.max].map(|corner| corner.to_array());
    let holds = ["does not hold", "holds"][usize::from(b.contains_point(p))];
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
        let mut trial = Trial::new(items.len());
        trial.set_view(&items, &half);
        assert_eq!(trial.expected, 3);
        assert!(trial.run(|out| out.extend([5, 3, 4])).is_ok());
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
            let found = trial.run(|out| out.extend(answer)).unwrap_err();
            assert_eq!(found, Fault::Differs(wanted), "{answer:?}");
            let right = trial.run(|out| out.extend([3, 4, 5]));
            assert!(right.is_ok(), "state is restored");
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
