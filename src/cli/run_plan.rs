//! The plan of `cullbench run`, checked as far as possible before the run.
//!
//! Scenes, paths, structures and culling tests.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};

use super::args::RunArgs;
use super::shared_args::{WhatArgs, each_once};
use crate::culling::Culling;
use crate::index::Registry;
use crate::input::{InputError, is_readable, names_file, note, tell_warnings};
use crate::measure::{GroupKey, Part, Plan, PlannedScene};
use crate::motion::Motion;
use crate::path::{self, DEFAULT_PATH, LensDefaults};
use crate::report::{StoredPart, Stream};
use crate::scene::{self, FETCHED, FETCHED_FOLDER, Fetched, every_part, split_part};
use crate::suite::{REAL, REAL_PATHS, SUITES, Suite};

/// A plan and its source.
pub struct RunPlan {
    pub plan: Plan,
    /// Name of the suite or of its file; `None` for scenes and paths chosen by hand.
    pub suite: Option<String>,
    /// Structures as they were named.
    pub structures: String,
    /// True if it has no files of the user.
    is_built_in: bool,
    /// Scenes of the suite that cannot be measured here, with the reason.
    pub left_out: Option<String>,
    /// Groups of the whole plan, if this is a shard.
    pub whole: Vec<GroupKey>,
}

/// The plan of arguments; scenes and paths are not read yet.
pub fn plan(registry: &Registry, args: &RunArgs) -> Result<RunPlan> {
    let mut planned = plan_of(registry, &args.what, &SUITES[0].name, None)?;
    if let Some(processes) = args.processes {
        planned.plan.effort.processes = processes;
    }
    if let Some(text) = &args.shard {
        let (i, n) = shard(text)?;
        planned.whole = planned.plan.groups();
        planned.plan = planned.plan.shard(i, n);
    }
    Ok(planned)
}

/// The plan of the arguments that `run` and `compare --against` share.
///
/// With the default suite, and default structures in place of the suite's.
pub fn plan_of(
    registry: &Registry,
    args: &WhatArgs,
    default_suite: &str,
    default_structures: Option<&str>,
) -> Result<RunPlan> {
    let suite = args.suite.as_deref().unwrap_or(default_suite);
    let suite = Suite::of(suite, default_structures)?;
    let names = match args.structure.is_empty() {
        true => suite.structures.clone(),
        false => args.structure.join(","),
    };
    let tests = || args.test.iter().flat_map(|tests| tests.split(','));
    let cullings = tests().map(|test| args.culling.culling(test));
    let cullings: Vec<Culling> = cullings.collect::<Result<_, _>>()?;
    cullings.iter().try_for_each(Culling::check)?;
    each_once("test", tests())?;
    let list = args.moves.list(&names);
    let structures = args.culling.kernel.structures(registry, list);
    let structures = of_suite(args.structure.is_empty().then_some(&suite.name), structures)?;
    let (scenes, left_out) = scenes(args, &suite)?;
    let mut plan = Plan {
        scenes,
        cullings,
        lens: args.culling.lens.defaults()?,
        motions: Vec::new(),
        views_per_frame: 1,
        load: args.culling.lens.scene_args.options(structures.len()),
        structures,
        effort: suite.effort,
        bounds: !args.no_bounds,
        seed: args.seed,
    };
    args.moves.enter(&mut plan)?;
    each_once("scene", plan.scenes.iter().map(|scene| &scene.source))?;
    (plan.scenes.iter()).try_for_each(|scene| each_once("path", &scene.paths))?;
    each_once("motion", &plan.motions)?;
    if !plan.motions.is_empty() && plan.scenes.iter().any(|scene| scene.cold) {
        let suite = suite.name;
        bail!(
            "suite '{suite}' has cold caches, --motion has none; expected another suite, or --scene"
        );
    }
    let is_suite = args.scene.is_empty() && args.path.is_empty();
    Ok(RunPlan {
        plan,
        is_built_in: is_suite && suite.is_built_in() && suite.name != REAL,
        suite: is_suite.then_some(suite.name),
        structures: names,
        left_out,
        whole: Vec::new(),
    })
}

/// Errors in a suite's file name it.
fn of_suite<T>(suite: Option<&String>, found: Result<T>) -> Result<T> {
    let file = suite.filter(|suite| suite.ends_with(".toml"));
    match file {
        Some(file) => found.context(file.clone()),
        None => found,
    }
}

/// "2/4": the second of four shares.
fn shard(text: &str) -> Result<(usize, usize)> {
    let numbers = text.split_once('/');
    let numbers = numbers.and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
    let sound = numbers.filter(|&(i, n)| 1 <= i && i <= n && !text.contains('+'));
    let expected = "expected i/n with i from 1 to n, such as 2/4";
    sound.with_context(|| format!("--shard is '{text}'; {expected}"))
}

impl RunPlan {
    /// Reads every input: an error in the last file must not show after an hour.
    ///
    /// Built-in suites are known to be sound.
    pub fn check_inputs(&self) -> Result<()> {
        // A missing file; for a suite's file the error names the suite.
        let scenes = self.plan.scenes.iter();
        let sources = scenes.flat_map(|scene| scene.paths.iter().chain([&scene.source]));
        for source in sources.chain(&self.plan.motions) {
            let file = Path::new(split_part(source).0);
            if names_file(source) && !is_readable(file) {
                let found = fs::metadata(file).map_err(InputError::io(file, "file"));
                of_suite(self.suite.as_ref(), found.map_err(Into::into))?;
            }
        }
        for scene in &self.plan.scenes {
            scene::check_fits(&scene.source, &self.plan.load)?;
        }
        of_suite(self.suite.as_ref(), self.check_scenes(&[]))
    }

    /// Checks that plan and files of a started run are unchanged.
    pub fn check_goes_on(&self, begun: &Stream) -> Result<()> {
        let structures = self.plan.structures.iter().map(|s| &s.label);
        if self.plan.groups() != begun.header.groups || !structures.eq(&begun.header.structures) {
            bail!(
                "holds the run of another plan, or a merged one; expected the recorded plan: begin \
                 a new run, or resume the shards"
            );
        }
        self.check_scenes(&begun.parts)
    }

    /// Loads every scene and every path of it; they must match the parts `begun`.
    fn check_scenes(&self, begun: &[StoredPart]) -> Result<()> {
        let plain = Culling::default();
        let is_plain = |culling: &Culling| {
            (culling.arithmetic, culling.planes) == (plain.arithmetic, plain.planes)
        };
        let as_it_comes =
            self.plan.lens == LensDefaults::default() && self.plan.cullings.iter().all(is_plain);
        if self.is_built_in && as_it_comes && self.plan.motions.is_empty() {
            return Ok(());
        }
        for PlannedScene { source, paths, .. } in &self.plan.scenes {
            let scene = scene::load(source, &self.plan.load)?;
            let parts = begun.iter().map(|kept| &kept.part);
            let parts = parts.filter(|part| part.key.scene == scene.name);
            let known = parts.clone().find(|part| !part.scene.digest.is_empty());
            let before = known.map(|part| part.scene.digest.clone());
            same_digest("scene", &scene.name, before, || scene.digest())?;
            for source in paths {
                let path = path::load(source, &scene, &self.plan.lens)?;
                for culling in &self.plan.cullings {
                    let moved = self.plan.motions.iter().map(Some);
                    let still = self.plan.motions.is_empty().then_some(None);
                    for motion in moved.chain(still) {
                        let motion = motion.map(|motion| Motion::load(motion, &scene));
                        let (motion, views) = (motion.transpose()?, self.plan.views_per_frame);
                        let motion = motion.inspect(|own| own.tell_numbers(&path, views));
                        let workload = self.plan.workload(&scene, &path, culling, motion)?;
                        let Ok(workload) = workload else { continue };
                        let moved = workload.motion.as_ref().map_or("", |own| &own.name);
                        let (what, name) = match moved {
                            "" => ("path", source.as_str()),
                            _ => ("path or motion", moved),
                        };
                        let is_it = |p: &&Part| p.key.path == *source && p.key.motion == moved;
                        let mut own = parts.clone().filter(is_it);
                        let before = own.find_map(|part| part.path.digest.clone());
                        same_digest(what, name, before, || workload.digest())?;
                    }
                }
            }
        }
        tell_warnings();
        Ok(())
    }
}

/// Refuses to continue a run whose input has changed.
pub fn same_digest(
    what: &str,
    name: &str,
    before: Option<String>,
    now: impl Fn() -> String,
) -> Result<()> {
    let Some(before) = before else {
        return Ok(());
    };
    let now = now();
    ensure!(
        before == now,
        "{what} '{name}' has changed since the run was begun: its digest was {before:.12} and is \
         {now:.12}; expected the same: begin a new run"
    );
    Ok(())
}

/// Scenes of the plan, and a line about omitted ones of the suite.
fn scenes(args: &WhatArgs, suite: &Suite) -> Result<(Vec<PlannedScene>, Option<String>)> {
    let (mut scenes, mut left_out) = (suite.scenes.clone(), None);
    if !args.scene.is_empty() {
        scenes.clear();
        for source in &args.scene {
            let parts = every_part(source)?.into_iter();
            scenes.extend(parts.map(|source| PlannedScene::new(&source, &[DEFAULT_PATH])));
        }
    } else if suite.name == REAL {
        let own = FETCHED.iter().filter(|row| !row.scenes().is_empty());
        let (there, missing): (Vec<_>, Vec<_>) = own.partition(|row| row.is_there());
        let there = there.into_iter().flat_map(Fetched::scenes);
        scenes.extend(there.map(|source| PlannedScene::new(&source, REAL_PATHS)));
        if !missing.is_empty() {
            let names: String = missing.iter().map(|row| format!(" {}", row.name)).collect();
            let place = format!("{FETCHED_FOLDER} of the working directory");
            let how = "(scripts/fetch.py fetches them)";
            let line = format!("left out, as missing or damaged in {place} {how}:{names}");
            note(&line);
            left_out = Some(line);
        }
    }
    for scene in &mut scenes {
        scene.cold |= args.cold;
        if !args.path.is_empty() {
            scene.paths.clone_from(&args.path);
        }
    }
    Ok((scenes, left_out))
}
