//! The command behind `compare --against`: options, progress, the table.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, bail};
use serde_json::json;

use super::against::{Against, Duel};
use super::command_args::{CompareArgs, Gate};
use super::compare_table::{Basis, CompareTable, Side, WORK_HEAD};
use super::run_resume::RunOptions;
use super::study::progress;
use super::{interrupt, run_plan, text};
use crate::index::Registry;
use crate::measure::{CellKey, Machine, Plan, Status};
use crate::report::{Changes, JudgedRow, Lone, WORK, work_changes};
use crate::scene;

const SUITE: &str = "compare";
/// Default structures, without the plain loop over all items: it takes most of the
/// time and says least.
const STRUCTURES: &str = "linear,bsp,octree,quadtree,bvh,wide";

/// Changes below this are not looked for: two builds of one source differ as much
/// by where their code lies.
const LEAST_THRESHOLD: f64 = 0.01;

pub fn compare_against(
    registry: &Registry,
    args: &CompareArgs,
    binary: &Path,
    threshold: f64,
) -> anyhow::Result<CompareTable> {
    let is_timed = args.gate == Gate::Time;
    if is_timed && threshold < LEAST_THRESHOLD {
        bail!(
            "--threshold is {}; expected at least {}: two builds of one source differ by as much",
            text::percent(threshold),
            text::percent(LEAST_THRESHOLD)
        );
    }
    let new = std::env::current_exe().context("this program cannot be found again")?;
    let binary = &program(binary)?;
    let sides = [side(binary)?, side(&new)?];
    let plan = run_plan::plan_of(registry, &args.what, SUITE, Some(STRUCTURES))?;
    plan.check_inputs()?;
    interrupt::from_now_on_finish();
    let bar = progress(0, " pairs");
    let duel = Duel {
        args: arguments()?,
        plan: &plan.plan,
        programs: [binary.to_owned(), new],
        threshold,
        is_timed,
        patience: Duration::from_secs(args.what.timeout),
        progress: &|done, most, step| {
            bar.set_length(most as u64);
            bar.set_position(done as u64);
            bar.set_message(step.to_owned());
        },
    };
    // Before it begins: afterwards the load is its own.
    let load = Machine::capture();
    let found = duel.run();
    bar.finish_and_clear();
    let found = found?;
    let busy = load
        .load
        .filter(|l| is_timed && *l > 0.5 * load.cores as f64);
    let note = |busy| {
        format!(
            "the machine was busy (load average {busy:.1} on {} cores): both sides suffered \
             alike, and it took more pairs",
            load.cores
        )
    };
    let left_out = match args.what.structure.is_empty() {
        true => left_out(registry, &plan.plan)?,
        false => None,
    };
    let [old, new] = sides;
    Ok(CompareTable {
        old,
        new,
        basis: Basis::Pairs,
        gate: args.gate,
        fail_inconclusive: args.fail_inconclusive,
        head: match args.gate {
            Gate::Time => format!(
                "{} × {} rounds × {} cameras in {:.0} s",
                text::counted(found.pairs, "pair"),
                found.rounds,
                found.cameras,
                found.seconds
            ),
            Gate::Work => WORK_HEAD.to_owned(),
        },
        notes: busy.map(note).into_iter().chain(left_out).collect(),
        settings: Vec::new(),
        changes: changes(&found, threshold, args.gate),
    })
}

/// Line on the default structures of a run that a comparison lacks.
fn left_out(registry: &Registry, plan: &Plan) -> anyhow::Result<Option<String>> {
    let all = registry.structures("default")?.into_iter();
    let names = all.map(|spec| spec.label);
    let is_in = |name: &String| plan.structures.iter().any(|spec| spec.label == *name);
    let names: Vec<String> = names.filter(|name| !is_in(name)).collect();
    let note = || {
        let names = names.join(", ");
        format!("not compared by default: {names} (--structure default takes all)")
    };
    Ok((!names.is_empty()).then(note))
}

/// The program of a name, as in a shell: one without a folder is looked up in PATH.
fn program(name: &Path) -> anyhow::Result<PathBuf> {
    let found = match name.parent() {
        Some(folder) if folder.as_os_str().is_empty() => {
            let path = std::env::var_os("PATH").unwrap_or_default();
            let mut places = std::env::split_paths(&path).map(|folder| folder.join(name));
            places.find(|place| place.is_file()).with_context(|| {
                let name = name.display();
                format!("{name}: not in PATH; expected a program there, or ./{name} for one here")
            })?
        }
        _ => name.to_owned(),
    };
    let shown = || found.display().to_string();
    let is_file = fs::metadata(&found).with_context(shown)?.is_file();
    anyhow::ensure!(is_file, "{}: no file; expected a program", shown());
    std::path::absolute(&found).with_context(shown)
}

/// A program as one side of the comparison.
fn side(program: &Path) -> anyhow::Result<Side> {
    let bytes = fs::read(program).with_context(|| program.display().to_string())?;
    let digest = scene::hex(&hmac_sha256::Hash::hash(&bytes));
    let short: String = digest.chars().take(12).collect();
    Ok(Side {
        line: format!("{}, digest {short}", program.display()),
        json: json!({ "program": program.display().to_string(), "digest": digest }),
    })
}

fn changes(found: &Against, threshold: f64, gate: Gate) -> Changes {
    let mut changes = Changes {
        threshold,
        ..Changes::default()
    };
    for cell in &found.cells {
        let key = CellKey {
            group: cell.group.clone(),
            structure: cell.structure.clone(),
        };
        let [old, new] = &cell.verdicts;
        if old.status == Status::LeftOut {
            let lone = Lone {
                cell: key,
                status: new.status,
                reason: new.reason.clone(),
            };
            let is_new = new.status != Status::LeftOut;
            changes.only_in_new.extend(Some(lone).filter(|_| is_new));
            continue;
        }
        changes.cells_in_common += 1;
        changes
            .work_changed
            .extend(work_changes(&key, &cell.counts[0], &cell.counts[1]));
        if let Some(row) = JudgedRow::of_statuses(key.clone(), old, new) {
            changes.rows.push(row);
            continue;
        }
        if gate == Gate::Work {
            let rows = WORK.iter().map(|counter| {
                let [old, new] = cell.counts.each_ref().map(|own| own.get(*counter).copied());
                JudgedRow::by_work(key.clone(), counter, (old, new), threshold)
            });
            changes.rows.extend(rows);
            continue;
        }
        let [old, new] = cell.shown();
        let pairs = cell.ln_ns.each_ref().map(Vec::len);
        changes.rows.push(JudgedRow {
            pairs_ln_ns: Some(cell.ln_ns.clone()),
            ..JudgedRow::by_times(key, "query_ns", (old, new), cell.judgement, pairs)
        });
    }
    changes.rows.sort_by(JudgedRow::order);
    changes
}

/// The options of `run` that were typed behind `compare`.
fn typed() -> anyhow::Result<Vec<String>> {
    Ok(RunOptions::of("compare", std::env::args_os())?.words(|_| true))
}

/// The arguments of `run` for the same measurement.
fn arguments() -> anyhow::Result<Vec<String>> {
    let mut arguments = vec!["run".to_owned()];
    arguments.extend(typed()?);
    for (option, value) in [("--suite=", SUITE), ("--structure=", STRUCTURES)] {
        if !arguments.iter().any(|typed| typed.starts_with(option)) {
            arguments.push(format!("{option}{value}"));
        }
    }
    Ok(arguments)
}

/// Refuses options of a measurement where nothing is measured.
pub fn expect_none_of_a_run() -> anyhow::Result<()> {
    if let Some(option) = typed()?.first().and_then(|typed| typed.split('=').next()) {
        bail!(
            "{option} says what --against BINARY measures, and two reports are measured already; \
             expected no {option}"
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The report names the program that runs.
    #[cfg(unix)]
    #[test]
    fn a_name_without_a_folder_is_looked_up_in_path() {
        let found = |name: &str| program(Path::new(name)).map_err(|error| error.to_string());
        let shell = found("sh").unwrap();
        assert!(shell.is_absolute() && shell.ends_with("sh") && shell.is_file());
        let manifest = found("./Cargo.toml").unwrap();
        assert!(manifest.is_absolute() && manifest.is_file());
        for (name, wanted) in [
            (
                "Cargo.toml",
                "Cargo.toml: not in PATH; expected a program there, or ./Cargo.toml",
            ),
            ("/dev/zero", "/dev/zero: no file; expected a program"),
            ("./src", "./src: no file; expected a program"),
        ] {
            let error = found(name).unwrap_err();
            assert!(error.starts_with(wanted), "{error}");
        }
    }
}
