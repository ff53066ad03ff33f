//! `run`, `verify`, `precision` and `stress` share one truth: the pose as written.
//!
//! A frame that is wrong on purpose must show in all four.

use super::verify::judge_camera_level;
use crate::camera::{Camera, Lens, PlaneOptions, look_at};
use crate::culling::Culling;
use crate::index::Registry;
use crate::measure::{Protocol, Setting, Subject, Workload, judge};
use crate::path::CameraPath;
use crate::precision;
use crate::scene::{Scene, WorldBox};
use crate::stress::extremes::Case;
use glam::DVec3;

/// Up 1e-6 rad from the view, coordinates with full mantissas.
fn sound() -> Camera {
    let eye = DVec3::new(0.1, 0.7, -0.3);
    let look = eye + DVec3::new(1.1, 2.3, 0.7);
    let up = look - eye + DVec3::new(2.3e-6, -1.1e-6, 0.0);
    Camera {
        frame: look_at(eye, look, up).expect("a frame"),
        lens: Lens::perspective(70.0, 1.5, 0.5, Some(64.0)).expect("a lens"),
    }
}

/// The same numbers, but axes rolled by 1e-3 degrees.
fn broken() -> Camera {
    let camera = sound();
    let mut rolled = camera.frame;
    rolled.roll(1e-3);
    Camera {
        frame: camera.frame.with_axes_of(&rolled),
        ..camera
    }
}

/// Points along the edges of the view, just inside.
fn scene() -> Scene {
    let camera = sound();
    let corners = camera.lens.corners(&camera.frame).expect("corners");
    let centre = corners.iter().sum::<DVec3>() / 8.0;
    let boxes: Vec<WorldBox> = (1..200)
        .flat_map(|step| {
            let at = f64::from(step) / 200.0;
            (0..4).map(move |k| corners[k].lerp(corners[k + 4], at).lerp(centre, 1e-5))
        })
        .map(|p| WorldBox::new(p, p))
        .collect();
    Scene::from_boxes("edges", &boxes).expect("a scene")
}

/// Returns whether `run`, `verify`, `precision` and `stress` find false negatives.
fn missed(camera: Camera) -> [bool; 4] {
    let scene = scene();
    let path = CameraPath {
        name: "one".to_owned(),
        cameras: vec![camera],
        ..CameraPath::default()
    };
    let structures = Registry::builtin().structures("linear");
    let structures = structures.expect("a structure");
    let culling = Culling::default();
    let workload = Workload::new(&scene, &path, &culling).expect("a workload");
    let by_run = judge(&workload, usize::MAX).errors;
    assert!(by_run.visible > 700, "{by_run:?}");

    let subject = Subject::build(structures[0].clone(), false, &scene, culling.test);
    let mut checks = super::verify::check(&workload, &[subject], "", "");
    judge_camera_level(&workload, &mut checks, "", "");
    let by_verify = checks.iter().any(|check| check.difference.is_some());

    let setting = Setting {
        protocol: Protocol {
            rounds: [1, 1],
            cameras: 1,
            seed: 1,
            ..Protocol::default()
        },
        scene: scene.clone(),
        path,
        structures: structures.clone(),
    };
    let prepared = precision::prepare(&setting, 1).expect("no refusal");
    let times = precision::time(&setting, 1, &prepared.plan);
    let measured = prepared.conclude(&[times.expect("no refusal")]);
    let by_precision = measured.points.iter().any(|point| {
        let is_default = point.names.test == "six-plane"
            && point.names.arithmetic == "f32"
            && point.names.planes == "frame"
            && point.names.epsilon > 0.0;
        is_default && point.counts.is_some_and(|e| e.false_negatives > 0)
    });

    let case = Case::new(
        camera,
        PlaneOptions::default(),
        scene.surroundings(),
        scene.items.clone(),
    );
    let findings = case.expect("a case").check(&structures, 0);
    let by_stress = findings
        .faults
        .iter()
        .any(|fault| fault.subject[1] == "six-plane");
    [
        by_run.false_negatives > 0,
        by_verify,
        by_precision,
        by_stress,
    ]
}

#[test]
fn a_broken_frame_shows_in_run_verify_precision_and_stress() {
    assert_eq!(missed(sound()), [false; 4]);
    assert_eq!(missed(broken()), [true; 4]);
}
