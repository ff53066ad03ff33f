//! The promise of the conservative epsilon: with the default options no box
//! that holds a visible point is ever dropped. Boxes are built to touch the
//! view volume by a hair, at offsets, scales and near/far ratios where f32
//! runs out of digits; the same boxes must trip planes without the epsilon.

mod far;

use std::collections::BTreeMap;

use super::by_hand::{Kind, Setup, View};
use cullbench::camera::{Camera, PlaneMethod, PlaneOptions, Pose, Surroundings};
use cullbench::culling::{Arithmetic, Culling, CullingTest};
use cullbench::geometry::{Aabb, FrustumPlane};
use cullbench::index::{Registry, StructureSpec};
use cullbench::oracle::{Oracle, Verdict};
use cullbench::query::Predicate as _;
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

struct SeededRng(Pcg64);

impl SeededRng {
    fn new(seed: u64) -> Self {
        SeededRng(Pcg64::seed_from_u64(seed))
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }

    /// Between two positive numbers, every order of magnitude alike.
    fn log_between(&mut self, low: f64, high: f64) -> f64 {
        (self.between(low.ln(), high.ln())).exp().clamp(low, high)
    }

    fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.0.random_range(0..from.len())]
    }

    /// Any direction, or one along an axis, where some numbers vanish.
    fn direction(&mut self) -> DVec3 {
        if self.pick(&[true, false, false, false, false]) {
            let sign = self.pick(&[-1.0, 1.0]);
            return self.pick(&[DVec3::X, DVec3::Y, DVec3::Z]) * sign;
        }
        loop {
            let v: DVec3 = std::array::from_fn(|_| self.between(-1.0, 1.0)).into();
            if v.length() > 0.1 && v.length() < 1.0 {
                return v.normalize();
            }
        }
    }
}

/// Depth at which an infinite volume is probed, as a multiple of the near distance.
const DEEP: f64 = 1e6;

const KINDS: [&str; 5] = [
    "perspective",
    "perspective, infinite far",
    "orthographic",
    "off-axis",
    "off-axis, infinite far",
];

/// A camera that makes rounding as bad as it gets: `scale` is the depth of
/// its volume, `offset` its distance from the scene's zero.
fn adversarial(rng: &mut SeededRng, kind: &str, offset: f64) -> Setup {
    let scale = rng.log_between(1e-3, 1e6);
    let eye = rng.direction() * offset + rng.direction() * scale * rng.between(0.0, 1.0);
    let (forward, up) = loop {
        let (forward, up) = (rng.direction(), rng.direction());
        if forward.cross(up).length() > 1e-2 {
            break (forward, up);
        }
    };
    let near = scale / rng.log_between(1.1, 1e6);
    let fovy_deg = rng.between(5.0, 140.0);
    let aspect = rng.between(0.3, 3.0);
    let y = near * (fovy_deg.to_radians() / 2.0).tan();
    let far = (!kind.ends_with("infinite far")).then_some(scale);
    let kind = match kind {
        "orthographic" => Kind::Orthographic {
            height: scale * rng.log_between(1e-2, 1.0),
            aspect,
        },
        "off-axis" | "off-axis, infinite far" => {
            let (x, dx, dy) = (y * aspect, rng.between(-3.0, 3.0), rng.between(-3.0, 3.0));
            Kind::OffAxis {
                window: [
                    x * (dx - 1.0),
                    x * (dx + 1.0),
                    y * (dy - 1.0),
                    y * (dy + 1.0),
                ],
            }
        }
        _ => Kind::Perspective { fovy_deg, aspect },
    };
    Setup {
        eye,
        look: eye + forward * (scale + offset),
        up,
        kind,
        near,
        far,
    }
}

/// A point on the surface and the direction back inside: on a face, an edge
/// or a corner.
fn on_surface(rng: &mut SeededRng, view: &View) -> (DVec3, DVec3) {
    let far = view.far_or(DEEP);
    let mut at = [
        rng.between(0.0, 1.0),
        rng.between(0.0, 1.0),
        rng.log_between(view.near, far),
    ];
    let mut inward = DVec3::ZERO;
    for _ in 0..rng.pick(&[1, 1, 1, 2, 3]) {
        let face = rng.pick(view.faces());
        let (axis, place) = match face {
            FrustumPlane::Left => (0, 0.0),
            FrustumPlane::Right => (0, 1.0),
            FrustumPlane::Bottom => (1, 0.0),
            FrustumPlane::Top => (1, 1.0),
            FrustumPlane::Near => (2, view.near),
            FrustumPlane::Far => (2, far),
        };
        at[axis] = place;
        inward += view.inward(face);
    }
    (view.point(at[0], at[1], at[2]), inward)
}

/// More than f64 can misjudge a distance, and far less than f32 can tell.
fn hair(view: &View, p: DVec3) -> f64 {
    2e-14 * ((p - view.eye).length() + view.near.abs() + view.far.unwrap_or(0.0))
}

/// Returns `true` if the point is visible by more than the rounding error of f64.
fn surely_inside(view: &View, p: DVec3) -> bool {
    view.depth_inside(p) >= hair(view, p)
}

/// A visible f64 point next to the surface point `on`, as near as f64 allows.
fn just_inside(view: &View, on: DVec3, inward: DVec3) -> Option<DVec3> {
    let mut step = 2.0 * hair(view, on) + 1e-16 * on.abs().max_element();
    for _ in 0..12 {
        let p = on + inward * step;
        if surely_inside(view, p) {
            return Some(p);
        }
        step *= 2.0;
    }
    None
}

/// A visible point whose coordinates about zero are f32 values, one f32 step
/// from being invisible: the worst there is, nothing is left to round.
fn just_inside_f32(rng: &mut SeededRng, view: &View, on: DVec3, inward: DVec3) -> Option<DVec3> {
    let axis = rng.pick(&[0, 1, 2]);
    let mut p = on.as_vec3();
    let step = |x: f32, up: bool| if up { x.next_up() } else { x.next_down() };
    for _ in 0..64 {
        if surely_inside(view, p.as_dvec3()) {
            let mut beyond = p;
            beyond[axis] = step(p[axis], inward[axis] < 0.0);
            if !surely_inside(view, beyond.as_dvec3()) {
                return Some(p.as_dvec3());
            }
            p = beyond;
        } else {
            p[axis] = step(p[axis], inward[axis] >= 0.0);
        }
    }
    None
}

/// A box that has `p` as the corner (or on the face or edge, where it is flat)
/// farthest inside, extends away from the volume, and is rounded outward to
/// f32 about `origin`.
fn touching(rng: &mut SeededRng, p: DVec3, inward: DVec3, size: f64, origin: DVec3) -> Aabb {
    let (mut min, mut max) = (p, p);
    for axis in 0..3 {
        let size = rng.pick(&[0.0, 1.0, 1.0, 1.0]) * rng.log_between(size * 1e-6, size);
        if inward[axis] >= 0.0 {
            min[axis] -= size;
        } else {
            max[axis] += size;
        }
    }
    let b = Aabb::rounded_outward(min, max, origin);
    if origin == DVec3::ZERO {
        let holds = p.cmpge(b.min.as_dvec3()).all() && p.cmple(b.max.as_dvec3()).all();
        assert!(holds, "{b:?} was not rounded outward from {p}");
    }
    b
}

/// One camera with the boxes that touch its volume.
struct Scene {
    setup: Setup,
    origin: DVec3,
    boxes: Vec<Aabb>,
}

fn scene(rng: &mut SeededRng, kind: &str, offset: f64, count: usize) -> Scene {
    let setup = adversarial(rng, kind, offset);
    let view = setup.view();
    // Scene-local coordinates about zero, or about a point near the camera.
    let origin = match rng.pick(&[0, 0, 1]) {
        0 => DVec3::ZERO,
        _ => (setup.eye * 0.9).round(),
    };
    let size = view.far_or(DEEP);
    let mut boxes = Vec::with_capacity(count);
    for i in 0..count {
        let (on, inward) = on_surface(rng, &view);
        let p = if i % 2 == 0 && origin == DVec3::ZERO {
            just_inside_f32(rng, &view, on, inward)
        } else {
            just_inside(&view, on, inward)
        };
        if let Some(p) = p {
            assert!(surely_inside(&view, p));
            boxes.push(touching(rng, p, inward, size, origin));
        }
    }
    Scene {
        setup,
        origin,
        boxes,
    }
}

impl Scene {
    fn surroundings(&self) -> Surroundings {
        Surroundings {
            origin: self.origin,
            reach: Aabb::union_of(&self.boxes).reach(),
        }
    }

    fn dropped(&self, options: &PlaneOptions) -> Vec<usize> {
        let volume = self.setup.camera().volume(options, &self.surroundings());
        let volume = volume.unwrap_or_else(|error| panic!("{:?}: {error}", self.setup));
        let boxes = self.boxes.iter().enumerate();
        let dropped = boxes.filter(|(_, b)| !volume.sees(b));
        dropped.map(|(i, _)| i).collect()
    }
}

#[test]
fn no_box_that_holds_a_visible_point_is_ever_dropped() {
    let mut rng = SeededRng::new(0x0065_7073);
    let default = PlaneOptions::default();
    assert_eq!((default.method, default.epsilon), (PlaneMethod::Frame, 8.0));
    let with = |epsilon| PlaneOptions { epsilon, ..default };
    let (mut boxes, mut dropped_at_half) = (0, 0);
    // Boxes and what the bare planes drop, by kind of lens and by offset.
    let mut bare_drops: BTreeMap<String, (usize, usize)> = BTreeMap::new();
    for offset in [0.0, 1e4, 1e6] {
        for kind in KINDS {
            for _ in 0..100 {
                let scene = scene(&mut rng, kind, offset, 200);
                let dropped = scene.dropped(&default);
                assert!(
                    dropped.is_empty(),
                    "{} of {} boxes are dropped, such as {:?}; {kind}, {:?}, origin {}",
                    dropped.len(),
                    scene.boxes.len(),
                    scene.boxes[dropped[0]],
                    scene.setup,
                    scene.origin,
                );
                let bare = scene.dropped(&with(0.0)).len();
                dropped_at_half += scene.dropped(&with(0.5)).len();
                boxes += scene.boxes.len();
                for key in [kind.to_owned(), format!("offset {offset:e}")] {
                    let row = bare_drops.entry(key).or_default();
                    *row = (row.0 + scene.boxes.len(), row.1 + bare);
                }
            }
        }
    }
    assert!(boxes >= 200_000, "only {boxes} boxes");
    // Otherwise the boxes were too easy and the zero above means nothing.
    for (what, (boxes, dropped)) in &bare_drops {
        assert!(dropped * 50 > *boxes, "{what}: {dropped} of {boxes}");
    }
    // Not even half a rounding of each number is margin enough.
    assert!(dropped_at_half > 50, "{dropped_at_half}");
}

#[test]
fn views_about_the_eye_drop_none_of_them_either() {
    let mut rng = SeededRng::new(31);
    let (mut bare, mut rounded_near_zero, mut boxes) = (0, 0, 0);
    for offset in [0.0, 1e4, 1e6] {
        for kind in KINDS {
            for _ in 0..100 {
                let scene = scene(&mut rng, kind, offset, 100);
                let (camera, around) = (scene.setup.camera(), scene.surroundings());
                let about = |c| camera.relative_volume(&[], c, &around).unwrap();
                let (safe, tight) = (about(8.0), about(0.0));
                let wide = camera.convex_volume_f64(&around).unwrap();
                for b in &scene.boxes {
                    assert!(safe.sees(b), "{b:?}; {:?}, {around:?}", scene.setup);
                    bare += usize::from(!tight.sees(b));
                    // f64 has no margin, but digits enough where the camera
                    // is not far away.
                    rounded_near_zero += usize::from(offset == 0.0 && !wide.sees(b));
                }
                boxes += scene.boxes.len();
            }
        }
    }
    assert!(bare * 100 > boxes, "too easy: {bare} of {boxes}");
    assert_eq!(rounded_near_zero, 0);
}

#[test]
fn about_the_eye_the_margin_does_not_grow_with_the_distance() {
    let mut rng = SeededRng::new(37);
    let mut camera = scene(&mut rng, "perspective", 0.0, 1).setup.camera();
    let margin = |camera: &cullbench::camera::Camera, relative: bool| -> f64 {
        let at = |c| -> Vec<f64> {
            let around = Surroundings::default();
            let options = PlaneOptions {
                epsilon: c,
                ..PlaneOptions::default()
            };
            let planes = match relative {
                true => camera
                    .relative_volume(&[], c, &around)
                    .unwrap()
                    .planes()
                    .clone(),
                false => camera.volume(&options, &around).unwrap(),
            };
            planes.planes().iter().map(|p| f64::from(p.d)).collect()
        };
        let (moved, bare) = (at(8.0), at(0.0));
        let gaps = moved.iter().zip(bare).map(|(moved, bare)| moved - bare);
        gaps.fold(0.0, f64::max)
    };
    camera.frame.eye = DVec3::splat(1e7 + 0.3);
    let far = camera.lens.far().unwrap();
    assert!(margin(&camera, true) < far * 2e-5);
    assert!(margin(&camera, false) > 1.0);
}

#[test]
fn structures_drop_none_of_them_either() {
    let mut rng = SeededRng::new(17);
    for kind in KINDS {
        for offset in [0.0, 1e4, 1e6] {
            let scene = scene(&mut rng, kind, offset, 500);
            let camera = scene.setup.camera();
            let volume = camera.volume(&PlaneOptions::default(), &scene.surroundings());
            let volume = volume.unwrap();
            for row in Registry::builtin().rows() {
                let spec = StructureSpec::parse(row.info.name).unwrap();
                let structure = spec.build(&scene.boxes).unwrap();
                let mut found = Vec::new();
                structure.visible(&volume, &mut found);
                found.sort_unstable();
                let all: Vec<u32> = (0..scene.boxes.len() as u32).collect();
                assert_eq!(found, all, "{}, {:?}", row.info.name, scene.setup);
            }
        }
    }
}

/// Near corners and far ones; none of these without a far plane.
fn corners(view: &View) -> ([DVec3; 4], Vec<DVec3>) {
    let all = view.corners(view.far.unwrap_or(2.0 * view.near));
    let (near, far) = all.split_at(4);
    let far = if view.far.is_some() { far } else { &[] };
    (near.try_into().expect("four corners"), far.to_vec())
}

#[test]
fn planes_move_outward_by_the_documented_margin_and_no_more() {
    let mut rng = SeededRng::new(23);
    for offset in [0.0, 1e4, 1e6] {
        for kind in KINDS {
            for _ in 0..50 {
                let scene = scene(&mut rng, kind, offset, 20);
                let around = scene.surroundings();
                let view = Setup {
                    eye: scene.setup.eye - scene.origin,
                    look: scene.setup.look - scene.origin,
                    ..scene.setup
                }
                .view();
                // Of volume and scene, whichever is smaller.
                let (near, far) = corners(&view);
                let all = near.iter().chain(&far).map(|corner| corner.abs());
                let mut reach = around.reach.as_dvec3();
                if view.far.is_some() {
                    reach = reach.min(all.fold(DVec3::ZERO, DVec3::max));
                }
                let camera = scene.setup.camera();
                for c in [1.0, 8.0, 1000.0] {
                    let planes = |epsilon| {
                        let method = PlaneMethod::Frame;
                        let options = PlaneOptions { method, epsilon };
                        camera.volume(&options, &around).unwrap()
                    };
                    let (bare, moved) = (planes(0.0), planes(c));
                    for (i, (bare, moved)) in bare.planes().iter().zip(moved.planes()).enumerate() {
                        assert_eq!(bare.normal, moved.normal);
                        let d = f64::from(bare.d);
                        let n = bare.normal.as_dvec3().abs();
                        let most =
                            |of: &[DVec3]| of.iter().map(|x| n.dot(x.abs())).fold(0.0, f64::max);
                        // At the corners that the plane can misjudge: near and
                        // far plane only their own.
                        let own = match (i, view.far) {
                            (4, _) => most(&near),
                            (5, _) => most(&far),
                            (_, Some(_)) => most(&near).max(most(&far)),
                            (_, None) => f64::INFINITY,
                        };
                        let size = own.min(n.dot(reach)) + d.abs();
                        let derived = view.eye.abs() + reach;
                        let mut derived = 2f64.powi(-49) * derived.element_sum();
                        // Rays of samples begin at points rounded in the world.
                        if matches!(scene.setup.kind, Kind::Orthographic { .. }) {
                            derived += f64::EPSILON * scene.setup.eye.abs().element_sum();
                        }
                        let wanted = d + c * 2f64.powi(-24) * size + 2f64.powi(-147) + derived;
                        // Rounded up, once; the corners of the two cameras
                        // differ in the last bits of f64.
                        let slack = 1e-12 * (size + d.abs() + derived);
                        let found = f64::from(moved.d);
                        let before = f64::from(moved.d.next_down());
                        assert!(
                            found >= wanted - slack && before < wanted + slack,
                            "{d:e} moves to {found:e}, not {wanted:e}; {:?}",
                            scene.setup
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn without_a_far_plane_the_scenes_bound_carries_the_promise() {
    // The margin of an unbounded volume comes from the scene alone: a bound
    // that is too small must show, or the reach is not what is used.
    let mut rng = SeededRng::new(29);
    let mut dropped = 0;
    for _ in 0..100 {
        let scene = scene(&mut rng, "perspective, infinite far", 0.0, 200);
        let small = Surroundings {
            reach: scene.surroundings().reach * 1e-3,
            ..scene.surroundings()
        };
        let camera = scene.setup.camera();
        let volume = camera.volume(&PlaneOptions::default(), &small).unwrap();
        dropped += scene.boxes.iter().filter(|b| !volume.sees(b)).count();
    }
    assert!(dropped > 10, "{dropped}");
}
