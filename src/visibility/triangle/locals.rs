//! The points of each cluster side by side: what tests of corners read once instead
//! of once per triangle.

use std::collections::HashMap;
use std::sync::Arc;

use glam::Vec3;

use super::clusters::{Clusters, MOST_TRIANGLES};
use super::selection::Selection;
use crate::kernel::each;

/// Points of a cluster at the most.
const MOST_POINTS: usize = 3 * MOST_TRIANGLES;

/// Points that are looked at together.
pub const EIGHT: usize = 8;

/// Eight points: x, y and z in a row each.
pub type Points = [[f32; EIGHT]; 3];

/// Points and triangles of clusters.
pub struct Locals {
    /// Where the points of each cluster begin; one more at the end.
    starts: Vec<u32>,
    points: Vec<Points>,
    /// Where the triangles of each cluster begin; one more at the end.
    firsts: Vec<u32>,
    /// Three points of the cluster each.
    triangles: Vec<[u8; 3]>,
    /// The corners of each cluster's box.
    corners: Vec<Points>,
}

/// Which triangles are kept. All of it is `#[inline(always)]`: what stays a call of
/// its own was compiled for the portable instruction set.
pub trait Rule {
    /// What is to be known of a point.
    type Of: Copy + Default;

    /// Of eight points.
    fn of_points(&self, points: &Points) -> [Self::Of; EIGHT];

    /// Whether all of a cluster is kept, or none, by the corners of its box.
    fn of_box(&self, corners: [Self::Of; EIGHT]) -> Option<bool>;

    /// Whether a triangle is kept.
    fn keep(&self, corners: [Self::Of; 3]) -> bool;
}

impl Locals {
    /// Copies the points. O(t).
    pub fn of(clusters: &Arc<Clusters>) -> Locals {
        let mut locals = Locals {
            starts: vec![0],
            points: Vec::new(),
            firsts: clusters.starts.clone(),
            triangles: Vec::with_capacity(clusters.triangles.len()),
            corners: Vec::with_capacity(clusters.len()),
        };
        for cluster in 0..clusters.len() {
            let mut own: HashMap<u32, u8> = HashMap::new();
            let mut points: Vec<Vec3> = Vec::new();
            for &triangle in clusters.triangles_of(cluster) {
                let corners = clusters.surfaces.triangles[triangle as usize].map(|point| {
                    *own.entry(point).or_insert_with(|| {
                        points.push(clusters.surfaces.points[point as usize]);
                        (points.len() - 1) as u8
                    })
                });
                locals.triangles.push(corners);
            }
            locals.points.extend(points.chunks(EIGHT).map(in_rows));
            locals.starts.push(locals.points.len() as u32);
            let bounds = clusters.bounds(cluster);
            let corners: [Vec3; 8] = std::array::from_fn(|i| bounds.corner(i));
            locals.corners.push(in_rows(&corners));
        }
        locals
    }

    /// Keeps the triangles that a rule keeps: first all of a cluster or none of it, by
    /// the corners of its box, where that decides.
    #[inline(always)]
    pub fn retain<R: Rule>(&self, kept: &mut Selection, rule: &R) {
        let mut of = [R::Of::default(); MOST_POINTS];
        for (cluster, word) in kept.words_mut().iter_mut().enumerate() {
            if *word == 0 {
                continue;
            }
            match rule.of_box(rule.of_points(&self.corners[cluster])) {
                Some(true) => continue,
                Some(false) => {
                    *word = 0;
                    continue;
                }
                None => {}
            }
            let points = self.starts[cluster] as usize..self.starts[cluster + 1] as usize;
            for (i, points) in self.points[points].iter().enumerate() {
                of.as_chunks_mut().0[i] = rule.of_points(points);
            }
            let triangles = self.firsts[cluster] as usize..self.firsts[cluster + 1] as usize;
            let mut front = 0;
            for (bit, [a, b, c]) in self.triangles[triangles].iter().enumerate() {
                let corners = each([*a, *b, *c], |corner| of[usize::from(corner)]);
                front |= u64::from(rule.keep(corners)) << bit;
            }
            *word &= front;
        }
    }
}

/// Up to eight points; zeros where there are fewer.
pub fn in_rows(points: &[Vec3]) -> Points {
    let mut rows = [[0.0; EIGHT]; 3];
    for (lane, point) in points.iter().enumerate() {
        for (k, row) in rows.iter_mut().enumerate() {
            row[lane] = point[k];
        }
    }
    rows
}
