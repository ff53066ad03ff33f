//! The table of generated worlds and what they share: the named random
//! generator, the item count, the seed and the offset. Each family has a file
//! of its own; adding one is that file and one row here.

use glam::DVec3;

use super::rng::SeededRng;
use super::world::World;
use super::{Regions, Scene, WorldBox, city, clustered, forest, rooms, uniform};
use crate::input::InputError;
use crate::spec::{Spec, SpecError};

/// The generator behind every seeded choice. Its stream is fixed by its
/// definition (O'Neill 2014, PCG XSL RR 128/64), so the same seed gives the
/// same scene on every machine.
pub const GENERATOR_NAME: &str = "rand_pcg::Pcg64 (PCG XSL RR 128/64)";

/// A kind of generated world.
#[non_exhaustive]
pub struct Family {
    /// What is typed.
    pub name: &'static str,
    /// One line for `cullbench list`.
    pub summary: &'static str,
    /// Parameters beyond [`SCENE_PARAMS`], for the help.
    pub params: &'static str,
    build: fn(&mut Spec, usize, &mut SeededRng) -> Result<World, SpecError>,
}

/// All families, in the order of the help.
pub static FAMILIES: &[Family] = rows! { Family { name, summary, params, build }
    "uniform", "boxes scattered evenly in a cube",
        "side=1000 (cube edge, m), size=0.2*side/cbrt(n) (mean box edge, m)", uniform::build;
    "clustered", "Gaussian clusters of uneven weight",
        "clusters=64, side=1000 (m), spread=0.02 (standard deviation / side)", clustered::build;
    "city", "a flat grid of blocks: tall buildings, streets, tiny street furniture",
        "block=80 (m), street=16 (m)", city::build;
    "forest", "trees, bushes and rocks on a fractal heightfield",
        "relief=0.12 (height / width), spacing=5 (m between plants)", forest::build;
    "rooms", "an indoor block of cells joined by doors; the cells are the regions",
        "storeys=3, room=6 (mean edge, m)", rooms::build;
};

/// Parameters that every generated scene takes; `n` of a mesh counts triangles.
pub const SCENE_PARAMS: &str = "n=100000, seed=1, offset=0";

/// Largest scene a spec may ask for: 12 GB while it is made, 7.2 GB then.
pub(super) const MOST_ITEMS: u64 = 100_000_000;

impl Family {
    /// The family of exactly this name.
    pub fn named(name: &str) -> Option<&'static Family> {
        FAMILIES.iter().find(|f| f.name == name)
    }

    /// Generates the scene that the spec describes.
    ///
    /// # Errors
    /// A parameter that is unknown or out of range.
    pub fn generate(&self, text: &str, mut spec: Spec) -> Result<Scene, InputError> {
        let n = spec.whole("n", 100_000, MOST_ITEMS)? as usize;
        let seed = spec.whole("seed", 1, u64::MAX)?;
        let offset = spec.number("offset", 0.0)?;
        let mut rng = SeededRng::new(seed);
        let mut world = (self.build)(&mut spec, n, &mut rng)?;
        spec.finish()?;
        if offset != 0.0 {
            for b in &mut world.boxes {
                *b = WorldBox::new(b.min + offset, b.max + offset);
            }
        }
        let mut scene = Scene::from_boxes(text, &world.boxes)?;
        if let Some(mut plan) = world.rooms {
            plan.shift(DVec3::splat(offset));
            scene.regions = Regions::Tiling(plan.tiling(scene.origin));
        }
        Ok(scene)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{MESHES, load};
    use super::*;
    use crate::spec::tests::{keys, known, listed};

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
            assert_ne!(with(3), with(4), "{}", family.name);
        }
    }

    /// Pinned digests: a change of any generated world is a change of every
    /// published figure and belongs into the CHANGELOG.
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
        ];
        let published: Vec<_> = published
            .map(|(name, digest)| (name, digest.to_owned()))
            .into();
        assert_eq!(digests, published);
    }

    #[test]
    fn every_parameter_of_the_list_is_one_and_no_other() {
        let families = FAMILIES.iter().map(|f| (f.name, f.params));
        for (name, params) in families.chain(MESHES.iter().map(|mesh| (mesh.name, ""))) {
            let load = |parameter: &str| load(&format!("{name}:{parameter}"), &Default::default());
            let listed = listed(&format!("{SCENE_PARAMS}, {params}"));
            for (key, default) in &listed {
                let parameter = match key.as_str() {
                    "n" => "n=20".to_owned(),
                    // Follows from the others.
                    "size" => "n=20,size=1".to_owned(),
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
            assert!(matches!(result, Err(InputError::Spec(_))), "{text}");
        }
    }
}
