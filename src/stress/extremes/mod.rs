//! Generated extremes: families of seeded cases with their outcome declared,
//! and the loop that runs them. Each file beside this one owns one part:
//! cameras, boxes, what counts as a fault, bare planes.

mod boxes;
mod cameras;
mod check;
mod volumes;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};

use super::{Level, Row, Section, Status, surroundings};
use crate::camera::Camera;
use crate::index::StructureSpec;
use crate::scene::SeededRng;

pub use boxes::Shapes;
use boxes::adversarial;
pub use cameras::{CAMERA_FAMILIES, CameraFamily, Draft};
pub use check::{Case, Drops, Fault, Findings, SCALAR, Tally};
pub use volumes::{PLANES_FAMILIES, PlanesCase, PlanesFamily};

/// Cases of each variant that make ten million boxes at camera level.
pub const DEFAULT_CASES: u64 = 66;

/// How many extremes to generate.
#[derive(Clone, Copy)]
pub struct Extremes<'a> {
    /// Structures that are queried.
    pub structures: &'a [StructureSpec],
    /// Seed of the first case of each variant.
    pub seed: u64,
    /// Cases of each variant.
    pub cases: u64,
    /// Cases worked on at once.
    pub threads: usize,
}

/// Boxes of one case.
pub const BOXES: usize = 2048;
/// Boxes that structures are built over: all in every so many cases, else few.
const ALL_EVERY: u64 = 16;
const FEW: usize = 256;

/// How the run goes on: told of each case, asked whether to stop.
pub trait Progress: Sync {
    /// A case of this family has been judged.
    fn case_done(&self, family: &str);
    /// Whether to leave out the cases that are left.
    fn stop(&self) -> bool;
}

impl Extremes<'_> {
    /// How many cases there will be, for a progress bar.
    pub fn total(&self) -> u64 {
        let variants: usize = CAMERA_FAMILIES.iter().map(|f| f.variants.len()).sum();
        let at_planes: u64 = PLANES_FAMILIES.iter().map(|f| f.factor).sum();
        (variants as u64 + at_planes) * self.cases
    }

    /// All families, a section each.
    pub fn run(&self, progress: &dyn Progress) -> Vec<Section> {
        let mut sections = Vec::new();
        for family in PLANES_FAMILIES {
            sections.push(self.planes_family(family, progress));
        }
        for family in CAMERA_FAMILIES {
            sections.push(self.camera_family(family, progress));
        }
        sections
    }

    /// Every variant of a family of cameras.
    pub fn camera_family(&self, family: &CameraFamily, progress: &dyn Progress) -> Section {
        let mut section = Section::new(&format!("generated {}", family.name));
        for &variant in family.variants {
            let label = (family.label)(variant);
            let group = format!("{}/{label}", family.name);
            let case = |nth: u64, seed: u64| {
                let case = match camera_case(family, variant, seed) {
                    Ok(case) => case,
                    Err(reason) => {
                        let mut findings = Findings::default();
                        findings.fault(SCALAR, "camera", None, "a camera with boxes", reason);
                        return Outcome::new(findings, |_| String::new());
                    }
                };
                let share = if nth.is_multiple_of(ALL_EVERY) {
                    BOXES
                } else {
                    FEW
                };
                let findings = case.check(self.structures, share);
                Outcome::new(findings, |item| case.describe(item))
            };
            let outcomes = self.share_out(family.name, self.cases, progress, case);
            self.gather(&mut section, Level::Camera, |_| group.clone(), outcomes);
        }
        section
    }

    /// Every case of a family at planes level.
    pub fn planes_family(&self, family: &PlanesFamily, progress: &dyn Progress) -> Section {
        let mut section = Section::new(&format!("generated {}", family.name));
        let cases = self.cases.saturating_mul(family.factor);
        let case = |_, seed| {
            let case = (family.case)(seed);
            let findings = case.check(self.structures);
            let mut outcome = Outcome::new(findings, |item| case.describe(item));
            outcome.kind = case.kind;
            outcome
        };
        let outcomes = self.share_out(family.name, cases, progress, case);
        let group = |outcome: &Outcome| match outcome.kind == family.name {
            true => family.name.to_owned(),
            false => format!("{}/{}", family.name, outcome.kind),
        };
        self.gather(&mut section, Level::Planes, group, outcomes);
        section
    }

    /// The cases of a group with their seeds, shared out among threads; what
    /// comes out does not depend on their number.
    fn share_out(
        &self,
        name: &str,
        cases: u64,
        progress: &dyn Progress,
        case: impl Fn(u64, u64) -> Outcome + Sync,
    ) -> Vec<(u64, Outcome)> {
        let next = AtomicU64::new(0);
        let work = || {
            let mut done = Vec::new();
            loop {
                let nth = next.fetch_add(1, Ordering::Relaxed);
                if nth >= cases || progress.stop() {
                    return done;
                }
                let seed = self.seed.wrapping_add(nth);
                done.push((seed, case(nth, seed)));
                progress.case_done(name);
            }
        };
        let mut done = std::thread::scope(|scope| {
            let others: Vec<_> = (1..self.threads).map(|_| scope.spawn(work)).collect();
            let mut done = work();
            for other in others {
                match other.join() {
                    Ok(more) => done.extend(more),
                    Err(panic) => std::panic::resume_unwind(panic),
                }
            }
            done
        });
        done.sort_by_key(|(seed, _)| seed.wrapping_sub(self.seed));
        done
    }

    /// Rows of a group: one for each question that came out well every time,
    /// and for each fault one with its seed.
    fn gather(
        &self,
        section: &mut Section,
        level: Level,
        group: impl Fn(&Outcome) -> String,
        outcomes: Vec<(u64, Outcome)>,
    ) {
        let mut sums: BTreeMap<(String, String, String), Sum> = BTreeMap::new();
        for (seed, outcome) in outcomes {
            let name = group(&outcome);
            section.cases += 1;
            section.boxes += outcome.findings.boxes;
            section.tally += outcome.findings.tally;
            for (structure, test) in outcome.findings.asked {
                let sum = sums.entry((name.clone(), structure, test)).or_default();
                sum.cases += 1;
            }
            for (fault, about) in outcome.findings.faults.iter().zip(&outcome.described) {
                let key = (name.clone(), fault.structure.clone(), fault.test.clone());
                sums.entry(key).or_default().failed = true;
                let id = format!("{name}/seed {seed}");
                section
                    .rows
                    .extend(rows_of(&id, level, fault, about.as_deref()));
            }
        }
        for ((name, structure, test), sum) in sums {
            if sum.failed {
                continue;
            }
            let expected = match (structure.as_str(), level) {
                (SCALAR, Level::Camera) => "drops nothing that is inside or touches",
                (SCALAR, Level::Planes) => "drops nothing but what rounding hides",
                _ => "returns the very set of the scalar loop",
            };
            section.rows.push(Row {
                id: format!("{name}/from seed {}", self.seed),
                level,
                structure,
                test,
                status: Status::Pass,
                expected: expected.into(),
                got: format!("so in all of {} cases", sum.cases).into(),
            });
        }
    }
}

/// The case of a family's variant and seed; the same on every machine.
///
/// # Errors
/// A camera that cannot be made, in words.
pub fn camera_case(family: &CameraFamily, variant: f64, seed: u64) -> Result<Case, String> {
    // Each seed means another camera in every variant.
    let name = family.name.bytes().chain(variant.to_bits().to_le_bytes());
    let words = name.fold(seed, |hash, byte| {
        hash.rotate_left(9).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ u64::from(byte)
    });
    let rng = &mut SeededRng::new(words);
    let draft = family.draft(rng, variant);
    let (lens, pose) = (draft.lens(), draft.pose());
    let lens = lens.map_err(|error| error.to_string())?;
    let frame = pose.frame().map_err(|error| error.to_string())?;
    let camera = Camera { frame, lens };
    let mut around = surroundings(&[]);
    around.origin = draft.origin;
    let items = adversarial(rng, &camera, &around, draft.shapes, BOXES);
    let items = items.ok_or("a lens without corners")?;
    around.reach = surroundings(&items).reach;
    let case = Case::new(camera, &pose, draft.planes, around, items);
    case.ok_or_else(|| "the oracle has no such camera".to_owned())
}

/// A case that was run.
struct Outcome {
    findings: Findings,
    /// The box of each fault that is about one.
    described: Vec<Option<String>>,
    kind: &'static str,
}

impl Outcome {
    fn new(findings: Findings, describe: impl Fn(usize) -> String) -> Outcome {
        let faults = findings.faults.iter();
        let described = faults.map(|fault| fault.item.map(&describe)).collect();
        Outcome {
            findings,
            described,
            kind: "",
        }
    }
}

/// Questions of one kind.
#[derive(Default)]
struct Sum {
    cases: u64,
    failed: bool,
}

/// A row for a fault, and one for the box it is about.
fn rows_of(id: &str, level: Level, fault: &Fault, about: Option<&str>) -> Vec<Row> {
    let row = Row {
        id: id.to_owned(),
        level,
        structure: fault.structure.clone(),
        test: fault.test.clone(),
        status: Status::Fail,
        expected: fault.expected.as_str().into(),
        got: fault.got.as_str().into(),
    };
    let mut rows = vec![row.clone()];
    if let (Some(item), Some(about)) = (fault.item, about) {
        rows.push(Row {
            id: format!("{id}/box {item}"),
            got: about.into(),
            ..row
        });
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::Registry;

    /// Goes on to the end.
    struct Quiet;

    impl Progress for Quiet {
        fn case_done(&self, _family: &str) {}
        fn stop(&self) -> bool {
            false
        }
    }

    #[test]
    fn the_default_run_judges_ten_million_boxes() {
        let variants: usize = CAMERA_FAMILIES.iter().map(|f| f.variants.len()).sum();
        assert!(variants as u64 * BOXES as u64 * DEFAULT_CASES >= 10_000_000);
    }

    /// A draw that is refused must not be drawn again from numbers that stay.
    #[test]
    fn every_seed_draws_a_camera() {
        for family in CAMERA_FAMILIES {
            for &variant in family.variants {
                for seed in 0..300 {
                    let draft = family.draft(&mut SeededRng::new(seed), variant);
                    assert!(draft.lens().is_ok(), "{} {variant:e} {seed}", family.name);
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
        let sections = extremes.run(&Quiet);
        let alone = Extremes {
            threads: 1,
            ..extremes
        }
        .run(&Quiet);
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
        // Otherwise the boxes were too easy and the zeros above mean nothing.
        let cameras = &sections[PLANES_FAMILIES.len()..];
        let mut off = Vec::new();
        for section in cameras {
            let Tally { boxes, seen, .. } = section.tally;
            // At 1e15 from zero f32 has few places left between in and out.
            let least = match section.name.ends_with("offset") {
                true => boxes / 6,
                false => boxes / 5,
            };
            if !(seen > least && seen * 5 < boxes * 4) {
                off.push(format!("{}: {seen} of {boxes}", section.name));
            }
        }
        assert!(off.is_empty(), "{off:?}");
        let bare: u64 = cameras.iter().map(|s| s.tally.lost_bare).sum();
        let boxes: u64 = cameras.iter().map(|s| s.tally.boxes).sum();
        assert!(bare * 200 > boxes, "{bare} of {boxes} need the epsilon");
    }
}
