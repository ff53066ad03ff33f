//! Origin of a figure: machine, toolchain and source.
//!
//! A fact that cannot be determined is null, never a guess.

use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};
use sysinfo::{CpuRefreshKind, MemoryRefreshKind, RefreshKind, System};

use crate::kernel::Kernel;
use crate::scene::hex;
use crate::shown::counted;

/// The machine of a run; facts that the system does not provide are `None`.
#[derive(Clone, Default, PartialEq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Machine {
    /// Model name of the processor.
    pub cpu: Option<String>,
    /// SIMD features by which kernels may be chosen.
    pub features: Vec<String>,
    /// The kernel of the queries, one of those that this processor runs.
    pub instruction_set: String,
    /// Logical processors that this process may use.
    pub cores: usize,
    /// Logical processors of the whole machine, to which the load refers.
    pub machine_cores: Option<usize>,
    /// Data and unified caches of the first core, innermost first.
    pub caches: Vec<Cache>,
    /// Physical memory.
    pub memory_bytes: Option<u64>,
    /// Name and version of the operating system.
    pub os: Option<String>,
    /// Version of the operating system's kernel.
    pub kernel: Option<String>,
    /// Load average over one minute at the start.
    pub load: Option<f64>,
}

/// One cache of a processor core.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Cache {
    /// 1 is the innermost.
    pub level: u32,
    /// Size in bytes.
    pub bytes: u64,
}

/// Compiler and settings of the build; unknown facts are `None`.
#[derive(Clone, Default, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Toolchain {
    /// `rustc --version`.
    pub rustc: Option<String>,
    /// Target triple.
    pub target: Option<String>,
    /// RUSTFLAGS, separated by blanks.
    pub flags: String,
    /// Cargo profile, `release`.
    pub profile: Option<String>,
    /// `opt-level` of that profile.
    pub opt_level: Option<String>,
    /// Cargo features without `default`.
    pub features: Vec<String>,
    /// SHA-256 of Cargo.lock, which pins the dependencies.
    pub lock_digest: String,
}

/// Source of the build.
#[derive(Clone, Default, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Source {
    /// Version of the program; for a program of another crate, also of this crate.
    pub version: String,
    /// Git commit; `None` for a build from a package.
    pub commit: Option<String>,
    /// True if files differed from the commit when the program was built.
    pub dirty: Option<bool>,
}

impl Machine {
    /// This machine, with its best kernel.
    pub fn capture() -> Machine {
        let wanted = RefreshKind::nothing()
            .with_cpu(CpuRefreshKind::nothing())
            .with_memory(MemoryRefreshKind::nothing().with_ram());
        let system = System::new_with_specifics(wanted).ok();
        let cpu = system.as_ref().and_then(|system| system.cpus().first());
        let brand = cpu.map(|cpu| cpu.brand().trim().to_owned());
        Machine {
            cpu: brand.filter(|brand| !brand.is_empty()),
            features: simd_features(),
            instruction_set: Kernel::best().name().to_owned(),
            machine_cores: system.as_ref().map(|s| s.cpus().len()),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            caches: caches(Path::new("/sys/devices/system/cpu/cpu0/cache")),
            memory_bytes: system.map(|s| s.total_memory()),
            os: System::long_os_version().ok(),
            kernel: System::kernel_version().ok(),
            load: System::load_average().ok().map(|load| load.one),
        }
    }

    /// The same machine with another kernel of queries.
    pub fn by(mut self, kernel: Kernel) -> Machine {
        self.instruction_set = kernel.name().to_owned();
        self
    }

    /// Sentence about a busy machine: a load of half a process per core or more.
    pub fn busy(&self) -> Option<String> {
        let cores = self.machine_cores.unwrap_or(self.cores);
        let load = self.load.filter(|load| *load > 0.5 * cores as f64)?;
        let cores = counted(cores, "core");
        Some(format!(
            "the machine, of {cores}, was already busy (load average {load:.1})"
        ))
    }

    /// Number of bytes that evict everything else from the caches.
    ///
    /// Twice the last level, at least 64 MiB.
    pub fn cache_sweep_bytes(&self) -> usize {
        let last = self.caches.iter().map(|c| c.bytes).max().unwrap_or(0);
        usize::try_from((2 * last).max(64 << 20)).unwrap_or(usize::MAX)
    }

    /// A short name for folders: `amd-epyc-2c`.
    pub fn slug(&self) -> String {
        let brand = self.cpu.as_deref().unwrap_or("unknown");
        let words = brand.split(|c: char| !c.is_ascii_alphanumeric());
        let words = words.filter(|w| !w.is_empty()).take(3);
        let short: Vec<String> = words.map(str::to_ascii_lowercase).collect();
        format!("{}-{}c", short.join("-"), self.cores)
    }
}

fn simd_features() -> Vec<String> {
    let mut found = Vec::new();
    #[cfg(target_arch = "x86_64")]
    {
        macro_rules! detect {
            ($($name:tt),*) => {
                $(if std::arch::is_x86_feature_detected!($name) { found.push($name.to_owned()); })*
            };
        }
        detect!("sse2", "sse4.2", "avx", "avx2", "fma", "bmi2");
        detect!("avx512f", "avx512bw", "avx512vl", "avx512vbmi2");
    }
    #[cfg(target_arch = "aarch64")]
    if std::arch::is_aarch64_feature_detected!("neon") {
        found.push("neon".to_owned());
    }
    found
}

/// Linux lists a core's caches as folders; other systems have no such list.
fn caches(folder: &Path) -> Vec<Cache> {
    let read = |index: usize, name: &str| -> Option<String> {
        let text = fs::read_to_string(folder.join(format!("index{index}/{name}"))).ok()?;
        Some(text.trim().to_owned())
    };
    let cache = |index: usize| -> Option<Cache> {
        read(index, "type").filter(|kind| kind != "Instruction")?;
        let size = read(index, "size")?;
        let bytes = match size.strip_suffix('K') {
            Some(kilo) => kilo.parse::<u64>().ok()? << 10,
            None => size.strip_suffix('M')?.parse::<u64>().ok()? << 20,
        };
        let level = read(index, "level")?.parse().ok()?;
        Some(Cache { level, bytes })
    };
    (0..8).filter_map(cache).collect()
}

/// A value that build.rs passed in the environment; empty means unknown.
fn built_with(value: &str) -> Option<String> {
    Some(value.to_owned()).filter(|v| !v.is_empty())
}

impl Toolchain {
    /// The facts that the build script compiled into this program.
    pub fn capture() -> Toolchain {
        let lock = include_bytes!("../../Cargo.lock");
        let features = env!("CULLBENCH_FEATURES").split(',');
        let features = features.filter(|f| !f.is_empty());
        Toolchain {
            rustc: built_with(env!("CULLBENCH_RUSTC")),
            target: built_with(env!("CULLBENCH_TARGET")),
            flags: env!("CULLBENCH_RUSTFLAGS").to_owned(),
            profile: built_with(env!("CULLBENCH_PROFILE")),
            opt_level: built_with(env!("CULLBENCH_OPT_LEVEL")),
            features: features.map(str::to_owned).collect(),
            lock_digest: hex(&hmac_sha256::Hash::hash(lock)),
        }
    }
}

impl Source {
    /// The facts that the build script compiled into this program.
    pub fn capture() -> Source {
        Source {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            commit: built_with(env!("CULLBENCH_COMMIT")),
            dirty: built_with(env!("CULLBENCH_DIRTY")).map(|d| d == "true"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_machine_and_the_build_are_known_here() {
        let machine = Machine::capture();
        assert!(machine.cores >= 1 && machine.memory_bytes > Some(0));
        assert!(machine.slug().ends_with('c') && !machine.slug().contains(' '));
        assert!(machine.cache_sweep_bytes() >= 64 << 20);
        let toolchain = Toolchain::capture();
        assert!(toolchain.rustc.unwrap().starts_with("rustc 1."));
        assert_eq!(toolchain.lock_digest.len(), 64);
    }

    #[test]
    fn a_load_is_of_the_machine_and_not_of_the_cores_of_a_process() {
        let machine = |load, machine_cores| Machine {
            cores: 1,
            machine_cores,
            load,
            ..Machine::default()
        };
        assert_eq!(machine(Some(5.0), Some(64)).busy(), None);
        let told = machine(Some(40.0), Some(64)).busy().unwrap();
        assert!(
            told.contains("of 64 cores, was already busy (load average 40.0)"),
            "{told}"
        );
        // Older reports have the processors of the process alone.
        assert!(machine(Some(5.0), None).busy().is_some());
        let here = Machine::capture();
        assert!(here.machine_cores >= Some(here.cores));
    }

    #[test]
    fn cache_sizes_are_read_from_the_folders() {
        let folder = tempfile::tempdir().unwrap();
        for (index, kind, level, size) in [
            (0, "Data", 1, "48K"),
            (1, "Instruction", 1, "32K"),
            (2, "Unified", 3, "32M"),
        ] {
            let at = folder.path().join(format!("index{index}"));
            fs::create_dir(&at).unwrap();
            for (name, text) in [
                ("type", kind.to_owned()),
                ("level", level.to_string()),
                ("size", size.to_owned()),
            ] {
                fs::write(at.join(name), text + "\n").unwrap();
            }
        }
        let wanted = [
            Cache {
                level: 1,
                bytes: 48 << 10,
            },
            Cache {
                level: 3,
                bytes: 32 << 20,
            },
        ];
        assert_eq!(caches(folder.path()), wanted);
    }
}
