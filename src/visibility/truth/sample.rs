//! Exact sample truth: the front item of each ray of an image, here of a box scene.
//! Triangles are in `surface_sample`.

use crate::query::ItemId;
use crate::scene::{SeededRng, WorldBox};
use crate::threads;
use crate::visibility::{Ray, Rays, SampleGrid, Solids};

use super::entry::{Crossing, Probe};
use super::ray_index::{RayIndex, Search};

/// In place of an item where a ray meets nothing.
pub const NO_ITEM: ItemId = ItemId::MAX;

/// Rows of samples that a thread takes at a time.
const BAND: usize = 4;

/// What the rays of a sample grid see: exact for these rays.
///
/// The same on any number of threads.
#[derive(Clone, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub struct SampleTruth {
    /// Columns and rows.
    pub grid: SampleGrid,
    /// The front item of each sample, row by row from the top left; the lowest of a
    /// tie, [`NO_ITEM`] where there is none.
    pub front: Vec<ItemId>,
    /// The items that are in front along any ray, ascending; all of a tie are.
    pub visible: Vec<ItemId>,
    /// Along how many rays, for each of `visible`: a tie counts for each.
    pub samples_of: Vec<u32>,
}

impl SampleTruth {
    /// Follows every ray of the grid. O(samples * log n) in common scenes.
    pub fn of(
        solids: &Solids,
        index: &RayIndex,
        rays: &Rays,
        grid: SampleGrid,
        threads: usize,
    ) -> SampleTruth {
        debug_assert_eq!(solids.boxes.len(), index.len(), "an index of these solids");
        SampleTruth::of_opaque(index, &|_, _, _, _| true, rays, grid, threads)
    }

    /// The same where items have holes: what is seen is the first item that is opaque
    /// where the ray enters it, and those that tie with it.
    pub fn of_opaque(
        index: &RayIndex,
        is_opaque: &(impl Fn(ItemId, &WorldBox, &Probe, &Crossing) -> bool + Sync),
        rays: &Rays,
        grid: SampleGrid,
        threads: usize,
    ) -> SampleTruth {
        let see = |search: &mut Search, ray: &Ray, others: &mut Vec<ItemId>| {
            search.front_of(index, ray, is_opaque);
            let (first, ties) = search.items.split_first()?;
            others.extend_from_slice(ties);
            Some(*first)
        };
        SampleTruth::by(see, index.len(), rays, grid, threads)
    }

    /// Follows every ray of the grid by `see`, which gives the front item of a ray
    /// and appends what else of `items` items is visible along it.
    pub(super) fn by<M: Default>(
        see: impl Fn(&mut M, &Ray, &mut Vec<ItemId>) -> Option<ItemId> + Sync,
        items: usize,
        rays: &Rays,
        grid: SampleGrid,
        threads: usize,
    ) -> SampleTruth {
        let width = grid.width as usize;
        let mut front = vec![NO_ITEM; grid.samples()];
        // Of each band, every visible item but those in `front`.
        let mut others = vec![Vec::new(); (grid.height as usize).div_ceil(BAND)];
        let rows = front.chunks_mut((width * BAND).max(1)).zip(&mut others);
        threads::share(threads, rows.enumerate(), |(band, (front, others))| {
            let mut memory = M::default();
            for (place, sample) in front.iter_mut().enumerate() {
                let (column, row) = (place % width, band * BAND + place / width);
                let ray = rays.sample(grid, column as u32, row as u32);
                *sample = see(&mut memory, &ray, others).unwrap_or(NO_ITEM);
            }
        });
        let (visible, samples_of) = counted(&front, others.into_iter().flatten(), items);
        SampleTruth {
            grid,
            front,
            visible,
            samples_of,
        }
    }
}

/// The items that occur, ascending, and how often.
fn counted(
    front: &[ItemId],
    ties: impl Iterator<Item = ItemId>,
    items: usize,
) -> (Vec<ItemId>, Vec<u32>) {
    let mut samples = vec![0u32; items];
    let seen = front.iter().copied().filter(|&item| item != NO_ITEM);
    seen.chain(ties)
        .for_each(|item| samples[item as usize] += 1);
    let occurring = samples.iter().enumerate().filter(|(_, count)| **count > 0);
    occurring
        .map(|(item, &count)| (item as ItemId, count))
        .unzip()
}

/// The items in front of any of `count` seeded random rays through the window,
/// ascending: what a back end that promises all visible items must have delivered.
/// The same on any number of threads.
pub fn visible_by_random_rays(
    index: &RayIndex,
    rays: &Rays,
    count: usize,
    seed: u64,
    threads: usize,
) -> Vec<ItemId> {
    let see = |search: &mut Search, ray: &Ray, seen: &mut Vec<ItemId>| {
        search.front(index, ray);
        seen.extend_from_slice(&search.items);
    };
    seen_at_random(see, rays, count, seed, threads)
}

/// The items that `see` appends for any of so many random rays, ascending.
pub(super) fn seen_at_random<M: Default>(
    see: impl Fn(&mut M, &Ray, &mut Vec<ItemId>) + Sync,
    rays: &Rays,
    count: usize,
    seed: u64,
    threads: usize,
) -> Vec<ItemId> {
    const CHUNK: usize = 4096;
    let mut found = vec![Vec::new(); count.div_ceil(CHUNK)];
    threads::share(threads, found.iter_mut().enumerate(), |(chunk, found)| {
        // A stream of its own for each chunk, on whichever thread.
        let mut rng = SeededRng::new(seed.wrapping_add((chunk as u64) << 32));
        let mut memory = M::default();
        for _ in 0..CHUNK.min(count - chunk * CHUNK) {
            let (x, y) = (rng.unit(), rng.unit());
            see(&mut memory, &rays.through(x, y), found);
        }
        found.sort_unstable();
        found.dedup();
    });
    let mut all = found.concat();
    all.sort_unstable();
    all.dedup();
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::visibility::truth::judge;

    #[test]
    fn worlds_full_of_ties_are_seen_as_whole_numbers_see_them() {
        let mut rng = SeededRng::new(5);
        let (mut met, mut tied) = (0, 0);
        for world in 0..250 {
            let count = 1 + rng.below(12);
            let boxes = judge::ties(&mut rng, count);
            let solids = judge::solids(&boxes);
            let index = RayIndex::build(&solids);
            let camera = judge::camera(&mut rng);
            let rays = Rays::of(&camera).unwrap();
            let grid = SampleGrid::new(8, 6);
            let truth = SampleTruth::of(&solids, &index, &rays, grid, 1);
            let mut samples = vec![0; boxes.len()];
            for (place, &front) in truth.front.iter().enumerate() {
                let ray = rays.sample(grid, place as u32 % 8, place as u32 / 8);
                let wanted = judge::front(&ray, &boxes);
                let of_ray = index.front_of(&ray).map_or(vec![], |front| front.items);
                assert_eq!(of_ray, wanted, "world {world}, {ray:?}, {boxes:?}");
                assert_eq!(front, wanted.first().copied().unwrap_or(NO_ITEM));
                wanted.iter().for_each(|&item| samples[item as usize] += 1);
                met += usize::from(!wanted.is_empty());
                tied += usize::from(wanted.len() > 1);
            }
            for (item, &wanted) in samples.iter().enumerate() {
                let place = truth.visible.binary_search(&(item as ItemId));
                assert_eq!(place.map_or(0, |place| truth.samples_of[place]), wanted);
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
            let mut found: Vec<ItemId> =
                index.all_along(&ray, ray.far).iter().map(|f| f.0).collect();
            found.sort_unstable();
            let wanted =
                (0..20).filter(|&item| judge::entry(&ray, &boxes[item as usize]).is_some());
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
                answers.push(SampleTruth::of(&solids, &index, &rays, grid, threads));
            }
            let seen =
                [1, 3].map(|threads| visible_by_random_rays(&index, &rays, 9000, 1, threads));
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

    #[test]
    fn a_scene_of_nothing_and_of_one() {
        let frame =
            crate::camera::look_at(glam::DVec3::ZERO, glam::DVec3::X, glam::DVec3::Z).unwrap();
        let lens = crate::camera::Lens::perspective(90.0, 1.0, 1.0, None).unwrap();
        let rays = Rays::of(&crate::camera::Camera { frame, lens }).unwrap();
        let grid = SampleGrid::new(3, 3);
        let of = |boxes: &[crate::scene::WorldBox]| {
            let solids = judge::solids(boxes);
            SampleTruth::of(&solids, &RayIndex::build(&solids), &rays, grid, 2)
        };
        assert!(of(&[]).visible.is_empty());
        let at =
            |x: f64| crate::scene::WorldBox::around(glam::DVec3::X * x, glam::DVec3::splat(1.0));
        assert_eq!(of(&[at(3.0)]).samples_of, [1]);
        assert_eq!(of(&[at(1.5)]).front[4], 0, "it begins at the near plane");
        assert!(
            of(&[at(1.25)]).visible.is_empty(),
            "entered before the near plane"
        );
        assert!(of(&[at(0.0)]).visible.is_empty(), "the eye is in it");
    }
}
