//! The points of the diagram that keep their items in few bits: which codes, on
//! which grids, and what is answered from them.

use super::judged::{Judged, Shots, Truths};
use super::plane_test::PlaneTest;
use super::quantised::{CodeKind, GridScope, Quantised, Storage};
use crate::culling::{Culling, CullingTest};
use crate::index::{By, DynIndex, Input, RegionIndex};
use crate::kernel::Kernel;
use crate::scene::Scene;

/// Items in few bits: an index, or none if the scene does not fit.
pub(super) struct Stored {
    pub label: String,
    pub index: Option<Box<dyn DynIndex>>,
    pub judged: Vec<Judged>,
}

/// u8 and u16 codes, on one grid or on one for each block, and the two kinds of
/// half floats; with the default view and with the exact test.
pub(super) fn stored_points(
    kernel: Kernel,
    scene: &Scene,
    shots: &Shots,
    truths: Option<&Truths>,
) -> Vec<Stored> {
    let shared = Shared {
        kernel,
        scene,
        shots,
        truths,
    };
    let (world, block) = (GridScope::World, GridScope::Block);
    vec![
        shared.stored(CodeKind::U8, world, "bits=8,grid=world"),
        shared.stored(CodeKind::U8, block, "bits=8,grid=block"),
        shared.stored(CodeKind::U16, world, "bits=16,grid=world"),
        shared.stored(CodeKind::U16, block, "bits=16,grid=block"),
        shared.stored(CodeKind::F16, world, "bits=16,float=f16"),
        shared.stored(CodeKind::Bf16, world, "bits=16,float=bf16"),
    ]
}

#[derive(Clone, Copy)]
struct Shared<'a> {
    kernel: Kernel,
    scene: &'a Scene,
    shots: &'a Shots,
    truths: Option<&'a Truths>,
}

impl Shared<'_> {
    fn stored(self, kind: CodeKind, scope: GridScope, codes: &str) -> Stored {
        let Shared {
            kernel,
            scene,
            shots,
            truths,
        } = self;
        let tests = [CullingTest::SixPlane, CullingTest::Exact].map(|test| {
            PlaneTest::Culling(Culling {
                test,
                ..Culling::default()
            })
        });
        let label = format!("{}:{codes}", Quantised::INFO.name);
        match Quantised::build(&Input::new(&scene.items), &Storage { kind, scope }) {
            Ok(index) => {
                let items = index.decoded(scene.items.len());
                let judged = tests.map(|test| Judged::new(scene, &items, shots, truths, test));
                Stored {
                    label,
                    index: Some(Box::new(By { index, kernel })),
                    judged: judged.into(),
                }
            }
            Err(error) => Stored {
                label,
                index: None,
                judged: tests.map(|test| Judged::refused(test, &error)).into(),
            },
        }
    }
}
