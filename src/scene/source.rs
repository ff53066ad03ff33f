//! From a typed scene to its data.
//!
//! A built-in sample, a generated family with parameters, or a file by its contents. Known formats
//! that are not read are refused with a suggestion.

use std::fs;
use std::path::Path;

use serde::de::IgnoredAny;

use super::generate::{Build, COUNT, MOST};
use super::gltf::{self, Beside, beside, is_gltf};
use super::ibsp::{is_ibsp, read_ibsp};
use super::obj::{is_obj, read_obj};
use super::zip::{self, is_zip};
use super::{
    FAMILIES, Family, ItemKind, LoadOptions, MESHES, Regions, SAMPLES, Sample, Scene, UpAxis,
    WadMap, WorldBox, boxes_csv, map_names,
};
use crate::input::{InputError, Result, is_readable, note, note_counted, read_file};
use crate::shown::{plain, shortened};
use crate::spec::{Spec, SpecError, nearest};

/// Prefix of the name of every mesh.
const MESH_PREFIX: &str = "mesh:";

/// The file and the name within it of `maps.wad#MAP07` or `pak.pk3#maps/q.bsp`.
///
/// An existing file takes precedence.
pub fn split_part(source: &str) -> (&str, Option<&str>) {
    let cuts = source.match_indices('#').rev();
    let mut parts = cuts.map(|(at, _)| (&source[..at], Some(&source[at + 1..])));
    let is_there = |(file, _): &(&str, _)| is_readable(Path::new(file));
    if Path::new(source).exists() {
        return (source, None);
    }
    let found = parts.clone().find(is_there).or_else(|| parts.next());
    found.unwrap_or((source, None))
}

/// The scenes of `maps.wad#*` or `pak.pk3#*`, one by one; else the source itself.
///
/// # Errors
/// A file that cannot be read, or a damaged directory.
pub fn every_part(source: &str) -> Result<Vec<String>> {
    let (file, part) = split_part(source);
    let names = match part {
        Some("*") => part_names(&read_file(Path::new(file))?, file)?,
        _ => Vec::new(),
    };
    Ok(match names.is_empty() {
        true => vec![source.to_owned()],
        false => names.iter().map(|name| format!("{file}#{name}")).collect(),
    })
}

/// Recognises a zip archive by its magic, or by its name if bytes precede that.
fn is_archive(bytes: &[u8], file: &str) -> bool {
    let has_name = [".zip", ".pk3"].map(|end| file.to_ascii_lowercase().ends_with(end));
    let is_other = || is_wad(bytes) || is_ibsp(bytes) || is_gltf(bytes);
    is_zip(bytes) || has_name.contains(&true) && !is_other()
}

/// Names of the maps of a WAD or the scenes of a zip archive; empty for others.
///
/// # Errors
/// A damaged directory.
pub fn part_names(bytes: &[u8], file: &str) -> Result<Vec<String>> {
    match (is_wad(bytes), is_archive(bytes, file)) {
        (true, _) => map_names(bytes, file),
        (_, true) => zip::scene_names(bytes, file),
        _ => Ok(Vec::new()),
    }
}

/// Loads a scene: a sample, a spec or a file.
///
/// `freedm-map12`, `city:n=100000,seed=7`, `mesh:statue:n=1M`, `boxes.csv`, `map.wad`,
/// `maps.wad#MAP07` or `pak.pk3#maps/q.bsp`. An existing file takes precedence over a name.
///
/// # Errors
/// One line that names what was found and what was expected.
pub fn load(source: &str, options: &LoadOptions) -> Result<Scene> {
    let mut scene = read(source, options)?;
    if options.items == ItemKind::Triangles {
        scene = scene.by_triangle(options)?;
    }
    let is_of_map = matches!(options.items, ItemKind::Surfaces | ItemKind::Brushes);
    if let Regions::Leaves(map) = &scene.regions {
        let what = "without triangles (flares), no items";
        note_counted(source, [(map.bare, "surface", what)]);
    } else if is_of_map {
        let items = options.items.name();
        let expected =
            format_args!("{source}: no {items}; expected a Quake III map for --items {items}");
        return Err(SpecError::new(expected).into());
    }
    if let Some(up) = options.up.filter(|up| *up != scene.up) {
        let (name, own, up) = (&scene.name, scene.up.name(), up.name());
        let what = format_args!("{own} is up by its format; --up {up} is for boxes CSV and OBJ");
        note(&format!("{name}: {what}"));
    }
    // Formats that define an axis define a unit as well.
    if options.up.is_none() && scene.unit.is_none() {
        let WorldBox { min, max } = scene.world_bounds();
        let along = |axis: UpAxis| (max - min).dot(axis.vector());
        let is_flat = |axis: &UpAxis| 4.0 * along(*axis) < (max.x - min.x).min(along(scene.up));
        if let Some(flat) = UpAxis::ALL.into_iter().find(is_flat) {
            let (name, up, flat) = (&scene.name, scene.up.name(), flat.name());
            let what =
                format_args!("flat along {flat}; --up {flat} if that is up, --up {up} if not");
            note(&format!("{name}: {what}"));
        }
    }
    Ok(scene)
}

fn read(source: &str, options: &LoadOptions) -> Result<Scene> {
    let (file, part) = split_part(source);
    if is_readable(Path::new(file)) {
        let bytes = read_file(Path::new(file))?;
        return read_bytes(&bytes, [file, source], part, options);
    }
    let looks_like_a_file = source.contains(['/', '\\', '.']) && !source.contains('=');
    if looks_like_a_file {
        let error = fs::metadata(file).err();
        let error = error.unwrap_or(std::io::ErrorKind::IsADirectory.into());
        return Err(InputError::io(Path::new(file), "file")(error));
    }
    let spec = Spec::parse_behind(MESH_PREFIX, source)?;
    if let Some(family) = Family::named(spec.name()) {
        family.check_fits(source, &spec, options)?;
        return Ok(Scene {
            unit: Some("m"),
            ..family.generate(source, spec)?
        });
    }
    if let Some(sample) = Sample::named(spec.name()) {
        spec.finish()?;
        return sample.load();
    }
    let generated = FAMILIES.iter().chain(MESHES).map(|f| f.name);
    let known = generated.chain(SAMPLES.iter().map(|s| s.name));
    let guess = nearest(spec.name(), known.clone());
    let hint = guess.map_or(String::new(), |guess| format!("; did you mean '{guess}'?"));
    let error = SpecError::new(format_args!(
        "unknown scene '{}': neither a file nor a built-in scene{hint} (built in: {})",
        spec.name(),
        known.collect::<Vec<_>>().join(", ")
    ));
    Err(error.into())
}

/// Refuses a scene whose name shows that it will not fit into memory.
///
/// Nothing is loaded.
///
/// # Errors
/// A scene that would not fit.
pub fn check_fits(source: &str, options: &LoadOptions) -> Result<()> {
    let Ok(spec) = Spec::parse_behind(MESH_PREFIX, source) else {
        return Ok(());
    };
    let family = Family::named(spec.name()).filter(|_| !is_readable(Path::new(source)));
    family.map_or(Ok(()), |family| family.check_fits(source, &spec, options))
}

impl Family {
    /// Refuses a scene that would not fit.
    ///
    /// The generator reports an invalid count.
    fn check_fits(&self, source: &str, spec: &Spec, options: &LoadOptions) -> Result<()> {
        let Ok(n) = spec.clone().whole("n", COUNT, 0..=MOST) else {
            return Ok(());
        };
        match self.build {
            Build::Boxes(_) | Build::Rooms(_) => options.check_fits(source, Some(n), 0),
            Build::Mesh(_) => options.check_fits(source, None, n),
        }
    }
}

/// Reads a file by its first bytes or extension; anything else as boxes CSV.
///
/// `name` becomes the scene's name.
///
/// # Errors
/// The errors of [`load`].
pub fn read_bytes(
    bytes: &[u8],
    names: [&str; 2],
    map: Option<&str>,
    options: &LoadOptions,
) -> Result<Scene> {
    read_beside(bytes, names, map, options, &|uri| beside(names[0], uri))
}

fn read_beside(
    bytes: &[u8],
    [file, name]: [&str; 2],
    map: Option<&str>,
    options: &LoadOptions,
    beside: Beside,
) -> Result<Scene> {
    refuse(bytes, file)?;
    if is_archive(bytes, file) {
        let archive = zip::open(bytes, file)?;
        // Listed once: a glTF may have a buffer in each of thousands of entries.
        let entries = zip::entries(&archive, file)?;
        let named = zip::finder(&entries);
        let (entry, record, map) = zip::chosen(&entries, &named, file, map)?;
        let bytes = zip::unpacked(&archive, file, (entry, record))?;
        let names = [&format!("{file}#{}", plain(entry)), name];
        let folder = entry.rfind('/').map_or("", |end| &entry[..=end]);
        let beside = |uri: &str| {
            let mut parts: Vec<&str> = folder.split_terminator('/').collect();
            for part in uri.split('/').filter(|part| *part != ".") {
                match parts.last() {
                    Some(last) if part == ".." && *last != ".." => drop(parts.pop()),
                    _ => parts.push(part),
                }
            }
            let wanted = parts.join("/");
            let Some((name, record)) = named(&wanted) else {
                let found = format!("no '{}' beside it", shortened(&wanted, 80));
                let expected = "the files that it names";
                return Err(InputError::at(names[0], "buffers", found, expected));
            };
            zip::unpacked(&archive, file, (name, record))
        };
        return read_beside(&bytes, names, map, options, &beside);
    }
    let extension = Path::new(file).extension();
    let is_named = |name: &str| extension.is_some_and(|e| e.eq_ignore_ascii_case(name));
    if is_wad(bytes) || is_named("wad") && !is_ibsp(bytes) {
        return Ok(Scene {
            unit: Some("map units"),
            ..WadMap::read(bytes, file, map)?.into_scene(name)?
        });
    }
    if let Some(map) = map {
        let found = format!("no parts, and so no '{}'", shortened(map, 80));
        return Err(InputError::byte(file, 0, found, "a WAD or a zip archive"));
    }
    if is_ibsp(bytes) || is_named("bsp") {
        return read_ibsp(bytes, file, name, options);
    }
    let is_gltf = is_gltf(bytes) || is_named("gltf") || is_named("glb");
    if is_gltf || is_obj(bytes) || is_named("obj") {
        if options.skip_bad_items {
            note(&format!("{name}: --skip-bad-items is for boxes CSV"));
        }
        return match is_gltf {
            true => gltf::read_beside(bytes, [file, name], options, beside),
            false => read_obj(bytes, file, name, options),
        };
    }
    // UTF-16 has an error of its own.
    if bytes.iter().take(32).any(|byte| *byte == 0) && !bytes.starts_with(b"\xff\xfe") {
        let found = "a binary file of no known format";
        return Err(InputError::byte(file, 0, found, READ));
    }
    let rows = bytes.iter().filter(|byte| **byte == b'\n').count() as u64;
    options.check_fits(name, Some(rows), 0)?;
    let mut scene = boxes_csv::read_boxes_csv(bytes, file, options.skip_bad_items)?;
    scene.name = name.to_owned();
    scene.up = options.up.unwrap_or_default();
    Ok(scene)
}

/// Tests for the magic of a WAD file.
pub fn is_wad(bytes: &[u8]) -> bool {
    bytes.starts_with(b"PWAD") || bytes.starts_with(b"IWAD")
}

impl Sample {
    /// Loads the scene of the sample.
    ///
    /// # Errors
    /// The file cannot be read; no sample of this build has that error.
    pub fn load(&self) -> Result<Scene> {
        let names = [self.file, self.name];
        Ok(Scene {
            unit: Some(self.unit),
            ..read_bytes(self.bytes, names, None, &LoadOptions::default())?
        })
    }
}

const MESH: &str = "glTF or OBJ exported from it, or its boxes as CSV (docs/CAPTURE.md)";
const POINTS: &str = "its objects as boxes CSV (docs/CAPTURE.md)";
const TILES: &str = "its tiles as glTF, or their boxes as CSV (docs/CAPTURE.md)";
const PACKED: &str = "the file that is packed in it";
const OWN_MAP: &str = "the BSP map that it belongs to";
const READ: &str = "boxes CSV, glTF, OBJ, a Doom WAD or a Quake III map";

/// Name (empty: the extension), first bytes, extensions in capitals, suggestion.
const FORMATS: [(&str, &[&[u8]], &str, &str); 22] = [
    ("", &[], "3DS 3MF ASE B3D DXF LWO OFF STL", MESH),
    ("", &[], "TSCN UASSET UNITY USDZ VOX WRL X", MESH),
    ("", &[], "E57 LAZ PARQUET PCD", POINTS),
    ("PLY", &[b"ply\n", b"ply\r"], "PLY", MESH),
    ("FBX", &[b"Kaydara FBX", b"; FBX"], "FBX", MESH),
    ("USD", &[b"#usda", b"PXR-USDC"], "USD USDA USDC", MESH),
    ("Blender", &[b"BLENDER"], "BLEND", MESH),
    ("IFC", &[b"ISO-10303-21"], "IFC", MESH),
    ("LAS", &[b"LASF"], "LAS", POINTS),
    ("OpenStreetMap PBF", &[], "PBF", POINTS),
    ("3D Tiles", &[b"b3dm", b"i3dm"], "B3DM I3DM", TILES),
    ("3D Tiles", &[b"pnts", b"cmpt"], "PNTS CMPT", TILES),
    ("PNG", &[b"\x89PNG"], "PNG", READ),
    ("JPEG", &[b"\xff\xd8\xff"], "JPG JPEG", READ),
    ("Cube 2 map", &[], "OGZ", MESH),
    ("Quake PACK", &[b"PACK"], "PAK", "a Quake III map of a pk3"),
    ("Quake editor map", &[], "MAP", OWN_MAP),
    ("AAS (bot paths)", &[b"EAAS"], "AAS", OWN_MAP),
    ("gzip", &[b"\x1f\x8b"], "GZ", PACKED),
    ("Zstandard", &[b"\x28\xb5\x2f\xfd"], "ZST", PACKED),
    ("xz", &[b"\xfd7zXZ"], "XZ", PACKED),
    ("bzip2 or 7z", &[b"BZh", b"7z\xbc\xaf"], "BZ2 7Z", PACKED),
];

/// Refuses known formats that are not read.
///
/// # Errors
/// The name of the format, and what to give instead.
pub fn refuse(bytes: &[u8], file: &str) -> Result<()> {
    let extension = Path::new(file).extension().unwrap_or_default();
    let extension = extension.to_string_lossy().to_ascii_uppercase();
    let holds = |word: &[u8]| bytes.windows(word.len()).any(|window| window == word);
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let begins = |row: &&(_, &[&[u8]], _, _)| row.1.iter().any(|start| text.starts_with(start));
    let by_start = FORMATS.iter().find(begins);
    // The file may be a download unpacked under its old name.
    let is_named = |row: &&(_, _, &str, _)| row.2.split(' ').any(|name| name == extension);
    let mut named = FORMATS.iter().filter(is_named);
    let by_name = named.find(|row| row.3 != PACKED || begins(row));
    let stl = || bytes.starts_with(b"solid ") && holds(b"facet") || is_binary_stl(bytes);
    let first = text.trim_ascii_start().first();
    let is_xml = first == Some(&b'<');
    // A first value that is valid up to its end.
    let mut values = serde_json::Deserializer::from_slice(text).into_iter::<IgnoredAny>();
    let is_json = matches!(first, Some(b'{' | b'[')) && extension != "GLTF";
    let is_json = is_json && values.any(|value| value.err().is_none_or(|error| error.is_eof()));
    let (name, expected) = match by_name.or(by_start) {
        Some(row) => (row.0, row.3),
        None if stl() => ("STL", MESH),
        None if bytes.get(257..262) == Some(b"ustar") => ("tar", PACKED),
        None if is_xml && holds(b"<COLLADA") => ("Collada", MESH),
        None if is_xml => ("XML or HTML", READ),
        None if is_json && holds(b"\"geometricError\"") => ("3D Tiles", TILES),
        None if is_json && !holds(b"\"asset\"") => ("JSON without the 'asset' of glTF", READ),
        None => return Ok(()),
    };
    let name = [name, &extension][usize::from(name.is_empty())];
    let found = format!("{name}, which is not read");
    Err(InputError::byte(file, 0, found, expected))
}

/// Recognises binary STL by its size: 80 bytes, a count, 50 bytes per triangle.
fn is_binary_stl(bytes: &[u8]) -> bool {
    let count = bytes.get(80..84).and_then(|count| count.try_into().ok());
    count.is_some_and(|count| {
        let count = u64::from(u32::from_le_bytes(count));
        count > 0 && bytes.len() as u64 == 84 + 50 * count
    })
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
        let (obj, names) = (b"v 0 0 0\nf 1 1 1\n", ["a.csv", "a"]);
        assert!(read_bytes(obj, names, None, &LoadOptions::default()).is_ok());
    }

    #[test]
    fn every_part_of_a_file_is_named() {
        let all = |source: &str| every_part(source).unwrap();
        let map = ["datasets/freedm_map12.wad#MAP12"];
        assert_eq!(all("datasets/freedm_map12.wad#*"), map);
        for source in ["datasets/freedm_map12.wad", "city:n=9", "none.wad#MAP01"] {
            assert_eq!(all(source), [source]);
        }
        assert!(every_part("none.wad#*").is_err());
    }

    #[test]
    fn what_cannot_be_loaded_says_why() {
        assert!(error("unifrom").contains("did you mean 'uniform'"));
        assert!(error("mesh:sphere").contains("did you mean 'mesh:spheres'"));
        assert!(error("mesh:statue:n=many").contains("n is 'many'; expected"));
        assert!(error("mesh:statue:size=3").contains("unknown parameter"));
        assert!(error("no/such/file.csv").contains("no/such/file.csv: No such file"));
        assert!(error("datasets/").contains("a directory; expected a file"));
        assert!(error("datasets/freedm_map12.wad#MAP99").contains("no map 'MAP99'"));
        let part = error("Cargo.lock#MAP01");
        let wanted = "no parts, and so no 'MAP01'; expected a WAD or a zip archive";
        assert!(part.ends_with(wanted), "{part}");
        assert!(error("helsinki:n=3").contains("unknown parameter"));
    }

    #[test]
    fn formats_are_named_by_content_or_extension() {
        let mut binary_stl = vec![0; 84 + 50];
        binary_stl[80] = 1;
        let tiles = br#" {"asset":{"version":"1.1"},"geometricError":500,"root":{}}"#;
        let tar = [[b'n'; 257].as_slice(), b"ustar"].concat();
        let cases: [(&[u8], &str, &str); 18] = [
            (b"solid cube\nfacet normal 0 0 1\n", "a", "STL"),
            (&binary_stl, "a", "STL"),
            (b"ply\nformat ascii 1.0\n", "a.csv", "PLY"),
            (b"\x1f\x8b\x08", "map.OGZ", "Cube 2 map"),
            (b"\x1f\x8b\x08", "boxes.csv.gz", "gzip"),
            (b"\0\0\0\x0d", "city.osm.pbf", "OpenStreetMap PBF"),
            (tiles, "tileset.json", "3D Tiles"),
            (b"[1, 2]", "a.json", "JSON without the 'asset' of glTF"),
            (b"BLENDER-v300", "a", "Blender"),
            (b"PACK\x0c\0\0\0", "a", "Quake PACK"),
            (b"EAAS\x05\0\0\0", "a", "AAS (bot paths)"),
            (
                b"{\n\"classname\" \"worldspawn\"",
                "q.map",
                "Quake editor map",
            ),
            (b"[gd_scene format=3]", "a.tscn", "TSCN"),
            (b"<?xml version=\"1.0\"?>\n<osm>", "a.osm", "XML or HTML"),
            (b"<?xml version=\"1.0\"?>\n<COLLADA>", "a", "Collada"),
            (b"MM\x99\0\0\0", "a.3ds", "3DS"),
            (b"\xfd7zXZ\0", "a.csv.xz", "xz"),
            (&tar, "a", "tar"),
        ];
        for (bytes, file, name) in cases {
            let error = refuse(bytes, file).unwrap_err().to_string();
            let wanted = format!("{file}, byte 0: {name}, which is not read; expected ");
            assert!(error.starts_with(&wanted) && error.len() < 160, "{error}");
        }
        let read: [(&[u8], &str); 4] = [
            (b"min_x,min_y\n", "a.csv"),
            (b"solid,min_x\n", "a.csv"),
            (b"{}", "a.gltf"),
            (br#"{"asset":{"version":"2.0"}}"#, "a"),
        ];
        for (bytes, file) in read {
            refuse(bytes, file).unwrap();
        }
        let of = |bytes: &[u8]| {
            read_bytes(bytes, ["a", "a"], None, &LoadOptions::default()).unwrap_err()
        };
        let binary = "a, byte 0: a binary file of no known format; expected boxes CSV, ";
        assert!(of(b"\x7fELF\x02\0\0\0").to_string().starts_with(binary));
        assert!(of(b"\xff\xfem\0").to_string().contains("UTF-16"));
        assert!(of(b"{\"classname\" 1}").to_string().contains("expected"));
    }
}
