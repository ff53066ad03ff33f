//! Boxes scattered evenly in a cube: the scene without structure, against
//! which every other one is a special case.

use super::WorldBox;
use super::rng::SeededRng;
use super::tiling::World;
use crate::spec::{Spec, SpecError};

/// Edges vary between half and one and a half times the mean, per axis.
pub fn build(spec: &mut Spec, n: usize, rng: &mut SeededRng) -> Result<World, SpecError> {
    let side = spec.number_between("side", 1000.0, 0.0, f64::INFINITY)?;
    let fitting = 0.2 * side / libm::cbrt(n.max(1) as f64);
    let size = spec.number_between("size", fitting, 0.0, f64::INFINITY)?;
    let boxes = (0..n).map(|_| {
        let centre = rng.point() * side;
        let edges = (rng.point() + 0.5) * size;
        WorldBox::around(centre, edges)
    });
    Ok(World {
        boxes: boxes.collect(),
        ..World::default()
    })
}
