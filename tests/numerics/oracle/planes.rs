//! Planes level: verdicts against the linear program, on the random cases of
//! the verification, on small whole numbers (where exact ties are frequent) and
//! on the whole range of f32.

use std::collections::BTreeSet;

use cullbench::geometry::{Aabb, ConvexVolume, MAX_PLANES, Plane};
use cullbench::oracle::{Oracle, Verdict};
use cullbench::verify::{RandomCase, VOLUME_KINDS};
use glam::Vec3;

use super::cases;
use super::draw::{SeededRng, grid_box};
use super::simplex;

/// Cases of a run by verdict: all, and those that no single plane decides.
///
/// The latter are edges against edges, corners, and bounds.
#[derive(Default, Debug)]
struct Tally {
    verdicts: [usize; 3],
    combined: [usize; 3],
    /// The numbers of planes met.
    counts: BTreeSet<usize>,
}

impl Tally {
    fn cases(&self) -> usize {
        self.verdicts.iter().sum()
    }

    fn share(&self, verdict: Verdict) -> f64 {
        self.verdicts[verdict as usize] as f64 / self.cases() as f64
    }

    fn combined_share(&self, verdict: Verdict) -> f64 {
        self.combined[verdict as usize] as f64 / self.cases() as f64
    }

    fn check(&mut self, planes: &[Plane], boxes: &[Aabb], name: &dyn Fn() -> String) {
        let volume = ConvexVolume::from_planes(planes).expect("finite planes");
        let oracle = Oracle::of_volume(&volume);
        let exact: Vec<simplex::ExactPlane> = planes.iter().map(simplex::exact).collect();
        for b in boxes {
            let wanted = simplex::verdict(&exact, b);
            let found = oracle.classify(b);
            assert!(
                found.verdict == wanted && !found.undecided,
                "{}: {found:?}, wanted {wanted:?}, for {b:?} and {planes:?}",
                name()
            );
            self.verdicts[wanted as usize] += 1;
            self.counts.insert(planes.len());
            let alone = exact
                .iter()
                .any(|plane| simplex::verdict(std::slice::from_ref(plane), b) == wanted);
            self.combined[wanted as usize] += usize::from(!alone);
        }
    }
}

#[test]
fn random_cases_of_every_volume_kind() {
    let mut tally = Tally::default();
    let mut kinds = [0; VOLUME_KINDS.len()];
    let wanted = cases(14_000);
    for seed in 0.. {
        let case = RandomCase::new(seed);
        let boxes = &case.items[..case.items.len().min(12)];
        tally.check(case.volume.planes(), boxes, &|| {
            format!("seed {seed} ({})", VOLUME_KINDS[case.kind])
        });
        kinds[case.kind] += boxes.len();
        if tally.cases() >= wanted {
            break;
        }
    }
    println!("random: {tally:?} of kinds {kinds:?}");
    assert!(kinds.iter().all(|&n| n * 20 > wanted), "{kinds:?}");
    assert!(tally.share(Verdict::In) > 0.1, "{tally:?}");
    assert!(tally.share(Verdict::Out) > 0.1, "{tally:?}");
}

/// Mostly few planes, now and then up to the limit.
fn plane_count(rng: &mut SeededRng) -> usize {
    match rng.below(8) {
        0..4 => 1 + rng.below(6),
        4 | 5 => 4 + rng.below(5),
        6 => 1 + rng.below(MAX_PLANES),
        _ => MAX_PLANES,
    }
}

/// A volume of small whole numbers and boxes that often share a grid point
/// with its boundary.
fn grid_case(rng: &mut SeededRng) -> (Vec<Plane>, Vec<Aabb>) {
    let (planes, tips) = match rng.below(3) {
        0 => grid_frustum(rng),
        1 => grid_cone(rng),
        _ => (grid_planes(rng), vec![rng.whole3(4)]),
    };
    let boxes = (0..4).map(|_| {
        let tip = tips[rng.below(tips.len())];
        let elsewhere = rng.whole3(9);
        let near_tip = rng.chance(0.7);
        let mut b = grid_box(rng, if near_tip { tip } else { elsewhere });
        if rng.chance(0.02) {
            (b.min, b.max) = (b.max, b.min);
        }
        if rng.chance(0.1) {
            // With the tip well inside: only the volume itself can be missing.
            b = Aabb::new(tip - 1.0, tip + 1.0);
        }
        b
    });
    let boxes = boxes.collect();
    (planes, boxes)
}

/// Planes about a grid point; now and then one of nothing but zeros, or an
/// empty volume.
fn grid_planes(rng: &mut SeededRng) -> Vec<Plane> {
    let count = plane_count(rng);
    let centre = rng.whole3(3);
    let plane = |_| {
        let normal = rng.whole3(2);
        let distance = match rng.below(60) {
            0 => rng.whole(2),
            1..8 => 0,
            _ => 1 + rng.below(9) as i64,
        };
        Plane::new(normal, distance as f32 - normal.dot(centre))
    };
    (0..count).map(plane).collect()
}

/// Planes through one point, the tip of a cone (or wedge, or all there is).
fn grid_cone(rng: &mut SeededRng) -> (Vec<Plane>, Vec<Vec3>) {
    let tip = rng.whole3(5);
    // Without an axis the planes often have the tip alone in common.
    let axis = if rng.chance(0.3) {
        Vec3::ZERO
    } else {
        rng.whole3(3)
    };
    let count = if rng.chance(0.9) {
        2 + rng.below(5)
    } else {
        plane_count(rng)
    };
    let plane = |_| {
        let mut normal = rng.whole3(3);
        if normal.dot(axis) < 0.0 && rng.chance(0.95) {
            normal = -normal;
        }
        Plane::new(normal, -normal.dot(tip))
    };
    let planes = (0..count).map(plane).collect();
    // A point on a ray of the cone, more often than not inside it.
    (planes, vec![tip, tip, tip + axis])
}

/// Vector A02 with whole slopes, in any position and along any axis, and its
/// corners; now and then with an infinite far plane or one side open.
fn grid_frustum(rng: &mut SeededRng) -> (Vec<Plane>, Vec<Vec3>) {
    let mut slope = || 1.0 + rng.below(2) as f32;
    let (x, y) = (slope(), slope());
    let near = 2.0;
    let far = near + 2.0 + 2.0 * rng.below(4) as f32;
    let eye = rng.whole3(3);
    let turn = rng.below(3);
    let turned = |n: Vec3| match turn {
        0 => n,
        1 => Vec3::new(n.y, n.z, n.x),
        _ => Vec3::new(n.z, n.x, n.y),
    };
    let mut planes = vec![
        (Vec3::new(x, 0.0, -1.0), 0.0),
        (Vec3::new(-x, 0.0, -1.0), 0.0),
        (Vec3::new(0.0, y, -1.0), 0.0),
        (Vec3::new(0.0, -y, -1.0), 0.0),
        (Vec3::new(0.0, 0.0, -1.0), -near),
        (Vec3::new(0.0, 0.0, 1.0), far),
    ];
    match rng.below(6) {
        0 => drop(planes.pop()),
        1 => drop(planes.swap_remove(rng.below(4))),
        _ => {}
    }
    let placed = planes.into_iter().map(|(normal, d)| {
        let normal = turned(normal);
        Plane::new(normal, d - normal.dot(eye))
    });
    let mut tips = vec![eye];
    for depth in [near, far] {
        for (left, bottom) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
            let corner = Vec3::new(left * depth / x, bottom * depth / y, -depth);
            tips.push(eye + turned(corner));
            tips.push(eye + turned(corner.with_x(0.0)));
        }
    }
    (placed.collect(), tips)
}

#[test]
fn small_whole_numbers_where_ties_are_frequent() {
    let mut tally = Tally::default();
    let wanted = cases(14_000);
    for seed in 0.. {
        let (planes, boxes) = grid_case(&mut SeededRng::new(seed));
        tally.check(&planes, &boxes, &|| format!("seed {seed}"));
        if tally.cases() >= wanted {
            break;
        }
    }
    println!("grid: {tally:?}");
    assert!(tally.share(Verdict::Touch) > 0.1, "{tally:?}");
    assert!(tally.combined_share(Verdict::Touch) > 0.02, "{tally:?}");
    assert!(
        (1..=MAX_PLANES).eq(tally.counts.iter().copied()),
        "{tally:?}"
    );
}

/// An f32 of any sign and mantissa, `2^low` to `2^high`.
fn float(rng: &mut SeededRng, low: i32, high: i32) -> f32 {
    let exponent = low + rng.below((high - low) as usize) as i32;
    let mantissa = 1.0 + rng.unit();
    let sign = if rng.chance(0.5) { 1.0 } else { -1.0 };
    (sign * libm::ldexp(mantissa, exponent)) as f32
}

fn ordered(a: [f32; 3], b: [f32; 3]) -> Aabb {
    let (a, b) = (Vec3::from_array(a), Vec3::from_array(b));
    Aabb::new(a.min(b), a.max(b))
}

/// One step up or down, not off the finite numbers.
fn nudged(x: f32, rng: &mut SeededRng) -> f32 {
    let moved = if rng.chance(0.5) {
        x.next_up()
    } else {
        x.next_down()
    };
    if moved.is_finite() { moved } else { x }
}

/// Any bit patterns at all.
fn wild(rng: &mut SeededRng) -> (Vec<Plane>, Vec<Aabb>) {
    let some = |rng: &mut SeededRng| match rng.below(8) {
        0 => 0.0,
        1 => f32::from_bits(rng.bits() as u32 & 0x8000_FFFF),
        _ => rng.any_f32(),
    };
    let planes = (0..plane_count(rng).min(9))
        .map(|_| Plane::new(Vec3::from_array([0; 3].map(|_| some(rng))), some(rng)))
        .collect();
    let boxes = (0..4).map(|_| ordered([0; 3].map(|_| some(rng)), [0; 3].map(|_| some(rng))));
    (planes, boxes.collect())
}

/// Magnitudes mixed over some forty binary orders, all planes about one box.
fn mixed(rng: &mut SeededRng) -> (Vec<Plane>, Vec<Aabb>) {
    let scale = rng.below(160) as i32 - 90;
    let point = |rng: &mut SeededRng| [0; 3].map(|_| float(rng, scale - 12, scale + 12));
    let centre = point(rng);
    let planes = (0..plane_count(rng))
        .map(|_| {
            let s = rng.below(60) as i32 - 30;
            let normal = [0; 3].map(|_| float(rng, s - 20, s + 20));
            let product = (0..3).fold(0.0, |sum, k| {
                sum + f64::from(normal[k]) * f64::from(centre[k])
            });
            let d = -product * (1.0 - 0.2 * rng.unit());
            let d = d.clamp(-f64::from(f32::MAX), f64::from(f32::MAX)) as f32;
            Plane::new(Vec3::from_array(normal), d)
        })
        .collect();
    let boxes = (0..4).map(|_| ordered(point(rng), centre));
    (planes, boxes.collect())
}

/// Planes through points of a box with their offsets rounded: hair-fine misses
/// and overlaps.
fn near_ties(rng: &mut SeededRng) -> (Vec<Plane>, Vec<Aabb>) {
    let scale = rng.below(60) as i32 - 30;
    let point = |rng: &mut SeededRng| [0; 3].map(|_| float(rng, scale - 3, scale + 1));
    let mut b = ordered(point(rng), point(rng));
    // All through one point on an edge of the box, so that combinations of
    // planes come as close as single ones.
    let mut common = b.corner(rng.below(8));
    let k = rng.below(3);
    common[k] = b.min[k] + (b.max[k] - b.min[k]) * rng.unit() as f32;
    if rng.chance(0.4) {
        // Or inside it: then the volume has a hair-fine inside, or none.
        let size = b.extent().max_element();
        b = Aabb::new(common - size, common + size);
    }
    let few = if rng.chance(0.5) { 4 } else { 1 };
    let planes = (0..few + rng.below(4))
        .map(|_| {
            let normal = [0; 3].map(|_| float(rng, -4, 4));
            let product = (0..3).fold(0.0, |sum, k| {
                sum + f64::from(normal[k]) * f64::from(common[k])
            });
            let mut d = -product as f32;
            if rng.chance(0.3) {
                d = nudged(d, rng);
            }
            Plane::new(Vec3::from_array(normal), d)
        })
        .collect();
    (planes, vec![b])
}

/// A case of small whole numbers, stretched by powers of two axis by axis and
/// plane by plane (ties stay ties), then one number moved by one step.
fn stretched(rng: &mut SeededRng) -> (Vec<Plane>, Vec<Aabb>) {
    let (planes, mut boxes) = grid_case(rng);
    let axes = [0; 3].map(|_| rng.whole(55) as i32);
    let scaled = |x: f32, exponent: i32| libm::ldexp(f64::from(x), exponent) as f32;
    let mut planes: Vec<Plane> = planes
        .iter()
        .map(|plane| {
            let s = rng.whole(55) as i32;
            let normal = [0, 1, 2].map(|k| scaled(plane.normal[k], s - axes[k]));
            Plane::new(Vec3::from_array(normal), scaled(plane.d, s))
        })
        .collect();
    let stretch = |v: Vec3| Vec3::from_array([0, 1, 2].map(|k| scaled(v[k], axes[k])));
    for b in &mut boxes {
        *b = Aabb::new(stretch(b.min), stretch(b.max));
    }
    match rng.below(4) {
        0 => {}
        1 => {
            let i = rng.below(planes.len());
            planes[i].d = nudged(planes[i].d, rng);
        }
        2 => {
            let (i, k) = (rng.below(planes.len()), rng.below(3));
            planes[i].normal[k] = nudged(planes[i].normal[k], rng);
        }
        _ => {
            for b in &mut boxes {
                let k = rng.below(3);
                let bound = if rng.chance(0.5) {
                    &mut b.min[k]
                } else {
                    &mut b.max[k]
                };
                *bound = nudged(*bound, rng);
            }
        }
    }
    (planes, boxes)
}

/// Planes that hold one point with full mantissas exactly, and boxes that end
/// there: ties of edges and corners that take all digits of a certificate.
fn long_ties(rng: &mut SeededRng) -> (Vec<Plane>, Vec<Aabb>) {
    let scale = rng.below(60) as i32 - 30;
    let p = [0; 3].map(|_| float(rng, scale - 3, scale + 3));
    let point = Vec3::from_array(p);
    let planes = (0..2 + rng.below(5))
        .map(|_| {
            let k = rng.below(3);
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let mut normal = Vec3::ZERO;
            let mut d = 0.0;
            if rng.chance(0.3) {
                (normal[k], d) = (1.0, -p[k]);
            } else {
                (normal[i], normal[j]) = (p[j], -p[i]);
            }
            let sign = if rng.chance(0.5) { 1.0 } else { -1.0 };
            let size = sign * libm::exp2(rng.whole(20) as f64) as f32;
            Plane::new(normal * size, d * size)
        })
        .collect();
    let boxes = (0..4).map(|_| {
        let (mut low, mut high) = (point, point);
        for k in 0..3 {
            let side = rng.below(3);
            if side < 2 {
                low[k] = p[k] - p[k].abs() * (0.1 + rng.unit() as f32);
            }
            if side > 0 {
                high[k] = p[k] + p[k].abs() * (0.1 + rng.unit() as f32);
            }
        }
        if rng.chance(0.5) {
            // One step off: out, or in, or no matter.
            let k = rng.below(3);
            (low[k], high[k]) = (nudged(low[k], rng), nudged(high[k], rng));
        }
        Aabb::new(low, high)
    });
    let boxes = boxes.collect();
    (planes, boxes)
}

#[test]
fn the_whole_range_of_f32() {
    type Maker = fn(&mut SeededRng) -> (Vec<Plane>, Vec<Aabb>);
    let makers: [(&str, Maker); 5] = [
        ("wild", wild),
        ("mixed", mixed),
        ("near ties", near_ties),
        ("stretched", stretched),
        ("long ties", long_ties),
    ];
    for (name, make) in makers {
        let mut tally = Tally::default();
        // The kinds weigh the same in a long run.
        let wanted = cases(10_000) / makers.len();
        for seed in 0.. {
            let (planes, boxes) = make(&mut SeededRng::new(seed));
            tally.check(&planes, &boxes, &|| format!("{name}, seed {seed}"));
            if tally.cases() >= wanted {
                break;
            }
        }
        println!("{name}: {tally:?}");
        assert!(tally.share(Verdict::Out) > 0.04, "{name}: {tally:?}");
        let rest = tally.share(Verdict::In).max(tally.share(Verdict::Touch));
        assert!(rest > 0.1, "{name}: {tally:?}");
    }
}
