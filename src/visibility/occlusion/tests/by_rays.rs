//! Items that random rays meet first, by brute force, and items that are lost.

use glam::{DVec3, Vec3};

use super::super::{OccluderTree, View};
use crate::camera::{Camera, PlaneOptions, Surroundings};
use crate::geometry::ConvexVolume;
use crate::query::ItemId;
use crate::scene::{Scene, SeededRng, WorldBox};
use crate::visibility::rays::tests::in_image;
use crate::visibility::{Ray, Rays, SampleGrid, Solids};

/// A scene with its solids and occluders.
pub struct Ready {
    pub scene: Scene,
    pub solids: Solids,
    pub occluders: OccluderTree,
}

impl Ready {
    pub fn of(scene: Scene) -> Ready {
        let solids = Solids::of(&scene);
        let occluders = OccluderTree::of(&solids);
        Ready {
            scene,
            solids,
            occluders,
        }
    }

    pub fn volume(&self, camera: &Camera) -> ConvexVolume {
        let around = Surroundings {
            origin: self.scene.origin,
            reach: self
                .scene
                .items
                .iter()
                .map(|b| b.reach())
                .fold(Vec3::ZERO, Vec3::max),
        };
        camera.volume(&PlaneOptions::default(), &around).unwrap()
    }

    /// Items that no plane of the volume excludes, by testing every item.
    pub fn in_view(&self, volume: &ConvexVolume) -> Vec<ItemId> {
        let items = self.scene.items.iter().enumerate();
        let seen = items.filter(|(_, b)| volume.sees(b));
        seen.map(|(id, _)| id as ItemId).collect()
    }
}

/// Depth at which a ray enters a box, if it lies between near and far.
pub fn entry(ray: &Ray, b: &WorldBox) -> Option<f64> {
    let (mut enters, mut leaves) = (f64::NEG_INFINITY, f64::INFINITY);
    for axis in 0..3 {
        let (o, d) = (ray.origin[axis], ray.direction[axis]);
        let (low, high) = (b.min[axis] - o, b.max[axis] - o);
        if d == 0.0 {
            if low > 0.0 || high < 0.0 {
                return None;
            }
            continue;
        }
        let (first, last) = if d > 0.0 { (low, high) } else { (high, low) };
        enters = enters.max(first / d);
        leaves = leaves.min(last / d);
    }
    (enters <= leaves && enters >= ray.near && enters <= ray.far).then_some(enters)
}

/// Items that a ray meets first: several if their depths are equal.
pub fn front(ray: &Ray, boxes: &[WorldBox]) -> Vec<ItemId> {
    let mut least = f64::INFINITY;
    let mut first = Vec::new();
    for (id, b) in boxes.iter().enumerate() {
        match entry(ray, b) {
            Some(depth) if depth < least => {
                least = depth;
                first = vec![id as ItemId];
            }
            Some(depth) if depth == least => first.push(id as ItemId),
            _ => {}
        }
    }
    first
}

/// Items that some of `count` rays meet first, in order.
///
/// Every other ray is at a random point of the image; the rest aim at points of items, mostly close
/// to their edges.
pub fn seen_by_rays(
    rays: &Rays,
    boxes: &[WorldBox],
    count: usize,
    rng: &mut SeededRng,
) -> Vec<ItemId> {
    let mut seen = Vec::new();
    for number in 0..count {
        let at = match number % 2 {
            0 => Some([rng.unit(), rng.unit()]),
            _ => in_image(rays, point_of(&boxes[rng.below(boxes.len())], rng)),
        };
        if let Some([x, y]) = at {
            seen.extend(front(&rays.through(x, y), boxes));
        }
    }
    seen.sort_unstable();
    seen.dedup();
    seen
}

/// A point of a box, mostly close to an edge.
fn point_of(b: &WorldBox, rng: &mut SeededRng) -> DVec3 {
    let mut along = || match rng.below(3) {
        0 => rng.unit(),
        1 => rng.unit() * 1e-3,
        _ => 1.0 - rng.unit() * 1e-3,
    };
    b.min + (b.max - b.min) * DVec3::new(along(), along(), along())
}

/// Items of `seen` that are not in `kept`.
pub fn missing(seen: &[ItemId], kept: &[ItemId]) -> Vec<ItemId> {
    let mut kept = kept.to_vec();
    kept.sort_unstable();
    let lost = seen.iter().filter(|id| kept.binary_search(id).is_err());
    lost.copied().collect()
}

/// Calls `ask` with a camera's view.
pub fn with_view<R>(
    ready: &Ready,
    camera: &Camera,
    grid: SampleGrid,
    ask: impl FnOnce(&View, &Rays) -> R,
) -> R {
    let rays = Rays::of(camera).unwrap();
    let volume = ready.volume(camera);
    let view = View::new(&rays, &volume, &ready.occluders, grid);
    ask(&view, &rays)
}

/// A random point of a box.
pub fn point_between(low: DVec3, high: DVec3, rng: &mut SeededRng) -> DVec3 {
    low + (high - low) * rng.point()
}
