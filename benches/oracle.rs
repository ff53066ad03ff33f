//! The speed of the oracle: verdicts per second on one core about random
//! scenes (both levels) and about boxes on the grid of integer planes (at least
//! a fifth exact ties), and what it takes to prepare a volume. Exits 3 if a
//! promised speed is missed. `-- --test` runs little and judges nothing.

use std::hint::black_box;
use std::process::ExitCode;
use std::time::Instant;

use cullbench::camera::PlaneOptions;
use cullbench::geometry::{Aabb, ConvexVolume, Plane};
use cullbench::oracle::{Oracle, Pose, Verdict};
use cullbench::{path, scene};
use glam::Vec3;

/// Verdicts per second that are promised.
const RANDOM_FLOOR: f64 = 1e7;
const TIES_FLOOR: f64 = 5e6;
const REPEATS: usize = 9;

/// Questions: every oracle tests every box.
struct Workload {
    name: &'static str,
    oracles: Vec<Oracle>,
    boxes: Vec<Aabb>,
    /// Verdicts per second; `None` where nothing is promised.
    floor: Option<f64>,
}

/// A scene and the frusta of a flight through it, at both levels.
fn flight(names: [&'static str; 2], source: &str, only_test: bool) -> [Workload; 2] {
    let n = if only_test { 500 } else { 50_000 };
    let frames = if only_test { 2 } else { 16 };
    let scene = scene::load(&format!("{source}:n={n}"), &Default::default()).expect(source);
    let flight = format!("flythrough:frames={frames},visible=2%");
    let path = path::load(&flight, &scene, &Default::default()).expect("a path");
    let of_planes = path.cameras.iter().map(|camera| {
        let volume = camera.volume(&PlaneOptions::default(), &scene.surroundings());
        Oracle::of_volume(&volume.expect("a volume"))
    });
    let of_cameras = path.cameras.iter().map(|camera| {
        Oracle::of_camera(&Pose::of(camera), &camera.lens, scene.origin).expect("a camera")
    });
    let [planes, cameras] = names;
    let workload = |name, oracles| Workload {
        name,
        oracles,
        boxes: scene.items.clone(),
        floor: Some(RANDOM_FLOOR),
    };
    [
        workload(planes, of_planes.collect()),
        workload(cameras, of_cameras.collect()),
    ]
}

/// The frustum of 90 degrees with integer planes, shifted by whole numbers.
fn integer_frustum(eye: Vec3, far: f32) -> ConvexVolume {
    let planes = [
        (Vec3::new(1.0, 0.0, -1.0), 0.0),
        (Vec3::new(-1.0, 0.0, -1.0), 0.0),
        (Vec3::new(0.0, 1.0, -1.0), 0.0),
        (Vec3::new(0.0, -1.0, -1.0), 0.0),
        (Vec3::new(0.0, 0.0, -1.0), -1.0),
        (Vec3::new(0.0, 0.0, 1.0), far),
    ];
    let placed = planes.map(|(normal, d)| Plane::new(normal, d - normal.dot(eye)));
    ConvexVolume::from_planes(&placed).expect("finite planes")
}

/// Boxes of a whole-number grid about the boundaries of small frusta.
fn on_the_grid(only_test: bool) -> Workload {
    let (near, far): (i32, i32) = (1, if only_test { 3 } else { 12 });
    let mut boxes = Vec::new();
    for depth in near - 1..=far + 1 {
        let width = depth + 1;
        for x in -width..=width {
            for y in -width..=width {
                if x.abs().max(y.abs()) < depth - 1 && (near + 1..far).contains(&depth) {
                    continue; // Well inside.
                }
                // A unit box that grows outward, as those of vector A02 do.
                let near_corner = Vec3::new(x as f32, y as f32, -depth as f32);
                let outward = Vec3::new((x as f32).signum(), (y as f32).signum(), 1.0);
                let far_corner = near_corner + outward;
                boxes.push(Aabb::new(
                    near_corner.min(far_corner),
                    near_corner.max(far_corner),
                ));
            }
        }
    }
    let eyes = [Vec3::ZERO, Vec3::X, Vec3::new(-1.0, 1.0, 0.0)];
    Workload {
        name: "boxes on the grid of integer planes",
        oracles: eyes
            .map(|eye| Oracle::of_volume(&integer_frustum(eye, far as f32)))
            .into(),
        boxes,
        floor: Some(TIES_FLOOR),
    }
}

/// Boxes as large as the frustum itself about its boundary: hardly any is
/// decided by a single plane or an inner point.
fn straddling(only_test: bool) -> Workload {
    let count = if only_test { 100 } else { 20_000 };
    // The additive recurrence of the plastic number fills space evenly.
    let unit = |i: usize, k: i32| (i as f64 * 0.819_172_513_396_164_4f64.powi(k)).fract() as f32;
    let boxes = (0..count).map(|i| {
        let point = |k: i32| Vec3::new(unit(i, k), unit(i, k + 1), unit(i, k + 2));
        let low = (point(1) - 0.5) * 40.0;
        Aabb::new(low, low + point(4) * 12.0)
    });
    let frustum = integer_frustum(Vec3::ZERO, 8.0);
    let tilted = frustum.planes().iter().map(|plane| {
        let turn = glam::Quat::from_rotation_y(0.7) * glam::Quat::from_rotation_x(-0.4);
        Plane::new(turn * plane.normal, plane.d)
    });
    let tilted = ConvexVolume::from_planes(&tilted.collect::<Vec<_>>()).expect("finite planes");
    let sees = |b: &Aabb| tilted.sees(b) && !tilted.planes().iter().all(|plane| plane.contains(b));
    Workload {
        name: "boxes that cross a frustum's planes",
        oracles: vec![Oracle::of_volume(&tilted)],
        boxes: boxes.filter(sees).collect(),
        floor: None,
    }
}

impl Workload {
    fn questions(&self) -> usize {
        self.oracles.len() * self.boxes.len()
    }

    fn tally(&self) -> [usize; 3] {
        let mut tally = [0; 3];
        for oracle in &self.oracles {
            for b in &self.boxes {
                tally[oracle.verdict(black_box(b)) as usize] += 1;
            }
        }
        tally
    }

    /// Prints the median speed; whether it is fast enough.
    fn run(&self, only_test: bool) -> bool {
        let tally = self.tally();
        let share =
            |verdict: Verdict| 100.0 * tally[verdict as usize] as f64 / self.questions() as f64;
        let speeds = (0..REPEATS).map(|_| {
            let start = Instant::now();
            black_box(self.tally());
            self.questions() as f64 / start.elapsed().as_secs_f64()
        });
        let speed = median(speeds);
        let holds = self.floor.is_none_or(|floor| speed >= floor);
        let verdict = match (only_test, self.floor, holds) {
            (true, ..) => "not judged".to_owned(),
            (_, None, _) => "nothing promised".to_owned(),
            (_, Some(floor), true) => format!("promised {:.0}: ok", floor / 1e6),
            (_, Some(floor), false) => format!("promised {:.0}: MISSED", floor / 1e6),
        };
        println!(
            "{:<36} {:>6.1} million verdicts/s ({:.1} % in, {:.1} % touch), {verdict}",
            self.name,
            speed / 1e6,
            share(Verdict::In),
            share(Verdict::Touch),
        );
        only_test || holds
    }
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Planes that touch a sphere in points spread evenly over it (Fibonacci).
fn round_volume(count: usize) -> ConvexVolume {
    let planes: Vec<Plane> = (0..count)
        .map(|i| {
            let z = 1.0 - (2 * i + 1) as f32 / count as f32;
            let angle = i as f32 * 2.399_963_1;
            let r = (1.0 - z * z).sqrt();
            Plane::new(Vec3::new(r * angle.cos(), r * angle.sin(), z), 10.0)
        })
        .collect();
    ConvexVolume::from_planes(&planes).expect("finite planes")
}

/// Median time of one preparation in microseconds.
fn preparation(prepare: impl Fn() -> Oracle, only_test: bool) -> f64 {
    let repeats = if only_test { 1 } else { 25 };
    median((0..repeats).map(|_| {
        let start = Instant::now();
        black_box(prepare());
        start.elapsed().as_secs_f64() * 1e6
    }))
}

fn main() -> ExitCode {
    let only_test = std::env::args().any(|arg| arg == "--test");
    let uniform = flight(
        ["uniform scene, planes level", "uniform scene, camera level"],
        "uniform",
        only_test,
    );
    let city = flight(
        ["city, planes level", "city, camera level"],
        "city",
        only_test,
    );
    let mut workloads: Vec<Workload> = uniform.into_iter().chain(city).collect();
    workloads.push(on_the_grid(only_test));
    workloads.push(straddling(only_test));
    let missed = workloads.iter().filter(|w| !w.run(only_test)).count();

    let scene = scene::load("uniform:n=1000", &Default::default()).expect("uniform");
    let path = path::load("flythrough:frames=2", &scene, &Default::default()).expect("a path");
    let camera = &path.cameras[1];
    let frustum = camera
        .volume(&PlaneOptions::default(), &scene.surroundings())
        .expect("a volume");
    let volumes = [
        ("frustum (6 planes)", frustum),
        ("integer frustum (6 planes)", integer_frustum(Vec3::X, 12.0)),
        ("12 planes", round_volume(12)),
        ("32 planes", round_volume(32)),
    ];
    for (name, volume) in &volumes {
        let took = preparation(|| Oracle::of_volume(volume), only_test);
        println!("prepare {name:<32} {took:>9.1} us");
    }
    let pose = Pose::of(camera);
    let prepare = || Oracle::of_camera(&pose, &camera.lens, scene.origin).expect("a camera");
    let took = preparation(prepare, only_test);
    println!("prepare {:<32} {took:>9.1} us", "camera");
    ExitCode::from(if missed > 0 { 3 } else { 0 })
}
