//! Inputs said back: axes, unit, lenses and matrices as used.

use crate::measure::{PathInfo, SceneInfo};
use crate::path::{CameraFacts, LensDefaults, MatrixFacts};

/// "z up, in m".
pub fn axes(scene: &SceneInfo) -> String {
    match &scene.unit {
        Some(unit) => format!("{} up, in {unit}", scene.up),
        None => format!("{} up, no unit stated", scene.up),
    }
}

/// "60 degrees, aspect 1.778, near 0.5, far 500".
pub fn lens(facts: &CameraFacts) -> String {
    let of = |before: &str, range: Option<[f64; 2]>, after: &str| {
        range.map(|range| format!("{before}{}{after}", shown(range)))
    };
    let far = match facts.far {
        [Some(least), Some(most)] => shown([least, most]),
        [Some(least), None] => format!("{} to infinite", figure(least)),
        _ => "infinite".to_owned(),
    };
    let parts = [
        of("", facts.fovy_deg, " degrees"),
        of("height ", facts.ortho_height, ""),
        of("aspect ", facts.aspect, ""),
        of("near ", facts.near, ""),
        Some(format!("far {far}")),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// Lens of recorded cameras that state none.
pub fn default_lens(defaults: &LensDefaults) -> String {
    let (near, far) = defaults.depths(defaults.middle);
    lens(&CameraFacts {
        fovy_deg: Some([defaults.fovy_deg; 2]),
        aspect: Some([defaults.aspect; 2]),
        near: Some([near; 2]),
        far: [far; 2],
        ..CameraFacts::default()
    })
}

/// "column-gl, depth -1 to 1; the first: eye (..), right (..), .."
pub fn matrices(facts: &MatrixFacts) -> String {
    let point = |v: [f64; 3]| format!("({})", v.map(figure).join(", "));
    let [near, far] = facts.depth;
    let mirrored = if facts.is_mirrored { ", mirrored" } else { "" };
    format!(
        "{}, depth {near} to {far}{mirrored}; the first: eye {}, right {}, up {}, forward {}",
        facts.convention,
        point(facts.eye),
        point(facts.right),
        point(facts.up),
        point(facts.forward)
    )
}

/// The same of several paths: one value where it is the same in all.
pub fn lenses<'p>(paths: impl Iterator<Item = &'p PathInfo>) -> Option<String> {
    let facts = paths.filter_map(|path| path.lens.as_ref());
    let all = facts.cloned().reduce(CameraFacts::with)?;
    Some(lens(&all))
}

fn shown([least, most]: [f64; 2]) -> String {
    let [a, b] = [least, most].map(figure);
    if a == b { a } else { format!("{a} to {b}") }
}

/// Four digits, no more zeros than needed.
fn figure(value: f64) -> String {
    let rounded = format!("{value:.3e}").parse().unwrap_or(value) + 0.0;
    match rounded == 0.0 || (1e-4..1e7).contains(&rounded.abs()) {
        true => rounded.to_string(),
        false => format!("{rounded:e}"),
    }
}
