//! Clusters: at most 64 neighbouring triangles of an item.
//!
//! Each triangle is a bit of a word. All triangles of a cluster have the same kind and the same
//! number of sides.
//!
//! Grown greedily over common edges, along the Morton curve (as Kapoulkine's meshoptimizer grows
//! meshlets). Deterministic.

use std::ops::Range;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use obvhs::ploc::morton::morton_encode_u64;

use super::exact::{Eye, faces, normal};
use crate::geometry::Aabb;
use crate::kernel::each;
use crate::query::Bits;
use crate::scene::Surfaces;

/// Most triangles of a cluster: the bits of a word.
pub const MOST_TRIANGLES: usize = 64;

/// Triangles of surfaces in clusters.
///
/// The clusters of an item are consecutive.
#[derive(Clone, Debug)]
pub struct Clusters {
    /// Surfaces that were clustered.
    pub surfaces: Arc<Surfaces>,
    /// Indices of triangles, cluster after cluster.
    pub triangles: Vec<u32>,
    /// First index in `triangles` of each cluster; one more at the end.
    pub starts: Vec<u32>,
    /// Range of clusters of each item.
    pub of_item: Vec<Range<u32>>,
}

impl Clusters {
    /// Builds clusters of at most `most` triangles, 1 to 64. O(t log t).
    ///
    /// # Panics
    /// If `most` is outside 1..=64.
    pub fn of(surfaces: Arc<Surfaces>, most: usize) -> Clusters {
        assert!((1..=MOST_TRIANGLES).contains(&most), "1 to 64 triangles");
        let mut clusters = Clusters {
            triangles: Vec::with_capacity(surfaces.triangles.len()),
            starts: vec![0],
            of_item: Vec::with_capacity(surfaces.items()),
            surfaces: surfaces.clone(),
        };
        for item in 0..surfaces.items() {
            let first = clusters.len() as u32;
            for run in surfaces.runs(item) {
                grow(&surfaces, run, most, &mut clusters);
            }
            clusters.of_item.push(first..clusters.len() as u32);
        }
        clusters
    }

    /// Number of clusters.
    #[allow(clippy::len_without_is_empty)] // No caller needs `is_empty`.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Indices of a cluster's triangles: bit `i` of its word is the `i`-th.
    pub fn triangles_of(&self, cluster: usize) -> &[u32] {
        &self.triangles[self.starts[cluster] as usize..self.starts[cluster + 1] as usize]
    }

    /// Corners of a cluster's triangles, in the same order.
    pub fn corners_of(&self, cluster: usize) -> impl Iterator<Item = [Vec3; 3]> {
        let triangles = self.triangles_of(cluster).iter();
        triangles.map(|&t| self.surfaces.corners(t))
    }

    /// Word of a cluster with a bit set for each of its triangles.
    pub fn word(&self, cluster: usize) -> u64 {
        u64::MAX >> (MOST_TRIANGLES - self.triangles_of(cluster).len())
    }

    /// One-sided clusters, with the corners of their triangles.
    pub fn one_sided(&self) -> impl Iterator<Item = (usize, Vec<[Vec3; 3]>)> {
        let clusters = (0..self.len()).filter(|&cluster| !self.is_two_sided(cluster));
        clusters.map(|cluster| (cluster, self.corners_of(cluster).collect()))
    }

    /// Returns `true` if the triangles of a cluster are visible from both sides.
    pub fn is_two_sided(&self, cluster: usize) -> bool {
        self.surfaces.two_sided[self.triangles_of(cluster)[0] as usize]
    }

    /// Triangles among those of `word` whose front faces the eye.
    ///
    /// All of them if they are two-sided. Exact; one predicate per triangle.
    #[inline(never)]
    pub fn seen(&self, eye: &Eye, cluster: usize, word: u64) -> u64 {
        let triangles = self.triangles_of(cluster);
        let corners = |bit: u32| self.surfaces.corners(triangles[bit as usize]);
        let is_seen = |bit: &u32| self.is_two_sided(cluster) || faces(eye, corners(*bit));
        let seen = Bits(word).filter(is_seen);
        seen.fold(0, |word, bit| word | 1 << bit)
    }
}

/// Index for no neighbour across an edge.
const NONE: u32 = u32::MAX;

/// A triangle of an item, to be added to a cluster.
struct Node {
    centre: DVec3,
    /// Unit normal, or zero.
    normal: DVec3,
    neighbours: [u32; 3],
    is_used: bool,
}

fn grow(surfaces: &Surfaces, run: Range<u32>, most: usize, out: &mut Clusters) {
    let first = run.start;
    let bounds = Aabb::of_points(run.clone().flat_map(|t| surfaces.corners(t)));
    let mut nodes = nodes(surfaces, run);
    let order = along_the_curve(&nodes, &bounds);
    let mut seeds = order.into_iter();
    let mut frontier: Vec<u32> = Vec::new();
    while let Some(seed) = seeds.find(|&seed| !nodes[seed as usize].is_used) {
        frontier.clear();
        let mut next = Some(seed);
        let (mut centres, mut normals, mut count) = (DVec3::ZERO, DVec3::ZERO, 0);
        while let Some(index) = next {
            let node = &mut nodes[index as usize];
            node.is_used = true;
            centres += node.centre;
            normals += node.normal;
            count += 1;
            out.triangles.push(first + index);
            frontier.extend(node.neighbours.iter().filter(|&&n| n != NONE));
            if count == most {
                break;
            }
            frontier.retain(|&n| !nodes[n as usize].is_used);
            let (centre, axis) = (centres / count as f64, normals.normalize_or_zero());
            let cost = |index: u32| {
                let node = &nodes[index as usize];
                let free = |&&n: &&u32| n != NONE && !nodes[n as usize].is_used;
                let free = node.neighbours.iter().filter(free).count();
                // Prefers triangles that are near and have a similar normal and few free
                // neighbours.
                let turned = 1.5 - node.normal.dot(axis);
                node.centre.distance_squared(centre) * turned * (2.0 + free as f64)
            };
            let costs = frontier.iter().map(|&index| (cost(index), index));
            let best = costs.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            next = best.map(|(_, index)| index).or_else(|| {
                // The component is used up: continue along the curve.
                seeds.find(|&seed| !nodes[seed as usize].is_used)
            });
        }
        out.starts.push(out.triangles.len() as u32);
    }
}

fn nodes(surfaces: &Surfaces, run: Range<u32>) -> Vec<Node> {
    let corners = run.clone().map(|t| surfaces.corners(t));
    let nodes = corners.map(|corners| Node {
        centre: each(corners, |p: Vec3| p.as_dvec3()).iter().sum::<DVec3>() / 3.0,
        normal: normal(corners).normalize_or_zero(),
        neighbours: [NONE; 3],
        is_used: false,
    });
    let mut nodes: Vec<Node> = nodes.collect();
    let mut edges: Vec<(u64, u32)> = Vec::with_capacity(3 * nodes.len());
    let triangles = &surfaces.triangles[run.start as usize..run.end as usize];
    for (index, t) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            let key = u64::from(a.min(b)) << 32 | u64::from(a.max(b));
            edges.push((key, (3 * index + k) as u32));
        }
    }
    edges.sort_unstable();
    // An edge with more than two triangles links them in pairs.
    for run in edges.chunk_by(|a, b| a.0 == b.0) {
        for pair in run.chunks_exact(2) {
            let (a, b) = (pair[0].1 as usize, pair[1].1 as usize);
            nodes[a / 3].neighbours[a % 3] = (b / 3) as u32;
            nodes[b / 3].neighbours[b % 3] = (a / 3) as u32;
        }
    }
    nodes
}

/// Triangles in the order of their centres' Morton codes, 21 bits per axis.
fn along_the_curve(nodes: &[Node], bounds: &Aabb) -> Vec<u32> {
    let low = bounds.min.as_dvec3();
    let edge = (bounds.max.as_dvec3() - low).max_element();
    let scale = if edge > 0.0 { 2_097_151.0 / edge } else { 0.0 };
    let keyed = nodes.iter().zip(0..).map(|(node, index)| {
        let [x, y, z] = ((node.centre - low) * scale).to_array().map(|x| x as u32);
        (morton_encode_u64(x, y, z), index)
    });
    let mut keyed: Vec<(u64, u32)> = keyed.collect();
    keyed.sort_unstable();
    keyed.into_iter().map(|(_, index)| index).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Family, MESHES, SurfaceKind};

    fn bounds(clusters: &Clusters, cluster: usize) -> Aabb {
        let corners = clusters.corners_of(cluster).flatten();
        corners.fold(Aabb::EMPTY, |all, p| {
            Aabb::new(all.min.min(p), all.max.max(p))
        })
    }

    #[test]
    fn every_triangle_is_in_one_cluster_of_its_item() {
        for mesh in MESHES {
            let surfaces = Arc::new(mesh.mesh(20_000, 3));
            for most in [1, 17, 64] {
                let clusters = Clusters::of(surfaces.clone(), most);
                let mut seen = clusters.triangles.clone();
                seen.sort_unstable();
                assert!(seen.iter().copied().eq(0..surfaces.triangles.len() as u32));
                for (item, range) in clusters.of_item.iter().enumerate() {
                    for cluster in range.clone() {
                        let own = clusters.triangles_of(cluster as usize);
                        assert!((1..=most).contains(&own.len()));
                        assert!(own.iter().all(|t| surfaces.of_item[item].contains(t)));
                        let bits = clusters.word(cluster as usize).count_ones();
                        assert_eq!(bits as usize, own.len());
                    }
                }
                let again = Clusters::of(surfaces.clone(), most);
                assert_eq!(clusters.triangles, again.triangles);
                assert_eq!(clusters.starts, again.starts);
            }
        }
    }

    #[test]
    fn an_item_without_triangles_is_no_cluster() {
        let scene = crate::scene::load("city:n=2", &Default::default()).unwrap();
        let mut surfaces = Surfaces::from_boxes(&scene);
        let whole = surfaces.of_item[1].clone();
        surfaces.of_item.insert(1, whole.start..whole.start);
        let clusters = Clusters::of(surfaces.into(), 2);
        assert!(clusters.of_item[1].is_empty());
        assert!((0..clusters.len()).all(|cluster| !clusters.triangles_of(cluster).is_empty()));
        assert_eq!(clusters.one_sided().count(), clusters.len());
    }

    #[test]
    fn a_cluster_is_of_one_kind_and_alike_in_sides() {
        let scene = crate::scene::load("city:n=2", &Default::default()).unwrap();
        let mut surfaces = Surfaces::from_boxes(&scene);
        surfaces.two_sided[4] = true;
        surfaces.kinds[20..].fill(SurfaceKind::Clear);
        let clusters = Clusters::of(surfaces.into(), 64);
        assert_eq!(clusters.starts, [0, 4, 5, 12, 20, 24]);
        assert_eq!(clusters.of_item, [0..3, 3..5]);
        assert_eq!(clusters.one_sided().count(), 4);
    }

    #[test]
    fn clusters_are_full_and_small() {
        let surfaces = Arc::new(Family::named("mesh:statue").unwrap().mesh(50_000, 3));
        let clusters = Clusters::of(surfaces.clone(), 64);
        let least = surfaces.triangles.len() / 64;
        assert!(
            clusters.len() < least * 5 / 4,
            "{} of {least}",
            clusters.len()
        );
        let size = |b: Aabb| b.extent().max_element();
        let whole = size(surfaces.bounds(0));
        let mean = (0..clusters.len())
            .map(|c| size(bounds(&clusters, c)))
            .sum::<f32>()
            / clusters.len() as f32;
        assert!(mean < whole * 0.1, "{mean} of {whole}");
    }
}
