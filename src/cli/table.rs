//! A table as rows and columns, and its form on a terminal.

use std::fmt;

use comfy_table::presets::UTF8_BORDERS_ONLY;
use comfy_table::{CellAlignment, ColumnConstraint, ContentArrangement};

use super::text::plain;

/// Blanks between the columns of a bare table.
const GAP: usize = 2;

/// A column of rows `R`: its head, with `>` before that of numbers, and its cell of
/// a row.
pub type Column<R> = (&'static str, fn(&R) -> String);

/// A table whose cells may hold any text. Columns in `right` hold numbers.
pub struct Table {
    pub header: Vec<String>,
    pub right: Vec<usize>,
    pub rows: Vec<Vec<String>>,
    /// Columns of the terminal, where the table is to fit into them.
    width: Option<u16>,
}

impl Table {
    pub fn new(header: impl IntoIterator<Item = impl Into<String>>, right: &[usize]) -> Table {
        Table {
            header: header.into_iter().map(Into::into).collect(),
            right: right.to_vec(),
            rows: Vec::new(),
            width: None,
        }
    }

    /// A table of heads with bars between them and `>` before those of numbers:
    /// "structure | > query | > build | status".
    pub fn of(columns: &str) -> Table {
        let mut table = Table::new(columns.split('|').map(str::trim), &[]);
        for (n, name) in table.header.iter_mut().enumerate() {
            if let Some(bare) = name.strip_prefix('>') {
                table.right.push(n);
                *name = bare.trim_start().to_owned();
            }
        }
        table
    }

    /// A row per item.
    pub fn with<R>(rows: impl IntoIterator<Item = R>, columns: &[Column<R>]) -> Table {
        let heads: Vec<&str> = columns.iter().map(|column| column.0).collect();
        let mut table = Table::of(&heads.join("|"));
        for row in rows {
            table.add_row(columns.iter().map(|(_, cell)| cell(&row)));
        }
        table
    }

    /// The first column holds names, all others numbers.
    pub fn of_numbers(header: impl IntoIterator<Item = impl Into<String>>) -> Table {
        let mut table = Table::new(header, &[]);
        table.right = (1..table.header.len()).collect();
        table
    }

    pub fn add_row(&mut self, row: impl IntoIterator<Item = impl Into<String>>) {
        self.rows.push(row.into_iter().map(Into::into).collect());
    }

    /// Limits the width: columns move together, and if that is not enough, long cells
    /// are broken into lines. Names, in the first column, stay whole.
    pub fn fit(mut self, width: u16) -> Table {
        self.width = Some(width);
        self
    }

    /// The table without columns that do not fit, for [`Table::bare`].
    ///
    /// The named ones go, in this order, until `width` characters hold a row.
    pub fn within(&self, width: usize, first_to_go: &[&str]) -> Table {
        let (widths, mut gone) = (self.widths(), first_to_go.iter());
        let mut left: Vec<usize> = (0..widths.len()).collect();
        while left.iter().map(|&c| widths[c] + GAP).sum::<usize>() > width + GAP {
            let Some(name) = gone.next() else { break };
            left.retain(|&column| self.header[column] != *name);
        }
        self.of_columns(&left)
    }

    /// The table as tables of at most `width` characters, for [`Table::bare`]: each has
    /// the names, which stand before the first numbers, and as many further columns as
    /// fit, at least one.
    pub fn parts(&self, width: usize) -> Vec<Table> {
        let widths = self.widths();
        let names = self.right.iter().min().map_or(1, |first| *first.max(&1));
        let name_width: usize = widths.iter().take(names).map(|own| own + GAP).sum();
        let (mut parts, mut left) = (Vec::<Vec<usize>>::new(), 0);
        for (column, own) in widths.iter().enumerate().skip(names) {
            match parts.last_mut() {
                Some(part) if GAP + own <= left => {
                    part.push(column);
                    left -= GAP + own;
                }
                _ => {
                    parts.push((0..names).chain([column]).collect());
                    left = width.saturating_sub(name_width + own);
                }
            }
        }
        parts
            .iter()
            .map(|columns| self.of_columns(columns))
            .collect()
    }

    fn of_columns(&self, columns: &[usize]) -> Table {
        let chosen = |row: &Vec<String>| columns.iter().map(|&c| row[c].clone()).collect();
        let is_right = |&place: &usize| self.right.contains(&columns[place]);
        Table {
            header: chosen(&self.header),
            right: (0..columns.len()).filter(is_right).collect(),
            rows: self.rows.iter().map(chosen).collect(),
            width: self.width,
        }
    }

    /// The widest cell of each column, in characters.
    fn widths(&self) -> Vec<usize> {
        let rows = || std::iter::once(&self.header).chain(&self.rows);
        let width = |column: usize| rows().map(move |row| plain(&row[column]).chars().count());
        let columns = 0..self.header.len();
        columns.map(|c| width(c).max().unwrap_or(0)).collect()
    }

    /// The table without borders, a line per row.
    pub fn bare(&self) -> String {
        let widths = self.widths();
        let mut text = String::new();
        for row in std::iter::once(&self.header).chain(&self.rows) {
            let mut line = String::new();
            for (column, (cell, width)) in row.iter().zip(&widths).enumerate() {
                let (cell, gap) = (plain(cell), if column > 0 { GAP } else { 0 });
                line += &" ".repeat(gap);
                line += &match self.right.contains(&column) {
                    true => format!("{cell:>width$}"),
                    false => format!("{cell:<width$}"),
                };
            }
            text += line.trim_end();
            text.push('\n');
        }
        text
    }

    /// The table without the columns that are empty in every row.
    pub fn without_empty_columns(mut self) -> Table {
        for column in (0..self.header.len()).rev() {
            if self.rows.iter().all(|row| row[column].is_empty()) {
                self.header.remove(column);
                self.right.retain(|&right| right != column);
                let after = self.right.iter_mut().filter(|right| **right > column);
                after.for_each(|right| *right -= 1);
                self.rows
                    .iter_mut()
                    .for_each(|row| drop(row.remove(column)));
            }
        }
        self
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let mut table = comfy_table::Table::new();
        table
            .load_style(UTF8_BORDERS_ONLY)
            .set_content_arrangement(ContentArrangement::Disabled)
            .set_header(self.header.iter().map(|name| plain(name)));
        for &column in &self.right {
            if let Some(column) = table.column_mut(column) {
                column.set_cell_alignment(CellAlignment::Right);
            }
        }
        for row in &self.rows {
            table.add_row(row.iter().map(|cell| plain(cell)));
        }
        let wide = table.to_string();
        let is_within = |width: u16| {
            let mut lines = wide.lines();
            lines.all(|line| line.chars().count() <= usize::from(width))
        };
        let Some(width) = self.width.filter(|width| !is_within(*width)) else {
            return f.write_str(&wide);
        };
        table
            .set_content_arrangement(ContentArrangement::Dynamic)
            .set_width(width);
        for (place, column) in table.column_iter_mut().enumerate() {
            match place {
                0 => column.set_constraint(ColumnConstraint::ContentWidth),
                _ => column.set_padding((0, 1)),
            };
        }
        table.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_nothing_are_left_out() {
        let mut table = Table::of("name | >none | >some");
        table.add_row(["a", "", ""]);
        table.add_row(["b", "", "7"]);
        assert_eq!(
            (&table.right[..], table.header[1].as_str()),
            (&[1, 2][..], "none")
        );
        let kept = table.without_empty_columns();
        assert_eq!(kept.header, ["name", "some"]);
        assert_eq!(kept.right, [1]);
        assert_eq!(kept.rows, [["a", ""], ["b", "7"]]);
    }

    #[test]
    fn columns_go_in_their_order_until_the_rest_fits() {
        let mut table = Table::of("name | >p95 | >time | note");
        table.add_row(["wide", "9 us", "7 us", "of 12"]);
        let within = |width| table.within(width, &["note", "p95"]).bare();
        assert_eq!(
            within(23),
            "name   p95  time  note\nwide  9 us  7 us  of 12\n"
        );
        assert_eq!(within(22), "name   p95  time\nwide  9 us  7 us\n");
        assert_eq!(within(12), "name  time\nwide  7 us\n");
        assert_eq!(within(1), within(12));
    }

    #[test]
    fn bare_tables_fit_by_leaving_columns_to_the_next_part() {
        let mut table = Table::of("name | >one | two | >three");
        table.add_row(["a", "1.5", "x", "33333333"]);
        assert_eq!(
            table.bare(),
            "name  one  two     three\na     1.5  x    33333333\n"
        );
        let parts = |width: usize| {
            let parts = table.parts(width);
            parts.iter().map(Table::bare).collect::<Vec<_>>()
        };
        assert_eq!(parts(24), [table.bare()]);
        let (first, rest) = ("name  one  two\na     1.5  x\n", "name     three\n");
        assert_eq!(parts(23), [first, &format!("{rest}a     33333333\n")]);
        assert_eq!(parts(0).len(), 3);
    }
}
