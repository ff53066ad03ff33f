//! Comma-separated files with a header, read row by row with errors that name
//! file, line and column. It owns the mechanics that the box, camera and point
//! readers share; what the columns mean is theirs.

use std::io::Read;

use super::InputError;

/// A CSV file with its header read.
pub struct TableReader<R> {
    file: String,
    csv: csv::Reader<R>,
    header: Vec<String>,
    record: csv::ByteRecord,
}

/// One data row.
pub struct Row<'a> {
    file: &'a str,
    header: &'a [String],
    record: &'a csv::ByteRecord,
    line: u64,
}

impl<R: Read> TableReader<R> {
    /// Reads the header. Names are trimmed; a byte order mark is dropped.
    ///
    /// # Errors
    /// An unreadable or empty file, a column named twice.
    pub fn open(input: R, file: &str) -> Result<Self, InputError> {
        let mut csv = csv::ReaderBuilder::new()
            .flexible(true)
            .trim(csv::Trim::All)
            .from_reader(input);
        let fields = csv
            .byte_headers()
            .map_err(|error| csv_error(file, error))?
            .clone();
        let header: Vec<String> = fields
            .iter()
            .map(|f| {
                String::from_utf8_lossy(f)
                    .trim_start_matches('\u{feff}')
                    .to_owned()
            })
            .collect();
        let complain = |found: String, expected: &str| InputError::Line {
            file: file.to_owned(),
            line: 1,
            found,
            expected: expected.to_owned(),
        };
        if header.iter().all(String::is_empty) {
            return Err(complain("an empty file".into(), "a header line"));
        }
        for (i, name) in header.iter().enumerate() {
            if !name.is_empty() && header[..i].contains(name) {
                let found = format!("column '{name}' twice");
                return Err(complain(found, "each column once"));
            }
        }
        Ok(TableReader {
            file: file.to_owned(),
            csv,
            header,
            record: csv::ByteRecord::new(),
        })
    }

    pub fn header(&self) -> &[String] {
        &self.header
    }

    /// The place of a column, if the file has it.
    pub fn column(&self, name: &str) -> Option<usize> {
        self.header.iter().position(|h| h == name)
    }

    /// The places of columns that must all be there.
    pub fn columns<const N: usize>(&self, names: &[&str; N]) -> Result<[usize; N], InputError> {
        let mut places = [0; N];
        for (place, name) in places.iter_mut().zip(names) {
            *place = self.column(name).ok_or_else(|| InputError::Line {
                file: self.file.clone(),
                line: 1,
                found: format!(
                    "no column '{name}' in '{}'",
                    shortened(&self.header.join(","))
                ),
                expected: format!("a header with {}", names.join(",")),
            })?;
        }
        Ok(places)
    }

    /// The next row; `None` at the end of the file.
    pub fn next_row(&mut self) -> Option<Result<Row<'_>, InputError>> {
        match self.csv.read_byte_record(&mut self.record) {
            Ok(false) => None,
            Err(error) => Some(Err(csv_error(&self.file, error))),
            Ok(true) => {
                let row = Row {
                    file: &self.file,
                    header: &self.header,
                    line: self.record.position().map_or(0, csv::Position::line),
                    record: &self.record,
                };
                let (found, wanted) = (self.record.len(), self.header.len());
                Some(if found == wanted {
                    Ok(row)
                } else {
                    Err(row.error(
                        format!("{found} fields"),
                        format!("{wanted}, as in the header"),
                    ))
                })
            }
        }
    }
}

impl Row<'_> {
    /// The field as text; bytes that are no UTF-8 are replaced.
    pub fn text(&self, column: usize) -> &str {
        std::str::from_utf8(&self.record[column]).unwrap_or("\u{fffd}")
    }

    /// A finite f64.
    pub fn finite_number(&self, column: usize) -> Result<f64, InputError> {
        let value = self.text(column).parse::<f64>().ok();
        value.filter(|v| v.is_finite()).ok_or_else(|| {
            let (name, text) = (&self.header[column], shortened(self.text(column)));
            self.error(format!("{name} '{text}'"), "a finite number".into())
        })
    }

    pub fn error(&self, found: String, expected: String) -> InputError {
        InputError::Line {
            file: self.file.to_owned(),
            line: self.line,
            found,
            expected,
        }
    }
}

/// Long or multi-line text cut down to what fits an error line.
fn shortened(text: &str) -> String {
    let mut short: String = text
        .chars()
        .map(|c| if c.is_control() { ' ' } else { c })
        .take(60)
        .collect();
    if text.chars().count() > 60 {
        short.push_str("...");
    }
    short
}

fn csv_error(file: &str, error: csv::Error) -> InputError {
    let line = error.position().map_or(1, csv::Position::line);
    match error.into_kind() {
        csv::ErrorKind::Io(source) => InputError::Io {
            path: file.into(),
            source,
        },
        other => InputError::Line {
            file: file.to_owned(),
            line,
            found: format!("{other:?}"),
            expected: "comma-separated values".into(),
        },
    }
}
