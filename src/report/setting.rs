//! Facts of machine and toolchain that differ between two reports: they move
//! times without any change of the code.

use serde::Serialize;

use super::Report;
use super::stream::caches;

/// A fact that differs.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Setting {
    /// "machine" or "toolchain".
    pub of: &'static str,
    /// Name of the fact.
    pub what: &'static str,
    /// In the old report.
    pub old: String,
    /// In the new report.
    pub new: String,
    /// True if it is another machine: absolute times do not compare.
    pub is_machine: bool,
}

/// Whose, name, whether it tells two machines apart, and the fact itself.
type Fact = (&'static str, &'static str, bool, String);

fn facts(report: &Report) -> Vec<Fact> {
    let (machine, tools) = (&report.machine, &report.toolchain);
    let known = |text: &Option<String>| text.clone().unwrap_or_else(|| "unknown".to_owned());
    let (vectors, locked) = (machine.instruction_set.clone(), tools.lock_digest.clone());
    vec![
        ("machine", "cpu", true, known(&machine.cpu)),
        ("machine", "cores", true, machine.cores.to_string()),
        ("machine", "caches", true, caches(machine).join(" ")),
        ("machine", "instruction set", true, vectors),
        ("machine", "os kernel", false, known(&machine.kernel)),
        ("toolchain", "rustc", false, known(&tools.rustc)),
        ("toolchain", "target", false, known(&tools.target)),
        ("toolchain", "flags", false, tools.flags.clone()),
        ("toolchain", "profile", false, known(&tools.profile)),
        ("toolchain", "opt-level", false, known(&tools.opt_level)),
        ("toolchain", "features", false, tools.features.join(",")),
        ("toolchain", "dependencies", false, locked),
    ]
}

/// Differing facts, in the order of the report.
pub fn settings(old: &Report, new: &Report) -> Vec<Setting> {
    let pairs = facts(old).into_iter().zip(facts(new));
    let differing = pairs.filter(|(old, new)| old.3 != new.3);
    differing
        .map(|((of, what, is_machine, old), (.., new))| Setting {
            of,
            what,
            old,
            new,
            is_machine,
        })
        .collect()
}
