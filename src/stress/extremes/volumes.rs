//! Extremes at planes level.
//!
//! Volumes without an end, with many planes and with no point at all; inverted, flat and
//! coincident boxes; and numbers so small that flushing them to zero would change the answer.

use glam::Vec3;

use super::check::{Findings, SCALAR};
use crate::geometry::{
    Aabb, ConvexVolume, ConvexVolumeF64, Plane, RelativeVolume, Spheres, sphere_cube,
};
use crate::index::{Input, StructureSpec};
use crate::oracle::{Oracle, Verdict};
use crate::query::AnyVolume;
use crate::scene::SeededRng;
use crate::stress::sheet::sees_exactly;
use crate::verify::{RandomCase, explain_visibility};

/// A way to make cases at planes level.
pub struct PlanesFamily {
    /// Name in the table of results.
    pub name: &'static str,
    /// Makes the case of a seed.
    pub case: fn(u64) -> RandomCase,
    /// Cases for each case of a camera variant.
    pub factor: u64,
    /// Every operation of the plane test is exact: so must its answer be.
    pub exact: bool,
}

/// All families at planes level, in the order of the table of results.
pub static PLANES_FAMILIES: &[PlanesFamily] = rows! { PlanesFamily { name, factor, exact, case }
    // Every kind of volume (unbounded, empty, up to 31 planes) about flat, inverted and
    // touching boxes.
    "volumes", 20, false, RandomCase::new;
    // Planes and boxes of denormal numbers: nothing may be flushed to zero.
    "denormals", 2, true, denormals;
};

/// Normals of -1, 0 and 1, offsets and bounds of whole multiples of the least
/// number: no operation rounds, and all of them work on denormals.
fn denormals(seed: u64) -> RandomCase {
    let mut rng = SeededRng::new(seed ^ 0xDE_0A11);
    // Below the least normal number, 2^23 units.
    let mut number = || {
        let magnitude = f32::from_bits(rng.below(1 << 22) as u32);
        magnitude * [1.0, -1.0][rng.below(2)]
    };
    let mut vector = || Vec3::new(number(), number(), number());
    let items = (0..200).map(|_| {
        let (a, b) = (vector(), vector());
        Aabb::new(a.min(b), a.max(b))
    });
    let mut items: Vec<Aabb> = items.collect();
    items.extend(items.clone().iter().map(|b| Aabb::new(b.max, b.max)));
    let mut planes = Vec::new();
    for _ in 0..3 {
        let mut sign = || [-1.0, 0.0, 1.0, 1.0f32][rng.below(4)];
        let normal = Vec3::new(sign(), sign(), sign());
        let d = f32::from_bits(rng.below(1 << 22) as u32);
        planes.push(Plane::new(normal, if rng.below(3) == 0 { -d } else { d }));
    }
    RandomCase {
        volume: ConvexVolume::from_planes(&planes).expect("three finite planes"),
        kind: UNBOUNDED,
        point: items[0].min,
        region: items[0],
        items,
    }
}

/// Kind of a volume of a few planes.
const UNBOUNDED: usize = 5;
/// The largest volume whose certificates are worth making: O(m^4).
const MOST_PLANES: usize = 12;

impl PlanesFamily {
    /// Checks every kind of volume of the planes, and the point, on every structure.
    pub fn check(&self, case: &RandomCase, structures: &[StructureSpec]) -> Findings {
        let mut found = Findings {
            boxes: case.items.len() as u64,
            ..Findings::default()
        };
        self.scalar(case, &mut found);
        let wide = ConvexVolumeF64::from(&case.volume);
        let spheres = Spheres::new(&case.volume);
        // Offsets about the point may be beyond f32.
        let relative = RelativeVolume::about(case.point, &case.volume).ok();
        let cubes: Vec<Aabb> = case.items.iter().map(sphere_cube).collect();
        let (items, input) = (&case.items, Input::new(&cubes).spheres(true));
        let boxes = (items, found.built(structures, Input::new(items)));
        let cubes = (&cubes, found.built(structures, input));
        let relative = relative.as_ref().map(AnyVolume::from);
        let views: [(&str, Option<AnyVolume>, _); 5] = [
            ("six-plane", Some((&case.volume).into()), &boxes),
            ("six-plane f64", Some((&wide).into()), &boxes),
            ("six-plane f32-relative", relative, &boxes),
            ("sphere", Some((&spheres).into()), &cubes),
            ("locate", Some(case.point.into()), &boxes),
        ];
        for (name, view, (items, built)) in views {
            if let Some(view) = view {
                found.compare(built, name, view, items);
            }
        }
        found.described(|item| explain_visibility(&case.items[item], &case.volume))
    }

    /// The scalar loop against the oracle: without an epsilon it may drop what
    /// is no deeper than the roundings of the test itself, and it must never
    /// return what is wholly outside one plane by more.
    fn scalar(&self, case: &RandomCase, found: &mut Findings) {
        let subject = [SCALAR, "six-plane"];
        found.check(subject);
        if case.volume.planes().len() > MOST_PLANES {
            return;
        }
        let oracle = Oracle::of_volume(&case.volume);
        for (i, b) in case.items.iter().enumerate() {
            let seen = case.volume.sees(b);
            let verdict = oracle.verdict(b);
            let differs = || seen != sees_exactly(&case.volume, b);
            let is_deep =
                || verdict != Verdict::Out && oracle.depth(b) > roundings(&case.volume, b);
            let (expected, wrong) = match (self.exact, seen) {
                (true, _) => ("the answer without any rounding", differs()),
                (false, true) => ("no empty box", b.is_empty()),
                (false, false) => ("nothing dropped beyond the rounding error", is_deep()),
            };
            if wrong {
                let answer = if seen { "seen" } else { "dropped" };
                let got = format!("{answer}; the oracle: {verdict:?}");
                found.fault(subject, Some(i), expected, got);
                return;
            }
        }
    }
}

/// Error of evaluating a plane at the box, for unit length: 3
/// roundings of each product, one of the sum with d; 4 u of the magnitudes
/// and what underflows.
fn roundings(volume: &ConvexVolume, b: &Aabb) -> f64 {
    const UNIT_ROUNDOFF: f64 = 1.0 / (1u64 << 24) as f64;
    const TINY: f64 = f64::from_bits((1023 - 147) << 52);
    let reach = b.reach().as_dvec3();
    let planes = volume.planes().iter();
    let errors = planes.filter(|plane| plane.normal != Vec3::ZERO);
    let errors = errors.map(|plane| {
        let normal = plane.normal.as_dvec3();
        let size = normal.abs().dot(reach) + f64::from(plane.d).abs();
        (4.0 * UNIT_ROUNDOFF * size + TINY) / normal.length()
    });
    errors.fold(0.0, f64::max)
}
