//! Comparisons per region search: a scan, O(n), against trees, O(log n).
//!
//! Counts the bounds (or planes) that each structure compares per search, for a thousand to
//! a million regions, fits the growth of the count, and prints Markdown.

use cullbench::geometry::Aabb;
use cullbench::index::{Registry, StructureSpec};
use cullbench::query::QueryCost;
use glam::Vec3;

const SIZES: [usize; 4] = [10, 22, 46, 100]; // cubed: 1e3, 1e4, 1e5, 1e6
const SEARCHES: usize = 500;

/// `side`^3 unit cells: every point has one region, or several on a wall.
fn tiling(side: usize) -> Vec<Aabb> {
    let cell = |i: usize| {
        Vec3::new(
            (i % side) as f32,
            (i / side % side) as f32,
            (i / side / side) as f32,
        )
    };
    (0..side.pow(3))
        .map(|i| Aabb::new(cell(i), cell(i) + Vec3::ONE))
        .collect()
}

/// The same cells, each grown by half a cell on every side: every inner point
/// lies in eight.
fn overlapping(side: usize) -> Vec<Aabb> {
    let grown = |b: Aabb| Aabb::new(b.min - 0.5, b.max + 0.5);
    tiling(side).into_iter().map(grown).collect()
}

/// Points spread over the cells, none on a wall (a Weyl sequence).
fn point(i: usize, side: usize) -> Vec3 {
    let weyl = |step: f64| ((i + 1) as f64 * step).fract() as f32 * side as f32;
    Vec3::new(
        weyl(0.754_877_666),
        weyl(0.569_840_291),
        weyl(0.430_159_709),
    )
}

/// Slope of the least-squares line through (log n, log count): 1 is O(n), near
/// 0 is O(log n).
fn exponent(counts: &[(f64, f64)]) -> f64 {
    let logs: Vec<(f64, f64)> = counts.iter().map(|(n, c)| (n.ln(), c.ln())).collect();
    let mean = |of: fn(&(f64, f64)) -> f64| logs.iter().map(of).sum::<f64>() / logs.len() as f64;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let (over, under) = logs.iter().fold((0.0, 0.0), |(over, under), p| {
        (over + (p.0 - x) * (p.1 - y), under + (p.0 - x).powi(2))
    });
    over / under
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for (title, regions) in [
        (
            "tiling: one region a point",
            tiling as fn(usize) -> Vec<Aabb>,
        ),
        ("overlapping: up to eight regions a point", overlapping),
    ] {
        println!("\n### {title}\n");
        println!("| structure | 1,000 | 10,648 | 97,336 | 1,000,000 | growth exponent |");
        println!("|---|--:|--:|--:|--:|--:|");
        for row in Registry::builtin().rows() {
            let spec = StructureSpec::parse(row.info.name)?;
            let mut counts = Vec::new();
            for side in SIZES {
                let boxes = regions(side);
                let index = spec.build(&boxes)?;
                let (mut cost, mut out) = (QueryCost::default(), Vec::new());
                for p in (0..SEARCHES).map(|i| point(i, side)) {
                    out.clear();
                    index.query_counted(p.into(), &mut out, &mut cost);
                    let holding = out
                        .iter()
                        .filter(|&&id| boxes[id as usize].contains_point(p));
                    assert!(!out.is_empty() && holding.count() == out.len());
                }
                counts.push((
                    boxes.len() as f64,
                    cost.comparisons() as f64 / SEARCHES as f64,
                ));
            }
            let cells: Vec<String> = counts.iter().map(|(_, c)| format!("{c:.1}")).collect();
            println!(
                "| `{}` | {} | {:.2} |",
                row.info.name,
                cells.join(" | "),
                exponent(&counts)
            );
        }
    }
    Ok(())
}
