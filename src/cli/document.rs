//! A document of headings, lines and tables, written as Markdown, as one HTML page
//! or for a terminal, and the escaping of each.

use super::table::Table;
use super::text;

pub enum Block {
    /// A heading of the first, second or third level.
    Heading(u8, String),
    Line(String),
    Table(Table),
    /// A picture as SVG, which only HTML can hold.
    Picture(String),
}

fn markdown_table(table: &Table) -> String {
    let line = |cells: &[String]| {
        let cells: Vec<String> = cells.iter().map(|cell| markdown(cell)).collect();
        format!("| {} |\n", cells.join(" | "))
    };
    let rule = (0..table.header.len()).map(|column| match table.right.contains(&column) {
        true => "---:|",
        false => "---|",
    });
    let mut out = line(&table.header) + "|" + &rule.collect::<String>() + "\n";
    for row in &table.rows {
        out += &line(row);
    }
    out
}

fn html_table(table: &Table) -> String {
    let line = |tag: &str, cells: &[String]| {
        let cells = cells.iter().enumerate().map(|(column, cell)| {
            let class = match table.right.contains(&column) {
                true => " class=\"n\"",
                false => "",
            };
            format!("<{tag}{class}>{}</{tag}>", html(cell))
        });
        format!("<tr>{}</tr>\n", cells.collect::<String>())
    };
    let rows = table.rows.iter().map(|row| line("td", row));
    format!(
        "<table>\n<thead>{}</thead>\n<tbody>\n{}</tbody>\n</table>\n",
        line("th", &table.header),
        rows.collect::<String>()
    )
}

/// Text of a line, with an escape before every mark of Markdown. A line break would
/// end a table row.
fn markdown(text: &str) -> String {
    let marks = ['\\', '|', '`', '*', '_', '<', '[', '&'];
    let text = text::plain(text);
    let escaped = text.chars().flat_map(|c| {
        let escape = marks.contains(&c).then_some('\\');
        escape.into_iter().chain([c])
    });
    escaped.collect()
}

fn html(text: &str) -> String {
    let mut text = text::plain(text).replace('&', "&amp;");
    for (mark, name) in [
        ("<", "&lt;"),
        (">", "&gt;"),
        ("\"", "&quot;"),
        ("'", "&#39;"),
    ] {
        text = text.replace(mark, name);
    }
    text
}

/// The document as Markdown.
pub fn to_markdown(blocks: &[Block]) -> String {
    let parts = blocks.iter().filter_map(|block| match block {
        Block::Heading(level, text) => {
            let marks = "#".repeat(usize::from(*level));
            Some(format!("{marks} {}\n", markdown(text)))
        }
        Block::Line(text) => Some(markdown(text) + "\n"),
        Block::Table(rows) => Some(markdown_table(rows)),
        Block::Picture(_) => None,
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
        Block::Heading(_, text) | Block::Line(text) => {
            text::wrapped(&text::plain(text), width) + "\n"
        }
        Block::Table(table) => format!("{table}\n"),
        Block::Picture(_) => String::new(),
    });
    parts.collect()
}

const STYLE: &str = "body{font:15px/1.45 system-ui,sans-serif;max-width:75rem;margin:2rem auto;\
padding:0 1rem}table{border-collapse:collapse;margin:1rem 0;display:block;overflow-x:auto}\
th,td{padding:.2rem .6rem;border-bottom:1px solid #ddd;text-align:left;white-space:nowrap}\
.n{text-align:right;font-variant-numeric:tabular-nums}svg{max-width:100%;height:auto}";

/// The document as one page that needs no other file.
pub fn to_html(title: &str, blocks: &[Block]) -> String {
    let parts = blocks.iter().map(|block| match block {
        Block::Heading(level, text) => format!("<h{level}>{}</h{level}>\n", html(text)),
        Block::Line(text) => format!("<p>{}</p>\n", html(text)),
        Block::Table(rows) => html_table(rows),
        Block::Picture(svg) => format!("<figure>{svg}</figure>\n"),
    });
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head><meta charset=\"utf-8\"><title>{}</title>\
         <style>{STYLE}</style></head>\n<body>\n{}</body>\n</html>\n",
        html(title),
        parts.collect::<String>()
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
            !page.contains("<script>") && page.contains("<svg></svg>"),
            "{page}"
        );
        let cell =
            "<td>a|b&lt;script&gt; `c` &amp; &quot;d&quot;\\u{202e}</td><td class=\"n\">1</td>";
        assert!(page.contains(cell), "{page}");
    }
}
