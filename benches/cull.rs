//! Criterion benchmarks: groups `build`, `cull` and `locate` over scenes and
//! structures, named `group/structure/scene`, so that critcmp can compare two
//! runs. Loops over the same tables and walks the same road as `run`; it
//! measures single structures, ratios belong to `floors` and to `run`.

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use cullbench::camera::PlaneOptions;
use cullbench::index::{BACKENDS, StructureSpec};
use cullbench::measure::Workload;
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
        for backend in BACKENDS {
            let spec = StructureSpec::parse(backend.name).expect(backend.name);
            group.bench_function(BenchmarkId::new(backend.name, source), |b| {
                b.iter(|| spec.build(black_box(&scene.items)).expect(backend.name));
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
        let workload = Workload::new(&scene, &cameras, &PlaneOptions::default()).expect(way);
        group.throughput(Throughput::Elements(workload.volumes.len() as u64));
        for backend in BACKENDS {
            let spec = StructureSpec::parse(backend.name).expect(backend.name);
            let index = spec.build(&scene.items).expect(backend.name);
            let mut out = Vec::new();
            group.bench_function(BenchmarkId::new(backend.name, source), |b| {
                b.iter(|| {
                    for volume in &workload.volumes {
                        out.clear();
                        index.visible(volume, &mut out);
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
        let workload = Workload::new(&scene, &cameras, &PlaneOptions::default()).expect(way);
        group.throughput(Throughput::Elements(workload.points.len() as u64));
        for backend in BACKENDS {
            let spec = StructureSpec::parse(backend.name).expect(backend.name);
            let boxes = scene.regions.boxes(&scene.items);
            let index = spec.build(boxes).expect(backend.name);
            let mut out = Vec::new();
            group.bench_function(BenchmarkId::new(backend.name, source), |b| {
                b.iter(|| {
                    for &p in &workload.points {
                        out.clear();
                        index.locate(p, &mut out);
                        workload.refine(p, &mut out);
                        black_box(&out);
                    }
                });
            });
        }
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1));
    targets = build, cull, locate
}
criterion_main!(benches);
