//! Whether a generated scene fits into memory, known before it is made: a
//! machine that begins to swap, or ends the process, has measured nothing.

use sysinfo::{MemoryRefreshKind, RefreshKind, System};

use super::WorldBox;
use super::generate::MOST_ITEMS;
use super::meshes::{MOST_TRIANGLES, TRIANGLES};
use crate::geometry::Aabb;
use crate::input::InputError;
use crate::spec::Spec;

/// Bytes of an item in a scene: as indexes hold it, and as it was written.
const HELD: u64 = (size_of::<Aabb>() + size_of::<WorldBox>()) as u64;
/// While the scene is made there is the written box twice.
const MADE: u64 = HELD + size_of::<WorldBox>() as u64;
/// What a structure holds for an item; 28 to 39 were measured.
const INDEXED: u64 = 40;
/// What a build needs beside that, for the one that is being built.
const BUILT: u64 = 64;
/// Scenes of fewer items, and meshes of fewer triangles, are made without asking.
const ANYWHERE: u64 = 1_000_000;
/// Bytes of a triangle while a mesh is made: 117 were measured of the statue, which
/// finds its points in a table, 20 to 24 of the others.
const MESHED: u64 = 120;
/// Fewest triangles of an item: those of a bush.
const FEWEST: u64 = 24;

/// About how much memory a scene takes with so many structures over it.
pub fn needed_bytes(items: u64, structures: u64) -> u64 {
    let built = if structures > 0 { BUILT } else { 0 };
    items.saturating_mul(MADE.max(HELD + structures * INDEXED + built))
}

/// Refuses a scene that needs more than is available; what is not known is no
/// reason.
///
/// # Errors
/// [`InputError::TooLarge`].
pub fn fits(
    scene: &str,
    items: u64,
    structures: u64,
    available: Option<u64>,
) -> Result<(), InputError> {
    fits_bytes(
        scene,
        needed_bytes(items, structures),
        structures,
        available,
    )
}

fn fits_bytes(
    scene: &str,
    needed: u64,
    structures: u64,
    available: Option<u64>,
) -> Result<(), InputError> {
    match available {
        Some(available) if needed > available => Err(InputError::TooLarge {
            scene: scene.to_owned(),
            structures,
            needed,
            available,
        }),
        _ => Ok(()),
    }
}

/// The same of the text of a generated scene, on this machine as it is now.
pub(super) fn fits_here(scene: &str, spec: &Spec, structures: u64) -> Result<(), InputError> {
    // What is no number is told by the generator.
    match spec.clone().whole("n", 0, MOST_ITEMS) {
        Ok(items) if items > ANYWHERE => fits(scene, items, structures, available_bytes()),
        _ => Ok(()),
    }
}

/// The same of the text of a mesh, whose `n` counts triangles, each of which will need
/// so many bytes beside the scene.
pub(super) fn mesh_fits_here(
    scene: &str,
    spec: &Spec,
    structures: u64,
    per_triangle: u64,
) -> Result<(), InputError> {
    match spec.clone().whole("n", TRIANGLES, MOST_TRIANGLES) {
        Ok(triangles) if triangles > ANYWHERE => {
            let of_items = needed_bytes(triangles / FEWEST, structures);
            let needed = triangles * (MESHED + per_triangle) + of_items;
            fits_bytes(scene, needed, structures, available_bytes())
        }
        _ => Ok(()),
    }
}

/// What the system, and the group of processes this one is in, have left.
pub(crate) fn available_bytes() -> Option<u64> {
    let wanted = RefreshKind::nothing().with_memory(MemoryRefreshKind::nothing().with_ram());
    let system = System::new_with_specifics(wanted).ok()?;
    let of_group = system.cgroup_limits().map(|limits| limits.free_memory);
    let here = system.available_memory();
    Some(of_group.map_or(here, |group| group.min(here))).filter(|bytes| *bytes > 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_free_is_known_here() {
        assert!(available_bytes() > Some(1 << 20));
    }
}
