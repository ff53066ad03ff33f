//! Options of several commands.
//!
//! Scenes, lenses, culling tests, instruction sets, and the processes of a study.

use std::collections::BTreeSet;

use super::text;
use crate::camera::{
    DEFAULT_EPSILON, MATRIX_CONVENTIONS, MatrixConvention, PLANE_METHODS, PlaneMethod, PlaneOptions,
};
use crate::culling::{ARITHMETICS, Arithmetic, Culling, TESTS};
use crate::index::{DEFAULT, Execution, MOTION, Registry, StructureSpec, UpdatePolicy};
use crate::kernel::{KERNELS, Kernel};
use crate::measure::{Machine, Plan, Protocol};
use crate::path::{DEFAULT_PATH, LensDefaults};
use crate::scene::{ITEM_KINDS, ItemKind, LoadOptions, UP_AXES, UpAxis};
use crate::spec::values;
use crate::threads::MOST_THREADS;
use anyhow::{Result, bail, ensure};
use clap::{Args, ValueEnum};

#[derive(Args, Debug)]
pub struct SceneArgs {
    /// Leave out rows of the scene's boxes CSV that are not finite boxes, and report
    /// their number; the others keep their ids
    #[arg(long)]
    pub skip_bad_items: bool,
    /// Up axis of boxes CSV and OBJ, y or z; other scenes state theirs [default: z of
    /// boxes, y of OBJ]
    #[arg(long, value_name = "AXIS", value_parser = values::choice("up axis", &UP_AXES))]
    pub up: Option<UpAxis>,
    /// Items of scenes with triangles (OBJ, glTF, meshes): objects or triangles; of
    /// Quake III maps also surfaces or brushes alone
    #[arg(long, value_name = "KIND", default_value = "objects", value_parser = values::choice("kind of item", &ITEM_KINDS))]
    pub items: ItemKind,
}

impl SceneArgs {
    /// Load options of a scene for n `structures`.
    pub fn options(&self, structures: usize) -> LoadOptions {
        LoadOptions {
            skip_bad_items: self.skip_bad_items,
            up: self.up,
            items: self.items,
            structures: structures as u64,
            per_triangle: 0,
        }
    }
}

/// Options of a measurement, shared by `run` and `compare --against`.
#[derive(Args, Debug)]
pub struct WhatArgs {
    /// Scenes, paths and rounds: quick, standard, full, real, compare, growth, or
    /// your own in FILE.toml (see the end of `run --help`) [default: quick; compare
    /// --against: compare]
    #[arg(long, value_name = "SUITE")]
    pub suite: Option<String>,
    /// A scene (file or spec) instead of the suite's; may be repeated; maps.wad#* and
    /// pak.pk3#* are all of a file
    #[arg(long, value_name = "SCENE")]
    pub scene: Vec<String>,
    /// A camera path (spec or cameras CSV) instead of the suite's; may be repeated
    #[arg(long, visible_alias = "cameras", value_name = "PATH")]
    pub path: Vec<String>,
    /// Structures, e.g. linear,bvh:leaf=4, or all, or default (all but auto, the
    /// textbook forms and, in still scenes, moving); may be repeated [default: all for the suite standard, else default;
    /// compare --against: the trees, linear and wide]
    #[arg(long, value_name = "LIST")]
    pub structure: Vec<String>,
    /// The culling test: sphere, six-plane, six-box or exact; may be repeated
    #[arg(long, value_name = "TEST", default_value = "six-plane")]
    pub test: Vec<String>,
    /// Seed of the order in which structures are measured
    #[arg(long, default_value_t = 1, value_parser = values::whole(0..=u64::MAX))]
    pub seed: u64,
    /// Measure with cold caches as well (always on in the suite full)
    #[arg(long, conflicts_with = "motion")]
    pub cold: bool,
    /// Do not measure the lower bounds: reading all items, copying all answers
    #[arg(long)]
    pub no_bounds: bool,
    /// Seconds without progress after which a structure has timed out
    #[arg(long, value_name = "SECONDS", default_value_t = 300, value_parser = values::whole(1..=u64::MAX))]
    pub timeout: u64,
    #[command(flatten)]
    pub moves: MotionArgs,
    #[command(flatten)]
    pub culling: CullingArgs,
}

/// Motion of the items, and the frames of it.
#[derive(Args, Debug)]
pub struct MotionArgs {
    /// Move the items: a spec (see `list motions`) or a motion CSV. Measures frames, an
    /// update and queries each, in place of still scenes; run and compare: may be repeated
    #[arg(long, value_name = "MOTION")]
    pub motion: Vec<String>,
    /// Queries per frame, along the path
    #[arg(long, value_name = "N", default_value_t = 1, requires = "motion", value_parser = values::whole(1..=1000usize))]
    pub views: usize,
    /// Work of a frame, a row for each: refit, rebuild, every=N (rebuilt in every n-th
    /// frame)
    #[arg(long, value_name = "LIST", requires = "motion")]
    pub update: Option<String>,
}

/// Refuses a name that comes twice: a cell is found by its names.
pub fn each_once(what: &str, names: impl IntoIterator<Item = impl AsRef<str>>) -> Result<()> {
    let mut seen = BTreeSet::new();
    for name in names {
        let name = name.as_ref();
        ensure!(
            seen.insert(name.to_owned()),
            "{what} '{name}' is named twice; expected each once"
        );
    }
    Ok(())
}

/// Seed of the first of some generated cases.
pub fn first_seed(seed: Option<u64>, cases: u64) -> Result<u64> {
    let is_used = seed.is_none() || cases > 0;
    ensure!(
        is_used,
        "--seed is for generated cases, of which there are none; expected --cases above 0 with it"
    );
    Ok(seed.unwrap_or(1))
}

impl MotionArgs {
    /// The list of structures, with `default` as it is where items move.
    pub fn list<'l>(&self, list: &'l str) -> &'l str {
        match list == DEFAULT && !self.motion.is_empty() {
            true => MOTION,
            false => list,
        }
    }

    /// Enters motions, queries per frame and policies into a plan.
    pub fn enter(&self, plan: &mut Plan) -> Result<()> {
        plan.motions.clone_from(&self.motion);
        plan.views_per_frame = self.views;
        if let Some(list) = &self.update {
            plan.structures = under_policies(list, &plan.structures)?;
        }
        Ok(())
    }
}

/// The structures under each policy of a comma-separated list, `wide@every=10`.
///
/// Labels stay as they are under [`UpdatePolicy::Refit`]. A structure that does not
/// refit is built again in any case: it appears once.
fn under_policies(list: &str, specs: &[StructureSpec]) -> Result<Vec<StructureSpec>> {
    let policies = list.split(',').map(|text| text.trim().parse());
    let policies: Vec<UpdatePolicy> = policies.collect::<Result<_, _>>()?;
    each_once("--update", policies.iter().map(ToString::to_string))?;
    let mut all: Vec<StructureSpec> = Vec::new();
    for spec in specs {
        for &policy in &policies {
            let mut own = spec.clone();
            if spec.info().refits && policy != UpdatePolicy::Refit {
                own.policy = policy;
                own.label += &format!("@{policy}");
            }
            if all.iter().all(|entered| entered.label != own.label) {
                all.push(own);
            }
        }
    }
    Ok(all)
}

/// Instruction set and threads; answers do not depend on them.
#[derive(Args, Debug)]
pub struct KernelArgs {
    /// Instruction set: portable, avx2 or avx512 [default: the best of this machine]
    #[arg(long = "kernel", value_name = "NAME", value_parser = values::choice("kernel", &KERNELS))]
    pub name: Option<Kernel>,
    /// Threads per build (of query and locate also for cameras and points). With a
    /// list, such as 1,2,4, structures with the parameter 'threads' are entered for each
    #[arg(long, value_name = "N,..", default_value = "1", value_delimiter = ',',
        value_parser = values::whole(1..=MOST_THREADS))]
    pub threads: Vec<usize>,
}

impl KernelArgs {
    /// The structures of a list, with this instruction set and these threads.
    pub fn structures(&self, registry: &Registry, list: &str) -> Result<Vec<StructureSpec>> {
        let execution = self.execution()?;
        let mut specs: Vec<StructureSpec> = Vec::new();
        for spec in registry.structures(list)? {
            let join = if spec.label.contains(':') { ',' } else { ':' };
            let of_several = |n: &&usize| self.threads.len() > 1 && **n > 1;
            let shared = self.threads.iter().filter(of_several);
            let labels = shared.map(|n| format!("{}{join}threads={n}", spec.label));
            // A structure without the parameter is entered once.
            let shared = labels.filter_map(|label| registry.structure(&label).ok());
            for spec in [spec.clone()].into_iter().chain(shared) {
                if specs.iter().all(|entered| entered.label != spec.label) {
                    specs.push(spec);
                }
            }
        }
        Ok(specs.into_iter().map(|spec| spec.by(execution)).collect())
    }

    /// The instruction set, and the largest number of threads.
    ///
    /// Fails if this machine lacks the instruction set, or for a number named twice.
    pub fn execution(&self) -> Result<Execution> {
        let kernel = self.name.unwrap_or_else(Kernel::best);
        ensure!(
            kernel.is_available(),
            "kernel '{kernel}' needs instructions that this processor does not have; available: {}",
            text::joined(Kernel::available().map(Kernel::name))
        );
        each_once("--threads", self.threads.iter().map(ToString::to_string))?;
        let threads = self.threads.iter().copied().max().unwrap_or(1);
        Ok(Execution { kernel, threads })
    }
}

/// The scene, cameras and structures of a study, and its processes.
#[derive(Args, Debug)]
pub struct StudyArgs {
    /// A scene: boxes CSV, glTF, OBJ, Doom or Quake III map, zip, built-in name or spec
    #[arg(long)]
    pub scene: String,
    /// A camera path: a spec or a cameras CSV
    #[arg(long, visible_alias = "cameras", value_name = "PATH", default_value = DEFAULT_PATH)]
    pub path: String,
    /// Structures, e.g. linear,bvh:leaf=4
    #[arg(long, value_name = "LIST", default_value = "default")]
    pub structure: String,
    #[command(flatten)]
    pub spread: SpreadArgs,
    #[command(flatten)]
    pub lens: LensArgs,
    #[command(flatten)]
    pub kernel: KernelArgs,
}

/// Distribution of measurements over processes, for a study of one scene and path.
#[derive(Args, Debug)]
pub struct SpreadArgs {
    /// Processes to spread the rounds over; ten or more give intervals, one gives none
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = values::whole(1..=1000u32))]
    pub processes: u32,
    /// Random seed: order of measurement; of precision also the scenes of sweeps
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = values::whole(0..=u64::MAX))]
    pub seed: u64,
}

impl SpreadArgs {
    /// The protocol of one of the processes, with its share of the `rounds` of a study.
    pub fn protocol(&self, [least, most]: [usize; 2], process: u32) -> Protocol {
        let processes = self.processes as usize;
        Protocol {
            rounds: [
                (least / processes).max(LEAST_ROUNDS),
                (2 * most / processes).clamp(LEAST_ROUNDS, most),
            ],
            task_ns: TASK_NS / f64::from(self.processes),
            cameras: usize::MAX,
            cold: false,
            // Other orders in each process.
            seed: self.seed.wrapping_add(u64::from(process)),
            cache_bytes: Machine::capture().cache_sweep_bytes(),
        }
    }
}

/// Minimum rounds per process, so that a mean can exclude a disturbed round.
const LEAST_ROUNDS: usize = 3;
/// CPU time of a task in all processes, ns.
const TASK_NS: f64 = 150e6;

/// Reading of a scene, and the lens of cameras without their own values.
#[derive(Args, Debug)]
pub struct LensArgs {
    #[command(flatten)]
    pub scene_args: SceneArgs,
    /// Vertical field of view in degrees for cameras without one [default: 60]
    #[arg(long, value_name = "DEG", value_parser = values::field_of_view)]
    pub fovy: Option<f64>,
    /// Width / height for cameras without one [default: 1.778, 16 by 9]
    #[arg(long, value_parser = values::above_zero)]
    pub aspect: Option<f64>,
    /// Near plane for cameras without one [default: far / 1000, 0.1 for street;
    /// at most the default far / 1000, for recorded cameras 2 x the scene's diagonal /
    /// 1000]
    #[arg(long, value_parser = values::above_zero)]
    pub near: Option<f64>,
    /// Far plane for cameras without one, or inf; beyond 1.7e38 counts as inf [default:
    /// twice the scene's diagonal for recorded cameras, and at least the far side of the
    /// scene, as for paths]
    #[arg(long, value_parser = values::far)]
    pub far: Option<f64>,
    /// Convention of cameras given as matrices (columns m00 to m33: row, column):
    /// column-gl or column-d3d (clip = M x, depth -1..1 or 0..1), row-gl or row-d3d
    /// (clip = x M); reversed depth and infinite far are recognised; append -reversed for
    /// orthographic matrices with reversed depth
    #[arg(long, value_name = "NAME", value_parser = values::choice("matrix convention", &MATRIX_CONVENTIONS))]
    pub matrix_convention: Option<MatrixConvention>,
}

impl LensArgs {
    pub fn defaults(&self) -> Result<LensDefaults> {
        if let (Some(near), Some(far)) = (self.near, self.far)
            && near >= far
        {
            bail!("--near is {near} and --far {far}; expected near < far");
        }
        Ok(LensDefaults {
            matrix: self.matrix_convention,
            fovy_deg: self.fovy,
            aspect: self.aspect,
            near: self.near,
            far: self.far.map(|far| Some(far).filter(|far| far.is_finite())),
            ..LensDefaults::default()
        })
    }
}

/// Lens, derivation of planes, numbers of the culling test, and its execution.
#[derive(Args, Debug)]
pub struct CullingArgs {
    #[command(flatten)]
    pub lens: LensArgs,
    /// Derivation of the planes: frame, frame-f32, or by Gribb and Hartmann (gh)
    /// from a matrix of OpenGL (gl), D3D (d3d) or reversed z (revz): gh-gl-f32,
    /// gh-gl-f64, gh-d3d-f32, gh-d3d-f64, gh-revz-f32, gh-revz-f64
    #[arg(long, value_name = "METHOD", default_value = "frame", value_parser = values::choice("plane method", &PLANE_METHODS))]
    pub planes: PlaneMethod,
    /// Planes move outward by C roundings of f32; 0 leaves them as derived
    /// [default: 8; 0 with f64, which has no margin]
    // With the largest one everything is visible.
    #[arg(long, value_name = "C", value_parser = values::within(0.0..=1e9))]
    pub epsilon: Option<f64>,
    /// Numbers of the culling test: f32, f64, or f32-relative (f32 about the eye)
    #[arg(long, value_name = "NUMBERS", default_value = "f32", value_parser = values::choice("arithmetic", &ARITHMETICS))]
    pub arithmetic: Arithmetic,
    #[command(flatten)]
    pub kernel: KernelArgs,
}

impl CullingArgs {
    /// The culling test of that name, with the other settings from the options.
    pub fn culling(&self, test: &str) -> Result<Culling> {
        if let (Some(c), Arithmetic::F64) = (self.epsilon.filter(|&c| c > 0.0), self.arithmetic) {
            bail!("--epsilon is {c} with --arithmetic f64, which has none; expected 0, or f32");
        }
        let (method, epsilon) = (self.planes, self.epsilon.unwrap_or(DEFAULT_EPSILON));
        let planes = PlaneOptions { method, epsilon };
        let test = values::choice("test", &TESTS)(test)?;
        Ok(Culling::new(test, self.arithmetic, planes))
    }
}

/// Output formats for people and programs.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum, Debug)]
pub enum TableFormat {
    Table,
    Json,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum, Debug)]
pub enum RowFormat {
    Csv,
    Json,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn policies_make_rows_and_mistakes_are_named() {
        let specs = Registry::builtin()
            .structures("wide,octree-textbook")
            .unwrap();
        let labels = |list: &str| -> Result<Vec<String>, String> {
            let all = under_policies(list, &specs).map_err(|e| e.to_string())?;
            Ok(all.into_iter().map(|spec| spec.label).collect())
        };
        let found = labels("refit,rebuild,every=10").unwrap();
        assert_eq!(
            found.join(","),
            "wide,wide@rebuild,wide@every=10,octree-textbook"
        );
        assert_eq!(
            labels("rebuild").unwrap(),
            ["wide@rebuild", "octree-textbook"]
        );
        for bad in ["", "often", "every", "every=1", "every=x", "refit=1"] {
            let error = labels(bad).unwrap_err();
            assert!(error.contains("expected refit, rebuild"), "{bad}: {error}");
        }
        assert!(labels("refit,refit").unwrap_err().contains("named twice"));
    }
}
