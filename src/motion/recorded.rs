//! Recorded motions: CSV rows of a time, an item and its new bounds.

use std::collections::BTreeMap;
use std::mem;

use glam::{DVec3, Vec3};

use super::laws::REMOVED;
use crate::geometry::Aabb;
use crate::input::{InputError, Row, TableReader};
use crate::query::ItemId;
use crate::scene::{Scene, WorldBox};

const COLUMNS: [&str; 8] = [
    "time_s", "id", "min_x", "min_y", "min_z", "max_x", "max_y", "max_z",
];

/// Bounds of a row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub(super) stored: Aabb,
    /// The box as written; NaN if the stored box equals it.
    pub(super) written: WorldBox,
}

/// Consecutive frames.
#[derive(Default, Debug)]
pub(super) struct Recorded {
    ids: Vec<ItemId>,
    rows: Vec<Bounds>,
    /// Number of rows up to the end of each frame.
    ends: Vec<usize>,
    /// Time of each frame, s.
    times: Vec<f64>,
    /// Reach of the whole file that these frames are a part of.
    reach: Vec3,
}

impl Recorded {
    pub(super) fn frames(&self) -> usize {
        self.ends.len()
    }

    /// Number of rows of all frames.
    pub(super) fn moves(&self) -> usize {
        self.ids.len()
    }

    /// Ids, ascending, and their bounds.
    pub(super) fn frame(&self, n: usize) -> (&[ItemId], &[Bounds]) {
        let first = n.checked_sub(1).map_or(0, |before| self.ends[before]);
        let rows = first..self.ends[n];
        (&self.ids[rows.clone()], &self.rows[rows])
    }

    /// Number of rows before a time.
    pub(super) fn moves_before(&self, time: f64) -> usize {
        let frames = self.times.partition_point(|own| *own < time);
        self.ends[..frames].last().copied().unwrap_or_default()
    }

    /// A frame for each time, with all rows since the previous one.
    ///
    /// The last row of an item counts. Returns the number of unused rows, too.
    pub(super) fn at<'t>(&self, times: impl Iterator<Item = &'t f64>) -> (Recorded, usize) {
        let (mut paced, mut next) = (Recorded::default(), 0);
        // The margin of a frame depends on the whole file.
        paced.reach = self.reach();
        for time in times {
            let first = next;
            next += self.times[first..].partition_point(|own| own <= time);
            let frames = (first..next).map(|n| self.frame(n));
            let rows = frames.flat_map(|(ids, rows)| ids.iter().zip(rows));
            let rows: BTreeMap<ItemId, Bounds> = rows.map(|(id, b)| (*id, *b)).collect();
            paced.end_frame(&rows);
            paced.times.push(*time);
        }
        let used = self.ends[..next].last().copied().unwrap_or_default();
        (paced, self.moves() - used)
    }

    pub(super) fn reach(&self) -> Vec3 {
        self.own_reach().max(self.reach)
    }

    fn own_reach(&self) -> Vec3 {
        let reaches = self.rows.iter().map(|row| row.stored.reach());
        reaches.fold(Vec3::ZERO, Vec3::max)
    }

    /// Returns whether rows of the file that are in no frame widen the margin.
    pub(super) fn is_widened(&self) -> bool {
        !self.reach.cmple(self.own_reach()).all()
    }

    pub(super) fn digest(&self, hash: &mut hmac_sha256::Hash) {
        if self.is_widened() {
            let reach = self.reach.to_array();
            hash.update(reach.map(f32::to_le_bytes).concat());
        }
        for end in &self.ends {
            hash.update((*end as u64).to_le_bytes());
        }
        for (id, row) in self.ids.iter().zip(&self.rows) {
            hash.update(id.to_le_bytes());
            for v in row.stored.bits().as_flattened() {
                hash.update(v.to_le_bytes());
            }
            // The digest of a file that f32 represents exactly is that of its stored boxes.
            let WorldBox { min, max } = row.written;
            let own = [min, max].into_iter().filter(|corner| !corner.is_nan());
            for v in own.flat_map(|corner| corner.to_array()) {
                hash.update(v.to_le_bytes());
            }
        }
    }

    /// Ends a frame; `moved` are its moves.
    fn end_frame(&mut self, moved: &BTreeMap<ItemId, Bounds>) {
        self.ids.extend(moved.keys());
        self.rows.extend(moved.values());
        self.ends.push(self.ids.len());
    }
}

/// Reads a motion CSV: `time_s,id,min_x,..,max_z`.
///
/// Rows with the same time are a frame; a row without bounds removes the item. Numbers are f64 and
/// are rounded outward to f32 relative to the scene's origin.
///
/// # Errors
/// The line of the first value that is not a number, box or item of the scene; a time before the
/// last one; an item twice at one time; a file without rows.
pub(super) fn read_motion_csv(
    bytes: &[u8],
    file: &str,
    scene: &Scene,
) -> Result<Recorded, InputError> {
    let mut table = TableReader::open(bytes, file, &COLUMNS)?;
    let [time_at, id_at, bounds_at @ ..] = table.columns(&COLUMNS)?;
    table.note_unread(&COLUMNS, &[]);
    let (mut recorded, mut moved) = (Recorded::default(), BTreeMap::new());
    while let Some(row) = table.next_row() {
        let row = row?;
        let last = recorded.times.last().copied();
        let time = row.time(time_at, last.unwrap_or(f64::NEG_INFINITY))?;
        if last.is_some_and(|last| time > last) {
            recorded.end_frame(&mem::take(&mut moved));
        }
        if last != Some(time) {
            recorded.times.push(time);
        }
        let id = item(&row, id_at, scene)?;
        let known = moved.insert(id, bounds(&row, &bounds_at, scene)?);
        if known.is_some() {
            let found = format!("item {id} twice at one time");
            return Err(row.error(found, "each item once"));
        }
    }
    table.expect_rows(recorded.times.len(), "no motion")?;
    recorded.end_frame(&moved);
    Ok(recorded)
}

fn item(row: &Row, column: usize, scene: &Scene) -> Result<ItemId, InputError> {
    let text = row.text(column);
    let id = text.parse::<ItemId>().ok();
    id.and_then(|id| scene.item_of(id)).ok_or_else(|| {
        let found = format!("id '{}'", crate::shown::shortened(text, 60));
        let expected = format!("an item of '{}', {}", scene.name, scene.ids());
        row.error(found, expected)
    })
}

fn bounds(row: &Row, columns: &[usize; 6], scene: &Scene) -> Result<Bounds, InputError> {
    if columns.iter().all(|&column| row.text(column).is_empty()) {
        return Ok(Bounds {
            stored: REMOVED,
            written: WorldBox::AS_STORED,
        });
    }
    let values = row.finite_numbers(columns)?;
    let [min, max] = [&values[..3], &values[3..]].map(DVec3::from_slice);
    let b = Aabb::rounded_outward(min, max, scene.origin);
    if b.is_finite() && min.cmple(max).all() {
        let own = WorldBox::new(min, max);
        return Ok(Bounds {
            stored: b,
            written: match own.is_stored_as(&b, scene.origin) {
                true => WorldBox::AS_STORED,
                false => own,
            },
        });
    }
    let found = format!("a box from {:?} to {:?}", min.to_array(), max.to_array());
    let expected = "min <= max within the range of f32, or no bounds to remove the item";
    Err(row.error(found, expected.to_owned()))
}
