//! Extremes at planes level.
//!
//! Unbounded volumes, volumes with many planes and empty ones; inverted, flat and coincident boxes;
//! and numbers so small that flushing them to zero would change the answer.

use glam::Vec3;

use super::check::{Findings, SCALAR};
use crate::geometry::{
    Aabb, ConvexVolume, ConvexVolumeF64, Plane, RelativeVolume, Spheres, sphere_cube,
};
use crate::index::{Input, StructureSpec};
use crate::oracle::{Oracle, Verdict};
use crate::query::AnyVolume;
use crate::scene::SeededRng;
use crate::stress::level_results::sees_exactly;
use crate::verify::{RandomCase, explain_visibility};

/// A family of cases at planes level.
pub struct PlanesFamily {
    /// Name in the table of results.
    pub name: &'static str,
    /// Generates the case of a seed.
    pub case: fn(u64) -> RandomCase,
    /// Number of cases per case of a camera variant.
    pub factor: u64,
    /// True if every operation of the plane test is exact; then its answer must be too.
    pub exact: bool,
}

/// All families at planes level, in the order of the table of results.
pub static PLANES_FAMILIES: &[PlanesFamily] = rows! { PlanesFamily { name, factor, exact, case }
    // Every kind of volume (unbounded, empty, up to 31 planes), with flat, inverted and touching
    // boxes.
    "volumes", 20, false, RandomCase::new;
    // Planes and boxes of denormal numbers: nothing may be flushed to zero.
    "denormals", 2, true, denormals;
};

/// Case of denormal numbers on which no operation rounds.
///
/// Normals are -1, 0 and 1; offsets and bounds are integer multiples of the least number.
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
/// Most planes of a volume for which the oracle is affordable: O(m^4).
const MOST_PLANES: usize = 12;

impl PlanesFamily {
    /// Checks every structure with every kind of view of the planes, and the point.
    pub fn check(&self, case: &RandomCase, structures: &[StructureSpec]) -> Findings {
        let mut found = Findings {
            boxes: case.items.len() as u64,
            ..Findings::default()
        };
        self.scalar(case, &mut found);
        let wide = ConvexVolumeF64::from(&case.volume);
        let spheres = Spheres::new(&case.volume);
        // Offsets relative to the point may overflow f32.
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

    /// Compares the scalar loop with the oracle.
    ///
    /// Without an epsilon it may drop only boxes that are no deeper than the rounding of the test
    /// itself, and it must not return an empty box. In an exact family it must give the answer
    /// without any rounding. Skips volumes of more than [`MOST_PLANES`] planes.
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

/// Error of evaluating a plane at the box, divided by the normal's length.
///
/// 3 roundings of each product, one of the sum with d: 4 u of the magnitudes, and underflow.
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
