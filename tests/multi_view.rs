//! Several views in one pass give the sets of separate queries: random cases,
//! edge scenes and camera sets, every kind of view, every instruction set,
//! every structure. A process of its own, because the kernel is chosen for the
//! process.

use std::ops::ControlFlow;

use cullbench::camera::{PlaneOptions, ViewSet};
use cullbench::geometry::{Aabb, ConvexVolume, Plane, RelativeVolume, Spheres, WideVolume};
use cullbench::index::{DynIndex, Execution, RegionIndex, Registry, StructureSpec, Wide};
use cullbench::kernel::{BASELINE, Kernel};
use cullbench::query::{AnyView, ItemId, Sink};
use cullbench::verify::{RandomCase, Reference, edge_scenes, edge_volumes};
use cullbench::{path, scene};
use glam::Vec3;

fn wide(items: &[Aabb]) -> Wide {
    Wide::build(items, None, &Default::default()).expect("finite items")
}

/// Every list must hold exactly what its view sees. Ids in all of them.
fn check(name: &str, items: &[Aabb], views: &[AnyView<'_>], lists: &[Vec<ItemId>]) -> usize {
    let mut reference = Reference::new(items.len());
    for (i, (view, list)) in views.iter().zip(lists).enumerate() {
        reference.see(items, *view);
        let difference = reference.compare(list);
        assert!(difference.is_none(), "{name}, view {i}: {difference}");
    }
    lists.iter().map(Vec::len).sum()
}

/// One pass over volumes, by every kernel: right, and the same lists.
fn one_pass(name: &str, items: &[Aabb], volumes: &[ConvexVolume]) -> usize {
    let spec = StructureSpec::parse("wide").expect("wide");
    let views: Vec<AnyView> = volumes.iter().map(AnyView::from).collect();
    let mut first: Option<Vec<Vec<ItemId>>> = None;
    let mut ids = 0;
    for kernel in Kernel::available() {
        let by = Execution { kernel, threads: 1 };
        let tree = spec.clone().by(by).build(items).expect("sound items");
        let mut lists = vec![Vec::new(); views.len()];
        tree.see_many(&views, &mut lists);
        ids += check(&format!("{name}, {kernel}"), items, &views, &lists);
        let first = first.get_or_insert_with(|| lists.clone());
        assert!(*first == lists, "{name}: {kernel} has another order");
    }
    ids
}

/// The volume again, moved a little: what two eyes are to each other.
fn beside(volume: &ConvexVolume, by: f32) -> ConvexVolume {
    let moved = volume
        .planes()
        .iter()
        .map(|p| Plane::new(p.normal, p.d + by));
    ConvexVolume::from_planes(&moved.collect::<Vec<_>>()).expect("finite")
}

#[test]
fn one_pass_gives_the_sets_of_separate_queries() {
    let mut ids = 0;
    for seed in 0..300 {
        let case = RandomCase::new(seed);
        // Volumes of other cases, of other scales: some see nothing.
        let mut volumes = vec![case.volume.clone()];
        volumes.extend((1..1 + seed % 5).map(|i| RandomCase::new(1000 * i + seed).volume));
        volumes.push(beside(&case.volume, 0.5));
        volumes.push(case.volume.clone());
        let normals: usize = volumes.iter().map(|v| v.planes().len()).sum();
        if normals > 32 {
            volumes = vec![case.volume.clone(), beside(&case.volume, -0.25)];
        }
        ids += one_pass(&format!("random case {seed}"), &case.items, &volumes);
    }
    for (name, items) in edge_scenes() {
        let volumes = edge_volumes(&items);
        for volumes in volumes.chunks(9) {
            ids += one_pass(name, &items, volumes);
        }
    }
    for source in ["uniform:n=20000", "city:n=20000", "freedm-map12"] {
        let scene = scene::load(source, &Default::default()).expect(source);
        let way = "teleport:frames=6,visible=3%";
        let cameras = path::load(way, &scene, &Default::default()).expect(way);
        for camera in &cameras.cameras {
            for set in [
                ViewSet::Single,
                ViewSet::Stereo {
                    distance: camera.lens.near(),
                },
                ViewSet::Cascades { count: 4 },
                ViewSet::Cube,
                ViewSet::Frame,
            ] {
                let views = set.cameras(camera).expect("a finite camera");
                let volume = |c: &cullbench::camera::Camera| {
                    c.volume(&PlaneOptions::default(), &scene.surroundings())
                        .expect("fits")
                };
                let volumes: Vec<ConvexVolume> = views.iter().map(volume).collect();
                ids += one_pass(source, &scene.items, &volumes);
            }
        }
    }
    assert!(ids > 400_000 * Kernel::available().count(), "{ids}");
    views_of_all_kinds();
}

/// `see_many` of every structure with a mixture of views.
fn views_of_all_kinds() {
    for kernel in Kernel::available() {
        for seed in 0..60 {
            let case = RandomCase::new(seed);
            let (volume, moved) = (&case.volume, beside(&case.volume, 0.125));
            let (spheres, finer) = (Spheres::new(volume), WideVolume::from(volume));
            let relative = RelativeVolume::about(case.point, volume).ok();
            let mut views: Vec<AnyView> = vec![volume.into(), (&finer).into(), (&moved).into()];
            views.extend(relative.as_ref().map(AnyView::from));
            // Spheres on boxes as they are: a view like any other.
            views.push((&spheres).into());
            for row in Registry::builtin().rows() {
                let spec = StructureSpec::parse(row.info.name).expect(row.info.name);
                let index = spec
                    .by(Execution { kernel, threads: 1 })
                    .build(&case.items)
                    .expect(row.info.name);
                let mut lists = vec![Vec::new(); views.len()];
                index.see_many(&views, &mut lists);
                let name = format!("{}, {kernel}, case {seed}", row.info.name);
                check(&name, &case.items, &views, &lists);
            }
        }
    }
}

/// Takes so many slices, then no more.
struct Few {
    left: usize,
    ids: Vec<ItemId>,
}

impl Sink for Few {
    fn accept(&mut self, ids: &[ItemId]) -> ControlFlow<()> {
        assert!(self.left > 0, "called again after a break");
        self.left -= 1;
        self.ids.extend_from_slice(ids);
        if self.left == 0 {
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    }
}

#[test]
fn a_sink_that_breaks_off_ends_its_own_query_only() {
    let scene = scene::load("uniform:n=60000", &Default::default()).expect("uniform");
    let tree = wide(&scene.items);
    let plane = |x: f32| Plane::new(Vec3::new(1.0, 0.1, 0.2), -x);
    let middle = scene.bounds.centre().x;
    let volumes = [middle, middle * 1.1, middle * 0.9]
        .map(|x| ConvexVolume::from_planes(&[plane(x)]).expect("a plane"));
    let count = |volume: &ConvexVolume| scene.items.iter().filter(|b| volume.sees(b)).count();
    for first in [1, 2, 5, 20] {
        let mut sinks = [first, usize::MAX, 3].map(|left| Few {
            left,
            ids: Vec::new(),
        });
        let mut asked: Vec<_> = volumes.iter().zip(&mut sinks).collect();
        tree.visible_together(BASELINE, &mut asked);
        assert_eq!(sinks[1].ids.len(), count(&volumes[1]));
        for (sink, volume) in sinks.iter().zip(&volumes) {
            assert!(
                sink.ids
                    .iter()
                    .all(|&id| volume.sees(&scene.items[id as usize]))
            );
        }
        assert_eq!((sinks[0].left, sinks[2].left), (0, 0));
    }
}

#[test]
fn many_views_and_none_are_no_trouble() {
    let items = [Aabb::around(Vec3::ZERO, Vec3::ONE)];
    let tree = wide(&items);
    let all = ConvexVolume::from_planes(&[]).expect("no plane");
    // More that are alike than one mask has bits, and more normals.
    let many: Vec<ConvexVolume> = (0..70)
        .map(|i| ConvexVolume::from_planes(&[Plane::new(Vec3::X, i as f32)]).expect("a plane"))
        .collect();
    let normals: Vec<Plane> = (0..33)
        .map(|i| Plane::new(Vec3::new(1.0, i as f32, 0.0), 99.0))
        .collect();
    let halves: Vec<ConvexVolume> = normals
        .chunks(17)
        .map(|p| ConvexVolume::from_planes(p).expect("planes"))
        .collect();
    let finer = WideVolume::from(&all);
    let asked: [Vec<AnyView>; 5] = [
        vec![(&all).into(), (&all).into(), (&many[0]).into()],
        many.iter().map(AnyView::from).collect(),
        halves.iter().map(AnyView::from).collect(),
        vec![(&all).into(), (&finer).into(), (&all).into()],
        vec![],
    ];
    for views in asked {
        let mut lists = vec![Vec::new(); views.len()];
        tree.see_many(&views, &mut lists);
        assert!(lists.iter().all(|list| *list == [0]));
        let mut lists = vec![Vec::new(); views.len()];
        wide(&[]).see_many(&views, &mut lists);
        assert!(lists.iter().all(Vec::is_empty));
    }
}

/// A tree of several levels in which hundreds of leaves are wholly inside, volumes
/// about the edge of "nearly the same": between two planes, a third one that is
/// moved, in both directions; or all three; or one that is turned.
#[test]
fn volumes_about_as_near_as_can_share() {
    let scene = scene::load("uniform:n=60000", &Default::default()).expect("uniform");
    let b = scene.bounds;
    let at = |share: f32| b.min.x + share * b.extent().x;
    let volume = |moved: f32, slab: f32| {
        let (n, side) = (Vec3::new(1.0, 0.3, 0.0) * 2.0, Vec3::new(0.2, -1.0, 0.4));
        let planes = [
            Plane::new(n, -n.x * at(0.2 + slab)),
            Plane::new(-n, n.x * at(0.9 + slab)),
            Plane::new(side, side.length() * moved - side.dot(b.centre())),
        ];
        ConvexVolume::from_planes(&planes).expect("finite")
    };
    for apart in [0.0, 1e-7, 0.01, 0.05, 0.16, 0.17, 0.18, 0.7] {
        let by = apart * b.extent().x;
        for slab in [0.0, apart] {
            let volumes = [
                volume(0.0, 0.0),
                volume(by, slab),
                volume(-0.5 * by, -slab),
                volume(by, 0.0),
            ];
            one_pass(&format!("{apart} apart"), &scene.items, &volumes);
        }
    }
    let here = volume(0.0, 0.0);
    let mut turned = here.planes().to_vec();
    turned[2].normal += Vec3::new(0.0, 0.0, 0.3);
    let turned = ConvexVolume::from_planes(&turned).expect("finite");
    one_pass("turned", &scene.items, &[here, turned]);
}
