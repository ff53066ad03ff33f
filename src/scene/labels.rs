//! Further columns of a boxes file, kept as labels: texts and a number per item.
//!
//! Each of a few distinct texts is stored once. If there are many, such as names and ids, further
//! ones are not looked up.

use std::cmp::Reverse;
use std::collections::{BTreeMap, HashMap};

/// Most texts that are looked up.
const MOST_KNOWN: usize = 4096;

/// One labelled column, such as `kind`.
#[derive(Clone, Default, Debug)]
pub struct Labels {
    /// Name of the column.
    pub column: String,
    /// The texts, concatenated, and the end of each.
    texts: String,
    ends: Vec<usize>,
    /// Numbers of the texts that are looked up.
    numbers: HashMap<Box<str>, u32>,
    of_item: Vec<u32>,
}

impl Labels {
    /// A column without values.
    pub fn new(column: impl Into<String>) -> Self {
        Labels {
            column: column.into(),
            ..Labels::default()
        }
    }

    /// Labels the next item.
    ///
    /// Zero bytes, which no CSV file may contain, become replacement characters.
    pub fn push(&mut self, value: &str) {
        let known = self.numbers.get(value).copied();
        let number = known.unwrap_or_else(|| {
            let number = self.ends.len() as u32;
            self.texts += &value.replace('\0', "\u{fffd}");
            self.ends.push(self.texts.len());
            if self.numbers.len() < MOST_KNOWN {
                self.numbers.insert(value.into(), number);
            }
            number
        });
        self.of_item.push(number);
    }

    /// The labels of some of the items, which may repeat.
    pub fn of(&self, items: &[u32]) -> Labels {
        let number = |&item: &u32| self.of_item[item as usize];
        Labels {
            of_item: items.iter().map(number).collect(),
            ..self.clone()
        }
    }

    fn text(&self, number: usize) -> &str {
        let start = number.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.texts[start..self.ends[number]]
    }

    /// The label of an item; empty if it has none.
    pub fn get(&self, item: usize) -> &str {
        let number = self.of_item.get(item);
        number.map_or("", |&number| self.text(number as usize))
    }

    /// Each distinct label with its number of items, most frequent first.
    pub fn histogram(&self) -> Vec<(&str, usize)> {
        let mut rows: BTreeMap<&str, usize> = BTreeMap::new();
        for &number in &self.of_item {
            *rows.entry(self.text(number as usize)).or_default() += 1;
        }
        let mut rows: Vec<(&str, usize)> = rows.into_iter().collect();
        rows.sort_by_key(|(_, count)| Reverse(*count));
        rows
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_kept_per_item_and_counted() {
        let mut kind = Labels::new("kind");
        for value in ["tree", "road", "tree"] {
            kind.push(value);
        }
        assert_eq!((kind.get(1), kind.get(9)), ("road", ""));
        assert_eq!(kind.histogram(), [("tree", 2), ("road", 1)]);
        let trees = kind.of(&[0, 0, 2]);
        assert_eq!(
            (trees.get(1), trees.histogram()),
            ("tree", vec![("tree", 3)])
        );
    }

    #[test]
    fn many_distinct_labels_are_counted_alike_and_have_no_zero_bytes() {
        let mut id = Labels::new("id");
        let count = 2 * MOST_KNOWN;
        (0..count).for_each(|i| id.push(&i.to_string()));
        for value in ["a\0b", "8000"] {
            id.push(value);
        }
        let own = [id.get(count - 1), id.get(count), id.get(count + 1)];
        assert_eq!(own, ["8191", "a\u{fffd}b", "8000"]);
        let histogram = id.histogram();
        assert_eq!(histogram.len(), count + 1);
        assert_eq!(histogram[..2], [("8000", 2), ("0", 1)]);
    }
}
