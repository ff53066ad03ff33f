//! The truth of triangles, checked by arithmetic on integers.

use std::cmp::Ordering;

use dashu_int::IBig;
use glam::{DVec3, Vec3};

use super::judge::{self, Depth, exact};
use crate::camera::{Camera, Lens};
use crate::query::ItemId;
use crate::scene::{self, Family, SeededRng, SurfaceKind, Surfaces};
use crate::visibility::truth::{NO_ITEM, RayIndex, SampleTruth, SurfaceIndex, fronts};
use crate::visibility::{Ray, Rays, SampleGrid, Solids};

type Point = [IBig; 3];

fn point(x: f64, y: f64, z: f64) -> Point {
    [exact(x), exact(y), exact(z)]
}

fn minus(a: &Point, b: &Point) -> Point {
    [0, 1, 2].map(|k| &a[k] - &b[k])
}

fn cross(a: &Point, b: &Point) -> Point {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| &a[i] * &b[j] - &a[j] * &b[i])
}

fn dot(a: &Point, b: &Point) -> IBig {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

/// Meeting by another method than the code under test.
///
/// Computes the depth of the plane, then the sides of the point there, scaled by the depth's
/// denominator.
fn met(ray: &Ray, origin: DVec3, corners: [Vec3; 3], two_sided: bool) -> Option<Depth> {
    let zero = point(origin.x, origin.y, origin.z);
    let [a, b, c] = corners.map(|p| {
        let p = point(p.x.into(), p.y.into(), p.z.into());
        [0, 1, 2].map(|k| &p[k] + &zero[k])
    });
    let o = point(ray.origin.x, ray.origin.y, ray.origin.z);
    let d = point(ray.direction.x, ray.direction.y, ray.direction.z);
    let normal = cross(&minus(&b, &a), &minus(&c, &a));
    let (mut above, mut below) = (dot(&minus(&a, &o), &normal), dot(&d, &normal));
    match below.cmp(&IBig::ZERO) {
        Ordering::Equal => return None,
        Ordering::Greater if !two_sided => return None,
        Ordering::Greater => {}
        Ordering::Less => (above, below) = (-above, -below),
    }
    let at: Point = [0, 1, 2].map(|k| &o[k] * &below + &d[k] * &above);
    let scaled = |p: &Point| [0, 1, 2].map(|k| &p[k] * &below);
    for (p, q) in [(&a, &b), (&b, &c), (&c, &a)] {
        let side = cross(&minus(q, p), &minus(&at, &scaled(p)));
        if dot(&side, &normal) < IBig::ZERO {
            return None;
        }
    }
    let depth = (above, below);
    let limit = |x: f64| (exact(x), exact(1.0));
    let within = judge::order(&depth, &limit(ray.near)).is_ge()
        && (ray.far.is_infinite() || judge::order(&depth, &limit(ray.far)).is_le());
    within.then_some(depth)
}

/// Items in front, and items seen before them.
fn seen(ray: &Ray, surfaces: &Surfaces) -> [Vec<ItemId>; 2] {
    let mut all = Vec::new();
    for item in 0..surfaces.items() {
        for triangle in surfaces.range(item) {
            let corners = surfaces.corners(triangle as u32);
            let depth = met(ray, surfaces.origin, corners, surfaces.two_sided[triangle]);
            let hides = surfaces.kinds[triangle] == SurfaceKind::Opaque;
            all.extend(depth.map(|depth| (item, depth, hides)));
        }
    }
    let opaque = all.iter().filter(|(.., hides)| *hides);
    let first = opaque
        .map(|(_, depth, _)| depth)
        .min_by(|a, b| judge::order(a, b));
    let order = |depth: &Depth| first.map_or(Ordering::Less, |f| judge::order(depth, f));
    let items = |front: bool| {
        let of = all
            .iter()
            .filter(|(_, depth, hides)| *hides == front && order(depth).is_le());
        let mut items: Vec<ItemId> = of.map(|(item, ..)| *item as ItemId).collect();
        items.sort_unstable();
        items.dedup();
        items
    };
    let (front, mut before) = (items(true), items(false));
    before.retain(|item| !front.contains(item));
    [front, before]
}

#[test]
fn triangles_full_of_ties_are_seen_as_whole_numbers_see_them() {
    let mut rng = SeededRng::new(31);
    let (mut met, mut tied, mut before, mut edges) = (0, 0, 0, 0);
    for world in 0..240 {
        let surfaces = judge::triangles(&mut rng);
        let index = SurfaceIndex::build(&surfaces);
        let mut camera = judge::camera(&mut rng);
        camera.frame.eye += surfaces.origin;
        let rays = Rays::of(&camera).unwrap();
        let grid = SampleGrid::new(6, 4);
        let truth = SampleTruth::of(&index, &rays, grid, 1);
        let fronts = fronts(&index, &|_, _, _| true, &rays, grid);
        let mut samples = vec![0; surfaces.items()];
        for (sample, own) in (0..).zip(&fronts) {
            let ray = rays.sample(grid, sample % 6, sample / 6);
            let wanted = seen(&ray, &surfaces);
            let found = index.front_of(&ray);
            let found = [found.front, found.before];
            assert_eq!(found, wanted, "world {world}, {ray:?}, {surfaces:?}");
            let front = wanted[0].first().copied().unwrap_or(NO_ITEM);
            assert_eq!(*own, front);
            let items = wanted.iter().flatten();
            items.for_each(|&item| samples[item as usize] += 1);
            met += usize::from(!wanted[0].is_empty());
            tied += usize::from(wanted[0].len() > 1);
            before += wanted[1].len();
        }
        for (item, &wanted) in samples.iter().enumerate() {
            let index = truth.visible.binary_search(&(item as ItemId));
            assert_eq!(index.map_or(0, |index| truth.samples_of[index]), wanted);
        }
        // Rays that aim at corners and at midpoints of edges.
        for _ in 0..12 {
            let t = rng.below(surfaces.triangles.len()) as u32;
            let [a, b, _] = surfaces.corners(t).map(Vec3::as_dvec3);
            let at = surfaces.origin + if rng.below(2) == 0 { a } else { (a + b) * 0.5 };
            let ray = Ray {
                origin: camera.frame.eye,
                direction: at - camera.frame.eye,
                near: 0.125,
                far: f64::INFINITY,
            };
            let wanted = seen(&ray, &surfaces);
            let found = index.front_of(&ray);
            assert_eq!(
                [found.front, found.before],
                wanted,
                "world {world}, {ray:?}"
            );
            edges += usize::from(!wanted[0].is_empty());
        }
    }
    println!("{met} met, {tied} tied, {before} before, {edges} at edges");
    assert!(met > 300 && tied > 25 && before > 25 && edges > 500);
}

#[test]
fn no_ray_slips_through_the_edges_of_a_closed_surface() {
    let surfaces = Family::named("mesh:statue").unwrap().mesh(2000, 3);
    let index = SurfaceIndex::build(&surfaces);
    let bounds = surfaces.bounds(0);
    let eye = bounds.centre().as_dvec3()
        + DVec3::new(3.0, 2.0, 1.0) * (bounds.max - bounds.min).length() as f64;
    let mut met = 0;
    for t in 0..surfaces.triangles.len() as u32 {
        let [a, b, c] = surfaces.corners(t).map(Vec3::as_dvec3);
        let outward = (b - a).cross(c - a);
        for at in [a, (a + b) * 0.5, (a + c) * 0.5, b * 0.25 + c * 0.75] {
            let ray = Ray {
                origin: eye,
                direction: surfaces.origin + at - eye,
                near: 0.0,
                far: f64::INFINITY,
            };
            // Rays near the silhouette may miss; others must not.
            if outward.dot(ray.direction) < -0.3 * outward.length() * ray.direction.length() {
                let front = index.front_of(&ray);
                assert_eq!(front.front, [0], "{t} {at}");
                assert!(front.hit.unwrap().min_depth() <= 1.0 + 1e-9);
                met += 1;
            }
        }
    }
    assert!(met > 1000, "{met}");
}

#[test]
fn boxes_as_triangles_are_seen_as_boxes_are() {
    for spec in ["city:n=500", "rooms:n=500", "city:n=500,offset=1e6"] {
        let scene = scene::load(spec, &Default::default()).unwrap();
        let surfaces = Surfaces::from_boxes(&scene);
        // The f32 boxes themselves, so that both are the same solids.
        let boxes = scene.items.iter().map(|b| {
            let (min, max) = b.in_world(scene.origin);
            crate::scene::WorldBox::new(min, max)
        });
        let mut solids = Solids::of(&scene);
        solids.boxes = boxes.collect();
        let (index, of_triangles) = (RayIndex::build(&solids), SurfaceIndex::build(&surfaces));
        let (mut rng, mut seen) = (SeededRng::new(4), 0);
        for place in 0..10 {
            let (min, max) = scene.bounds.in_world(scene.origin);
            let mut eye = min + (max - min) * rng.point();
            eye.z = min.z + 1.7;
            let forward = DVec3::new(rng.normal(), rng.normal(), 0.1);
            let frame = crate::camera::Frame::looking_along(eye, forward, DVec3::Z).unwrap();
            let lens = Lens::perspective(75.0, 1.5, 0.05, Some(5e3)).unwrap();
            let rays = Rays::of(&Camera { frame, lens }).unwrap();
            let grid = SampleGrid::new(48, 32);
            let boxes = SampleTruth::of(&index, &rays, grid, 1);
            for threads in [1, 3] {
                let triangles = SampleTruth::of(&of_triangles, &rays, grid, threads);
                assert_eq!(triangles, boxes, "{spec}, place {place}");
            }
            seen += boxes.visible.len();
        }
        assert!(seen > 30, "{spec}: {seen}");
    }
}
