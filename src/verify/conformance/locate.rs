//! The properties of region search: one point, and many at once. Frustum
//! queries have properties of their own.

use std::ops::ControlFlow;

use glam::Vec3;

use super::*;
use crate::kernel::BASELINE;
use crate::query::{Located, ManySink};

/// A point is answered with exactly the boxes that hold the point, bounds closed.
pub fn region_search_is_the_closed_box_scan<T: RegionIndex>() -> Outcome {
    let scenes = edges().chain(cases(SEEDS)).chain(generated_scenes(500)?);
    each(scenes, |asked, index: &mut T| asked.locate_is_right(index))
}

/// `query_many` passes the ids of `query` for every point in order:
/// whatever the size of the batch, with points that come again, lie on faces or
/// outside, or are no numbers; and stops where its sink does.
pub fn many_points_are_answered_as_one_by_one<T: RegionIndex>() -> Outcome {
    let scenes = edges().chain(cases(SEEDS)).chain([cells()]);
    let scenes = scenes.chain(generated_scenes(500)?);
    each(scenes, |asked, index: &mut T| {
        let mut points = asked.points.clone();
        let strange = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX];
        for value in strange {
            points.push(Vec3::splat(value));
            points.extend(asked.points.iter().take(4).map(|p| p.with_y(value)));
        }
        // Neighbours in a batch, and far apart.
        points.extend_from_within(points.len() / 2..);
        let mut trial = Trial::new(asked.items.len());
        for count in [0, 1, 3, points.len()] {
            let points = &points[..count.min(points.len())];
            let (mut many, count) = (Located::default(), points.len());
            let flow = index.query_many(BASELINE, points, &mut many);
            ensure(many.len() == count && flow.is_continue(), || {
                format!("{} of {count} points answered, {flow:?}", many.len())
            })?;
            for (&p, found) in points.iter().zip(many.iter()) {
                trial.expect(scan(&asked.items, |b| b.contains_point(p)));
                let alone = seen(index, &p);
                let answer = trial.ask(|ids| ids.extend_from_slice(found));
                let fault = answer.err().map(|fault| fault.explained(|_| None));
                ensure(fault.is_none() && found == alone, || {
                    format!("{p} among {count} points: {fault:?}; {found:?}, alone {alone:?}")
                })?;
            }
        }
        if points.len() > 1 {
            let most = points.len() as u32 / 2;
            let mut sink = StopsAfter { most, got: 0 };
            let flow = index.query_many(BASELINE, &points, &mut sink);
            ensure(flow.is_break() && sink.got == most, || {
                format!("stopped after {most} points, got {} and {flow:?}", sink.got)
            })?;
        }
        Ok(())
    })
}

/// Breaks when it has its points.
struct StopsAfter {
    most: u32,
    got: u32,
}

impl ManySink for StopsAfter {
    fn accept(&mut self, _: u32, _: &[ItemId]) -> ControlFlow<()> {
        self.got += 1;
        match self.got < self.most {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(()),
        }
    }
}

/// Cells that tile a block, with points within, on faces, edges and corners,
/// and beside the block.
fn cells() -> Questions {
    const SIDE: u16 = 11;
    let at = |x: u16, y: u16, z: u16| Vec3::from([x, y, z].map(f32::from));
    let grid = |i: u16| at(i % SIDE, i / SIDE % SIDE, i / SIDE / SIDE);
    let items = (0..SIDE * SIDE * SIDE).map(|i| Aabb::new(grid(i), grid(i) + 1.0));
    // Halves: every other coordinate is a face.
    let points = (0..2 * SIDE * SIDE).map(|i| {
        let step = i.wrapping_mul(31);
        at(i % 23, step % 23, step / 23 % 25) * 0.5
    });
    Questions {
        scene: "cells".to_owned(),
        items: items.collect(),
        volumes: vec![],
        points: points.collect(),
    }
}
