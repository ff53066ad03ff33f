//! What reuse between frames could gain on the wide tree, at the very most: a
//! query of which everything above the leaves is known beforehand, for nothing,
//! against the whole query and its twin (an A/A control). On a slow, a fast and
//! a shuffled flight; with what the leaves have open, and how many of them were
//! undecided in the frame before. `-- --test` only checks that it runs.

use std::ops::ControlFlow;
use std::process::ExitCode;

use cullbench::camera::PlaneOptions;
use cullbench::geometry::{ConvexVolume, LaneMask};
use cullbench::index::{DynIndex, Foreseen, FrustumQuery, RegionIndex, Wide};
use cullbench::kernel::Isa;
use cullbench::measure::{Ask, Competitor, Machine, Protocol, Timed, timed_rounds};
use cullbench::query::{ItemId, QueryCost, Recorder, Sink};
use cullbench::{path, scene};

const SCENES: [&str; 3] = ["uniform:n=100000", "uniform:n=1000000", "city:n=1000000"];
const SHARES: [&str; 2] = ["0.1%", "2%"];
/// Frames of the same flight, and how many of its first ones are asked.
const PACES: [(&str, usize, bool); 3] = [
    ("slow", 8192, false),
    ("fast", 128, false),
    ("shuffled", 8192, true),
];
const ASKED: usize = 128;

/// The leaves that a query looks at: the last blocks that it reads.
#[derive(Default)]
struct Reads(Vec<usize>);

impl Recorder for Reads {
    fn block_read(&mut self, block: usize, _: impl FnOnce() -> u8) {
        self.0.push(block);
    }
}

/// Counts the leaves that are tested for nothing.
#[derive(Default)]
struct InVain(usize);

impl Sink for InVain {
    fn accept(&mut self, _: &[ItemId]) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
    fn accept_lanes<I: Isa>(
        &mut self,
        _: I,
        _: &[ItemId],
        _: usize,
        lanes: LaneMask,
    ) -> ControlFlow<()> {
        self.0 += usize::from(lanes == 0);
        ControlFlow::Continue(())
    }
}

/// What a flight's queries have in common with the frame before, and what they
/// do in vain.
struct Portrait {
    planes_per_box: f64,
    /// Share of the blocks that are leaves.
    leaves: f64,
    /// Share of the leaves that hold nothing visible.
    in_vain: f64,
    /// Share of the leaves that the frame before tested too.
    again: f64,
}

fn portrait(tree: &Wide, volumes: &[ConvexVolume], leaves: &[usize]) -> Portrait {
    let (mut again, mut all, mut blocks) = (0, 0, 0);
    let mut before: Vec<usize> = Vec::new();
    let (mut cost, mut in_vain) = (QueryCost::default(), InVain::default());
    for (volume, &leaves) in volumes.iter().zip(leaves) {
        let mut reads = Reads::default();
        let _ = FrustumQuery::visible(tree, volume, &mut in_vain, &mut reads);
        let _ = FrustumQuery::visible(tree, volume, &mut Vec::new(), &mut cost);
        blocks += reads.0.len();
        let mut now = reads.0.split_off(reads.0.len() - leaves);
        now.sort_unstable();
        let both = now.iter().filter(|b| before.binary_search(b).is_ok());
        again += both.count();
        all += now.len();
        before = now;
    }
    Portrait {
        planes_per_box: cost.planes_tested as f64 / cost.comparisons() as f64,
        leaves: all as f64 / blocks as f64,
        in_vain: in_vain.0 as f64 / all as f64,
        again: again as f64 / all as f64,
    }
}

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let only_test = words.iter().any(|word| word == "--test");
    let cold = words.iter().any(|word| word == "--cold");
    let protocol = Protocol {
        rounds: if only_test { [1, 1] } else { [9, 45] },
        task_ns: 1e9,
        cameras: if only_test { 8 } else { ASKED },
        cold,
        seed: 1,
        cache_bytes: Machine::capture().cache_sweep_bytes(),
    };
    println!(
        "| scene | visible | flight | us | whole / foreseen | A/A | planes a box | leaves of all blocks | leaves in vain | leaves tested before |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for source in SCENES {
        for share in SHARES {
            let source = if only_test {
                source.replace("000", "0")
            } else {
                source.to_owned()
            };
            let scene = scene::load(&source, &Default::default()).expect(&source);
            let build = || Wide::build(&scene.items, None, &Default::default());
            let copies = [(); 3].map(|()| build().expect("finite items"));
            for (pace, frames, shuffled) in PACES {
                let way = format!("flythrough:frames={frames},visible={share}");
                let mut cameras = path::load(&way, &scene, &Default::default())
                    .expect(&way)
                    .cameras;
                if shuffled {
                    // Fibonacci hashing: every camera is far from the last.
                    let mut order: Vec<u32> = (0..cameras.len() as u32).collect();
                    order.sort_by_key(|i| i.wrapping_mul(2_654_435_769));
                    cameras = order.iter().map(|&i| cameras[i as usize]).collect();
                }
                cameras.truncate(ASKED);
                let around = scene.surroundings();
                let volume = |c: &cullbench::camera::Camera| {
                    c.volume(&PlaneOptions::default(), &around)
                        .expect("within f32")
                };
                let volumes: Vec<ConvexVolume> = cameras.iter().map(volume).collect();
                let foreseen: Vec<Foreseen> = volumes
                    .iter()
                    .map(|volume| Foreseen::of(&copies[2], volume))
                    .collect();
                let mut expected = Vec::new();
                for (volume, foreseen) in volumes.iter().zip(&foreseen) {
                    let (mut one, mut other): (Vec<ItemId>, Vec<ItemId>) = Default::default();
                    DynIndex::visible(&copies[0], volume, &mut one);
                    foreseen.answer(&copies[2], volume, &mut other);
                    assert!(one == other, "foreseen otherwise");
                    expected.push(one.len() as u64);
                }
                let asks: [Ask; 3] = [
                    Box::new(|i, out| DynIndex::visible(&copies[0], &volumes[i], out)),
                    Box::new(|i, out| DynIndex::visible(&copies[1], &volumes[i], out)),
                    Box::new(|i, out| foreseen[i].answer(&copies[2], &volumes[i], out)),
                ];
                let competitors = asks.map(|ask| Competitor {
                    ask,
                    ask_many: None,
                    expected: expected.clone(),
                    least_ns: None,
                });
                let timed = timed_rounds(volumes.len(), &competitors, &protocol, &|| false);
                let timed: Vec<Timed> = timed
                    .expect("not stopped")
                    .into_iter()
                    .map(|timed| timed.expect("right ids"))
                    .collect();
                let ratio = |other: usize| timed[0].over(&timed[other]).expect("a round");
                let us = timed[0].ns().expect("a round") / 1e3;
                let (twin, gain) = (ratio(1), ratio(2));
                let leaves: Vec<usize> = foreseen.iter().map(Foreseen::leaves).collect();
                let seen = portrait(&copies[0], &volumes, &leaves);
                println!(
                    "| {source} | {share} | {pace} | {us:.1} | {:.3} | {:.3} | {:.2} | {:.2} | {:.2} | {:.2} |",
                    gain, twin, seen.planes_per_box, seen.leaves, seen.in_vain, seen.again
                );
            }
        }
    }
    ExitCode::SUCCESS
}
