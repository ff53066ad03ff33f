//! `memory()` tells the truth: an index's own figure against what a counting
//! allocator saw it keep. A test program of its own, because an allocator
//! serves a whole program.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use cullbench::index::{DynIndex, Registry, StructureSpec};
use cullbench::scene;

/// The system's allocator, with a count of the bytes that are in use.
struct Counting;

static IN_USE: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is passed on unchanged to the system's allocator; the
// counter does not touch memory.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        IN_USE.fetch_add(layout.size(), Ordering::Relaxed);
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        IN_USE.fetch_sub(layout.size(), Ordering::Relaxed);
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn memory_is_within_five_percent_of_what_is_kept() {
    let mut off = Vec::new();
    for source in ["uniform:n=20000", "city:n=20000", "us-counties"] {
        let scene = scene::load(source, &Default::default()).expect(source);
        // The build of auto counts queries, and what those keep is the thread's, not the index's.
        let auto = StructureSpec::parse("auto").expect("auto");
        drop(auto.build(&scene.items));
        for row in Registry::builtin().rows() {
            let spec = StructureSpec::parse(row.info.name).expect(row.info.name);
            let before = IN_USE.load(Ordering::Relaxed);
            let index: Box<dyn DynIndex> = spec.build(&scene.items).expect(row.info.name);
            let kept = (IN_USE.load(Ordering::Relaxed) - before) as f64;
            let told = index.memory().total() as f64;
            if (told / kept - 1.0).abs() >= 0.05 {
                let name = row.info.name;
                off.push(format!(
                    "{name} on {source}: memory() says {told}, the allocator {kept}"
                ));
            }
        }
    }
    assert!(off.is_empty(), "{off:#?}");
}
