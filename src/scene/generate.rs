//! The tables of generated worlds, and their common parameters.
//!
//! Boxes are made in `families` and `rooms`, meshes in `meshes`; adding one takes a function there
//! and a row here.

use super::meshes::{ground, spheres};
use super::rng::SeededRng;
use super::rooms::World;
use super::{Regions, Scene, Surfaces, families, rooms};
use crate::input::Result;
use crate::spec::{Spec, SpecError};

/// The random generator of every seeded choice.
///
/// Its stream is fixed by its definition (O'Neill 2014, PCG XSL RR 128/64), so the same seed gives
/// the same scene on every machine.
pub const GENERATOR_NAME: &str = "rand_pcg::Pcg64 (PCG XSL RR 128/64)";

/// A kind of generated world.
#[derive(Clone, Copy)]
pub struct Family {
    /// Name as typed: `city`, `mesh:statue`.
    pub name: &'static str,
    /// One line for `cullbench list`.
    pub summary: &'static str,
    /// Parameters beyond those of all scenes, for the help.
    pub params: &'static str,
    /// The generator.
    pub(super) build: Build,
}

/// A generator: the same world for the same arguments on every machine.
#[derive(Clone, Copy)]
pub(super) enum Build {
    /// Makes `n` boxes from parameters and a random stream.
    Boxes(fn(&mut Spec, usize, &mut SeededRng) -> families::Made),
    /// Makes `n` boxes, and the rooms that they enclose.
    Rooms(fn(&mut Spec, usize, &mut SeededRng) -> Result<World, SpecError>),
    /// Makes about `n` triangles (at least one object) from a seed.
    Mesh(fn(usize, u64) -> Surfaces),
}
use Build::{Boxes, Mesh, Rooms};

/// All families of boxes, in the order of the help.
pub static FAMILIES: &[Family] = rows! { Family { name, summary, params, build }
    "uniform", "boxes scattered evenly in a cube",
        "side=1000 (cube edge, m), size=0.2*side/cbrt(n) (mean box edge, m)", Boxes(families::uniform);
    "clustered", "Gaussian clusters of uneven weight",
        "clusters=64, side=1000 (m), spread=0.02 (standard deviation / side)", Boxes(families::clustered);
    "city", "a flat grid of blocks: tall buildings, streets, tiny street furniture",
        "block=80 (m), street=16 (m)", Boxes(families::city);
    "forest", "trees, bushes and rocks on a fractal heightfield",
        "relief=0.12 (height / width), spacing=5 (m between plants)", Boxes(families::forest);
    "rooms", "an indoor block of cells joined by doors; the cells are the regions",
        "storeys=3, room=6 (mean edge, m)", Rooms(rooms::build);
    "shell", "unit cubes evenly over a sphere, for views from its centre (Bevy's many_cubes: n=160k)",
        "radius=1.25*sqrt(n) (m)", Boxes(families::shell);
    "grid3", "boxes of touching unit spheres on a cubic grid (sseculling: n=512k)",
        "shuffled=0 (1: in random order)", Boxes(families::grid3);
    "bepu", "edges 1 + 99 X^10, X even in 0..1: many small boxes, few large (bepuphysics: n=65536)",
        "side=15.625*cbrt(n) (cube edge, m)", Boxes(families::bepu);
    "corridor", "boxes scattered evenly along a line",
        "width=10 (m), length=1000*width (m)", Boxes(families::corridor);
    "tiles2d", "rectangles in a plane that tile a square; neighbours share exact coordinates",
        "side=1000 (m)", Boxes(families::tiles2d);
    "stack", "piles of coincident boxes", "piles=16", Boxes(families::stack);
    "voxels", "unit cubes on whole coordinates under a fractal surface: ties everywhere",
        "relief=0.2 (height / width)", Boxes(families::voxels);
};

/// All generated meshes, in the order of the help.
pub static MESHES: &[Family] = rows! { Family { name, summary, params, build }
    "mesh:terrain", "a heightfield in tiles of 512 triangles; one-sided, open",
        "", Mesh(ground::terrain);
    "mesh:forest", "terrain with trees (closed) and bushes of cut-out leaf cards",
        "", Mesh(ground::forest);
    "mesh:spheres", "Geodesic spheres of 1,280 triangles each; closed",
        "", Mesh(spheres::spheres);
    "mesh:statue", "One bumpy closed blob, up to millions of triangles",
        "", Mesh(spheres::statue);
};

/// Parameters that every generated scene takes; `n` of a mesh counts triangles.
pub const SCENE_PARAMS: &str = "n=100000, seed=1, offset=0";

/// Default of `n`.
pub(crate) const COUNT: u64 = 100_000;
/// Most items or triangles of a scene.
///
/// 12 GB while boxes are made, 7.2 GB afterwards; indices of corners fit u32.
pub(super) const MOST: u64 = 100_000_000;

impl Family {
    /// The family or mesh of exactly this name.
    pub fn named(name: &str) -> Option<&'static Family> {
        FAMILIES.iter().chain(MESHES).find(|f| f.name == name)
    }

    /// Generates the scene that the spec describes.
    ///
    /// # Errors
    /// A parameter that is unknown or out of range.
    pub(super) fn generate(&self, text: &str, mut spec: Spec) -> Result<Scene> {
        let least = u64::from(matches!(self.build, Mesh(_)));
        let n = spec.whole("n", COUNT, least..=MOST)?;
        let seed = spec.whole("seed", 1, 0..=u64::MAX)?;
        let offset = spec.number("offset", 0.0)?;
        let mut world = match self.build {
            Boxes(build) => World {
                boxes: build(&mut spec, n as usize, &mut SeededRng::new(seed))?,
                ..World::default()
            },
            Rooms(build) => build(&mut spec, n as usize, &mut SeededRng::new(seed))?,
            Mesh(build) => {
                spec.finish()?;
                let mut surfaces = build(n as usize, seed);
                surfaces.origin += offset;
                return surfaces.into_scene(text);
            }
        };
        spec.finish()?;
        if offset != 0.0 {
            world.shift(offset);
        }
        let mut scene = Scene::from_boxes(text, &world.boxes)?;
        if !world.rooms.is_empty() {
            scene.regions = Regions::Tiling(world.tiling(scene.origin));
        }
        Ok(scene)
    }
}

#[cfg(test)]
mod tests {
    use super::super::load;
    use super::*;
    use crate::spec::tests::{keys, known, listed};
    use glam::DVec3;

    impl Family {
        /// The triangles of a mesh.
        pub fn mesh(&self, n: usize, seed: u64) -> Surfaces {
            match self.build {
                Mesh(build) => build(n, seed),
                _ => panic!("{} is no mesh", self.name),
            }
        }
    }

    fn scene(text: &str) -> Scene {
        let spec = Spec::parse(text).unwrap();
        Family::named(spec.name())
            .unwrap()
            .generate(text, spec)
            .unwrap()
    }

    #[test]
    fn every_family_makes_exactly_n_sound_items_from_zero_up() {
        for family in FAMILIES {
            for n in [0, 1, 2, 7, 100, 5000] {
                let scene = scene(&format!("{}:n={n}", family.name));
                assert_eq!(scene.items.len(), n, "{}", family.name);
                assert!(scene.items.iter().all(|b| b.is_finite() && !b.is_empty()));
            }
        }
    }

    #[test]
    fn the_seed_decides_everything() {
        for family in FAMILIES {
            let with = |seed: u32| scene(&format!("{}:n=500,seed={seed}", family.name)).digest();
            assert_eq!(with(3), with(3), "{}", family.name);
            let is_fixed = ["shell", "grid3"].contains(&family.name);
            assert_eq!(with(3) == with(4), is_fixed, "{}", family.name);
        }
    }

    /// Pinned digests of generated worlds.
    ///
    /// Changing a world changes every published figure and belongs in the CHANGELOG.
    #[test]
    fn generated_worlds_are_the_published_ones() {
        let digests: Vec<_> = FAMILIES
            .iter()
            .map(|f| {
                (
                    f.name,
                    scene(&format!("{}:n=1000,seed=7", f.name)).digest()[..16].to_owned(),
                )
            })
            .collect();
        let published = [
            ("uniform", "f30dfca29618a16f"),
            ("clustered", "cfe41ee908f30321"),
            ("city", "9b14e0b3e2a55b23"),
            ("forest", "e53a5ff1901693e7"),
            ("rooms", "7e58616b5720c7e6"),
            ("shell", "6d63162bcd0b6ae2"),
            ("grid3", "0fc813e1f99af322"),
            ("bepu", "d89b2d48367bcb12"),
            ("corridor", "a739e69ad3ad2d80"),
            ("tiles2d", "949cf7ba4e207124"),
            ("stack", "e442d8cf52858a63"),
            ("voxels", "ea399145ac229b4d"),
        ];
        let published: Vec<_> = published
            .map(|(name, digest)| (name, digest.to_owned()))
            .into();
        assert_eq!(digests, published);
    }

    #[test]
    fn every_parameter_of_the_list_is_one_and_no_other() {
        for Family { name, params, .. } in FAMILIES.iter().chain(MESHES) {
            let load = |parameter: &str| load(&format!("{name}:{parameter}"), &Default::default());
            let listed = listed(&format!("{SCENE_PARAMS}, {params}"));
            for (key, default) in &listed {
                let parameter = match key.as_str() {
                    "n" => "n=20".to_owned(),
                    // Derived from the other parameters.
                    _ if default.contains('*') => format!("n=20,{key}=1"),
                    _ => format!("n=20,{key}={default}"),
                };
                let made = load(&parameter);
                assert!(made.is_ok(), "{name}:{parameter}: {:?}", made.err());
            }
            let error = load("n=20,zzz=1").unwrap_err().to_string();
            assert_eq!(known(&error), keys(&listed), "{name}");
        }
    }

    #[test]
    fn an_offset_moves_the_origin_and_keeps_the_boxes() {
        let (here, far) = (scene("uniform:n=100"), scene("uniform:n=100,offset=1e7"));
        assert_eq!(here.origin, DVec3::ZERO);
        assert!((far.origin.x - 1e7).abs() < 2000.0);
        let drift = far.world_bounds().min - here.world_bounds().min - 1e7;
        assert!(drift.abs().max_element() < 1e-3, "{drift}");
    }

    #[test]
    fn bad_parameters_are_refused() {
        for text in [
            "city:n=-1",
            "city:n=1.5",
            "uniform:side=0",
            "rooms:storeys=0",
            "city:trees=4",
        ] {
            let spec = Spec::parse(text).unwrap();
            let result = Family::named(spec.name()).unwrap().generate(text, spec);
            let error = result.err().map(|error| error.to_string());
            let error = error.unwrap_or_default();
            assert!(
                error.starts_with("in '") || error.starts_with("unknown"),
                "{error}"
            );
        }
    }
}
