//! The level stage, the lecture's user selection: of the maps in a file only the one
//! that was chosen is loaded at all.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use crate::input::{InputError, is_readable, read_file};
use crate::scene::{Sample, Scene, WadMap, map_names};

/// A map of a file, decoded to see what it would have added.
#[derive(Clone, PartialEq, Debug)]
pub struct LevelMap {
    /// As the file names it.
    pub name: String,
    /// Items of the map as a scene.
    pub items: usize,
    /// Wall time of decoding it, ns.
    pub load_ns: f64,
}

/// The maps of a scene's file, and which of them the scene is.
#[derive(Clone, PartialEq, Debug)]
pub struct Level {
    /// In file order; one for whatever holds no maps.
    pub maps: Vec<LevelMap>,
    /// Index of the one that was loaded.
    pub selected: usize,
}

/// The WAD file that a scene comes from.
#[derive(Clone, Debug)]
pub struct MapFile {
    /// Its contents.
    pub bytes: Arc<[u8]>,
    /// As it was typed, or the name of a sample.
    pub name: String,
    /// The map that was asked for; the first if none was.
    pub map: Option<String>,
}

impl MapFile {
    /// The file behind what was typed for a scene; `None` if that is no WAD.
    ///
    /// # Errors
    /// The file cannot be read (again).
    pub fn of(source: &str) -> Result<Option<MapFile>, InputError> {
        let (file, map) = match source.rsplit_once('#') {
            Some((file, map)) if !Path::new(source).exists() => (file, Some(map)),
            _ => (source, None),
        };
        let bytes: Arc<[u8]> = match (is_readable(Path::new(file)), Sample::named(file)) {
            (true, _) => read_file(Path::new(file))?,
            (false, Some(sample)) => sample.bytes.into(),
            (false, None) => return Ok(None),
        };
        let is_wad = bytes.starts_with(b"PWAD") || bytes.starts_with(b"IWAD");
        Ok(is_wad.then(|| MapFile {
            bytes,
            name: file.to_owned(),
            map: map.map(str::to_owned),
        }))
    }
}

impl Level {
    /// The level that a scene was loaded from, by what was typed for it. Maps that
    /// cannot be decoded were not selected and are left out.
    ///
    /// # Errors
    /// The file cannot be read again.
    pub fn of(source: &str, scene: &Scene) -> Result<Level, InputError> {
        let file = MapFile::of(source)?;
        let Some(file) = file else {
            return Ok(Level::alone(scene));
        };
        let (bytes, map) = (&file.bytes, file.map.as_deref());
        let names = map_names(bytes, &file.name)?;
        let decoded = names.into_iter().filter_map(|name| {
            let begun = Instant::now();
            let map = WadMap::read(bytes, &file.name, Some(&name)).ok()?;
            let items = map.into_scene(&name).ok()?.items.len();
            Some(LevelMap {
                items,
                load_ns: begun.elapsed().as_nanos() as f64,
                name,
            })
        });
        let maps: Vec<LevelMap> = decoded.collect();
        let is_selected =
            |candidate: &LevelMap| map.is_none_or(|map| candidate.name.eq_ignore_ascii_case(map));
        match maps.iter().position(is_selected) {
            Some(selected) => Ok(Level { maps, selected }),
            None => Ok(Level::alone(scene)),
        }
    }

    /// A scene that is all there is.
    fn alone(scene: &Scene) -> Level {
        Level {
            maps: vec![LevelMap {
                name: scene.name.clone(),
                items: scene.items.len(),
                load_ns: f64::NAN,
            }],
            selected: 0,
        }
    }

    /// Items in the whole file.
    pub fn items(&self) -> usize {
        self.maps.iter().map(|map| map.items).sum()
    }

    /// Items of the map that was selected.
    pub fn selected_items(&self) -> usize {
        self.maps[self.selected].items
    }

    /// What decoding the other maps would have taken, ns; 0 if there are none.
    pub fn saved_ns(&self) -> f64 {
        let others = self.maps.iter().enumerate();
        let others = others.filter(|(i, _)| *i != self.selected);
        others.map(|(_, map)| map.load_ns).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene;

    /// Two maps in one file: the directories of the samples joined.
    fn two_maps() -> Vec<u8> {
        let [first, second] = ["freedm-map12", "freedm-map20"]
            .map(|name| Sample::named(name).expect("a sample").bytes);
        let word = |bytes: &[u8], at: usize| {
            u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"))
        };
        let mut joined = first.to_vec();
        let shift = joined.len() as u32;
        joined.extend_from_slice(second);
        let at = joined.len() as u32;
        let mut count = 0;
        for (bytes, shift) in [(first, 0), (second, shift)] {
            for entry in 0..word(bytes, 4) as usize {
                let from = word(bytes, 8) as usize + 16 * entry;
                let offset = word(bytes, from) + shift;
                joined.extend_from_slice(&offset.to_le_bytes());
                joined.extend_from_slice(&bytes[from + 4..from + 16]);
                count += 1u32;
            }
        }
        joined[4..8].copy_from_slice(&count.to_le_bytes());
        joined[8..12].copy_from_slice(&at.to_le_bytes());
        joined
    }

    #[test]
    fn what_was_not_selected_is_counted() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("two.wad");
        std::fs::write(&file, two_maps()).expect("written");
        let source = format!("{}#map20", file.display());
        let scene = scene::load(&source, &Default::default()).expect("a map");
        let level = Level::of(&source, &scene).expect("a level");
        assert_eq!(level.maps.len(), 2);
        assert_eq!(
            (level.selected, level.selected_items()),
            (1, scene.items.len())
        );
        assert_eq!(level.items(), level.maps[0].items + scene.items.len());
        assert!(level.saved_ns() > 0.0);
        let first = Level::of(&file.display().to_string(), &scene).expect("a level");
        assert_eq!(
            first.selected, 0,
            "the first map is taken where none is named"
        );
    }

    #[test]
    fn what_has_no_maps_is_one_level() {
        let scene = scene::load("city:n=50", &Default::default()).expect("a scene");
        let level = Level::of("city:n=50", &scene).expect("a level");
        assert_eq!(
            (level.items(), level.selected_items(), level.saved_ns()),
            (50, 50, 0.0)
        );
    }
}
