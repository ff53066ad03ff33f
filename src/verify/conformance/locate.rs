//! The properties of region search: one point, and many at once. What a camera
//! sees is the other properties' business.

use std::ops::ControlFlow;

use glam::Vec3;

use super::*;
use crate::query::{Located, ManySink};

/// `locate` returns exactly the boxes that hold the point, bounds closed.
pub fn region_search_is_the_closed_box_scan<T: FrustumQuery>() -> Result<(), String> {
    for (name, items) in edge_scenes() {
        let index: T = build(name, &items)?;
        Questions::on_edge(name, &items).locate_is_right(&index, &items)?;
    }
    for seed in SEEDS {
        let case = RandomCase::new(seed);
        let questions = Questions::of_case(seed, &case);
        let index: T = build(&questions.scene, &case.items)?;
        questions.locate_is_right(&index, &case.items)?;
    }
    for (questions, items) in generated_scenes(500)? {
        let index: T = build(&questions.scene, &items)?;
        questions.locate_is_right(&index, &items)?;
    }
    Ok(())
}

/// `locate_many` hands over, for every point in order, what `locate` does:
/// whatever the size of the batch, with points that come again, lie on faces or
/// outside, or are no numbers; and stops where its sink does.
pub fn many_points_are_answered_as_one_by_one<T: FrustumQuery>() -> Result<(), String> {
    let mut scenes = generated_scenes(500)?;
    for (name, items) in edge_scenes() {
        scenes.push((Questions::on_edge(name, &items), items));
    }
    for seed in SEEDS {
        let case = RandomCase::new(seed);
        scenes.push((Questions::of_case(seed, &case), case.items));
    }
    scenes.push(cells());
    for (questions, items) in scenes {
        let index: T = build(&questions.scene, &items)?;
        let mut points = questions.points.clone();
        let strange = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX];
        for value in strange {
            points.push(Vec3::splat(value));
            points.extend(questions.points.iter().take(4).map(|p| p.with_y(value)));
        }
        // Neighbours in a batch, and far apart.
        points.extend_from_within(points.len() / 2..);
        let mut reference = Reference::new(items.len());
        for count in [0, 1, 3, points.len()] {
            let points = &points[..count.min(points.len())];
            let mut many = Located::default();
            let flow = index.locate_many(points, &mut many);
            ensure(many.len() == points.len() && flow.is_continue(), || {
                let answered = many.len();
                format!(
                    "{} on '{}': {answered} of {} points answered, {flow:?}",
                    T::INFO.name,
                    questions.scene,
                    points.len()
                )
            })?;
            for (&p, found) in points.iter().zip(many.iter()) {
                let holding = items.iter().zip(0..).filter(|(b, _)| b.contains_point(p));
                reference.expect(holding.map(|(_, id)| id));
                let difference = reference.compare(found);
                let right = difference.is_none() && found == located(&index, p);
                ensure(right, || {
                    format!(
                        "{} on '{}', {p} among {} points: {difference}; {found:?}, alone {:?}",
                        T::INFO.name,
                        questions.scene,
                        points.len(),
                        located(&index, p)
                    )
                })?;
            }
        }
        if points.len() > 1 {
            let mut sink = StopsAfter {
                points: points.len() as u32 / 2,
                next: 0,
            };
            let flow = index.locate_many(&points, &mut sink);
            ensure(flow.is_break() && sink.next == sink.points, || {
                format!(
                    "{} on '{}': stopped after {} points, got {} and {flow:?}",
                    T::INFO.name,
                    questions.scene,
                    sink.points,
                    sink.next
                )
            })?;
        }
    }
    Ok(())
}

/// Breaks when it has its points.
struct StopsAfter {
    points: u32,
    next: u32,
}

impl ManySink for StopsAfter {
    fn accept(&mut self, _: u32, _: &[ItemId]) -> ControlFlow<()> {
        self.next += 1;
        match self.next < self.points {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(()),
        }
    }
}

/// Cells that tile a block, with points within, on faces, edges and corners,
/// and beside the block.
fn cells() -> (Questions, Vec<Aabb>) {
    const SIDE: u16 = 11;
    let grid = |i: u16| {
        Vec3::new(
            f32::from(i % SIDE),
            f32::from(i / SIDE % SIDE),
            f32::from(i / SIDE / SIDE),
        )
    };
    let items = (0..SIDE * SIDE * SIDE).map(|i| Aabb::new(grid(i), grid(i) + 1.0));
    // Halves: every other coordinate is a face.
    let points = (0..2 * SIDE * SIDE).map(|i| {
        let step = i.wrapping_mul(31);
        Vec3::new(
            f32::from(i % 23),
            f32::from(step % 23),
            f32::from(step / 23 % 25),
        ) * 0.5
    });
    let questions = Questions {
        scene: "cells".to_owned(),
        volumes: vec![],
        points: points.collect(),
    };
    (questions, items.collect())
}
