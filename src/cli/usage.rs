//! Errors of the command line on one line: clap tells them in several, with a
//! tip and the usage. It defines how those become what was found and expected.

use std::error::Error;

use clap::error::{ContextKind, ContextValue, ErrorKind};

use crate::spec::{SpecError, nearest};

/// Message of one of our own parsers about a value.
fn value(error: &clap::Error) -> Option<String> {
    let said = error.source()?.downcast_ref::<SpecError>()?.to_string();
    let told = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => text.as_str(),
        _ => "",
    };
    let (option, found) = (
        told(ContextKind::InvalidArg),
        told(ContextKind::InvalidValue),
    );
    let option = option.split(' ').next().unwrap_or_default();
    Some(match said.starts_with("expected") {
        true => format!("{option} is '{found}'; {said}"),
        false => said,
    })
}

/// The error on one line; `None` for requested help or version, and for the help in
/// place of a missing command.
pub fn one_line(error: &clap::Error) -> Option<String> {
    use ErrorKind::{
        DisplayHelp, DisplayHelpOnMissingArgumentOrSubcommand as NoCommand, DisplayVersion,
    };
    if matches!(error.kind(), DisplayHelp | NoCommand | DisplayVersion) {
        return None;
    }
    if let Some(line) = value(error) {
        return Some(line);
    }
    let text = error.render().to_string();
    let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    let first = lines.next().unwrap_or_default();
    let mut found = first.strip_prefix("error: ").unwrap_or(first).to_owned();
    let mut expected = None;
    let mut missing = Vec::new();
    let mut usage = None;
    for line in lines {
        let tip = line.strip_prefix("tip: ");
        let similar = tip.filter(|tip| tip.contains("similar"));
        let values = line.strip_prefix("[possible values: ");
        if let Some((_, names)) = similar.and_then(|tip| tip.split_once(": ")) {
            // Those of clap need not be alike.
            let word = found.split('\'').nth(1).unwrap_or_default();
            if let Some(name) = nearest(word, names.split('\'').skip(1).step_by(2)) {
                expected.get_or_insert(format!("; did you mean '{name}'?"));
            }
        } else if let Some(tip) = tip {
            expected.get_or_insert(format!("; {tip}"));
        } else if let Some(values) = values {
            expected = Some(format!(
                "; expected one of {}",
                values.trim_end_matches(']')
            ));
        } else if let Some(line) = line.strip_prefix("Usage: ") {
            usage = Some(line.to_owned());
        } else if !line.starts_with("For more information") && usage.is_none() {
            missing.push(line.to_owned());
        }
    }
    if !missing.is_empty() {
        found = format!("{found} {}", missing.join(", "));
    }
    let usage = usage.map(|usage| format!("; expected {usage}"));
    let help = "; see --help".to_owned();
    Some(found + &expected.or(usage).unwrap_or(help))
}
