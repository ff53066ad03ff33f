//! Threads change nothing but the time: the same tree, the same answers in the
//! same order, on every edge scene.

use cullbench::geometry::{Aabb, ConvexVolume};
use cullbench::index::{BlockOrder, FrustumQuery, Input, Pool, RegionIndex, Wide, WideParams};
use cullbench::scene;
use cullbench::verify::{RandomCase, edge_scenes, edge_volumes};
use glam::Vec3;

const THREADS: std::ops::RangeInclusive<usize> = 1..=5;

fn built(threads: usize, items: &[Aabb], order: BlockOrder) -> Wide {
    let pool = Pool::new(threads);
    let input = Input::new(items).pool(&pool);
    Wide::build(&input, &WideParams { order }).expect("finite items")
}

/// Scenes with the volumes to ask them: all edge scenes, random cases, and
/// worlds that are large enough to be split.
fn cases() -> Vec<(String, Vec<Aabb>, Vec<ConvexVolume>)> {
    let edges = edge_scenes().into_iter().map(|(name, items)| {
        let volumes = edge_volumes(&items).into_iter().step_by(7).collect();
        (name.to_owned(), items, volumes)
    });
    let random = (0..64).map(|seed| {
        let case = RandomCase::new(seed);
        (format!("random case {seed}"), case.items, vec![case.volume])
    });
    let worlds = ["uniform:n=400001", "city:n=250000", "clustered:n=199999"].map(|source| {
        let scene = scene::load(source, &Default::default()).expect(source);
        let bounds = scene.bounds;
        let around = |share: f32| {
            let half = bounds.extent() * share;
            let low = bounds.centre() - half;
            let high = bounds.centre() + half;
            let faces = [Vec3::X, Vec3::Y, Vec3::Z].into_iter().flat_map(|axis| {
                let tilted = (axis + Vec3::new(0.1, -0.05, 0.02)).normalize();
                [
                    cullbench::geometry::Plane::through(low, tilted),
                    cullbench::geometry::Plane::through(high, -tilted),
                ]
            });
            ConvexVolume::from_planes(&faces.collect::<Vec<_>>()).expect("finite planes")
        };
        let mut volumes = [0.01, 0.1, 0.25, 0.3, 0.35, 0.4, 0.45, 3.0]
            .map(around)
            .to_vec();
        volumes.push(ConvexVolume::from_planes(&[]).expect("no planes"));
        (source.to_owned(), scene.items, volumes)
    });
    edges.chain(random).chain(worlds).collect()
}

#[test]
fn a_tree_that_several_threads_have_built_is_the_tree_of_one() {
    let mut large = 0;
    for (name, items, volumes) in cases() {
        for order in [BlockOrder::Median, BlockOrder::Morton] {
            let one = built(1, &items, order);
            for threads in THREADS {
                let tree = built(threads, &items, order);
                assert!(tree.same_as(&one), "{name}, {order:?}, {threads} threads");
                let (mut here, mut there) = (Vec::new(), Vec::new());
                for volume in &volumes {
                    one.visible_ranges(volume, &mut here);
                    tree.visible_ranges(volume, &mut there);
                }
                assert_eq!(here, there, "{name}, {order:?}, {threads} threads");
            }
        }
        large += usize::from(items.len() > 50_000);
    }
    assert_eq!(large, 3);
}
