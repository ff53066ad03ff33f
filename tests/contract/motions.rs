//! Structures return the sets of the scan in each frame of each motion.

use cullbench::culling::{Culling, CullingTest};
use cullbench::geometry::{ConvexVolume, Plane};
use cullbench::index::Registry;
use cullbench::measure::{Workload, input_of};
use cullbench::motion::{MOTIONS, Motion};
use cullbench::verify::Trial;
use cullbench::{path, scene};
use glam::Vec3;

/// Frames of each motion, with the same movers and with others in each frame.
const FRAMES: usize = 120;

#[test]
fn every_structure_is_right_in_every_frame_of_every_motion() {
    let scene = scene::load("city:n=150", &Default::default()).unwrap();
    let way = path::load("orbit:frames=11", &scene, &Default::default()).unwrap();
    let views = Workload::new(&scene, &way, &Culling::default())
        .unwrap()
        .views;
    let everything = ConvexVolume::from_planes(&[Plane::new(Vec3::X, 1e6)]).unwrap();
    let structures = Registry::builtin().structures("all").unwrap();
    for family in MOTIONS {
        for same in [true, false] {
            let spec = format!("{}:share=0.15,frames={FRAMES},same={same}", family.name);
            let motion = Motion::load(&spec, &scene).unwrap();
            for structure in &structures {
                let mut items = scene.items.clone();
                let mut index = structure.build(input_of(&scene, &items)).unwrap();
                let (mut replay, mut trial) = (motion.replay(), Trial::new(items.len()));
                for frame in 0..FRAMES {
                    let moved = replay.advance(&mut items).unwrap().to_vec();
                    let input = input_of(&scene, &items);
                    structure.update(&mut index, input, &moved).unwrap();
                    let view = views[frame % views.len()].as_any();
                    for volume in [view, (&everything).into()] {
                        trial.set_view(&items, volume);
                        let found = trial.run(|ids| index.query(volume, ids));
                        assert!(
                            found.is_ok(),
                            "{} in frame {frame} of {spec}: {found:?}",
                            structure.label
                        );
                    }
                }
                assert!(replay.advance(&mut items).is_none());
            }
        }
    }
}

#[test]
fn spheres_are_those_of_the_scan_in_every_frame() {
    let scene = scene::load("city:n=300", &Default::default()).unwrap();
    let way = path::load("orbit:frames=11", &scene, &Default::default()).unwrap();
    let test = CullingTest::Sphere;
    let culling = Culling {
        test,
        ..Culling::default()
    };
    let workload = Workload::new(&scene, &way, &culling).unwrap();
    let names = "linear,wide,moving,auto:use=linear,auto:use=moving,auto:use=wide";
    let structures = Registry::builtin().structures(names).unwrap();
    for family in MOTIONS {
        let spec = format!("{}:share=0.15,frames={FRAMES},same=false", family.name);
        let motion = Motion::load(&spec, &scene).unwrap();
        for structure in &structures {
            let (mut items, mut replay) = (scene.items.clone(), motion.replay());
            let cubes = test.items(&items);
            let input = input_of(&scene, &cubes).spheres(true);
            let (mut index, mut trial) = (structure.build(input).unwrap(), Trial::new(300));
            for frame in 0..FRAMES {
                let moved = replay.advance(&mut items).unwrap();
                let cubes = test.items(&items);
                let input = input_of(&scene, &cubes).spheres(true);
                structure.update(&mut index, input, moved).unwrap();
                let view = workload.views[frame % way.cameras.len()].as_any();
                trial.set_view(&cubes, view);
                let found = trial.run(|ids| index.query(view, ids));
                let label = &structure.label;
                assert!(found.is_ok(), "{label}, frame {frame} of {spec}: {found:?}");
            }
        }
    }
}
