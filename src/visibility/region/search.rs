//! Portal search from the regions of the eye, through windows.
//!
//! A window is the rectangle of the image that an opening covers, intersected with the window
//! before it (Luebke and Georges 1995, "Portals and mirrors: simple, fast evaluation of potentially
//! visible sets"). Windows are enlarged by a slack, so that rounding never loses a line of sight;
//! its proof is at [`SLACK`].

use glam::DVec3;

use super::graph::{Opening, RegionGraph, RegionId};
use crate::camera::Camera;
use crate::index::IdSet;
use crate::kernel::each;
use crate::visibility::Rays;

/// Most different windows per region; any further one is the whole image.
///
/// Bounds the time if many paths lead to one region.
const MOST_WINDOWS: usize = 32;

/// Memory of a search, reused from search to search.
#[derive(Clone, Default, Debug)]
pub struct Search {
    /// Entered regions with their windows, in search order.
    entries: Vec<(RegionId, Window)>,
    /// Windows of each visible region.
    windows: Vec<Vec<Window>>,
}

impl Search {
    /// Adds the regions visible from the regions of the eye, including these.
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

    /// Marks a region as seen; tests whether an earlier window contains this one.
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

/// Intersection of two windows; `None` if they do not meet.
fn common([x0, x1, y0, y1]: Window, [left, right, bottom, top]: Window) -> Option<Window> {
    let both = [x0.max(left), x1.min(right), y0.max(bottom), y1.min(top)];
    (both[0] <= both[1] && both[2] <= both[3]).then_some(both)
}

fn is_within(inner: Window, outer: Window) -> bool {
    outer[0] <= inner[0] && inner[1] <= outer[1] && outer[2] <= inner[2] && inner[3] <= outer[3]
}

/// Rectangle of the image: left, right, bottom, top, slopes per unit of depth.
type Window = [f64; 4];

/// Distance within which a point outside of a half-space `n . x >= 0` is kept.
///
/// Relative to bounds of |n| and |x| (sums of absolute coordinates).
///
/// The errors to cover, with u = 2^-53 and X = |x|:
/// - A corner minus the eye is rounded by u relative; three products and two sums
///   with axes whose coordinates are at most 1 add 3 u X per coordinate: below 2^-49 X.
/// - A ray of the camera is `u a + v b + forward`, rounded: u relative per operation,
///   and the axes are orthonormal to 2^-50: below 2^-48 X.
/// - The product of a corner with a normal adds below 2^-50 |n| X.
///
/// Thresholds are shifted by 2^-36 |n| X, far more than the sum.
const SLACK: f64 = 1.0 / (1u64 << 36) as f64;

/// Smallest window that certainly contains an opening, enlarged by the slack.
///
/// `None` if the opening is certainly not in the image, or beyond the far plane. All rays must
/// share an eye: the lens is not orthographic.
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
    // Planes through the eye and each side of the image.
    let [left, right, bottom, top] = rays.window;
    if outside(DVec3::new(1.0, 0.0, -left))
        || outside(DVec3::new(-1.0, 0.0, right))
        || outside(DVec3::new(0.0, 1.0, -bottom))
        || outside(DVec3::new(0.0, -1.0, top))
    {
        return None;
    }
    // A corner near depth zero has no reliable direction.
    if corners.iter().any(|c| c.z <= 4.0 * SLACK * reach) {
        return Some(rays.window);
    }
    let (most, least) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut window = [most, least, most, least];
    for c in &corners {
        let (x, y) = (c.x / c.z, c.y / c.z);
        // Both coordinates of x / z are wrong by less than 2^-48 reach.
        let slack = 2.0 * SLACK * reach / c.z;
        let (sx, sy) = (slack * (1.0 + x.abs()), slack * (1.0 + y.abs()));
        window[0] = window[0].min(x - sx);
        window[1] = window[1].max(x + sx);
        window[2] = window[2].min(y - sy);
        window[3] = window[3].max(y + sy);
    }
    Some(window)
}
