//! Real scenes that `scripts/fetch.py` fetches: the table that it reads.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use serde::Deserialize;

/// Folder of the fetched files, from the working directory.
const FOLDER: &str = "datasets/fetched";

/// A file with real scenes that is fetched and not part of the program.
#[derive(Deserialize)]
#[non_exhaustive]
pub struct Fetched {
    /// Name for `scripts/fetch.py`.
    pub name: String,
    /// File in the folder of fetched files.
    file: String,
    /// SPDX identifier, and whom to name.
    pub licence: String,
    /// Scenes in the file for the suite `real`; perhaps none.
    ///
    /// `.` is the file itself, `#MAP01` a map in it.
    scenes: String,
    /// One line for `cullbench list`.
    pub summary: String,
}

/// All of them, in the order of the table.
pub static FETCHED: LazyLock<Vec<Fetched>> = LazyLock::new(|| {
    let mut table = csv::Reader::from_reader(&include_bytes!("../../datasets/fetch.csv")[..]);
    // A test reads the table.
    table.deserialize().flatten().collect()
});

impl Fetched {
    /// File from the working directory.
    pub fn path(&self) -> PathBuf {
        Path::new(FOLDER).join(&self.file)
    }

    /// Tests whether the file has been fetched.
    pub fn is_there(&self) -> bool {
        self.path().is_file()
    }

    /// Scenes for the suite `real`, as typed.
    pub fn scenes(&self) -> Vec<String> {
        let maps = self.scenes.split_whitespace();
        maps.map(|map| format!("{FOLDER}/{}{}", self.file, map.trim_matches('.')))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
