//! The property of all views: a structure is queried with each kind there is and
//! compared with the scan. Other properties vary the planes of a volume; this one
//! varies what is made of them.

use super::*;
use crate::geometry::{ConvexVolumeF64, PlaneF64, RelativeVolume, Spheres, sphere_cube};
use crate::query::QueryVolume;

/// `visible` returns exactly `{ i : view.sees(items[i]) }` for every kind of
/// [`QueryVolume`], over the items and over the cubes of their spheres; a counted
/// query gives the same ids and evaluates no plane twice.
pub fn every_view_sees_what_the_scan_sees<T: RegionIndex>() -> Outcome {
    // Every kind of plane set, not each of them at each of its places.
    each(edges(), |asked, index: &mut T| {
        check(asked, index, 5, usize::MAX)
    })?;
    each(cases(SEEDS), |asked, index: &mut T| {
        check(asked, index, 1, 1)
    })?;
    each(generated_scenes(500)?, |asked, index: &mut T| {
        check(asked, index, 1, 3)
    })
}

/// Queries with every kind of view of some of the volumes.
fn check<T: RegionIndex>(asked: &Questions, index: &T, step: usize, most: usize) -> Outcome {
    let items = &asked.items;
    let cubes: Vec<Aabb> = items.iter().map(sphere_cube).collect();
    let index_of_cubes: T = build(&cubes)?;
    let input = Input::new(&cubes).spheres(true);
    let of_spheres = T::build(&input, &T::Params::default()).map_err(|e| e.to_string())?;
    for volume in asked.volumes.iter().step_by(step).take(most) {
        let wide =
            ConvexVolumeF64::from_planes(&finer(volume)).map_err(|error| error.to_string())?;
        right("planes", index, items, volume)?;
        let spheres = Spheres::new(volume);
        right("spheres", &index_of_cubes, &cubes, &spheres)?;
        right("spheres in blocks", &of_spheres, &cubes, &spheres)?;
        right("f64 planes", index, items, &wide)?;
        let eye = items.first().map_or(Vec3::ONE, |b| b.max);
        // A plane may leave f32 on its way to the eye.
        if let Ok(relative) = RelativeVolume::about(eye, volume) {
            right("planes about the eye", index, items, &relative)?;
        }
    }
    // A box at either end, and all of them.
    let ends = [items.first(), items.last()].into_iter().flatten().copied();
    let sought = ends.chain([Aabb::union_of(items)]);
    let mut sound = sought.filter(|b| !b.is_empty());
    sound.try_for_each(|sought| right("a box", index, items, &sought))
}

/// Planes that are none of f32.
fn finer(volume: &ConvexVolume) -> Vec<PlaneF64> {
    let planes = volume.planes().iter().map(PlaneF64::from);
    let turned = planes.map(|p| PlaneF64::new(p.normal * (1.0 + 1e-9), p.d));
    turned.collect()
}

fn right<T: RegionIndex, Q: QueryVolume>(
    kind: &str,
    index: &T,
    items: &[Aabb],
    view: &Q,
) -> Outcome {
    let why = |b: &Aabb| format!("{b:?} is seen: {}", view.sees(b));
    is_right(kind, index, items, view, why)?;
    counts_are_plausible(index, view).map_err(|error| format!("{kind}: {error}"))
}
