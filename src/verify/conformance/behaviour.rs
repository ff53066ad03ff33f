//! Properties of views, of region search, of refits and of declared capabilities.
//!
//! A structure is queried with each kind of view, and with one point and many. It is refitted, or
//! rebuilt if it declines. It must have exactly the capabilities that it declares.

use glam::Vec3;

use super::super::edge_volumes;
use super::*;
use crate::geometry::{ConvexVolumeF64, PlaneF64, PlaneTree, RelativeVolume, Spheres, sphere_cube};
use crate::index::QueryMany;
use crate::kernel::Kernel;
use crate::query::{Located, QueryVolume, Ranges};
use crate::threads::Pool;

/// Checks that `visible` returns exactly `{ i : view.sees(items[i]) }`.
///
/// For every kind of [`QueryVolume`], over the items and over the cubes of their spheres.
pub fn every_view_sees_what_the_scan_sees<T: RegionIndex>() -> Outcome {
    // Queries every kind of view of some of the volumes.
    let some = |step, most| {
        move |queries: &mut QuerySet, index: &mut T| {
            let cubes = cubes(queries);
            let of_cubes: [T; 2] = [build(&cubes)?, build_of_spheres(&cubes)?];
            views_are_right(queries, index, &of_cubes, step, most)
        }
    };
    // Every kind of plane set, but not at every position.
    each(edges(), some(5, usize::MAX))?;
    each(cases(SEEDS), some(1, 1))?;
    each(generated_scenes(500)?, some(1, 3))
}

fn cubes(queries: &QuerySet) -> Vec<Aabb> {
    queries.items.iter().map(sphere_cube).collect()
}

fn build_of_spheres<T: RegionIndex>(cubes: &[Aabb]) -> Result<T, String> {
    build_from(&Input::new(cubes).spheres(true))
}

fn views_are_right<T: RegionIndex>(
    queries: &QuerySet,
    index: &T,
    of_cubes: &[T],
    step: usize,
    most: usize,
) -> Outcome {
    let (items, cubes) = (&queries.items, cubes(queries));
    // The first three are kinds of their own.
    let (odd, rest) = queries.volumes.split_at(queries.volumes.len().min(3));
    for volume in odd.iter().chain(rest.iter().step_by(step)).take(most) {
        let wide = ConvexVolumeF64::from_planes(&finer(volume));
        let wide = wide.map_err(|error| error.to_string())?;
        right("planes", index, items, volume)?;
        let spheres = Spheres::new(volume);
        for index in of_cubes {
            right("spheres", index, &cubes, &spheres)?;
            right("planes, built of spheres", index, &cubes, volume)?;
        }
        right("f64 planes", index, items, &wide)?;
        let eye = items.first().map_or(Vec3::ONE, |b| b.max);
        // A plane relative to the eye may overflow f32.
        if let Ok(relative) = RelativeVolume::about(eye, volume) {
            right("planes about the eye", index, items, &relative)?;
        }
    }
    // The first and the last box, and the union of all.
    let ends = [items.first(), items.last()].into_iter().flatten().copied();
    let mut sought = ends.chain([Aabb::union_of(items)]);
    sought.try_for_each(|sought| {
        right("a box", index, items, &sought)?;
        let inverted = Aabb::new(sought.max, sought.min);
        right("a box, inverted", index, items, &inverted)
    })
}

/// Planes whose normals are not in f32.
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
    is_right(kind, index, items, view, why)
}

/// Checks that a point query returns exactly the closed boxes that contain it.
pub fn region_search_is_the_closed_box_scan<T: RegionIndex>() -> Outcome {
    let scenes = edges().chain(cases(SEEDS)).chain(generated_scenes(500)?);
    each(scenes, |set, index: &mut T| set.locate_is_right(index))
}

/// Checks that `query_many` passes the ids of `query` for every point, in order.
///
/// For batches of any size, with points that are repeated, lie on faces or outside, or are not
/// finite.
pub fn many_points_are_answered_as_one_by_one<T: RegionIndex>() -> Outcome {
    let scenes = edges().chain(cases(SEEDS)).chain([cells()]);
    let scenes = scenes.chain(generated_scenes(500)?);
    each(scenes, |queries, index: &mut T| {
        let mut points = queries.points.clone();
        let strange = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX];
        for value in strange {
            points.push(Vec3::splat(value));
            points.extend(queries.points.iter().take(4).map(|p| p.with_y(value)));
        }
        // Repeated points, next to each other in a batch and far apart.
        points.extend_from_within(points.len() / 2..);
        for count in [0, 1, 3, points.len()] {
            many_are_right(&queries.items, index, &points[..count.min(points.len())])?;
        }
        Ok(())
    })
}

/// Searches a batch of points with the portable and with the best kernel.
fn many_are_right<T: RegionIndex>(items: &[Aabb], index: &T, points: &[Vec3]) -> Outcome {
    let (mut trial, count) = (Trial::new(items.len()), points.len());
    for kernel in [Kernel::Portable, Kernel::best()] {
        let mut many = Located::default();
        let out = &mut many;
        kernel.run(QueryMany { index, points, out });
        ensure(many.len() == count, || {
            format!("{} of {count} points answered", many.len())
        })?;
        for (&p, found) in points.iter().zip(many.iter()) {
            trial.set_expected(scan(items, |b| b.contains_point(p)));
            let alone = ids_of(index, &p);
            let answer = trial.run(|ids| ids.extend_from_slice(found));
            let fault = answer.err().map(|fault| fault.explained(|_| None));
            let fault = fault.unwrap_or_default();
            // Another kernel may find them in another order.
            let in_order = found == alone || kernel != Kernel::Portable;
            ensure(fault.is_empty() && in_order, || {
                format!("{p} among {count} points: {fault}; {found:?}, alone {alone:?}")
            })?;
        }
    }
    Ok(())
}

/// Cells that tile a block, with points relative to it.
///
/// Points are inside, on faces, edges and corners, and outside of the block.
fn cells() -> QuerySet {
    const SIDE: u16 = 11;
    let at = |x: u16, y: u16, z: u16| Vec3::from([x, y, z].map(f32::from));
    let grid = |i: u16| at(i % SIDE, i / SIDE % SIDE, i / SIDE / SIDE);
    let items = (0..SIDE * SIDE * SIDE).map(|i| Aabb::new(grid(i), grid(i) + 1.0));
    // Multiples of one half: every other coordinate is on a face.
    let points = (0..2 * SIDE * SIDE).map(|i| {
        let step = i.wrapping_mul(31);
        at(i % 23, step % 23, step / 23 % 25) * 0.5
    });
    QuerySet {
        scene: "cells".to_owned(),
        items: items.collect(),
        volumes: vec![],
        points: points.collect(),
    }
}

/// Updates an index: refits it if it can, else rebuilds it.
///
/// An index that declines must not have changed.
fn update<T: RegionIndex>(index: &mut T, queries: &QuerySet, moved: &[ItemId]) -> Outcome {
    let before = queries.answers(index);
    if index.refit(&queries.items, moved) {
        return Ok(());
    }
    ensure(before == queries.answers(index), || {
        "refit refused, but changed the structure".to_owned()
    })?;
    *index = build(&queries.items)?;
    Ok(())
}

/// Consecutive updates, to reveal errors that accumulate.
const MANY_UPDATES: usize = 50;

/// Checks that a refitted structure answers like a newly built one.
///
/// After 0.1 %, 1 %, 10 % and 100 % of the items have moved, one after the other, and all of them
/// far away: every view, and points one by one and many.
pub fn refit_equals_a_fresh_build<T: RegionIndex>() -> Outcome {
    let degenerate = ["all the same", "needles", "inverted among sound"];
    let degenerate = edges().filter(|queries| degenerate.contains(&queries.scene.as_str()));
    let scenes = generated_scenes(1000)?.into_iter().chain(degenerate);
    each(scenes, |queries, index: &mut T| {
        let mut rng = SeededRng::new(11);
        let width = f64::from(Aabb::union_of(&queries.items).extent().max_element());
        let mut of_spheres: [T; 1] = [build_of_spheres(&cubes(queries))?];
        update(index, queries, &[])?;
        for (step, away) in [(1000, 0.0), (100, 0.0), (10, 0.0), (1, 0.0), (1, 1e6)] {
            let all = 0..queries.items.len() as ItemId;
            let moved: Vec<ItemId> = all.skip(step / 3).step_by(step).collect();
            for (at, &id) in moved.iter().enumerate() {
                // Most move a little, some far.
                let far = if at % 5 == 0 { 0.5 } else { 0.01 };
                let by = (rng.normal3() * width * far + away).as_vec3();
                let b = &mut queries.items[id as usize];
                // One in three grows too.
                let grown = if at % 3 == 0 {
                    b.max - b.min
                } else {
                    Vec3::ZERO
                };
                *b = Aabb::new(b.min + by, b.max + by + grown.max(Vec3::ZERO));
            }
            // In any order, with a duplicate.
            let reported: Vec<ItemId> = moved.iter().rev().chain(moved.first()).copied().collect();
            update(index, queries, &reported)?;
            if !of_spheres[0].refit(&cubes(queries), &reported) {
                of_spheres = [build_of_spheres(&cubes(queries))?];
            }
            queries.points = points(&queries.items);
            let corners = moved.iter().map(|&id| queries.items[id as usize].max);
            queries.points.extend(corners.take(20));
            if away > 0.0 {
                queries.volumes = edge_volumes(&queries.items);
            }
            let right = queries.both_are_right(index);
            let right = right.and_then(|()| match step {
                1 => views_are_right(queries, index, &of_spheres, 5, 3)
                    .and_then(|()| many_are_right(&queries.items, index, &queries.points)),
                _ => Ok(()),
            });
            right.map_err(|error| format!("after {} moves: {error}", moved.len()))?;
        }
        for round in 0..MANY_UPDATES {
            let id = round * 7 % queries.items.len();
            let (b, by) = (&mut queries.items[id], (rng.normal3() * width).as_vec3());
            *b = Aabb::new(b.min + by, b.max + by);
            if !index.refit(&queries.items, &[id as ItemId]) {
                *index = build(&queries.items)?;
            }
        }
        let right = queries.both_are_right(index);
        right.map_err(|error| format!("after {MANY_UPDATES} updates: {error}"))
    })
}

/// Checks that an emptied item disappears, and that one that becomes sound appears.
pub fn items_that_come_and_go_are_followed<T: RegionIndex>() -> Outcome {
    let names = ["one", "coplanar", "inverted among sound", "only inverted"];
    let scenes = edges().filter(|queries| names.contains(&queries.scene.as_str()));
    each(scenes, |queries, _: &mut T| {
        let last = queries.items.len() as ItemId - 1;
        let all: Vec<ItemId> = (0..=last).collect();
        // The first and then the last item are inverted (a sound box becomes empty and vice versa)
        // and restored, then all at once.
        let steps = [vec![0], vec![0], vec![last], vec![last], all.clone(), all];
        for expected in [false, true] {
            let mut index: T = build_from(&Input::new(&queries.items).come_and_go(expected))?;
            let right = queries.both_are_right(&index);
            right.map_err(|error| format!("built with come_and_go {expected}: {error}"))?;
            for moved in &steps {
                for &id in moved {
                    let b = &mut queries.items[id as usize];
                    *b = Aabb::new(b.max, b.min);
                }
                update(&mut index, queries, moved)?;
                let right = queries.both_are_right(&index);
                right.map_err(|error| format!("{} items turned about: {error}", moved.len()))?;
            }
        }
        Ok(())
    })
}

/// Checks the structure's [`Info`](crate::index::Info) against its behaviour.
///
/// It accepts moved items if it declares refits, and declines them otherwise. It has a tree order
/// if it declares one, and then answers in ranges of it are the reference set. A build reads the
/// number of threads exactly if it declares a threaded build, and answers the same with several.
pub fn declared_capabilities_are_true<T: RegionIndex>() -> Outcome {
    let says = T::INFO;
    each(generated_scenes(500)?, |queries, index: &mut T| {
        // Every run calls these: they must not panic.
        let _ = (index.chose(), index.cells().len());
        ensure(index.memory().item_bytes > 0, || {
            "memory() tells no bytes of items".to_owned()
        })?;
        let ordered = index.tree_order().is_some();
        ensure(ordered == says.ranges, || {
            let (says, has) = (says.ranges, if ordered { "has" } else { "lacks" });
            format!("declares ranges: {says}, yet {has} a tree order")
        })?;
        if let Some(ids) = index.tree_order() {
            for volume in &queries.volumes {
                let mut ranges = Vec::new();
                let mut sink = Ranges::onto(&mut ranges);
                let _ = query(index, volume, &mut sink, &mut NoRecorder);
                let places = ranges.into_iter().flatten();
                let found = places.map(|place| ids.get(place as usize).copied());
                let found: Option<Vec<ItemId>> = found.collect();
                let wanted = sorted(ids_of(index, volume));
                ensure(found.map(sorted).as_ref() == Some(&wanted), || {
                    let count = wanted.len();
                    format!("its ranges are not the {count} items that it sees")
                })?;
            }
        }
        let pool = Pool::new(3);
        let shared: T = build_from(&Input::new(&queries.items).pool(&pool))?;
        let was_used = pool.was_used();
        ensure(was_used == says.threaded_build, || {
            let says = says.threaded_build;
            format!("declares threaded-build: {says}, yet its build asks for threads: {was_used}")
        })?;
        ensure(queries.answers(&shared) == queries.answers(index), || {
            "built on three threads, answered differently".to_owned()
        })?;
        let (input, tree) = (Input::new(&queries.items), PlaneTree::default());
        let changing: T = build_from(&input.come_and_go(true).own_tree(Some(&tree)))?;
        let right = queries.both_are_right(&changing);
        right.map_err(|error| format!("built for items that come and go: {error}"))?;
        let moved: Vec<ItemId> = (0..queries.items.len() as ItemId).step_by(7).collect();
        for &id in &moved {
            let b = &mut queries.items[id as usize];
            *b = Aabb::new(b.min + b.extent(), b.max + b.extent());
        }
        let refitted = index.refit(&queries.items, &moved);
        ensure(refitted == says.refits, || {
            let (says, count) = (says.refits, moved.len());
            format!("declares refits: {says}, yet refit of {count} items says {refitted}")
        })
    })
}
