//! The program with one slow structure, for `scripts/check-compare.sh`.
//!
//! A file `PROGRAM.slowed` beside it with the text `octree:20` makes its octree answer every 20th
//! query twice, 5 % more work. The script shows with it what `compare --against` finds: two copies
//! of one file differ by nothing else, two builds by their code layout too.

use std::process::ExitCode;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use cullbench::geometry::Aabb;
use cullbench::index::{DynIndex, MemoryUsage, Registry, Row, TreeCell};
use cullbench::query::{AnyVolume, ItemId, Located, QueryCost};
use glam::Vec3;

/// A structure that answers every n-th query twice.
struct Slowed {
    own: Box<dyn DynIndex>,
    every: usize,
    answered: AtomicUsize,
}

impl DynIndex for Slowed {
    fn memory(&self) -> MemoryUsage {
        self.own.memory()
    }
    fn query(&self, volume: AnyVolume<'_>, out: &mut Vec<ItemId>) {
        let answered = self.answered.load(Relaxed) + 1;
        self.answered.store(answered, Relaxed);
        if answered.is_multiple_of(self.every) {
            let first = out.len();
            self.own.query(volume, out);
            out.truncate(first);
        }
        self.own.query(volume, out);
    }
    fn query_counted(&self, volume: AnyVolume<'_>, out: &mut Vec<ItemId>, cost: &mut QueryCost) {
        self.own.query_counted(volume, out, cost);
    }
    fn query_many(&self, points: &[Vec3], out: &mut Located) {
        self.own.query_many(points, out);
    }
    fn cells(&self) -> Vec<TreeCell<'_>> {
        self.own.cells()
    }
    fn chose(&self) -> Option<String> {
        self.own.chose()
    }
    fn refit(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        self.own.refit(items, moved)
    }
}

/// The row of the structure that is slowed, and which of its queries are.
static SLOWED: OnceLock<(Row, usize)> = OnceLock::new();

fn slowed(row: Row) -> Option<(Row, usize)> {
    let mut file = std::env::current_exe().ok()?.into_os_string();
    file.push(".slowed");
    let text = std::fs::read_to_string(file).ok()?;
    let (name, every) = text.trim().split_once(':')?;
    every
        .parse()
        .ok()
        .map(|every| (row, every))
        .filter(|_| name == row.info.name)
}

fn main() -> ExitCode {
    let mut registry = Registry::empty();
    for &own in Registry::builtin().rows() {
        let mut row = own;
        if let Some(slowed) = slowed(own) {
            SLOWED.get_or_init(|| slowed);
            row.build = |execution, input, params| {
                let (own, every) = SLOWED.get().expect("the row that is slowed");
                Ok(Box::new(Slowed {
                    own: (own.build)(execution, input, params)?,
                    every: *every,
                    answered: AtomicUsize::new(0),
                }))
            };
        }
        registry = registry.with_row(row);
    }
    cullbench::cli::main_with(registry)
}
