//! Generated extremes of the occlusion stage: worlds full of contacts, far from the
//! origin, seen by every kind of lens, and fences with gaps of a fraction of a pixel.
//! Whatever a ray sees, exactly, must be handed on by what promises it.

use std::ops::Range;

use glam::DVec3;

use super::{Level, Row, Section, Status};
use crate::camera::{Camera, Frame, Lens, PlaneOptions};
use crate::kernel::Kernel;
use crate::query::ItemId;
use crate::scene::{Scene, SeededRng, WorldBox};
use crate::visibility::occlusion::{
    Interleaved, MaskedInner, OccluderChoice, OccluderScene, OcclusionBuffer, TwoPass, View,
};
use crate::visibility::truth::{RayIndex, visible_by_random_rays};
use crate::visibility::{Rays, SampleGrid, Solids};

/// Random rays of a case.
const RAYS: usize = 2_000;

/// A family: its name, and a case of it.
type Family = (&'static str, fn(&mut SeededRng) -> (Vec<WorldBox>, Camera));

/// All of them.
pub const VISIBILITY_FAMILIES: [Family; 5] = [
    ("occlusion-contacts", |rng| {
        (world(rng, 0.0), camera(rng, 0.0, Kind::Any))
    }),
    ("occlusion-far-out", |rng| {
        (world(rng, 1e7), camera(rng, 1e7, Kind::Any))
    }),
    ("occlusion-parallel", |rng| {
        (world(rng, 0.0), camera(rng, 0.0, Kind::Parallel))
    }),
    ("occlusion-off-axis", |rng| {
        (world(rng, 0.0), camera(rng, 0.0, Kind::OffAxis))
    }),
    ("occlusion-fence", fence),
];

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Any,
    Parallel,
    OffAxis,
}

/// Boxes of any shape, every other time on whole numbers so that faces coincide, and
/// standing on one floor.
fn world(rng: &mut SeededRng, far_out: f64) -> Vec<WorldBox> {
    let [whole, standing] = [rng.below(2) == 0, rng.below(2) == 0];
    let about = DVec3::new(far_out, -far_out, 0.0);
    let count = 4 + rng.below(40);
    let boxes = (0..count).map(|_| {
        let mut low = rng.point() * 20.0 - 10.0;
        let mut size = rng.point() * if rng.below(2) == 0 { 12.0 } else { 1.5 };
        if rng.below(6) == 0 {
            size[rng.below(3)] = 0.0;
        }
        if whole {
            (low, size) = (low.round(), size.round());
        }
        if standing && rng.below(3) > 0 {
            low.z = -10.0;
        }
        WorldBox::new(low + about, low + size + about)
    });
    boxes.collect()
}

fn camera(rng: &mut SeededRng, far_out: f64, kind: Kind) -> Camera {
    let reach = if rng.below(2) == 0 { 9.0 } else { 25.0 };
    let mut eye = (rng.point() * 2.0 - 1.0) * reach;
    let mut forward = rng.point() * 12.0 - 6.0 - eye;
    if rng.below(3) == 0 {
        (eye, forward) = (eye.round(), [DVec3::X, DVec3::Y, -DVec3::X][rng.below(3)]);
    }
    if rng.below(3) == 0 {
        forward.z = 0.0;
    }
    // Never along the up vector.
    forward.x += if forward.x.abs() < 1e-3 && forward.y.abs() < 1e-3 {
        1.0
    } else {
        0.0
    };
    let eye = eye + DVec3::new(far_out, -far_out, 0.0);
    let near = [0.01, 0.5, 2.0][rng.below(3)];
    let far = [None, Some(30.0), Some(1000.0)][rng.below(3)];
    let made = match kind {
        Kind::Parallel => Lens::orthographic(rng.between(2.0, 30.0), 1.6, -20.0, 60.0),
        Kind::OffAxis => {
            let [left, bottom] =
                [rng.between(-1.5, -0.1), rng.between(-1.5, -0.1)].map(|x| x * near);
            Lens::off_axis([left, left + near * 1.2, bottom, bottom + near], near, far)
        }
        Kind::Any => Lens::perspective(rng.between(20.0, 130.0), 1.6, near, far),
    };
    // Both are sound by how they are drawn.
    Camera {
        frame: Frame::looking_along(eye, forward, DVec3::Z).expect("a direction beside up"),
        lens: made.expect("a lens"),
    }
}

/// Pickets with gaps of 4 to 0.03 pixels, and boxes in line with the gaps.
fn fence(rng: &mut SeededRng) -> (Vec<WorldBox>, Camera) {
    let lens = Lens::perspective(60.0, 16.0 / 9.0, 0.1, None).expect("a lens");
    let [left, right, ..] = lens.window();
    let pixel = (right - left) / f64::from(GRID.width) * 10.0;
    let gap = pixel * libm::exp2(rng.between(-5.0, 2.0));
    let mut boxes = Vec::new();
    let mut y = 10.0 * left;
    while y < 10.0 * right {
        let width = pixel * rng.between(6.0, 40.0);
        boxes.push(WorldBox::new(
            DVec3::new(10.0, y, -8.0),
            DVec3::new(10.0, y + width, 8.0),
        ));
        y += width + gap;
    }
    for picket in 0..boxes.len() {
        // Twice as far as the gap, in line with it.
        let at = DVec3::new(
            20.25,
            2.0 * boxes[picket].max.y + gap,
            rng.between(-4.0, 4.0),
        );
        boxes.push(WorldBox::around(
            at,
            DVec3::new(0.5, rng.between(0.02, 0.3), 1.0),
        ));
    }
    let frame = Frame::looking_along(DVec3::ZERO, DVec3::X, DVec3::Z).expect("a direction");
    (boxes, Camera { frame, lens })
}

/// Pixels of the buffers.
const GRID: SampleGrid = SampleGrid::new(320, 180);

/// What each coupling hands on.
fn answers(
    scene: &OccluderScene,
    view: &View,
    in_view: &[ItemId],
) -> [(&'static str, Vec<ItemId>); 2] {
    let kernel = Kernel::best();
    let (mut walked, mut passed) = (Vec::new(), Vec::new());
    Interleaved::new(MaskedInner::new(GRID), kernel).cull(scene, view, &mut walked);
    let mut two = TwoPass::new(MaskedInner::new(GRID), OccluderChoice::All, kernel);
    two.cull(scene, view, in_view, &mut passed);
    [("masked-inner", walked), ("masked-inner-two-pass", passed)]
}

/// Cases of a family: one row for each case and coupling. `stop` is asked before each.
pub fn occlusion_cases(
    (name, draw): Family,
    cases: Range<u64>,
    seed: u64,
    stop: &dyn Fn() -> bool,
) -> Section {
    let mut section = Section::new(name);
    for case in cases {
        if stop() {
            break;
        }
        let mut rng = SeededRng::new(seed.wrapping_mul(0x9E37_79B9).wrapping_add(case));
        let (boxes, camera) = draw(&mut rng);
        section.cases += 1;
        section.boxes += boxes.len() as u64;
        section
            .rows
            .extend(rows(&format!("{name}/{case}"), &boxes, &camera, case));
    }
    section
}

fn rows(id: &str, boxes: &[WorldBox], camera: &Camera, seed: u64) -> Vec<Row> {
    let row = |structure: &str, status, expected: &str, got: String| Row {
        id: id.to_owned(),
        level: Level::Camera,
        structure: structure.to_owned(),
        test: "occlusion".to_owned(),
        status,
        expected: expected.into(),
        got: got.into(),
    };
    let made = Scene::from_boxes(id, boxes).map_err(|error| error.to_string());
    let made = made.and_then(|scene| {
        let volume = camera.volume(&PlaneOptions::default(), &scene.surroundings());
        let rays = Rays::of(camera).map_err(|error| error.to_string())?;
        Ok((volume.map_err(|error| error.to_string())?, rays, scene))
    });
    let (volume, rays, scene) = match made {
        Ok(made) => made,
        Err(reason) => return vec![row("masked-inner", Status::Fail, "an answer", reason)],
    };
    let solids = Solids::of(&scene);
    let occluders = OccluderScene::of(&solids);
    let view = View::new(&rays, &volume, &occluders, GRID);
    let items = scene.items.iter().zip(0..);
    let in_view: Vec<ItemId> = items
        .filter(|(b, _)| volume.sees(b))
        .map(|(_, id)| id)
        .collect();
    let seen = visible_by_random_rays(&RayIndex::build(&solids), &rays, RAYS, seed, 1);
    let judged = answers(&occluders, &view, &in_view).map(|(name, kept)| {
        let (status, got) = status(&seen, kept, &in_view);
        row(name, status, "every item that a ray sees", got)
    });
    judged.into()
}

/// Whether all that is seen was handed on, and nothing from outside of the view.
fn status(seen: &[ItemId], mut kept: Vec<ItemId>, in_view: &[ItemId]) -> (Status, String) {
    kept.sort_unstable();
    let lost = seen.iter().filter(|id| kept.binary_search(id).is_err());
    let lost: Vec<String> = lost.map(ToString::to_string).collect();
    let more = kept
        .iter()
        .filter(|id| in_view.binary_search(id).is_err())
        .count();
    match (lost.is_empty(), more) {
        (true, 0) => (Status::Pass, "all of them".to_owned()),
        (true, more) => (Status::Fail, format!("{more} items outside of the frustum")),
        (false, _) => (
            Status::Fail,
            format!("items {} are missing", lost.join(", ")),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_promises_everything_passes_and_something_is_hidden() {
        for family in VISIBILITY_FAMILIES {
            let section = occlusion_cases(family, 0..12, 5, &|| false);
            assert_eq!(
                section.count(Status::Pass),
                24,
                "{}: {:?}",
                family.0,
                section.rows
            );
        }
    }

    /// A row fails where an item is missing: judged with an answer that lacks one.
    #[test]
    fn a_missing_item_fails_its_row() {
        let judge = |seen: &[ItemId], kept: &[ItemId]| status(seen, kept.to_vec(), &[0, 1, 2]).0;
        assert_eq!(judge(&[0, 2], &[2, 0]), Status::Pass);
        assert_eq!(judge(&[0, 2], &[0, 1]), Status::Fail);
        assert_eq!(judge(&[0], &[0, 7]), Status::Fail, "what is not in view");
    }
}
