//! Further columns of a boxes file, kept as labels: each distinct text once
//! and a number per item.

use std::collections::HashMap;

/// One labelled column, such as `kind`.
#[derive(Clone, Default, Debug)]
pub struct Labels {
    /// Name of the column.
    pub column: String,
    values: Vec<String>,
    numbers: HashMap<String, u32>,
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
    pub fn push(&mut self, value: &str) {
        let known = self.numbers.get(value).copied();
        let number = known.unwrap_or_else(|| {
            let number = self.values.len() as u32;
            self.values.push(value.to_owned());
            self.numbers.insert(value.to_owned(), number);
            number
        });
        self.of_item.push(number);
    }

    /// The label of an item; empty if it has none.
    pub fn get(&self, item: usize) -> &str {
        let number = self.of_item.get(item);
        number.map_or("", |&number| &self.values[number as usize])
    }

    /// Each distinct label with its number of items, most frequent first.
    pub fn histogram(&self) -> Vec<(&str, usize)> {
        let mut counts = vec![0; self.values.len()];
        for &number in &self.of_item {
            counts[number as usize] += 1;
        }
        let mut rows: Vec<_> = self.values.iter().map(String::as_str).zip(counts).collect();
        rows.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(b.0)));
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
    }
}
