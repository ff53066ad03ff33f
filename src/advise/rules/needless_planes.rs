//! Planes that the whole scene lies within: a camera does not need them. The
//! far plane first of all, which paths often put behind the scene.

use std::rc::Rc;

use super::super::case::Case;
use super::super::omission::{By, Draft, Forced, LeftOutIf, Omission, Way};
use super::super::rule::{Rule, Unfit};
use crate::culling::CameraView;
use crate::geometry::{Aabb, ConvexVolume, FrustumPlane};
use crate::index::DynIndex;
use crate::query::Predicate;
use crate::shown::counted;

pub(super) const RULE: Rule = Rule {
    name: "needless-planes",
    left_out: "planes that the whole scene is inside of",
    advice: [
        "skip the planes that the whole scene is inside of",
        "test every plane: the scene reaches beyond them",
    ],
    statistic_name: "share of all planes that the n-vertex of the scene's bounds is inside of",
    left_out_if: LeftOutIf::AtLeast,
    by: By::Time,
    prepare,
};

/// Share of the planes below which the saving is lost in noise.
const THRESHOLD: f64 = 0.01;

fn prepare<'c>(case: &'c Case<'c>, omission: Omission) -> Result<Draft<'c>, Unfit> {
    let bounds = &case.scene().bounds;
    let (mut needless, mut far, mut all) = (0, 0, 0);
    let mut fewer = Vec::with_capacity(case.workload.views.len());
    for volume in case.volumes() {
        let left = without_needless(volume, bounds);
        all += volume.planes().len();
        needless += volume.planes().len() - left.planes().len();
        far += usize::from(is_far_needless(volume, bounds));
        fewer.push(CameraView::Volume(left));
    }
    let share = needless as f64 / all.max(1) as f64;
    let cameras = case.workload.views.len();
    let omission = omission.compares(share, THRESHOLD).because(format!(
        "the whole scene is inside of {needless} of {}, and of the far plane for {far} of {}",
        counted(all, "plane"),
        counted(cameras, "camera")
    ));
    let fewer = Rc::new(fewer);
    let scan: Rc<dyn DynIndex> = Rc::from(case.scan.build(&case.scene().items)?);
    let views = fewer.clone();
    let on_tree = Forced {
        on: case.spec.label.clone(),
        kept: Way::Base,
        left_out: Way::Other(Box::new(move |n, out| {
            case.index.query(views[n].as_any(), out);
        })),
        same: true,
        judged: true,
    };
    let other = scan.clone();
    let on_scan = Forced {
        on: case.scan.label.clone(),
        kept: Way::Other(Box::new(move |n, out| {
            other.query(case.workload.views[n].as_any(), out);
        })),
        left_out: Way::Other(Box::new(move |n, out| scan.query(fewer[n].as_any(), out))),
        same: true,
        judged: true,
    };
    Ok(omission.draft(vec![on_tree, on_scan]))
}

/// The volume without planes that contain the bounds: whatever lies within the
/// bounds gets the same verdict, since plane tests are monotone.
fn without_needless(volume: &ConvexVolume, bounds: &Aabb) -> ConvexVolume {
    let indexed = volume.planes().iter().zip(0..);
    let needed = indexed.filter(|(_, index)| !volume.contains(*index, bounds));
    let needed: Vec<_> = needed.map(|(plane, _)| *plane).collect();
    // Finite planes, and no more of them than there were.
    ConvexVolume::from_planes(&needed).unwrap_or_else(|_| volume.clone())
}

fn is_far_needless(volume: &ConvexVolume, bounds: &Aabb) -> bool {
    let far = volume.plane(FrustumPlane::Far);
    far.is_some_and(|far| far.contains(bounds))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Plane;
    use glam::Vec3;

    #[test]
    fn planes_that_cut_the_scene_stay() {
        let planes = [
            // Cuts the bounds; holds them; just holds them; excludes them.
            Plane::new(Vec3::X, 0.0),
            Plane::new(Vec3::Y, 5.0),
            Plane::new(Vec3::Z, 1.0),
            Plane::new(-Vec3::Z, -2.0),
        ];
        let volume = ConvexVolume::from_planes(&planes).unwrap();
        let bounds = Aabb::new(Vec3::splat(-1.0), Vec3::splat(1.0));
        let left = without_needless(&volume, &bounds);
        assert_eq!(left.planes(), [planes[0], planes[3]]);
        let none = without_needless(&ConvexVolume::from_planes(&planes[1..3]).unwrap(), &bounds);
        assert!(none.planes().is_empty() && none.sees(&bounds));
    }
}
