//! `cullbench list`: everything that has a name.

use std::io::{self, Write};

use clap::ValueEnum;
use serde_json::{Map, Value, json};

use super::args::{EnvArgs, ListArgs, ListTopic};
use super::shared_args::TableFormat;
use super::table::Table;
use super::{Ending, print_json, program, text};
use crate::culling::TESTS;
use crate::index::{Info, Registry};
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
                let rows = rows.into_iter().map(told);
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

/// Condition under which a run times a structure.
fn timed(info: &Info) -> &'static str {
    if info.on_request {
        "if named"
    } else {
        "by default"
    }
}

/// A row for people: its name and its summary with what the columns hold.
fn told((name, columns, summary): Row) -> [String; 2] {
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
    let told: Vec<String> = told
        .map(|(column, value)| format!("{column} {value}"))
        .collect();
    let columns = told.iter().map(|column| format!("\n{column}"));
    match told.join("; ") {
        short if short.len() < 60 && !told.is_empty() => [name, format!("{summary} ({short})")],
        _ => [name, summary + &columns.collect::<String>()],
    }
}

fn as_json((name, columns, summary): Row) -> Value {
    let mut row = json!({ "name": name, "summary": summary });
    for (column, value) in columns {
        row[column] = value;
    }
    row
}

fn rows(registry: &Registry, topic: ListTopic) -> anyhow::Result<(&'static str, String, Vec<Row>)> {
    let row = |name: &str, columns: &[(&'static str, &str)], summary: &str| {
        let columns = columns
            .iter()
            .map(|&(column, value)| (column, value.into()));
        (name.to_owned(), columns.collect(), summary.to_owned())
    };
    Ok(match topic {
        ListTopic::Structures => {
            let rows = registry.rows().iter().map(|row| {
                let info = row.info;
                let params = registry.structure(info.name)?.params;
                let columns = vec![
                    ("kind", info.kind.name().into()),
                    ("origin", info.origin.to_string().into()),
                    ("capabilities", info.capabilities.names().into()),
                    ("timed", timed(&info).into()),
                    ("params", params.to_string().into()),
                ];
                Ok((info.name.to_owned(), columns, info.summary.to_owned()))
            });
            let note = "Parameters follow the name: bvh:leaf=4,preset=medium\nLists of \
                        structures: all, default (those timed by default) or names separated by \
                        commas";
            (
                "structures",
                note.to_owned(),
                rows.collect::<anyhow::Result<_>>()?,
            )
        }
        ListTopic::Scenes => {
            let families = FAMILIES.iter().map(|f| {
                let params = format!("{SCENE_PARAMS}, {}", f.params);
                row(f.name, &[("params", &params)], f.summary)
            });
            let meshes = MESHES
                .iter()
                .map(|m| row(m.name, &[("params", SCENE_PARAMS)], m.summary));
            let samples = SAMPLES.iter().map(|s| {
                let licence = format!("real; {}", s.licence);
                row(s.name, &[("params", &licence)], s.summary)
            });
            let fetched = FETCHED.iter().map(|f| {
                let state = match f.is_there() {
                    true => "fetched".to_owned(),
                    false => format!("missing: scripts/fetch.py {}", f.name),
                };
                let params = format!("{state}; {}", f.licence);
                let path = f.path();
                row(&path.to_string_lossy(), &[("params", &params)], &f.summary)
            });
            let suites = SUITES
                .iter()
                .map(|s| [s.name.to_owned(), s.summary.to_owned()]);
            let suites = text::entries(&suites.collect::<Vec<_>>(), text::width());
            let note = format!(
                "In a mesh, n is the number of triangles.\nA scene is also a file: boxes CSV, \
                 glTF or GLB, OBJ, a Doom WAD (maps.wad#MAP07 picks a map), a Quake III BSP, or a \
                 zip or pk3 with one (pak.pk3#maps/q.bsp).\nReal scenes have licences of their own: `{} licences`.\nSuites of `run`:\n{suites}",
                program::name()
            );
            (
                "scenes",
                note,
                families
                    .chain(meshes)
                    .chain(samples)
                    .chain(fetched)
                    .collect(),
            )
        }
        ListTopic::Paths => (
            "paths",
            format!(
                "Parameters of every path: {PATH_PARAMS}.\nA path is also a file: a cameras CSV (eye_x.. and look_x.. or forward_x.., or matrices m00..m33)."
            ),
            PATHS
                .iter()
                .map(|p| row(p.name, &[("params", p.params)], p.summary))
                .collect(),
        ),
        ListTopic::Tests => (
            "tests",
            String::new(),
            TESTS.iter().map(|(_, n, s)| row(n, &[], s)).collect(),
        ),
        ListTopic::Metrics => {
            let rows = METRICS
                .iter()
                .map(|m| row(m.name, &[("unit", m.unit)], m.summary));
            let bounds = BOUNDS
                .iter()
                .map(|b| [b.name, b.summary].map(str::to_owned));
            let bounds = text::entries(&bounds.collect::<Vec<_>>(), text::width());
            let note = format!("Lower bounds in reports and tables (no structures):\n{bounds}");
            ("metrics", note, rows.collect())
        }
        ListTopic::Motions => {
            let rows = MOTIONS.iter().map(|m| {
                let params = format!("share={}, step={}", m.share, m.step);
                row(m.name, &[("params", &params)], m.summary)
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
