//! A search of the graph from the regions of the eye, through windows.
//!
//! A window is the rectangle of the image that an opening covers, intersected with the
//! window before it (Luebke and Georges 1995, "Portals and mirrors: simple, fast evaluation
//! of potentially visible sets"). Windows are grown by a slack, so that no rounding ever loses
//! a line of sight; its proof is at [`SLACK`].

use glam::DVec3;

use super::graph::{Opening, RegionGraph, RegionId};
use crate::camera::Camera;
use crate::index::IdSet;
use crate::kernel::each;
use crate::visibility::Rays;

/// Most different windows of a region; further ones are the whole image.
///
/// Bounds the time where many ways lead to one region.
const MOST_WINDOWS: usize = 32;

/// Memory of a search.
#[derive(Clone, Default, Debug)]
pub struct Search {
    /// All entries of regions through windows, in the order of the search.
    entries: Vec<(RegionId, Window)>,
    /// The windows of each region that is seen.
    windows: Vec<Vec<Window>>,
}

impl Search {
    /// Adds the regions that are seen from those of the eye, these among them.
    pub fn run(&mut self, graph: &RegionGraph, rays: &Rays, homes: &[RegionId], seen: &mut IdSet) {
        self.entries.clear();
        let regions = graph.len().max(self.windows.len());
        self.windows.resize_with(regions, Vec::new);
        for &home in homes {
            if !self.is_entered(seen, home, rays.window) {
                self.enter(home, rays.window);
            }
        }
        let mut next = 0;
        while let Some(&(region, window)) = self.entries.get(next) {
            next += 1;
            for &exit in &graph.exits[region as usize] {
                let opening = &graph.openings[exit as usize];
                let Some(entered) = opening.entered(region, rays.camera.frame.eye) else {
                    continue;
                };
                let covered = window_of(rays, opening);
                let Some(narrowed) = covered.and_then(|covered| common(window, covered)) else {
                    continue;
                };
                if !self.is_entered(seen, entered, narrowed) {
                    let window = match self.windows[entered as usize].len() < MOST_WINDOWS {
                        true => narrowed,
                        false => rays.window,
                    };
                    self.enter(entered, window);
                }
            }
        }
    }

    /// Tests whether an earlier window of a region holds a window.
    fn is_entered(&mut self, seen: &mut IdSet, region: RegionId, window: Window) -> bool {
        let earlier = &mut self.windows[region as usize];
        if seen.insert(region) {
            earlier.clear();
        }
        earlier.iter().any(|earlier| is_within(window, *earlier))
    }

    fn enter(&mut self, region: RegionId, window: Window) {
        self.entries.push((region, window));
        self.windows[region as usize].push(window);
    }
}

/// The common part of two windows; `None` if they do not meet.
fn common([x0, x1, y0, y1]: Window, [left, right, bottom, top]: Window) -> Option<Window> {
    let both = [x0.max(left), x1.min(right), y0.max(bottom), y1.min(top)];
    (both[0] <= both[1] && both[2] <= both[3]).then_some(both)
}

fn is_within(inner: Window, outer: Window) -> bool {
    outer[0] <= inner[0] && inner[1] <= outer[1] && outer[2] <= inner[2] && inner[3] <= outer[3]
}

/// A part of the image: left, right, bottom, top, slopes per unit of depth.
type Window = [f64; 4];

/// Distance within which a point outside of a half-space `n . x >= 0` is kept.
///
/// Relative to bounds of |n| and |x| (sums of absolute coordinates).
///
/// The errors to cover, with u = 2^-53 and X = |x|:
/// - A corner minus the eye is rounded by u relative; three products and two sums
///   with axes whose coordinates are at most 1 add 3 u X a coordinate: below 2^-49 X.
/// - A ray of the camera is `u a + v b + forward`, rounded: u relative an operation,
///   and the axes are orthonormal to 2^-50: below 2^-48 X.
/// - The product of a corner with a normal adds below 2^-50 |n| X.
///
/// The sum is far below the 2^-36 |n| X that thresholds are shifted by.
const SLACK: f64 = 1.0 / (1u64 << 36) as f64;

/// The smallest window that surely holds an opening, grown by the slack.
///
/// `None` if it is surely not in the image, or beyond the far plane. All rays share an eye:
/// the lens is not orthographic.
fn window_of(rays: &Rays, opening: &Opening) -> Option<Window> {
    let Camera { frame, lens } = &rays.camera;
    let axes = [frame.u(), frame.v(), frame.forward()];
    let corners = each(opening.corners, |c| {
        DVec3::from(each(axes, |axis| axis.dot(c - frame.eye)))
    });
    let sizes = each(corners, |c| c.abs().element_sum());
    let reach = sizes.into_iter().fold(0.0, f64::max);
    let far = lens.far().unwrap_or(f64::INFINITY);
    if corners.iter().all(|c| c.z - reach * SLACK > far) {
        return None;
    }
    let outside = |normal: DVec3| {
        let slack = SLACK * normal.abs().element_sum() * reach;
        corners.iter().all(|c| normal.dot(*c) < -slack)
    };
    // By the planes through the eye and each side of the image.
    let [left, right, bottom, top] = rays.window;
    if outside(DVec3::new(1.0, 0.0, -left))
        || outside(DVec3::new(-1.0, 0.0, right))
        || outside(DVec3::new(0.0, 1.0, -bottom))
        || outside(DVec3::new(0.0, -1.0, top))
    {
        return None;
    }
    // Nothing is known of the directions to corners at depths about zero.
    if corners.iter().any(|c| c.z <= 4.0 * SLACK * reach) {
        return Some(rays.window);
    }
    let (most, least) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut window = [most, least, most, least];
    for c in &corners {
        let (x, y) = (c.x / c.z, c.y / c.z);
        // Both coordinates of x / z are off by below 2^-48 reach.
        let slack = 2.0 * SLACK * reach / c.z;
        let (sx, sy) = (slack * (1.0 + x.abs()), slack * (1.0 + y.abs()));
        window[0] = window[0].min(x - sx);
        window[1] = window[1].max(x + sx);
        window[2] = window[2].min(y - sy);
        window[3] = window[3].max(y + sy);
    }
    Some(window)
}
