//! A document of headings, lines and tables, as Markdown, HTML or terminal text.
//!
//! With the escaping of each format; tables as rows and columns.

use std::fmt::Display;
use std::io::{self, Write};

use console::{Alignment, pad_str};

use super::figure::Figure;
use super::text::{self, across, html, plain, wrapped};
use crate::report::{grouped, unique};

pub enum Block {
    /// A heading of the first, second or third level.
    Heading(u8, String),
    Line(String),
    Table(Table),
    /// A table of numbers that HTML shades row by row.
    Heat(Table),
    /// A picture as SVG; like a figure, only HTML can contain it.
    Picture(String),
    Figure(Figure),
}

impl Block {
    pub fn line(text: impl Into<String>) -> Block {
        Block::Line(text.into())
    }

    /// A line for each warning.
    pub fn warnings(all: impl IntoIterator<Item = impl Display>) -> impl Iterator<Item = Block> {
        let all = all.into_iter();
        all.map(|said| Block::Line(format!("Warning: {said}")))
    }

    /// A heading of the second level.
    pub fn heading(text: impl Into<String>) -> Block {
        Block::Heading(2, text.into())
    }

    /// A table below a heading of the second level.
    pub fn section(heading: impl Into<String>, table: Table) -> [Block; 2] {
        [Block::heading(heading), Block::Table(table)]
    }

    /// A sentence below a gap, such as about another option; empty if `all`.
    pub fn more(all: bool, sentence: &str) -> impl Iterator<Item = Block> {
        let lines = ["", sentence].map(Block::line).into_iter();
        lines.filter(move |_| !all)
    }
}

fn markdown_table(table: &Table) -> String {
    let line = |cells: &Vec<String>| {
        let cells: Vec<String> = cells.iter().map(|cell| markdown(cell)).collect();
        format!("| {} |\n", cells.join(" | "))
    };
    let rule = table.right.iter();
    let rule = rule.map(|right| ["---|", "---:|"][usize::from(*right)]);
    let rule = format!("|{}\n", rule.collect::<String>());
    line(&table.header) + &rule + &table.rows.iter().map(line).collect::<String>()
}

/// A table with its own scroll bar.
///
/// A row of a structure has its name as `data-s`; the page shades numbers if `is_heat`.
fn html_table(table: &Table, heading: &str, is_heat: bool) -> String {
    // Tables below one heading differ in their first column.
    let caption = text::joined([heading, table.header.first().map_or("", String::as_str)]);
    let head = table.header.iter().zip(&table.right).map(|(name, right)| {
        let class = if *right { " class=\"n\"" } else { "" };
        format!("<th scope=\"col\"{class}>{}</th>", html(name))
    });
    let of_structures = table.header.first().is_some_and(|name| name == "structure");
    let row = |row: &Vec<String>| {
        let cells = row.iter().map(|cell| html(cell)).enumerate();
        let cells = cells.map(|cell| match cell {
            (0, text) => format!("<th scope=\"row\">{text}</th>"),
            (n, text) if table.right[n] => format!("<td class=\"n\">{text}</td>"),
            (_, text) => format!("<td>{text}</td>"),
        });
        let own = row.first().filter(|_| of_structures);
        let own = text::some(own, |name| format!(" data-s=\"{}\"", html(name)));
        format!("<tr{own}>{}</tr>\n", cells.collect::<String>())
    };
    format!(
        "<div class=\"t\" tabindex=\"0\"><table{}><caption>{}</caption>\n<thead><tr>{}</tr></thead>\n\
         <tbody>\n{}</tbody></table></div>\n",
        if is_heat { " class=\"heat\"" } else { "" },
        html(&caption),
        head.collect::<String>(),
        table.rows.iter().map(row).collect::<String>()
    )
}

/// Text of a line, with every Markdown character escaped.
///
/// A line break would end a table row.
fn markdown(text: &str) -> String {
    let marks = ['\\', '|', '`', '*', '_', '<', '[', '&', '~'];
    let text = text::plain(text);
    let escape = |c: char| marks.contains(&c).then_some('\\').into_iter().chain([c]);
    text.chars().flat_map(escape).collect()
}

/// The document as Markdown.
pub fn to_markdown(blocks: &[Block]) -> String {
    let parts = blocks.iter().filter_map(|block| match block {
        Block::Heading(level, text) => {
            let marks = "#".repeat(usize::from(*level));
            Some(format!("{marks} {}\n", markdown(text)))
        }
        Block::Line(text) => Some(markdown(text) + "\n"),
        Block::Table(rows) | Block::Heat(rows) => Some(markdown_table(rows)),
        Block::Picture(_) | Block::Figure(_) => None,
    });
    parts.collect::<Vec<_>>().join("\n")
}

/// Markdown text collapsed under a line, as on GitHub and GitLab.
pub fn folded(line: &str, text: &str) -> String {
    let line = html(line);
    format!("<details>\n<summary>{line}</summary>\n\n{text}\n</details>\n")
}

/// The document for a terminal of `width` columns.
pub fn to_terminal(blocks: &[Block], width: usize) -> String {
    let parts = blocks.iter().map(|block| match block {
        Block::Heading(level, text) => {
            let gap = if *level > 1 { "\n" } else { "" };
            format!("{gap}{}\n", text::wrapped(&text::plain(text), width))
        }
        Block::Line(text) => text::wrapped(&text::plain(text), width) + "\n",
        Block::Table(table) | Block::Heat(table) => format!("\n{}", table.fitted(width)),
        Block::Picture(_) | Block::Figure(_) => String::new(),
    });
    parts.collect()
}

/// Shows the document on standard output.
pub fn show(blocks: &[Block]) -> io::Result<()> {
    let text = to_terminal(blocks, text::width());
    io::stdout().lock().write_all(text.as_bytes())
}

/// The document as one self-contained page.
pub fn to_html(title: &str, blocks: &[Block]) -> String {
    let body = format!("<main>\n{}</main>\n", elements(title, blocks));
    page(title, "", &body, include_str!("assets/page.js"))
}

/// The blocks as HTML; `caption` is for tables above all headings.
pub fn elements<'t>(mut caption: &'t str, blocks: &'t [Block]) -> String {
    let parts = blocks.iter().map(|block| match block {
        Block::Heading(level, text) => {
            caption = text;
            format!("<h{level}>{}</h{level}>\n", html(text))
        }
        Block::Line(text) => format!("<p>{}</p>\n", html(text)),
        Block::Table(rows) => html_table(rows, caption, false),
        Block::Heat(rows) => html_table(rows, caption, true),
        Block::Picture(svg) => format!("<figure>{svg}</figure>\n"),
        Block::Figure(figure) => format!("<figure>{}</figure>\n", figure.inline()),
    });
    parts.collect()
}

/// A self-contained page in the common style.
pub fn page(title: &str, style: &str, body: &str, script: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head><meta charset=\"utf-8\"/><meta \
         name=\"viewport\" content=\"width=device-width\"/><title>{}</title>\n\
         <style>{}{}{}{style}</style></head>\n<body>{body}<script>{script}</script></body>\n</html>\n",
        html(title),
        include_str!("assets/page.css"),
        include_str!("assets/figure.css"),
        include_str!("assets/dark.css"),
    )
}

/// Blanks between columns.
const GAP: usize = 2;
/// Least characters of a line of text in the last column.
const LEAST_TEXT: usize = 20;

/// A column of rows `R`: its header, with `>` before that of numbers, and its cell.
pub type Column<R> = (&'static str, fn(&R) -> String);

/// A table whose cells may contain any text.
pub struct Table {
    pub header: Vec<String>,
    /// For each column, true if its cells are right-aligned numbers.
    pub right: Vec<bool>,
    pub rows: Vec<Vec<String>>,
}

impl Table {
    fn new(header: Vec<String>, right: Vec<bool>) -> Table {
        Table {
            header,
            right,
            rows: Vec::new(),
        }
    }

    /// An empty table from headers with bars between them.
    ///
    /// `>` precedes headers of numbers: "structure | > query | > build | status".
    pub fn of(columns: &str) -> Table {
        let heads: Vec<&str> = columns.split('|').map(str::trim).collect();
        let bare = |head: &&str| head.trim_start_matches('>').trim_start().to_owned();
        let right = heads.iter().map(|head| head.starts_with('>')).collect();
        Table::new(heads.iter().map(bare).collect(), right)
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

    /// A table of cells with the names of their rows and columns, each pair once.
    ///
    /// Names are in the order of their first occurrence; cells are numbers.
    pub fn grid(title: &str, cells: impl IntoIterator<Item = [String; 3]>) -> Table {
        let cells: Vec<[String; 3]> = cells.into_iter().collect();
        let heads = unique(cells.iter().map(|[_, head, _]| head.as_str()));
        let mut table = Table::of_numbers([title].iter().chain(&heads).copied());
        let rows = cells.iter().map(|[name, head, cell]| (name, (head, cell)));
        for (name, own) in grouped(rows) {
            let cell = |head: &&str| {
                let cell = own.iter().find(|cell| cell.0 == head);
                cell.map_or("", |cell| cell.1)
            };
            table.add_row([name.as_str()].into_iter().chain(heads.iter().map(cell)));
        }
        table
    }

    /// The first column has names, all others numbers.
    pub fn of_numbers(header: impl IntoIterator<Item = impl Into<String>>) -> Table {
        let header: Vec<String> = header.into_iter().map(Into::into).collect();
        let right = (0..header.len()).map(|column| column > 0).collect();
        Table::new(header, right)
    }

    pub fn add_row(&mut self, row: impl IntoIterator<Item = impl Into<String>>) {
        let mut row: Vec<String> = row.into_iter().map(Into::into).collect();
        row.resize(self.header.len(), String::new());
        self.rows.push(row);
    }

    /// The table without columns that do not fit, for [`Table::bare`].
    ///
    /// The named ones are dropped, in this order, until a row fits into `width` characters.
    pub fn within(&self, width: usize, first_to_go: &[&str]) -> Table {
        let (widths, mut gone) = (self.widths(), first_to_go.iter());
        let mut left: Vec<usize> = (0..widths.len()).collect();
        while left.iter().map(|&c| widths[c] + GAP).sum::<usize>() > width.saturating_add(GAP) {
            let Some(name) = gone.next() else { break };
            left.retain(|&column| self.header[column] != *name);
        }
        self.of_columns(&left)
    }

    /// Splits a table into tables of at most `width` characters, for [`Table::bare`].
    ///
    /// Each has the name columns, which precede the first numbers, and as many further columns as
    /// fit, at least one.
    pub fn parts(&self, width: usize) -> Vec<Table> {
        let widths = self.widths();
        let names = self.right.iter().position(|right| *right);
        let names = names.map_or(1, |first| first.max(1));
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
        let table = |columns: &Vec<usize>| self.of_columns(columns);
        parts.iter().map(table).collect()
    }

    fn of_columns(&self, columns: &[usize]) -> Table {
        let chosen = |row: &Vec<String>| columns.iter().map(|&c| row[c].clone()).collect();
        Table {
            header: chosen(&self.header),
            right: columns.iter().map(|&c| self.right[c]).collect(),
            rows: self.rows.iter().map(chosen).collect(),
        }
    }

    /// The widest cell of each column, in columns of a terminal.
    fn widths(&self) -> Vec<usize> {
        let rows = || std::iter::once(&self.header).chain(&self.rows);
        let width = |column: usize| rows().map(move |row| across(&plain(&row[column])));
        let columns = 0..self.header.len();
        columns.map(|c| width(c).max().unwrap_or(0)).collect()
    }

    /// The table without borders, a line per row.
    pub fn bare(&self) -> String {
        let widths = self.widths();
        let mut text = String::new();
        for row in std::iter::once(&self.header).chain(&self.rows) {
            let cells = row.iter().zip(&widths).zip(&self.right);
            let cells = cells.map(|((cell, width), right)| {
                let side = [Alignment::Left, Alignment::Right][usize::from(*right)];
                pad_str(&plain(cell), *width, side, None).into_owned()
            });
            text += cells.collect::<Vec<_>>().join(&" ".repeat(GAP)).trim_end();
            text.push('\n');
        }
        text
    }

    /// The table for a terminal: [`Table::parts`] one below the other.
    ///
    /// If wrapping the last column's text suffices, that is done instead.
    pub fn fitted(&self, width: usize) -> String {
        if let Some(table) = self.wrapped_last(width) {
            return table.bare();
        }
        let parts = self.parts(width).into_iter();
        let parts = parts.map(|part| part.wrapped_last(width).unwrap_or(part).bare());
        parts.collect::<Vec<_>>().join("\n")
    }

    /// The table with text in its last column wrapped.
    ///
    /// `None` if that is unnecessary or does not help.
    pub fn wrapped_last(&self, width: usize) -> Option<Table> {
        let widths = self.widths();
        let last = widths.len().checked_sub(1)?;
        let others: usize = widths[..last].iter().map(|own| own + GAP).sum();
        let is_text = !self.right[last];
        if others + widths[last] <= width || others + LEAST_TEXT > width || !is_text {
            return None;
        }
        let room = width - others;
        let mut table = Table::new(self.header.clone(), self.right.clone());
        for row in &self.rows {
            let text: Vec<char> = wrapped(&plain(&row[last]), room).chars().collect();
            // A word may be longer than a line.
            let lines = text.split(|c| *c == '\n');
            let lines = lines.flat_map(|line| line.chunks(room));
            let lines: Vec<String> = lines.map(String::from_iter).collect();
            for n in 0..lines.len().max(1) {
                let own = |cell: &String| if n == 0 { cell.clone() } else { String::new() };
                let line = lines.get(n).cloned().unwrap_or_default();
                table.add_row(row[..last].iter().map(own).chain([line]));
            }
        }
        Some(table)
    }

    /// The table without the columns that are empty in every row.
    pub fn without_empty_columns(&self) -> Table {
        let has_text = |&column: &usize| self.rows.iter().any(|row| !row[column].is_empty());
        let left: Vec<usize> = (0..self.header.len()).filter(has_text).collect();
        self.of_columns(&left)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_stays_text_in_every_format() {
        let nasty = "a|b<script>\n`c` & ~\"d\"\u{202e}";
        let mut table = Table::of_numbers(["x", nasty]);
        table.add_row([nasty, "1"]);
        let blocks = [
            Block::Heading(2, nasty.to_owned()),
            Block::Table(table),
            Block::Picture("<svg></svg>".into()),
        ];
        let text = to_markdown(&blocks);
        let plain = "a\\|b\\<script> \\`c\\` \\& \\~\"d\"\\\\u{202e}";
        assert_eq!(
            text,
            format!("## {plain}\n\n| x | {plain} |\n|---|---:|\n| {plain} | 1 |\n")
        );
        let page = to_html(nasty, &blocks);
        assert!(
            !page.contains("b<script>") && page.contains("<svg></svg>"),
            "{page}"
        );
        let cell = "<th scope=\"row\">a|b&lt;script&gt; `c` &amp; ~&quot;d&quot;\\u{202e}</th><td \
                    class=\"n\">1</td>";
        assert!(page.contains(cell), "{page}");
    }

    #[test]
    fn columns_of_nothing_are_left_out() {
        let mut table = Table::of("name | >none | >some");
        table.add_row(["a", "", ""]);
        table.add_row(["b", "", "7"]);
        assert_eq!(
            (&table.right[..], table.header[1].as_str()),
            (&[false, true, true][..], "none")
        );
        let kept = table.without_empty_columns();
        assert_eq!(kept.header, ["name", "some"]);
        assert_eq!(kept.right, [false, true]);
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

    #[test]
    fn wide_characters_take_two_columns() {
        let mut table = Table::of("name | >one");
        table.add_row(["\u{6f22}\u{5b57}", "1"]);
        table.add_row(["abcd", "2"]);
        assert_eq!(
            table.bare(),
            "name  one\n\u{6f22}\u{5b57}    1\nabcd    2\n"
        );
    }

    #[test]
    fn text_in_the_last_column_is_wrapped_before_columns_move() {
        let mut table = Table::of("name | >time | why");
        table.add_row(["wide", "7 us", "the fastest of all that are right"]);
        table.add_row(["bvh", "9 us", ""]);
        table.add_row(["bsp", "9 us", "0123456789012345678901"]);
        assert_eq!(
            table.fitted(32),
            "name  time  why\nwide  7 us  the fastest of all\n            that are right\nbvh   \
             9 us\nbsp   9 us  01234567890123456789\n            01\n"
        );
        assert_eq!(table.fitted(45), table.bare());
        // Too narrow for text: a separate part.
        assert_eq!(table.fitted(31).matches("name").count(), 2);
    }
}
