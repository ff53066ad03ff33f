//! Triangles wholly outside one plane of the view: outcodes as clipping computes
//! them (Sproull and Sutherland 1968). What crosses the near plane is kept.

use std::sync::Arc;

use glam::Vec3;

use super::super::guarantee::Guarantee;
use super::clusters::Clusters;
use super::contract::{Criterion, TriangleCull, TriangleRow};
use super::screen::Screen;
use super::selection::Selection;
use super::view::View;
use crate::kernel::Kernel;

/// The row of this file.
pub const ROW: TriangleRow = TriangleRow {
    name: "outcode",
    summary: "Drops what has all corners outside one of the six planes of the view",
    guarantee: Guarantee::Conservative,
    criterion: Criterion::Window,
    build: |clusters| Box::new(Outcodes(clusters.clone())),
};

named! {
    /// What a clipper has to do with a triangle.
    #[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
    #[non_exhaustive]
    pub enum Clipping {
        /// Nothing: it is wholly outside one plane.
        Outside = "outside",
        /// Nothing: it is wholly inside.
        Inside = "inside",
        /// Nothing: it crosses sides of the window, but stays within the guard band,
        /// where a rasteriser's coordinates still hold.
        GuardBand = "guard band",
        /// To cut it: it crosses near or far, or leaves the guard band.
        Clip = "clip",
    }
}

/// What a clipper has to do with a triangle whose guard band is `band` times as wide
/// and high as the window (1 is none). `Outside` is proven; the others are rounded.
pub fn clipping(screen: &Screen, corners: [Vec3; 3], band: f64) -> Clipping {
    let outside = corners.map(|p| screen.outcode(p));
    if outside[0] & outside[1] & outside[2] != 0 {
        return Clipping::Outside;
    }
    let any = outside[0] | outside[1] | outside[2];
    if any == 0 {
        return Clipping::Inside;
    }
    let in_band = any & Screen::DEPTH == 0 && corners.iter().all(|p| screen.is_within(*p, band));
    match in_band {
        true => Clipping::GuardBand,
        false => Clipping::Clip,
    }
}

struct Outcodes(Arc<Clusters>);

impl TriangleCull for Outcodes {
    fn cull(&self, view: &View, _: Kernel, kept: &mut Selection) {
        let Some(screen) = Screen::of(view) else {
            return;
        };
        let clusters = &*self.0;
        kept.retain(|cluster, bit| {
            let corners = clusters
                .surfaces
                .corners(clusters.triangles_of(cluster)[bit]);
            let [a, b, c] = corners.map(|p| screen.outcode(p));
            a & b & c == 0
        });
    }

    fn bytes(&self) -> usize {
        let surfaces = &self.0.surfaces;
        size_of_val(&surfaces.points[..]) + size_of_val(&surfaces.triangles[..])
    }
}
