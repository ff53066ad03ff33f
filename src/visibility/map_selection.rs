//! Level stage: selection of one map by the user.
//!
//! Loads only the selected map of a file.

use std::path::Path;
use std::sync::Arc;

use serde::Serialize;

use crate::input::{InputError, is_readable, read_file, unheard};
use crate::scene::{ItemKind, LoadOptions, Sample, Scene, part_names, read_bytes, split_part};

/// Counts of the level stage.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct MapSelection {
    /// Number of maps in the file; 1 for a file without maps.
    pub map_count: usize,
    /// The selected map.
    pub selected: String,
    /// Number of items in all maps.
    pub input_count: usize,
    /// Number of items in the selected map.
    pub output_count: usize,
}

impl MapSelection {
    /// The level that a scene was loaded from, by its source as typed.
    ///
    /// Maps that cannot be decoded are not counted.
    ///
    /// # Errors
    /// The file cannot be read again.
    pub fn of(source: &str, scene: &Scene, options: &LoadOptions) -> Result<Self, InputError> {
        // A source without maps is the scene itself.
        let alone = MapSelection {
            map_count: 1,
            selected: scene.name.clone(),
            input_count: scene.items.len(),
            output_count: scene.items.len(),
        };
        let (file, selected) = split_part(source);
        let bytes: Arc<[u8]> = match (is_readable(Path::new(file)), Sample::named(file)) {
            (true, _) => read_file(Path::new(file))?,
            (false, Some(sample)) => sample.bytes.into(),
            (false, None) => return Ok(alone),
        };
        // Meshes and boxes in the same archive are not maps.
        let is_map = |name: &String| {
            let end = Path::new(name).extension();
            end.is_none_or(|end| end.eq_ignore_ascii_case("bsp") || end.eq_ignore_ascii_case("wad"))
        };
        let mut maps = part_names(&bytes, file)?;
        maps.retain(is_map);
        let exact = maps.iter().position(|name| selected == Some(name));
        let is_selected =
            |name: &String| selected.is_none_or(|selected| name.eq_ignore_ascii_case(selected));
        let Some(own) = exact.or_else(|| maps.iter().rposition(is_selected)) else {
            return Ok(alone);
        };
        let selected = maps.remove(own);
        // Notes on maps that were not selected are dropped.
        let items_of = |name: String| {
            let read = || read_bytes(&bytes, [file, &name], Some(&name), options).ok();
            let mut map = unheard(read)?;
            if options.items == ItemKind::Triangles {
                map = map.by_triangle(options).ok()?;
            }
            Some(map.items.len())
        };
        let others: Vec<usize> = maps.into_iter().filter_map(items_of).collect();
        Ok(MapSelection {
            map_count: 1 + others.len(),
            selected,
            input_count: alone.output_count + others.iter().sum::<usize>(),
            ..alone
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene;

    /// One file with the given sample maps, their directories joined.
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

    /// Writes such a file to a folder; returns its path as typed.
    fn written(folder: &Path, samples: &[&str]) -> String {
        let file = folder.join("several.wad");
        std::fs::write(&file, joined(samples)).expect("written");
        file.display().to_string()
    }

    #[test]
    fn names_may_differ_by_case_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        let maps = ["freedm-map12", "freedm-map20"].map(|name| Sample::named(name).unwrap());
        let entries = [("A.wad", maps[0].bytes, 0), ("a.wad", maps[1].bytes, 0)];
        let file = folder.path().join("case.zip");
        std::fs::write(&file, scene::packed(&entries)).expect("written");
        for (map, name) in maps.iter().zip(["A.wad", "a.wad"]) {
            let source = format!("{}#{name}", file.display());
            let scene = scene::load(&source, &Default::default()).expect("a map");
            let level = MapSelection::of(&source, &scene, &Default::default()).expect("a level");
            let items = map.load().expect("a map").items.len();
            assert_eq!((&level.selected[..], level.output_count), (name, items));
            assert_eq!((scene.items.len(), level.map_count), (items, 2));
        }
    }

    #[test]
    fn what_was_not_selected_is_counted() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = written(folder.path(), &["freedm-map12", "freedm-map20"]);
        let source = format!("{file}#map20");
        let scene = scene::load(&source, &Default::default()).expect("a map");
        let level = MapSelection::of(&source, &scene, &Default::default()).expect("a level");
        let other = scene::load(&format!("{file}#map12"), &Default::default()).expect("a map");
        assert_eq!((level.map_count, &level.selected[..]), (2, "MAP20"));
        assert_eq!(level.output_count, scene.items.len());
        assert_eq!(level.input_count, other.items.len() + scene.items.len());
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
        // Among maps of one name only the last counts.
        let many = ["freedm-map20", "freedm-map12"].repeat(6);
        let many = written(folder.path(), &many);
        refused(&many, &["2 maps, MAP20, MAP12;"]);
        let source = format!("{many}#MAP12");
        let scene = scene::load(&source, &Default::default()).expect("a map");
        let level = MapSelection::of(&source, &scene, &Default::default()).expect("a level");
        assert_eq!((level.map_count, &level.selected[..]), (2, "MAP12"));
        let one = written(folder.path(), &["freedm-map12"]);
        for source in [one.clone(), format!("{one}#MAP12")] {
            let level = |scene: &Scene| {
                MapSelection::of(&source, scene, &Default::default()).expect("a level")
            };
            let scene = scene::load(&source, &Default::default()).expect("a map");
            assert_eq!(level(&scene).input_count, scene.items.len());
        }
    }

    #[test]
    fn levels_are_read_as_the_scene_was() {
        let map = include_bytes!("../../tests/data/two_rooms.bsp");
        let square = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
        let maps = scene::packed(&[
            ("maps/a.bsp", map, 0),
            ("maps/b.bsp", map, 0),
            ("beside.obj", square, 0),
        ]);
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("two.pk3");
        std::fs::write(&file, maps).expect("writable");
        let mut counts = Vec::new();
        for items in [ItemKind::default(), ItemKind::Brushes, ItemKind::Triangles] {
            let options = LoadOptions {
                items,
                ..Default::default()
            };
            let level = |part: &str| {
                let source = format!("{}#{part}", file.display());
                let scene = scene::load(&source, &options)?;
                let level = MapSelection::of(&source, &scene, &options)?;
                Ok::<_, InputError>((level, scene.items.len()))
            };
            let (of_map, items) = level("maps/b.bsp").expect("a level");
            assert_eq!((of_map.map_count, of_map.output_count), (2, items));
            assert_eq!(of_map.input_count, 2 * items);
            // A file that is not a map is not counted.
            if let Ok((of_mesh, items)) = level("beside.obj") {
                assert_eq!((of_mesh.map_count, of_mesh.input_count), (1, items));
            }
            counts.push(items);
        }
        assert!(
            counts[0] != counts[1] && counts[1] != counts[2],
            "{counts:?}"
        );
    }

    #[test]
    fn what_has_no_maps_is_one_level() {
        let scene = scene::load("city:n=50", &Default::default()).expect("a scene");
        let level = MapSelection::of("city:n=50", &scene, &Default::default()).expect("a level");
        assert_eq!((level.input_count, level.output_count), (50, 50));
    }
}
