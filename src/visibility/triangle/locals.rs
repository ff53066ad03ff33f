//! The points of each cluster side by side: what tests of corners read once instead
//! of once per triangle.

use std::collections::HashMap;
use std::sync::Arc;

use glam::Vec3;

use super::clusters::{Clusters, MOST_TRIANGLES};
use super::selection::Selection;
use crate::geometry::Aabb;

/// Points of a cluster at the most.
const MOST_POINTS: usize = 3 * MOST_TRIANGLES;

/// Points and triangles of clusters.
pub struct Locals {
    /// Where the points of each cluster begin; one more at the end.
    starts: Vec<u32>,
    points: Vec<Vec3>,
    /// Where the triangles of each cluster begin; one more at the end.
    firsts: Vec<u32>,
    /// Three points of the cluster each.
    triangles: Vec<[u8; 3]>,
    bounds: Vec<Aabb>,
}

impl Locals {
    /// Copies the points. O(t).
    pub fn of(clusters: &Arc<Clusters>) -> Locals {
        let mut locals = Locals {
            starts: vec![0],
            points: Vec::new(),
            firsts: clusters.starts.clone(),
            triangles: Vec::with_capacity(clusters.triangles.len()),
            bounds: (0..clusters.len()).map(|c| clusters.bounds(c)).collect(),
        };
        for cluster in 0..clusters.len() {
            let first = locals.points.len();
            let mut own: HashMap<u32, u8> = HashMap::new();
            for &triangle in clusters.triangles_of(cluster) {
                let corners = clusters.surfaces.triangles[triangle as usize].map(|point| {
                    let next = (locals.points.len() - first) as u8;
                    *own.entry(point).or_insert_with(|| {
                        locals.points.push(clusters.surfaces.points[point as usize]);
                        next
                    })
                });
                locals.triangles.push(corners);
            }
            locals.starts.push(locals.points.len() as u32);
        }
        locals
    }

    /// Keeps the triangles that a rule keeps, by what `of_point` says of each corner:
    /// first all of a cluster or none of it, by the corners of its box, where `of_box`
    /// decides.
    #[inline(always)]
    pub fn retain<T: Copy + Default>(
        &self,
        kept: &mut Selection,
        of_point: impl Fn(Vec3) -> T,
        of_box: impl Fn([T; 8]) -> Option<bool>,
        keep: impl Fn([T; 3]) -> bool,
    ) {
        let mut of = [T::default(); MOST_POINTS];
        for (cluster, word) in kept.words_mut().iter_mut().enumerate() {
            if *word == 0 {
                continue;
            }
            let mut corners = [T::default(); 8];
            for (i, corner) in corners.iter_mut().enumerate() {
                *corner = of_point(self.bounds[cluster].corner(i));
            }
            match of_box(corners) {
                Some(true) => continue,
                Some(false) => {
                    *word = 0;
                    continue;
                }
                None => {}
            }
            let points = self.starts[cluster] as usize..self.starts[cluster + 1] as usize;
            for (of, point) in of.iter_mut().zip(&self.points[points]) {
                *of = of_point(*point);
            }
            let triangles = self.firsts[cluster] as usize..self.firsts[cluster + 1] as usize;
            let mut front = 0;
            for (bit, corners) in self.triangles[triangles].iter().enumerate() {
                front |= u64::from(keep(corners.map(|corner| of[usize::from(corner)]))) << bit;
            }
            *word &= front;
        }
    }

    /// Bytes of all.
    pub fn bytes(&self) -> usize {
        let indices = size_of_val(&self.starts[..]) + size_of_val(&self.firsts[..]);
        let indices = indices + size_of_val(&self.bounds[..]);
        indices + size_of_val(&self.points[..]) + size_of_val(&self.triangles[..])
    }
}
