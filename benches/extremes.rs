//! Builds on scenes that break naive structures, against the uniform scene.
//!
//! Build time and depth-driven memory of each structure, and the build time of picking by
//! `wide-ray`, on a million unpleasant items, in one run. Exits 3 if a build takes more than
//! three times as long. `-- --test` runs a thousand items and judges nothing.
//! Other crates' structures are left out: obvhs by itself takes quadratic time for posts
//! and nested boxes.

use std::process::ExitCode;
use std::time::Instant;

use cullbench::geometry::Aabb;
use cullbench::index::{Origin, Registry, Row, StructureSpec};
use cullbench::kernel::Kernel;
use cullbench::scene::{self, Scene};
use cullbench::visibility::Solids;
use cullbench::visibility::pick::WideRay;
use cullbench::visibility::truth::Boxes;
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

const SHAPES: [Shape; 12] = [
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
    ("posts", |i| {
        let at = Vec3::X * 2.0 * i as f32;
        Aabb::new(at, at + 1.0)
    }),
    ("posts that overlap", |i| {
        let at = Vec3::X * 1e-3 * i as f32;
        Aabb::new(at, at + 100.0)
    }),
    ("nested", |i| {
        Aabb::around(Vec3::ZERO, Vec3::splat(1.0 + i as f32))
    }),
    ("growing", |i| {
        Aabb::new(Vec3::ZERO, Vec3::splat(1.0 + i as f32))
    }),
    ("growing by factors", |i| {
        Aabb::new(Vec3::ZERO, Vec3::splat((8e-5 * i as f32 - 40.0).exp2()))
    }),
];

/// Median build time in seconds, and the bytes where they are known.
type Build = Box<dyn Fn(&Scene) -> (f64, Option<usize>)>;

fn median<T>(build: impl Fn() -> T) -> (f64, T) {
    let timed = || {
        let start = Instant::now();
        let built = std::hint::black_box(build());
        (start.elapsed().as_secs_f64(), built)
    };
    let mut times: Vec<f64> = (1..BUILDS).map(|_| timed().0).collect();
    let (last, built) = timed();
    times.push(last);
    times.sort_by(f64::total_cmp);
    (times[BUILDS / 2], built)
}

/// All that is built, by name.
fn builds() -> Vec<(&'static str, Build)> {
    let mut all: Vec<(&str, Build)> = Vec::new();
    let registry = Registry::builtin();
    let ours = |row: &&Row| matches!(row.info.origin, Origin::Ours);
    for row in registry.rows().iter().filter(ours) {
        let spec = StructureSpec::parse(row.info.name).expect(row.info.name);
        let build = move |scene: &Scene| {
            let (time, built) = median(|| spec.build(&scene.items).expect("can be built"));
            (time, Some(built.memory().total()))
        };
        all.push((row.info.name, Box::new(build)));
    }
    let wide_ray = |scene: &Scene| {
        let boxes = Boxes::of(&Solids::of(scene));
        (median(|| WideRay::of(&boxes, Kernel::best())).0, None)
    };
    all.push(("wide-ray", Box::new(wide_ray)));
    all
}

fn main() -> ExitCode {
    let only_test = std::env::args().any(|arg| arg == "--test");
    // A name picks one alone, as criterion's filters do.
    let wanted = std::env::args().skip(1).find(|arg| !arg.starts_with("--"));
    let n: usize = if only_test { 1_000 } else { 1_000_000 };
    let mut scene = scene::load(&format!("uniform:n={n}"), &Default::default()).expect("uniform");
    let uniform = scene.items.clone();
    let mut missed = 0;
    for (name, build) in builds() {
        if wanted.as_deref().is_some_and(|wanted| wanted != name) {
            continue;
        }
        scene.items.clone_from(&uniform);
        let (base, _) = build(&scene);
        println!("{name}: uniform {:.0} ns an item", base / n as f64 * 1e9);
        for (shape, item) in SHAPES {
            scene.items = (0..n).map(item).collect();
            let (time, bytes) = build(&scene);
            let ratio = time / base;
            let holds = only_test || ratio <= MOST;
            missed += u32::from(!holds);
            let verdict = match (only_test, holds) {
                (true, _) => "not judged",
                (false, true) => "ok",
                (false, false) => "MISSED",
            };
            let bytes =
                bytes.map(|bytes| format!(", {:.1} bytes an item", bytes as f64 / n as f64));
            let bytes = bytes.unwrap_or_default();
            println!("  {shape:<24} {ratio:>5.2} x uniform{bytes}: {verdict}");
        }
    }
    ExitCode::from(if missed > 0 { 3 } else { 0 })
}
