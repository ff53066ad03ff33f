//! Choice of a plane for a group of items: by the median or by surface areas.
//!
//! Each function moves the items behind its plane to the front of the slice and returns their
//! number.

use glam::{DVec3, Vec3};

use crate::geometry::{Aabb, LANES};
use crate::index::items::Record;

/// Moves the records of the back to the front of the slice; returns their number.
///
/// Their order is unspecified. O(n).
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

/// Most items of a leaf whose order is left unspecified: one block.
pub const ARRANGED: usize = LANES;

fn centres(records: &[Record]) -> Aabb {
    Aabb::of_points(records.iter().map(|r| r.bounds.centre()))
}

/// The median along the widest axis, or a plane beside it between two layers.
///
/// Beside it if the median would separate items with one centre: regions that tile space lie in
/// layers, and a plane between two layers cuts none of them. Axes are tried widest first. A side
/// gets at least a quarter of the items (at least one, if there are few); if no axis allows that,
/// the median divides the layer.
pub fn between_layers(records: &mut [Record]) -> (Vec3, usize) {
    let centres = centres(records);
    let width = centres.half_extent();
    let mut axes = [0, 1, 2];
    axes.sort_by(|&a, &b| width[b].total_cmp(&width[a]));
    let (count, half) = (records.len(), records.len() / 2);
    let quarter = count.div_ceil(4);
    // Few items may be divided unevenly: at most fifteen more levels.
    let sizes: &[usize] = match count <= ARRANGED {
        true => &[quarter, 1],
        false => &[quarter],
    };
    for &least in sizes {
        // No plane perpendicular to an axis separates centres that are equal on it.
        let differ = |k: &usize| centres.min[*k] < centres.max[*k];
        for axis in axes.into_iter().filter(differ) {
            let at = |r: &Record| r.bounds.centre()[axis];
            records
                .select_nth_unstable_by(half, |a, b| at(a).total_cmp(&at(b)).then(a.id.cmp(&b.id)));
            let middle = at(&records[half]);
            let below = records[..half].iter().filter(|r| at(r) < middle).count();
            let above = half + records[half..].iter().filter(|r| at(r) <= middle).count();
            let is_below = half - below <= above - half;
            let nearest = if is_below { below } else { above };
            // The other edge of the layer may be the edge of the group.
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
                return (Vec3::AXES[axis], back);
            }
        }
    }
    // Adding 0.0 makes the two zeros equal.
    let at = |r: &Record| r.bounds.centre()[axes[0]] + 0.0;
    records.select_nth_unstable_by(half, |a, b| at(a).total_cmp(&at(b)).then(a.id.cmp(&b.id)));
    (Vec3::AXES[axes[0]], half)
}

/// Bins per axis of the surface area heuristic.
const BINS: usize = 16;

/// The best of 15 planes per axis, by the sum of area times count of both sides.
///
/// `None` if all centres coincide.
pub fn by_surface_area(records: &mut [Record]) -> Option<(Vec3, usize)> {
    let centres = centres(records);
    let low = centres.min;
    let width = centres.max - low;
    // Width beyond f32's range, or zero: bins would be NaN.
    let scale = Vec3::splat(BINS as f32 * 0.999) / width;
    let is_usable = |k: &usize| scale[*k].is_finite() && scale[*k] > 0.0;
    let usable: Vec<usize> = (0..3).filter(is_usable).collect();
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
    // An empty box has no area; areas of far items are finite only in f64.
    let cost = |(bounds, count): (Aabb, usize)| {
        let e = bounds.extent().as_dvec3().max(DVec3::ZERO);
        (e.x * e.y + e.y * e.z + e.z * e.x) * count as f64
    };
    let mut best: Option<(f64, usize, usize)> = None;
    for &k in &usable {
        let with = |(bounds, count): (Aabb, usize), i: usize| {
            (bounds.union(&bins[k][i].0), count + bins[k][i].1)
        };
        let (mut right, mut above) = ([0.0; BINS], (Aabb::EMPTY, 0));
        for i in (1..BINS).rev() {
            above = with(above, i);
            right[i] = cost(above);
        }
        let mut below = (Aabb::EMPTY, 0);
        for (i, right) in right.into_iter().enumerate().skip(1) {
            below = with(below, i - 1);
            let sum = cost(below) + right;
            let divides = (1..records.len()).contains(&below.1);
            if divides && best.is_none_or(|(lowest, ..)| sum < lowest) {
                best = Some((sum, k, i));
            }
        }
    }
    let (_, k, split) = best?;
    let back = divide(records, |r| bin(r, k) < split);
    Some((Vec3::AXES[k], back))
}
