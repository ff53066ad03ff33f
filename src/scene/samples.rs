//! The real scenes that come with the program, by name. They are compiled in,
//! so that the main job needs no file; their provenance is in
//! `datasets/README.md`.

/// A real scene that is part of the program.
#[non_exhaustive]
pub struct Sample {
    /// Name as typed.
    pub name: &'static str,
    /// One line for `cullbench list`.
    pub summary: &'static str,
    /// SPDX identifier, and whom to name; the texts are in [`NOTICE`].
    pub licence: &'static str,
    /// Unit of coordinates.
    pub unit: &'static str,
    /// The file under `datasets/`.
    pub file: &'static str,
    /// Contents of the file.
    pub bytes: &'static [u8],
}

/// Whose works the samples are and under which terms: a program that contains
/// them has to be able to show it (`cullbench licences`).
pub const NOTICE: &str = concat!(
    include_str!("../../datasets/NOTICE.txt"),
    include_str!("../../datasets/freedm_LICENSE.txt")
);

macro_rules! samples {
    ($($name:literal $file:literal $unit:literal $licence:literal, $summary:literal;)+) => {
        rows! { Sample { name, file, unit, licence, summary, bytes }
            $($name, $file, $unit, $licence, $summary, include_bytes!(concat!("../../datasets/", $file));)+
        }
    };
}

/// All of them, in the order of the quick suite.
pub static SAMPLES: &[Sample] = samples! {
    "freedm-map12" "freedm_map12.wad" "map units" "BSD-3-Clause",
        "small Doom deathmatch map: linedefs and things, 87 BSP leaves as regions";
    "freedm-map20" "freedm_map20.wad" "map units" "BSD-3-Clause",
        "large Doom deathmatch map, 825 BSP leaves as regions";
    "helsinki" "helsinki_boxes.csv" "m" "ODbL-1.0, (c) OpenStreetMap contributors",
        "11,065 objects of central Helsinki in metres";
    "us-counties" "us_counties_boxes.csv" "degrees" "ISC",
        "3,510 flat county boxes in degrees, sizes 1 : 10,000";
};

impl Sample {
    /// The sample of exactly this name.
    pub fn named(name: &str) -> Option<&'static Sample> {
        SAMPLES.iter().find(|s| s.name == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_byte_for_byte_the_documented_ones() {
        let readme = include_str!("../../datasets/README.md");
        for sample in SAMPLES {
            let digest = super::super::hex(&hmac_sha256::Hash::hash(sample.bytes));
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
}
