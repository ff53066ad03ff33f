//! Options that several commands take: how scenes are read, what cameras lack,
//! how a view is made and tested, how queries are computed. Values are checked
//! where they are used.

use crate::camera::{
    DEFAULT_EPSILON, MATRIX_CONVENTIONS, MatrixConvention, PLANE_METHODS, PlaneMethod, PlaneOptions,
};
use crate::culling::{ARITHMETICS, Arithmetic, Culling, CullingTest, TESTS};
use crate::index::{Execution, Registry, StructureSpec};
use crate::kernel::Kernel;
use crate::measure::{Beside, Effort, Machine, Protocol};
use crate::path::LensDefaults;
use crate::spec::SpecError;
use crate::threads::MOST_THREADS;
use clap::Args;
use glam::DVec3;

#[derive(Args, Debug)]
pub struct SceneArgs {
    /// Leave out items that are no finite box, and report their number
    #[arg(long)]
    pub skip_bad_items: bool,
}

/// How queries are computed; the answers are the same.
#[derive(Args, Debug)]
pub struct KernelArgs {
    /// Instruction set: portable, avx2 or avx512 [default: the best of this machine]
    #[arg(long = "kernel", value_name = "NAME")]
    pub name: Option<String>,
    /// Threads that a build may use, and that query and locate share cameras and points among
    #[arg(
        long,
        value_name = "N",
        default_value = "1",
        allow_negative_numbers = true
    )]
    pub threads: String,
}

impl KernelArgs {
    /// The structures of a list, to be built and asked in this way.
    pub fn structures(
        &self,
        registry: &Registry,
        list: &str,
    ) -> Result<Vec<StructureSpec>, SpecError> {
        let execution = self.execution()?;
        let specs = registry.structures(list)?.into_iter();
        Ok(specs.map(|spec| spec.by(execution)).collect())
    }

    pub fn execution(&self) -> Result<Execution, SpecError> {
        let threads = match self.threads.parse() {
            Ok(count @ 1..=MOST_THREADS) => count,
            _ => {
                return Err(SpecError::new(format_args!(
                    "--threads is '{}'; expected a whole number from 1 to {MOST_THREADS}",
                    self.threads
                )));
            }
        };
        let Some(name) = self.name.as_deref() else {
            return Ok(Execution {
                threads,
                ..Execution::default()
            });
        };
        let Some(kernel) = Kernel::named(name) else {
            let known = Kernel::ALL.iter().map(|kernel| kernel.name());
            return Err(SpecError::unknown("kernel", name, known));
        };
        let kernel = kernel.checked().map_err(|error| {
            let here: Vec<_> = Kernel::available().map(Kernel::name).collect();
            SpecError::new(format_args!("{error}; here are: {}", here.join(", ")))
        })?;
        Ok(Execution { kernel, threads })
    }
}

/// How times are spread over processes, for a study of one scene and path.
#[derive(Args, Debug)]
pub struct SpreadArgs {
    /// Processes to spread the rounds over; ten or more give intervals, one gives values alone
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub processes: u32,
    /// Seed of whatever is drawn at random, also of the order in which things are measured
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
}

impl SpreadArgs {
    /// How much of a study that takes so many rounds by itself is one process's.
    pub fn effort(&self, rounds: [usize; 2]) -> Effort {
        let processes = self.processes as usize;
        let [least, most] = rounds;
        Effort {
            processes: self.processes,
            rounds: [
                (least / processes).max(LEAST_ROUNDS),
                (2 * most / processes).clamp(LEAST_ROUNDS, most),
            ],
            task_ns: TASK_NS / f64::from(self.processes),
            pass_ns: PASS_NS,
            beside: Beside::RegionSearch,
        }
    }

    /// The protocol of one of the processes, for so many items.
    pub fn protocol(&self, effort: &Effort, process: u32, cameras: usize) -> Protocol {
        Protocol {
            rounds: effort.rounds,
            task_ns: effort.task_ns,
            cameras,
            cold: false,
            // Other orders in each process.
            seed: self.seed.wrapping_add(u64::from(process)),
            cache_bytes: Machine::capture().cache_sweep_bytes(),
        }
    }
}

/// Fewest rounds of a process: of fewer no mean leaves out a disturbed one.
const LEAST_ROUNDS: usize = 3;
/// CPU time of a task in all processes, ns.
const TASK_NS: f64 = 150e6;
/// Time of a plain loop over all items by all timed cameras, ns.
const PASS_NS: f64 = 20e6;

/// Values for cameras that do not bring their own.
#[derive(Args, Debug)]
pub struct LensArgs {
    /// Vertical field of view in degrees for cameras without one
    #[arg(
        long,
        value_name = "DEG",
        default_value_t = 60.0,
        allow_negative_numbers = true
    )]
    pub fovy: f64,
    /// Width / height for cameras without one
    #[arg(long, default_value_t = 16.0 / 9.0, allow_negative_numbers = true)]
    pub aspect: f64,
    /// Near plane for cameras without one [default: 0.1 for recorded cameras, far/1000 for paths]
    #[arg(long, allow_negative_numbers = true)]
    pub near: Option<f64>,
    /// Far plane for cameras without one, or inf [default: 1000 for recorded cameras, the scene for paths]
    #[arg(long, allow_negative_numbers = true)]
    pub far: Option<String>,
    /// How cameras that are matrices (columns m00 to m33: row, column) are read: column-gl or column-d3d (clip = M x, depth -1..1 or 0..1), row-gl or row-d3d (clip = x M); reversed depth and infinite far as they come
    #[arg(long, value_name = "NAME")]
    pub matrix_convention: Option<String>,
}

impl LensArgs {
    pub fn defaults(&self) -> Result<LensDefaults, SpecError> {
        let far = match self.far.as_deref() {
            None => None,
            Some(text) if text.eq_ignore_ascii_case("inf") => Some(None),
            Some(text) => match text.parse::<f64>() {
                Ok(far) if far.is_finite() => Some(Some(far)),
                _ => {
                    return Err(SpecError::new(format_args!(
                        "--far is '{text}'; expected a finite number or inf"
                    )));
                }
            },
        };
        let matrix = self.matrix_convention.as_deref().map(|name| {
            let known = MATRIX_CONVENTIONS.iter().map(|row| row.1);
            MatrixConvention::named(name)
                .ok_or_else(|| SpecError::unknown("matrix convention", name, known))
        });
        Ok(LensDefaults {
            matrix: matrix.transpose()?,
            fovy_deg: self.fovy,
            aspect: self.aspect,
            near: self.near,
            far,
            up: DVec3::Z,
        })
    }
}

/// How a camera's view is made and tested.
#[derive(Args, Debug)]
pub struct CullingArgs {
    /// Where the planes come from: frame, frame-f32, gh-gl-f32, gh-gl-f64, gh-d3d-f32, gh-d3d-f64, gh-revz-f32, gh-revz-f64
    #[arg(long, value_name = "METHOD", default_value = "frame")]
    pub planes: String,
    /// Factor c of the conservative epsilon; 0 leaves the planes as derived
    #[arg(long, value_name = "C", default_value_t = DEFAULT_EPSILON, allow_negative_numbers = true)]
    pub epsilon: f64,
    /// Numbers the culling test is carried out in: f32, f64, f32-relative
    #[arg(long, value_name = "NUMBERS", default_value = "f32")]
    pub arithmetic: String,
}

impl CullingArgs {
    fn plane_options(&self) -> Result<PlaneOptions, SpecError> {
        let method = PlaneMethod::named(&self.planes).ok_or_else(|| {
            SpecError::unknown(
                "plane method",
                &self.planes,
                PLANE_METHODS.iter().map(|row| row.1),
            )
        })?;
        if !(self.epsilon >= 0.0 && self.epsilon.is_finite()) {
            return Err(SpecError::new(format_args!(
                "--epsilon is {}; expected a number of at least 0",
                self.epsilon
            )));
        }
        Ok(PlaneOptions {
            method,
            epsilon: self.epsilon,
        })
    }

    /// The culling test of that name with everything else as asked for.
    pub fn culling(&self, test: &str) -> Result<Culling, SpecError> {
        Ok(Culling {
            test: CullingTest::named(test)
                .ok_or_else(|| SpecError::unknown("test", test, TESTS.iter().map(|t| t.1)))?,
            arithmetic: Arithmetic::named(&self.arithmetic).ok_or_else(|| {
                let known = ARITHMETICS.iter().map(|a| a.1);
                SpecError::unknown("arithmetic", &self.arithmetic, known)
            })?,
            planes: self.plane_options()?,
        })
    }
}
