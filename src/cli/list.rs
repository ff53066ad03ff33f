//! `cullbench list`: everything that has a name.

use std::io::{self, Write};

use clap::ValueEnum;
use serde_json::{Map, Value, json};

use super::args::{EnvArgs, ListArgs, ListTopic};
use super::shared_args::TableFormat;
use super::table::Table;
use super::{Ending, print_json, program, text};
use crate::culling::TESTS;
use crate::index::Registry;
use crate::measure::{BOUNDS, METRICS, Machine, Source, Toolchain};
use crate::motion::{MOTION_PARAMS, MOTIONS};
use crate::path::{PATH_PARAMS, PATHS};
use crate::scene::{FAMILIES, FETCHED, MESHES, SAMPLES, SCENE_PARAMS};
use crate::suite::SUITES;

/// Name, further columns by name, summary.
type Row = (String, Vec<(&'static str, Value)>, String);

pub fn list(registry: &Registry, args: &ListArgs) -> anyhow::Result<Ending> {
    let topics = match args.topic {
        Some(topic) => vec![topic],
        None => ListTopic::value_variants().to_vec(),
    };
    let mut out = io::stdout().lock();
    let mut all = Map::new();
    for topic in &topics {
        let (name, note, rows) = rows(registry, *topic)?;
        match args.format {
            TableFormat::Json => {
                all.insert(name.to_owned(), rows.into_iter().map(as_json).collect());
            }
            TableFormat::Table => {
                let rows: Vec<_> = rows.into_iter().map(told).collect();
                let in_line = rows.iter().all(|row| row.1.join("; ").len() < 60);
                let rows = rows
                    .into_iter()
                    .map(|(name, columns, summary)| match in_line {
                        true if !columns.is_empty() => {
                            [name, format!("{summary} ({})", columns.join("; "))]
                        }
                        _ => [name, [vec![summary], columns].concat().join("\n")],
                    });
                let entries = text::entries(&rows.collect::<Vec<_>>(), text::width());
                writeln!(out, "{name}\n{entries}")?;
                if !note.is_empty() {
                    writeln!(out, "{}\n", text::wrapped(note.trim_end(), text::width()))?;
                }
            }
        }
    }
    if args.format == TableFormat::Json {
        // One topic is a plain array, all of them an object.
        let value = match args.topic {
            Some(_) => all.into_iter().next().map(|(_, v)| v).unwrap_or_default(),
            None => Value::Object(all),
        };
        print_json(&value)?;
    }
    Ok(Ending::Ok)
}

/// A row for people: its name, what the columns hold, its summary.
fn told((name, columns, summary): Row) -> (String, Vec<String>, String) {
    let of = |value: &Value| match value {
        Value::String(text) => text.clone(),
        Value::Array(words) => {
            let words = words.iter().filter_map(Value::as_str);
            words.collect::<Vec<_>>().join(", ")
        }
        other => other.to_string(),
    };
    let told = columns.iter().map(|(column, value)| {
        // Parameters as they are typed behind the name.
        let value = of(value).replace("\":", "=").replace(['{', '}', '"'], "");
        (column, value)
    });
    let told = told.filter(|(_, value)| !value.is_empty());
    let told = told.map(|(column, value)| format!("{column} {value}"));
    (name, told.collect(), summary)
}

fn entries<'r>(rows: impl Iterator<Item = [&'r str; 2]>) -> String {
    let rows = rows.map(|row| row.map(str::to_owned));
    text::entries(&rows.collect::<Vec<_>>(), text::width())
}

fn as_json((name, columns, summary): Row) -> Value {
    let mut row = json!({ "name": name, "summary": summary });
    for (column, value) in columns {
        row[column] = value;
    }
    row
}

/// Rows with one further column: name, column and summary.
fn rows_with<'r>(
    column: &'static str,
    rows: impl IntoIterator<Item = [&'r str; 3]>,
) -> impl Iterator<Item = Row> {
    let rows = rows.into_iter();
    rows.map(move |[name, value, summary]| {
        let columns = vec![(column, value.into())];
        (name.to_owned(), columns, summary.to_owned())
    })
}

/// Name of a topic, a note on it, and its rows.
fn rows(registry: &Registry, topic: ListTopic) -> anyhow::Result<(&'static str, String, Vec<Row>)> {
    Ok(match topic {
        ListTopic::Structures => {
            let rows = registry.rows().iter().map(|row| {
                let info = row.info;
                let params = registry.structure(info.name)?.params;
                let timed = if info.on_request {
                    "if named"
                } else {
                    "by default"
                };
                let columns = vec![
                    ("kind", info.kind.name().into()),
                    ("origin", info.origin.to_string().into()),
                    ("capabilities", info.capabilities.names().into()),
                    ("timed", timed.into()),
                    ("params", params.to_string().into()),
                ];
                Ok((info.name.to_owned(), columns, info.summary.to_owned()))
            });
            let rows = rows.collect::<anyhow::Result<_>>()?;
            let note = "Parameters follow the name: bvh:leaf=4,preset=medium\nLists of \
                        structures: all, default (those timed by default) or names separated by \
                        commas";
            ("structures", note.to_owned(), rows)
        }
        ListTopic::Scenes => {
            let mut rows: Vec<[String; 3]> = Vec::new();
            for f in FAMILIES {
                let params = format!("{SCENE_PARAMS}, {}", f.params);
                rows.push([f.name.to_owned(), params, f.summary.to_owned()]);
            }
            rows.extend(
                MESHES
                    .iter()
                    .map(|m| [m.name, SCENE_PARAMS, m.summary].map(str::to_owned)),
            );
            for s in SAMPLES {
                let params = format!("real; {}", s.licence);
                rows.push([s.name.to_owned(), params, s.summary.to_owned()]);
            }
            for f in FETCHED.iter() {
                let state = match f.is_there() {
                    true => "fetched".to_owned(),
                    false => format!("missing: scripts/fetch.py {}", f.name),
                };
                let params = format!("{state}; {}", f.licence);
                let path = f.path().to_string_lossy().into_owned();
                rows.push([path, params, f.summary.clone()]);
            }
            let note = format!(
                "In a mesh, n is the number of triangles.\nA scene is also a file: boxes CSV, \
                 glTF or GLB, OBJ, a Doom WAD (maps.wad#MAP07 picks a map), a Quake III BSP, or a \
                 zip or pk3 with one (pak.pk3#maps/q.bsp).\nReal scenes have licences of their own: `{} licences`.\nSuites of `run`:\n{}",
                program::name(),
                entries(SUITES.iter().map(|s| [s.name, s.summary]))
            );
            let rows = rows.iter().map(|row| row.each_ref().map(String::as_str));
            ("scenes", note, rows_with("params", rows).collect())
        }
        ListTopic::Paths => {
            let rows = PATHS.iter().map(|p| [p.name, p.params, p.summary]);
            let note = format!(
                "Parameters of every path: {PATH_PARAMS}.\nA path is also a file: a cameras CSV (eye_x.. and look_x.. or forward_x.., or matrices m00..m33)."
            );
            ("paths", note, rows_with("params", rows).collect())
        }
        ListTopic::Tests => {
            let row = |(name, summary): (&str, &str)| (name.to_owned(), vec![], summary.to_owned());
            let rows = TESTS.iter().map(|(_, name, summary)| row((name, summary)));
            ("tests", String::new(), rows.collect())
        }
        ListTopic::Metrics => {
            let rows = METRICS.iter().map(|m| [m.name, m.unit, m.summary]);
            let bounds = entries(BOUNDS.iter().map(|b| [b.name, b.summary]));
            let note = format!("Lower bounds in reports and tables (no structures):\n{bounds}");
            ("metrics", note, rows_with("unit", rows).collect())
        }
        ListTopic::Motions => {
            let rows = MOTIONS.iter().flat_map(|m| {
                let params = format!("share={}, step={}", m.share, m.step);
                rows_with("params", [[m.name, &params, m.summary]]).collect::<Vec<_>>()
            });
            let note = format!(
                "Parameters of every motion: {MOTION_PARAMS}.\nA motion is also a file: a motion \
                 CSV (time_s,id,min_x,min_y,min_z,max_x,max_y,max_z; a row without bounds removes \
                 the item)."
            );
            ("motions", note, rows.collect())
        }
    })
}

pub fn env(args: &EnvArgs) -> anyhow::Result<Ending> {
    let facts = json!({
        "machine": Machine::capture(),
        "toolchain": Toolchain::capture(),
        "source": Source::capture(),
    });
    match args.format {
        TableFormat::Json => print_json(&facts)?,
        TableFormat::Table => {
            let mut table = Table::of("fact | value");
            for (group, facts) in facts.as_object().into_iter().flatten() {
                for (name, value) in facts.as_object().into_iter().flatten() {
                    table.add_row([format!("{group}.{name}"), plain(value)]);
                }
            }
            write!(io::stdout(), "{}", table.fitted(text::width()))?;
        }
    }
    Ok(Ending::Ok)
}

fn plain(value: &Value) -> String {
    match value {
        Value::Null => "unknown".to_owned(),
        Value::String(text) => text.clone(),
        Value::Array(values) => values.iter().map(plain).collect::<Vec<_>>().join(" "),
        Value::Object(fields) => {
            let fields = fields
                .iter()
                .map(|(name, value)| format!("{name}={}", plain(value)));
            format!("({})", fields.collect::<Vec<_>>().join(", "))
        }
        other => other.to_string(),
    }
}
