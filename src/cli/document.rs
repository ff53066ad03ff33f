//! A document of headings, lines and tables, written as Markdown, as one HTML page
//! or for a terminal, and the escaping of each.

use std::io::{self, Write};

use super::figure::Figure;
use super::table::Table;
use super::text::{self, html};

pub enum Block {
    /// A heading of the first, second or third level.
    Heading(u8, String),
    Line(String),
    Table(Table),
    /// A table of numbers that HTML shades row by row.
    Heat(Table),
    /// A picture as SVG, which only HTML can hold, as can a figure.
    Picture(String),
    Figure(Figure),
}

impl Block {
    pub fn line(text: impl Into<String>) -> Block {
        Block::Line(text.into())
    }

    /// A heading of the second level.
    pub fn heading(text: impl Into<String>) -> Block {
        Block::Heading(2, text.into())
    }

    /// A table below a heading of the second level.
    pub fn section(heading: impl Into<String>, table: Table) -> [Block; 2] {
        [Block::heading(heading), Block::Table(table)]
    }

    /// Sentence on what another option shows, below a gap; nothing if `all` is shown.
    pub fn more(all: bool, option: &str) -> impl Iterator<Item = Block> {
        let lines = ["", option].map(Block::line).into_iter();
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

/// A table that scrolls inside itself.
///
/// A row of a structure has its name as `data-s`; `is_heat` shades each number by its share of the largest of its row.
fn html_table(table: &Table, heading: &str, is_heat: bool) -> String {
    // Tables below one heading differ in their first column.
    let caption = text::joined([heading, table.header.first().map_or("", String::as_str)]);
    let head = table.header.iter().zip(&table.right).map(|(name, right)| {
        let class = if *right { " class=\"n\"" } else { "" };
        format!("<th scope=\"col\"{class}>{}</th>", html(name))
    });
    let of_structures = table.header.first().is_some_and(|name| name == "structure");
    let row = |row: &Vec<String>| {
        // Without the mark of the fastest.
        let number = |cell: &String| {
            let digits = cell.trim_start_matches('*').replace(',', "");
            digits.parse::<f64>().ok()
        };
        let most = row.iter().filter_map(number).fold(0.0, f64::max);
        let cells = row.iter().enumerate().map(|(column, cell)| {
            let shade = text::some(number(cell).filter(|_| is_heat), |value| {
                let shade = 1.0 - (most / value).log2() / 3.0;
                format!(" style=\"--v:{:.2}\"", shade.clamp(0.0, 1.0))
            });
            let text = html(cell);
            match column {
                0 => format!("<th scope=\"row\">{text}</th>"),
                n if table.right[n] => format!("<td class=\"n\"{shade}>{text}</td>"),
                _ => format!("<td>{text}</td>"),
            }
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

/// Text of a line, with an escape before every mark of Markdown. A line break would
/// end a table row.
fn markdown(text: &str) -> String {
    let marks = ['\\', '|', '`', '*', '_', '<', '[', '&'];
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

/// A text of Markdown folded behind a line, as GitHub and GitLab show it.
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

/// The document as one page that needs no other file.
pub fn to_html(title: &str, blocks: &[Block]) -> String {
    let mut caption = title;
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
    let body = format!("<main>\n{}</main>\n", parts.collect::<String>());
    page(title, "", &body, include_str!("assets/page.js"))
}

/// A page that needs no other file, in the style of all pages.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_stays_text_in_every_format() {
        let nasty = "a|b<script>\n`c` & \"d\"\u{202e}";
        let mut table = Table::of_numbers(["x", nasty]);
        table.add_row([nasty, "1"]);
        let blocks = [
            Block::Heading(2, nasty.to_owned()),
            Block::Table(table),
            Block::Picture("<svg></svg>".into()),
        ];
        let text = to_markdown(&blocks);
        let plain = "a\\|b\\<script> \\`c\\` \\& \"d\"\\\\u{202e}";
        assert_eq!(
            text,
            format!("## {plain}\n\n| x | {plain} |\n|---|---:|\n| {plain} | 1 |\n")
        );
        let page = to_html(nasty, &blocks);
        assert!(
            !page.contains("b<script>") && page.contains("<svg></svg>"),
            "{page}"
        );
        let cell = "<th scope=\"row\">a|b&lt;script&gt; `c` &amp; &quot;d&quot;\\u{202e}</th><td \
                    class=\"n\">1</td>";
        assert!(page.contains(cell), "{page}");
    }
}
