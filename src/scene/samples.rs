//! Real scenes by name.
//!
//! Samples are compiled in, so that the main job needs no file; others are files that
//! `scripts/fetch.py` fetches. Provenance is in `datasets/README.md`.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use serde::Deserialize;

use crate::shown::hex;

/// A real scene that is part of the program.
pub struct Sample {
    /// Name as typed.
    pub name: &'static str,
    /// One line for `cullbench list`.
    pub summary: &'static str,
    /// SPDX identifier and attribution; the texts are in [`NOTICE`].
    pub licence: &'static str,
    /// Unit of coordinates.
    pub unit: &'static str,
    /// The file under `datasets/`.
    pub file: &'static str,
    /// Contents of the file.
    pub bytes: &'static [u8],
}

/// Authors and licences of the samples.
///
/// A program that contains the samples must be able to show it (`cullbench licences`).
pub const NOTICE: &str = concat!(
    include_str!("../../datasets/NOTICE.txt"),
    include_str!("../../datasets/freedm_LICENSE.txt")
);

/// All samples, in the order of the quick suite.
pub static SAMPLES: &[Sample] = rows! { Sample { name, licence, unit, summary, file, bytes }
    "freedm-map12", "BSD-3-Clause", "map units",
        "small Doom deathmatch map: linedefs and things, 87 BSP leaves as regions",
        "freedm_map12.wad", include_bytes!("../../datasets/freedm_map12.wad");
    "freedm-map20", "BSD-3-Clause", "map units",
        "large Doom deathmatch map, 825 BSP leaves as regions",
        "freedm_map20.wad", include_bytes!("../../datasets/freedm_map20.wad");
    "helsinki", "ODbL-1.0, (c) OpenStreetMap contributors", "m",
        "11,065 objects of central Helsinki in metres",
        "helsinki_boxes.csv", include_bytes!("../../datasets/helsinki_boxes.csv");
    "us-counties", "ISC", "degrees",
        "3,510 flat county boxes in degrees, sizes 1 : 10,000, six of 0",
        "us_counties_boxes.csv", include_bytes!("../../datasets/us_counties_boxes.csv");
};

impl Sample {
    /// The sample of exactly this name.
    pub fn named(name: &str) -> Option<&'static Sample> {
        SAMPLES.iter().find(|s| s.name == name)
    }
}

/// Folder of the fetched files, relative to the working directory.
pub const FETCHED_FOLDER: &str = "datasets/fetched";

/// A file with real scenes that is fetched and not compiled in.
#[derive(Deserialize)]
pub struct Fetched {
    /// Name for `scripts/fetch.py`.
    pub name: String,
    /// File in the folder of fetched files.
    file: String,
    /// SHA-256 of that file.
    file_sha256: String,
    /// SPDX identifier and attribution.
    pub licence: String,
    /// Scenes in the file for the suite `real`; may be empty.
    ///
    /// `.` is the file itself, `#MAP01` a map in it.
    scenes: String,
    /// One line for `cullbench list`.
    pub summary: String,
}

/// All fetched files, in the order of the table.
pub static FETCHED: LazyLock<Vec<Fetched>> = LazyLock::new(|| {
    let mut table = csv::Reader::from_reader(&include_bytes!("../../datasets/fetch.csv")[..]);
    // A test checks that the table can be read.
    table.deserialize().flatten().collect()
});

impl Fetched {
    /// Path from the working directory.
    pub fn path(&self) -> PathBuf {
        Path::new(FETCHED_FOLDER).join(&self.file)
    }

    /// Tests whether the file is present and is the published one or derived from it.
    pub fn is_there(&self) -> bool {
        let is_it = |bytes: Vec<u8>| hex(&hmac_sha256::Hash::hash(&bytes)) == self.file_sha256;
        fs::read(self.path()).is_ok_and(is_it)
    }

    /// Scenes for the suite `real`, as typed.
    pub fn scenes(&self) -> Vec<String> {
        let maps = self.scenes.split_whitespace();
        maps.map(|map| format!("{FETCHED_FOLDER}/{}{}", self.file, map.trim_matches('.')))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_byte_for_byte_the_documented_ones() {
        let readme = include_str!("../../datasets/README.md");
        for sample in SAMPLES {
            let digest = hex(&hmac_sha256::Hash::hash(sample.bytes));
            assert!(readme.contains(&digest), "{}: {digest}", sample.file);
            assert!(readme.contains(sample.file));
        }
    }

    #[test]
    fn the_notice_has_every_sample_with_its_file_and_licence() {
        for sample in SAMPLES {
            let (licence, owner) = sample
                .licence
                .split_once(", ")
                .unwrap_or((sample.licence, ""));
            let mut entries = NOTICE
                .split("\n\n")
                .filter(|entry| entry.contains(sample.name));
            let entry = entries.next().expect(sample.name);
            for part in [sample.file, licence, owner] {
                assert!(entry.contains(part), "{}: {part}", sample.name);
            }
        }
    }

    #[test]
    fn every_sample_loads_with_its_published_size() {
        let sizes: Vec<_> = SAMPLES
            .iter()
            .map(|s| s.load().unwrap().items.len())
            .collect();
        assert_eq!(sizes[2..], [11_065, 3_510]);
    }

    #[test]
    fn every_row_of_the_table_is_one() {
        let lines = include_str!("../../datasets/fetch.csv").lines().count();
        assert_eq!(FETCHED.len(), lines - 1);
        for row in &*FETCHED {
            assert!(
                !row.licence.is_empty() && !row.summary.is_empty(),
                "{}",
                row.name
            );
        }
        let freedm = FETCHED[0].scenes();
        assert_eq!(freedm[0], "datasets/fetched/freedm.wad#MAP01");
    }
}
