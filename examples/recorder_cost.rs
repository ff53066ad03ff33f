//! Cost of a recorder that is off.
//!
//! Runs the same region searches by the library with `NoRecorder` (`with`) or by a copy of its
//! search without that parameter (`without`). `scripts/check-recorder.sh` compares the
//! instruction counts of the two.

use std::hint::black_box;

use cullbench::geometry::Aabb;
use cullbench::index::{PackedTree, Part, Record, Splitter, build_top_down};
use cullbench::kernel::Plain;
use cullbench::query::{ItemId, NoRecorder, QueryContext, Sink};
use cullbench::scene;
use glam::Vec3;

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

/// Region search of the library with a recorder that is off.
#[inline(never)]
fn with(tree: &PackedTree, p: Vec3, out: &mut Vec<ItemId>) {
    let _ = tree.query(&p, &mut QueryContext::new(Plain, out, &mut NoRecorder));
}

/// The same search, written without a recorder.
#[inline(never)]
fn without(tree: &PackedTree, p: Vec3, out: &mut Vec<ItemId>) {
    let nodes = tree.nodes();
    let mut at = 0;
    while let Some(node) = nodes.get(at) {
        if !node.bounds.contains_point(p) {
            at = node.after();
            continue;
        }
        at += 1;
        if node.after() == at {
            let items = node.items();
            for (start, lanes, block) in tree.boxes().range(items.start, items.end) {
                let admitted = block.holding(p) & lanes;
                if admitted != 0 {
                    // A Vec never stops the query.
                    let _ = out.accept_lanes(Plain, tree.ids(), start, admitted);
                }
            }
        }
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let ask = match std::env::args().nth(1).as_deref() {
        Some("with") => with,
        Some("without") => without,
        _ => return Err("expected 'with' or 'without'".into()),
    };
    let city = scene::load("city:n=20000", &Default::default())?;
    let records = Record::all(&city.items)?;
    let tree = build_top_down(records, 32, (), &mut Halves);
    let (mut out, mut sum) = (Vec::with_capacity(city.items.len()), 0u64);
    for item in &city.items {
        out.clear();
        ask(black_box(&tree), black_box(item.centre()), &mut out);
        sum += out.iter().map(|&id| u64::from(id)).sum::<u64>();
    }
    println!("{sum}");
    Ok(())
}
