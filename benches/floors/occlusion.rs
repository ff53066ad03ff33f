//! Floors of the occlusion stage: rectangles of a tree's boxes in its order, and
//! sixteen boxes a test against the same boxes one by one.

use std::hint::black_box;

use cullbench::culling::Culling;
use cullbench::kernel::{Isa, Kernel, LaneMask, Work};
use cullbench::measure::{Stopwatch, Workload, trimmed_mean};
use cullbench::query::AnyVolume;
use cullbench::visibility::occlusion::{
    Interleaved, MaskedInner, OccluderTree, OcclusionBuffer, Rects, View,
};
use cullbench::visibility::{Rays, SampleGrid, Solids};

use super::{loaded, ratio, verdict};

const SCENE: &str = "city:n=100000";
const PATH: &str = "street:frames=32";
const GRID: SampleGrid = SampleGrid::new(320, 180);
/// Time of a rectangle.
const MOST_NS: f64 = 4.0;
/// Time one by one / time of sixteen at a time.
const LEAST_TIMES: f64 = 2.5;

// No closures within `run`: they would be compiled for the portable set.

/// The rectangles of all boxes.
struct Project<'a>(&'a OccluderTree, &'a View<'a>);

impl Work for Project<'_> {
    type Output = LaneMask;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> LaneMask {
        let (mut rects, mut all) = (Rects::default(), 0);
        for block in self.0.levels[0].blocks() {
            rects.project(isa, block, self.1);
            all ^= black_box(&rects).seen;
        }
        all
    }
}

/// Rectangles of the boxes of a view's blocks, with masks of their lanes.
type Asked = [(Rects, LaneMask)];

/// How many of them are hidden, sixteen at a time.
struct Together<'a>(&'a MaskedInner, &'a Asked);

impl Work for Together<'_> {
    type Output = u32;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> u32 {
        let mut hidden = 0;
        for (rects, lanes) in self.1 {
            hidden += self.0.hides_lanes(isa, rects, *lanes).count_ones();
        }
        hidden
    }
}

/// The same one by one.
struct Alone<'a>(&'a MaskedInner, &'a Asked);

impl Work for Alone<'_> {
    type Output = u32;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> u32 {
        let mut hidden = 0;
        for (rects, lanes) in self.1 {
            let mut left = *lanes;
            while left != 0 {
                let lane = left.trailing_zeros() as usize;
                left &= left - 1;
                hidden += u32::from(self.0.hides(isa, &rects.get(lane)));
            }
        }
        hidden
    }
}

/// Collects the rectangles of all boxes in view, block by block.
struct QueryFn<'a>(
    &'a OccluderTree,
    &'a View<'a>,
    &'a mut Vec<(Rects, LaneMask)>,
);

impl Work for QueryFn<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let QueryFn(scene, view, asked) = self;
        for (index, block) in scene.levels[0].blocks().iter().enumerate() {
            let admitted = block.admitted_by(isa, view.volume, view.volume.mask());
            let mut rects = Rects::default();
            rects.project(isa, block, view);
            let lanes = scene.lanes(0, index) & admitted & rects.seen & rects.flat;
            if lanes != 0 {
                asked.push((rects, lanes));
            }
        }
    }
}

/// Judges both on every instruction set that has vectors; how many are missed.
pub fn missed(only_test: bool, turns: usize) -> u32 {
    let wide = Kernel::available().filter(|kernel| *kernel != Kernel::Portable);
    wide.map(|kernel| missed_by(kernel, only_test, turns)).sum()
}

fn missed_by(kernel: Kernel, only_test: bool, turns: usize) -> u32 {
    let (source, scene, cameras) = loaded(SCENE, PATH, only_test);
    let workload = Workload::new(&scene, &cameras, &Culling::default()).expect("views");
    let occluders = OccluderTree::of(&Solids::of(&scene));
    let mut views = Vec::new();
    for (camera, view) in cameras.cameras.iter().zip(&workload.views) {
        let AnyVolume::Planes(volume) = view.as_any() else {
            unreachable!("a perspective camera's default test")
        };
        let rays = Rays::of(camera).expect("rays");
        let view = View::new(&rays, volume, &occluders, GRID);
        let mut culling = Interleaved::new(MaskedInner::new(GRID), kernel);
        culling.cull(&occluders, &view, &mut Vec::new());
        let mut asked = Vec::new();
        kernel.run(QueryFn(&occluders, &view, &mut asked));
        views.push((view, culling, asked));
    }

    let laps = (0..turns).map(|_| {
        let watch = Stopwatch::start();
        for (view, ..) in &views {
            black_box(kernel.run(Project(&occluders, view)));
        }
        watch.lap().cpu_ns / (views.len() * occluders.len()) as f64
    });
    let laps = laps.collect::<Vec<_>>();
    let ns = trimmed_mean(&laps).expect("turns");
    let (low, high) = ns.interval(0.95);
    let fast = only_test || ns.mean <= MOST_NS;
    println!(
        "{source}, {kernel}: rectangles of all boxes in the order of the tree, {:.2} ns [{low:.2}, {high:.2}] each, at most \
         {MOST_NS} ns: {}",
        ns.mean,
        verdict(only_test, fast)
    );

    let counts = |count: &dyn Fn(&MaskedInner, &Asked) -> u32| -> Vec<u32> {
        let of_view = |(_, culling, asked): &(_, Interleaved<MaskedInner>, Vec<_>)| {
            count(&culling.buffer, asked)
        };
        views.iter().map(of_view).collect()
    };
    let together = |buffer: &MaskedInner, asked: &Asked| kernel.run(Together(buffer, asked));
    let alone = |buffer: &MaskedInner, asked: &Asked| kernel.run(Alone(buffer, asked));
    assert_eq!(
        counts(&together),
        counts(&alone),
        "the same boxes are hidden"
    );
    let timed = |count: &dyn Fn(&MaskedInner, &Asked) -> u32| {
        let watch = Stopwatch::start();
        black_box(counts(count));
        watch.lap().cpu_ns
    };
    let [times, low, high] = ratio(turns, || timed(&alone), || timed(&together));
    let ahead = only_test || times >= LEAST_TIMES;
    println!(
        "{source}, {kernel}: one by one takes {times:.2} x [{low:.2}, {high:.2}] sixteen boxes a test, at least \
         {LEAST_TIMES} x: {}",
        verdict(only_test, ahead)
    );
    u32::from(!fast) + u32::from(!ahead)
}
