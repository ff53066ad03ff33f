//! One generated case under test: what every structure and culling test makes
//! of its boxes, against the scalar loop and the oracle. It defines what counts
//! as a fault; cameras and boxes come from the files beside it.

use glam::DVec3;

use crate::camera::{Camera, CameraError, PlaneMethod, PlaneOptions, Surroundings};
use crate::culling::{ARITHMETICS, Arithmetic, Culling, CullingError, CullingTest, TESTS};
use crate::geometry::Aabb;
use crate::index::{DynIndex, StructureSpec};
use crate::oracle::{Judgement, Oracle, Pose, Verdict};
use crate::query::{AnyVolume, ItemId};
use crate::stress::slack;
use crate::verify::{self, Trial};

/// The rows of the scalar loop have this in place of a structure.
pub const SCALAR: &str = "scalar";

/// A camera with boxes and the truth about them.
pub struct Case {
    /// The camera that is culled for.
    pub camera: Camera,
    /// How its planes are derived.
    pub planes: PlaneOptions,
    /// Size of the scene about it, for the epsilon.
    pub around: Surroundings,
    /// Boxes to be culled, in scene coordinates.
    pub items: Vec<Aabb>,
    oracle: Oracle,
    judgements: Vec<Judgement>,
}

/// What an answer lost.
#[derive(Clone, Copy, Default, PartialEq, Debug)]
pub struct Drops {
    /// Boxes that reach into the view and were not returned.
    pub false_negatives: u64,
    /// Boxes that touch the view and were not returned.
    pub touch_dropped: u64,
    /// Empty boxes that were returned.
    pub ghosts: u64,
    /// The first item concerned.
    pub first: Option<usize>,
    /// How deep the deepest false negative reaches into the volume.
    pub deepest: f64,
}

/// Sums over cases.
#[derive(Clone, Copy, Default, PartialEq, Debug)]
pub struct Tally {
    /// Boxes judged at camera level.
    pub boxes: u64,
    /// Boxes that are in or touch.
    pub seen: u64,
    /// Boxes that touch, to all that is known.
    pub ties: u64,
    /// Ties that the oracle cannot prove.
    pub undecided: u64,
    /// Boxes that reach into the view and were not returned.
    pub false_negatives: u64,
    /// Boxes that touch the view and were not returned.
    pub touch_dropped: u64,
    /// Views that were refused because their sums could overflow.
    pub refused: u64,
    /// What the six planes would lose without their epsilon.
    pub lost_bare: u64,
}

impl std::ops::AddAssign for Tally {
    fn add_assign(&mut self, other: Tally) {
        self.boxes += other.boxes;
        self.seen += other.seen;
        self.ties += other.ties;
        self.undecided += other.undecided;
        self.false_negatives += other.false_negatives;
        self.touch_dropped += other.touch_dropped;
        self.refused += other.refused;
        self.lost_bare += other.lost_bare;
    }
}

/// Something that must not be.
#[derive(Clone, PartialEq, Debug)]
pub struct Fault {
    /// Name of the structure, or [`SCALAR`].
    pub structure: String,
    /// Name of the culling test.
    pub test: String,
    /// Index of the box; `None` where the whole answer is wrong.
    pub item: Option<usize>,
    /// What the oracle says.
    pub expected: String,
    /// What the structure did.
    pub got: String,
}

/// The questions that were asked, and what came of it.
#[derive(Clone, Default, Debug)]
pub struct Findings {
    /// Boxes asked about.
    pub boxes: u64,
    /// What the oracle says of them at camera level.
    pub tally: Tally,
    /// Structure and test of every question.
    pub asked: Vec<(String, String)>,
    /// In the order in which they were found.
    pub faults: Vec<Fault>,
}

impl Case {
    /// Judges every box. O(items). None if the pose makes no camera.
    pub fn new(
        camera: Camera,
        pose: &Pose,
        planes: PlaneOptions,
        around: Surroundings,
        items: Vec<Aabb>,
    ) -> Option<Case> {
        let oracle = Oracle::of_camera(pose, &camera.lens, around.origin)?;
        let judgements = items.iter().map(|b| oracle.judge(b)).collect();
        Some(Case {
            camera,
            planes,
            around,
            items,
            oracle,
            judgements,
        })
    }

    /// What a test loses that sees these items.
    pub fn drops(&self, seen: &[bool]) -> Drops {
        let mut drops = Drops::default();
        for (i, (&seen, judgement)) in seen.iter().zip(&self.judgements).enumerate() {
            match (judgement.verdict, seen) {
                (Verdict::In, false) => {
                    drops.false_negatives += 1;
                    drops.deepest = drops.deepest.max(self.oracle.depth(&self.items[i]));
                }
                (Verdict::Touch, false) => drops.touch_dropped += 1,
                (_, true) if self.items[i].is_empty() => drops.ghosts += 1,
                _ => continue,
            }
            drops.first.get_or_insert(i);
        }
        drops
    }

    /// Puts every culling test and every structure to the test. Structures are
    /// built over the first `share` items.
    pub fn check(&self, structures: &[StructureSpec], share: usize) -> Findings {
        let mut found = Findings::default();
        let verdicts = self.judgements.iter();
        let count = |of: fn(&&Judgement) -> bool| verdicts.clone().filter(of).count() as u64;
        found.boxes = self.items.len() as u64;
        found.tally.boxes = found.boxes;
        found.tally.seen = count(|j| j.verdict != Verdict::Out);
        found.tally.ties = count(|j| j.verdict == Verdict::Touch);
        found.tally.undecided = count(|j| j.undecided);
        let share = share.min(self.items.len());
        let six = self.built(structures, &self.items[..share], &mut found);
        let cubes = CullingTest::Sphere.items(&self.items);
        let spheres = self.built(structures, &cubes[..share], &mut found);
        for (arithmetic, arithmetic_name, _) in ARITHMETICS {
            for (test, test_name, _) in TESTS {
                let is_f32 = arithmetic == Arithmetic::F32;
                let is_frame = self.planes.method == PlaneMethod::Frame;
                if !is_f32 && (test == CullingTest::Sphere || !is_frame) {
                    continue;
                }
                let name = match arithmetic {
                    Arithmetic::F32 => test_name.to_owned(),
                    _ => format!("{test_name} {arithmetic_name}"),
                };
                let culling = Culling {
                    test,
                    arithmetic,
                    planes: self.planes,
                };
                let view = match culling.view(&self.camera, &self.around) {
                    Ok(view) => view,
                    // Declared: what could overflow is refused in one line.
                    Err(CullingError::Camera(CameraError::Sums { .. })) => {
                        found.tally.refused += 1;
                        continue;
                    }
                    Err(CullingError::Camera(CameraError::Volume(_))) if self.size() > HUGE => {
                        found.tally.refused += 1;
                        continue;
                    }
                    Err(error) => {
                        found.fault(SCALAR, &name, None, "a view", error.to_string());
                        continue;
                    }
                };
                let (items, built) = match test {
                    CullingTest::Sphere => (&cubes[..], &spheres),
                    _ => (&self.items[..], &six),
                };
                let view = view.as_any();
                let seen: Vec<bool> = items.iter().map(|b| view.sees(b)).collect();
                self.scalar(&culling, &name, &seen, &mut found);
                ask(built, &name, view, &seen[..share], &self.items, &mut found);
            }
        }
        let bare = Culling {
            planes: PlaneOptions {
                epsilon: 0.0,
                ..self.planes
            },
            ..Culling::default()
        };
        if let Ok(view) = bare.view(&self.camera, &self.around) {
            let view = view.as_any();
            let seen: Vec<bool> = self.items.iter().map(|b| view.sees(b)).collect();
            let drops = self.drops(&seen);
            found.tally.lost_bare = drops.false_negatives + drops.touch_dropped;
            // The boxes are within ulps of these planes, not of the moved
            // ones: here structures that round otherwise show.
            let name = "six-plane epsilon 0";
            ask(&six, name, view, &seen[..share], &self.items, &mut found);
            // A sphere holds its box: what the box test sees it must see too.
            let bare = Culling {
                test: CullingTest::Sphere,
                ..bare
            };
            if let Ok(view) = bare.view(&self.camera, &self.around) {
                let name = "sphere epsilon 0";
                found.asked.push((SCALAR.to_owned(), name.to_owned()));
                let boxes = seen.iter().zip(&cubes[..]);
                let mut lost = boxes.map(|(seen, cube)| *seen && !view.as_any().sees(cube));
                if let Some(item) = lost.position(|lost| lost) {
                    let expected = "all that the six planes see";
                    found.fault(SCALAR, name, Some(item), expected, "dropped".to_owned());
                }
            }
        }
        found
    }

    fn built<'s>(
        &self,
        structures: &'s [StructureSpec],
        items: &[Aabb],
        found: &mut Findings,
    ) -> Vec<(&'s str, Box<dyn DynIndex>)> {
        let mut built = Vec::with_capacity(structures.len());
        for spec in structures {
            match spec.build(items) {
                Ok(index) => built.push((spec.label.as_str(), index)),
                Err(error) => {
                    found.fault(&spec.label, "build", None, "built", error.to_string());
                }
            }
        }
        built
    }

    /// What the scalar loop may and may not lose.
    fn scalar(&self, culling: &Culling, name: &str, seen: &[bool], found: &mut Findings) {
        found.asked.push((SCALAR.to_owned(), name.to_owned()));
        let drops = self.drops(seen);
        let promised = culling.arithmetic != Arithmetic::F64;
        // Without a margin f64 is as good as its own roundings. Planes that
        // are sums of others have lost digits; they are measured, not judged.
        let judged = promised || culling.test == CullingTest::SixPlane;
        let allowed = self.size() * F64_MARGIN;
        let lost = if promised {
            found.tally.false_negatives += drops.false_negatives;
            found.tally.touch_dropped += drops.touch_dropped;
            drops.false_negatives + drops.touch_dropped > 0
        } else {
            judged && drops.deepest > allowed
        };
        if lost || drops.ghosts > 0 {
            let expected = match promised {
                true => {
                    "nothing dropped that is inside or touches, nothing empty returned".to_owned()
                }
                false => format!("nothing dropped that is deeper than {allowed:e}"),
            };
            let got = format!(
                "{} false negatives (deepest {:e}), {} boundary contacts dropped, {} empty boxes returned",
                drops.false_negatives, drops.deepest, drops.touch_dropped, drops.ghosts
            );
            found.fault(SCALAR, name, drops.first, &expected, got);
        }
        if culling.test == CullingTest::Exact && culling.arithmetic == Arithmetic::F32 {
            self.tight(name, seen, found);
        }
    }

    /// The exact test returns nothing that is out by more than its margin.
    fn tight(&self, name: &str, seen: &[bool], found: &mut Findings) {
        let extra = self
            .items
            .iter()
            .zip(&self.judgements)
            .zip(seen)
            .enumerate();
        for (i, ((b, judgement), &seen)) in extra {
            if !seen || judgement.verdict != Verdict::Out || b.is_empty() {
                continue;
            }
            let away = -self.oracle.depth(b);
            let margin = slack(&self.camera, &self.around, b);
            if away > margin {
                let expected = format!("nothing returned that is farther out than {margin:e}");
                found.fault(SCALAR, name, Some(i), &expected, format!("{away:e} out"));
                return;
            }
        }
    }

    /// The magnitudes that f64 rounds: the eye's and the volume's coordinates
    /// and those of the boxes.
    fn size(&self) -> f64 {
        let eye = self.camera.frame.eye;
        let own = (eye.abs() + (eye - self.around.origin).abs()).element_sum();
        let depth = self.camera.lens.far().unwrap_or(0.0);
        own + depth + self.around.reach.as_dvec3().element_sum()
    }

    /// The box and what is known of it, so that a reader can check by hand.
    pub fn describe(&self, item: usize) -> String {
        let b = &self.items[item];
        let judgement = &self.judgements[item];
        format!(
            "box {:?} to {:?} is {:?} by {:e}; {:?}, scene origin {:?}",
            b.min.to_array(),
            b.max.to_array(),
            judgement.verdict,
            self.oracle.depth(b),
            self.camera,
            DVec3::to_array(&self.around.origin),
        )
    }
}

/// Of the magnitudes: a normal of unit length is true to a few units of
/// 2^-53 in each component, the offset is a dot product of it with the eye,
/// and the test itself rounds seven times: 2^-48 is twice all of that.
const F64_MARGIN: f64 = 1.0 / (1u64 << 48) as f64;

/// Planes of volumes this large may not fit f32.
const HUGE: f64 = 1e38;

/// Every structure must return exactly what the scalar loop does.
fn ask(
    built: &[(&str, Box<dyn DynIndex>)],
    name: &str,
    view: AnyVolume<'_>,
    seen: &[bool],
    items: &[Aabb],
    found: &mut Findings,
) {
    let mut trial = Trial::new(seen.len());
    let wanted = seen.iter().zip(0..).filter(|(seen, _)| **seen);
    trial.expect(wanted.map(|(_, id): (_, ItemId)| id));
    for (structure, index) in built {
        found.tried(&mut trial, structure, name, items.len(), |out| {
            index.query(view, out);
        });
    }
}

impl Findings {
    /// Puts a question of the scalar loop to a structure.
    pub fn tried(
        &mut self,
        trial: &mut Trial,
        structure: &str,
        test: &str,
        items: usize,
        ask: impl FnOnce(&mut Vec<ItemId>),
    ) {
        self.asked.push((structure.to_owned(), test.to_owned()));
        match trial.ask(ask).map(drop) {
            Ok(()) => {}
            Err(verify::Fault::Panicked(text)) => self.panicked(structure, test, &text),
            Err(verify::Fault::Differs(difference)) => {
                let item = difference.first.map(|id| id as usize);
                let known = item.filter(|&item| item < items);
                let expected = format!("the {} items of the scalar loop", trial.expected());
                self.fault(structure, test, known, &expected, difference.to_string());
            }
        }
    }

    /// A structure ended in place of answering.
    pub fn panicked(&mut self, structure: &str, test: &str, text: &str) {
        self.fault(
            structure,
            test,
            None,
            "an answer",
            format!("panicked: {text}"),
        );
    }

    /// Notes that an answer is not what was expected.
    pub fn fault(
        &mut self,
        structure: &str,
        test: &str,
        item: Option<usize>,
        expected: &str,
        got: String,
    ) {
        self.faults.push(Fault {
            structure: structure.to_owned(),
            test: test.to_owned(),
            item,
            expected: expected.to_owned(),
            got,
        });
    }
}
