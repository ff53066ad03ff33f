//! `cullbench list`: everything that has a name.

use std::io::{self, Write};

use anyhow::Result;
use clap::ValueEnum;
use serde_json::{Map, Value, json};

use super::args::ListTopic;
use super::document::Table;
use super::shared_args::TableFormat;
use super::{Ending, print, print_json, program, text};
use crate::culling::TESTS;
use crate::index::{Info, Registry};
use crate::measure::{BOUNDS, METRICS, Machine, Toolchain};
use crate::motion::{MOTION_PARAMS, MOTIONS};
use crate::path::{PATH_PARAMS, PATHS};
use crate::scene::{FAMILIES, FETCHED, MESHES, SAMPLES, SCENE_PARAMS};
use crate::suite::SUITES;

/// Further columns of rows, in the order of the tables.
const COLUMNS: &str = "kind origin capabilities timed params licence state unit";

pub fn list(registry: &Registry, one: Option<ListTopic>, format: TableFormat) -> Result<Ending> {
    let topics = ListTopic::value_variants().iter().copied();
    let mut out = io::stdout().lock();
    let mut all = Map::new();
    for topic in topics.filter(|topic| one.is_none_or(|one| one == *topic)) {
        let (name, note, rows) = rows(registry, topic)?;
        if format == TableFormat::Json {
            all.insert(name.to_owned(), rows.into());
            continue;
        }
        let columns: Vec<Vec<String>> = rows.iter().map(told).collect();
        let in_line = columns.iter().all(|own| own.join("; ").len() < 60);
        let rows = rows.iter().zip(columns).map(|(row, columns)| {
            let [name, summary] = ["name", "summary"].map(|key| plain(&row[key], ", "));
            let text = match in_line && !columns.is_empty() {
                true => format!("{summary} ({})", columns.join("; ")),
                false => [vec![summary], columns].concat().join("\n"),
            };
            [name, text]
        });
        writeln!(out, "{name}\n{}", text::entries(rows, text::width()))?;
        if !note.is_empty() {
            writeln!(out, "{}\n", text::wrapped(note.trim_end(), text::width()))?;
        }
    }
    if format == TableFormat::Json {
        // One topic is a plain array; all of them are an object.
        let only = all.values().next().filter(|_| one.is_some());
        print_json(&only.cloned().unwrap_or(Value::Object(all)))?;
    }
    Ok(Ending::Ok)
}

/// Further columns of a row, in readable form.
fn told(row: &Value) -> Vec<String> {
    let told = COLUMNS.split(' ').filter_map(|column| {
        // Parameters in the form in which they are typed after the name.
        let value = plain(row.get(column)?, ", ").replace("\":", "=");
        Some((column, value.replace(['{', '}', '"'], "")))
    });
    let told = told.filter(|(_, value)| !value.is_empty());
    told.map(|(column, value)| format!("{column} {value}"))
        .collect()
}

/// A row with a name, one further column and a summary.
fn row(name: &str, column: &str, value: &str, summary: &str) -> Value {
    json!({ "name": name, column: value, "summary": summary })
}

/// Name of a topic, a note on it, and its rows.
fn rows(registry: &Registry, topic: ListTopic) -> Result<(&'static str, String, Vec<Value>)> {
    Ok(match topic {
        ListTopic::Structures => {
            let row = |info: &Info| {
                let mut params = registry.structure(info.name)?.params;
                // One thread, the default, is omitted from labels.
                let threaded = format!("{}:threads=2", info.name);
                if registry.structure(&threaded).is_ok() {
                    params["threads"] = 1.into();
                }
                Ok(json!({
                    "name": info.name,
                    "kind": info.kind.name(),
                    "origin": info.origin.to_string(),
                    "capabilities": info.capabilities(),
                    "timed": match (info.on_request, info.for_motion) {
                        (true, _) => "if named",
                        (_, true) => "with --motion",
                        _ => "by default",
                    },
                    "params": params.to_string(),
                    "summary": info.summary,
                }))
            };
            let rows = registry.rows().iter().map(|own| row(&own.info));
            let note = "Parameters follow the name: bvh:leaf=4,preset=medium\nLists of \
                        structures: all, default (those timed by default), motion (these and \
                        those with --motion) or names separated by commas";
            let rows = rows.collect::<Result<_>>()?;
            ("structures", note.to_owned(), rows)
        }
        ListTopic::Scenes => {
            let families = FAMILIES.iter().map(|f| {
                let params = format!("{SCENE_PARAMS}, {}", f.params);
                row(f.name, "params", &params, f.summary)
            });
            let meshes = MESHES.iter();
            let meshes = meshes.map(|m| row(m.name, "params", SCENE_PARAMS, m.summary));
            let samples = SAMPLES.iter();
            let samples = samples.map(|s| row(s.name, "licence", s.licence, s.summary));
            let fetched = FETCHED.iter().map(|f| {
                let state = match f.is_there() {
                    true => "fetched".to_owned(),
                    false => format!("missing, scripts/fetch.py {}", f.name),
                };
                let path = f.path();
                let mut row = row(&path.to_string_lossy(), "licence", &f.licence, &f.summary);
                row["state"] = state.into();
                row
            });
            let suites = SUITES.iter().map(|s| [s.name.as_str(), &s.summary]);
            let note = format!(
                "In a mesh, n is the number of triangles.\nA scene is also a file: boxes CSV, \
                 glTF or GLB, OBJ, a Doom WAD (maps.wad#MAP07 picks a map), a Quake III BSP, or a \
                 zip or pk3 with one (pak.pk3#maps/q.bsp).\nFetched scenes are looked for from the working directory.\nReal scenes have licences of their own: `{} licences`.\nSuites of `run`:\n{}",
                program::name(),
                text::entries(suites, text::width())
            );
            let rows = families.chain(meshes).chain(samples).chain(fetched);
            ("scenes", note, rows.collect())
        }
        ListTopic::Paths => {
            let rows = PATHS.iter();
            let rows = rows.map(|p| row(p.name, "params", p.params, p.summary));
            let note = format!(
                "Parameters of every path: {PATH_PARAMS}.\nA path is also a file: a cameras CSV (eye_x.. and look_x.. or forward_x.., or matrices m00..m33)."
            );
            ("paths", note, rows.collect())
        }
        ListTopic::Tests => {
            let rows = TESTS.iter();
            let rows = rows.map(|(_, name, what)| json!({ "name": name, "summary": what }));
            ("tests", String::new(), rows.collect())
        }
        ListTopic::Metrics => {
            let rows = METRICS.iter();
            let rows = rows.map(|m| row(m.name, "unit", m.unit, m.summary));
            let bounds = text::entries(BOUNDS.iter().map(|b| [b.name, b.summary]), text::width());
            let note = format!("Lower bounds in reports and tables (no structures):\n{bounds}");
            ("metrics", note, rows.collect())
        }
        ListTopic::Motions => {
            let rows = MOTIONS.iter().map(|m| {
                let params = format!("share={}, step={}", m.share, m.step);
                row(m.name, "params", &params, m.summary)
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

pub fn env(format: TableFormat) -> Result<Ending> {
    let facts = json!({
        "machine": Machine::capture(),
        "toolchain": Toolchain::capture(),
        "source": program::source(),
    });
    print(format, &facts, || {
        let mut table = Table::of("fact | value");
        for (group, facts) in facts.as_object().into_iter().flatten() {
            for (name, value) in facts.as_object().into_iter().flatten() {
                table.add_row([format!("{group}.{name}"), plain(value, " ")]);
            }
        }
        write!(io::stdout(), "{}", table.fitted(text::width()))
    })?;
    Ok(Ending::Ok)
}

/// A value in readable form, with `between` between the values of a list.
fn plain(value: &Value, between: &str) -> String {
    match value {
        Value::Null => "unknown".to_owned(),
        Value::String(text) => text.clone(),
        Value::Array(values) => {
            let values = values.iter().map(|value| plain(value, between));
            values.collect::<Vec<_>>().join(between)
        }
        Value::Object(fields) => {
            let field = |(name, value)| format!("{name}={}", plain(value, between));
            format!("({})", text::joined(fields.iter().map(field)))
        }
        other => other.to_string(),
    }
}
