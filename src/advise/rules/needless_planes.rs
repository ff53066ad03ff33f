//! Planes that the whole scene lies within: a camera does not need them. The
//! far plane first of all, which paths often put behind the scene.

use std::rc::Rc;

use super::super::rule::{Draft, Finding, Unfit};
use super::super::trials::{BASE, Sides, Trials};
use crate::culling::CameraView;
use crate::geometry::{Aabb, ConvexVolume, FrustumPlane};
use crate::index::DynIndex;
use crate::query::Predicate;
use crate::shown::counted;

/// Share of the planes below which the saving is lost in noise.
const THRESHOLD: f64 = 0.01;

pub(super) fn prepare(trials: &mut Trials) -> Result<Draft, Unfit> {
    let case = trials.case;
    let bounds = &case.scene().bounds;
    let (mut needless, mut far, mut all) = (0, 0, 0);
    let mut fewer = Vec::with_capacity(case.cameras());
    for volume in case.volumes() {
        let left = without_needless(volume, bounds);
        all += volume.planes().len();
        needless += volume.planes().len() - left.planes().len();
        let far_plane = volume.plane(FrustumPlane::Far);
        far += usize::from(far_plane.is_some_and(|far| far.contains(bounds)));
        fewer.push(CameraView::Volume(left));
    }
    let share = needless as f64 / all.max(1) as f64;
    let reason = format!(
        "the whole scene is inside of {needless} of {}, and of the far plane for {far} of {}",
        counted(all, "plane"),
        counted(case.cameras(), "camera")
    );
    let fewer: Rc<[CameraView]> = fewer.into();
    let scan: Rc<dyn DynIndex> = case.scan.build(&case.scene().items)?.into();
    let on_tree = trials.index(&*case.index, fewer.clone());
    let [kept, left_out] = [
        trials.index(scan.clone(), case.views()),
        trials.index(scan, fewer),
    ];
    let sides = vec![
        Sides::same(&case.spec.label, BASE, on_tree),
        Sides::same(&case.scan.label, kept, left_out),
    ];
    Ok(Draft::new(
        sides,
        Finding::new(share, THRESHOLD, reason)
            .noted(format!("scene is inside {:.0} % of them", share * 100.0)),
    ))
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
