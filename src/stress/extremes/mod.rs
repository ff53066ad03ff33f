//! Generated extremes: families of seeded cases, and the loop that runs them.
//!
//! Each case declares its expected outcome.

mod cameras;
mod check;
mod volumes;

use std::collections::{BTreeMap, BTreeSet};

use super::{Level, Row, Section, Status};
use crate::camera::{Camera, Surroundings};
use crate::geometry::Aabb;
use crate::index::StructureSpec;
use crate::scene::SeededRng;
use crate::threads;
use crate::verify::VOLUME_KINDS;

use cameras::adversarial;
pub use cameras::{CAMERA_FAMILIES, CameraBuilder, CameraFamily, Shapes};
pub(crate) use check::SCALAR;
pub use check::{Case, Fault, Findings, VerdictCounts};
pub use volumes::{PLANES_FAMILIES, PlanesFamily};

/// Cases per variant for ten million boxes at camera level.
pub const DEFAULT_CASES: u64 = 66;

/// Parameters of a run of generated extremes.
#[derive(Clone, Copy)]
pub struct Extremes<'a> {
    /// Structures under test.
    pub structures: &'a [StructureSpec],
    /// Seed of the first case of each variant.
    pub seed: u64,
    /// Cases per variant.
    pub cases: u64,
    /// Number of cases run concurrently.
    pub threads: usize,
}

/// Boxes of one case.
pub const BOXES: usize = 2048;
/// One case in `ALL_EVERY` builds structures over all boxes, the others over `FEW`.
const ALL_EVERY: u64 = 16;
const FEW: usize = 256;

/// Called with the family before each case; returns true to skip the rest.
pub type Progress<'a> = &'a (dyn Fn(&str) -> bool + Sync);

/// Total number of cases, for a progress bar.
pub fn total(cases: u64) -> u64 {
    let variants: usize = CAMERA_FAMILIES.iter().map(|f| f.variants.len()).sum();
    let at_planes: u64 = PLANES_FAMILIES.iter().map(|f| f.factor).sum();
    (variants as u64 + at_planes) * cases
}

impl Extremes<'_> {
    /// Runs all families; returns one section per family.
    pub fn run(&self, progress: Progress) -> Vec<Section> {
        let (planes, cameras) = (PLANES_FAMILIES.iter(), CAMERA_FAMILIES.iter());
        let planes = planes.map(|family| self.planes_family(family, progress));
        let cameras = cameras.map(|family| self.camera_family(family, progress));
        planes.chain(cameras).collect()
    }

    fn camera_family(&self, family: &CameraFamily, progress: Progress) -> Section {
        let mut section = Section::new(&format!("generated {}", family.name));
        for &variant in family.variants {
            let group = format!("{}/{}", family.name, (family.label)(variant));
            let of = (family.name, Level::Camera);
            self.add_cases(&mut section, of, self.cases, progress, |nth, seed| {
                let has_all = nth.is_multiple_of(ALL_EVERY);
                let share = if has_all { BOXES } else { FEW };
                let case = camera_case(family, variant, seed);
                let findings = case.map(|case| case.check(self.structures, share));
                let findings = findings.unwrap_or_else(Findings::without_case);
                (group.clone(), findings)
            });
        }
        section
    }

    fn planes_family(&self, family: &PlanesFamily, progress: Progress) -> Section {
        let mut section = Section::new(&format!("generated {}", family.name));
        let cases = self.cases.saturating_mul(family.factor);
        let of = (family.name, Level::Planes);
        self.add_cases(&mut section, of, cases, progress, |_, seed| {
            let case = (family.case)(seed);
            let group = match family.exact {
                true => family.name.to_owned(),
                false => format!("{}/{}", family.name, VOLUME_KINDS[case.kind]),
            };
            (group, family.check(&case, self.structures))
        });
        section
    }

    /// Runs cases of a family by number and seed on all threads.
    ///
    /// Adds a row for each fault with its seed, in the order of the seeds, and one row for each
    /// structure and test of a group without a fault.
    fn add_cases(
        &self,
        section: &mut Section,
        (name, level): (&str, Level),
        cases: u64,
        progress: Progress,
        case: impl Fn(u64, u64) -> (String, Findings) + Sync,
    ) {
        let numbers = (0..cases).take_while(|_| !progress(name));
        let outcomes = threads::map(self.threads, numbers, |nth| {
            let seed = self.seed.wrapping_add(nth);
            (seed, case(nth, seed))
        });
        let mut checked: BTreeMap<[String; 3], u64> = BTreeMap::new();
        let mut failed = BTreeSet::new();
        let row = |id, [structure, test]: [String; 2], status, expected, got: String| Row {
            id,
            level,
            structure,
            test,
            status,
            expected,
            got: got.into(),
            kernel: None,
        };
        for (seed, (group, findings)) in outcomes {
            section.cases += 1;
            section.boxes += findings.boxes;
            section.verdicts += findings.verdicts;
            for [structure, test] in findings.checked {
                *checked.entry([group.clone(), structure, test]).or_default() += 1;
            }
            for fault in findings.faults {
                let [structure, test] = fault.subject.clone();
                failed.insert([group.clone(), structure, test]);
                let (subject, expected) = (&fault.subject, &fault.expected);
                let fail = |id, got| row(id, subject.clone(), Status::Fail, expected.clone(), got);
                let id = format!("{group}/seed {seed}");
                let of_box = fault.item.map(|item| format!("{id}/box {item}"));
                let of_box = of_box.zip(fault.about);
                section.rows.push(fail(id, fault.got));
                let of_box = of_box.map(|(id, about)| fail(id, about));
                section.rows.extend(of_box);
            }
        }
        checked.retain(|key, _| !failed.contains(key));
        for ([group, structure, test], cases) in checked {
            let expected = match (structure.as_str(), level) {
                (SCALAR, Level::Camera) => "drops nothing that is inside or touches",
                (SCALAR, Level::Planes) => "drops nothing beyond the rounding error",
                _ => "returns exactly the set of the scalar loop",
            };
            let id = format!("{group}/from seed {}", self.seed);
            let (expected, got) = (expected.into(), format!("so in all of {cases} cases"));
            let passed = row(id, [structure, test], Status::Pass, expected, got);
            section.rows.push(passed);
        }
    }
}

/// Case of a family's variant and seed; the same on every machine.
///
/// # Errors
/// A camera that cannot be made, in words.
pub fn camera_case(family: &CameraFamily, variant: f64, seed: u64) -> Result<Case, String> {
    // A seed gives another camera in every variant.
    let name = family.name.bytes().chain(variant.to_bits().to_le_bytes());
    let words = name.fold(seed, |hash, byte| {
        hash.rotate_left(9).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ u64::from(byte)
    });
    let rng = &mut SeededRng::new(words);
    let builder = family.builder(rng, variant);
    let lens = builder.lens().map_err(|error| error.to_string())?;
    let frame = builder.pose().frame().map_err(|error| error.to_string())?;
    let camera = Camera { frame, lens };
    let mut around = Surroundings {
        origin: builder.origin,
        ..Surroundings::default()
    };
    let items = adversarial(rng, &camera, &around, builder.shapes, BOXES);
    let items = items.ok_or("a lens without corners")?;
    around.reach = Aabb::union_of(&items).reach();
    let case = Case::new(camera, builder.planes, around, items);
    case.ok_or_else(|| "the oracle has no such camera".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::Registry;

    #[test]
    fn the_default_run_judges_ten_million_boxes() {
        let variants: usize = CAMERA_FAMILIES.iter().map(|f| f.variants.len()).sum();
        assert!(variants as u64 * BOXES as u64 * DEFAULT_CASES >= 10_000_000);
    }

    /// A refused draw must be followed by a draw from different random numbers.
    #[test]
    fn every_seed_draws_a_camera() {
        for family in CAMERA_FAMILIES {
            for &variant in family.variants {
                for seed in 0..300 {
                    let builder = family.builder(&mut SeededRng::new(seed), variant);
                    assert!(builder.lens().is_ok(), "{} {variant:e} {seed}", family.name);
                }
            }
        }
    }

    #[test]
    fn a_case_of_every_variant_comes_out_as_declared() {
        let structures = Registry::builtin().structures("all").unwrap();
        let extremes = Extremes {
            structures: &structures,
            seed: 5,
            cases: 1,
            threads: 2,
        };
        let sections = extremes.run(&|_| false);
        let alone = Extremes {
            threads: 1,
            ..extremes
        }
        .run(&|_| false);
        for (section, alone) in sections.iter().zip(&alone) {
            assert_eq!(section.rows, alone.rows, "threads change nothing");
            assert!(
                section.cases > 0 && !section.rows.is_empty(),
                "{}",
                section.name
            );
            let failed = section.rows.iter().find(|row| row.status == Status::Fail);
            assert!(failed.is_none(), "{failed:?}");
        }
        // Otherwise the boxes are too easy and the zeros above are meaningless.
        let cameras = &sections[PLANES_FAMILIES.len()..];
        let mut off = Vec::new();
        for section in cameras {
            let (boxes, seen) = (section.verdicts.boxes, section.verdicts.errors.visible);
            // At 1e15 from the origin f32 leaves few positions between in and out.
            let least = match section.name.ends_with("offset") {
                true => boxes / 6,
                false => boxes / 5,
            };
            if !(seen > least && seen * 5 < boxes * 4) {
                off.push(format!("{}: {seen} of {boxes}", section.name));
            }
        }
        assert!(off.is_empty(), "{off:?}");
        let bare: u64 = cameras
            .iter()
            .map(|s| s.verdicts.lost_without_epsilon)
            .sum();
        let boxes: u64 = cameras.iter().map(|s| s.verdicts.boxes).sum();
        assert!(bare * 200 > boxes, "{bare} of {boxes} need the epsilon");
    }
}
