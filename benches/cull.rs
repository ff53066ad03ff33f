//! Criterion benchmarks: groups `build`, `cull`, `locate` and `update` over
//! scenes and structures, and `kernels` by themselves, named `group/structure/scene`, so that critcmp can compare two
//! runs. Loops over the same tables and walks the same road as `run`; it
//! measures single structures, ratios belong to `floors` and to `run`.

use std::hint::black_box;
use std::time::Duration;

use criterion::{BatchSize, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use cullbench::camera::PlaneOptions;
use cullbench::culling::Culling;
use cullbench::geometry::BoxBlocks;
use cullbench::index::{Input, Registry, StructureSpec};
use cullbench::kernel::Plain;
use cullbench::measure::{Workload, move_share};
use cullbench::path;
use cullbench::scene::{self, Scene};

/// Scene and path; the figures of one view would train the branch predictor.
const WORKLOADS: [(&str, &str); 5] = [
    ("uniform:n=100000", "flythrough:frames=512,visible=2%"),
    ("city:n=100000", "flythrough:frames=512,visible=2%"),
    ("clustered:n=100000", "flythrough:frames=512,visible=2%"),
    ("helsinki", "flythrough:frames=512,visible=2%"),
    ("freedm-map20", "places"),
];

fn load(source: &str) -> Scene {
    scene::load(source, &Default::default()).expect(source)
}

fn build(c: &mut Criterion) {
    let mut group = c.benchmark_group("build");
    group.sample_size(10);
    for (source, _) in WORKLOADS {
        let scene = load(source);
        group.throughput(Throughput::Elements(scene.items.len() as u64));
        for row in Registry::builtin().rows() {
            let spec = StructureSpec::parse(row.info.name).expect(row.info.name);
            group.bench_function(BenchmarkId::new(row.info.name, source), |b| {
                b.iter(|| spec.build(black_box(&scene.items)).expect(row.info.name));
            });
        }
    }
    group.finish();
}

/// One iteration asks the whole path; the throughput is queries.
fn cull(c: &mut Criterion) {
    let mut group = c.benchmark_group("cull");
    group.sample_size(10);
    for (source, way) in WORKLOADS {
        let scene = load(source);
        let cameras = path::load(way, &scene, &Default::default()).expect(way);
        let workload = Workload::new(&scene, &cameras, &Culling::default()).expect(way);
        group.throughput(Throughput::Elements(workload.views.len() as u64));
        for row in Registry::builtin().rows() {
            let spec = StructureSpec::parse(row.info.name).expect(row.info.name);
            let index = spec.build(&scene.items).expect(row.info.name);
            let mut out = Vec::new();
            group.bench_function(BenchmarkId::new(row.info.name, source), |b| {
                b.iter(|| {
                    for view in &workload.views {
                        out.clear();
                        index.query(view.as_any(), &mut out);
                        black_box(&out);
                    }
                });
            });
        }
    }
    group.finish();
}

fn locate(c: &mut Criterion) {
    let mut group = c.benchmark_group("locate");
    group.sample_size(10);
    for (source, way) in WORKLOADS {
        let scene = load(source);
        let cameras = path::load(way, &scene, &Default::default()).expect(way);
        let workload = Workload::new(&scene, &cameras, &Culling::default()).expect(way);
        group.throughput(Throughput::Elements(workload.points.len() as u64));
        for row in Registry::builtin().rows() {
            let spec = StructureSpec::parse(row.info.name).expect(row.info.name);
            let boxes = scene.regions.boxes(&scene.items);
            let index = spec.build(boxes).expect(row.info.name);
            let mut out = Vec::new();
            group.bench_function(BenchmarkId::new(row.info.name, source), |b| {
                b.iter(|| {
                    for place in 0..workload.points.len() {
                        out.clear();
                        workload.search(place, &mut out, |p, out| index.locate(p, out));
                        black_box(&out);
                    }
                });
            });
        }
    }
    group.finish();
}

/// Bringing an index up to date after a share of the items has moved.
fn update(c: &mut Criterion) {
    let mut group = c.benchmark_group("update");
    group.sample_size(10);
    for source in ["uniform:n=100000", "city:n=100000"] {
        let scene = load(source);
        for row in Registry::builtin().rows() {
            let spec = StructureSpec::parse(row.info.name).expect(row.info.name);
            for share in [0.001, 0.01, 0.1, 1.0] {
                let mut items = scene.items.clone();
                let moved = move_share(&mut items, share);
                let name = format!("{source}/{}%", share * 100.0);
                group.bench_function(BenchmarkId::new(row.info.name, name), |b| {
                    b.iter_batched_ref(
                        || spec.build(&scene.items).expect(row.info.name),
                        |index| {
                            spec.update(index, Input::new(&items), &moved)
                                .expect(row.info.name)
                        },
                        BatchSize::PerIteration,
                    );
                });
            }
        }
    }
    group.finish();
}

/// The plane test, box by box and sixteen at a time, over the same boxes.
fn kernels(c: &mut Criterion) {
    let mut group = c.benchmark_group("kernels");
    group.sample_size(20);
    let scene = load("uniform:n=4096");
    let cameras = path::load("orbit:frames=1", &scene, &Default::default()).expect("orbit");
    let options = PlaneOptions::default();
    let volume = cameras.cameras[0].volume(&options, &scene.surroundings());
    let volume = volume.expect("planes that fit f32");
    let mut blocks = BoxBlocks::with_capacity(scene.items.len());
    scene.items.iter().for_each(|b| blocks.push(b));
    group.throughput(Throughput::Elements(scene.items.len() as u64));
    group.bench_function("scalar", |b| {
        b.iter(|| {
            scene
                .items
                .iter()
                .filter(|item| volume.sees(black_box(item)))
                .count()
        });
    });
    group.bench_function("block", |b| {
        b.iter(|| {
            let blocks = black_box(&blocks).range(0, scene.items.len());
            let seen = blocks.map(|(_, lanes, block)| {
                (block.admitted_by(Plain, &volume, volume.mask()) & lanes).count_ones()
            });
            seen.sum::<u32>()
        });
    });
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1));
    targets = build, cull, locate, update, kernels
}
criterion_main!(benches);
