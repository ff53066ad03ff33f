//! From what a user names to a scene: a built-in sample, a generated family
//! with parameters, or a file by its contents. It makes that decision only.

use std::fs;
use std::path::Path;

use super::{
    FAMILIES, Family, MESHES, Mesh, SAMPLES, Sample, Scene, WadMap, boxes_csv, memory, meshes,
};
use crate::input::{InputError, is_readable, read_file};
use crate::spec::{Spec, SpecError, nearest};

/// How to read a scene.
#[derive(Clone, Copy, Default, Debug)]
pub struct LoadOptions {
    /// Leave out rows that are no finite box, and count them.
    pub skip_bad_items: bool,
    /// Structures that will be built over the scene: they need memory as well.
    pub structures: u64,
    /// Bytes that will be needed for each triangle of a mesh, beside the scene.
    pub per_triangle: u64,
}

/// Loads `freedm-map12`, `city:n=100000,seed=7`, `mesh:statue:n=1M`, `boxes.csv`,
/// `map.wad` or `maps.wad#MAP07`. An existing file wins over a name.
///
/// # Errors
/// One line that names what was found and what was expected.
pub fn load(source: &str, options: &LoadOptions) -> Result<Scene, InputError> {
    let (file, map) = match source.rsplit_once('#') {
        Some((file, map)) if !Path::new(source).exists() => (file, Some(map)),
        _ => (source, None),
    };
    if is_readable(Path::new(file)) {
        let bytes = read_file(Path::new(file))?;
        return match map {
            Some(map) => WadMap::read(&bytes, file, Some(map))?.into_scene(source),
            None => parse_bytes(&bytes, file, source, options),
        };
    }
    let looks_like_a_file = source.contains(['/', '\\', '.']) && !source.contains('=');
    if !looks_like_a_file {
        if let Some(generated) = Generated::named(source)? {
            generated.check_fits(source, options)?;
            return generated.generate(source);
        }
        let spec = Spec::parse_behind(meshes::PREFIX, source)?;
        if let Some(sample) = Sample::named(spec.name()) {
            spec.finish()?;
            return sample.load();
        }
        return Err(unknown_scene(spec.name()).into());
    }
    Err(InputError::Io {
        path: file.into(),
        source: match fs::metadata(file) {
            Ok(_) => std::io::Error::other("is not a file"),
            Err(error) => error,
        },
    })
}

/// Whether a scene will fit into memory, as far as its name says; nothing is
/// loaded.
///
/// # Errors
/// [`InputError::TooLarge`].
pub fn check_fits(source: &str, options: &LoadOptions) -> Result<(), InputError> {
    match Generated::named(source) {
        Ok(Some(generated)) if !is_readable(Path::new(source)) => {
            generated.check_fits(source, options)
        }
        _ => Ok(()),
    }
}

/// Something that is made from parameters.
enum Generated {
    Family(&'static Family, Spec),
    Mesh(&'static Mesh, Spec),
}

impl Generated {
    /// `None` if no generator has this name.
    fn named(source: &str) -> Result<Option<Generated>, SpecError> {
        let spec = Spec::parse_behind(meshes::PREFIX, source)?;
        if let Some(mesh) = Mesh::named(spec.name()) {
            return Ok(Some(Generated::Mesh(mesh, spec)));
        }
        let family = Family::named(spec.name());
        Ok(family.map(|family| Generated::Family(family, spec)))
    }

    fn check_fits(&self, source: &str, options: &LoadOptions) -> Result<(), InputError> {
        let structures = options.structures;
        match self {
            Generated::Family(_, spec) => memory::fits_here(source, spec, structures),
            Generated::Mesh(_, spec) => {
                memory::mesh_fits_here(source, spec, structures, options.per_triangle)
            }
        }
    }

    fn generate(self, source: &str) -> Result<Scene, InputError> {
        match self {
            Generated::Family(family, spec) => family.generate(source, spec),
            Generated::Mesh(mesh, spec) => mesh.generate(source, spec),
        }
    }
}

/// A WAD by its magic, anything else as boxes CSV.
pub(super) fn parse_bytes(
    bytes: &[u8],
    file: &str,
    name: &str,
    options: &LoadOptions,
) -> Result<Scene, InputError> {
    let is_wad = bytes.starts_with(b"PWAD") || bytes.starts_with(b"IWAD");
    let named_wad = Path::new(file)
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("wad"));
    if is_wad || named_wad {
        return WadMap::read(bytes, file, None)?.into_scene(name);
    }
    let rows = bytes.iter().filter(|byte| **byte == b'\n').count();
    memory::rows_fit_here(name, rows as u64, options.structures)?;
    let mut scene = boxes_csv::read_boxes_csv(bytes, file, options.skip_bad_items)?;
    scene.name = name.to_owned();
    Ok(scene)
}

fn unknown_scene(word: &str) -> SpecError {
    let families = FAMILIES.iter().map(|f| f.name);
    let generated = families.chain(MESHES.iter().map(|m| m.name));
    let known = generated.chain(SAMPLES.iter().map(|s| s.name));
    let hint = match nearest(word, known.clone()) {
        Some(guess) => format!("; did you mean '{guess}'?"),
        None => String::new(),
    };
    SpecError::new(format_args!(
        "unknown scene '{word}': neither a file nor a built-in scene{hint} (built in: {})",
        known.collect::<Vec<_>>().join(", ")
    ))
}

impl Sample {
    /// The scene in it.
    ///
    /// # Errors
    /// The file cannot be read; no sample of this build has that error.
    pub fn load(&self) -> Result<Scene, InputError> {
        parse_bytes(self.bytes, self.file, self.name, &LoadOptions::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(source: &str) -> String {
        load(source, &LoadOptions::default())
            .unwrap_err()
            .to_string()
    }

    #[test]
    fn names_specs_and_files_load() {
        for source in [
            "freedm-map12",
            "city:n=10",
            "datasets/freedm_map20.wad",
            "datasets/freedm_map12.wad#map12",
            "mesh:statue:n=500,seed=7",
        ] {
            let scene = load(source, &LoadOptions::default()).unwrap();
            assert_eq!(scene.name, source);
            assert!(!scene.items.is_empty());
        }
    }

    #[test]
    fn what_cannot_be_loaded_says_why() {
        assert!(error("unifrom").contains("did you mean 'uniform'"));
        assert!(error("mesh:sphere").contains("did you mean 'mesh:spheres'"));
        assert!(error("mesh:statue:n=many").contains("n is 'many'; expected"));
        assert!(error("mesh:statue:size=3").contains("unknown parameter"));
        assert!(error("no/such/file.csv").contains("no/such/file.csv: No such file"));
        assert!(error("datasets/").contains("not a file"));
        assert!(error("datasets/freedm_map12.wad#MAP99").contains("no map 'MAP99'"));
        assert!(error("helsinki:n=3").contains("unknown parameter"));
    }
}
