//! What happens far from the world's zero: the false negatives of every
//! derivation of the planes when boxes and camera are moved away together and
//! nothing is rebased. Boxes are f32 world coordinates here, on purpose.

use glam::{DVec3, Vec3};
use serde::Serialize;

use crate::camera::{Camera, Frame, Lens, PLANE_METHODS, PlaneOptions, Surroundings};
use crate::culling::{Arithmetic, Culling};
use crate::geometry::Aabb;
use crate::query::ItemId;
use crate::scene::Dice;
use crate::verify::{ErrorCount, Truth};

/// Distance of the scene from zero along each axis.
pub const OFFSETS: [f64; 5] = [0.0, 1e4, 1e5, 1e6, 1e7];

/// One derivation at one offset.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct OffsetRow {
    /// Distance of the scene from zero along each axis.
    pub offset: f64,
    /// Name of the derivation of the planes.
    pub planes: &'static str,
    /// Name of the arithmetic.
    pub arithmetic: &'static str,
    /// Factor c of the planes' epsilon.
    pub epsilon: f64,
    /// Null if the planes cannot be made.
    pub false_negative_ppm: Option<f64>,
    /// False positives / visible items; null as above.
    pub excess: Option<f64>,
    /// The same as counts.
    #[serde(flatten)]
    pub errors: ErrorCount,
    /// Why the planes cannot be made; null if they can.
    pub refused: Option<String>,
}

/// Depth of the views, and how many boxes each camera looks at.
const DEPTH: f64 = 100.0;
const BOXES: usize = 4000;

/// Judges `cameras` random cameras at every offset with every derivation.
pub fn offset_sweep(cameras: usize, seed: u64) -> Vec<OffsetRow> {
    let standard = PlaneOptions::default();
    let of = |epsilon: f64| PlaneOptions {
        epsilon,
        ..standard
    };
    let mut cullings = vec![
        Culling::default(),
        Culling {
            arithmetic: Arithmetic::F64,
            planes: of(0.0),
            ..Culling::default()
        },
        Culling {
            arithmetic: Arithmetic::F32Relative,
            planes: of(0.0),
            ..Culling::default()
        },
    ];
    cullings.extend(PLANE_METHODS.iter().map(|&(method, ..)| Culling {
        planes: PlaneOptions {
            method,
            epsilon: 0.0,
        },
        ..Culling::default()
    }));
    let mut rows = Vec::new();
    for offset in OFFSETS {
        let mut of_offset: Vec<OffsetRow> = cullings.iter().map(|c| row(offset, c)).collect();
        let mut dice = Dice::new(seed);
        for _ in 0..cameras {
            judge(&mut dice, offset, &cullings, &mut of_offset);
        }
        for row in &mut of_offset {
            if row.refused.is_none() {
                row.false_negative_ppm = row.errors.false_negative_ppm();
                row.excess = row.errors.excess();
            }
        }
        rows.append(&mut of_offset);
    }
    rows
}

fn row(offset: f64, culling: &Culling) -> OffsetRow {
    OffsetRow {
        offset,
        planes: culling.planes.method.name(),
        arithmetic: culling.arithmetic.name(),
        epsilon: culling.planes.epsilon,
        false_negative_ppm: None,
        excess: None,
        errors: ErrorCount::default(),
        refused: None,
    }
}

fn judge(dice: &mut Dice, offset: f64, cullings: &[Culling], rows: &mut [OffsetRow]) {
    let centre = DVec3::splat(offset);
    let eye = centre + dice.normal3() * 10.0;
    let (forward, up) = (dice.normal3(), dice.normal3());
    let lens = Lens::perspective(60.0, 16.0 / 9.0, DEPTH / 1000.0, Some(DEPTH));
    let (Ok(frame), Ok(lens)) = (Frame::looking_along(eye, forward, up), lens) else {
        return;
    };
    let camera = Camera { frame, lens };
    // As a world in f32 has them: rounded to its grid, and exact from there on.
    let boxes: Vec<Aabb> = (0..BOXES)
        .map(|_| {
            let at = eye + (dice.point() * 2.0 - 1.0) * DEPTH;
            Aabb::around(at.as_vec3(), Vec3::splat(dice.between(0.5, 5.0) as f32))
        })
        .collect();
    let around = Surroundings {
        origin: DVec3::ZERO,
        reach: Aabb::union_of(&boxes).reach(),
    };
    let Some(truth) = Truth::of_camera(&camera, DVec3::ZERO, &boxes) else {
        return;
    };
    for (culling, row) in cullings.iter().zip(rows) {
        match culling.view(&camera, &around) {
            Ok(view) => {
                let seen = boxes.iter().zip(0..).filter(|(b, _)| view.as_any().sees(b));
                let answer: Vec<ItemId> = seen.map(|(_, id)| id).collect();
                row.errors += truth.errors(&boxes, &answer);
            }
            Err(error) => row.refused = Some(error.to_string()),
        }
    }
}
