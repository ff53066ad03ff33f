//! Tables read in pieces: separators, quoted fields, line numbers, what is refused.

use super::*;

const NAMES: [&str; 3] = ["x", "y", "z"];

/// The line of the first row whose field `x` is no number.
fn bad_line(text: &str) -> u64 {
    let mut table = TableReader::open(text.as_bytes(), "t.csv", &NAMES).unwrap();
    while let Some(row) = table.next_row() {
        if let Err(error) = row.and_then(|row| row.finite_number(0)) {
            let error = error.to_string();
            let line = error.strip_prefix("t.csv, line ").unwrap_or_default();
            return line.split(':').next().unwrap_or_default().parse().unwrap();
        }
    }
    0
}

#[test]
fn the_delimiter_that_gives_most_names_separates() {
    for (header, wanted) in [
        ("x,y,a\t\t\t\tb", b','),
        ("x;y;,,,,", b';'),
        ("\"a,b\"\tx\ty", b'\t'),
        ("size (w;h;d;e),x,y,z", b','),
        ("name|id,x,y", b','),
        ("\u{feff}x;y;a,b,c", b';'),
        ("x,y,z,x\tz\ty\tx\tx", b','),
        ("1;2;3", b';'),
        ("x", b','),
    ] {
        assert_eq!(delimiter(header.as_bytes(), &NAMES), wanted, "{header:?}");
    }
}

#[test]
fn lines_are_those_of_an_editor() {
    for end in ["\n", "\r\n", "\r"] {
        let cases = [
            ("x,y|1,2|q,2|", 3),
            ("x,y|1,2|q,2", 3),
            ("||x,y|||1,2||q,2|", 8),
            ("x,y|1,\"a|b||c\"|q,2|", 6),
            ("x,y|1,2|1|", 3),
            ("\u{feff}x,y|q,2|", 2),
        ];
        for (text, line) in cases {
            assert_eq!(bad_line(&text.replace('|', end)), line, "{text} {end:?}");
        }
    }
    // Longer than any buffer.
    let rows = format!("1,{}\r\n", "a".repeat(100)).repeat(5000);
    assert_eq!(bad_line(&format!("x,y\r\n{rows}q,2\r\n")), 5002);
}

#[test]
fn nothing_is_told_from_columns_without_names() {
    for (text, wanted) in [
        ("", "t.csv, line 1: an empty file; expected a header line"),
        (
            "\n\n",
            "t.csv, line 2: an empty file; expected a header line",
        ),
        (
            " \nx\n1\n",
            "t.csv, line 1: a line of blanks; expected a header line",
        ),
        (
            ",,\n1,2,3\n",
            "t.csv, line 1: 3 columns without a name; expected a header line",
        ),
    ] {
        let error = TableReader::open(text.as_bytes(), "t.csv", &NAMES)
            .err()
            .unwrap();
        assert_eq!(error.to_string(), wanted, "{text:?}");
    }
}

#[test]
fn columns_are_separated_by_what_separates_the_header() {
    for text in [
        "x,y,z,a;b\n1,2,3,4",
        "\nx;y;z;\"a,b,c,d\"\n1;2;\"3\";\"4;5\"\n",
        "x\ty\tz\tkind\r\n1\t2\t\" 3\"\ta b\r\n",
        "\u{feff}\"x\"|\"y\"|z|\"a \"\"|\"\"\"\n 1 |2|3| ",
    ] {
        let mut table = TableReader::open(text.as_bytes(), "t.csv", &NAMES).unwrap();
        let columns = table.columns(&["x", "y", "z"]).unwrap();
        assert_eq!(table.header.len(), 4, "{text}");
        let row = table.next_row().unwrap().unwrap();
        let numbers = columns.map(|column| row.finite_number(column).unwrap());
        assert_eq!(numbers, [1.0, 2.0, 3.0], "{text}");
        assert!(table.next_row().is_none());
    }
}

/// The error of reading a table of three columns to its end.
fn told(text: &[u8]) -> String {
    let read = || -> Result<()> {
        let mut table = TableReader::open(text, "t.csv", &NAMES)?;
        let columns = table.columns(&["x", "y", "z"])?;
        while let Some(row) = table.next_row() {
            row?.finite_number(columns[1])?;
        }
        Ok(())
    };
    read()
        .err()
        .map(|error| error.to_string())
        .unwrap_or_default()
}

#[test]
fn a_quote_that_takes_in_other_lines_is_named_where_it_opens() {
    for (text, wanted) in [
        (
            "x,y,z\n1,2,\"a\n1,2,3\n",
            "t.csv, line 2: a quote that is never closed; ",
        ),
        (
            "x,y,z\n1,2,3\n\"1,2,3",
            "line 3: a quote that is never closed",
        ),
        ("x,\"y,z\n1,2,3\n", "line 1: a quote that is never closed"),
        (
            "x,y,z\n1,2,\"a\"\"\n",
            "line 2: a quote that is never closed",
        ),
        (
            "x,y,z\n1,2,\"a\n1,2,\"b\"\n",
            "line 2: a quote that is not closed before line 3",
        ),
        (
            "x,y,z\n1,2,\"a\n1,2,\" b\"\n",
            "line 2: a quote that is not closed before line 3",
        ),
        ("\u{feff}\"x,y,z\n", "line 1: a quote that is never closed"),
        ("x,y,z\n1,2,\"1\"5\n", "line 2: text behind a closing quote"),
        // Fields of several lines, doubled quotes, and a quote within a word.
        (
            "x,y,z\n1,2,\"a\n\"\"b\"\"\"\n1,2,\"\" \n1,2,3\"\n1b,2,3",
            "",
        ),
        ("\u{feff}\"x\",y,z\r\n1,2,\"3\"\r\n", ""),
    ] {
        let found = told(text.as_bytes());
        assert!(
            found.contains(wanted) && found.is_empty() == wanted.is_empty(),
            "{text}: {found}"
        );
    }
    // Longer than any buffer.
    let text = format!("x,y,z\n{}\"1,2,3\n{0}", "1,2,3\n".repeat(9000));
    assert!(told(text.as_bytes()).starts_with("t.csv, line 9002: a quote"));
}

#[test]
fn text_of_another_form_is_named() {
    let utf16 = |to: fn(u16) -> [u8; 2]| {
        let units = "\u{feff}x,y,z\r\n1,2,3\r\n".encode_utf16();
        units.flat_map(to).collect::<Vec<u8>>()
    };
    let (little, big) = (utf16(u16::to_le_bytes), utf16(u16::to_be_bytes));
    let cases: [(&[u8], &str); 14] = [
        (
            b"PK\x03\x04\0",
            "line 1: a zip archive, no table; expected UTF-8",
        ),
        (b"glTF\x02\0\0\0", "line 1: binary glTF, no table"),
        (
            &little,
            "line 1: zero bytes, as in UTF-16 text; expected UTF-8",
        ),
        (&little[2..], "UTF-16"),
        (&big, "UTF-16"),
        (b"x y z\n1 2 3\n", "no column 'x' in 'x y z'"),
        (
            b"x;y;z\n1;2,5;3\n",
            "line 2: y '2,5'; expected a decimal point, not a decimal comma",
        ),
        (
            b"x,y,z\n1,5,2,3,5\n",
            "line 2: 5 fields; expected 3, as in the header, without decimal commas",
        ),
        (
            b"x,y,z\n1,2,3,a\n",
            "line 2: 4 fields; expected 3, as in the header",
        ),
        (
            b"x;y;z\n1;2;3;5\n",
            "line 2: 4 fields; expected 3, as in the header",
        ),
        (
            b"1,0,1\n1,2,3\n",
            "line 1: data '1,0,1' in place of the header; expected",
        ),
        (
            b"1,2,3\n",
            "data '1,2,3' in place of the header; expected a header with x,y,z",
        ),
        (b"x,y,z,2,2\n", "column '2' twice"),
        ("\u{feff}x,y,z\n1,2,3\n".as_bytes(), ""),
    ];
    for (text, wanted) in cases {
        let found = told(text);
        assert!(
            found.contains(wanted) && found.is_empty() == wanted.is_empty(),
            "{wanted}: {found}"
        );
    }
}

#[test]
fn header_errors_fit_one_line() {
    let twice = format!("\n\"{0}\n\",\"{0}\n\"\n", "long".repeat(50));
    let error = TableReader::open(twice.as_bytes(), "t.csv", &NAMES)
        .err()
        .unwrap();
    let error = error.to_string();
    assert!(
        error.starts_with("t.csv, line 2: column 'longlong"),
        "{error}"
    );
    assert!(!error.contains('\n') && error.len() < 150, "{error}");
}

#[test]
fn bytes_that_are_no_utf_8_are_refused_with_their_line() {
    let told = |text: &[u8]| match TableReader::open(text, "t.csv", &NAMES) {
        Ok(_) => "taken".to_owned(),
        Err(error) => error.to_string(),
    };
    assert_eq!(
        told(b"x,y,kind\r\n1,2,gr\xc3\xbcn a\r\n1,2,gr\xfcn a\n"),
        "t.csv, line 3: a byte that is no UTF-8; expected UTF-8 text"
    );
    let told = told(b"x,y,kind\n1,2,a\0b\n");
    assert!(told.starts_with("t.csv, line 2: zero bytes"), "{told}");
}

#[test]
fn a_header_of_megabytes_is_refused() {
    let text = "\n".to_owned() + &"0".repeat(MOST_HEADER + 1);
    let error = TableReader::open(text.as_bytes(), "t.csv", &NAMES).err();
    let error = error.expect("an error").to_string();
    assert_eq!(
        error,
        "t.csv, line 1: a header of 1,000,001 bytes; expected at most a million"
    );
}
