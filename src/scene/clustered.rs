//! Gaussian clusters of uneven weight: dense spots in mostly empty space, as
//! in asset-heavy levels or point-like survey data.

use super::WorldBox;
use super::rng::SeededRng;
use super::tiling::World;
use crate::spec::{Spec, SpecError};

/// Cluster k attracts items in proportion to 1/(k+1) (Zipf), so that a few
/// clusters hold most of the scene.
pub fn build(spec: &mut Spec, n: usize, rng: &mut SeededRng) -> Result<World, SpecError> {
    let clusters = spec.count("clusters", 64, 1_000_000)? as usize;
    let side = spec.number_between("side", 1000.0, 0.0, f64::INFINITY)?;
    let spread = spec.number_between("spread", 0.02, 0.0, 10.0)? * side;
    let centres: Vec<_> = (0..clusters).map(|_| rng.point() * side).collect();
    let mut total = 0.0;
    let cumulative: Vec<f64> = (1..=clusters)
        .map(|k| {
            total += 1.0 / k as f64;
            total
        })
        .collect();
    let size = 0.2 * spread / libm::cbrt(n.max(1) as f64 / clusters as f64).max(1.0);
    let boxes = (0..n).map(|_| {
        let draw = rng.unit() * total;
        let k = cumulative.partition_point(|&c| c < draw).min(clusters - 1);
        let centre = centres[k] + rng.normal3() * spread;
        WorldBox::around(centre, (rng.point() + 0.5) * size)
    });
    Ok(World {
        boxes: boxes.collect(),
        ..World::default()
    })
}
