//! Generated meshes: scenes of triangles, each from a number of triangles and a
//! seed. One file a mesh; the table names them all.

mod forest;
mod icosphere;
mod noise;
mod shapes;
mod spheres;
mod statue;
mod terrain;

use super::surface::Surfaces;
use crate::spec::{Spec, SpecError};

/// A kind of generated mesh.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Mesh {
    /// As it is typed: `mesh:terrain`.
    pub name: &'static str,
    /// What it is, in a line.
    pub summary: &'static str,
    /// Makes about so many triangles (at least one object) from a seed: the same
    /// ones on every machine.
    pub build: fn(triangles: usize, seed: u64) -> Surfaces,
}

/// All generated meshes.
pub const MESHES: &[Mesh] = rows! {
    Mesh { name, summary, build }
    "mesh:terrain", "A heightfield in tiles of 512 triangles; one-sided, open", terrain::build;
    "mesh:forest", "Terrain with trees (closed) and bushes of cut-out leaf cards", forest::build;
    "mesh:spheres", "Geodesic spheres of 1,280 triangles each; closed", spheres::build;
    "mesh:statue", "One bumpy closed blob, up to millions of triangles", statue::build;
};

impl Mesh {
    /// The mesh of a name, with or without `mesh:`.
    pub fn named(name: &str) -> Option<&'static Mesh> {
        let bare = |name: &'static str| name.trim_start_matches("mesh:");
        MESHES
            .iter()
            .find(|mesh| mesh.name == name || bare(mesh.name) == name)
    }
}

/// Most triangles that a spec may ask for: the indices of their corners fit u32.
const MOST_TRIANGLES: u64 = 100_000_000;

/// The mesh that a text describes: `mesh:statue:n=1M,seed=7`. Parameters: `n`
/// triangles (100k), `seed` (1), and `offset`, where the zero of the mesh lies on
/// all axes of the world (0).
///
/// # Errors
/// An unknown mesh, or a parameter that is unknown or out of range.
pub fn load(text: &str) -> Result<Surfaces, SpecError> {
    let mut spec = Spec::parse(text.strip_prefix("mesh:").unwrap_or(text))?;
    let mesh = Mesh::named(spec.name())
        .ok_or_else(|| SpecError::unknown("mesh", text, MESHES.iter().map(|mesh| mesh.name)))?;
    let triangles = spec.count("n", 100_000, MOST_TRIANGLES)?;
    let seed = spec.whole("seed", 1, u64::MAX)?;
    let offset = spec.number("offset", 0.0)?;
    spec.finish()?;
    let mut surfaces = (mesh.build)(triangles as usize, seed);
    surfaces.origin += offset;
    Ok(surfaces)
}

#[cfg(test)]
mod tests {
    use super::super::surface::SurfaceKind;
    use super::*;
    use glam::Vec3;

    #[test]
    fn every_mesh_has_about_the_triangles_asked_for_and_a_box_an_item() {
        for mesh in MESHES {
            assert_eq!(Mesh::named(mesh.name).unwrap().name, mesh.name);
            for asked in [1, 20_000] {
                let surfaces = (mesh.build)(asked, 7);
                let made = surfaces.triangles.len();
                assert!(made > 0 && made < asked + 2000, "{}: {made}", mesh.name);
                assert!(asked == 1 || made > asked / 2, "{}: {made}", mesh.name);
                let scene = surfaces.scene(mesh.name).unwrap();
                assert_eq!(scene.items.len(), surfaces.items());
                assert!(surfaces.points.iter().all(|p| p.is_finite()));
                let next = surfaces.of_item.windows(2);
                assert!(next.into_iter().all(|w| w[0].end == w[1].start));
            }
        }
        assert!(Mesh::named("terrain").is_some() && Mesh::named("mesh:teapot").is_none());
    }

    #[test]
    fn a_text_names_a_mesh_its_size_and_its_place() {
        let near = load("mesh:spheres:n=3k,seed=2").unwrap();
        let far = load("spheres:n=3k,seed=2,offset=1e7").unwrap();
        assert_eq!((near.items(), &near.points), (2, &far.points));
        assert_eq!(far.origin, glam::DVec3::splat(1e7));
        let scene = far.scene("far").unwrap();
        assert_eq!(scene.items, near.scene("near").unwrap().items);
        for wrong in ["mesh:sphere", "mesh:spheres:n=0", "mesh:spheres:m=3"] {
            assert!(load(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn the_seed_decides_everything() {
        for mesh in MESHES {
            let [a, b, other] = [3, 3, 4].map(|seed| (mesh.build)(5000, seed));
            assert_eq!(a.points, b.points);
            assert_eq!(a.triangles, b.triangles);
            assert_ne!(a.points, other.points, "{}", mesh.name);
        }
    }

    #[test]
    fn closed_meshes_are_watertight_and_no_triangle_is_empty() {
        for mesh in MESHES {
            let surfaces = (mesh.build)(20_000, 11);
            for item in 0..surfaces.items() {
                // Ground is open, and so are the cards of bushes.
                let is_tile = surfaces.of_item[item].len() == terrain::TILE;
                let is_bush = surfaces.kinds[item] == SurfaceKind::CutOut;
                if !is_tile && !is_bush {
                    assert_eq!(surfaces.open_edges(item), 0, "{} {item}", mesh.name);
                    assert!(surfaces.volume(item) > 0.0, "{} {item}", mesh.name);
                }
                for [a, b, c] in surfaces.of(item).map(|c| c.map(Vec3::as_dvec3)) {
                    assert!((b - a).cross(c - a).length() > 0.0, "{} {item}", mesh.name);
                }
            }
        }
    }
}
