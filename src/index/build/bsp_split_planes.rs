//! Choice of a plane for a group of items: by the median, by surface areas, across
//! their principal axis, or from their own faces. Each function moves the items
//! behind its plane to the front of the slice and returns their number.

use glam::Vec3;

use crate::geometry::{Aabb, Plane};
use crate::index::items::{Record, bounds_of_centres};
use crate::index::tree::kd_treelets::DESCENT_LEAF;

/// Moves the records that belong to the back to the front of the slice, in any
/// order, and returns their number. O(n).
pub fn divide(records: &mut [Record], to_back: impl Fn(&Record) -> bool) -> usize {
    let mut back = 0;
    for i in 0..records.len() {
        if to_back(&records[i]) {
            records.swap(back, i);
            back += 1;
        }
    }
    back
}

fn centres(records: &[Record]) -> Aabb {
    bounds_of_centres(records.iter().map(|r| r.bounds.centre()))
}

const AXES: [Vec3; 3] = [Vec3::X, Vec3::Y, Vec3::Z];

fn widest_axis(records: &[Record]) -> Vec3 {
    let centres = centres(records);
    let width = centres.max * 0.5 - centres.min * 0.5;
    let widest = (0..3).max_by(|&a, &b| width[a].total_cmp(&width[b]));
    AXES[widest.unwrap_or(0)]
}

/// Halves the records along a direction; ties by id, so that the same items
/// always give the same tree.
fn by_median(records: &mut [Record], normal: Vec3) -> (Vec3, usize) {
    let half = records.len() / 2;
    let along = Plane::new(normal, 0.0);
    records.select_nth_unstable_by(half, |a, b| {
        let at = |r: &Record| along.value_at(r.bounds.centre());
        at(a).total_cmp(&at(b)).then(a.id.cmp(&b.id))
    });
    (normal, half)
}

/// The median along the widest axis, or beside it where it would separate items of
/// one centre: regions that tile space lie in layers, and a plane between two
/// layers cuts none of them. Axis after axis, widest first; a side gets at
/// least a quarter of the items (of few, at least one), or else the layer is
/// divided after all.
pub fn between_layers(records: &mut [Record]) -> (Vec3, usize) {
    let centres = centres(records);
    let width = centres.max * 0.5 - centres.min * 0.5;
    let mut axes = [0, 1, 2];
    axes.sort_by(|&a, &b| width[b].total_cmp(&width[a]));
    let (count, half) = (records.len(), records.len() / 2);
    let quarter = count.div_ceil(4);
    // Few items may be divided unevenly: the depth of small subtrees is bounded separately.
    let sizes: &[usize] = match count <= DESCENT_LEAF {
        true => &[quarter, 1],
        false => &[quarter],
    };
    for &least in sizes {
        // No plane across an axis separates centres with one coordinate on it.
        for axis in axes
            .into_iter()
            .filter(|&k| centres.min[k] < centres.max[k])
        {
            let at = |r: &Record| r.bounds.centre()[axis];
            records
                .select_nth_unstable_by(half, |a, b| at(a).total_cmp(&at(b)).then(a.id.cmp(&b.id)));
            let middle = at(&records[half]);
            let below = records[..half].iter().filter(|r| at(r) < middle).count();
            let above = half + records[half..].iter().filter(|r| at(r) <= middle).count();
            let nearest = if half - below <= above - half {
                below
            } else {
                above
            };
            // The other edge of the layer may be that of the group.
            let nearest = match nearest {
                0 => above,
                all if all == count => below,
                inner => inner,
            };
            if nearest.min(count - nearest) >= least {
                let back = divide(records, |r| match nearest == below {
                    true => at(r) < middle,
                    false => at(r) <= middle,
                });
                return (AXES[axis], back);
            }
        }
    }
    by_median(records, AXES[axes[0]])
}

/// Bins per axis of the surface area heuristic.
const BINS: usize = 16;

/// The best of 15 planes on each axis by area times count, both sides; `None`
/// if all centres coincide.
pub fn by_surface_area(records: &mut [Record]) -> Option<(Vec3, usize)> {
    let centres = centres(records);
    let low = centres.min;
    let width = centres.max - low;
    // Beyond f32's range, or no width at all: bins would be NaN.
    let scale = Vec3::splat(BINS as f32 * 0.999) / width;
    let usable: Vec<usize> = (0..3)
        .filter(|&k| scale[k].is_finite() && scale[k] > 0.0)
        .collect();
    let bin = |r: &Record, k: usize| {
        (((r.bounds.centre()[k] - low[k]) * scale[k]) as usize).min(BINS - 1)
    };
    let mut bins = [[(Aabb::EMPTY, 0usize); BINS]; 3];
    for record in records.iter() {
        for &k in &usable {
            let (bounds, count) = &mut bins[k][bin(record, k)];
            *bounds = bounds.union(&record.bounds);
            *count += 1;
        }
    }
    let mut best: Option<(f32, usize, usize)> = None;
    for &k in &usable {
        let mut right = [0.0; BINS];
        let (mut bounds, mut count) = (Aabb::EMPTY, 0);
        for i in (1..BINS).rev() {
            bounds = bounds.union(&bins[k][i].0);
            count += bins[k][i].1;
            right[i] = half_area(&bounds) * count as f32;
        }
        let (mut bounds, mut count) = (Aabb::EMPTY, 0);
        for i in 1..BINS {
            bounds = bounds.union(&bins[k][i - 1].0);
            count += bins[k][i - 1].1;
            let cost = half_area(&bounds) * count as f32 + right[i];
            if best.is_none_or(|(lowest, _, _)| cost < lowest) && count > 0 && count < records.len()
            {
                best = Some((cost, k, i));
            }
        }
    }
    let (_, k, split) = best?;
    let back = divide(records, |r| bin(r, k) < split);
    Some((AXES[k], back))
}

fn half_area(b: &Aabb) -> f32 {
    let e = b.extent().max(Vec3::ZERO);
    e.x * e.y + e.y * e.z + e.z * e.x
}

/// The median across the principal axis of the centres: the dominant
/// eigenvector of their covariance, by power iteration in f64.
pub fn by_principal_axis(records: &mut [Record]) -> Option<(Vec3, usize)> {
    let centres = centres(records);
    let middle = centres.centre().as_dvec3();
    let width = (centres.max.as_dvec3() - centres.min.as_dvec3()).max_element();
    if width == 0.0 || !width.is_finite() {
        return None;
    }
    let mut covariance = glam::DMat3::ZERO;
    for record in records.iter() {
        let d = (record.bounds.centre().as_dvec3() - middle) / width;
        covariance += glam::DMat3::from_cols(d * d.x, d * d.y, d * d.z);
    }
    let mut axis = widest_axis(records).as_dvec3() + glam::DVec3::new(1e-3, 2e-3, 3e-3);
    for _ in 0..16 {
        axis = (covariance * axis).try_normalize()?;
    }
    Some(by_median(records, axis.as_vec3()))
}

/// Candidate planes of `faces` per node, and items by which they are ranked.
const CANDIDATES: usize = 24;
const JUDGES: usize = 128;

/// The faces of `boxes` of the boxes, and two diagonals through the centre of each:
/// eight planes per box.
pub fn planes_of(records: &[Record], boxes: usize) -> impl Iterator<Item = Plane> {
    let step = records.len().div_ceil(boxes).max(1);
    records.iter().step_by(step).flat_map(|r| {
        let diagonals = [Vec3::new(1.0, 1.0, 0.0), Vec3::new(1.0, -1.0, 0.0)];
        let faces = AXES
            .into_iter()
            .flat_map(|n| [(n, r.bounds.min), (n, r.bounds.max)]);
        let diagonals = diagonals.into_iter().map(|n| (n, r.bounds.centre()));
        let through = |(normal, at)| Plane::through(at, normal);
        faces.chain(diagonals).map(through).collect::<Vec<_>>()
    })
}

/// The plane of some boxes ([`planes_of`]) with the least imbalance plus cut items.
pub fn by_own_planes(records: &mut [Record], cut: f32) -> Option<(Vec3, usize)> {
    let candidates = planes_of(records, CANDIDATES / 8);
    let judges = records.len().div_ceil(JUDGES).max(1);
    let mut best: Option<(f32, Plane)> = None;
    for plane in candidates {
        let (mut balance, mut cuts) = (0i32, 0u32);
        for record in records.iter().step_by(judges) {
            balance += if plane.contains_point(record.bounds.centre()) {
                1
            } else {
                -1
            };
            let crosses = !plane.excludes(&record.bounds) && !plane.contains(&record.bounds);
            cuts += u32::from(crosses);
        }
        let cost = balance.unsigned_abs() as f32 + cut * cuts as f32;
        if best.is_none_or(|(lowest, _)| cost < lowest) {
            best = Some((cost, plane));
        }
    }
    let (_, plane) = best?;
    let back = divide(records, |r| !plane.contains_point(r.bounds.centre()));
    Some((plane.normal, back))
}
