//! The goals, a row each: which world, which way through it, how far ahead of
//! other crates and how close to the bounds. How they are judged is next door.

/// A scene with the goals that hold on all ways through it.
pub struct World {
    pub scene: &'static str,
    pub frames: usize,
    pub cold: bool,
    /// Time of `linear` / time of `bound-read`, at most, where nearly all of
    /// both is reading.
    pub scan: f64,
    /// Trees that suit the scene: each at least as fast as any other crate. The
    /// others are [never much slower](LEAST_OF_TREES).
    pub ahead: &'static [&'static str],
    pub ways: &'static [Way],
}

/// A way through it.
pub struct Way {
    pub path: &'static str,
    /// Time of the fastest structure of another crate / time of the subject, at
    /// least.
    pub peers: f64,
    /// Time of the subject / time of a bound, at most.
    pub bound: Option<(&'static str, f64)>,
}

const fn way(path: &'static str, peers: f64, bound: Option<(&'static str, f64)>) -> Way {
    Way { path, peers, bound }
}

pub const TINY: &str = "flythrough:visible=0.1%";
const FEW: &str = "flythrough:visible=2%";
const MANY: &str = "orbit:visible=20%";
pub const ALL: &str = "outside";

const COPY: Option<(&str, f64)> = Some(("times_memcpy", 1.2));

const OF_TEN_THOUSAND: [Way; 4] = [
    way(TINY, 3.0, None),
    way(FEW, 7.0, None),
    way(MANY, 12.0, None),
    way(ALL, 50.0, None),
];
const OF_A_MILLION: [Way; 4] = [
    way(TINY, 10.0, None),
    way(FEW, 20.0, None),
    way(MANY, 33.0, None),
    way(ALL, 65.0, COPY),
];

/// The trees that are judged beside the subject.
pub const TREES: [&str; 4] = ["bsp", "octree", "quadtree", "bvh"];
/// Time of the fastest structure of another crate / time of any tree, at least,
/// in any world.
pub const LEAST_OF_TREES: f64 = 1.0 / 3.0;

pub const WORLDS: [World; 9] = [
    World {
        scene: "uniform:n=10000",
        frames: 512,
        cold: false,
        scan: 2.5,
        ahead: &[],
        ways: &OF_TEN_THOUSAND,
    },
    World {
        scene: "uniform:n=100000",
        frames: 256,
        cold: false,
        scan: 1.6,
        ahead: &TREES,
        ways: &[
            way(TINY, 5.5, None),
            way(FEW, 11.0, None),
            way(MANY, 14.0, None),
            way(ALL, 50.0, COPY),
        ],
    },
    World {
        scene: "uniform:n=1000000",
        frames: 128,
        cold: false,
        scan: 1.8,
        ahead: &TREES,
        ways: &OF_A_MILLION,
    },
    World {
        scene: "uniform:n=1000000",
        // Caches are swept before each query.
        frames: 32,
        cold: true,
        scan: 1.45,
        ahead: &TREES,
        ways: &[
            way(TINY, 5.0, None),
            way(FEW, 8.0, None),
            way(MANY, 14.0, None),
            way(ALL, 25.0, None),
        ],
    },
    World {
        scene: "city:n=1000000",
        frames: 128,
        cold: false,
        scan: 1.8,
        ahead: &TREES,
        ways: &[
            way(TINY, 10.0, None),
            way(FEW, 20.0, None),
            way(MANY, 55.0, None),
            way(ALL, 65.0, COPY),
        ],
    },
    World {
        scene: "clustered:n=1000000",
        frames: 128,
        cold: false,
        scan: 1.8,
        ahead: &TREES,
        ways: &OF_A_MILLION,
    },
    // Eleven thousand buildings: the goals of ten thousand boxes.
    World {
        scene: "helsinki",
        frames: 512,
        cold: false,
        scan: 2.5,
        ahead: &[],
        ways: &OF_TEN_THOUSAND,
    },
    // Three thousand and fewer: no goal but to be ahead.
    World {
        scene: "us-counties",
        frames: 512,
        cold: false,
        scan: 2.5,
        ahead: &[],
        ways: &[way("orbit", 1.0, None), way(ALL, 1.0, None)],
    },
    World {
        scene: "freedm-map20",
        frames: 512,
        cold: false,
        scan: 2.5,
        ahead: &[],
        ways: &[way("places", 1.0, None), way(FEW, 1.0, None)],
    },
];

/// CPU time of a build and memory, per item, at most; in every world.
pub const MOST_BUILD_NS: f64 = 90.0;
pub const MOST_BYTES: f64 = 30.0;
/// CPU time of an answer in ranges, at most; in warm worlds where all is visible.
pub const MOST_RANGES_US: f64 = 0.1;
