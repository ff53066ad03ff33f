//! Figures of a scene's boxes: sizes, flatness, overlap, copies, loss by f32.
//!
//! Also lenses, matrices and axes in words, for tables and pages.

use glam::DVec3;
use serde::Serialize;

use super::text;
use crate::index::{Bvh, FrustumQuery, Input, RegionIndex};
use crate::measure::SceneInfo;
use crate::path::{CameraFacts, LensDefaults, MatrixFacts, scattered};
use crate::scene::{Scene, WorldBox};
use crate::statistics::{quantile, sorted};

/// Most thickness of a flat item / its longest edge.
const FLAT: f64 = 0.01;
/// Most items whose neighbours are counted.
const SAMPLE: usize = 1000;
/// Number of neighbours after which no further item is sampled.
const MOST_NEIGHBOURS: usize = 10_000_000;
/// Steps of the histogram of sizes.
const STEPS: usize = 12;
const BARS: [char; 9] = ['·', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// Figures of the items as written.
///
/// Sizes are longest edges in units of the scene.
#[derive(Serialize)]
pub struct SceneFacts {
    /// Corners of the box about all items.
    pub bounds_min: [f64; 3],
    pub bounds_max: [f64; 3],
    /// Edges of the box about all items.
    extent: [f64; 3],
    size_min: Option<f64>,
    size_median: Option<f64>,
    size_p99: Option<f64>,
    size_max: Option<f64>,
    /// Steps of equal ratio from the smallest positive size to the largest.
    size_histogram: Vec<SizeStep>,
    /// Items whose longest edge is zero.
    point_count: usize,
    /// Items that are flat along x, y and z, points excluded.
    flat_counts: [usize; 3],
    /// Items with the bounds of an earlier item.
    coincident_count: usize,
    /// Mean number of other items that an item meets, in a sample.
    overlap_mean: Option<f64>,
    /// Share of items that meet another one, in the sample.
    overlap_share: Option<f64>,
    overlap_sample_count: usize,
    /// Farthest that f32 moves a bound outward, per axis.
    f32_loss: [f64; 3],
    /// Spacing of f32 numbers at the farthest bound in world coordinates, per axis.
    f32_step_unmoved: [f64; 3],
}

#[derive(Serialize)]
struct SizeStep {
    from: f64,
    to: f64,
    count: usize,
}

impl SceneFacts {
    pub fn of(scene: &Scene) -> anyhow::Result<SceneFacts> {
        let extents = || scene.written().map(|b| b.max - b.min);
        let edges = sorted(extents().map(|extent| extent.max_element()).collect());
        let [size_min, size_median, size_p99, size_max] =
            [0.0, 0.5, 0.99, 1.0].map(|q| quantile(&edges, q));
        // A point is not flat.
        let flat_counts = [0, 1, 2].map(|axis| {
            let is_flat = |extent: &DVec3| extent[axis] < FLAT * extent.max_element();
            extents().filter(is_flat).count()
        });
        let corners = |b: WorldBox| [b.min, b.max].map(|v| v.to_array().map(f64::to_bits));
        let mut distinct: Vec<_> = scene.written().map(corners).collect();
        distinct.sort_unstable();
        distinct.dedup();
        let mut f32_loss = DVec3::ZERO;
        for (b, written) in scene.items.iter().zip(scene.written()) {
            let low = written.min - scene.origin - b.min.as_dvec3();
            let high = b.max.as_dvec3() - (written.max - scene.origin);
            f32_loss = f32_loss.max(low).max(high);
        }
        let bounds = match scene.items.is_empty() {
            true => scene.world_bounds(),
            false => WorldBox::union_of(scene.written()),
        };
        let step = |axis: usize| {
            let farthest = bounds.min[axis].abs().max(bounds.max[axis].abs()) as f32;
            if !farthest.is_finite() {
                return f64::INFINITY;
            }
            // The largest f32 has no finite number above it.
            let low = farthest.min(f32::MAX.next_down());
            f64::from(low.next_up() - low)
        };
        let (mut sampled, mut meeting, mut others) = (0, 0, 0);
        let tree = Bvh::build(&Input::new(&scene.items), &Default::default())?;
        for item in scattered(scene.items.len(), SAMPLE) {
            let (mut met, b) = (0, scene.written_box(item));
            let stored = &scene.items[item];
            tree.each_visible(stored, |id| met += usize::from(scene.overlaps(id, &b)));
            // An item that ends the sample is not part of it, since it is not a random one.
            if sampled > 0 && others + met > MOST_NEIGHBOURS {
                break;
            }
            (sampled, others) = (sampled + 1, others + met - 1);
            meeting += usize::from(met > 1);
        }
        let of_sample = |count: usize| (sampled > 0).then(|| count as f64 / sampled as f64);
        Ok(SceneFacts {
            // -0 is 0.
            bounds_min: (bounds.min + 0.0).to_array(),
            bounds_max: bounds.max.to_array(),
            extent: (bounds.max - bounds.min).to_array(),
            size_min,
            size_median,
            size_p99,
            size_max,
            point_count: edges.partition_point(|edge| *edge <= 0.0),
            size_histogram: histogram(&edges),
            flat_counts,
            coincident_count: scene.items.len() - distinct.len(),
            overlap_mean: of_sample(others),
            overlap_share: of_sample(meeting),
            overlap_sample_count: sampled,
            f32_loss: f32_loss.to_array(),
            f32_step_unmoved: [0, 1, 2].map(step),
        })
    }

    /// The figures as names and texts.
    pub fn rows(&self, scene: &Scene) -> Vec<(&'static str, String)> {
        let length = |value: f64| length(value, scene.unit);
        let count = scene.items.len();
        let three = |values: [f64; 3]| values.map(length).join(", ");
        let [x, y, z] = self.extent.map(length);
        let unit = z.find(' ').map_or("", |at| &z[at..]);
        let (x, y) = match [&x, &y].map(|own| own.strip_suffix(unit)) {
            [Some(x), Some(y)] => (x, y),
            _ => (&*x, &*y),
        };
        let extent = ("extent", format!("{x} x {y} x {z}"));
        if count == 0 {
            return vec![("sizes", "no items".to_owned())];
        }
        let size = |size| text::some(size, length);
        let [least, median] = [self.size_min, self.size_median].map(size);
        let [p99, most] = [self.size_p99, self.size_max].map(size);
        let sizes = format!("longest edge min {least}, median {median}, p99 {p99}, max {most}");
        let axes = ["x", "y", "z"].into_iter().zip(self.flat_counts);
        let flat = axes.filter(|(_, flat)| *flat > 0).map(|(axis, flat)| {
            let share = text::percent(flat as f64 / count as f64);
            format!("{share} along {axis}")
        });
        let flat = match flat.collect::<Vec<_>>().join(", ") {
            none if none.is_empty() => "no items thinner than 1 % of their longest edge".to_owned(),
            some => format!("{some} (below 1 % of the longest edge)"),
        };
        let sampled = self.overlap_sample_count;
        let overlap = [self.overlap_share, self.overlap_mean];
        let [share, mean] = overlap.map(Option::unwrap_or_default);
        let (all, others) = (text::percent(share), text::short(mean));
        let mut overlap = format!("{all} meet other items, {others} on average");
        if sampled < count {
            // As many digits as the number of sampled items that meet others supports.
            let digits = usize::from(share * sampled as f64 >= 100.0);
            let [all, others] = [share * 100.0, mean].map(|x| text::short(rounded(x, digits)));
            let of = format!("(of {} sampled)", people(sampled));
            overlap = format!("about {all} % meet other items, {others} on average {of}");
        }
        let copies = match self.coincident_count {
            0 => "no two items have the same bounds".to_owned(),
            copies => format!("{} with the bounds of an item before them", people(copies)),
        };
        let [loss, step] = [self.f32_loss, self.f32_step_unmoved].map(three);
        let loss = format!(
            "bounds grow by at most {loss} (x, y, z); f32 steps in world coordinates are {step}"
        );
        let mut rows = vec![extent, ("sizes", sizes)];
        rows.extend(self.bars(length).map(|bars| ("", bars)));
        let more = [("flat", flat), ("overlap", overlap), ("copies", copies)];
        rows.extend(more.into_iter().chain([("f32", loss)]));
        rows
    }

    /// The histogram of sizes as bars.
    fn bars(&self, length: impl Fn(f64) -> String) -> Option<String> {
        let [first, .., last] = &self.size_histogram[..] else {
            return None;
        };
        let counts = || self.size_histogram.iter().map(|step| step.count);
        let most = counts().max().unwrap_or(1).max(1);
        let bars = counts().map(|count| BARS[(count * (BARS.len() - 1)).div_ceil(most)]);
        let bars: String = bars.collect();
        let [from, to] = [first.from, last.to].map(length);
        let factor = text::short(first.to / first.from);
        let points = match self.point_count {
            0 => String::new(),
            points => format!("; {} of size 0", people(points)),
        };
        Some(format!("{from} |{bars}| {to}, steps of x{factor}{points}"))
    }
}

/// Counts per step of equal ratio; empty if all sizes are equal.
fn histogram(edges: &[f64]) -> Vec<SizeStep> {
    let above_zero = &edges[edges.partition_point(|edge| *edge <= 0.0)..];
    let (least, most) = match *above_zero {
        [least, .., most] if least < most => (least, most),
        _ => return Vec::new(),
    };
    // By logarithms, whose difference f64 can always represent.
    let [low, high] = [least, most].map(libm::log);
    let between = |share: f64| low + (high - low) * share;
    let end = |step: usize| match step {
        0 => least,
        STEPS => most,
        _ => libm::exp(between(step as f64 / STEPS as f64)),
    };
    // Each step includes its lower end, the last one both.
    let below = |step: usize| match step {
        STEPS => above_zero.len(),
        _ => above_zero.partition_point(|edge| *edge < end(step)),
    };
    let step = |step: usize| SizeStep {
        from: end(step),
        to: end(step + 1),
        count: below(step + 1) - below(step),
    };
    (0..STEPS).map(step).collect()
}

/// A readable count: 11,065 or 1.2 million.
pub fn people(count: usize) -> String {
    match count {
        0..1_000_000 => text::count(count),
        _ => format!("{} million", text::short(count as f64 / 1e6)),
    }
}

/// A readable length: 3.4 km, 12 m, 5 mm, 64 map units, or 64 without a unit.
fn length(value: f64, unit: Option<&str>) -> String {
    let (scale, unit) = match unit {
        None if value > 0.0 && value < 1e-3 => return format!("{value:.2e}"),
        None => return text::short(value),
        Some("m") => match value.abs() {
            v if v >= 1000.0 => (1e-3, "km"),
            v if v >= 0.1 || v == 0.0 => (1.0, "m"),
            v if v >= 1e-3 => (1e3, "mm"),
            _ => (1e6, "um"),
        },
        Some(unit) if value > 0.0 && value < 1e-3 => return format!("{value:.2e} {unit}"),
        Some(unit) => (1.0, unit),
    };
    format!("{} {unit}", text::short(value * scale))
}

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
    let far = facts.far.map(|far| far.unwrap_or(f64::INFINITY));
    let parts = [
        of("", facts.fovy_deg, " degrees"),
        of("height ", facts.ortho_height, ""),
        of("aspect ", facts.aspect, ""),
        of("near ", facts.near, ""),
        Some(format!("far {}", shown(far)).replace("inf", "infinite")),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// Lens of recorded cameras that state none.
pub fn default_lens(defaults: &LensDefaults) -> String {
    let (near, far) = defaults.depths(defaults.middle);
    let [fovy_deg, aspect] = defaults.shape();
    lens(&CameraFacts {
        fovy_deg: Some([fovy_deg; 2]),
        aspect: Some([aspect; 2]),
        near: Some([near; 2]),
        far: [far; 2],
        ..CameraFacts::default()
    })
}

/// "column-gl; the first: depth -1 to 1, eye (..), right (..), .."
pub fn matrices(facts: &MatrixFacts) -> String {
    let vectors = [facts.eye, facts.right, facts.up, facts.forward];
    let [eye, right, up, forward] = vectors.map(|v| format!("({})", v.map(figure).join(", ")));
    let ([near, far], convention) = (facts.depth, &facts.convention);
    let mirrored = if facts.is_mirrored { ", mirrored" } else { "" };
    let [by_name, at] = match facts.is_orthographic {
        true => [" by this name", "centre of the near plane (as eye)"],
        false => ["", "eye"],
    };
    format!(
        "{convention}; the first: depth {near} to {far}{by_name}{mirrored}, {at} {eye}, right {right}, \
         up {up}, forward {forward}"
    )
}

fn shown([least, most]: [f64; 2]) -> String {
    let [a, b] = [least, most].map(figure);
    if a == b { a } else { format!("{a} to {b}") }
}

/// Four digits without trailing zeros.
fn figure(value: f64) -> String {
    // No lens has 180 degrees.
    let digits = [3, 6][usize::from((179.9..180.0).contains(&value))];
    let rounded = rounded(value, digits);
    match rounded == 0.0 || (1e-4..1e7).contains(&rounded.abs()) {
        true => rounded.to_string(),
        false => format!("{rounded:e}"),
    }
}

/// Some digits after the first; -0 is 0.
fn rounded(value: f64, digits: usize) -> f64 {
    format!("{value:.digits$e}").parse().unwrap_or(value) + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{WorldBox, load};

    fn scene(boxes: &[[f64; 2]]) -> Scene {
        let one = |&[low, size]: &[f64; 2]| {
            let min = DVec3::new(low, 0.0, 0.0);
            WorldBox::new(min, min + DVec3::new(size, size, 0.0))
        };
        let boxes: Vec<WorldBox> = boxes.iter().map(one).collect();
        Scene::from_boxes("test", &boxes).expect("boxes")
    }

    #[test]
    fn figures_are_those_of_a_count_by_hand() {
        // Two copies that meet the third, a fourth apart, and a point.
        let scene = scene(&[
            [0.0, 2.0],
            [0.0, 2.0],
            [1.5, 4.5],
            [90.1, 32.0],
            [50.0, 0.0],
        ]);
        let facts = SceneFacts::of(&scene).unwrap();
        assert_eq!(facts.extent[1..], [32.0, 0.0]);
        assert_eq!((facts.point_count, facts.coincident_count), (1, 1));
        assert_eq!(facts.flat_counts, [0, 0, 4]);
        assert_eq!(facts.overlap_sample_count, 5);
        let overlap = (facts.overlap_mean, facts.overlap_share);
        assert_eq!(overlap, (Some(1.2), Some(0.6)));
        assert_eq!((facts.size_min, facts.size_median), (Some(0.0), Some(2.0)));
        let counts: Vec<usize> = facts.size_histogram.iter().map(|step| step.count).collect();
        assert_eq!(counts, [2, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1]);
        let step = f64::from(122f32.next_up() - 122.0);
        assert!(facts.f32_loss[0] > 0.0 && facts.f32_loss[0] <= step);
        assert_eq!(facts.f32_loss[1..], [0.0, 0.0]);
        assert_eq!(facts.f32_step_unmoved[0], step);
    }

    #[test]
    fn figures_at_the_end_of_f32_are_numbers() {
        let facts =
            SceneFacts::of(&scene(&[[-f64::from(f32::MAX), 1e-300], [0.0, 3.4e38]])).unwrap();
        assert_eq!(
            facts.f32_step_unmoved[0],
            f64::from(f32::MAX) - f64::from(f32::MAX.next_down())
        );
        let steps = &facts.size_histogram;
        assert!(
            steps
                .iter()
                .all(|step| step.from < step.to && step.to.is_finite())
        );
        assert_eq!((steps[0].count, steps[STEPS - 1].count), (1, 1));
    }

    /// f32 has steps of 2 there.
    #[test]
    fn figures_are_those_of_the_boxes_as_written() {
        let point = |x: f64| WorldBox::at(DVec3::new(16_777_217.0 + x, 0.0, 0.0));
        let unit = WorldBox::new(DVec3::ZERO, DVec3::ONE);
        let boxes = [point(0.0), point(0.25), point(0.5), unit, point(0.5)];
        let scene = Scene::from_boxes("far", &boxes).expect("boxes");
        let facts = SceneFacts::of(&scene).unwrap();
        assert_eq!((facts.size_min, facts.size_max), (Some(0.0), Some(1.0)));
        assert_eq!((facts.point_count, facts.flat_counts), (4, [0; 3]));
        assert_eq!(
            (facts.coincident_count, facts.overlap_share),
            (1, Some(0.4))
        );
        assert_eq!(facts.bounds_max, [16_777_217.5, 1.0, 1.0]);
    }

    #[test]
    fn scenes_of_any_size_have_figures() {
        for source in [
            "uniform:n=0",
            "uniform:n=1",
            "city:n=3000,offset=1e7",
            "us-counties",
        ] {
            let scene = load(source, &Default::default()).unwrap();
            let facts = SceneFacts::of(&scene).unwrap();
            assert!(facts.overlap_sample_count <= SAMPLE && !facts.rows(&scene).is_empty());
            let above_zero = scene.items.len() - facts.point_count;
            let counted: usize = facts.size_histogram.iter().map(|step| step.count).sum();
            assert!(
                counted == above_zero || counted == 0 && above_zero < 2,
                "{source}"
            );
        }
    }

    /// Every other item meets another one, or the first quarter is in one pile.
    #[test]
    fn neighbours_are_counted_of_items_from_anywhere() {
        let alone = |item: usize| [1e6 + 9.0 * item as f64, 1.0];
        let pairs = |first: usize| {
            let place = move |item: usize| match item % 2 == first {
                true => [3.0 * (item / 4) as f64, 1.0],
                false => alone(item),
            };
            scene(&(0..4000).map(place).collect::<Vec<_>>())
        };
        let piled = |item| if item < 16_000 { [0.0; 2] } else { alone(item) };
        let piled = scene(&(0..64_000).map(piled).collect::<Vec<_>>());
        for (scene, share, others) in [
            (pairs(0), 0.5, 1.0),
            (pairs(1), 0.5, 1.0),
            (piled, 0.25, 15_999.0),
        ] {
            let facts = SceneFacts::of(&scene).unwrap();
            let (found, mean) = (facts.overlap_share.unwrap(), facts.overlap_mean.unwrap());
            assert!((found - share).abs() < 0.05, "{found} of {share}");
            assert!((mean / others / found - 1.0).abs() < 1e-9, "{mean}");
            let rows = facts.rows(&scene);
            let (_, text) = rows.iter().find(|row| row.0 == "overlap").unwrap();
            let told = format!("about {} % meet other items", (found * 100.0).round());
            assert!(text.starts_with(&told), "{text}");
        }
    }

    #[test]
    fn numbers_are_those_that_people_say() {
        let told = [0.0, 3400.0, 12.34, 0.005, 1e-6].map(|v| length(v, Some("m")));
        assert_eq!(told, ["0 m", "3.4 km", "12.3 m", "5 mm", "1 um"]);
        assert_eq!(length(64.0, Some("map units")), "64 map units");
        assert_eq!(length(7.63e-6, None), "7.63e-6");
        assert_eq!([179.99, 59.999_96].map(figure), ["179.99", "60"]);
        let told = [11_065, 1_234_567].map(people);
        assert_eq!(told, ["11,065", "1.23 million"]);
    }
}
