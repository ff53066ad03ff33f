//! Where and by what two reports were measured, as far as they differ: the
//! facts that move times without any change of the code. It owns the choice of
//! those facts; what each of them is, the report's model says.

use serde::Serialize;

use super::Report;

/// A fact that differs.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Setting {
    pub what: &'static str,
    pub old: String,
    pub new: String,
    /// Of the machine: times of different machines do not compare.
    pub is_machine: bool,
}

/// Name, whether it is the machine's, and the fact itself.
type Fact = (&'static str, bool, String);

fn facts(report: &Report) -> Vec<Fact> {
    let (machine, tools) = (&report.machine, &report.toolchain);
    let known = |text: &Option<String>| text.clone().unwrap_or_else(|| "unknown".to_owned());
    let caches = machine.caches.iter();
    let caches: Vec<String> = caches
        .map(|cache| format!("L{} {} KiB", cache.level, cache.bytes >> 10))
        .collect();
    vec![
        ("cpu", true, known(&machine.cpu)),
        ("cores", true, machine.cores.to_string()),
        ("caches", true, caches.join(" ")),
        ("instruction set", true, machine.instruction_set.clone()),
        ("kernel", false, known(&machine.kernel)),
        ("rustc", false, known(&tools.rustc)),
        ("target", false, known(&tools.target)),
        ("flags", false, tools.flags.clone()),
        ("profile", false, known(&tools.profile)),
        ("opt-level", false, known(&tools.opt_level)),
        ("features", false, tools.features.join(",")),
        ("dependencies", false, tools.lock_digest.clone()),
    ]
}

/// What differs, in the order of the report.
pub fn settings(old: &Report, new: &Report) -> Vec<Setting> {
    let pairs = facts(old).into_iter().zip(facts(new));
    let differing = pairs.filter(|(old, new)| old.2 != new.2);
    differing
        .map(|((what, is_machine, old), (.., new))| Setting {
            what,
            old,
            new,
            is_machine,
        })
        .collect()
}
