//! Zip archives (zip, pk3), read in place: one entry is unpacked at a time.
//!
//! No size is trusted before the bytes are there. Buffers of a glTF are entries beside it: `..`
//! does not leave the archive. Source: PKWARE, APPNOTE.TXT 6.3.

use std::collections::{HashMap, HashSet};
use std::fmt::Display;

use miniz_oxide::inflate::decompress_to_vec_with_limit;
use rawzip::{CompressionMethod, ZipArchive, ZipFileHeaderRecord, ZipSliceArchive, crc32};

use super::memory;
use crate::input::{InputError, Result};
use crate::shown::{counted, first_of, part_hint, plain, shortened};

/// Extensions of scenes.
const SCENES: [&str; 6] = [".bsp", ".wad", ".gltf", ".glb", ".obj", ".csv"];
/// Most names in a message.
const MOST_NAMED: usize = 32;
/// Peak memory of unpacking / size of the entry: the buffer grows by doubling.
const GROWTH: u64 = 3;

/// Recognises an archive by the magic of its first entry, or of its end if empty.
pub fn is_zip(bytes: &[u8]) -> bool {
    bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"PK\x05\x06")
}

/// Names of the entries of an archive that are scenes by extension, in its order.
pub fn scene_names(bytes: &[u8], file: &str) -> Result<Vec<String>> {
    let archive = open(bytes, file)?;
    let entries = entries(&archive, file)?.into_iter();
    let names = entries.map(|(name, _)| name);
    Ok(names.filter(|name| ends_in(name, &SCENES)).collect())
}

/// The unpacked bytes of an entry.
///
/// # Errors
/// An encrypted entry, another compression method, too little memory, or bytes that differ from the
/// directory.
pub fn unpacked(
    archive: &Archive,
    file: &str,
    (name, record): (&str, &ZipFileHeaderRecord),
) -> Result<Vec<u8>> {
    let refused = |found: &dyn Display, expected: &str| {
        let place = format!("entry {}", shortened(name, 80));
        InputError::at(file, &place, found.to_string(), expected)
    };
    if record.flags().is_encrypted() {
        return Err(refused(&"encrypted", "an entry without a password"));
    }
    let stated = record.uncompressed_size_hint();
    let needed = stated.saturating_mul(GROWTH);
    let label = format!("{file}#{}", plain(name));
    memory::check_fits(&label, needed, 0, stated)?;
    let packed = archive.get_entry(record.wayfinder());
    let packed = packed.map_err(|e| refused(&e, "an entry within the file"))?;
    let limit = usize::try_from(stated).unwrap_or(usize::MAX);
    let unpacked = match record.compression_method() {
        CompressionMethod::STORE => packed.data().to_vec(),
        CompressionMethod::DEFLATE => decompress_to_vec_with_limit(packed.data(), limit)
            .map_err(|e| refused(&e, &format!("{stated} bytes, deflated")))?,
        method => {
            let found = format!("packed by method {method}");
            return Err(refused(&found, "stored (0) or deflated (8)"));
        }
    };
    let claim = packed.claim_verifier();
    if unpacked.len() as u64 != stated {
        let found = format!("{} bytes", unpacked.len());
        return Err(refused(&found, &format!("{stated}, as the archive states")));
    }
    let found = crc32(&unpacked);
    if found != claim.crc {
        let expected = format!("{:08x}, as the archive states", claim.crc);
        return Err(refused(&format!("CRC-32 {found:08x}"), &expected));
    }
    Ok(unpacked)
}

/// Finds entries: the exact name, or else the last one that differs only by case.
pub fn finder<'e, 'r>(entries: &'e [Named<'r>]) -> impl Fn(&str) -> Option<&'e Named<'r>> {
    let keyed = |key: fn(&str) -> String| -> HashMap<String, &'e Named<'r>> {
        entries.iter().map(|entry| (key(&entry.0), entry)).collect()
    };
    let (exact, folded) = (keyed(str::to_owned), keyed(str::to_ascii_lowercase));
    move |name| {
        let folded = || folded.get(&name.to_ascii_lowercase());
        exact.get(name).or_else(folded).copied()
    }
}

/// An entry by its name.
type Named<'r> = (String, ZipFileHeaderRecord<'r>);
pub type Archive<'a> = ZipSliceArchive<&'a [u8]>;

pub fn open<'a>(bytes: &'a [u8], file: &str) -> Result<Archive<'a>> {
    ZipArchive::from_slice(bytes).map_err(|error| damaged(file, error))
}

fn damaged(file: &str, error: rawzip::Error) -> InputError {
    InputError::at(file, "directory", error, "a zip archive")
}

/// Names and records in the order of the directory, without folders.
///
/// The last of several entries with one name counts.
pub fn entries<'a>(archive: &'a Archive, file: &str) -> Result<Vec<Named<'a>>> {
    let (mut all, mut records) = (Vec::new(), archive.entries());
    while let Some(record) = records.next_entry().map_err(|error| damaged(file, error))? {
        let path = record.file_path();
        if !record.is_dir() {
            let name = String::from_utf8(path.as_ref().to_vec());
            let name = name.unwrap_or_else(|bytes| of_code_page(bytes.as_bytes()));
            // Zips of old .NET programs have backslashes.
            all.push((name.replace('\\', "/"), record));
        }
    }
    let mut seen = HashSet::new();
    all.reverse();
    all.retain(|(name, _)| seen.insert(name.clone()));
    all.reverse();
    Ok(all)
}

/// A name in code page 437, the encoding of zip entries that are not UTF-8.
fn of_code_page(name: &[u8]) -> String {
    const UPPER_HALF: &str = "ÇüéâäàåçêëèïîìÄÅÉæÆôöòûùÿÖÜ¢£¥₧ƒáíóúñÑªº¿⌐¬½¼¡«»░▒▓│┤╡╢╖╕╣║╗╝╜╛┐\
                              └┴┬├─┼╞╟╚╔╩╦╠═╬╧╨╤╥╙╘╒╓╫╪┘┌█▄▌▐▀αßΓπΣσµτΦΘΩδ∞φε∩≡±≥≤⌠⌡÷≈°∙·√ⁿ²■\u{a0}";
    let upper: Vec<char> = UPPER_HALF.chars().collect();
    let decoded = |byte: &u8| match byte.checked_sub(128) {
        Some(place) => upper[usize::from(place)],
        None => char::from(*byte),
    };
    name.iter().map(decoded).collect()
}

/// Tests the extension of a name.
///
/// macOS adds to each file of an archive a `._` file with its attributes; these do not count.
fn ends_in(name: &str, endings: &[&str]) -> bool {
    let name = name.to_ascii_lowercase();
    let is_aside = name.rsplit('/').next().unwrap_or("").starts_with("._");
    !is_aside && endings.iter().any(|ending| name.ends_with(ending))
}

/// The entry of a name, or the only scene.
///
/// Also the map in it, if one is named, as in `maps.wad#MAP07`.
///
/// # Errors
/// No such entry, or several.
pub fn chosen<'e, 'r, 'w>(
    entries: &'e [Named<'r>],
    named: impl Fn(&str) -> Option<&'e Named<'r>>,
    file: &str,
    wanted: Option<&'w str>,
) -> Result<(&'e str, &'e ZipFileHeaderRecord<'r>, Option<&'w str>)> {
    let whole = wanted.map(|wanted| (wanted, None));
    let text = wanted.unwrap_or_default();
    let signs = text.rmatch_indices('#');
    let parts = signs.map(|(at, _)| (&text[..at], Some(&text[at + 1..])));
    for (entry, map) in whole.into_iter().chain(parts) {
        if let Some((name, record)) = named(entry) {
            return Ok((name, record, map));
        }
    }
    let of = |endings: &[&str]| -> Vec<_> {
        let own = entries.iter().filter(|(name, _)| ends_in(name, endings));
        own.collect()
    };
    let (scenes, archives) = (of(&SCENES), of(&[".zip", ".pk3"]));
    let names: Vec<String> = scenes.iter().map(|(name, _)| shortened(name, 80)).collect();
    let listed = first_of(&names, MOST_NAMED);
    let all = counted(entries.len(), "entry");
    let sought = shortened(text, 80);
    let refused = |found, expected: &str| InputError::at(file, "directory", found, expected);
    Err(match (wanted, &scenes[..]) {
        (None, [(name, record)]) => return Ok((name, record, None)),
        (None, []) => {
            let expected = match archives.first() {
                Some((name, _)) => part_hint(file, &shortened(name, 80)),
                None => format!("a name that ends in {}", SCENES.join(", ")),
            };
            refused(format!("no scene among {all}"), &expected)
        }
        (None, [..]) => {
            let found = format!("{} scenes, {listed}", scenes.len());
            refused(found, &part_hint(file, &names[0]))
        }
        (Some(_), _) => {
            let found = format!("no '{sought}' among {all}; scenes: {listed}");
            refused(found, "the name of an entry")
        }
    })
}

#[cfg(test)]
pub mod tests {
    use super::super::{LoadOptions, part_names, read_bytes};
    use super::*;
    use miniz_oxide::deflate::compress_to_vec;

    const MAP12: &[u8] = include_bytes!("../../datasets/freedm_map12.wad");
    const BOX: &[u8] = b"min_x,min_y,min_z,max_x,max_y,max_z\n0,0,0,1,1,1\n";

    /// An archive: names, contents and methods of its entries.
    pub fn packed(entries: &[(&str, &[u8], u16)]) -> Vec<u8> {
        let (mut file, mut directory) = (Vec::new(), Vec::new());
        for &(name, bytes, method) in entries {
            let data = match method {
                8 => compress_to_vec(bytes, 6),
                _ => bytes.to_vec(),
            };
            let mut header = [20u16, 0, method, 0, 33].map(u16::to_le_bytes).concat();
            let sizes = [crc32(bytes), data.len() as u32, bytes.len() as u32];
            header.extend(sizes.map(u32::to_le_bytes).concat());
            header.extend((name.len() as u32).to_le_bytes());
            directory.extend(b"PK\x01\x02\x14\0");
            directory.extend(&header);
            directory.extend([0; 10]);
            directory.extend((file.len() as u32).to_le_bytes());
            directory.extend(name.as_bytes());
            file.extend([b"PK\x03\x04", &header[..], name.as_bytes(), &data].concat());
        }
        let count = (entries.len() as u16).to_le_bytes();
        let place = [directory.len() as u32, file.len() as u32];
        let place = place.map(u32::to_le_bytes).concat();
        let end = [b"PK\x05\x06\0\0\0\0", &count[..], &count, &place, &[0; 2]].concat();
        [file, directory, end].concat()
    }

    fn read(bytes: &[u8], part: Option<&str>) -> Result<usize, String> {
        let read = read_bytes(bytes, ["a.zip", "a"], part, &LoadOptions::default());
        read.map(|scene| scene.items.len())
            .map_err(|e| e.to_string())
    }

    #[track_caller]
    fn refused(bytes: &[u8], part: Option<&str>, wanted: &str) {
        let error = read(bytes, part).unwrap_err();
        assert!(
            error.contains(wanted) && error.contains("; expected "),
            "{error}"
        );
        assert!(
            error.starts_with("a.zip") && !error.contains('\n'),
            "{error}"
        );
    }

    #[test]
    fn scenes_are_read_by_name_or_as_the_only_one() {
        let one = packed(&[("readme.txt", b"words", 0), ("in/one.csv", BOX, 8)]);
        for part in [None, Some("in/one.csv"), Some("IN/One.csv")] {
            assert_eq!(read(&one, part), Ok(1));
        }
        let in_front = [b"#!/bin/sh\n", &one[..]].concat();
        assert_eq!(read(&in_front, None), Ok(1));
        assert_eq!(part_names(&in_front, "a.pk3").unwrap(), ["in/one.csv"]);
        let of_net = packed(&[("in\\one.csv", BOX, 8)]);
        assert_eq!(read(&of_net, Some("in/one.csv")), Ok(1));
        let mut old = packed(&[("in<.csv", BOX, 0), ("in>.csv", BOX, 0)]);
        for byte in &mut old {
            *byte = match *byte {
                b'<' => 0x81,
                b'>' => 0x84,
                other => other,
            };
        }
        assert_eq!(part_names(&old, "a.zip").unwrap(), ["inü.csv", "inä.csv"]);
        let wad = packed(&[("maps/d.wad", MAP12, 8), ("two.csv", BOX, 0)]);
        let alone = read(MAP12, None);
        for part in ["maps/d.wad", "maps/d.wad#map12"] {
            assert_eq!(read(&wad, Some(part)), alone);
        }
        assert_eq!(read(&wad, Some("two.csv")), Ok(1));
        assert_eq!(
            part_names(&wad, "a.zip").unwrap(),
            ["maps/d.wad", "two.csv"]
        );
        refused(
            &wad,
            None,
            "2 scenes, maps/d.wad, two.csv; expected one of them by name, as in 'a.zip#maps/d.wad'",
        );
        refused(
            &wad,
            Some("q.bsp"),
            "no 'q.bsp' among 2 entries; scenes: maps/d.wad, two.csv; expected",
        );
        refused(&wad, Some("maps/d.wad#E1M1"), "no map 'E1M1' among MAP12");
        refused(
            &packed(&[("readme.txt", b"", 0)]),
            None,
            "no scene among 1 entry",
        );
        refused(&packed(&[]), None, "no scene among no entries");
        // The exact name first, and the last of several entries with one name.
        let two = [BOX, b"1,1,1,2,2,2\n"].concat();
        let cases = packed(&[("A.csv", BOX, 0), ("a.csv", &two, 0), ("b.csv", &two, 0)]);
        let counts = ["A.csv", "a.csv", "B.csv"].map(|part| read(&cases, Some(part)));
        assert_eq!(counts, [Ok(1), Ok(2), Ok(2)]);
        let again = packed(&[("a.csv", BOX, 0), ("A.csv", BOX, 0), ("a.csv", &two, 0)]);
        assert_eq!(part_names(&again, "a.zip").unwrap(), ["A.csv", "a.csv"]);
        let mac = packed(&[
            ("a.csv", &two, 0),
            ("__MACOSX/._a.csv", b"\0", 0),
            ("a.csv", BOX, 8),
        ]);
        assert_eq!(read(&mac, None), Ok(1));
        // Nested archives.
        let outer = packed(&[("inner.pk3", &one, 8)]);
        let outermost = packed(&[("o.zip", &outer, 0), ("w.zip", &wad, 0)]);
        for part in ["inner.pk3", "inner.pk3#in/one.csv"] {
            assert_eq!(read(&outer, Some(part)), Ok(1));
        }
        assert_eq!(read(&outermost, Some("o.zip#inner.pk3#in/one.csv")), Ok(1));
        assert_eq!(read(&outermost, Some("w.zip#maps/d.wad#map12")), alone);
        // Not opened without their name: an archive may contain itself.
        refused(
            &outermost,
            None,
            "no scene among 2 entries; expected one of them by name, as in 'a.zip#o.zip'",
        );
    }

    #[test]
    fn the_buffers_of_a_gltf_are_entries_beside_it() {
        let text = r#"{"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
            "bufferViews": [{"buffer": 0, "byteLength": 36}],
            "buffers": [{"byteLength": 36, "uri": "URI"}]}"#;
        let with = |uri: &str, name: &str| {
            let text = text.replace("URI", uri);
            packed(&[("in/s.gltf", text.as_bytes(), 8), (name, &[0; 36], 8)])
        };
        for (uri, name) in [
            ("./%C3%BC%20%281%29.bin", "in/\u{fc} (1).bin"),
            ("100%/%+f%", "in/100%/%+f%"),
            ("../sub/./x.bin", "sub/x.bin"),
        ] {
            assert_eq!(read(&with(uri, name), None), Ok(1), "{uri}");
        }
        refused(
            &with("b.bin", "b.bin"),
            None,
            "in/s.gltf, buffers: no 'in/b.bin' beside it",
        );
        // No map in the entry before the sign.
        refused(&with("b%231.bin", "in/b"), None, "no 'in/b#1.bin'");
    }

    #[test]
    fn damage_is_found_and_sizes_are_not_believed() {
        let good = packed(&[("one.csv", BOX, 8)]);
        let entry = good.windows(4).position(|w| w == b"PK\x01\x02").unwrap();
        let with = |at: usize, bytes: &[u8]| {
            let mut copy = good.clone();
            copy[entry + at..][..bytes.len()].copy_from_slice(bytes);
            copy
        };
        refused(&with(8, &[1]), None, "entry one.csv: encrypted");
        refused(&with(10, &[14]), None, "packed by method 14 (LZMA)");
        refused(&with(16, &[0; 4]), None, "CRC-32");
        refused(
            &with(24, &[9, 0, 0, 0]),
            None,
            "limit; expected 9 bytes, deflated",
        );
        refused(&with(24, &[99, 0, 0, 0]), None, "48 bytes; expected 99, as");
        refused(
            &with(20, &[3, 0, 0, 0]),
            None,
            "expected 48 bytes, deflated",
        );
        refused(
            &with(42, &[7, 0, 0, 0]),
            None,
            "expected an entry within the file",
        );
        refused(&with(0, b"XK"), None, "directory");
        refused(&good[..good.len() - 9], None, "directory");
        // A name with terminal escape sequences.
        let odd = packed(&[("\x1b[31m\n.csv", b"", 0)]);
        let error = read(&odd, None).unwrap_err();
        assert!(!error.contains(char::is_control), "{error:?}");
        for at in 0..good.len() {
            for value in [0, 1, 0x7F, 0xFF] {
                let mut copy = good.clone();
                copy[at] = value;
                let _ = read(&copy, None);
                let _ = read(&copy[..at], None);
            }
        }
    }

    #[test]
    fn what_memory_does_not_hold_is_not_unpacked() {
        let mut zip64 = packed(&[("one.csv", BOX, 8)]);
        let entry = zip64.windows(4).position(|w| w == b"PK\x01\x02").unwrap();
        zip64[entry + 24..][..4].copy_from_slice(&0xFFFF_FFF0u32.to_le_bytes());
        let error = read(&zip64, None).unwrap_err();
        let is_said = error.contains("needs about 12.9 GB") || error.contains("48 bytes;");
        assert!(is_said, "{error}");
    }
}
