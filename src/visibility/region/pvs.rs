//! Pairs of regions that may see each other: one set per region, as a file claims.

use serde::Deserialize;

use super::id_set::{IdSet, RegionId};
use crate::json::{JsonError, from_json};

/// A potentially visible set: for each region the set of regions seen from it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Pvs {
    rows: Vec<IdSet>,
}

/// Why bytes are no potentially visible set.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PvsError {
    /// JSON of another form.
    #[error("{}: {}; expected {}", .0.place(), .0.found, .0.expected_of(FORM))]
    Json(JsonError),
    /// A region that is not there.
    #[error("pair {pair}: region {region} is out of range; expected less than {regions}")]
    Region {
        /// Index of the pair.
        pair: usize,
        /// The number.
        region: RegionId,
        /// Number of regions.
        regions: usize,
    },
    /// More regions than pairs of them can be held.
    #[error("{0} regions; expected at most 65536")]
    TooMany(usize),
    /// A REJECT table that ends early.
    #[error("{found} bytes for {regions} sectors; expected at least {expected}")]
    Short {
        /// Bytes there are.
        found: usize,
        /// Bytes it takes.
        expected: usize,
        /// Number of sectors.
        regions: usize,
    },
}

// The message of the error has its words already: it is no source.
impl From<JsonError> for PvsError {
    fn from(error: JsonError) -> Self {
        PvsError::Json(error)
    }
}

const FORM: &str = "{\"regions\": COUNT, \"sees\": [[FROM, TO], ...]}";

/// Its form in a file: ordered pairs.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    regions: usize,
    sees: Vec<[RegionId; 2]>,
}

/// Most regions of a set: half a gigabyte of bits.
const MOST_REGIONS: usize = 1 << 16;

impl Pvs {
    /// Each region sees itself alone. O(n^2) bits.
    pub fn alone(regions: usize) -> Pvs {
        let row = |region| {
            let mut row = IdSet::default();
            row.clear(regions);
            row.insert(region);
            row
        };
        Pvs {
            rows: (0..regions as u32).map(row).collect(),
        }
    }

    /// Reads `{"regions": COUNT, "sees": [[FROM, TO], ...]}`; each region sees
    /// itself, whether that is written or not.
    ///
    /// # Errors
    /// Other JSON, or a region that is not there.
    pub fn from_json(text: impl AsRef<[u8]>) -> Result<Pvs, PvsError> {
        let written: Written = from_json(text.as_ref())?;
        let regions = written.regions;
        if regions > MOST_REGIONS {
            return Err(PvsError::TooMany(regions));
        }
        let mut pvs = Pvs::alone(regions);
        for (pair, [from, to]) in written.sees.into_iter().enumerate() {
            let region = from.max(to);
            if region as usize >= regions {
                return Err(PvsError::Region {
                    pair,
                    region,
                    regions,
                });
            }
            pvs.insert(from, to);
        }
        Ok(pvs)
    }

    /// The REJECT table of a Doom map: bit `from * sectors + to`, lowest bit of a
    /// byte first, is 1 where a monster in sector `from` cannot see sector `to`.
    ///
    /// # Errors
    /// Fewer bits than pairs of sectors.
    pub fn from_reject(bytes: &[u8], sectors: usize) -> Result<Pvs, PvsError> {
        if sectors > MOST_REGIONS {
            return Err(PvsError::TooMany(sectors));
        }
        let expected = (sectors * sectors).div_ceil(8);
        if bytes.len() < expected {
            return Err(PvsError::Short {
                found: bytes.len(),
                expected,
                regions: sectors,
            });
        }
        Pvs::of_pairs(sectors, |from, to| {
            let bit = from as usize * sectors + to as usize;
            bytes[bit / 8] >> (bit % 8) & 1 == 0
        })
    }

    /// All pairs of regions that a table has; each region sees itself.
    ///
    /// # Errors
    /// Too many regions.
    pub fn of_pairs(regions: usize, sees: impl Fn(u32, u32) -> bool) -> Result<Pvs, PvsError> {
        if regions > MOST_REGIONS {
            return Err(PvsError::TooMany(regions));
        }
        let mut pvs = Pvs::alone(regions);
        let all = 0..regions as u32;
        for from in all.clone() {
            let seen = all.clone().filter(|&to| sees(from, to));
            seen.for_each(|to| pvs.insert(from, to));
        }
        Ok(pvs)
    }

    /// Number of regions.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Tests whether there are no regions.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The regions that a region sees.
    pub fn row(&self, from: RegionId) -> &IdSet {
        &self.rows[from as usize]
    }

    /// Adds a pair, in this direction only.
    pub fn insert(&mut self, from: RegionId, to: RegionId) {
        self.rows[from as usize].insert(to);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_read_and_each_region_sees_itself() {
        let pvs = Pvs::from_json(r#"{"regions":70,"sees":[[3,69],[69,4]]}"#).unwrap();
        let mut wanted = Pvs::alone(70);
        wanted.insert(3, 69);
        wanted.insert(69, 4);
        assert_eq!(pvs, wanted);
        assert!(pvs.row(3).holds(69) && !pvs.row(69).holds(3));
        let mut row = Vec::new();
        pvs.row(69).list(&mut row);
        assert_eq!(row, [4, 69]);
    }

    #[test]
    fn other_files_are_typed_errors() {
        let error = |text: &str| Pvs::from_json(text).unwrap_err().to_string();
        assert!(error("[]").contains("expected {\"regions\""));
        assert!(
            error(r#"{"regions":2,"sees":[[0,2]]}"#)
                .contains("pair 0: region 2 is out of range; expected less than 2")
        );
        assert!(error(r#"{"regions":1,"sees":[],"more":1}"#).contains("more"));
        assert!(error(r#"{"regions":99999,"sees":[]}"#).contains("at most 65536"));
    }

    #[test]
    fn a_reject_bit_hides_and_bits_run_on_over_rows() {
        // Bit 1 (0 to 1) and bit 8 (2 to 2, which sees itself all the same).
        let pvs = Pvs::from_reject(&[0b10, 0b1], 3).unwrap();
        assert!(!pvs.row(0).holds(1) && pvs.row(1).holds(0) && pvs.row(2).holds(2));
        let rows = [0, 1, 2].map(|from| [0, 1, 2].map(|to| pvs.row(from).holds(to)));
        assert_eq!(rows, [[true, false, true], [true; 3], [true; 3]]);
        let error = Pvs::from_reject(&[0], 3).unwrap_err().to_string();
        assert!(error.contains("1 bytes for 3 sectors"), "{error}");
    }
}
