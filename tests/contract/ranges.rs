//! Answers as ranges of tree order hold what answers as ids hold, for every
//! structure that keeps such an order.

use std::ops::Range;

use cullbench::geometry::ConvexVolume;
use cullbench::index::{Bsp, Bvh, FrustumQuery, Input, Octree, Quadtree, Query, RegionIndex, Wide};
use cullbench::kernel::Kernel;
use cullbench::path::{self, LensDefaults};
use cullbench::query::{ItemId, NoRecorder, Ranges};
use cullbench::scene::{self, Scene};

fn check<T: RegionIndex>(kernel: Kernel, scene: &Scene, volumes: &[ConvexVolume]) {
    let items = &scene.items;
    let index = T::build(&Input::new(items), &T::Params::default()).expect(T::INFO.name);
    for volume in volumes {
        let what = format!("{} on {}", T::INFO.name, scene.name);
        let mut ids = index.visible(volume);
        // A range of another query, which ends where tree order begins.
        let theirs = Range {
            start: u32::MAX,
            end: 0,
        };
        let mut ranges = Vec::from([theirs.clone()]);
        let _ = kernel.run(Query {
            index: &index,
            volume,
            sink: &mut Ranges::onto(&mut ranges),
            recorder: &mut NoRecorder,
        });
        let order = index.tree_order().expect("declared");
        assert_eq!(ranges.remove(0), theirs, "{what}: not appended");
        let ends = ranges.windows(2).all(|two| two[0].end != two[1].start);
        assert!(ends, "{what}: adjoining ranges are one");
        assert!(ranges.iter().all(|range| !range.is_empty()), "{what}");
        let of = |range: &Range<u32>| range.start as usize..range.end as usize;
        let mut held: Vec<ItemId> = ranges
            .iter()
            .flat_map(|range| &order[of(range)])
            .copied()
            .collect();
        held.sort_unstable();
        ids.sort_unstable();
        assert_eq!(held, ids, "{what}");
        if volume.mask() == 0 {
            let all = 0..order.len() as u32;
            assert_eq!(ranges, Vec::from_iter([all]), "{what}");
        }
    }
}

#[test]
fn ranges_hold_what_the_ids_say() {
    for kernel in Kernel::available() {
        for (source, way) in [
            ("uniform:n=5000", "orbit:frames=8"),
            ("city:n=3000", "flythrough:frames=12,visible=2%"),
            ("freedm-map12", "places:frames=12"),
            ("uniform:n=5", "orbit:frames=4"),
        ] {
            let scene = scene::load(source, &Default::default()).expect(source);
            let cameras = path::load(way, &scene, &LensDefaults::default()).expect(way);
            let around = scene.surroundings();
            let mut volumes: Vec<ConvexVolume> = cameras
                .cameras
                .iter()
                .map(|camera| camera.volume(&Default::default(), &around).expect(way))
                .collect();
            volumes.push(ConvexVolume::from_planes(&[]).expect("all of space"));
            check::<Wide>(kernel, &scene, &volumes);
            check::<Bsp>(kernel, &scene, &volumes);
            check::<Octree>(kernel, &scene, &volumes);
            check::<Quadtree>(kernel, &scene, &volumes);
            check::<Bvh>(kernel, &scene, &volumes);
        }
    }
}
