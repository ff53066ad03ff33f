//! `cullbench env`: the machine, toolchain and source that every report records.

use std::io::{self, Write};

use serde_json::{Value, json};

use super::args::EnvArgs;
use super::shared_args::TableFormat;
use super::table::Table;
use super::{Ending, print_json, text};
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
