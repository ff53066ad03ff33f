//! Up to eight planes side by side, tested against one box at once.
//!
//! Each lane computes [`Plane::excludes`] or [`Plane::contains`].

use super::{Aabb, Plane};

/// Most planes of one [`PlaneRows`].
pub const ROW_LANES: usize = 8;

type Row = [f32; ROW_LANES];

/// The planes as four rows: normal x, y, z, then d.
///
/// 128 bytes. Lanes without a plane hold zeros: no constraint.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct PlaneRows {
    rows: [Row; 4],
    count: u32,
}

impl PlaneRows {
    /// Collects planes into rows; `None` if there are more than [`ROW_LANES`].
    pub fn collect<'p>(planes: impl Iterator<Item = &'p Plane>) -> Option<PlaneRows> {
        let mut all = PlaneRows {
            rows: [[0.0; ROW_LANES]; 4],
            count: 0,
        };
        for plane in planes {
            let lane = all.count as usize;
            if lane == ROW_LANES {
                return None;
            }
            let values = plane.normal.to_array().into_iter().chain([plane.d]);
            for (row, value) in all.rows.iter_mut().zip(values) {
                row[lane] = value;
            }
            all.count += 1;
        }
        Some(all)
    }

    /// Number of planes.
    #[inline(always)]
    pub fn count(&self) -> u32 {
        self.count
    }

    /// The planes, in the order in which they were collected.
    pub fn planes(&self) -> impl Iterator<Item = Plane> {
        let [x, y, z, d] = self.rows;
        let plane = move |i: usize| Plane::new(glam::Vec3::new(x[i], y[i], z[i]), d[i]);
        (0..self.count as usize).map(plane)
    }

    /// The values at the p-vertices if `FAR`, else at the n-vertices.
    ///
    /// The p-vertex needs no test of the normal's sign: rounding is monotone, so the larger of
    /// `n * min` and `n * max` is `n` times its coordinate, up to the sign of a zero, which no
    /// comparison distinguishes.
    // Loops instead of closures: what the compiler does not inline is not compiled for the
    // instruction set in use.
    #[inline(always)]
    fn values<const FAR: bool>(&self, b: &Aabb) -> Row {
        let [nx, ny, nz, d] = &self.rows;
        let mut values = [0.0; ROW_LANES];
        for i in 0..ROW_LANES {
            let x = pick::<FAR>([nx[i] * b.min.x, nx[i] * b.max.x]);
            let y = pick::<FAR>([ny[i] * b.min.y, ny[i] * b.max.y]);
            let z = pick::<FAR>([nz[i] * b.min.z, nz[i] * b.max.z]);
            values[i] = ((x + y) + z) + d[i];
        }
        values
    }

    /// [`PlaneRows::exclude`] and [`PlaneRows::contain`] from the same products.
    #[inline(always)]
    pub fn exclude_contain(&self, b: &Aabb) -> (bool, bool) {
        let [nx, ny, nz, d] = &self.rows;
        let (mut excluded, mut contained) = (false, true);
        for i in 0..ROW_LANES {
            let x = [nx[i] * b.min.x, nx[i] * b.max.x];
            let y = [ny[i] * b.min.y, ny[i] * b.max.y];
            let z = [nz[i] * b.min.z, nz[i] * b.max.z];
            let far = (pick::<true>(x) + pick::<true>(y)) + pick::<true>(z);
            let near = (pick::<false>(x) + pick::<false>(y)) + pick::<false>(z);
            excluded |= far + d[i] < 0.0;
            contained &= near + d[i] >= 0.0;
        }
        (excluded, contained)
    }

    /// Returns whether any plane excludes the (finite) box.
    #[inline(always)]
    pub fn exclude(&self, b: &Aabb) -> bool {
        let values = self.values::<true>(b);
        values.iter().fold(false, |any, value| any | (*value < 0.0))
    }

    /// Returns whether every plane contains the (finite) box.
    #[inline(always)]
    pub fn contain(&self, b: &Aabb) -> bool {
        let values = self.values::<false>(b);
        values.iter().fold(true, |all, value| all & (*value >= 0.0))
    }
}

/// The larger of two numbers if `LARGER`, else the smaller.
#[inline(always)]
fn pick<const LARGER: bool>([p, q]: [f32; 2]) -> f32 {
    let first = if LARGER { p > q } else { p < q };
    if first { p } else { q }
}

#[cfg(test)]
mod tests {
    use super::super::tests_arbitrary::{number, vector};
    use super::*;
    use glam::Vec3;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]
        #[test]
        fn all_at_once_is_each_by_itself(
            a in vector(),
            b in vector(),
            planes in prop::collection::vec((vector(), number()), 0..=ROW_LANES),
        ) {
            let b = Aabb::new(a.min(b), a.max(b));
            let planes: Vec<Plane> = planes.into_iter().map(|(n, d)| Plane::new(n, d)).collect();
            let rows = PlaneRows::collect(planes.iter()).expect("eight at most");
            prop_assert_eq!(rows.exclude(&b), planes.iter().any(|plane| plane.excludes(&b)));
            prop_assert_eq!(rows.contain(&b), planes.iter().all(|plane| plane.contains(&b)));
            prop_assert_eq!(rows.exclude_contain(&b), (rows.exclude(&b), rows.contain(&b)));
            prop_assert!(rows.planes().eq(planes));
        }
    }

    #[test]
    fn nine_planes_are_too_many() {
        let planes = [Plane::new(Vec3::X, 0.0); ROW_LANES + 1];
        assert!(PlaneRows::collect(planes[..ROW_LANES].iter()).is_some());
        assert!(PlaneRows::collect(planes.iter()).is_none());
    }
}
