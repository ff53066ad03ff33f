//! Reading JSON, with errors that name place, found text and expected text.
//!
//! Messages do not repeat the wording of the JSON crate.

use serde::de::DeserializeOwned;
use serde_json::error::Category;

use crate::shown::plain;

/// Difference between a text and the expected JSON.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{}: {found}; expected {}", self.place(), self.expected_of("JSON"))]
pub struct JsonError {
    /// Line, from 1; a reader of files with several texts sets it to that of the file.
    pub line: usize,
    /// Bytes, from 1.
    pub column: usize,
    /// Path of the value, `cells[3].rank`; empty for the whole.
    pub path: String,
    /// Found text.
    pub found: String,
    /// Expected value, if the text is JSON at all.
    pub expected: Option<String>,
}

impl JsonError {
    /// Line, column and the path of the value.
    pub fn place(&self) -> String {
        let place = format!("line {}, column {}", self.line, self.column);
        match self.path.as_str() {
            "" => place,
            path => format!("{place}, {}", plain(path)),
        }
    }

    /// Description of the whole, and of the value expected here.
    pub fn expected_of(&self, whole: &str) -> String {
        match &self.expected {
            Some(here) => format!("{whole}, here {here}"),
            None => whole.to_owned(),
        }
    }
}

/// Reads a value, skipping a leading byte order mark.
///
/// # Errors
/// Bytes that are not UTF-8, not JSON, or of another form.
pub fn from_json<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, JsonError> {
    // The byte order mark that some editors write.
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let (good, bad) = bytes.split_at(error.valid_up_to());
        JsonError {
            line: good.iter().filter(|byte| **byte == b'\n').count() + 1,
            column: good.iter().rev().take_while(|byte| **byte != b'\n').count() + 1,
            path: String::new(),
            found: match bytes.starts_with(b"\x1f\x8b") {
                true => "gzip, which has to be unpacked first".to_owned(),
                false => format!("byte {:#04x}, which is no UTF-8", bad.first().unwrap_or(&0)),
            },
            expected: None,
        }
    })?;
    let mut json = serde_json::Deserializer::from_str(text);
    let (path, error) = match serde_path_to_error::deserialize(&mut json) {
        Ok(value) => match json.end() {
            Ok(()) => return Ok(value),
            Err(error) => (String::new(), error),
        },
        Err(error) => {
            let path = error.path().to_string();
            let path = path.trim_end_matches(['?', '.']).to_owned();
            (path, error.into_inner())
        }
    };
    let count = error.is_syntax().then(|| too_long(text, &path)).flatten();
    let (found, expected) = match count {
        Some(count) => (format!("{count} values"), Some("fewer".to_owned())),
        None => told(&error),
    };
    Err(JsonError {
        line: error.line(),
        column: error.column().max(1),
        path,
        found,
        expected,
    })
}

/// Number of values of the list at a path, if the text is JSON.
///
/// The reader reports a list of too many values as bad syntax.
fn too_long(text: &str, path: &str) -> Option<usize> {
    let json: serde_json::Value = serde_json::from_str(text).ok()?;
    let pointer = path.replace(['.', '['], "/").replace(']', "");
    Some(json.pointer(&format!("/{pointer}"))?.as_array()?.len())
}

/// Found and expected text, from the reader's message.
pub fn told(error: &serde_json::Error) -> (String, Option<String>) {
    let said = error.to_string();
    let said = said.split(" at line ").next().unwrap_or_default();
    match error.classify() {
        Category::Eof => ("the text ends too early".to_owned(), None),
        Category::Syntax | Category::Io => (format!("no JSON ({})", said.replace('`', "'")), None),
        Category::Data => in_words(said),
    }
}

/// Found and expected text, from serde's message about a value.
pub fn in_words(said: &str) -> (String, Option<String>) {
    let mut cuts = [", expected ", ", there are "].into_iter();
    match cuts.find_map(|between| said.rsplit_once(between)) {
        Some((there, wanted)) => (found(there), Some(expected(wanted))),
        None => (found(said), None),
    }
}

fn found(said: &str) -> String {
    let quoted = |text: &str| {
        let text = plain(text.trim_matches(['`', '"']));
        match text.char_indices().nth(60) {
            Some((end, _)) => format!("'{}...'", &text[..end]),
            None => format!("'{text}'"),
        }
    };
    let value = |text: &str| match text.split_once([' ', '`', '"']) {
        _ if text == "map" => "an object".to_owned(),
        _ if text == "sequence" => "a list".to_owned(),
        Some(("string", text)) => format!("the text {}", quoted(text)),
        Some(("integer" | "boolean" | "character", text)) => quoted(text),
        Some(("floating", text)) => quoted(text.trim_start_matches("point ")),
        _ => text.to_owned(),
    };
    for (begin, before, behind) in [
        ("unknown variant ", "", ""),
        ("unknown field ", "a field ", ""),
        ("missing field ", "no field ", ""),
        ("duplicate field ", "the field ", " twice"),
    ] {
        if let Some(name) = said.strip_prefix(begin) {
            return format!("{before}{}{behind}", quoted(name));
        }
    }
    if let Some(count) = said.strip_prefix("invalid length ") {
        return format!("{count} values");
    }
    let of_value = said.strip_prefix("invalid type: ");
    let of_value = of_value.or(said.strip_prefix("invalid value: "));
    of_value.map_or_else(|| plain(said), value)
}

fn expected(said: &str) -> String {
    let length = || said.split(' ').find_map(|word| word.parse::<usize>().ok());
    let words = match said {
        "u8" => "a whole number from 0 to 255",
        "u16" => "a whole number from 0 to 65535",
        "u32" => "a whole number from 0 to 4294967295",
        "u64" | "usize" => "a whole number of at least 0",
        "i8" | "i16" | "i32" | "i64" | "isize" => "a whole number",
        "f32" | "f64" => "a number",
        "a boolean" => "true or false",
        "a string" | "a borrowed string" => "a text",
        "string or map" => "a text or an object",
        "a map" => "an object",
        "a sequence" => "a list",
        "unit" => "null",
        "fields" | "no fields" => "none",
        _ if said.starts_with("internally tagged enum ") => "an object",
        _ if said.starts_with("struct ") => "an object",
        _ => {
            let is_list = ["a tuple of size ", "an array of length ", "tuple struct "];
            let is_list = is_list.iter().any(|begin| said.starts_with(begin));
            return match length().filter(|_| is_list) {
                Some(length) => format!("a list of {length} values"),
                None => said.replace('`', "'"),
            };
        }
    };
    words.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Deserialize, Debug)]
    #[serde(tag = "kind", rename_all = "snake_case")]
    #[expect(dead_code, reason = "read, and never looked at")]
    enum Tagged {
        One { count: u32, pair: [f64; 2] },
    }

    #[derive(Deserialize, Debug)]
    #[serde(deny_unknown_fields)]
    #[expect(dead_code, reason = "read, and never looked at")]
    struct Whole {
        count: u32,
        #[serde(default)]
        pair: (f64, f64),
        #[serde(default)]
        names: Vec<String>,
        #[serde(default)]
        tagged: Option<Tagged>,
    }

    #[test]
    fn no_word_of_the_reader_is_left() {
        for (text, wanted) in [
            (
                "{\"count\": -1}",
                "line 1, column 12, count: '-1'; expected JSON, here a whole number from 0 to \
                 4294967295",
            ),
            ("{\"count\": {}}", "count: an object; "),
            ("{\"count\": 1.5}", "count: '1.5'; "),
            ("{\"count\": [1]}", "count: a list; "),
            ("{\"count\": null}", "count: null; "),
            ("{\"count\": true}", "count: 'true'; "),
            (
                "{\"count\":\n \"a, expected b\"}",
                "count: the text 'a, expected b'; ",
            ),
            (
                "{\"count\": 1, \"pair\": [1]}",
                "pair: 1 values; expected JSON, here a list of 2",
            ),
            (
                "{\"count\": 1, \"names\": [\"a\", 7]}",
                "names[1]: '7'; expected JSON, here a text",
            ),
            (
                "{\"count\": 1, \"names\": 7}",
                "names: '7'; expected JSON, here a list",
            ),
            ("{\"count\": 1, \"count\": 2}", "the field 'count' twice"),
            (
                "{\"cuont\": 1}",
                "a field 'cuont'; expected JSON, here one of 'count', 'pair'",
            ),
            ("{}", "no field 'count'; expected JSON"),
            ("[]", "0 values; expected JSON, here an object"),
            ("7", "line 1, column 1: '7'; expected JSON, here an object"),
            (
                "{\"count\": 1, \"tagged\": 7}",
                "tagged: '7'; expected JSON, here an object",
            ),
            (
                "{\"count\": 1, \"tagged\": {\"kind\": \"two\"}}",
                "'two'; expected JSON, here 'one'",
            ),
            (
                "{\"count\": 1} 2",
                "line 1, column 14: no JSON (trailing characters)",
            ),
            (
                "{\"count\": 1, \"pair\": [1, 2, 3]}",
                "pair: 3 values; expected JSON, here fewer",
            ),
            ("{\"count\" 1}", "no JSON (expected ':')"),
            (
                "{\"count\":\n",
                "line 2, column 1, count: the text ends too early",
            ),
            ("", "line 1, column 1: the text ends too early"),
            ("{\"pair\": [1,", "column 12, pair: the text ends too early"),
        ] {
            let error = from_json::<Whole>(text.as_bytes()).unwrap_err().to_string();
            assert!(error.contains(wanted), "{text}: {error}");
            for word in [
                "u32", "map", "sequence", "invalid", "struct", "enum", "`", "\n",
            ] {
                assert!(!error.contains(word), "{text}: {error}");
            }
            assert_eq!(error.matches("line ").count(), 1, "{error}");
        }
        let error = from_json::<Whole>(b"{\n \"a\": \"\xff\"}")
            .unwrap_err()
            .to_string();
        assert!(error.starts_with("line 2, column 8: byte 0xff"), "{error}");
    }

    #[test]
    fn a_byte_order_mark_is_skipped() {
        let found: Whole = from_json(b"\xef\xbb\xbf{\"count\": 3}").unwrap();
        assert_eq!(found.count, 3);
    }
}
