//! Several views asked for together against one after the other, on the wide
//! tree: separate queries, their twin (an A/A control), and `see_many`, each
//! over its own copy, interleaved and paired by the harness of `cullbench run`.
//! Lists are compared before anything is timed. A word on the command line
//! keeps only the rows that hold it; `-- --test` only checks that they run.

use std::cell::RefCell;
use std::process::ExitCode;

use cullbench::camera::{PlaneOptions, ViewSet};
use cullbench::geometry::ConvexVolume;
use cullbench::index::{DynIndex, RegionIndex, Wide};
use cullbench::measure::{Ask, Competitor, Machine, Protocol, Timed, timed_rounds};
use cullbench::query::{AnyView, ItemId};
use cullbench::{path, scene};

const SCENES: [&str; 4] = [
    "uniform:n=100000",
    "city:n=100000",
    "uniform:n=1000000",
    "city:n=1000000",
];

const SHARES: [&str; 3] = ["0.1%", "2%", "9%"];

fn sets(near: f64) -> [(&'static str, ViewSet); 5] {
    [
        ("1 camera", ViewSet::Single),
        ("2 eyes", ViewSet::Stereo { distance: near }),
        ("4 cascades", ViewSet::Cascades { count: 4 }),
        ("6 faces", ViewSet::Cube),
        ("11 of a frame", ViewSet::Frame),
    ]
}

/// One way to ask: all views of a place, each into a list of its own.
type Way = fn(&Wide, &[AnyView<'_>], &mut [Vec<ItemId>]);

fn separately(index: &Wide, views: &[AnyView<'_>], out: &mut [Vec<ItemId>]) {
    for (view, out) in views.iter().zip(out) {
        DynIndex::see(index, *view, out);
    }
}

fn together(index: &Wide, views: &[AnyView<'_>], out: &mut [Vec<ItemId>]) {
    index.see_many(views, out);
}

/// What is asked at every place of a path, and the length of every answer.
struct Questions {
    volumes: Vec<Vec<ConvexVolume>>,
    lengths: Vec<Vec<usize>>,
}

impl Questions {
    /// Asks both ways once; the lists must be the same, in the same order.
    fn new(volumes: Vec<Vec<ConvexVolume>>, index: &Wide) -> Questions {
        let mut lengths = Vec::new();
        for volumes in &volumes {
            let views: Vec<AnyView> = volumes.iter().map(AnyView::from).collect();
            let (mut one, mut other) = (vec![Vec::new(); views.len()], vec![vec![]; views.len()]);
            separately(index, &views, &mut one);
            together(index, &views, &mut other);
            lengths.push(one.iter().map(Vec::len).collect());
            one.iter_mut()
                .chain(&mut other)
                .for_each(|ids| ids.sort_unstable());
            assert!(one == other, "one pass gives other sets");
        }
        Questions { volumes, lengths }
    }

    /// The number of "ids" of a sample is the number of lists that are as long
    /// as they should be.
    fn competitor<'a>(&'a self, index: &'a Wide, way: Way) -> Competitor<'a> {
        let most = self.volumes.iter().map(Vec::len).max().unwrap_or(0);
        let lists = RefCell::new(vec![Vec::new(); most]);
        let views: Vec<Vec<AnyView>> = self
            .volumes
            .iter()
            .map(|volumes| volumes.iter().map(AnyView::from).collect())
            .collect();
        let ask: Ask = Box::new(move |place, out| {
            let views = &views[place];
            let lists = &mut lists.borrow_mut()[..views.len()];
            lists.iter_mut().for_each(Vec::clear);
            way(index, views, lists);
            let right = lists.iter().zip(&self.lengths[place]);
            let right = right.filter(|(list, length)| list.len() == **length);
            out.extend(right.map(|(list, _)| list.len() as ItemId));
        });
        Competitor {
            ask,
            ask_many: None,
            expected: self.lengths.iter().map(|l| l.len() as u64).collect(),
            least_ns: None,
        }
    }
}

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let only_test = words.iter().any(|word| word == "--test");
    let cold = words.iter().any(|word| word == "--cold");
    let wanted: Vec<&String> = words.iter().filter(|w| !w.starts_with('-')).collect();
    let protocol = Protocol {
        rounds: if only_test { [1, 1] } else { [9, 45] },
        task_ns: 1e9,
        cameras: if only_test { 8 } else { 64 },
        cold,
        seed: 1,
        cache_bytes: Machine::capture().cache_sweep_bytes(),
    };
    println!("| scene | visible | views | us apart | apart / one pass | A/A |");
    println!("|---|---|---|---|---|---|");
    for source in SCENES {
        for share in SHARES {
            let row = format!("{source} {share}");
            if !wanted.iter().all(|word| row.contains(word.as_str())) {
                continue;
            }
            let source = if only_test {
                source.replace("000", "0")
            } else {
                source.to_owned()
            };
            let scene = scene::load(&source, &Default::default()).expect(&source);
            let way = format!("flythrough:frames=64,visible={share}");
            let cameras = path::load(&way, &scene, &Default::default()).expect(&way);
            let build = || Wide::build(&scene.items, None, &Default::default());
            let copies = [(); 3].map(|()| build().expect("finite items"));
            let near = cameras.cameras[0].lens.near();
            for (name, set) in sets(near) {
                let around = scene.surroundings();
                let volumes = cameras.cameras.iter().map(|camera| {
                    let views = set.cameras(camera).expect("a finite camera");
                    let volume = |c: &cullbench::camera::Camera| {
                        c.volume(&PlaneOptions::default(), &around)
                            .expect("within f32")
                    };
                    views.iter().map(volume).collect()
                });
                let questions = Questions::new(volumes.collect(), &copies[0]);
                let ways: [Way; 3] = [separately, separately, together];
                let competitors: Vec<Competitor> = copies
                    .iter()
                    .zip(ways)
                    .map(|(index, way)| questions.competitor(index, way))
                    .collect();
                let timed = timed_rounds(cameras.cameras.len(), &competitors, &protocol, &|| false);
                let timed: Vec<Timed> = timed
                    .expect("not stopped")
                    .into_iter()
                    .map(|timed| timed.expect("right lists"))
                    .collect();
                let ratio = |other: usize| timed[0].over(&timed[other]).expect("a round");
                let us = timed[0].ns().expect("a round") / 1e3;
                let (twin, shared) = (ratio(1), ratio(2));
                println!(
                    "| {source} | {share} | {name} | {us:.1} | {:.3} | {:.3} |",
                    shared, twin
                );
            }
        }
    }
    ExitCode::SUCCESS
}
