//! The level stage, the lecture's user selection: of the maps in a file, only the
//! chosen one is loaded at all.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use crate::input::{InputError, is_readable, read_file};
use crate::scene::{LoadOptions, Sample, Scene, part_names, read_bytes, split_part};
use crate::statistics::{Trimmed, trimmed_mean};

/// Rounds of decoding all maps of a file, so that the time has an interval.
const ROUNDS: usize = 7;

/// A map of a file, decoded to count the items that it would add.
#[derive(Clone, PartialEq, Debug)]
pub struct LevelMap {
    /// Name in the file.
    pub name: String,
    /// Number of items of the map as a scene.
    pub items: usize,
    /// Wall time of decoding it, ns, in each of seven rounds over all maps; empty for
    /// a file of one map.
    pub load_ns: Vec<f64>,
}

/// The maps of a scene's file, and the one that the scene is.
#[derive(Clone, PartialEq, Debug)]
pub struct Level {
    /// Maps in file order; one for a source without maps.
    pub maps: Vec<LevelMap>,
    /// Index of the one that was loaded.
    pub selected: usize,
}

impl Level {
    /// The level that a scene was loaded from, by its source as typed. Maps that
    /// cannot be decoded were not selected and are left out.
    ///
    /// # Errors
    /// The file cannot be read again.
    pub fn of(source: &str, scene: &Scene) -> Result<Level, InputError> {
        let (file, selected) = split_part(source);
        let bytes: Arc<[u8]> = match (is_readable(Path::new(file)), Sample::named(file)) {
            (true, _) => read_file(Path::new(file))?,
            (false, Some(sample)) => sample.bytes.into(),
            (false, None) => return Ok(Level::alone(scene)),
        };
        let decode = |name: &str| {
            let begun = Instant::now();
            let options = LoadOptions::default();
            let map = read_bytes(&bytes, [file, name], Some(name), &options).ok()?;
            Some((map.items.len(), begun.elapsed().as_nanos() as f64))
        };
        let names = part_names(&bytes, file)?;
        let has_others = names.len() > 1;
        // The first time is of memory that has not been read yet.
        let decoded = names.into_iter().filter_map(|name| {
            Some(LevelMap {
                items: decode(&name)?.0,
                load_ns: Vec::new(),
                name,
            })
        });
        let mut maps: Vec<LevelMap> = decoded.collect();
        for _ in 0..if has_others { ROUNDS } else { 0 } {
            for map in &mut maps {
                map.load_ns.extend(decode(&map.name).map(|(_, ns)| ns));
            }
        }
        let is_selected =
            |map: &LevelMap| selected.is_none_or(|name| map.name.eq_ignore_ascii_case(name));
        match maps.iter().position(is_selected) {
            Some(selected) => Ok(Level { maps, selected }),
            None => Ok(Level::alone(scene)),
        }
    }

    /// The level of a source without maps: the scene itself.
    fn alone(scene: &Scene) -> Level {
        Level {
            maps: vec![LevelMap {
                name: scene.name.clone(),
                items: scene.items.len(),
                load_ns: Vec::new(),
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

    /// Wall time of decoding the maps that were not selected, ns; `None` if there are
    /// none.
    pub fn saved_ns(&self) -> Option<Trimmed> {
        let others = || {
            let maps = self.maps.iter().enumerate();
            maps.filter_map(|(i, map)| (i != self.selected).then_some(&map.load_ns))
        };
        let rounds = others().next()?.len();
        let sums = (0..rounds).map(|round| others().map(|load_ns| load_ns[round]).sum());
        trimmed_mean(&sums.collect::<Vec<f64>>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene;

    /// Maps in one file: the samples and their directories joined.
    fn joined(samples: &[&str]) -> Vec<u8> {
        let maps = samples
            .iter()
            .map(|name| Sample::named(name).expect("a sample").bytes);
        let word = |bytes: &[u8], at: usize| {
            u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"))
        };
        let (mut joined, mut directory) = (b"PWAD\0\0\0\0\0\0\0\0".to_vec(), Vec::new());
        for bytes in maps {
            for entry in 0..word(bytes, 4) as usize {
                let from = word(bytes, 8) as usize + 16 * entry;
                let offset = word(bytes, from) + joined.len() as u32;
                directory.extend_from_slice(&offset.to_le_bytes());
                directory.extend_from_slice(&bytes[from + 4..from + 16]);
            }
            joined.extend_from_slice(bytes);
        }
        let (at, count) = (joined.len() as u32, directory.len() as u32 / 16);
        joined.extend(directory);
        joined[4..8].copy_from_slice(&count.to_le_bytes());
        joined[8..12].copy_from_slice(&at.to_le_bytes());
        joined
    }

    /// Such a file in a folder, as it is typed.
    fn written(folder: &Path, samples: &[&str]) -> String {
        let file = folder.join("several.wad");
        std::fs::write(&file, joined(samples)).expect("written");
        file.display().to_string()
    }

    #[test]
    fn what_was_not_selected_is_counted() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = written(folder.path(), &["freedm-map12", "freedm-map20"]);
        let source = format!("{file}#map20");
        let scene = scene::load(&source, &Default::default()).expect("a map");
        let level = Level::of(&source, &scene).expect("a level");
        assert_eq!(level.maps.len(), 2);
        assert_eq!(
            (level.selected, level.selected_items()),
            (1, scene.items.len())
        );
        assert_eq!(level.items(), level.maps[0].items + scene.items.len());
        let saved = level.saved_ns().expect("another map");
        assert_eq!(saved.count, ROUNDS);
        assert!(saved.mean > 0.0);
    }

    #[test]
    fn of_several_maps_one_is_to_be_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let refused = |source: &str, wanted: &[&str]| {
            let error = scene::load(source, &Default::default()).unwrap_err();
            let error = error.to_string();
            for word in wanted {
                assert!(error.contains(word), "{word}: {error}");
            }
            assert!(error.starts_with(source.split('#').next().expect("a file")));
            assert_eq!(error.lines().count(), 1, "{error}");
        };
        let two = written(folder.path(), &["freedm-map12", "freedm-map20"]);
        let wanted = ["2 maps, MAP12, MAP20; expected", "several.wad#MAP12"];
        refused(&two, &wanted);
        let wanted = ["'map7' among MAP12, MAP20; expected"];
        refused(&format!("{two}#map7"), &wanted);
        // Of maps of one name the last is the one that there is.
        let many = ["freedm-map20", "freedm-map12"].repeat(6);
        let many = written(folder.path(), &many);
        refused(&many, &["2 maps, MAP20, MAP12;"]);
        let source = format!("{many}#MAP12");
        let scene = scene::load(&source, &Default::default()).expect("a map");
        let level = Level::of(&source, &scene).expect("a level");
        assert_eq!((level.maps.len(), level.selected), (2, 1));
        let one = written(folder.path(), &["freedm-map12"]);
        for source in [one.clone(), format!("{one}#MAP12")] {
            let level = |scene: &Scene| Level::of(&source, scene).expect("a level");
            let scene = scene::load(&source, &Default::default()).expect("a map");
            assert_eq!(level(&scene).items(), scene.items.len());
        }
    }

    #[test]
    fn what_has_no_maps_is_one_level() {
        let scene = scene::load("city:n=50", &Default::default()).expect("a scene");
        let level = Level::of("city:n=50", &scene).expect("a level");
        assert_eq!((level.items(), level.selected_items()), (50, 50));
        assert_eq!(level.saved_ns(), None, "no other map, and so no time");
    }
}
