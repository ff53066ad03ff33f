//! Lines and quotes of a CSV file, counted on the way to the CSV reader, which
//! reports neither the line of a record nor a quote that is never closed.

use std::collections::VecDeque;
use std::io::{self, Read};

/// Counts lines as an editor does. The CSV reader states where it began to look
/// for a record, which after an empty line, and after every line of a file with
/// Windows line ends, is a line too early.
pub(super) struct LineCounter<R> {
    input: R,
    delimiter: u8,
    offset: u64,
    line: u64,
    last: u8,
    quotes: Quotes,
    /// Offset and line of the quote that is open, or was last.
    opened: (u64, u64),
    fault: Option<QuoteFault>,
    /// Offset and number of the lines that are not empty, as far as the CSV
    /// reader has not passed them.
    starts: VecDeque<(u64, u64)>,
}

/// Position in a field, as the CSV reader sees it.
#[derive(Clone, Copy, PartialEq)]
enum Quotes {
    FieldStart,
    Unquoted,
    Open,
    /// After a quote that closes the field, or is the first of a doubled one.
    Closed,
    /// White space after the closing quote.
    Behind,
}

/// A quote that takes following lines into its field: it is never closed, or the
/// quote that closes it has text behind it and was meant to open another field.
#[derive(Clone, Copy, Debug)]
pub(super) struct QuoteFault {
    /// Bytes before the quote.
    pub offset: u64,
    /// Line of the quote.
    pub line: u64,
    /// Line where the field ends; `None` at the end of the file.
    pub end: Option<u64>,
}

impl<R> LineCounter<R> {
    pub fn new(input: R, delimiter: u8) -> Self {
        LineCounter {
            input,
            delimiter,
            offset: 0,
            line: 0,
            last: b'\n',
            quotes: Quotes::FieldStart,
            opened: (0, 0),
            fault: None,
            starts: VecDeque::new(),
        }
    }

    /// The line of the first record that begins at or after a byte. Records
    /// must come in the order of the file.
    pub fn line_of_record_at(&mut self, byte: u64) -> u64 {
        while self.starts.front().is_some_and(|start| start.0 < byte) {
            self.starts.pop_front();
        }
        self.starts
            .front()
            .map_or(self.line.max(1), |start| start.1)
    }

    /// The first faulty quote of the bytes before `end`.
    pub fn fault_before(&self, end: u64) -> Option<QuoteFault> {
        self.fault.filter(|fault| fault.offset < end)
    }

    fn note_fault(&mut self, end: Option<u64>) {
        let (offset, line) = self.opened;
        self.fault.get_or_insert(QuoteFault { offset, line, end });
    }

    fn follow_quotes(&mut self, byte: u8) {
        use Quotes::{Behind, Closed, FieldStart, Open, Unquoted};
        self.quotes = match (self.quotes, byte) {
            (Open, b'"') => Closed,
            (Open, _) | (Closed, b'"') => Open,
            (_, b'\n' | b'\r') => FieldStart,
            (_, byte) if byte == self.delimiter => FieldStart,
            (FieldStart, b'"') => {
                self.opened = (self.offset, self.line);
                Open
            }
            // A byte order mark, which the CSV reader drops.
            (FieldStart, 0xEF | 0xBB | 0xBF) if self.offset < 3 => FieldStart,
            (Closed | Behind, b' ' | b'\t') => Behind,
            (Closed | Behind, _) if self.opened.1 < self.line => {
                self.note_fault(Some(self.line));
                Unquoted
            }
            _ => Unquoted,
        };
    }
}

impl<R: Read> Read for LineCounter<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.input.read(buffer)?;
        if count == 0 && !buffer.is_empty() && self.quotes == Quotes::Open {
            self.note_fault(None);
        }
        for &byte in &buffer[..count] {
            let is_end = |b: u8| b == b'\n' || b == b'\r';
            if is_end(self.last) && (self.last, byte) != (b'\r', b'\n') {
                self.line += 1;
                if !is_end(byte) {
                    self.starts.push_back((self.offset, self.line));
                }
            }
            self.follow_quotes(byte);
            (self.last, self.offset) = (byte, self.offset + 1);
        }
        Ok(count)
    }
}
