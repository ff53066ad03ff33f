//! Cones per cluster in f32 with a proven margin, sixteen clusters at a time.
//!
//! The test is that of `normal_cone` in lanes. With several cones per cluster each is that of
//! triangles turned alike.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::clusters::Clusters;
use super::contract::{TriangleCull, TriangleRow};
use super::exact::normal;
use super::eye::Eye;
use super::normal_cone::{Cone, Prepared};
use super::selection::Selection;
use crate::kernel::{Isa, Kernel, LANES, LaneMask, Work};
use crate::visibility::Guarantee;

/// The row of one cone per cluster.
pub const ROW: TriangleRow = TriangleRow {
    name: "cone-f32-safe",
    summary: "One normal cone per cluster, sixteen at a time, rounding proven; 28 B",
    guarantee: Guarantee::Conservative,
    build: |clusters| Box::new(SafeCones::of(clusters)),
};

/// The row of four cones per cluster.
pub const ROW_SEVERAL: TriangleRow = TriangleRow {
    name: "several-cones",
    summary: "Four cones per cluster, each of triangles of similar orientation, rounding proven",
    guarantee: Guarantee::Conservative,
    build: |clusters| Box::new(Cones::<4>::of(clusters)),
};

/// Rounds of moving triangles to the nearest of the directions.
const ROUNDS: usize = 8;

/// `N` cones per cluster.
#[derive(Clone, Debug)]
pub struct Cones<const N: usize> {
    /// The `n`-th cones of sixteen clusters side by side.
    cones: Vec<[ConeBlock; N]>,
    /// The triangles of each cone; empty with one cone per cluster, which has all.
    triangles: Vec<[[u64; LANES]; N]>,
}

/// One cone per cluster.
pub type SafeCones = Cones<1>;

impl<const N: usize> Cones<N> {
    /// Fits the cones. O(t).
    pub fn of(clusters: &Arc<Clusters>) -> Cones<N> {
        let blocks = clusters.len().div_ceil(LANES);
        let mut cones = vec![[ConeBlock::EMPTY; N]; blocks];
        let mut words = vec![[[0; LANES]; N]; if N > 1 { blocks } else { 0 }];
        for (cluster, triangles) in clusters.one_sided() {
            let (block, lane) = (cluster / LANES, cluster % LANES);
            let groups = match N {
                1 => [u64::MAX; N],
                _ => groups(&triangles),
            };
            for (n, word) in groups.into_iter().enumerate() {
                let bits = (0..triangles.len()).filter(|bit| word >> bit & 1 == 1);
                let own: Vec<[Vec3; 3]> = bits.map(|bit| triangles[bit]).collect();
                if let Some(cone) = Cone::fit(&own) {
                    cones[block][n].set(lane, &cone);
                    if let Some(words) = words.get_mut(block) {
                        words[n][lane] = word;
                    }
                }
            }
        }
        Cones {
            cones,
            triangles: words,
        }
    }

    /// Reads all cones once: a lower bound of any test of them.
    ///
    /// The value only keeps the compiler from omitting the reads.
    pub fn read(&self, kernel: Kernel) -> u64 {
        kernel.run(Read(bytemuck::cast_slice(self.cones.as_flattened())))
    }
}

impl<const N: usize> TriangleCull for Cones<N> {
    fn cull(&self, eye: &Eye, kernel: Kernel, kept: &mut Selection) {
        if let Some(view) = &Prepared::of(eye) {
            kernel.run(Query {
                all: self,
                view,
                words: kept.blocks_mut(),
            });
        }
    }
}

struct Query<'a, const N: usize> {
    all: &'a Cones<N>,
    view: &'a Prepared,
    words: &'a mut [[u64; LANES]],
}

impl<const N: usize> Work for Query<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let view = Broadcast::of(isa, self.view);
        for (i, words) in self.words.iter_mut().enumerate() {
            for (n, block) in self.all.cones[i].iter().enumerate() {
                let gone = rejected(isa, block, &view);
                match N {
                    1 => clear(words, gone, &[u64::MAX; LANES]),
                    _ => clear(words, gone, &self.all.triangles[i][n]),
                }
            }
        }
    }
}

struct Read<'a>(&'a [[u64; 8]]);

impl Work for Read<'_> {
    type Output = u64;

    #[inline(always)]
    fn run<I: Isa>(self, _: I) -> u64 {
        let mut all = [0; 8];
        for line in self.0 {
            for (all, word) in all.iter_mut().zip(line) {
                *all ^= word;
            }
        }
        all.iter().fold(0, |all, word| all ^ word)
    }
}

/// The triangles in groups of like normals, a bit per triangle.
///
/// The farthest directions first, then each to the nearest mean (Lloyd 1982).
fn groups<const N: usize>(triangles: &[[Vec3; 3]]) -> [u64; N] {
    let normals: Vec<DVec3> = triangles
        .iter()
        .map(|corners| normal(*corners).normalize_or_zero())
        .collect();
    let mut means = [normals.iter().sum::<DVec3>().normalize_or_zero(); N];
    for k in 0..N {
        let known = &means[..k.max(1)];
        let nearest = |n: &DVec3| known.iter().map(|m| m.dot(*n)).fold(-2.0, f64::max);
        let farthest = normals
            .iter()
            .min_by(|a, b| nearest(a).total_cmp(&nearest(b)));
        means[k] = farthest.copied().unwrap_or(DVec3::Z);
    }
    let mut words = [0u64; N];
    for _ in 0..ROUNDS {
        words = [0; N];
        let mut sums = [DVec3::ZERO; N];
        for (bit, n) in normals.iter().enumerate() {
            let best = (1..N).fold(0, |best, k| {
                let is_nearer = means[k].dot(*n) > means[best].dot(*n);
                if is_nearer { k } else { best }
            });
            words[best] |= 1 << bit;
            sums[best] += *n;
        }
        for (mean, sum) in means.iter_mut().zip(sums) {
            *mean = sum.try_normalize().unwrap_or(*mean);
        }
    }
    words
}

/// Sixteen cones in f32: 28 bytes a cone.
#[derive(Clone, Copy, Debug, bytemuck::Zeroable, bytemuck::Pod)]
#[repr(C, align(64))]
struct ConeBlock {
    apex: [[f32; LANES]; 3],
    axis: [[f32; LANES]; 3],
    /// Infinite for a lane that is never rejected.
    square: [f32; LANES],
}

impl ConeBlock {
    /// Sixteen cones that reject nothing.
    const EMPTY: ConeBlock = ConeBlock {
        apex: [[0.0; LANES]; 3],
        axis: [[0.0; LANES]; 3],
        square: [f32::INFINITY; LANES],
    };

    /// Writes a cone.
    fn set(&mut self, lane: usize, cone: &Cone) {
        for k in 0..3 {
            self.apex[k][lane] = cone.apex[k];
            self.axis[k][lane] = cone.axis[k];
        }
        self.square[lane] = cone.square();
    }

    /// Apex and axis, three rows each, and the square of the sine.
    #[inline(always)]
    fn rows<I: Isa>(&self, isa: I) -> [I::Floats; 7] {
        // One by one: a closure would be compiled for the portable set.
        [
            isa.load(&self.apex[0]),
            isa.load(&self.apex[1]),
            isa.load(&self.apex[2]),
            isa.load(&self.axis[0]),
            isa.load(&self.axis[1]),
            isa.load(&self.axis[2]),
            isa.load(&self.square),
        ]
    }
}

/// The lanes that see none of their triangles. At the lowest: 21 operations.
#[inline(always)]
fn rejected<I: Isa>(isa: I, block: &ConeBlock, view: &Broadcast<I>) -> LaneMask {
    let [x, y, z, a, b, c, square] = block.rows(isa);
    let [ex, ey, ez] = view.minus_eye;
    let [x, y, z] = match view.is_parallel {
        true => [ex, ey, ez],
        false => [isa.add(x, ex), isa.add(y, ey), isa.add(z, ez)],
    };
    let way = [x, y, z];
    let t = isa.add(dot(isa, way, [a, b, c]), view.minus_margin);
    let needed = isa.mul(square, dot(isa, way, way));
    isa.at_most(view.zero, t) & isa.at_most(needed, isa.mul(t, t))
}

#[inline(always)]
fn dot<I: Isa>(isa: I, [x, y, z]: [I::Floats; 3], [a, b, c]: [I::Floats; 3]) -> I::Floats {
    let xy = isa.add(isa.mul(x, a), isa.mul(y, b));
    isa.add(xy, isa.mul(z, c))
}

/// A view in all lanes.
#[derive(Clone, Copy)]
struct Broadcast<I: Isa> {
    minus_eye: [I::Floats; 3],
    minus_margin: I::Floats,
    zero: I::Floats,
    is_parallel: bool,
}

impl<I: Isa> Broadcast<I> {
    /// All numbers of a view.
    #[inline(always)]
    fn of(isa: I, view: &Prepared) -> Broadcast<I> {
        Broadcast {
            minus_eye: [
                isa.splat(view.minus_eye[0]),
                isa.splat(view.minus_eye[1]),
                isa.splat(view.minus_eye[2]),
            ],
            minus_margin: isa.splat(view.minus_margin),
            zero: isa.splat(0.0),
            is_parallel: view.is_parallel,
        }
    }
}

/// Four words per number below 16: all ones where its bit is set.
const SPREAD: [[u64; 4]; 16] = {
    let mut spread = [[0; 4]; 16];
    let mut bits = 0;
    while bits < 16 {
        let mut lane = 0;
        while lane < 4 {
            if bits >> lane & 1 == 1 {
                spread[bits][lane] = u64::MAX;
            }
            lane += 1;
        }
        bits += 1;
    }
    spread
};

/// Takes `triangles` out of the words of the lanes that are gone, without branches.
///
/// Four lanes at a time, by a table: compilers turn a comparison here into masked stores.
#[inline(always)]
fn clear(words: &mut [u64; LANES], gone: LaneMask, triangles: &[u64; LANES]) {
    if gone == 0 {
        return;
    }
    for part in 0..LANES / 4 {
        let spread = &SPREAD[usize::from(gone >> (4 * part)) & 15];
        for lane in 0..4 {
            words[4 * part + lane] &= !(spread[lane] & triangles[4 * part + lane]);
        }
    }
}
