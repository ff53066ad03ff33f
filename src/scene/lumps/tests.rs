//! Files with an intact map, with maps in other formats, and damaged ones.

use super::super::WadMap;
use super::*;

const MAP12: &[u8] = include_bytes!("../../../datasets/freedm_map12.wad");

type Lumps = Vec<(String, Vec<u8>)>;

/// The lumps of the sample: a marker and those of its map.
fn map12() -> Lumps {
    let wad = Wad::open(MAP12, "in.wad").unwrap();
    let data = |l: &Lump| Table::of_entry("in.wad", "", MAP12, l.entry).unwrap().data;
    let lump = |l: &Lump| (l.name.clone(), data(l).to_vec());
    wad.lumps.iter().map(lump).collect()
}

fn place(lumps: &Lumps, name: &str) -> usize {
    lumps.iter().position(|lump| lump.0 == name).unwrap()
}

/// The lump of a name in a copy.
fn with(name: &str, change: impl Fn(&mut Vec<u8>)) -> Lumps {
    let mut lumps = map12();
    let at = place(&lumps, name);
    change(&mut lumps[at].1);
    lumps
}

/// A file of the lumps; the directory entry of lump i begins at 12 + 16 i.
fn file(lumps: &Lumps) -> Vec<u8> {
    let (mut directory, mut data) = (Vec::new(), Vec::new());
    for (name, bytes) in lumps {
        let at = 12 + 16 * lumps.len() + data.len();
        directory.extend((at as u32).to_le_bytes());
        directory.extend((bytes.len() as u32).to_le_bytes());
        let name = name.bytes().chain([0; 8]).take(8);
        directory.extend(name);
        data.extend(bytes);
    }
    let count = (lumps.len() as u32).to_le_bytes();
    [
        &b"PWAD"[..],
        &count,
        &12u32.to_le_bytes(),
        &directory,
        &data,
    ]
    .concat()
}

fn read(bytes: &[u8], map: Option<&str>) -> Result<String, String> {
    let map = WadMap::read(bytes, "in.wad", map);
    map.map(|map| format!("{map:?}")).map_err(|e| e.to_string())
}

#[track_caller]
fn refused(lumps: &Lumps, map: Option<&str>, wanted: &str) {
    let error = read(&file(lumps), map).unwrap_err();
    assert!(error.contains(wanted), "{error}");
    assert!(
        error.contains("; expected ") && !error.contains('\n'),
        "{error}"
    );
}

#[test]
fn foreign_lumps_among_those_of_a_map_change_nothing() {
    let (lumps, own) = (map12(), read(MAP12, None));
    assert!(own.is_ok());
    for at in 1..=lumps.len() {
        for (name, bytes) in [("MUSINFO", &b"x"[..]), ("MAP13", b""), ("GL_VERT", b"XGLN")] {
            let mut lumps = lumps.clone();
            lumps.insert(at, (name.to_owned(), bytes.to_vec()));
            assert_eq!(read(&file(&lumps), None), own, "{name} at {at}");
        }
    }
}

#[test]
fn what_a_map_lacks_is_not_taken_from_the_next() {
    let whole = map12();
    for at in 2..whole.len() {
        let mut lumps = whole.clone();
        let (name, _) = lumps.remove(at);
        // The next map intact, without THINGS, and starting with the same lump.
        for first in [0, 1, at - 1] {
            let mut both = lumps.clone();
            both.push(("MAP13".to_owned(), Vec::new()));
            both.extend_from_slice(&whole[first + 1..]);
            match &name[..] {
                "SEGS" | "SSECTORS" | "NODES" => {
                    let found = format!("MAP12 whose nodes are not built (no {name})");
                    refused(&both, Some("MAP12"), &found);
                }
                "REJECT" | "BLOCKMAP" => {
                    let map = WadMap::read(&file(&both), "in.wad", Some("map12")).unwrap();
                    assert_eq!(map.reject.is_empty(), name == "REJECT", "{first}");
                }
                _ => refused(&both, Some("MAP12"), &format!("MAP12 without {name};")),
            }
        }
    }
}

#[test]
fn other_formats_are_named() {
    for (magic, kind) in NODE_KINDS {
        for name in ["SSECTORS", "NODES"] {
            let lumps = with(name, |bytes| *bytes = format!("{magic}\0\0\0").into());
            let found = format!("map MAP12 with {kind} nodes ({magic} in {name});");
            refused(&lumps, None, &found);
        }
    }
    let mut lumps = map12();
    for name in BUILT {
        let at = place(&lumps, name);
        lumps[at].1.clear();
    }
    refused(&lumps, None, "MAP12 whose nodes are not built (no SEGS);");
    lumps.push(("GL_MAP12".to_owned(), Vec::new()));
    refused(&lumps, None, "MAP12 with GL nodes alone (no SEGS);");
    let lumps = with("NODES", Vec::clear);
    refused(&lumps, None, "whose nodes are not built (no NODES);");
    let mut lumps = map12();
    lumps.push(("BEHAVIOR".to_owned(), Vec::new()));
    refused(&lumps, None, "MAP12 in the format of Hexen (BEHAVIOR);");
    let udmf = ["MAP01", "TEXTMAP", "ZNODES", "ENDMAP"];
    let udmf = udmf.map(|name| (name.to_owned(), Vec::new())).to_vec();
    refused(&udmf, None, "MAP01 in the format of UDMF (TEXTMAP);");
    // Together with another map each keeps its name.
    let both = [udmf, map12()].concat();
    refused(&both, None, "2 maps, MAP01, MAP12;");
    refused(&both, Some("MAP01"), "UDMF");
    assert_eq!(read(&file(&both), Some("MAP12")), read(MAP12, None));
}

#[test]
fn what_engines_pass_over_is_passed_over() {
    let own = read(MAP12, None);
    // Of two maps of one name the last is taken.
    let first = with("THINGS", Vec::clear);
    let both = [first.clone(), map12()].concat();
    assert_eq!(read(&file(&both), None), own);
    assert_eq!(read(&file(&both), Some("MAP12")), own);
    let both = [map12(), first].concat();
    assert_ne!(read(&file(&both), Some("MAP12")), own);
    // A marker with contents; a name with junk after its end.
    let mut lumps = with("MAP12", |bytes| bytes.extend(b"junk"));
    lumps.push(("SPRITE".to_owned(), b"abc".to_vec()));
    let mut bytes = file(&lumps);
    let entry = |at: usize| 12 + 16 * at;
    bytes[entry(0) + 14..][..2].copy_from_slice(b"\xFFx");
    assert_eq!(read(&bytes, Some("MAP12")), own);
    // The position of an empty lump, and damage in lumps that are not read.
    lumps[0].1.clear();
    let (marker, other) = (entry(0), entry(lumps.len() - 1));
    for offset in [-1, i32::MIN, i32::MAX, 7] {
        let mut bytes = file(&lumps);
        bytes[marker..marker + 4].copy_from_slice(&offset.to_le_bytes());
        bytes[other..other + 4].copy_from_slice(&offset.to_le_bytes());
        assert_eq!(read(&bytes, None), own, "{offset}");
        let reject = entry(place(&lumps, "REJECT"));
        bytes[reject..reject + 4].copy_from_slice(&(offset | i32::MIN).to_le_bytes());
        let error = read(&bytes, None).unwrap_err();
        assert!(error.contains("lump REJECT at -"), "{error}");
    }
    // A marker that lost its map.
    let mut lumps = map12();
    lumps.insert(1, ("MUSINFO".to_owned(), Vec::new()));
    refused(
        &lumps,
        Some("MAP12"),
        "THINGS does not follow the lump of that name",
    );
}

#[test]
fn every_index_is_checked() {
    let fields = [
        ("LINEDEFS", 14, 0, "VERTEXES 65534 in LINEDEFS 3"),
        ("LINEDEFS", 14, 2, "VERTEXES 65534 in LINEDEFS 3"),
        ("LINEDEFS", 14, 10, "SIDEDEFS 65534 in LINEDEFS 3"),
        ("LINEDEFS", 14, 12, "SIDEDEFS 65534 in LINEDEFS 3"),
        ("SIDEDEFS", 30, 28, "SECTORS 65534 in SIDEDEFS 3"),
        ("SEGS", 12, 0, "VERTEXES 65534 in SEGS 3"),
        ("SEGS", 12, 2, "VERTEXES 65534 in SEGS 3"),
        ("SEGS", 12, 6, "LINEDEFS 65534 in SEGS 3"),
        ("SSECTORS", 4, 0, "a subsector of 65534 segs"),
        ("SSECTORS", 4, 2, "SEGS 65534 in SSECTORS 3"),
        ("NODES", 28, 24, "Leaf(32766) does not exist"),
        ("NODES", 28, 26, "Leaf(32766) does not exist"),
    ];
    for (name, record, at, wanted) in fields {
        let at = 3 * record + at;
        let lumps = with(name, |bytes| {
            bytes[at..at + 2].copy_from_slice(&[0xFE, 0xFF])
        });
        refused(&lumps, None, wanted);
    }
    let lumps = with("SSECTORS", |bytes| bytes[12..14].fill(0));
    refused(&lumps, None, "a subsector of 0 segs");
}
