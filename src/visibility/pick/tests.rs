//! Back ends compared with arithmetic on integers of any size.
//!
//! It shares no code with theirs.

mod triangles;

use glam::DVec3;

use super::*;
use crate::camera::{Camera, Frame, Lens, Surroundings};
use crate::index::{self, FrustumQuery, Input, RegionIndex};
use crate::kernel::Kernel;
use crate::query::{ItemId, distinct};
use crate::scene::{Scene, SeededRng, WorldBox, load};
use crate::visibility::truth::judge::{self, Depth};
use crate::visibility::truth::{Boxes, NO_ITEM, RayIndex, SampleTruth, fronts};
use crate::visibility::{Ray, Rays, SampleGrid, Solids};

/// All items that the ray meets, by depth and id.
fn all_judged(ray: &Ray, solids: &Solids) -> Vec<(Depth, ItemId)> {
    let boxes = solids.boxes.iter().zip(0..);
    let mut met: Vec<_> = boxes
        .filter_map(|(b, id)| judge::entry(ray, b).map(|depth| (depth, id)))
        .collect();
    met.sort_by(|a, b| judge::order(&a.0, &b.0).then(a.1.cmp(&b.1)));
    met
}

fn solids(boxes: &[WorldBox]) -> Solids {
    Solids::of(&Scene::from_boxes("test", boxes).unwrap())
}

/// Random boxes and rays on a grid.
///
/// Boxes lie between grid points, many of them alike, flat or touching; rays lead from grid points
/// through others.
struct Worlds {
    rng: SeededRng,
    /// Size of a grid unit, and position of the grid's origin.
    unit: f64,
    zero: DVec3,
}

impl Worlds {
    fn new(seed: u64, unit: f64, zero: DVec3) -> Worlds {
        let rng = SeededRng::new(seed);
        Worlds { rng, unit, zero }
    }

    fn whole(&mut self, low: i32, high: i32) -> f64 {
        f64::from(low) + self.rng.below((high - low + 1) as usize) as f64
    }

    fn boxes(&mut self, count: usize) -> Solids {
        let mut boxes = Vec::new();
        for _ in 0..count {
            let low = [(); 3].map(|()| self.whole(0, 9));
            let size = [(); 3].map(|()| self.whole(0, 3));
            let (low, size) = (DVec3::from(low), DVec3::from(size));
            let at = |corner: DVec3| self.zero + corner * self.unit;
            boxes.push(WorldBox::new(at(low), at(low + size)));
        }
        solids(&boxes)
    }

    fn ray(&mut self) -> Ray {
        let origin = DVec3::from([(); 3].map(|()| self.whole(-3, 12)));
        let mut direction = DVec3::ZERO;
        while direction == DVec3::ZERO {
            direction = DVec3::from([(); 3].map(|()| self.whole(1, 10))) - origin;
        }
        let far = [f64::INFINITY, 2.0, 5.0][self.rng.below(3)];
        Ray {
            origin: self.zero + origin * self.unit,
            direction: direction * [1.0, 1.0 / 3.0][self.rng.below(2)],
            near: self.whole(-1, 2) * self.unit,
            far: far * self.unit,
        }
    }
}

/// Grids of integers, of numbers that are not in f32, and of far integers.
fn grids(seed: u64) -> [Worlds; 3] {
    [
        Worlds::new(seed, 1.0, DVec3::ZERO),
        Worlds::new(seed + 1, 0.1, DVec3::new(0.05, -0.3, 0.0)),
        Worlds::new(seed + 2, 1.0, DVec3::new(1e7, -3e9, 0.5)),
    ]
}

/// Returns whether the first hit is another one.
fn differs(pick: &dyn Pick, ray: &Ray, truth: &[(Depth, ItemId)]) -> bool {
    pick.first(ray) != truth.first().map(|met| met.1)
}

#[test]
fn exact_back_ends_answer_as_arithmetic_on_integers_does() {
    let (mut met, mut ties) = (0, 0);
    for mut worlds in grids(11) {
        for count in [0, 1, 5, 40, 200] {
            let solids = worlds.boxes(count);
            let boxes = Boxes::of(&solids);
            let rows = Boxes::BACK_ENDS.iter();
            let built = rows.map(|row| (row.name, (row.build)(&boxes, Kernel::best())));
            let built: Vec<_> = built.collect();
            assert!(built.len() >= 2);
            let wide = Kernel::available().map(|kernel| (kernel, WideRay::of(&boxes, kernel)));
            let wide: Vec<_> = wide.collect();
            let index = RayIndex::build(&solids);
            for _ in 0..if count > 100 { 60 } else { 120 } {
                let ray = worlds.ray();
                let truth = all_judged(&ray, &solids);
                met += usize::from(!truth.is_empty());
                let along = distinct(truth.iter().map(|met| met.1).collect());
                assert_eq!(distinct(index.met(&ray)), along, "{ray:?}");
                let tied = |pair: &[(Depth, ItemId)]| judge::order(&pair[0].0, &pair[1].0).is_eq();
                ties += usize::from(truth.windows(2).take(1).any(tied));
                for (name, back_end) in &built {
                    assert!(!differs(&**back_end, &ray, &truth), "{name} {ray:?}");
                }
                for (kernel, wide) in &wide {
                    assert!(!differs(wide, &ray, &truth), "{kernel} {ray:?}");
                }
            }
        }
    }
    assert!(
        met > 300 && ties > 40,
        "the premise: {met} rays meet something, {ties} ties"
    );
}

/// Areas of large boxes overflow in f32, those of small ones vanish.
#[test]
fn boxes_of_any_size_are_picked_alike() {
    for unit in [1e-36, 1e-20, 1e10, 2e17, 1e19, 2e19, 1e30, 1e36] {
        let mut met = 0;
        let mut worlds = Worlds::new(5, unit, DVec3::ZERO);
        let solids = worlds.boxes(60);
        let boxes = Boxes::of(&solids);
        let rows = Boxes::BACK_ENDS.iter();
        let built = rows.map(|row| (row.name, (row.build)(&boxes, Kernel::best())));
        let built: Vec<_> = built.collect();
        for _ in 0..100 {
            let ray = worlds.ray();
            let truth = all_judged(&ray, &solids);
            met += usize::from(!truth.is_empty());
            for (name, back_end) in &built {
                let found = back_end.first(&ray);
                assert_eq!(found, truth.first().map(|t| t.1), "{name} {unit:e} {ray:?}");
            }
        }
        assert!(met > 20, "{unit:e}: {met}");
    }
}

/// Directions with tiny or zero components, and rays outside the f32 analysis.
#[test]
fn rays_along_faces_and_beyond_the_analysis_are_exact_too() {
    let mut worlds = Worlds::new(3, 1.0, DVec3::ZERO);
    let solids = worlds.boxes(150);
    let boxes = Boxes::of(&solids);
    let wide = Kernel::available().map(|kernel| (kernel, WideRay::of(&boxes, kernel)));
    let wide: Vec<_> = wide.collect();
    let sizes = [
        0.0, 1e-70, 1e-30, -1e-26, 6e-17, -6e-17, 1e-9, 0.2, -1.0, 1.0, 900.0, -900.0,
    ];
    let mut met = 0;
    for _ in 0..1500 {
        let mut ray = worlds.ray();
        let pick = |worlds: &mut Worlds| sizes[worlds.rng.below(sizes.len())];
        ray.direction = DVec3::from([(); 3].map(|()| pick(&mut worlds)));
        ray.origin *= [1.0, 1.0, -1e12][worlds.rng.below(3)];
        let truth = all_judged(&ray, &solids);
        met += usize::from(!truth.is_empty());
        for (kernel, wide) in &wide {
            assert!(!differs(wide, &ray, &truth), "{kernel} {ray:?}");
        }
    }
    assert!(met > 200, "the premise: {met}");
}

#[test]
fn in_scenes_the_wide_tree_finds_what_the_reference_finds() {
    for name in ["city:n=2000", "rooms:n=2000", "forest:n=2000", "helsinki"] {
        let scene = load(name, &Default::default()).unwrap();
        let bounds = scene.world_bounds();
        let solids = Solids::of(&scene);
        let (wide, reference) = (
            WideRay::of(&Boxes::of(&solids), Kernel::best()),
            LinearScan(Boxes::of(&solids)),
        );
        let mut rng = SeededRng::new(9);
        for _ in 0..100 {
            let ray = Ray {
                origin: bounds.min + (bounds.max - bounds.min) * rng.point(),
                direction: rng.normal3(),
                near: 0.1,
                far: f64::INFINITY,
            };
            assert_eq!(wide.first(&ray), reference.first(&ray), "{name} {ray:?}");
        }
    }
}

/// Cameras on the ground of a scene and above everything.
fn cameras(name: &str) -> (Scene, Vec<Camera>) {
    let scene = load(name, &Default::default()).unwrap();
    let bounds = scene.world_bounds();
    let size = bounds.max - bounds.min;
    let mut rng = SeededRng::new(21);
    let mut cameras = Vec::new();
    for lens in [
        Lens::perspective(60.0, 1.5, 0.25, None),
        Lens::off_axis([-0.1, 0.3, -0.2, 0.1], 0.25, Some(500.0)),
        Lens::orthographic(60.0, 1.5, 1.0, 800.0),
    ] {
        let at = bounds.min + size * rng.point();
        for (height, down) in [(bounds.min.z + 1.7, 0.0), (bounds.max.z + 20.0, -0.7)] {
            let eye = DVec3::new(at.x, at.y, height);
            let turn = rng.between(0.0, std::f64::consts::TAU);
            let forward = DVec3::new(libm::cos(turn), libm::sin(turn), down);
            let frame = Frame::looking_along(eye, forward, DVec3::Z).unwrap();
            let lens = lens.clone().unwrap();
            cameras.push(Camera { frame, lens });
        }
    }
    (scene, cameras)
}

#[test]
fn at_every_sample_the_pick_is_the_item_of_the_id_buffer() {
    let grid = SampleGrid::new(64, 40);
    for name in ["city:n=3000", "rooms:n=2000", "freedm-map12"] {
        let (scene, cameras) = cameras(name);
        let solids = Solids::of(&scene);
        let (wide, index) = (
            WideRay::of(&Boxes::of(&solids), Kernel::best()),
            RayIndex::build(&solids),
        );
        let mut items = 0;
        for camera in cameras {
            let rays = Rays::of(&camera).unwrap();
            let truth = SampleTruth::of(&index, &rays, grid, 1);
            items += truth.visible.len();
            let fronts = fronts(&index, &|_, _, _| true, &rays, grid);
            for row in 0..grid.height {
                for column in 0..grid.width {
                    let picked = wide.first(&rays.sample(grid, column, row));
                    let picked = picked.unwrap_or(NO_ITEM);
                    let front = fronts[(row * grid.width + column) as usize];
                    assert_eq!(picked, front, "{name} {column} {row}");
                }
            }
        }
        assert!(items > 50, "the premise: {items}");
    }
}

#[test]
fn a_cursors_frustum_holds_what_every_ray_through_it_meets_and_no_more_than_its_planes() {
    let (scene, cameras) = cameras("city:n=3000");
    let solids = Solids::of(&scene);
    let exact = RayIndex::build(&solids);
    let index = index::Wide::build(&Input::new(&scene.items), &Default::default()).unwrap();
    let around = Surroundings {
        origin: scene.origin,
        reach: scene.bounds.reach(),
    };
    let mut rng = SeededRng::new(2);
    let (mut met, mut found) = (0, 0);
    for camera in cameras {
        let rays = Rays::of(&camera).unwrap();
        for half in [0.5, 4.0, 60.0] {
            let cursor = [rng.between(60.0, 260.0), rng.between(60.0, 120.0)];
            let rectangle = CursorRectangle::around(cursor, half, [320.0, 180.0]);
            let volume = rectangle.volume(&rays, &around).unwrap();
            let mut items = index.visible(&volume);
            items.sort_unstable();
            let seen = scene.items.iter().map(|b| volume.sees(b));
            let seen = seen.zip(0..).filter(|(sees, _)| *sees).map(|(_, id)| id);
            assert_eq!(items, seen.collect::<Vec<ItemId>>());
            let between = |a: f64, b: f64, part: f64| a + (b - a) * part;
            for (x, y) in (0..9).map(|i| (f64::from(i % 3) / 2.0, f64::from(i / 3) / 2.0)) {
                let ([x0, y0], [x1, y1]) = (rectangle.min, rectangle.max);
                let ray = rays.through(between(x0, x1, x), between(y0, y1, y));
                let hits = exact.met(&ray);
                met += hits.len();
                for hit in &hits {
                    assert!(items.binary_search(hit).is_ok(), "{half} {hit}");
                }
            }
            found += items.len();
            // The rectangle's answer is smaller: the whole image contains more items.
            let whole = CursorRectangle {
                min: [0.0; 2],
                max: [1.0; 2],
            };
            let all = index.visible(&whole.volume(&rays, &around).unwrap());
            assert!(items.len() < all.len() || all.is_empty());
        }
    }
    assert!(met > 100 && found > 300, "the premise: {met} {found}");
}
