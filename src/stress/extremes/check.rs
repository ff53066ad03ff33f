//! Checks of one generated case, and the faults they find.
//!
//! Compares every structure and culling test on the boxes of a case with the scalar loop and the
//! oracle.

use glam::DVec3;

use crate::camera::{Camera, CameraError, PlaneOptions, Surroundings};
use crate::culling::{Arithmetic, Culling, CullingError, CullingTest};
use crate::geometry::Aabb;
use crate::index::{DynIndex, Input, StructureSpec};
use crate::oracle::Verdict;
use crate::query::{AnyVolume, ItemId};
use crate::stress::Answer;
use crate::stress::level_results::slack;
use crate::verify::{self, ErrorCount, Trial, Truth, scan};

/// Name of the scalar loop in the column of structures.
pub const SCALAR: &str = "scalar";

/// Sums over cases.
#[derive(Clone, Copy, Default, PartialEq, Debug)]
pub struct VerdictCounts {
    /// Boxes with a verdict at camera level.
    pub boxes: u64,
    /// Boxes that touch the volume or are too close to decide.
    pub ties: u64,
    /// Visible boxes, and those that tests with a margin lost.
    pub errors: ErrorCount,
    /// Views that were refused because their sums could overflow.
    pub refused: u64,
    /// Boxes that the six-plane test would lose without its epsilon.
    pub lost_without_epsilon: u64,
}

impl std::ops::AddAssign for VerdictCounts {
    fn add_assign(&mut self, other: VerdictCounts) {
        self.boxes += other.boxes;
        self.ties += other.ties;
        self.errors += other.errors;
        self.refused += other.refused;
        self.lost_without_epsilon += other.lost_without_epsilon;
    }
}

/// A wrong answer, or a missing one.
#[derive(Clone, PartialEq, Debug)]
pub struct Fault {
    /// Structure and test.
    pub subject: [String; 2],
    /// Index of the box; `None` if the whole answer is wrong.
    pub item: Option<usize>,
    /// Expected answer.
    pub expected: Answer,
    /// Actual answer.
    pub got: String,
    /// Description of the box and its truth, so that a reader can check by hand.
    pub about: Option<String>,
}

/// Structures with their labels, built over the boxes of a case.
pub type Built<'s> = Vec<(&'s str, Box<dyn DynIndex>)>;

/// Checks of one case and their faults.
#[derive(Clone, Default, Debug)]
pub struct Findings {
    /// Number of boxes.
    pub boxes: u64,
    /// Verdicts of the oracle at camera level.
    pub verdicts: VerdictCounts,
    /// Structure and test of each check.
    pub checked: Vec<[String; 2]>,
    /// Faults in the order found.
    pub faults: Vec<Fault>,
}

impl Findings {
    /// Findings for a camera that could not be made, with the reason.
    pub fn without_case(reason: String) -> Findings {
        let mut found = Findings::default();
        found.fault([SCALAR, "camera"], None, "a camera with boxes", reason);
        found
    }

    /// Records a check of a structure, or of the scalar loop, by a test.
    pub fn check(&mut self, subject: [&str; 2]) {
        self.checked.push(subject.map(str::to_owned));
    }

    /// Records a fault.
    pub fn fault(
        &mut self,
        subject: [&str; 2],
        item: Option<usize>,
        expected: impl Into<Answer>,
        got: String,
    ) {
        self.faults.push(Fault {
            subject: subject.map(str::to_owned),
            item,
            expected: expected.into(),
            got,
            about: None,
        });
    }

    /// Builds all structures; a failed build is a fault.
    pub fn built<'s>(&mut self, structures: &'s [StructureSpec], input: Input<'_>) -> Built<'s> {
        let mut built = Vec::with_capacity(structures.len());
        for spec in structures {
            match spec.build(input) {
                Ok(index) => built.push((spec.label.as_str(), index)),
                Err(error) => self.fault([&spec.label, "build"], None, "built", error.to_string()),
            }
        }
        built
    }

    /// Compares every structure with the scalar loop over the same items.
    pub fn compare(&mut self, built: &Built, test: &str, volume: AnyVolume<'_>, items: &[Aabb]) {
        let mut trial = Trial::new(items.len());
        trial.set_view(items, volume);
        for (structure, index) in built {
            self.check([structure, test]);
            let answer = trial.run(|out| index.query(volume, out)).map(drop);
            let Err(fault) = answer else { continue };
            let expected = format!("the {} items of the scalar loop", trial.expected);
            let (expected, first) = match &fault {
                verify::Fault::Panicked(_) => ("an answer".to_owned(), None),
                verify::Fault::Differs(difference) => (expected, difference.first),
            };
            let item = first.map(|id| id as usize).filter(|&id| id < items.len());
            self.fault([structure, test], item, expected, fault.explained(|_| None));
        }
    }

    /// Adds a description to each fault of a box.
    pub fn described(mut self, describe: impl Fn(usize) -> String) -> Findings {
        for fault in &mut self.faults {
            fault.about = fault.item.map(&describe);
        }
        self
    }
}

/// A camera with boxes and the truth about them.
pub struct Case {
    /// Camera of the view.
    pub camera: Camera,
    /// Derivation of its planes.
    pub planes: PlaneOptions,
    /// Extent of the scene around it, for the epsilon.
    pub around: Surroundings,
    /// Boxes to be culled, in scene coordinates.
    pub items: Vec<Aabb>,
    truth: Truth,
}

impl Case {
    /// Computes the truth about each box. O(items). `None` if the pose has no frame.
    pub fn new(
        camera: Camera,
        planes: PlaneOptions,
        around: Surroundings,
        items: Vec<Aabb>,
    ) -> Option<Case> {
        let truth = Truth::of_camera(&camera, around.origin, &items)?;
        Some(Case {
            camera,
            planes,
            around,
            items,
            truth,
        })
    }

    /// Errors of a test that returns these items.
    pub fn errors(&self, seen: &[ItemId]) -> ErrorCount {
        self.truth.errors(&self.items, seen)
    }

    /// Checks every culling test and every structure.
    ///
    /// Structures are built over the first `share` items.
    pub fn check(&self, structures: &[StructureSpec], share: usize) -> Findings {
        let verdicts = self.truth.verdicts.iter();
        let boxes = self.items.len() as u64;
        let mut found = Findings {
            boxes,
            verdicts: VerdictCounts {
                boxes,
                ties: verdicts.filter(|v| **v == Verdict::Touch).count() as u64,
                errors: self.truth.visible,
                ..VerdictCounts::default()
            },
            ..Findings::default()
        };
        let share = share.min(self.items.len());
        let cubes = CullingTest::Sphere.items(&self.items);
        let items = &self.items[..];
        let boxes = (items, found.built(structures, Input::new(&items[..share])));
        let input = Input::new(&cubes[..share]).spheres(true);
        let spheres = (&cubes[..], found.built(structures, input));
        for culling in Culling::all(self.planes) {
            let (test, numbers) = (culling.test, culling.arithmetic);
            let name = match numbers {
                Arithmetic::F32 => test.name().to_owned(),
                _ => format!("{} {}", test.name(), numbers.name()),
            };
            let (items, built) = match test {
                CullingTest::Sphere => &spheres,
                _ => &boxes,
            };
            match culling.view(&self.camera, &self.around) {
                Ok(view) => {
                    let view = view.as_any();
                    let seen: Vec<ItemId> = scan(items, |b| view.sees(b)).collect();
                    self.scalar(&culling, &name, &seen, &mut found);
                    found.compare(built, &name, view, &items[..share]);
                }
                Err(error) if self.may_refuse(&error) => found.verdicts.refused += 1,
                Err(error) => found.fault([SCALAR, &name], None, "a view", error.to_string()),
            }
        }
        self.check_without_epsilon(&boxes.1, &cubes, share, &mut found);
        found.described(|item| self.describe(item))
    }

    /// Returns true for a permitted refusal: a view whose sums could overflow.
    fn may_refuse(&self, error: &CullingError) -> bool {
        match error {
            CullingError::Camera(CameraError::Sums { .. }) => true,
            CullingError::Camera(CameraError::Volume(_)) => self.size() > HUGE,
            _ => false,
        }
    }

    /// Checks the tests without epsilon.
    ///
    /// The boxes lie within ulps of these planes, so structures that round differently are revealed
    /// here.
    fn check_without_epsilon(
        &self,
        built: &Built,
        cubes: &[Aabb],
        share: usize,
        found: &mut Findings,
    ) {
        let view = |test| {
            let planes = self.planes.without_epsilon();
            Culling::new(test, Arithmetic::F32, planes).view(&self.camera, &self.around)
        };
        let Ok(six) = view(CullingTest::SixPlane) else {
            return;
        };
        let six = six.as_any();
        let seen: Vec<ItemId> = scan(&self.items, |b| six.sees(b)).collect();
        found.verdicts.lost_without_epsilon = self.errors(&seen).dropped();
        found.compare(built, "six-plane epsilon 0", six, &self.items[..share]);
        let Ok(sphere) = view(CullingTest::Sphere) else {
            return;
        };
        // A sphere contains its box: it must be visible if the box is.
        let subject = [SCALAR, "sphere epsilon 0"];
        found.check(subject);
        let mut seen = seen.into_iter().map(|id| id as usize);
        let lost = seen.find(|&id| !sphere.as_any().sees(&cubes[id]));
        if lost.is_some() {
            let expected = "all that the six planes see";
            found.fault(subject, lost, expected, "dropped".to_owned());
        }
    }

    /// Checks which items the scalar loop loses.
    fn scalar(&self, culling: &Culling, name: &str, seen: &[ItemId], found: &mut Findings) {
        found.check([SCALAR, name]);
        let errors = self.errors(seen);
        let is_ghost = |id: &&ItemId| self.items[**id as usize].is_empty();
        let ghosts = seen.iter().filter(is_ghost).count();
        let allowed = self.size() * F64_MARGIN;
        let (lost, expected) = match culling.arithmetic {
            // Without a margin, f64 is only as accurate as its own rounding. Planes that are sums
            // of others have lost digits; they are measured, not checked.
            Arithmetic::F64 => {
                let judged = culling.test == CullingTest::SixPlane;
                let text = format!("nothing dropped that is deeper than {allowed:e}");
                (judged && errors.worst_miss > allowed, text)
            }
            _ => {
                found.verdicts.errors.false_negatives += errors.false_negatives;
                found.verdicts.errors.touch_dropped += errors.touch_dropped;
                let text = "nothing dropped that is inside or touches, nothing empty returned";
                (errors.dropped() > 0, text.to_owned())
            }
        };
        if lost || ghosts > 0 {
            let is_wrong = |&(id, verdict, seen): &(usize, Verdict, bool)| match seen {
                true => self.items[id].is_empty(),
                false => verdict != Verdict::Out,
            };
            let first = self.truth.answered(seen).find(is_wrong);
            let got = format!(
                "{} false negatives (deepest {:e}), {} boundary contacts dropped, {} empty boxes returned",
                errors.false_negatives, errors.worst_miss, errors.touch_dropped, ghosts
            );
            found.fault([SCALAR, name], first.map(|found| found.0), expected, got);
        }
        if culling.test == CullingTest::Exact && culling.arithmetic == Arithmetic::F32 {
            self.tight(name, seen, found);
        }
    }

    /// Checks that the exact test returns nothing that is out by more than its margin.
    fn tight(&self, name: &str, seen: &[ItemId], found: &mut Findings) {
        let mut out = self.truth.answered(seen).filter_map(|(i, verdict, seen)| {
            let b = &self.items[i];
            let is_extra = seen && verdict == Verdict::Out && !b.is_empty();
            let away = is_extra.then(|| -self.truth.depth(i, b))?;
            let margin = slack(&self.camera, &self.around, b);
            (away > margin).then_some((i, away, margin))
        });
        if let Some((i, away, margin)) = out.next() {
            let expected = format!("nothing returned that is farther out than {margin:e}");
            found.fault([SCALAR, name], Some(i), expected, format!("{away:e} out"));
        }
    }

    /// Magnitude that f64 rounds: the coordinates of eye, volume and boxes.
    fn size(&self) -> f64 {
        let eye = self.camera.frame.eye;
        let own = (eye.abs() + (eye - self.around.origin).abs()).element_sum();
        let depth = self.camera.lens.far().unwrap_or(0.0);
        own + depth + self.around.reach.as_dvec3().element_sum()
    }

    /// Describes the box and its truth, so that a reader can check by hand.
    pub fn describe(&self, item: usize) -> String {
        let b = &self.items[item];
        format!(
            "box {:?} to {:?} is {:?} by {:e}; {:?}, scene origin {:?}",
            b.min.to_array(),
            b.max.to_array(),
            self.truth.verdicts[item],
            self.truth.depth(item, b),
            self.camera,
            DVec3::to_array(&self.around.origin),
        )
    }
}

/// Error of a plane test in f64, relative to the magnitudes.
///
/// A normal of unit length is accurate to a few units of 2^-53 in each component, the offset is a
/// dot product of it with the eye, and the test itself rounds seven times. 2^-48 is twice the sum.
const F64_MARGIN: f64 = 1.0 / (1u64 << 48) as f64;

/// Planes of volumes this large may not fit f32.
const HUGE: f64 = 1e38;
