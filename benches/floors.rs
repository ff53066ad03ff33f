//! The speed floors this project promises, each a ratio in one run: all
//! contenders of a row are interleaved and paired by the same harness as
//! `cullbench run`. Exits 3 if a floor is missed. `-- --test` only checks that
//! every row runs.

use std::process::ExitCode;

use cullbench::culling::{Culling, CullingTest};
use cullbench::index::Registry;
use cullbench::measure::{Cell, Contender, Machine, Protocol, Status, Workload, measure_group};
use cullbench::{path, scene};

/// `structure` must be at least `floor` times as fast as the textbook loop.
struct Floor {
    scene: &'static str,
    path: &'static str,
    structure: &'static str,
    floor: f64,
}

const FLOORS: [Floor; 8] = [
    Floor {
        scene: "uniform:n=1000000",
        path: "flythrough:frames=64,visible=2%",
        structure: "bvh",
        floor: 20.0,
    },
    Floor {
        scene: "uniform:n=1000000",
        path: "flythrough:frames=64,visible=2%",
        structure: "bsp",
        floor: 20.0,
    },
    Floor {
        scene: "uniform:n=1000000",
        path: "flythrough:frames=64,visible=2%",
        structure: "octree",
        floor: 20.0,
    },
    Floor {
        scene: "city:n=1000000",
        path: "flythrough:frames=64,visible=2%",
        structure: "bvh",
        floor: 20.0,
    },
    Floor {
        scene: "city:n=1000000",
        path: "flythrough:frames=64,visible=2%",
        structure: "bsp",
        floor: 20.0,
    },
    Floor {
        scene: "city:n=1000000",
        path: "flythrough:frames=64,visible=2%",
        structure: "octree",
        floor: 20.0,
    },
    Floor {
        scene: "city:n=1000000",
        path: "flythrough:frames=64,visible=2%",
        structure: "quadtree",
        floor: 20.0,
    },
    Floor {
        scene: "clustered:n=1000000",
        path: "flythrough:frames=64,visible=2%",
        structure: "bvh",
        floor: 20.0,
    },
];

/// What every floor is measured against.
const YARDSTICK: &str = "linear-scalar";

fn main() -> ExitCode {
    let only_test = std::env::args().any(|arg| arg == "--test");
    let protocol = Protocol {
        rounds: if only_test { [1, 1] } else { [9, 25] },
        task_ns: 3e9,
        cameras: if only_test { 8 } else { 64 },
        cold: false,
        seed: 1,
        cache_bytes: Machine::capture().cache_sweep_bytes(),
    };
    let mut missed = 0;
    for row in &FLOORS {
        let source = if only_test {
            row.scene.replace("1000000", "1000")
        } else {
            row.scene.to_owned()
        };
        let scene = scene::load(&source, &Default::default()).expect(row.scene);
        let cameras = path::load(row.path, &scene, &Default::default()).expect(row.path);
        let workload = Workload::new(&scene, &cameras, &Culling::default()).expect(row.path);
        let specs = Registry::builtin()
            .structures(&format!("{YARDSTICK},{}", row.structure))
            .expect(row.structure);
        let twin = specs[1].clone();
        let mut contenders: Vec<Contender> = specs
            .into_iter()
            .map(|spec| Contender::build(spec, false, &scene, CullingTest::SixPlane))
            .collect();
        contenders.push(Contender::build(twin, true, &scene, CullingTest::SixPlane));
        let group =
            measure_group(&workload, &contenders, &[], &protocol, &|| false).expect("not stopped");
        let query_ns = |cell: &Cell| {
            assert_eq!(cell.verdict.status, Status::Ok, "{:?}", cell.verdict);
            cell.metrics["query_ns"].value
        };
        let ratio = query_ns(&group.cells[0]) / query_ns(&group.cells[1]);
        let noise = group
            .twin
            .map_or(f64::NAN, |(_, ratio)| (ratio.value - 1.0).abs() * 100.0);
        let holds = only_test || ratio >= row.floor;
        missed += u32::from(!holds);
        println!(
            "{source}, {}: {} {ratio:.1} x {YARDSTICK}, floor {} x, twin differs by {noise:.1} %: {}",
            row.path,
            row.structure,
            row.floor,
            match (only_test, holds) {
                (true, _) => "not judged",
                (false, true) => "ok",
                (false, false) => "MISSED",
            }
        );
    }
    ExitCode::from(if missed > 0 { 3 } else { 0 })
}
