//! Search for the far plane at which a given share of a sample is visible.

use super::{scattered, unfit};
use crate::camera::{Camera, CameraError, Lens, LensKind, PlaneOptions};
use crate::geometry::Aabb;
use crate::input::Result;
use crate::scene::Scene;
use crate::shown::significant;

/// Maximum numbers of items and cameras sampled per step of the search.
const MOST_ITEMS: usize = 8_000;
const MOST_CAMERAS: usize = 128;
/// Boxes tested per step of the search, unless sixteen cameras need more.
///
/// The warning that all views are empty tests the same number.
pub(super) const MOST_TESTS: usize = 160_000 * MOST_CAMERAS;
/// Least number of sampled items that a camera sees, on average.
///
/// The sample grows beyond [`MOST_ITEMS`] for it: 0.02 % of eight thousand would be one or two.
const LEAST_SEEN: f64 = 8.0;

/// Sampled items that all cameras together see, within [`MOST_TESTS`].
///
/// With few cameras and a small share, fewer would leave the result to chance.
const SEEN_BY_ALL: f64 = 1_000.0;

/// Least far / near if near was given.
const LEAST_DEPTH: f64 = 1.01;

/// Largest ratio of the share found to the one requested: three items for two.
const MOST_ABOVE: f64 = 1.5;

/// Largest ratio, either way, of the shares found in two samples of the items.
const MOST_APART: f64 = 1.2;

/// The scale of far at which `share` of the items is visible on average.
///
/// Within the sample's accuracy. A near that is a thousandth of far is scaled too.
///
/// # Errors
/// A share not reached even at four times the present far plane, or smaller than any share that can
/// be reached.
pub(super) fn for_visible_share(
    path: &str,
    scene: &Scene,
    cameras: &[Camera],
    share: f64,
) -> Result<f64> {
    if !(0.0..=1.0).contains(&share) {
        let reason = format!("visible={share}; expected a share from 0 to 1");
        return Err(unfit(path, reason));
    }
    let needed = (LEAST_SEEN / share).ceil() as usize;
    let watched = cameras.len().clamp(1, MOST_CAMERAS);
    let by_all = (SEEN_BY_ALL / share / watched as f64).ceil() as usize;
    let needed = needed.max(by_all.min(MOST_TESTS / watched));
    let most = MOST_ITEMS.max(needed);
    let regular = every_nth(&scene.items, most);
    let sample = every_nth(cameras, most_cameras(regular.len()));
    let around = scene.surroundings();
    let visible = |items: &[Aabb], scale: f64| -> Result<f64> {
        let mut seen = 0;
        for camera in &sample {
            let scaled = rescaled(camera, scale);
            let volume = scaled.and_then(|c| c.volume(&PlaneOptions::default(), &around));
            let volume = volume.map_err(|e| unfit(path, e))?;
            seen += items.iter().filter(|b| volume.sees(b)).count();
        }
        Ok(seen as f64 / (items.len() * sample.len()).max(1) as f64)
    };
    let unreached = |found: &str, expected: &str| {
        let scene = &scene.name;
        let reason =
            format!("six planes return {found} of '{scene}' along it; expected {expected}");
        unfit(path, reason)
    };
    let search = |items: &[Aabb]| {
        let mut low = 1e-4;
        // A near that grows with far loses close items, so a smaller scale may show more.
        let (mut high, mut most) = (4.0, visible(items, 4.0)?);
        let mut largest = most;
        while most < share && high > 4.0 * low {
            high /= 4.0;
            most = visible(items, high)?;
            largest = most.max(largest);
        }
        if most < share {
            let found = format!("at most {}%", significant(largest * 100.0));
            let expected = ["a path that sees items", "a smaller share"];
            return Err(unreached(&found, expected[usize::from(largest > 0.0)]));
        }
        let mut reached = [visible(items, low)?, most];
        for _ in 0..16 {
            let middle = f64::sqrt(low * high);
            let found = visible(items, middle)?;
            if found < share {
                (low, reached[0]) = (middle, found);
            } else {
                (high, reached[1]) = (middle, found);
            }
        }
        if reached[1] > share * MOST_ABOVE {
            let [below, above] = reached.map(|share| significant(share * 100.0));
            let found = match reached[0] < share {
                true => format!("{below}% or {above}%, and no share between,"),
                false => format!("at least {above}%"),
            };
            return Err(unreached(&found, "a larger share"));
        }
        Ok(high)
    };
    let found = search(&regular);
    if regular.len() == scene.items.len() {
        return found;
    }
    // Periodic files may have one kind of item at every n-th index.
    let scattered = scattered(scene.items.len(), regular.len());
    let scattered: Vec<Aabb> = scattered.map(|item| scene.items[item]).collect();
    let share_of = |scale: &f64| visible(&scattered, *scale).ok();
    match found.as_ref().ok().and_then(share_of) {
        Some(seen) if (share / MOST_APART..=share * MOST_APART).contains(&seen) => found,
        _ => search(&scattered),
    }
}

/// Most cameras of a sample with this number of items.
pub(super) fn most_cameras(items: usize) -> usize {
    (MOST_TESTS / items.max(1)).clamp(16, MOST_CAMERAS)
}

/// The cameras with far scaled, and near too if it is a thousandth of far.
pub(super) fn scaled(path: &str, cameras: &[Camera], scale: f64) -> Result<Vec<Camera>> {
    let scaled = cameras.iter().map(|camera| rescaled(camera, scale));
    scaled.collect::<Result<_, _>>().map_err(|e| unfit(path, e))
}

fn rescaled(camera: &Camera, scale: f64) -> Result<Camera, CameraError> {
    let Camera { frame, lens } = *camera;
    if let LensKind::Matrix(_) = lens.kind() {
        return Ok(*camera);
    }
    // An infinite far plane is replaced by near * 1000.
    let far = lens.far().unwrap_or(lens.near() * 1000.0);
    let is_named = lens.far().is_some() && lens.near() != far / 1000.0;
    let scaled = far * scale;
    let (near, far) = match is_named {
        true => (lens.near(), scaled.max(lens.near() * LEAST_DEPTH)),
        false => (scaled / 1000.0, scaled),
    };
    let lens = Lens::new(*lens.kind(), near, Some(far))?;
    Ok(Camera { frame, lens })
}

/// At most `most` elements, evenly spaced.
pub(super) fn every_nth<T: Copy>(all: &[T], most: usize) -> Vec<T> {
    let step = all.len().div_ceil(most).max(1);
    all.iter().copied().step_by(step).collect()
}
