//! Memory that a scene needs, and memory that is free.
//!
//! A scene that does not fit is refused before it is made, since measurements are worthless on a
//! machine that swaps.

use std::fs;
use std::path::Path;

use sysinfo::{MemoryRefreshKind, RefreshKind, System};

use super::{LoadOptions, WorldBox};
use crate::geometry::Aabb;
use crate::input::{InputError, Result, gigabytes};

/// Bytes of an item in a scene: rounded for indexes, and as written.
const HELD: u64 = (size_of::<Aabb>() + size_of::<WorldBox>()) as u64;
/// Bytes of an item while the scene is made: the written box exists twice.
const MADE: u64 = HELD + size_of::<WorldBox>() as u64;
/// Bytes of an item in a structure; measured: 28 to 39, and 54 for `moving`.
const INDEXED: u64 = 40;
/// Bytes of an item that a build needs in addition to its structure.
const BUILT: u64 = 64;
/// Number of items or triangles up to which a scene is not checked.
pub const ANYWHERE: u64 = 10_000;
/// Bytes of a triangle while a mesh is made.
///
/// Measured: 117 for the statue, which looks up its points in a table, 20 to 24 for the others.
const MESHED: u64 = 120;
/// Fewest triangles of an item: those of a bush.
const FEWEST: u64 = 24;

/// Approximate bytes of a scene with `structures` built over it.
fn needed_by_items(items: u64, structures: u64) -> u64 {
    let built = if structures > 0 { BUILT } else { 0 };
    items.saturating_mul(MADE.max(HELD + structures * INDEXED + built))
}

impl LoadOptions {
    /// Refuses a scene that would not fit into memory.
    ///
    /// The number of items is estimated from the triangles if it is unknown.
    ///
    /// # Errors
    /// The sizes needed and free.
    pub fn check_fits(&self, scene: &str, items: Option<u64>, triangles: u64) -> Result<()> {
        let made = needed_by_items(items.unwrap_or(triangles / FEWEST), self.structures);
        let needed = made.saturating_add(triangles.saturating_mul(MESHED + self.per_triangle));
        let count = items.unwrap_or(0).max(triangles);
        check_fits(scene, needed, self.structures, count)
    }
}

/// Refuses a scene that needs more bytes than are free.
///
/// A scene of few items or triangles (`count`) passes, and any scene if the free memory is unknown.
///
/// # Errors
/// The sizes needed and free.
pub fn check_fits(scene: &str, needed: u64, structures: u64, count: u64) -> Result<()> {
    let available = (count > ANYWHERE).then(available_bytes).flatten();
    fits(scene, needed, structures, available)
}

fn fits(scene: &str, needed: u64, structures: u64, available: Option<u64>) -> Result<()> {
    let (held, or_fewer) = match structures {
        0 => (String::new(), ""),
        1 => (" with 1 structure".to_owned(), ""),
        more => (format!(" with {more} structures"), " or fewer structures"),
    };
    let expected = format!("a smaller input{or_fewer}");
    fits_into(available, [scene, &held, &expected], needed)
}

/// Refuses what needs more memory than is available; accepts if that is unknown.
pub(crate) fn fits_into(
    available: Option<u64>,
    [what, held, expected]: [&str; 3],
    needed: u64,
) -> Result<()> {
    match available.filter(|available| needed > *available) {
        None => Ok(()),
        Some(free) => Err(InputError::new(format_args!(
            "{what}: needs about {}{held}, {} are free; expected {expected}",
            gigabytes(needed),
            gigabytes(free)
        ))),
    }
}

/// Bytes left by the system, the control groups and the limits of this process.
pub(crate) fn available_bytes() -> Option<u64> {
    let wanted = RefreshKind::nothing().with_memory(MemoryRefreshKind::nothing().with_ram());
    let system = System::new_with_specifics(wanted).ok();
    let free = system.map(|system| system.available_memory());
    let groups = fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    let [limits, status] = ["limits", "status"]
        .map(|file| fs::read_to_string(format!("/proc/self/{file}")).unwrap_or_default());
    let left = [
        free.filter(|bytes| *bytes > 0),
        left_in_groups(Path::new("/sys/fs/cgroup"), &groups),
        left_of_limits(&limits, &status),
    ];
    left.into_iter().flatten().min()
}

/// Address space for the allocator and the stack of another thread.
const THREADS: u64 = 80 << 20;

/// The number after a name at the start of a line; `None` for "unlimited".
fn figure(text: &str, name: &str) -> Option<u64> {
    let rest = text.lines().find_map(|line| line.strip_prefix(name))?;
    rest.split_whitespace().next()?.parse().ok()
}

/// Bytes left by `ulimit -v` and `ulimit -d`.
///
/// From the process's own files of limits and status.
fn left_of_limits(limits: &str, status: &str) -> Option<u64> {
    let left = |limit, used| {
        let used = 1024 * figure(status, used)? + THREADS;
        Some(figure(limits, limit)?.saturating_sub(used))
    };
    let address_space = left("Max address space", "VmSize:");
    let data = left("Max data size", "VmData:");
    address_space.into_iter().chain(data).min()
}

/// Bytes left by the control groups of a process and their ancestors.
///
/// File pages that can be dropped count as free. Version 2 if the line names no controller, else 1.
fn left_in_groups(root: &Path, groups: &str) -> Option<u64> {
    const V1: [&str; 3] = [
        "memory.limit_in_bytes",
        "memory.usage_in_bytes",
        "total_inactive_file",
    ];
    const V2: [&str; 3] = ["memory.max", "memory.current", "inactive_file"];
    let of_line = |line: &str| {
        let (controllers, path) = line.split_once(':')?.1.split_once(':')?;
        let (root, files) = match controllers {
            "" => (root.to_owned(), V2),
            some if some.split(',').any(|name| name == "memory") => (root.join("memory"), V1),
            _ => return None,
        };
        let left = |group: &Path| {
            let read = |file: &str| fs::read_to_string(group.join(file)).ok();
            let [limit, usage] = [files[0], files[1]].map(|file| figure(&read(file)?, ""));
            let pages = read("memory.stat").and_then(|stat| figure(&stat, files[2]));
            Some(limit?.saturating_sub(usage?.saturating_sub(pages.unwrap_or(0))))
        };
        let own = root.join(path.trim_start_matches('/'));
        let all = own.ancestors().take_while(|group| group.starts_with(&root));
        all.filter_map(left).min()
    };
    groups.lines().filter_map(of_line).min()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_free_is_known_here() {
        assert!(available_bytes() > Some(1 << 20));
    }

    #[test]
    fn what_does_not_fit_is_refused_before_it_is_made() {
        let refused = |items, structures, available| {
            let needed = needed_by_items(items, structures);
            let result = fits("uniform:n=9", needed, structures, available);
            result.err().map(|error| error.to_string())
        };
        let gigabyte = 1_000_000_000;
        let told = refused(100_000_000, 0, Some(8 * gigabyte)).expect("refused");
        let wanted = "uniform:n=9: needs about 12.0 GB, 8.0 GB are free; expected a smaller input";
        assert_eq!(told, wanted);
        // Structures count, and the message says how many.
        assert_eq!(refused(100_000_000, 0, Some(13 * gigabyte)), None);
        let told = refused(100_000_000, 8, Some(13 * gigabyte)).expect("refused");
        assert!(
            told.contains("45.6 GB with 8 structures, 13.0 GB are free"),
            "{told}"
        );
        assert_eq!(refused(1000, 8, Some(gigabyte)), None);
        // To the byte, and without overflow.
        assert_eq!(refused(10, 0, Some(1200)), None);
        assert!(refused(10, 0, Some(1199)).is_some());
        assert!(refused(u64::MAX, 3, Some(u64::MAX - 1)).is_some());
        assert_eq!(refused(u64::MAX, 3, None), None);
    }

    #[test]
    fn limits_of_the_process_count() {
        let status = "VmPeak:\t  900 kB\nVmSize:\t     300 kB\nVmData:\t     100 kB\n";
        let limits = |data: &str, space: &str| {
            format!("Max data size  {data}  unlimited  bytes\nMax address space  {space}  x  bytes")
        };
        let left = |data, space| left_of_limits(&limits(data, space), status);
        assert_eq!(left("unlimited", "unlimited"), None);
        assert_eq!(
            left("unlimited", "1024000000"),
            Some(1_024_000_000 - 300 * 1024 - THREADS)
        );
        assert_eq!(
            left("204800000", "1024000000"),
            Some(204_800_000 - 100 * 1024 - THREADS)
        );
        assert_eq!(left("unlimited", "1024"), Some(0));
        assert_eq!(left_of_limits("", ""), None);
    }

    #[test]
    fn groups_count_with_those_they_are_in() {
        let root = tempfile::tempdir().unwrap();
        let write = |file: &str, text: &str| {
            let file = root.path().join(file);
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(file, text).unwrap();
        };
        let left = |groups: &str| left_in_groups(root.path(), groups);
        write("a/b/memory.max", "max\n");
        write("a/b/memory.current", "70\n");
        assert_eq!(left("0::/a/b\n"), None);
        write("a/memory.max", "1000\n");
        write("a/memory.current", "800\n");
        write("a/memory.stat", "anon 500\ninactive_file 300\n");
        assert_eq!(left("0::/a/b\n"), Some(500));
        write("memory/c/memory.limit_in_bytes", "400\n");
        write("memory/c/memory.usage_in_bytes", "100\n");
        write(
            "memory/c/memory.stat",
            "inactive_file 5\ntotal_inactive_file 10\n",
        );
        assert_eq!(left("9:cpu:/\n4:hugetlb,memory:/c\n0::/a/b\n"), Some(310));
        // Within a container the path is the host's: the mounted files are the limit.
        write("memory/memory.limit_in_bytes", "90\n");
        write("memory/memory.usage_in_bytes", "100\n");
        assert_eq!(left("4:memory:/docker/1\n"), Some(0));
        assert_eq!(left("0::/elsewhere\n"), None);
    }
}
