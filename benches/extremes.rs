//! Builds on scenes that break naive structures: each structure's build time
//! and depth-driven memory on a million unpleasant items against the uniform
//! scene of the same size, in one run. Exits 3 if a build takes more than
//! three times as long. `-- --test` runs a thousand items and judges nothing.

use std::process::ExitCode;
use std::time::Instant;

use cullbench::geometry::Aabb;
use cullbench::index::{Registry, StructureSpec};
use cullbench::scene;
use glam::Vec3;

const MOST: f64 = 3.0;
const BUILDS: usize = 3;

/// A cheap, fixed sequence in [0, 1): what matters here is the shape.
fn unit(i: usize, k: usize) -> f32 {
    let mixed = (i as u64)
        .wrapping_mul(0x9E37_79B9_7F4A_7C15)
        .rotate_left(17 * (k as u32 + 1));
    (mixed.wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 40) as f32 / (1 << 24) as f32
}

fn point(i: usize) -> Vec3 {
    Vec3::new(unit(i, 0), unit(i, 1), unit(i, 2)) * 1000.0
}

type Shape = (&'static str, fn(usize) -> Aabb);

const SHAPES: [Shape; 7] = [
    ("identical", |_| Aabb::around(Vec3::splat(3.0), Vec3::ONE)),
    ("straddling every split", |i| {
        Aabb::around(Vec3::splat(500.0), Vec3::splat(1.0 + 499.0 * unit(i, 0)))
    }),
    ("needles", |i| {
        let mut half = Vec3::splat(0.01);
        half[i % 3] = 500.0;
        let mut at = point(i);
        at[i % 3] = 500.0;
        Aabb::around(at, half)
    }),
    ("collinear", |i| {
        Aabb::around(Vec3::X * point(i).x, Vec3::splat(0.01))
    }),
    ("coplanar", |i| {
        Aabb::around(point(i).with_z(0.0), Vec3::new(0.1, 0.1, 0.0))
    }),
    ("sizes from 1e-6 to 1e6", |i| {
        Aabb::around(point(i), Vec3::splat(10f32.powf(unit(i, 3) * 12.0 - 6.0)))
    }),
    ("offset of 1e7", |i| Aabb::around(point(i) + 1e7, Vec3::ONE)),
];

/// Median build time in seconds.
fn build_time(spec: &StructureSpec, items: &[Aabb]) -> f64 {
    let mut times: Vec<f64> = (0..BUILDS)
        .map(|_| {
            let start = Instant::now();
            let index = spec.build(items).expect("these scenes can be built");
            let took = start.elapsed().as_secs_f64();
            drop(std::hint::black_box(index));
            took
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[BUILDS / 2]
}

fn main() -> ExitCode {
    let only_test = std::env::args().any(|arg| arg == "--test");
    // A structure's name picks it alone, as criterion's filters do.
    let wanted = std::env::args().skip(1).find(|arg| !arg.starts_with("--"));
    let n: usize = if only_test { 1_000 } else { 1_000_000 };
    let uniform = scene::load(&format!("uniform:n={n}"), &Default::default())
        .expect("uniform")
        .items;
    let mut missed = 0;
    let chosen = |name: &str| wanted.as_deref().is_none_or(|w| w == name);
    for row in Registry::builtin()
        .rows()
        .iter()
        .filter(|row| chosen(row.info.name))
    {
        let spec = StructureSpec::parse(row.info.name).expect(row.info.name);
        let base = build_time(&spec, &uniform);
        println!(
            "{}: uniform {:.0} ns an item",
            row.info.name,
            base / n as f64 * 1e9
        );
        for (name, shape) in SHAPES {
            let items: Vec<Aabb> = (0..n).map(shape).collect();
            let ratio = build_time(&spec, &items) / base;
            let bytes = spec.build(&items).expect(name).memory().total() as f64 / n as f64;
            let holds = only_test || ratio <= MOST;
            missed += u32::from(!holds);
            let verdict = match (only_test, holds) {
                (true, _) => "not judged",
                (false, true) => "ok",
                (false, false) => "MISSED",
            };
            println!("  {name:<24} {ratio:>5.2} x uniform, {bytes:.1} bytes an item: {verdict}");
        }
    }
    ExitCode::from(if missed > 0 { 3 } else { 0 })
}
