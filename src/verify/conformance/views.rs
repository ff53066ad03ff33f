//! The property of all views: a structure is asked with each kind there is and
//! compared with the look at every item. Which planes a volume is made of is
//! the other properties' business; here it is what is made of the planes.

use super::*;
use crate::geometry::{RelativeVolume, Spheres, WidePlane, WideVolume, sphere_cube};
use crate::query::View;

/// `visible` returns exactly `{ i : view.sees(items[i]) }` for every kind of
/// [`View`], over the items and over the cubes of their spheres; a counted
/// query gives the same ids and evaluates no plane twice.
pub fn every_view_sees_what_the_scan_sees<T: FrustumQuery>() -> Result<(), String> {
    for (name, items) in edge_scenes() {
        let volumes = edge_volumes(&items);
        // Every kind of plane set, not each of them at each of its places.
        check::<T>(name, &items, volumes.iter().step_by(5))?;
    }
    for seed in SEEDS {
        let case = RandomCase::new(seed);
        let scene = format!("random case {seed}");
        check::<T>(&scene, &case.items, [&case.volume])?;
    }
    for (questions, items) in generated_scenes(500)? {
        check::<T>(&questions.scene, &items, questions.volumes.iter().take(3))?;
    }
    Ok(())
}

fn check<'v, T: FrustumQuery>(
    scene: &str,
    items: &[Aabb],
    volumes: impl IntoIterator<Item = &'v ConvexVolume>,
) -> Result<(), String> {
    let cubes: Vec<Aabb> = items.iter().map(sphere_cube).collect();
    let (index, index_of_cubes): (T, T) = (build(scene, items)?, build(scene, &cubes)?);
    for volume in volumes {
        let spheres = Spheres::new(volume);
        let wide = WideVolume::from_planes(&finer(volume)).map_err(|error| error.to_string())?;
        right("planes", scene, &index, items, volume)?;
        right("spheres", scene, &index_of_cubes, &cubes, &spheres)?;
        right("f64 planes", scene, &index, items, &wide)?;
        let eye = items.first().map_or(Vec3::ONE, |b| b.max);
        // A plane may leave f32 on its way to the eye.
        if let Ok(relative) = RelativeVolume::about(eye, volume) {
            right("planes about the eye", scene, &index, items, &relative)?;
        }
    }
    Ok(())
}

/// Planes that are none of f32.
fn finer(volume: &ConvexVolume) -> Vec<WidePlane> {
    let planes = volume.planes().iter().map(WidePlane::from);
    let turned = planes.map(|p| WidePlane::new(p.normal * (1.0 + 1e-9), p.d));
    turned.collect()
}

fn right<T: FrustumQuery, V: View>(
    kind: &str,
    scene: &str,
    index: &T,
    items: &[Aabb],
    view: &V,
) -> Result<(), String> {
    let mut reference = Reference::new(items.len());
    let wanted = items.iter().zip(0..).filter(|(b, _)| view.sees(b));
    reference.expect(wanted.map(|(_, id)| id));
    let (mut found, mut counted, mut cost) = (Vec::new(), Vec::new(), QueryCost::default());
    let _ = index.visible(view, &mut found, &mut NoRecorder);
    let _ = index.visible(view, &mut counted, &mut cost);
    let difference = reference.compare(&found);
    let most = cost.comparisons() * u64::from(view.mask().count_ones());
    let holds = difference.is_none() && found == counted && cost.planes_tested <= most;
    ensure(holds, || {
        let first = difference.first.and_then(|id| items.get(id as usize));
        let seen = first.map(|b| (b, view.sees(b)));
        format!(
            "{} on '{scene}', {kind}: {difference} (box and whether it is seen: {seen:?}); \
             {} ids when counted, {cost:?}",
            T::INFO.name,
            counted.len()
        )
    })
}
