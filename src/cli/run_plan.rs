//! What `cullbench run` is to do: scenes, ways through them, structures and
//! culling tests, checked as far as possible before anything runs.

use anyhow::bail;

use super::args::RunArgs;
use cullbench::culling::{Culling, CullingTest};
use cullbench::index::{StructureSpec, structures};
use cullbench::measure::Workload;
use cullbench::path::{self, LensDefaults};
use cullbench::scene::{self, LoadOptions};
use cullbench::spec::SpecError;
use cullbench::suite::{DEFAULT_PATH, SUITES, Suite};

/// What is to be done, checked as far as possible before anything runs.
pub struct Plan {
    pub suite: &'static Suite,
    /// Whether scenes and paths are the suite's own.
    pub from_suite: bool,
    pub scenes: Vec<PlannedScene>,
    pub structures: Vec<StructureSpec>,
    /// The culling tests with everything else as asked for.
    pub cullings: Vec<Culling>,
    pub lens: LensDefaults,
    pub load: LoadOptions,
}

/// A scene with the ways through it.
pub struct PlannedScene {
    pub source: String,
    pub paths: Vec<String>,
    /// Whether caches are cold: the states to measure.
    caches: &'static [bool],
}

const WARM: &[bool] = &[false];
const WARM_AND_COLD: &[bool] = &[false, true];

impl Plan {
    pub fn new(args: &RunArgs) -> anyhow::Result<Plan> {
        let suite = Suite::named(&args.suite).ok_or_else(|| {
            SpecError::unknown("suite", &args.suite, SUITES.iter().map(|s| s.name))
        })?;
        let tests = args.test.iter().flat_map(|t| t.split(','));
        let mut cullings: Vec<Culling> = Vec::new();
        for test in tests {
            let culling = args.culling.culling(test)?;
            culling.check()?;
            if cullings.contains(&culling) {
                bail!("test '{test}' is named twice");
            }
            cullings.push(culling);
        }
        let plan = Plan {
            suite,
            from_suite: args.scene.is_empty() && args.path.is_empty(),
            scenes: scenes(args, suite),
            structures: structures(&args.structure.join(","))?,
            cullings,
            lens: args.lens.defaults()?,
            load: LoadOptions {
                skip_bad_items: args.scene_args.skip_bad_items,
            },
        };
        plan.check_names()?;
        // A suite as it comes is known to be sound.
        let as_it_comes = plan.lens == LensDefaults::default()
            && plan.cullings.iter().all(|c| {
                let test = c.test;
                *c == Culling {
                    test,
                    ..Culling::default()
                }
            });
        if !(plan.from_suite && as_it_comes) {
            plan.check_inputs()?;
        }
        Ok(plan)
    }

    /// A cell is found by its names: each may come once.
    fn check_names(&self) -> anyhow::Result<()> {
        for (i, PlannedScene { source, paths, .. }) in self.scenes.iter().enumerate() {
            if self.scenes[..i].iter().any(|other| other.source == *source) {
                bail!("scene '{source}' is named twice");
            }
            for (k, path) in paths.iter().enumerate() {
                if paths[..k].contains(path) {
                    bail!("path '{path}' is named twice");
                }
            }
        }
        Ok(())
    }

    /// A mistake in the last file should not show after an hour.
    fn check_inputs(&self) -> anyhow::Result<()> {
        for PlannedScene { source, paths, .. } in &self.scenes {
            let scene = scene::load(source, &self.load)?;
            for source in paths {
                let path = path::load(source, &scene, &self.lens)?;
                for culling in &self.cullings {
                    Workload::new(&scene, &path, culling)?;
                }
            }
        }
        Ok(())
    }

    /// Everything that is asked on a scene: tests over boxes
    /// before those over spheres, so that structures are built twice at most.
    pub fn questions(&self, scene: &PlannedScene) -> Vec<Question> {
        let mut questions = Vec::new();
        let of_spheres = |c: &&Culling| c.test == CullingTest::Sphere;
        let (spheres, boxes): (Vec<&Culling>, Vec<&Culling>) =
            self.cullings.iter().partition(of_spheres);
        for cullings in [boxes, spheres] {
            for path in &scene.paths {
                for &cold in scene.caches {
                    let tests = cullings.iter().map(|c| c.test.name().to_owned());
                    questions.extend(tests.map(|test| (path.clone(), cold, test)));
                }
            }
        }
        questions
    }

    pub fn culling(&self, test: &str) -> Culling {
        let named = self.cullings.iter().find(|c| c.test.name() == test);
        named.copied().unwrap_or_default()
    }

    /// How many questions there are on all scenes.
    pub fn groups(&self) -> u64 {
        let of_scene = |scene: &PlannedScene| scene.paths.len() * scene.caches.len();
        let ways: usize = self.scenes.iter().map(of_scene).sum();
        (ways * self.cullings.len()) as u64
    }
}

fn scenes(args: &RunArgs, suite: &Suite) -> Vec<PlannedScene> {
    let scene = |source: &str, paths: &[&str], cold: bool| PlannedScene {
        source: source.to_owned(),
        paths: match args.path.is_empty() {
            true => paths.iter().map(|&p| p.to_owned()).collect(),
            false => args.path.clone(),
        },
        caches: if cold { WARM_AND_COLD } else { WARM },
    };
    if args.scene.is_empty() {
        let rows = suite.plan.iter();
        return rows
            .map(|row| scene(row.scene, row.paths, row.cold || args.cold))
            .collect();
    }
    let chosen = args.scene.iter();
    chosen
        .map(|source| scene(source, &[DEFAULT_PATH], args.cold))
        .collect()
}

/// A path, whether caches are cold, and the culling test.
pub type Question = (String, bool, String);
