//! Four cones per cluster: its triangles in four groups of like normals.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::super::guarantee::Guarantee;
use super::clusters::Clusters;
use super::cone_block::{Broadcast, ConeBlock, clear, rejected};
use super::contract::{TriangleCull, TriangleRow};
use super::exact::normal;
use super::eye::Eye;
use super::normal_cone::{Cone, Prepared};
use super::selection::Selection;
use crate::kernel::{Isa, Kernel, LANES, Work};

/// The row of this file.
pub const ROW: TriangleRow = TriangleRow {
    name: "several-cones",
    summary: "Four cones per cluster, each of triangles turned alike, rounding proven",
    guarantee: Guarantee::Conservative,
    build: |clusters| Box::new(SeveralCones::of(clusters)),
};

/// Cones per cluster.
const CONES: usize = 4;
/// Rounds of moving triangles to the nearest of the four directions.
const ROUNDS: usize = 8;

/// One cone of each of sixteen clusters, and its triangles.
#[derive(Clone, Copy)]
struct Group {
    cones: ConeBlock,
    triangles: [u64; LANES],
}

struct SeveralCones {
    blocks: Vec<[Group; CONES]>,
}

impl SeveralCones {
    fn of(clusters: &Arc<Clusters>) -> SeveralCones {
        let empty = Group {
            cones: ConeBlock::EMPTY,
            triangles: [0; LANES],
        };
        let mut blocks = vec![[empty; CONES]; clusters.len().div_ceil(LANES)];
        for (cluster, triangles) in clusters.one_sided() {
            let lane = cluster % LANES;
            for (group, word) in blocks[cluster / LANES].iter_mut().zip(groups(&triangles)) {
                let bits = (0..triangles.len()).filter(|bit| word >> bit & 1 == 1);
                let own: Vec<[Vec3; 3]> = bits.map(|bit| triangles[bit]).collect();
                if let Some(cone) = Cone::fit(&own) {
                    group.cones.set(lane, &cone);
                    group.triangles[lane] = word;
                }
            }
        }
        SeveralCones { blocks }
    }
}

/// The triangles in four groups by their normals: the farthest directions first,
/// then each to the nearest mean (Lloyd 1982).
fn groups(triangles: &[[Vec3; 3]]) -> [u64; CONES] {
    let normals: Vec<DVec3> = triangles
        .iter()
        .map(|corners| normal(*corners).normalize_or_zero())
        .collect();
    let mut means = [normals.iter().sum::<DVec3>().normalize_or_zero(); CONES];
    for k in 0..CONES {
        let known = if k == 0 { &means[..1] } else { &means[..k] };
        let nearest = |n: &DVec3| known.iter().map(|m| m.dot(*n)).fold(-2.0, f64::max);
        let farthest = normals
            .iter()
            .min_by(|a, b| nearest(a).total_cmp(&nearest(b)));
        means[k] = farthest.copied().unwrap_or(DVec3::Z);
    }
    let mut words = [0u64; CONES];
    for _ in 0..ROUNDS {
        words = [0; CONES];
        let mut sums = [DVec3::ZERO; CONES];
        for (bit, n) in normals.iter().enumerate() {
            let best = (1..CONES).fold(0, |best, k| {
                if means[k].dot(*n) > means[best].dot(*n) {
                    k
                } else {
                    best
                }
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

impl TriangleCull for SeveralCones {
    fn cull(&self, eye: &Eye, kernel: Kernel, kept: &mut Selection) {
        if let Some(prepared) = Prepared::of(eye) {
            kernel.run(Query {
                blocks: &self.blocks,
                view: &prepared,
                words: kept.blocks_mut(),
            });
        }
    }
}

struct Query<'a> {
    blocks: &'a [[Group; CONES]],
    view: &'a Prepared,
    words: &'a mut [[u64; LANES]],
}

impl Work for Query<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let view = Broadcast::of(isa, self.view);
        for (i, words) in self.words.iter_mut().enumerate() {
            for group in &self.blocks[i] {
                let gone = rejected(isa, &group.cones, &view);
                clear(words, gone, &group.triangles);
            }
        }
    }
}
