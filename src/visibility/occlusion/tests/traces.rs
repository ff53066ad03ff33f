//! Traces of a view: doing it again leaves the same buffer.

use super::super::masked::MaskedInner;
use super::super::rect::Rect;
use super::super::{FrameTrace, Interleaved, OcclusionBuffer};
use super::by_rays::with_view;
use super::streets::{cameras, ready};
use crate::kernel::Kernel;
use crate::visibility::SampleGrid;

#[test]
fn a_view_done_again_leaves_the_same_buffer() {
    let ready = ready("city:n=3000");
    let grid = SampleGrid::new(96, 54);
    let tiles = |b: &MaskedInner| (0..b.tiles()).map(|at| b.tile(at)).collect::<Vec<_>>();
    for camera in cameras(&ready, 3) {
        with_view(&ready, &camera, grid, |view, _| {
            let trace = FrameTrace::of(&ready.occluders, view, Kernel::best());
            let mut culling = Interleaved::new(MaskedInner::new(grid), Kernel::best());
            let stats = culling.cull(&ready.occluders, view, &mut Vec::new());
            assert_eq!(stats, trace.stats);
            assert!(stats.drawn > 0, "{stats:?}");
            let mut again = MaskedInner::new(grid);
            trace.replay(&mut again);
            assert_eq!(tiles(&again), tiles(culling.buffer()));
            // Kept from being thrown away, and of what was there.
            assert_ne!(trace.read_tested(&ready.occluders, &again), 0);
            assert_ne!(trace.read_occluders(&ready.occluders), 0);
        });
    }
}

#[test]
fn a_rectangle_is_cut_into_the_tiles_that_it_meets() {
    let buffer = MaskedInner::new(SampleGrid::new(64, 36));
    let nearness = 0.5;
    let rect = Rect {
        x0: 7,
        x1: 17,
        y0: 3,
        y1: 4,
        nearness,
    };
    let parts = buffer.tiles_of(&rect);
    assert_eq!(
        parts.iter().map(|(at, _)| *at).collect::<Vec<_>>(),
        [0, 1, 2, 8, 9, 10]
    );
    let area = |r: &Rect| u32::from(r.x1 - r.x0 + 1) * u32::from(r.y1 - r.y0 + 1);
    let of_parts = parts.iter().map(|(_, part)| area(part));
    assert_eq!(of_parts.sum::<u32>(), area(&rect));
    assert_eq!(
        parts[4].1,
        Rect {
            x0: 8,
            x1: 15,
            y0: 4,
            y1: 4,
            nearness
        }
    );
}
