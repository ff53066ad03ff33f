//! Threads change nothing but the time: the same tree, the same sets, the same
//! order, on every edge scene and for every kind of view.

use std::thread::scope;

use cullbench::geometry::{Aabb, ConvexVolume, RelativeVolume, Spheres, WideVolume, sphere_cube};
use cullbench::index::{
    BlockOrder, Crew, DynIndex, Registry, StructureSpec, TreeOrder, Wide, WideParams, see_each,
};
use cullbench::query::{AnyView, ItemId};
use cullbench::scene;
use cullbench::verify::{RandomCase, Reference, edge_scenes, edge_volumes};
use glam::Vec3;

const THREADS: std::ops::RangeInclusive<usize> = 1..=5;

/// A volume as every kind of view.
struct Views {
    volume: ConvexVolume,
    spheres: Spheres,
    wide: WideVolume,
    relative: Option<RelativeVolume>,
}

impl Views {
    fn new(volume: &ConvexVolume, eye: Vec3) -> Views {
        Views {
            volume: volume.clone(),
            spheres: Spheres::new(volume),
            wide: WideVolume::from(volume),
            relative: RelativeVolume::about(eye, volume).ok(),
        }
    }

    /// Those for the items themselves, and the one for their spheres' cubes.
    fn of_items(&self) -> Vec<AnyView<'_>> {
        let relative = self.relative.iter().map(AnyView::from);
        [(&self.volume).into(), (&self.wide).into()]
            .into_iter()
            .chain(relative)
            .collect()
    }
}

fn built(threads: usize, items: &[Aabb], order: BlockOrder) -> Wide {
    Wide::build_on(threads, items, &WideParams { order }).expect("finite items")
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
fn a_query_on_a_crew_gives_the_reference_set_in_one_order() {
    let mut reordered = 0;
    for (name, items, volumes) in cases() {
        let cubes: Vec<Aabb> = items.iter().map(sphere_cube).collect();
        let trees = [&items, &cubes].map(|items| built(1, items, BlockOrder::Median));
        let mut reference = Reference::new(items.len());
        // The answers of one thread; those of more are held to them.
        let mut wanted: Vec<Vec<ItemId>> = Vec::new();
        for threads in THREADS {
            scope(|scope| {
                let mut crews = trees.each_ref().map(|tree| Crew::new(scope, tree, threads));
                assert_eq!(crews[0].threads(), threads);
                let mut place = 0;
                for (i, volume) in volumes.iter().enumerate() {
                    let eye = items.first().map_or(Vec3::ONE, |b| b.max);
                    let views = Views::new(volume, eye);
                    let of_items = views.of_items().into_iter().map(|view| (0, view));
                    for (which, view) in of_items.chain([(1, (&views.spheres).into())]) {
                        let mut found = vec![ItemId::MAX];
                        crews[which].see(view, &mut found);
                        assert_eq!(found.remove(0), ItemId::MAX, "appended");
                        if threads == 1 {
                            reference.see([&items, &cubes][which], view);
                            let difference = reference.compare(&found);
                            assert!(
                                difference.is_none(),
                                "{name}, volume {i}, {view:?}: {difference}"
                            );
                            let mut whole = Vec::new();
                            trees[which].see(view, &mut whole);
                            reordered += usize::from(whole != found);
                            wanted.push(found);
                        } else {
                            assert_eq!(found, wanted[place], "{name}, volume {i}, {threads}");
                        }
                        place += 1;
                    }
                }
            });
        }
    }
    assert!(reordered >= 10, "only {reordered} queries were split");
}

#[test]
fn a_tree_that_several_threads_have_built_is_the_tree_of_one() {
    let mut large = 0;
    for (name, items, volumes) in cases() {
        for order in [BlockOrder::Median, BlockOrder::Morton] {
            let one = built(1, &items, order);
            let all = TreeOrder::visible_ranges;
            for threads in THREADS {
                let tree = built(threads, &items, order);
                assert!(tree.same_as(&one), "{name}, {order:?}, {threads} threads");
                let (mut here, mut there) = (Vec::new(), Vec::new());
                for volume in &volumes {
                    all(&one, volume, &mut here);
                    all(&tree, volume, &mut there);
                }
                assert_eq!(here, there, "{name}, {order:?}, {threads} threads");
            }
        }
        large += usize::from(items.len() > 50_000);
    }
    assert_eq!(large, 3);
}

#[test]
fn many_cameras_are_answered_each_in_its_place() {
    for (name, items, volumes) in cases() {
        let views: Vec<Views> = volumes.iter().map(|v| Views::new(v, Vec3::ONE)).collect();
        let views: Vec<AnyView> = views.iter().flat_map(Views::of_items).collect();
        for row in Registry::builtin().rows() {
            if items.len() > 50_000 && row.info.name != "wide" {
                continue;
            }
            let spec = StructureSpec::parse(row.info.name).expect(row.info.name);
            let index = spec.build(&items).expect(row.info.name);
            let one_by_one: Vec<Vec<ItemId>> = views
                .iter()
                .map(|&view| {
                    let mut out = Vec::new();
                    index.see(view, &mut out);
                    out
                })
                .collect();
            // What is left of a former call must not matter.
            let mut out = vec![vec![7]; views.len() + 3];
            for threads in THREADS {
                see_each(&*index, &views, threads, &mut out);
                assert_eq!(out, one_by_one, "{} on {name}, {threads}", row.info.name);
            }
        }
    }
}
