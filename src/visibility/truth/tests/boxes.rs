//! The truth of boxes, checked by arithmetic on integers.

use super::judge;
use crate::query::ItemId;
use crate::scene::SeededRng;
use crate::visibility::truth::visible_by_random_rays;
use crate::visibility::truth::{NO_ITEM, RayIndex, SampleTruth, SolidBox, fronts};
use crate::visibility::{Rays, SampleGrid, Solids};

#[test]
fn worlds_full_of_ties_are_seen_as_whole_numbers_see_them() {
    let mut rng = SeededRng::new(5);
    let (mut met, mut tied) = (0, 0);
    for world in 0..300 {
        let count = 1 + rng.below(12);
        let boxes = judge::ties(&mut rng, count);
        let solids = judge::solids(&boxes);
        let index = RayIndex::build(&solids);
        let camera = judge::camera(&mut rng);
        let rays = Rays::of(&camera).unwrap();
        let grid = SampleGrid::new(8, 6);
        let truth = SampleTruth::of(&index, &rays, grid, 1);
        let mut samples = vec![0; boxes.len()];
        let fronts = fronts(&index, &|_, _, _| true, &rays, grid);
        for (sample, front) in fronts.into_iter().enumerate() {
            let ray = rays.sample(grid, sample as u32 % 8, sample as u32 / 8);
            let wanted = judge::front(&ray, &boxes);
            let of_ray = index.front_of(&ray).front;
            assert_eq!(of_ray, wanted, "world {world}, {ray:?}, {boxes:?}");
            assert_eq!(front, wanted.first().copied().unwrap_or(NO_ITEM));
            wanted.iter().for_each(|&item| samples[item as usize] += 1);
            met += usize::from(!wanted.is_empty());
            tied += usize::from(wanted.len() > 1);
        }
        for (item, &wanted) in samples.iter().enumerate() {
            let index = truth.visible.binary_search(&(item as ItemId));
            assert_eq!(index.map_or(0, |index| truth.samples_of[index]), wanted);
            assert_eq!(truth.visible.contains(&(item as ItemId)), wanted > 0);
        }
    }
    assert!(
        met > 2000 && tied > 200,
        "the premise: {met} met, {tied} tied"
    );
}

#[test]
fn everything_along_a_ray_is_what_whole_numbers_find() {
    let mut rng = SeededRng::new(6);
    for _ in 0..200 {
        let boxes = judge::ties(&mut rng, 20);
        let index = RayIndex::build(&judge::solids(&boxes));
        let rays = Rays::of(&judge::camera(&mut rng)).unwrap();
        let ray = rays.sample(
            SampleGrid::new(4, 4),
            rng.below(4) as u32,
            rng.below(4) as u32,
        );
        let mut found: Vec<ItemId> = index.all_hits(&ray).iter().map(|f| f.0).collect();
        found.sort_unstable();
        let wanted = (0..20).filter(|&item| judge::entry(&ray, &boxes[item as usize]).is_some());
        assert_eq!(found, wanted.collect::<Vec<_>>());
    }
}

#[test]
fn the_same_on_any_number_of_threads_and_of_a_scene_far_from_zero() {
    let mut rng = SeededRng::new(8);
    let far_off = glam::DVec3::new(1e7, -3e6, 0.5);
    let near_zero: Vec<_> = (0..500)
        .map(|_| {
            let at = (rng.point() * 1024.0).round() / 16.0;
            crate::scene::WorldBox::new(at, at + (rng.point() * 64.0).round() / 16.0)
        })
        .collect();
    let moved = near_zero
        .iter()
        .map(|b| crate::scene::WorldBox::new(b.min + far_off, b.max + far_off));
    let moved: Vec<_> = moved.collect();
    let scene = |boxes: &[_]| Solids::of(&crate::scene::Scene::from_boxes("t", boxes).unwrap());
    let frame = crate::camera::look_at(
        glam::DVec3::splat(-8.0),
        glam::DVec3::splat(30.0),
        glam::DVec3::Z,
    )
    .unwrap();
    let lens = crate::camera::Lens::perspective(60.0, 1.5, 0.5, None).unwrap();
    let grid = SampleGrid::new(45, 31);
    let mut answers = Vec::new();
    for (boxes, by) in [(&near_zero, glam::DVec3::ZERO), (&moved, far_off)] {
        let solids = scene(boxes);
        let index = RayIndex::build(&solids);
        let frame = frame.relative_to(-by);
        let rays = Rays::of(&crate::camera::Camera { frame, lens }).unwrap();
        for threads in [1, 2, 5] {
            answers.push(SampleTruth::of(&index, &rays, grid, threads));
        }
        let seen = [1, 3].map(|threads| visible_by_random_rays(&index, &rays, 9000, 1, threads));
        assert_eq!(seen[0], seen[1]);
        let truth = &answers[0];
        assert!(
            truth
                .visible
                .iter()
                .filter(|&item| seen[0].contains(item))
                .count()
                > truth.visible.len() / 2
        );
    }
    assert!(answers[0].visible.len() > 50);
    assert!(answers.iter().all(|answer| *answer == answers[0]));
}

/// Every item of a tie counts, wherever in the image it is.
#[test]
fn more_items_in_front_than_allowed_end_the_search() {
    let frame = crate::camera::look_at(glam::DVec3::ZERO, glam::DVec3::X, glam::DVec3::Z).unwrap();
    let lens = crate::camera::Lens::perspective(90.0, 1.0, 1.0, None).unwrap();
    let rays = Rays::of(&crate::camera::Camera { frame, lens }).unwrap();
    let (grid, at) = (SampleGrid::new(90, 90), glam::DVec3::new(3.0, 0.5, 0.0));
    let one = crate::scene::WorldBox::around(at, glam::DVec3::new(0.1, 0.1, 9.0));
    let index = RayIndex::build(&judge::solids(&[one; 100]));
    for threads in [1, 3] {
        let opaque = |_: &SolidBox, _: &_, _: &_| true;
        let seen = |most| SampleTruth::of_opaque(&index, &opaque, &rays, grid, threads, most);
        let all = seen(u64::MAX).expect("no limit");
        let count: u64 = all.samples_of.iter().map(|n| u64::from(*n)).sum();
        assert_eq!(count, 9000, "a column of samples");
        assert_eq!(seen(count), Some(all));
        assert_eq!([0, 5000, count - 1].map(seen), [None, None, None]);
    }
}

#[test]
fn a_scene_of_nothing_and_of_one() {
    let frame = crate::camera::look_at(glam::DVec3::ZERO, glam::DVec3::X, glam::DVec3::Z).unwrap();
    let lens = crate::camera::Lens::perspective(90.0, 1.0, 1.0, None).unwrap();
    let rays = Rays::of(&crate::camera::Camera { frame, lens }).unwrap();
    let grid = SampleGrid::new(3, 3);
    let of = |boxes: &[crate::scene::WorldBox]| {
        let solids = judge::solids(boxes);
        SampleTruth::of(&RayIndex::build(&solids), &rays, grid, 2)
    };
    assert!(of(&[]).visible.is_empty());
    let at = |x: f64| crate::scene::WorldBox::around(glam::DVec3::X * x, glam::DVec3::splat(1.0));
    assert_eq!(of(&[at(3.0)]).samples_of, [1]);
    let begins_at_near = RayIndex::build(&judge::solids(&[at(1.5)]));
    assert_eq!(fronts(&begins_at_near, &|_, _, _| true, &rays, grid)[4], 0);
    assert!(
        of(&[at(1.25)]).visible.is_empty(),
        "entered before the near plane"
    );
    assert!(of(&[at(0.0)]).visible.is_empty(), "the eye is in it");
}
