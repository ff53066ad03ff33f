//! Every structure through the conformance suite, also with parameters other
//! than the defaults; then what needs the table of structures: all scenes and
//! paths, memory, the map's own tree.

use std::cell::Cell;
use std::ops::ControlFlow;

use cullbench::culling::Culling;
use cullbench::geometry::{Aabb, ConvexVolume, Plane};
use cullbench::index::{Auto, Bsp, Bvh, Input, Linear, LinearScalar, Octree, Quadtree};
use cullbench::index::{BspTextbook, BvhTextbook, OctreeTextbook, QuadtreeTextbook};
use cullbench::index::{BuildError, DynIndex, MemoryUsage, Registry, StructureSpec};
use cullbench::index::{Info, Kind, Moving, RegionIndex, UniformGrid, Wide};
use cullbench::kernel::Isa;
use cullbench::measure::Workload;
use cullbench::path::{self, LensDefaults};
use cullbench::query::{AnyVolume, Context, ItemId, Located, QueryVolume};
use cullbench::scene;
use cullbench::verify::Trial;
use cullbench::verify::conformance::properties;
use glam::Vec3;

thread_local! {
    /// The parameters that this thread builds structures with; empty for the defaults.
    ///
    /// No parameter of the type: each set would compile the whole suite again.
    static PARAMS: Cell<&'static str> = const { Cell::new("") };
}

/// A structure with the parameters of [`PARAMS`] for its defaults.
struct Given<T>(T);

impl<T: RegionIndex> RegionIndex for Given<T> {
    const INFO: Info = T::INFO;
    type Params = ();

    fn build(input: &Input<'_>, _: &()) -> Result<Self, BuildError> {
        let spec = format!("{}:{}", T::INFO.name, PARAMS.get());
        let spec = StructureSpec::parse(spec.trim_end_matches(':')).expect(&spec);
        let params = serde_json::from_value(spec.params).expect(T::INFO.name);
        T::build(input, &params).map(Given)
    }

    fn memory(&self) -> MemoryUsage {
        self.0.memory()
    }

    fn query<Q: QueryVolume, C: Context>(&self, volume: &Q, cx: &mut C) -> ControlFlow<()> {
        self.0.query(volume, cx)
    }

    fn query_many<I: Isa>(&self, isa: I, points: &[Vec3], out: &mut Located) {
        self.0.query_many(isa, points, out);
    }

    fn refit(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        self.0.refit(items, moved)
    }

    fn tree_order(&self) -> Option<&[ItemId]> {
        self.0.tree_order()
    }
}

/// Puts structures through the suite, each in a module of its own.
macro_rules! conforms {
    ($($module:ident: $structure:ty;)*) => {$(
        mod $module {
            use super::*;
            cullbench::conformance!($structure);
        }
    )*};
}

conforms! {
    linear_scalar: Given<LinearScalar>;
    linear: Given<Linear>;
    bsp: Given<Bsp>;
    octree: Given<Octree>;
    quadtree: Given<Quadtree>;
    bvh: Given<Bvh>;
    wide: Given<Wide>;
    moving: Given<Moving>;
    auto: Given<Auto>;
    uniform_grid: Given<UniformGrid>;
    bsp_textbook: Given<BspTextbook>;
    octree_textbook: Given<OctreeTextbook>;
    quadtree_textbook: Given<QuadtreeTextbook>;
    bvh_textbook: Given<BvhTextbook>;
}

/// The peers and their modules: tests and names from one list.
#[cfg(feature = "peers")]
macro_rules! peers {
    ($($module:ident: $peer:ident;)*) => {
        use cullbench::index::peers::{$($peer),*};

        conforms! { $($module: $peer;)* }

        const PEERS: &[&str] = &[$($peer::INFO.name),*];
    };
}

#[cfg(feature = "peers")]
peers! {
    peer_obvhs: PeerObvhs;
    peer_parry3d: PeerParry3d;
    peer_rstar: PeerRstar;
    peer_bvh: PeerBvh;
    peer_bevy_style: PeerBevyStyle;
}

#[cfg(not(feature = "peers"))]
const PEERS: &[&str] = &[];

/// Puts structures with other parameters than their defaults through the suite.
macro_rules! conforms_with {
    ($($name:ident: $structure:ty = $params:literal;)*) => {$(
        #[test]
        fn $name() {
            PARAMS.set($params);
            for (name, check) in properties::<Given<$structure>>() {
                check().expect(name);
            }
        }
    )*};
}

conforms_with! {
    octree_loose: Octree = "loose=2,leaf=4";
    octree_shallow: Octree = "depth=3,leaf=1";
    quadtree_loose: Quadtree = "loose=2";
    bsp_small_leaves: Bsp = "leaf=1";
    bsp_large_leaves: Bsp = "leaf=300";
    bsp_sah: Bsp = "builder=sah,leaf=3";
    bvh_fastest: Bvh = "preset=fastest,leaf=1";
    bvh_large_leaves: Bvh = "preset=medium,leaf=255";
    bvh_slowest: Bvh = "preset=very-slow";
    wide_morton: Wide = "order=morton";
    auto_linear: Auto = "use=linear";
    auto_wide: Auto = "use=wide";
    auto_moving: Auto = "use=moving";
    auto_rebuilt: Auto = "update=rebuild";
    bsp_textbook_deep: BspTextbook = "leaf=1,depth=256";
    octree_textbook_shallow: OctreeTextbook = "leaf=1,depth=3";
    quadtree_textbook_deep: QuadtreeTextbook = "leaf=1,depth=256";
    bvh_textbook_shallow: BvhTextbook = "leaf=1,depth=2";
}

#[test]
fn the_suite_has_every_structure_of_the_table() {
    let own = [
        LinearScalar::INFO.name,
        Linear::INFO.name,
        Bsp::INFO.name,
        Octree::INFO.name,
        Quadtree::INFO.name,
        Bvh::INFO.name,
        Wide::INFO.name,
        Moving::INFO.name,
        Auto::INFO.name,
        UniformGrid::INFO.name,
        BspTextbook::INFO.name,
        OctreeTextbook::INFO.name,
        QuadtreeTextbook::INFO.name,
        BvhTextbook::INFO.name,
    ];
    let here: Vec<_> = own.iter().chain(PEERS).copied().collect();
    let registry = Registry::builtin();
    let table: Vec<_> = registry.rows().iter().map(|row| row.info.name).collect();
    assert_eq!(here, table, "a structure without a line above");
}

fn build(name: &str, items: &[Aabb]) -> Box<dyn DynIndex> {
    let spec = StructureSpec::parse(name).expect(name);
    spec.build(items).expect(name)
}

/// A Quake III map of two rooms.
const MAP: &str = "tests/data/two_rooms.bsp";

#[test]
fn every_structure_returns_the_reference_set_on_every_scene_and_path() {
    let families = scene::FAMILIES.iter().map(|f| format!("{}:n=2000", f.name));
    let meshes = scene::MESHES.iter().map(|m| format!("{}:n=20000", m.name));
    let samples = scene::SAMPLES.iter().map(|s| s.name.to_owned());
    let maps = [MAP.to_owned()];
    for source in families.chain(meshes).chain(samples).chain(maps) {
        let scene = scene::load(&source, &Default::default()).expect(&source);
        let built: Vec<_> = Registry::builtin()
            .rows()
            .iter()
            .map(|b| build(b.info.name, &scene.items))
            .collect();
        let regions: Vec<_> = Registry::builtin()
            .rows()
            .iter()
            .map(|b| build(b.info.name, scene.regions.boxes(&scene.items)))
            .collect();
        for path in [
            "orbit:frames=6",
            "flythrough:frames=12",
            "teleport:frames=12",
            "outside:frames=2",
            "zoom:frames=4,far=inf",
        ] {
            let cameras = path::load(path, &scene, &LensDefaults::default()).expect(path);
            let workload = Workload::new(&scene, &cameras, &Culling::default()).expect(path);
            let mut trial = Trial::new(scene.items.len());
            for view in &workload.views {
                trial.set_view(&scene.items, view.as_any());
                for (index, row) in built.iter().zip(Registry::builtin().rows()) {
                    let answer = trial.run(|out| index.query(view.as_any(), out));
                    assert!(
                        answer.is_ok(),
                        "{} on {source}, {path}: {answer:?}",
                        row.info.name
                    );
                }
            }
            for sought in &workload.sought {
                let (p, wanted) = (sought.local, scene.holding(sought));
                for (index, row) in regions.iter().zip(Registry::builtin().rows()) {
                    let mut found = Vec::new();
                    index.locate(p, &mut found);
                    scene.refine(sought, &mut found, 0);
                    found.sort_unstable();
                    assert_eq!(found, wanted, "{} on {source} at {p}", row.info.name);
                    found.clear();
                    scene.search(sought, &mut found, |p, out| index.locate(p, out));
                    found.sort_unstable();
                    assert_eq!(found, wanted, "{} on {source} at {p}, moved", row.info.name);
                }
            }
        }
    }
}

#[test]
fn memory_and_counters_fit_the_items() {
    let scene = scene::load("uniform:n=5000", &Default::default()).expect("uniform");
    let nothing = ConvexVolume::from_planes(&[Plane::new(Vec3::X, -1e9)]).expect("a plane");
    for row in Registry::builtin().rows() {
        let index = build(row.info.name, &scene.items);
        assert!(index.memory().item_bytes >= 5000 * 28, "{}", row.info.name);
        let (mut out, mut cost) = (Vec::new(), Default::default());
        index.query_counted((&nothing).into(), &mut out, &mut cost);
        assert!(out.is_empty());
        // A scan looks at everything; a tree at its root, or at all of the
        // root's children, which lie in one block. Some peers keep no box of
        // the whole scene, but two of its halves.
        let looks = match row.info.name {
            _ if row.info.kind == Kind::Scan => 5000..=5000,
            "wide" | "moving" | "auto" => 1..=16,
            name if PEERS.contains(&name) => 1..=2,
            _ => 1..=1,
        };
        let compared = cost.comparisons();
        assert!(looks.contains(&compared), "{}: {compared}", row.info.name);
    }
}

#[test]
fn a_maps_own_tree_gives_the_reference_set() {
    for source in ["freedm-map12", MAP] {
        own_tree_gives_the_reference_set(source);
    }
}

fn own_tree_gives_the_reference_set(source: &str) {
    let map = scene::load(source, &Default::default()).expect("a map");
    let cameras = path::load("teleport:frames=40", &map, &LensDefaults::default()).expect("a path");
    let workload = Workload::new(&map, &cameras, &Culling::default()).expect("volumes");
    for name in ["bsp", "bsp:builder=import", "bsp-textbook"] {
        let spec = StructureSpec::parse(name).expect(name);
        // The items, and the boxes of the regions that region search asks for.
        for items in [&map.items[..], map.regions.boxes(&map.items)] {
            let index = spec
                .build(Input::new(items).own_tree(map.own_tree.as_ref()))
                .expect(name);
            let mut trial = Trial::new(items.len());
            for view in &workload.views {
                trial.set_view(items, view.as_any());
                let answer = trial.run(|out| index.query(view.as_any(), out));
                assert!(answer.is_ok(), "{name}");
            }
            for &p in &workload.points {
                let holding = items.iter().zip(0..).filter(|(b, _)| b.contains_point(p));
                trial.set_expected(holding.map(|(_, id)| id));
                let answer = trial.run(|out| index.locate(p, out));
                assert!(answer.is_ok(), "{name}");
            }
        }
    }
}

/// The order in which all items are seen tells which planes it was.
#[test]
fn bsp_takes_a_maps_own_planes_by_default_and_the_median_elsewhere() {
    let map = scene::load("freedm-map12", &Default::default()).expect("a sample");
    let order = |name: &str, own: Option<&cullbench::geometry::PlaneTree>| {
        let spec = StructureSpec::parse(name).expect(name);
        let index = spec
            .build(Input::new(&map.items).own_tree(own))
            .expect(name);
        let everything = ConvexVolume::from_planes(&[]).expect("no plane");
        let mut seen = Vec::new();
        index.query(AnyVolume::Planes(&everything), &mut seen);
        seen
    };
    let own = map.own_tree.as_ref();
    assert_eq!(order("bsp", own), order("bsp:builder=import", own));
    assert_eq!(order("bsp", None), order("bsp:builder=median", own));
    assert_ne!(order("bsp", own), order("bsp", None));
}
