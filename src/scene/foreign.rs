//! Formats that are recognised and not read, with what to do instead.

use std::path::Path;

use crate::input::InputError;

const MESH: &str = "glTF or OBJ exported from it, or its boxes as CSV (docs/CAPTURE.md)";
const POINTS: &str = "its objects as boxes CSV (docs/CAPTURE.md)";
const TILES: &str = "its tiles as glTF, or their boxes as CSV (docs/CAPTURE.md)";
const PACKED: &str = "the file that is compressed in it";
const PICTURE: &str = "boxes CSV, glTF, OBJ, a Doom WAD or a Quake III map";

/// Name, beginning (none: told by the extension alone), extension, and what to do.
const FORMATS: [(&str, &[u8], &str, &str); 24] = [
    ("STL", b"", "stl", MESH),
    ("PLY", b"ply\n", "ply", MESH),
    ("PLY", b"ply\r", "ply", MESH),
    ("FBX", b"Kaydara FBX", "fbx", MESH),
    ("FBX", b"; FBX", "fbx", MESH),
    ("USD", b"#usda", "usda", MESH),
    ("USD", b"PXR-USDC", "usdc", MESH),
    ("USD", b"", "usd", MESH),
    ("USDZ", b"", "usdz", MESH),
    ("Blender", b"BLENDER", "blend", MESH),
    ("IFC", b"ISO-10303-21", "ifc", MESH),
    ("Collada", b"<?xml", "dae", MESH),
    ("LAS", b"LASF", "las", POINTS),
    ("LAZ", b"", "laz", POINTS),
    ("OpenStreetMap PBF", b"", "pbf", POINTS),
    ("3D Tiles", b"b3dm", "b3dm", TILES),
    ("3D Tiles", b"i3dm", "i3dm", TILES),
    ("3D Tiles", b"pnts", "pnts", TILES),
    ("3D Tiles", b"cmpt", "cmpt", TILES),
    ("PNG", b"\x89PNG", "png", PICTURE),
    ("JPEG", b"\xff\xd8\xff", "jpg", PICTURE),
    ("Cube 2 map", b"", "ogz", MESH),
    ("gzip", b"\x1f\x8b", "gz", PACKED),
    ("Zstandard", b"\x28\xb5\x2f\xfd", "zst", PACKED),
];

/// Refuses formats that are known not to be read.
///
/// # Errors
/// The name of the format, and what to give instead.
pub fn refuse(bytes: &[u8], file: &str) -> Result<(), InputError> {
    let extension = Path::new(file).extension().unwrap_or_default();
    let is_named = |name: &str| extension.eq_ignore_ascii_case(name);
    let holds = |word: &[u8]| bytes.windows(word.len()).any(|window| window == word);
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let is_json = matches!(text.trim_ascii_start().first(), Some(b'{' | b'['));
    let begins = |start: &[u8]| !start.is_empty() && text.starts_with(start);
    let by_start = FORMATS.iter().find(|row| begins(row.1));
    let by_name = FORMATS.iter().find(|row| is_named(row.2));
    let stl = || bytes.starts_with(b"solid ") && holds(b"facet") || is_binary_stl(bytes);
    let (name, expected) = match by_name.or(by_start) {
        Some(row) => (row.0, row.3),
        None if stl() => ("STL", MESH),
        None if is_json && holds(b"\"geometricError\"") => ("3D Tiles", TILES),
        None if is_json && !is_named("gltf") && !holds(b"\"asset\"") => {
            ("JSON without the 'asset' of glTF", PICTURE)
        }
        None => return Ok(()),
    };
    let found = format_args!("{name}, which is not read");
    Err(InputError::byte(file, 0, found, expected))
}

/// Tells binary STL by its size: 80 bytes, a count, 50 bytes for each triangle.
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

    #[test]
    fn formats_are_named_by_content_or_extension() {
        let mut binary_stl = vec![0; 84 + 50];
        binary_stl[80] = 1;
        let tiles = br#" {"asset":{"version":"1.1"},"geometricError":500,"root":{}}"#;
        let cases: [(&[u8], &str, &str); 9] = [
            (b"solid cube\nfacet normal 0 0 1\n", "a", "STL"),
            (&binary_stl, "a", "STL"),
            (b"ply\nformat ascii 1.0\n", "a.csv", "PLY"),
            (b"\x1f\x8b\x08", "map.OGZ", "Cube 2 map"),
            (b"\x1f\x8b\x08", "boxes.csv.gz", "gzip"),
            (b"\0\0\0\x0d", "city.osm.pbf", "OpenStreetMap PBF"),
            (tiles, "tileset.json", "3D Tiles"),
            (b"[1, 2]", "a.json", "JSON without the 'asset' of glTF"),
            (b"BLENDER-v300", "a", "Blender"),
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
    }
}
