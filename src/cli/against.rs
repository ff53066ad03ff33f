//! `cullbench compare --against BINARY`: this program against another build of it.
//!
//! Pairs of processes alternate on one processor until the change of every cell is known to within
//! the threshold. [`changes`] has the statistics; here are the options and the execution of pairs.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};
use std::{fs, thread};

use anyhow::{Context, Result, bail};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde::Deserialize;
use serde_json::{Value, json};

use super::command_args::{CompareArgs, Gate};
use super::compare_table::{CompareTable, Side};
use super::processes::{Job, Message, Workers};
use super::run_plan::{self, RunPlan};
use super::run_resume::TypedOptions;
use super::shared_args::WhatArgs;
use super::study::{progress, tell_progress};
use super::{interrupt, text};
use crate::index::{DEFAULT, Registry};
use crate::input;
use crate::measure::{
    Group, GroupKey, Machine, Part, Plan, ReferenceResults, Schedule, Share, Toolchain,
};
use crate::report::{
    Basis, Changes, ReportCell, Setting, WORK, built_differently, changes, grouped,
};
use crate::scene;
use crate::statistics::resolved;

const SUITE: &str = "compare";
/// Default structures, without the plain loop over all items.
///
/// The plain loop takes most of the time and is the least informative.
const STRUCTURES: &str = "linear,bsp,octree,quadtree,bvh,wide";

/// Least change to look for.
///
/// Two builds of one source differ as much by where their code lies.
const LEAST_THRESHOLD: f64 = 0.01;

pub fn compare_against<'a>(
    registry: &Registry,
    args: &'a CompareArgs,
    binary: &Path,
) -> Result<CompareTable<'a>> {
    let threshold = args.threshold;
    let is_timed = args.gate == Gate::Time;
    if is_timed && threshold < LEAST_THRESHOLD {
        bail!(
            "--threshold is {}; expected at least {}: two builds of one source differ by as much",
            text::percent(threshold),
            text::percent(LEAST_THRESHOLD)
        );
    }
    let own = std::env::current_exe().context("this program cannot be found again")?;
    let binary = &program(binary)?;
    let [old, new] = [side(binary)?, side(&own)?];
    let plan = run_plan::plan_of(registry, &args.what, SUITE, Some(STRUCTURES))?;
    plan.check_inputs()?;
    if let Some((pipe, _)) = input::pipes().first() {
        bail!("'{pipe}' can be read only once; expected a file, which both programs can read");
    }
    interrupt::from_now_on_finish();
    let of_run = arguments(&plan.structures)?;
    let patience = Duration::from_secs(args.what.timeout);
    // Without pipes no folder is needed for them.
    let workers = || Workers::new(of_run.clone(), patience, Path::new(""));
    let mut duel = Duel {
        args,
        plan: &plan.plan,
        sides: [workers()?.of(binary), workers()?.of(&own)],
        rng: Pcg64::seed_from_u64(plan.plan.seed),
    };
    // Before the start: afterwards the load is our own.
    let busy = Machine::capture().busy().filter(|_| is_timed);
    let (changes, head) = duel.run()?;
    let note = |busy| format!("{busy}: both sides suffered alike, and it may take more pairs");
    let left_out = left_out(registry, &args.what, &plan)?;
    let differences = |other| built_differently(&other, &Toolchain::capture());
    let settings = toolchain(binary).map(differences).unwrap_or_default();
    let told = settings.iter().map(Setting::to_string);
    Ok(CompareTable {
        args,
        old,
        new,
        basis: Basis::Pairs,
        head,
        notes: told.chain(busy.map(note)).chain(left_out).collect(),
        settings,
        changes,
    })
}

/// A line about the default structures of a run that a comparison omits.
fn left_out(registry: &Registry, args: &WhatArgs, of: &RunPlan) -> Result<Option<String>> {
    let default = registry.structures(args.moves.list(DEFAULT))?.into_iter();
    // Labels without a policy of updates.
    let compared = of.plan.structures.iter();
    let compared: Vec<_> = compared.map(|s| s.label.split('@').next()).collect();
    let is_in = |name: &String| compared.contains(&Some(name));
    let names = text::joined(default.map(|spec| spec.label).filter(|name| !is_in(name)));
    let (note, more) = ("not compared by default", "(--structure default takes all)");
    let is_default = of.structures == STRUCTURES && !names.is_empty();
    Ok(is_default.then(|| format!("{note}: {names} {more}")))
}

/// The program of a name, as in a shell: looked up in PATH if it has no folder.
fn program(name: &Path) -> Result<PathBuf> {
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
fn side(program: &Path) -> Result<Side> {
    let bytes = fs::read(program).with_context(|| program.display().to_string())?;
    let digest = scene::hex(&hmac_sha256::Hash::hash(&bytes));
    Ok(Side {
        line: format!("{}, digest {digest:.12}", program.display()),
        json: json!({ "program": program.display().to_string(), "digest": digest }),
    })
}

/// Toolchain of a program, according to its own output.
fn toolchain(program: &Path) -> Option<Toolchain> {
    let told = Command::new(program)
        .args(["env", "--format", "json"])
        .output();
    let told: Value = serde_json::from_slice(&told.ok()?.stdout).ok()?;
    Toolchain::deserialize(&told["toolchain"]).ok()
}

/// The options of `run` that were typed after `compare`.
fn typed() -> Result<Vec<String>> {
    Ok(TypedOptions::of("compare", "run", std::env::args_os())?.words(|_| true))
}

/// The arguments of `run` for the same measurement.
fn arguments(structures: &str) -> Result<Vec<String>> {
    let mut arguments = vec!["run".to_owned()];
    arguments.extend(typed()?);
    for (option, value) in [("--suite=", SUITE), ("--structure=", structures)] {
        if !arguments.iter().any(|typed| typed.starts_with(option)) {
            arguments.push(format!("{option}{value}"));
        }
    }
    Ok(arguments)
}

/// Refuses options of a measurement if nothing is measured.
pub fn expect_none_of_a_run() -> Result<()> {
    if let Some(option) = typed()?.first().and_then(|typed| typed.split('=').next()) {
        bail!(
            "{option} says what --against BINARY measures, and two reports are measured already; \
             expected no {option}"
        );
    }
    Ok(())
}

/// Time for which one process of a pair runs before the other takes over.
///
/// Well below the time in which a shared machine changes its speed.
const TURN: Duration = Duration::from_millis(5);

/// The sides of a comparison, as indices: the other program and this one.
const OLD: usize = 0;
const NEW: usize = 1;

/// Number of pairs added at a time until the answer is clear.
const MORE: usize = 2;

/// The initial and the largest number of pairs of a comparison.
///
/// Ten for a threshold of 5 %, more for a smaller one, as required on a shared machine; none to
/// count work.
fn pairs(args: &CompareArgs) -> (usize, usize) {
    match args.threshold {
        _ if args.gate == Gate::Work => (0, 0),
        t if t >= 0.1 => (6, 32),
        t if t > 0.04 => (10, 32),
        _ => (16, 64),
    }
}

/// Two programs, and the plan on which they are compared.
struct Duel<'a> {
    /// Gate and threshold.
    args: &'a CompareArgs,
    plan: &'a Plan,
    /// Workers with the arguments of `run` from which the plan follows.
    sides: [Workers; 2],
    rng: Pcg64,
}

impl Duel<'_> {
    /// Runs pairs of processes until every change is known to within the threshold.
    ///
    /// Returns the changes, and their basis in words.
    ///
    /// # Errors
    /// A program that cannot be started or is of another version, a scene that it cannot read.
    fn run(&mut self) -> Result<(Changes, String)> {
        let started = Instant::now();
        let (first, most) = pairs(self.args);
        let bar = progress(most as u64, " pairs");
        let mut told = started;
        bar.set_message("counting and checking answers");
        let mut seen = self.count()?;
        let mut pairs = 0;
        loop {
            let is_due = pairs >= first && (pairs - first).is_multiple_of(MORE);
            if is_due || pairs == most {
                let changes = self.changes(&seen);
                let timed = changes.rows.iter().filter(|row| row.pairs_ln_ns.is_some());
                let judged: Vec<_> = timed.map(|row| row.judgement).collect();
                if resolved(&judged, self.args.threshold) || pairs == most {
                    let known = seen[NEW].iter().filter_map(|part| part.known.as_ref());
                    let plans = known.filter_map(|known| Some(&known.query.as_ref()?.schedule));
                    let range = |of: fn(&Schedule) -> usize| {
                        text::range(plans.clone().map(of), |most| most.to_string())
                    };
                    let head = format!(
                        "{} × {} rounds × {} cameras in {:.0} s",
                        text::counted(pairs, "pair"),
                        range(|plan| plan.rounds as usize),
                        range(|plan| plan.cameras.len()),
                        started.elapsed().as_secs_f64()
                    );
                    return Ok((changes, head));
                }
            }
            bar.set_position(pairs as u64);
            tell_progress(&bar, "pairs", &mut told);
            bar.set_message("pairs of processes");
            for scene in 0..self.plan.scenes.len() {
                let both = self.pair(scene, pairs as u32, &seen)?;
                for (seen, own) in seen.iter_mut().zip(both) {
                    seen.extend(own);
                }
            }
            pairs += 1;
        }
    }

    /// The changes of all cells, from the parts of both sides.
    fn changes(&self, seen: &[Vec<Part>; 2]) -> Changes {
        let cells = seen.each_ref().map(|parts| -> Vec<ReportCell> {
            let groups = grouped(parts.iter().map(|part| (&part.key, part.clone())));
            let groups = groups.iter().map(|(_, parts)| Group::of(parts));
            groups.flat_map(|group| group.cells).collect()
        });
        let metrics = match self.args.gate {
            Gate::Time if self.plan.motions.is_empty() => &["query_ns"],
            Gate::Time => &["frame_ns"][..],
            Gate::Work => WORK,
        };
        let [old, new] = &cells;
        changes(Basis::Pairs, [old, new], self.args.threshold, metrics)
    }

    /// Lets both sides count and check their answers.
    fn count(&self) -> Result<[Vec<Part>; 2]> {
        let mut seen = [Vec::new(), Vec::new()];
        for scene in 0..self.plan.scenes.len() {
            // The new side makes the plan; the old one follows it.
            for side in [NEW, OLD] {
                let mut share = self.share(scene, 0, [&seen[NEW], &[]]);
                share.plan_only = true;
                let (workers, job) = (&self.sides[side], Job::scene(scene, share, false));
                let parts = workers.found(0, job, &|_| (), Message::part);
                let program = || workers.program.display().to_string();
                seen[side].extend(parts.with_context(program)?);
            }
        }
        Ok(seen)
    }

    /// One process's share of a scene.
    ///
    /// The plan is the new side's; the answers to count are those of its own side.
    fn share(&self, scene: usize, process: u32, [new, own]: [&[Part]; 2]) -> Share {
        let keys = self.plan.keys_of(&self.plan.scenes[scene]);
        let known = keys.iter().map(|key| {
            let mut known = counted(new, key)?.clone();
            let answers = counted(own, key).map(|own| (own.visible.clone(), own.located.clone()));
            (known.visible, known.located) = answers.unwrap_or_default();
            Some(known)
        });
        Share {
            process,
            known: known.collect(),
            ..Share::first(keys.len())
        }
    }

    /// One pair of alternating processes on one scene; old and new.
    fn pair(&mut self, scene: usize, pair: u32, seen: &[Vec<Part>; 2]) -> Result<[Vec<Part>; 2]> {
        let mut parts = [Vec::new(), Vec::new()];
        // The side that is started first, and gets the first memory, is drawn for every pair;
        // independently, so is the side whose turn is first: old, new, new, old, ...
        let first: usize = self.rng.random_range(0..2);
        let begins: usize = self.rng.random_range(0..2);
        let mut workers = [None, None];
        for side in [first, 1 - first] {
            let share = self.share(scene, pair, [&seen[NEW], &seen[side]]);
            let job = Job::scene(scene, share, false);
            let mut worker = self.sides[side].start(0, self.rng.random(), job)?;
            // A side is suspended for half of the time.
            worker.patience = worker.patience.saturating_mul(2);
            workers[side] = Some(worker);
        }
        let mut turn = 0;
        let other = workers[1 - begins].iter();
        other.for_each(|other| other.hold(true));
        while workers.iter().any(Option::is_some) {
            interrupt::check()?;
            let mut side = (begins + usize::div_ceil(turn, 2)) % 2;
            turn += 1;
            if workers[side].is_none() {
                side = 1 - side;
            }
            let is_alone = workers[1 - side].is_none();
            workers[side].iter().for_each(|own| own.hold(false));
            thread::sleep(TURN);
            if !is_alone {
                workers[side].iter().for_each(|own| own.hold(true));
            }
            while let Some(worker) = &mut workers[side] {
                let program = || self.sides[side].program.display().to_string();
                match worker.listen(Duration::ZERO).with_context(program)? {
                    Some(Message::Done) => workers[side] = None,
                    Some(said) => parts[side].extend(said.part()),
                    None => break,
                }
            }
        }
        Ok(parts)
    }
}

/// Answers and counters of a side.
fn counted<'p>(parts: &'p [Part], key: &GroupKey) -> Option<&'p ReferenceResults> {
    let part = parts.iter().find(|part| part.key == *key)?;
    part.known.as_ref()
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
