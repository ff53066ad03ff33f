//! Reading and writing of boxes as CSV.
//!
//! `min_x,min_y,min_z,max_x,max_y,max_z` and any further columns as labels; the item id is the
//! zero-based data row.

use std::io::{self, Write};

use glam::DVec3;

use super::{Labels, Scene, WorldBox};
use crate::input::{InputError, Result, TableReader, note};
use crate::query::ItemId;
use crate::shown::shortened;

const BOUNDS: [&str; 6] = ["min_x", "min_y", "min_z", "max_x", "max_y", "max_z"];

/// Reads a scene from boxes CSV.
///
/// Numbers are f64 and are rounded outward to f32 relative to an origin chosen in f64. `file` only
/// names the source in errors.
///
/// With `skip_bad_items`, rows that are not a finite box with min <= max are left out and counted
/// in [`Scene::skipped_items`]; the others keep the ids of their rows ([`Scene::row_of`]).
///
/// # Errors
/// A missing or wrong header; the first bad row, with the number of bad rows.
pub fn read_boxes_csv(bytes: &[u8], file: &str, skip_bad_items: bool) -> Result<Scene> {
    let mut table = TableReader::open(bytes, file, &BOUNDS)?;
    let mut rows = read_rows(&mut table, f64::from(f32::MAX))?;
    if let Some(first) = rows.first_bad.take().filter(|_| !skip_bad_items) {
        return Err(match rows.bad {
            1 => first,
            count => InputError::new(format_args!(
                "{first} ({count} bad items in all; --skip-bad-items leaves them out and reports \
                 the count)"
            )),
        });
    }
    rows.note_near_names(file);
    let mut scene = Scene::from_boxes(file, &rows.boxes)?;
    scene.labels = rows.labels;
    scene.skipped_items = rows.bad;
    if rows.bad > 0 {
        scene.rows = rows.kept;
    }
    Ok(scene)
}

/// Reads boxes to search by, in the same format: any f64 numbers.
///
/// # Errors
/// A missing or wrong header, or the first bad row.
pub fn read_search_boxes_csv(bytes: &[u8], file: &str) -> Result<Vec<WorldBox>> {
    let mut table = TableReader::open(bytes, file, &BOUNDS)?;
    let mut rows = read_rows(&mut table, f64::MAX)?;
    rows.first_bad.take().map_or(Ok(()), Err)?;
    table.expect_rows(rows.boxes.len(), "no box")?;
    rows.note_near_names(file);
    Ok(rows.boxes)
}

/// Content of a file, with its errors.
#[derive(Default)]
struct Rows {
    boxes: Vec<WorldBox>,
    /// Data row of each box.
    kept: Vec<ItemId>,
    labels: Vec<Labels>,
    first_bad: Option<InputError>,
    bad: usize,
}

impl Rows {
    /// Warns of labels that may have been meant as bounds.
    fn note_near_names(&self, file: &str) {
        for name in self.labels.iter().map(|label| &label.column) {
            if let Some(bound) = BOUNDS.iter().find(|bound| letters(bound) == letters(name)) {
                let name = shortened(name, 60);
                let what = format_args!("column '{name}' is kept as a label beside '{bound}'");
                note(&format!("{file}: {what}"));
            }
        }
        let own = self.labels.iter().find(|label| label.column == "id");
        let is_row = |(item, row): (usize, &ItemId)| {
            own.is_none_or(|label| label.get(item).parse() == Ok(*row))
        };
        if !self.kept.iter().enumerate().all(is_row) {
            let what = "ids are data rows from 0; column 'id' is a label";
            note(&format!("{file}: {what}"));
        }
    }
}

/// A name in lower case without punctuation and blanks.
fn letters(name: &str) -> String {
    name.to_lowercase()
        .replace(|c: char| !c.is_alphanumeric(), "")
}

/// Reads all rows; a bound beyond `limit` is bad too.
fn read_rows(table: &mut TableReader, limit: f64) -> Result<Rows> {
    let centres = ["centerx", "centrex", "centroidx"];
    let is_centre = |name: &String| centres.contains(&&letters(name)[..]);
    if table.column(BOUNDS[0]).is_none() && table.header.iter().any(is_centre) {
        let half = "min = centre - half the size, max = centre + half the size";
        let expected = format!("a header with {}: {half}", BOUNDS.join(","));
        let header = shortened(&table.header.join(","), 80);
        return Err(table.error(format!("centres in place of bounds: '{header}'"), expected));
    }
    let columns = table.columns(&BOUNDS)?;
    let others = table.header.iter().enumerate();
    let others = others.filter(|(i, _)| !columns.contains(i));
    let labels = others.map(|(i, name)| (i, Labels::new(name)));
    let mut labels: Vec<(usize, Labels)> = labels.collect();
    let mut rows = Rows::default();
    while let Some(row) = table.next_row() {
        let checked = row.and_then(|row| {
            let bounds = row.finite_numbers(&columns)?;
            let [min, max] = [&bounds[..3], &bounds[3..]].map(DVec3::from_slice);
            let b = WorldBox::new(min, max);
            for axis in 0..3 {
                let (low, high) = (b.min[axis], b.max[axis]);
                if low > high {
                    let name = ["x", "y", "z"][axis];
                    let [min, max] = ["min", "max"].map(|end| format!("{end}_{name}"));
                    let found = format!("an inverted box, {min} {low:?} > {max} {high:?}");
                    return Err(row.error(found, format!("{min} <= {max}")));
                }
                if low < -limit || high > limit {
                    let found = format!("a bound beyond the range of f32 ({low:?} to {high:?})");
                    return Err(row.error(found, format!("numbers within +-{limit:e}")));
                }
            }
            for (column, label) in &mut labels {
                label.push(row.label(*column));
            }
            Ok(b)
        });
        match checked {
            Ok(b) => {
                rows.kept.push((rows.boxes.len() + rows.bad) as ItemId);
                rows.boxes.push(b);
            }
            Err(error) => {
                rows.bad += 1;
                rows.first_bad.get_or_insert(error);
            }
        }
    }
    rows.labels = labels.into_iter().map(|(_, label)| label).collect();
    Ok(rows)
}

/// Writes a scene's boxes as they were written, in world coordinates.
///
/// Its labels are further columns. Reading the numbers back gives the same f64; [`Scene::settled`]
/// converts a scene to the one that is then read.
pub fn write_boxes_csv(scene: &Scene, output: impl Write) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(output);
    for bound in BOUNDS {
        csv.write_field(bound)?;
    }
    for label in &scene.labels {
        csv.write_field(&label.column)?;
    }
    csv.write_record(None::<&[u8]>)?;
    let mut record = csv::ByteRecord::new();
    for (item, b) in scene.written().enumerate() {
        record.clear();
        for value in b.min.to_array().into_iter().chain(b.max.to_array()) {
            record.push_field(value.to_string().as_bytes());
        }
        for label in &scene.labels {
            record.push_field(label.get(item).as_bytes());
        }
        csv.write_byte_record(&record)?;
    }
    csv.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Scene> {
        read_boxes_csv(text.as_bytes(), "b.csv", false)
    }

    #[test]
    fn columns_in_any_order_with_labels() {
        let text = "kind,max_x,max_y,max_z,min_z,min_y,min_x\nhut,4,5,6,3,2,1\n";
        let scene = read(text).unwrap();
        let b = scene.world_bounds();
        assert_eq!(
            (b.min, b.max),
            (DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0))
        );
        assert_eq!(scene.labels[0].get(0), "hut");
    }

    #[test]
    fn each_bad_file_gets_its_line_and_what_was_expected() {
        let header = "min_x,min_y,min_z,max_x,max_y,max_z";
        let cases = [
            (String::new(), "line 1: an empty file"),
            ("a,b,c\n1,2,3\n".into(), "line 1: no column 'min_x'"),
            (
                "Center.x,center_y,center_z,extent_x,extent_y,extent_z\n".into(),
                "line 1: centres in place of bounds: 'Center.x,center_y,",
            ),
            (
                format!("{header}\n1,2,3,4,five,6\n"),
                "line 2: max_y 'five'",
            ),
            (
                format!("{header}\n0,0,0,1,1,1\n1,2,3,4,nan,6\n"),
                "line 3: max_y 'nan'",
            ),
            (format!("{header}\n1,2,3,4,inf,6\n"), "line 2: max_y 'inf'"),
            (
                format!("{header}\n1,2,3,4,1,6\n"),
                "inverted box, min_y 2.0 > max_y 1.0",
            ),
            (format!("{header}\n1,2,3\n"), "line 2: 3 fields"),
            (
                format!("{header}\n0,0,0,1,1,1e39\n"),
                "beyond the range of f32",
            ),
            (format!("{header},min_x\n"), "column 'min_x' twice"),
            (format!("{header}\n1,2,3,4,,6\n"), "line 2: max_y ''"),
        ];
        for (text, wanted) in cases {
            let error = read(&text).unwrap_err().to_string();
            assert!(error.contains(wanted), "{text:?}: {error}");
            assert!(
                error.contains("expected") && !error.contains('\n'),
                "{error}"
            );
        }
    }

    #[test]
    fn bad_rows_are_counted_and_skipped_only_on_request() {
        let text = "min_x,min_y,min_z,max_x,max_y,max_z,kind\n\
                    0,0,0,1,1,1,a\n0,0,0,-1,1,1,b\n0,0,0,nan,1,1,c\n2,2,2,3,3,3,d\n";
        let error = read(text).unwrap_err().to_string();
        assert!(
            error.contains("2 bad items") && error.contains("line 3"),
            "{error}"
        );
        let scene = read_boxes_csv(text.as_bytes(), "b.csv", true).unwrap();
        assert_eq!((scene.items.len(), scene.skipped_items), (2, 2));
        assert_eq!(scene.labels[0].get(1), "d");
        assert_eq!([scene.row_of(0), scene.row_of(1)], [0, 3]);
        assert_eq!(
            [0, 1, 3, 4].map(|row| scene.item_of(row)),
            [Some(0), None, Some(1), None]
        );
    }

    #[test]
    fn writing_and_reading_back_is_the_identity() {
        let text =
            "min_x,min_y,min_z,max_x,max_y,max_z,kind\n0.1,1e7,-3,0.7,10000001.5,2,\"a,b\"\n";
        let scene = read(text).unwrap();
        let mut bytes = Vec::new();
        write_boxes_csv(&scene, &mut bytes).unwrap();
        assert_eq!(
            String::from_utf8(bytes.clone()).unwrap(),
            text.replace("1e7", "10000000")
        );
        let again = read_boxes_csv(&bytes[..], "b.csv", false).unwrap();
        assert_eq!(
            (scene.digest(), "a,b"),
            (again.digest(), again.labels[0].get(0))
        );
    }
}
