//! `cullbench env`: what every report records about where it was made.

use std::io::{self, Write};

use serde_json::{Value, json};

use super::args::EnvArgs;
use super::shared_args::TableFormat;
use super::table::Table;
use super::{Ending, print_json};
use crate::measure::{Machine, Source, Toolchain};

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
                match facts.as_object() {
                    Some(facts) => {
                        for (name, value) in facts {
                            table.add_row([format!("{group}.{name}"), plain(value)]);
                        }
                    }
                    None => {
                        table.add_row([group.clone(), plain(facts)]);
                    }
                }
            }
            writeln!(io::stdout(), "{table}")?;
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
            let fields: Vec<String> = fields
                .iter()
                .map(|(k, v)| format!("{k}={}", plain(v)))
                .collect();
            format!("({})", fields.join(", "))
        }
        other => other.to_string(),
    }
}
