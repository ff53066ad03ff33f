//! Tables with a header, separated by commas, semicolons, tabs or bars.
//!
//! Rows are read one by one with errors that name file, line and column. It defines the
//! mechanics that the box, camera and point readers share; what the columns mean is theirs.

use std::collections::HashSet;
use std::fmt::Display;

use super::{InputError, Result, finite, note};
use crate::shown::{counted, first_of, shortened};
use crate::spec::nearest;

/// Columns that say which row it is, and nothing else.
const LABELS: [&str; 8] = [
    "camera", "comment", "frame", "id", "label", "name", "note", "time_s",
];

/// Bytes of the first line.
const MOST_HEADER: usize = 1_000_000;

/// A CSV file with its header read.
pub struct TableReader<'b> {
    file: String,
    bytes: &'b [u8],
    csv: csv::Reader<&'b [u8]>,
    delimiter: u8,
    /// The names of the columns, in order.
    pub header: Vec<String>,
    header_line: u64,
    record: csv::StringRecord,
    /// Begin of the last record in bytes, and its line.
    at: (usize, u64),
}

/// One data row.
pub struct Row<'a> {
    table: &'a TableReader<'a>,
    /// Its line in the file, from 1.
    pub line: u64,
}

impl<'b> TableReader<'b> {
    /// Reads the header. Names are trimmed; a byte order mark is dropped.
    ///
    /// Fields are separated by the one of `,`, `;`, tab and `|` that gives most of `names`.
    ///
    /// # Errors
    /// Text that is no UTF-8, an empty file, a column named twice, a quote that is never
    /// closed.
    pub fn open(bytes: &'b [u8], file: &str, names: &[&str]) -> Result<Self> {
        let no_text = |at: usize, found: &str| {
            InputError::line(file, lines(&bytes[..at]) + 1, found, "UTF-8 text")
        };
        const OTHERS: [(&[u8], &str); 3] = [
            (b"\x1f\x8b", "gzip, which is not read"),
            (b"PK\x03\x04", "a zip archive, no table"),
            (b"glTF", "binary glTF, no table"),
        ];
        if let Some((_, found)) = OTHERS.iter().find(|other| bytes.starts_with(other.0)) {
            return Err(no_text(0, found));
        }
        if let Some(zero) = bytes.iter().position(|byte| *byte == 0) {
            return Err(no_text(zero, "zero bytes, as in UTF-16 text"));
        }
        let text = str::from_utf8(bytes);
        text.map_err(|error| no_text(error.valid_up_to(), "a byte that is no UTF-8"))?;
        let head = first_line(bytes);
        if head.len() > MOST_HEADER {
            let found = format!("a header of {}", counted(head.len(), "byte"));
            return Err(InputError::line(file, 1, found, "at most a million"));
        }
        let delimiter = delimiter(head, names);
        let mut csv = csv::ReaderBuilder::new()
            .flexible(true)
            .delimiter(delimiter)
            .trim(csv::Trim::Headers)
            .from_reader(bytes);
        // From memory nothing fails to be read.
        let fields = csv.headers().cloned().unwrap_or_default();
        let plain = |name: &str| name.trim_start_matches('\u{feff}').to_owned();
        let header: Vec<String> = fields.iter().map(plain).collect();
        let mut table = TableReader {
            file: file.to_owned(),
            bytes,
            csv,
            delimiter,
            header: Vec::new(),
            header_line: 1,
            record: csv::StringRecord::new(),
            at: (0, 1),
        };
        table.header_line = table.line_of_record_at(0);
        check_quotes(bytes, delimiter, file)?;
        if header.iter().all(String::is_empty) {
            let found = match header.len() {
                0 => "an empty file".to_owned(),
                1 => "a line of blanks".to_owned(),
                columns => format!("{} without a name", counted(columns, "column")),
            };
            return Err(table.error(found, "a header line"));
        }
        let mut seen = HashSet::with_capacity(header.len());
        for name in header.iter().filter(|name| !name.is_empty()) {
            if seen.contains(name.as_str()) && is_data(&header) {
                let all = joined(&header, delimiter);
                let found = format!("data '{all}' in place of the header");
                return Err(table.error(found, "a line with the names of the columns"));
            }
            if !seen.insert(name.as_str()) {
                let found = format!("column '{}' twice", shortened(name, 60));
                return Err(table.error(found, "each column once"));
            }
        }
        table.header = header;
        Ok(table)
    }

    /// Line of the first record at or behind a byte.
    ///
    /// The CSV reader begins to look for a record at the line ends before it. Records come
    /// in the order of the file.
    fn line_of_record_at(&mut self, byte: usize) -> u64 {
        let (last, line) = self.at;
        let ends = self.bytes[byte..].iter().take_while(|byte| is_end(byte));
        let at = byte + ends.count();
        // The last line end of the file begins no line.
        let to = at.min(self.bytes.len().saturating_sub(1));
        self.at = (at, line + lines(&self.bytes[last.min(to)..to]));
        self.at.1
    }

    /// The place of a column, if the file has it.
    pub fn column(&self, name: &str) -> Option<usize> {
        self.header.iter().position(|h| h == name)
    }

    /// The places of columns that must all be there.
    pub fn columns<const N: usize>(&self, names: &[&str; N]) -> Result<[usize; N]> {
        let mut places = [0; N];
        for (place, name) in places.iter_mut().zip(names) {
            *place = self.column(name).ok_or_else(|| {
                let all = joined(&self.header, self.delimiter);
                let found = match is_data(&self.header) {
                    true => format!("data '{all}' in place of the header"),
                    false => format!("no column '{name}' in '{all}'"),
                };
                self.error(found, format!("a header with {}", names.join(",")))
            })?;
        }
        Ok(places)
    }

    /// An error in the header.
    pub fn error(&self, found: impl Display, expected: impl Display) -> InputError {
        InputError::line(&self.file, self.header_line, found, expected)
    }

    /// Checks that there were rows; `none` says that there were not.
    pub fn expect_rows(&self, count: usize, none: &str) -> Result<()> {
        let (line, expected) = (self.header_line + 1, "at least one row after the header");
        let error = || InputError::line(&self.file, line, none, expected);
        (count > 0).then_some(()).ok_or_else(error)
    }

    /// Tells of columns that nothing is read from, with the nearest name that would be,
    /// or the one that stands beside it in `synonyms`.
    pub fn note_unread(&self, known: &[&str], synonyms: &[(&str, &str)]) {
        let is_unread = |name: &&String| {
            let name = name.as_str();
            !name.is_empty() && !known.contains(&name) && !LABELS.contains(&name)
        };
        let unread = self.header.iter().filter(is_unread);
        let named = unread.map(|name| {
            let synonym = synonyms.iter().find(|(other, _)| name == other);
            let guess = synonym.map(|(_, guess)| *guess);
            let shown = shortened(name, 60);
            match guess.or_else(|| nearest(&shown, known.iter().copied())) {
                Some(guess) => format!("'{shown}' (did you mean '{guess}'?)"),
                None => format!("'{shown}'"),
            }
        });
        let named: Vec<String> = named.collect();
        if !named.is_empty() {
            let place = format!("{}, line {}", self.file, self.header_line);
            let named = first_of(&named, 16);
            note(&format!("{place}: columns that are not read: {named}"));
        }
    }

    /// The next row, or what is wrong with it; `None` at the end of the file.
    pub fn next_row(&mut self) -> Option<Result<Row<'_>>> {
        let read = self.csv.read_record(&mut self.record);
        read.ok().filter(|is_there| *is_there)?;
        let start = self.record.position().map_or(0, csv::Position::byte);
        let line = self.line_of_record_at(start as usize);
        let row = Row { table: self, line };
        let (found, wanted) = (self.record.len(), self.header.len());
        Some(match found == wanted {
            true => Ok(row),
            false => {
                // If all are numbers, some of them may be behind a decimal comma.
                let is_split = self.delimiter == b',' && found > wanted;
                let is_split = is_split && (0..found).all(|k| row.text(k).parse::<f64>().is_ok());
                let why = is_split.then_some(", without decimal commas");
                let expected = format!("{wanted}, as in the header{}", why.unwrap_or(""));
                Err(row.error(counted(found, "field"), expected))
            }
        })
    }
}

impl Row<'_> {
    /// The field without blanks around it.
    pub fn text(&self, column: usize) -> &str {
        self.label(column).trim_ascii()
    }

    /// The same with its blanks.
    pub fn label(&self, column: usize) -> &str {
        &self.table.record[column]
    }

    /// A finite f64.
    pub fn finite_number(&self, column: usize) -> Result<f64> {
        finite(self.text(column)).map_err(|expected| {
            let (name, text) = (&self.table.header[column], shortened(self.text(column), 60));
            self.error(format_args!("{name} '{text}'"), expected)
        })
    }

    /// Finite f64s, one of each column.
    pub fn finite_numbers<const N: usize>(&self, columns: &[usize; N]) -> Result<[f64; N]> {
        let mut numbers = [0.0; N];
        for (number, &column) in numbers.iter_mut().zip(columns) {
            *number = self.finite_number(column)?;
        }
        Ok(numbers)
    }

    /// Seconds, which do not lie before the `last`.
    pub fn time(&self, column: usize, last: f64) -> Result<f64> {
        let time = self.finite_number(column)?;
        let found = || format!("time_s {time} after {last}");
        let error = || self.error(found(), "times in ascending order");
        (time >= last).then_some(time).ok_or_else(error)
    }

    /// An error at this row.
    pub fn error(&self, found: impl Display, expected: impl Display) -> InputError {
        InputError::line(&self.table.file, self.line, found, expected)
    }
}

/// The first line that is not empty.
fn first_line(bytes: &[u8]) -> &[u8] {
    let text = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes);
    let mut lines = text.split(is_end);
    lines.find(|line| !line.is_empty()).unwrap_or_default()
}

/// Delimiter of a first line.
///
/// The one that gives most of the names; outside of quotes the most frequent if none does.
fn delimiter(header: &[u8], names: &[&str]) -> u8 {
    let unquoted = header.split(|byte| *byte == b'"').step_by(2);
    let rank = |one: &u8| {
        let mut csv = csv::ReaderBuilder::new();
        let csv = csv.delimiter(*one).trim(csv::Trim::All);
        let fields = csv.from_reader(header).byte_headers().cloned();
        let fields = fields.unwrap_or_default();
        let named = |name: &&&str| fields.iter().any(|field| field == name.as_bytes());
        match names.iter().filter(named).count() {
            0 => (0, unquoted.clone().flatten().filter(|b| *b == one).count()),
            named => (named, 0),
        }
    };
    // The last of several that are equal.
    let all = [b'|', b'\t', b';', b','];
    all.into_iter().max_by_key(rank).unwrap_or(b',')
}

/// Names of columns as in the file, cut down to what fits an error line.
fn joined(header: &[String], delimiter: u8) -> String {
    shortened(&header.join(&char::from(delimiter).to_string()), 60)
}

/// Numbers in place of the names of columns: all tables have three or more.
fn is_data(header: &[String]) -> bool {
    let numbers = header.iter().filter(|name| name.parse::<f64>().is_ok());
    numbers.count() >= 3
}

fn is_end(byte: &u8) -> bool {
    matches!(byte, b'\n' | b'\r')
}

/// Line ends as an editor counts them: LF, CR, or both.
fn lines(bytes: &[u8]) -> u64 {
    let next = bytes.iter().skip(1).chain([&0]);
    let ends = bytes.iter().zip(next);
    let ends = ends.filter(|(byte, next)| is_end(byte) && (**byte, **next) != (b'\r', b'\n'));
    ends.count() as u64
}

/// Refuses a quote that takes following lines into its field.
///
/// It is never closed, or the quote that closes it has text behind it and was meant to
/// open another field.
fn check_quotes(bytes: &[u8], delimiter: u8, file: &str) -> Result<()> {
    // A byte order mark, which the CSV reader drops.
    let mut begin = 3 * usize::from(bytes.starts_with(b"\xef\xbb\xbf"));
    let fault = |open: usize, found: String| {
        let expected = "'\"' at both ends of a field, and doubled within it";
        InputError::line(file, lines(&bytes[..open]) + 1, found, expected)
    };
    let separates = |byte: &u8| is_end(byte) || *byte == delimiter;
    while let Some(first) = bytes.get(begin) {
        let mut end = begin;
        if *first == b'"' {
            loop {
                let close = bytes[end + 1..].iter().position(|byte| *byte == b'"');
                let never = || fault(begin, "a quote that is never closed".to_owned());
                end += 1 + close.ok_or_else(never)?;
                if bytes.get(end + 1) != Some(&b'"') {
                    break;
                }
                end += 1;
            }
            let mut behind = bytes[end + 1..].iter();
            let behind = behind.find(|byte| separates(byte) || !b" \t".contains(byte));
            let has_text = behind.is_some_and(|byte| !separates(byte));
            if has_text {
                let found = match bytes[begin..end].iter().any(is_end) {
                    true => {
                        let line = lines(&bytes[..end]) + 1;
                        format!("a quote that is not closed before line {line}")
                    }
                    false => "text behind a closing quote".to_owned(),
                };
                return Err(fault(begin, found));
            }
        }
        let length = bytes[end..].iter().position(separates);
        begin = end + length.map_or(bytes.len() - end, |length| length + 1);
    }
    Ok(())
}

#[cfg(test)]
mod tests;
