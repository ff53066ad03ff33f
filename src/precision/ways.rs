//! The ways to answer that become points: every structure with every culling, items
//! in few bits, a plain loop in all numbers, and region search. What they answer and
//! how long it takes is put together in `points`.

use super::judged::{Judged, Shots, Truths};
use super::plane_test::{PlaneTest, Scan};
use super::region_search::{RegionNumbers, RegionQueries};
use super::stored::{Stored, stored_points};
use crate::camera::{PLANE_METHODS, PlaneMethod, PlaneOptions};
use crate::culling::{ARITHMETICS, Arithmetic, Culling, CullingTest, TESTS};
use crate::index::{BuildError, DynIndex, MemoryUsage, StructureSpec};
use crate::kernel::Kernel;
use crate::measure::{TimedTask, input_of};
use crate::query::ItemId;
use crate::scene::Scene;

/// Every test with every arithmetic, with and without epsilon; every
/// derivation of the planes for the six-plane test.
fn cullings() -> Vec<Culling> {
    let with = |epsilon: f64, method: PlaneMethod| PlaneOptions { method, epsilon };
    let standard = PlaneOptions::default();
    let mut all = Vec::new();
    for (test, ..) in TESTS {
        for (arithmetic, ..) in ARITHMETICS {
            let epsilons: &[f64] = match arithmetic {
                Arithmetic::F64 => &[0.0],
                _ => &[0.0, standard.epsilon],
            };
            for &epsilon in epsilons {
                let planes = with(epsilon, standard.method);
                all.push(Culling {
                    test,
                    arithmetic,
                    planes,
                });
            }
        }
    }
    for (method, ..) in PLANE_METHODS {
        if method != standard.method {
            all.push(Culling {
                planes: with(0.0, method),
                ..Culling::default()
            });
        }
    }
    all.retain(|culling| culling.check().is_ok());
    all
}

/// A structure over the boxes, over the cubes of the sphere test, and over the
/// regions where those are other boxes.
struct Indexes {
    boxes: Box<dyn DynIndex>,
    cubes: Box<dyn DynIndex>,
    regions: Option<Box<dyn DynIndex>>,
}

impl Indexes {
    fn new(spec: &StructureSpec, scene: &Scene) -> Result<Indexes, BuildError> {
        let over = |test: CullingTest| {
            let items = test.items(&scene.items);
            spec.build(input_of(scene, &items))
        };
        let regions = scene.regions.boxes(&scene.items);
        let others = !std::ptr::eq(regions, &scene.items[..]);
        let others = others.then(|| spec.build(input_of(scene, regions)));
        Ok(Indexes {
            boxes: over(CullingTest::SixPlane)?,
            cubes: over(CullingTest::Sphere)?,
            regions: others.transpose()?,
        })
    }

    fn of(&self, test: CullingTest) -> &dyn DynIndex {
        match test {
            CullingTest::Sphere => self.cubes.as_ref(),
            _ => self.boxes.as_ref(),
        }
    }

    fn regions(&self) -> &dyn DynIndex {
        self.regions.as_deref().unwrap_or(self.boxes.as_ref())
    }
}

/// Everything that points are made of, the same in every process.
pub(super) struct Built<'a> {
    pub scene: &'a Scene,
    judged: Vec<Judged>,
    structures: Vec<(&'a str, Indexes)>,
    stored: Vec<Stored>,
    /// The plain loop, asked in all numbers there are.
    scan: Scan,
    scanned: Vec<Judged>,
    kernel: Kernel,
    pub queries: RegionQueries,
}

/// What answers.
#[derive(Clone, Copy)]
pub(super) enum Asked<'b> {
    Index(&'b dyn DynIndex),
    Scan(&'b Scan, Kernel),
    Nothing,
}

impl Asked<'_> {
    pub fn see(self, judged: &Judged, n: usize, out: &mut Vec<ItemId>) {
        match (self, judged.views[n].as_any()) {
            (Asked::Index(index), Some(view)) => index.query(view, out),
            (Asked::Scan(scan, kernel), _) => scan.see(kernel, &judged.views[n], out),
            _ => {}
        }
    }
}

/// One way to answer: a structure with a culling.
pub(super) struct Way<'b> {
    pub structure: &'b str,
    pub asked: Asked<'b>,
    pub memory: Option<MemoryUsage>,
    pub judged: &'b Judged,
}

/// One way to search for a region: a structure, or a loop over all regions.
pub(super) struct RegionWay<'b> {
    pub structure: &'b str,
    pub index: Option<&'b dyn DynIndex>,
    pub numbers: RegionNumbers,
}

/// What is asked without an index.
const SCAN: &str = "scan";

/// The toolkit's own f32 and f64, and all others, for the same loop.
fn scanned() -> Vec<PlaneTest> {
    let own = [Arithmetic::F32, Arithmetic::F64].map(|arithmetic| Culling {
        arithmetic,
        planes: PlaneOptions {
            epsilon: match arithmetic {
                Arithmetic::F32 => PlaneOptions::default().epsilon,
                _ => 0.0,
            },
            ..PlaneOptions::default()
        },
        ..Culling::default()
    });
    let own = own.into_iter().map(PlaneTest::Culling);
    own.chain(PlaneTest::others()).collect()
}

impl<'a> Built<'a> {
    pub fn new(
        scene: &'a Scene,
        structures: &'a [StructureSpec],
        shots: &Shots,
        truths: Option<&Truths>,
    ) -> Result<Built<'a>, BuildError> {
        let judge = |test: PlaneTest| {
            let items = test.test().items(&scene.items);
            Judged::new(scene, &items, shots, truths, test)
        };
        let kernel = structures.first().map(|spec| spec.execution);
        let kernel = kernel.unwrap_or_default().kernel;
        let indexed = structures
            .iter()
            .map(|spec| Ok((spec.label.as_str(), Indexes::new(spec, scene)?)));
        Ok(Built {
            scene,
            judged: cullings()
                .into_iter()
                .map(PlaneTest::Culling)
                .map(judge)
                .collect(),
            structures: indexed.collect::<Result<_, BuildError>>()?,
            stored: stored_points(kernel, scene, shots, truths),
            scan: Scan::new(&scene.items),
            scanned: scanned().into_iter().map(judge).collect(),
            kernel,
            queries: RegionQueries::new(scene, shots),
        })
    }

    /// All points in their order.
    pub fn ways(&self) -> Vec<Way<'_>> {
        let mut ways = Vec::new();
        for (structure, indexes) in &self.structures {
            ways.extend(self.judged.iter().map(|judged| {
                let index = indexes.of(judged.test.test());
                Way {
                    structure,
                    asked: Asked::Index(index),
                    memory: Some(index.memory()),
                    judged,
                }
            }));
        }
        for stored in &self.stored {
            ways.extend(stored.judged.iter().map(|judged| Way {
                structure: &stored.label,
                asked: stored.index.as_deref().map_or(Asked::Nothing, Asked::Index),
                memory: stored.index.as_deref().map(DynIndex::memory),
                judged,
            }));
        }
        ways.extend(self.scanned.iter().map(|judged| Way {
            structure: SCAN,
            asked: Asked::Scan(&self.scan, self.kernel),
            memory: Some(self.scan.memory()),
            judged,
        }));
        ways
    }

    /// All ways to search for a region: f32 by every structure, the others by a
    /// loop over all regions.
    pub fn region_ways(&self) -> Vec<RegionWay<'_>> {
        let mut ways = Vec::new();
        for (structure, indexes) in &self.structures {
            ways.extend(
                [RegionNumbers::F32, RegionNumbers::Checked].map(|numbers| RegionWay {
                    structure,
                    index: Some(indexes.regions()),
                    numbers,
                }),
            );
        }
        ways.extend(
            [RegionNumbers::F64, RegionNumbers::Exact].map(|numbers| RegionWay {
                structure: SCAN,
                index: None,
                numbers,
            }),
        );
        ways
    }

    pub fn region_task<'b>(&'b self, way: &RegionWay<'b>, expected: Vec<u64>) -> TimedTask<'b> {
        let (index, numbers) = (way.index, way.numbers);
        TimedTask::new(expected, move |n, out| {
            self.queries.ask(self.scene, numbers, index, n, out);
        })
    }
}

impl<'b> Way<'b> {
    pub fn task(&self, expected: Vec<u64>) -> TimedTask<'b> {
        let (asked, judged) = (self.asked, self.judged);
        TimedTask::new(expected, move |n, out| asked.see(judged, n, out))
    }
}
