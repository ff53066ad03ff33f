//! Cost of a recorder that is off.
//!
//! Runs the same queries by the library's traversal with `NoRecorder` (`with`) or by a copy
//! of it without that parameter (`without`). `scripts/check-recorder.sh` compares the
//! instruction counts of the two.

use std::hint::black_box;

use cullbench::camera::PlaneOptions;
use cullbench::geometry::{Aabb, ConvexVolume, PlaneMask};
use cullbench::index::{PackedTree, Part, Record, Splitter, build_top_down};
use cullbench::kernel::BASELINE;
use cullbench::query::{ItemId, NoRecorder, Sink};
use cullbench::{path, scene};

/// Median tree: splits the widest axis at the median item.
struct Halves;

impl Splitter for Halves {
    type Cell = ();

    fn split(&mut self, records: &mut [Record], (): (), _: usize, parts: &mut Vec<Part<()>>) {
        let half = records.len() / 2;
        let all = Aabb::union_of(records.iter().map(|r| &r.bounds));
        let extent = all.extent();
        let axis = (0..3)
            .max_by(|&a, &b| extent[a].total_cmp(&extent[b]))
            .unwrap_or(0);
        let at = |r: &Record| r.bounds.centre()[axis];
        records.select_nth_unstable_by(half, |a, b| at(a).total_cmp(&at(b)));
        let part = |items| Part {
            items,
            cell: Some(()),
        };
        parts.extend([part(half), part(records.len() - half)]);
    }
}

enum Verdict {
    Outside,
    Straddles,
    Inside,
}

#[inline(always)]
fn classify(volume: &ConvexVolume, bounds: &Aabb, mask: PlaneMask) -> (Verdict, PlaneMask) {
    let (mut undecided, mut left) = (mask, mask);
    while left != 0 {
        let index = left.trailing_zeros();
        left &= left - 1;
        let plane = volume.plane_of_bit(index);
        if plane.excludes(bounds) {
            return (Verdict::Outside, mask);
        }
        if plane.contains(bounds) {
            undecided &= !(1 << index);
        }
    }
    (
        if undecided == 0 {
            Verdict::Inside
        } else {
            Verdict::Straddles
        },
        undecided,
    )
}

/// The traversal's stack: an array, then the heap.
struct Stack {
    near: [(u32, PlaneMask); 64],
    used: usize,
    far: Vec<(u32, PlaneMask)>,
}

impl Stack {
    #[inline(always)]
    fn pop(&mut self) -> Option<(u32, PlaneMask)> {
        if let Some(top) = self.far.pop() {
            return Some(top);
        }
        self.used = self.used.checked_sub(1)?;
        Some(self.near[self.used])
    }

    #[inline(always)]
    fn push(&mut self, entry: (u32, PlaneMask)) {
        if let Some(slot) = self.near.get_mut(self.used) {
            *slot = entry;
            self.used += 1;
        } else {
            self.far.push(entry);
        }
    }
}

/// `PackedTree::query` for a volume and a `Vec`, written without a recorder.
#[inline(never)]
fn without(tree: &PackedTree, volume: &ConvexVolume, out: &mut Vec<ItemId>) {
    let nodes = tree.nodes();
    let mut top = (nodes.len() as u32, volume.mask());
    let mut below = Stack {
        near: [top; 64],
        used: 1,
        far: Vec::new(),
    };
    let mut at = 0u32;
    while let Some(node) = nodes.get(at as usize) {
        while at >= top.0 {
            top = below.pop().unwrap_or(top);
        }
        let (verdict, mask) = classify(volume, &node.bounds, top.1);
        match verdict {
            Verdict::Outside => at = node.after() as u32,
            Verdict::Inside => {
                out.extend_from_slice(&tree.ids()[node.items()]);
                at = node.after() as u32;
            }
            Verdict::Straddles => {
                at += 1;
                if node.after() as u32 != at {
                    below.push(top);
                    top = (node.after() as u32, mask);
                    continue;
                }
                let items = node.items();
                for (start, lanes, block) in tree.boxes().range(items.start, items.end) {
                    let admitted = block.admitted_by(BASELINE, volume, mask);
                    if admitted & lanes != 0 {
                        // A Vec never stops the query.
                        let _ = out.accept_lanes(BASELINE, tree.ids(), start, admitted & lanes);
                    }
                }
            }
        }
    }
}

#[inline(never)]
fn with(tree: &PackedTree, volume: &ConvexVolume, out: &mut Vec<ItemId>) {
    let _ = tree.walk(BASELINE, volume, out, &mut NoRecorder);
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let ask = match std::env::args().nth(1).as_deref() {
        Some("with") => with,
        Some("without") => without,
        _ => return Err("expected 'with' or 'without'".into()),
    };
    let city = scene::load("city:n=20000", &Default::default())?;
    let orbit = path::load("orbit:frames=64", &city, &Default::default())?;
    let records = Record::all(&city.items)?;
    let tree = build_top_down(records, 32, (), &mut Halves);
    let (mut out, mut sum) = (Vec::with_capacity(city.items.len()), 0u64);
    for camera in &orbit.cameras {
        let volume = camera.volume(&PlaneOptions::default(), &city.surroundings())?;
        out.clear();
        ask(black_box(&tree), black_box(&volume), &mut out);
        sum += out.iter().map(|&id| u64::from(id)).sum::<u64>();
    }
    println!("{sum}");
    Ok(())
}
