//! The little language of the command line: `name:key=value,key=value`.
//!
//! A scene family, a camera path or a structure with its parameters. Defines the syntax, numbers
//! such as `100k` or `2%`, and the nearest suggestion for a misspelt word; the meaning of words is
//! defined by their users.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::RangeInclusive;

use crate::shown::plain;

pub(crate) mod values;

/// A name with its parameters, as typed.
#[derive(Clone, Debug)]
pub struct Spec {
    name: String,
    given: BTreeMap<String, String>,
    known: Vec<&'static str>,
}

/// Error in a spec, in one line.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
#[error("{}", plain(.0))]
pub struct SpecError(String);

impl SpecError {
    /// An error with this text.
    pub fn new(message: impl fmt::Display) -> Self {
        SpecError(message.to_string())
    }

    /// "unknown structure 'bhv'; did you mean 'bvh'? (known: ...)".
    pub fn unknown<'a>(
        what: &str,
        word: &str,
        known: impl IntoIterator<Item = &'a str> + Clone,
    ) -> Self {
        let all = known.clone().into_iter().collect::<Vec<_>>().join(", ");
        let hint = match nearest(word, known) {
            Some(guess) => format!("; did you mean '{guess}'? (known: {all})"),
            None if all.is_empty() => "; expected none".to_owned(),
            None => format!(" (known: {all})"),
        };
        SpecError(format!("unknown {what} '{word}'{hint}"))
    }
}

/// The known word most similar to `word`, if any is similar enough.
pub fn nearest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let word = word.to_lowercase();
    let alike = known.into_iter().map(|k| (likeness(&word, k), k));
    let alike = alike.filter(|(score, _)| *score > 0.6);
    Some(alike.max_by(|a, b| a.0.total_cmp(&b.0))?.1)
}

/// Similarity of two words; 1 if equal.
///
/// Swapped and missing letters count little (Damerau), and so does a missing ending (Jaro and
/// Winkler).
fn likeness(word: &str, known: &str) -> f64 {
    let edits = strsim::normalized_damerau_levenshtein(word, known);
    let prefix = strsim::jaro_winkler(word, known) - 0.2;
    edits.max(if word.len() > 2 { prefix } else { 0.0 })
}

/// A number with an optional suffix: `250`, `1e6`, `100k`, `10M`, `2%`, `1_000`.
pub fn parse_number(text: &str) -> Option<f64> {
    let plain = text.trim().replace('_', "");
    let (digits, exponent) = match plain.char_indices().next_back()? {
        (at, 'k') => (&plain[..at], "e3"),
        (at, 'M') => (&plain[..at], "e6"),
        (at, '%') => (&plain[..at], "e-2"),
        _ => (plain.as_str(), ""),
    };
    // In one rounding: 2.01 times a thousand is not exactly 2,010.
    let value = format!("{digits}{exponent}").parse::<f64>().ok()?;
    value.is_finite().then_some(value)
}

impl Spec {
    /// Splits `name:key=value,...`. The name may stand alone.
    pub fn parse(text: &str) -> Result<Spec, SpecError> {
        Spec::parse_behind("", text)
    }

    /// [`Spec::parse`] for names with an optional `prefix`, which may contain a `:`.
    ///
    /// Such as `mesh:statue:n=1M`.
    pub fn parse_behind(prefix: &str, text: &str) -> Result<Spec, SpecError> {
        let begun = text.strip_prefix(prefix).map_or(0, |_| prefix.len());
        let end = text[begun..].find(':').map_or(text.len(), |at| begun + at);
        let (name, rest) = (&text[..end], text.get(end + 1..).unwrap_or_default());
        let mut given = BTreeMap::new();
        let bad = |found: String| SpecError(format!("in '{text}': {found}"));
        for pair in rest.split(',').filter(|p| !p.trim().is_empty()) {
            let Some((key, value)) = pair.split_once('=') else {
                return Err(bad(format!("'{pair}'; expected key=value")));
            };
            let (key, value) = (key.trim().to_owned(), value.trim().to_owned());
            if given.insert(key.clone(), value).is_some() {
                return Err(bad(format!("'{key}' is given twice; expected it once")));
            }
        }
        Ok(Spec {
            name: name.trim().to_owned(),
            given,
            known: Vec::new(),
        })
    }

    /// Splits a comma-separated list of specs whose parameters use commas as well.
    ///
    /// `bvh:leaf=4,preset=fast,linear` is two specs: a bare `key=value` belongs to the spec before
    /// it.
    pub fn split_list(text: &str) -> Vec<String> {
        let mut specs: Vec<String> = Vec::new();
        for part in text.split(',').map(str::trim).filter(|p| !p.is_empty()) {
            match specs.last_mut() {
                Some(last) if part.contains('=') && !part.contains(':') => {
                    last.push(if last.contains(':') { ',' } else { ':' });
                    last.push_str(part);
                }
                _ => specs.push(part.to_owned()),
            }
        }
        specs
    }

    /// The text before the first `:`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// All parameters as typed, for users that check them themselves.
    pub fn given(&self) -> impl Iterator<Item = (&str, &str)> {
        self.given.iter().map(|(k, v)| (k.as_str(), v.as_str()))
    }

    /// A text parameter, if given.
    pub fn text(&mut self, key: &'static str) -> Option<String> {
        if !self.known.contains(&key) {
            self.known.push(key);
        }
        self.given.get(key).cloned()
    }

    /// A finite number, or the default.
    pub fn number(&mut self, key: &'static str, default: f64) -> Result<f64, SpecError> {
        match self.text(key) {
            None => Ok(default),
            Some(text) => parse_number(&text).ok_or_else(|| self.bad(key, &text, "a number")),
        }
    }

    /// A number in the open interval `(low, high)`, or the default.
    pub fn number_between(
        &mut self,
        key: &'static str,
        default: f64,
        low: f64,
        high: f64,
    ) -> Result<f64, SpecError> {
        let value = self.number(key, default)?;
        if value > low && value < high {
            return Ok(value);
        }
        let wanted = match high.is_finite() {
            true => format!("a number above {low} and below {high}"),
            false => format!("a number above {low}"),
        };
        // A default can be out of range too, without having been typed.
        let found = self.text(key).unwrap_or_else(|| format!("{value:?}"));
        Err(self.bad(key, &found, &wanted))
    }

    /// A whole number in a range, or the default.
    pub fn whole(
        &mut self,
        key: &'static str,
        default: u64,
        range: RangeInclusive<u64>,
    ) -> Result<u64, SpecError> {
        let Some(text) = self.text(key) else {
            return Ok(default);
        };
        // Plain digits first: a 64-bit seed does not fit an f64.
        let exact = text.replace('_', "").parse::<u64>().ok();
        // Not a share: 200 % is not two items.
        let is_part = text.ends_with('%');
        let is_whole = |v: &f64| !is_part && v.fract() == 0.0 && (0.0..9e15).contains(v);
        let rounded = parse_number(&text).filter(is_whole).map(|v| v as u64);
        let sound = exact.or(rounded).filter(|v| range.contains(v));
        sound.ok_or_else(|| {
            let (least, most) = (range.start(), range.end());
            let expected = format!("a whole number from {least} to {most}");
            self.bad(key, &text, &expected)
        })
    }

    /// Refuses parameters that were not read; call it last.
    pub fn finish(&self) -> Result<(), SpecError> {
        let known = self.known.iter().copied();
        let what = format!("parameter of '{}':", self.name);
        let is_unknown = |key: &&String| !self.known.contains(&key.as_str());
        let unknown = self.given.keys().find(is_unknown);
        unknown.map_or(Ok(()), |key| Err(SpecError::unknown(&what, key, known)))
    }

    fn bad(&self, key: &str, found: &str, expected: &str) -> SpecError {
        let name = &self.name;
        SpecError(format!(
            "in '{name}': {key} is '{found}'; expected {expected}"
        ))
    }
}

#[cfg(test)]
pub(crate) mod tests;
