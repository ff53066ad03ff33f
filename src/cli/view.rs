//! `cullbench view`: one page with a scene in 3-D along a path.
//!
//! Items have the colours of their verdicts in each view.

use std::io::{self, Write};

use anyhow::{Context, ensure};
use glam::{DMat4, DVec3, DVec4, I64Vec3};
use obvhs::ploc::morton::morton_encode_u64;
use serde::Serialize;

use super::command_args::ViewArgs;
use super::document::page;
use super::query::{Row, ask_all, frustum};
use super::study::progress;
use super::text::{self, html};
use super::{Ending, expect_places, load_scene, program, scene_facts, unread_is_fine, write_text};
use crate::camera::{Camera, ClipSpace};
use crate::funnel::{RaysEnd, Shape};
use crate::index::Registry;
use crate::input::{note, tell_warnings};
use crate::measure::{SceneInfo, Workload};
use crate::oracle::Verdict;
use crate::path::{self, CameraFacts};
use crate::query::{ItemId, QueryCost};
use crate::report::grouped;
use crate::scene::Scene;
use crate::verify::Truth;
use crate::visibility::Rays;

/// Most items that a browser is given to draw.
const MOST_ITEMS: usize = 2_000_000;

pub fn view(registry: &Registry, args: &ViewArgs) -> anyhow::Result<Ending> {
    let out = Some(args.out.clone());
    expect_places(&[("--out", &out)], &[&args.scene, &args.path])?;
    let structures = args.culling.kernel.structures(registry, &args.structure)?;
    let defaults = args.culling.lens.defaults()?;
    let culling = args.culling.culling(&args.test)?;
    let scene = load_scene(&args.scene, &args.culling.lens.scene_args.options(1))?;
    let items = scene.items.len();
    let (found, most) = (text::count(items), text::count(MOST_ITEMS));
    ensure!(
        items <= MOST_ITEMS,
        "{}: {found} items; expected at most {most} to draw",
        scene.name
    );
    let cameras = path::load(&args.path, &scene, &defaults)?;
    let (all, most) = (cameras.cameras.len(), args.frames);
    let cameras = cameras.at_most(most);
    let workload = Workload::new(&scene, &cameras, &culling)?;
    tell_warnings();
    culling.unproven().iter().for_each(|doubt| note(doubt));
    let (mut data, order) = ViewData::of(&scene, &cameras.name);
    let (mut answers, mut costs) = (Vec::<Box<[ItemId]>>::new(), Vec::new());
    let (ask, boxes, views) = (frustum(&workload), &workload.items, workload.views.len());
    let bar = progress((views * (structures.len() + 1)) as u64, " views");
    let mut each = |rows: Vec<Row>| {
        bar.inc(rows.len() as u64);
        for row in rows {
            costs.push((row.structure, row.cost));
            if answers.len() == row.question {
                answers.extend(row.ids);
            }
        }
        Ok(())
    };
    let questions = ("camera", views);
    let agree = ask_all(&structures, &scene, boxes, questions, true, ask, &mut each)?;
    let costs = grouped(costs.into_iter()).into_iter();
    let counters = |(name, costs): (String, Vec<QueryCost>)| Counters {
        name,
        nodes_tested: costs.iter().map(|cost| cost.nodes_tested).collect(),
        items_tested: costs.iter().map(|cost| cost.items_tested).collect(),
    };
    data.structures = costs.map(counters).collect();
    let threads = args.culling.kernel.execution()?.threads;
    let samples = args.samples;
    let surfaces = samples.map(|grid| (RaysEnd::at(&Shape::of(&scene), None), grid));
    let downward = path::is_downward(&cameras.cameras, scene.up);
    let mut totals = [0; FATES];
    for (view, answer) in answers.iter().enumerate() {
        let camera = &cameras.cameras[view];
        let front = surfaces.as_ref().map(|(ends, grid)| {
            let rays = Rays::of(camera)?;
            let truth = ends.visible(&rays, *grid, threads);
            Ok(truth.map_err(anyhow::Error::msg)?.visible)
        });
        let front: anyhow::Result<_> = front.transpose();
        let front = front.with_context(|| cameras.place(view))?;
        let truth = Truth::of_scene(camera, &scene);
        let fates = fates(items, answer, truth.as_ref(), front.as_deref());
        fates.iter().for_each(|fate| totals[*fate as usize] += 1);
        let set = |fate: Fate| runs(order.iter().map(|&id| fates[id as usize] == fate));
        data.frames.push(Frame {
            camera: if all > most { view * all / most } else { view },
            clip: clip_matrix(camera, scene.origin, downward).to_cols_array(),
            visible: set(Fate::Visible),
            false_positive: set(Fate::FalsePositive),
            hidden: set(Fate::Hidden),
            lost: set(Fate::Lost),
        });
        bar.inc(1);
    }
    bar.finish_and_clear();
    data.samples = samples.map(|grid| format!("{}x{}", grid.width, grid.height));
    let told = conclusion(&data, totals, agree);
    let facts = CameraFacts::of(&cameras.cameras, scene.up);
    let axes = scene_facts::axes(&SceneInfo::of(&scene));
    let lens = scene_facts::lens(&facts);
    let matrix = text::some(facts.matrix.as_ref(), |matrix| {
        format!("; matrices: {}", scene_facts::matrices(matrix))
    });
    let test = culling.test.name();
    let items = text::items(scene.items.len(), scene.skipped_items);
    let about = format!("Scene: {items}, {axes}. Lens: {lens}{matrix}. Test: {test}.");
    let json = serde_json::to_string(&data)?.replace('<', "\\u003c");
    let title = format!("{} view {}", program::name(), data.scene);
    let body = format!(
        "<main class=\"view\"><h1>{}, {}</h1>\n<p>{}</p>\n{}<p>{}</p>\n</main>\n\
         <script type=\"application/json\" id=\"data\">{json}</script>\n",
        html(&title),
        html(&data.path),
        html(&told),
        include_str!("assets/view.html"),
        html(&about),
    );
    let script = concat!(
        include_str!("assets/view_data.js"),
        include_str!("assets/view_gl.js"),
        include_str!("assets/view.js")
    );
    let text = page(&title, include_str!("assets/view.css"), &body, script);
    write_text(&args.out, &text)?;
    let megabytes = text::significant(text.len() as f64 / 1e6);
    let line = format!("{}, {megabytes} MB. {told}", args.out.display());
    let line = text::wrapped(&text::plain(&line), text::width());
    unread_is_fine(writeln!(io::stdout(), "{line}"))?;
    Ok(Ending::of(agree))
}

/// Fates of all items of a view; without a truth, returned items are visible.
fn fates(
    items: usize,
    answer: &[ItemId],
    truth: Option<&Truth>,
    front: Option<&[ItemId]>,
) -> Vec<Fate> {
    // Floors and ceilings of a map come behind its items.
    let set = |ids: &[ItemId]| {
        let mut set = vec![false; items];
        let own = ids.iter().map(|&id| id as usize).filter(|&id| id < items);
        own.for_each(|id| set[id] = true);
        set
    };
    let (returned, in_front) = (set(answer), front.map(set));
    let fate = |item: usize| {
        let is_hidden = in_front.as_ref().is_some_and(|front| !front[item]);
        match (returned[item], truth.map(|truth| truth.verdicts()[item])) {
            (true, Some(Verdict::Out)) => Fate::FalsePositive,
            (true, _) if is_hidden => Fate::Hidden,
            (true, _) => Fate::Visible,
            (false, Some(Verdict::In)) => Fate::Lost,
            (false, _) => Fate::Culled,
        }
    };
    (0..items).map(fate).collect()
}

/// The result in sentences.
fn conclusion(data: &ViewData, totals: [usize; FATES], agree: bool) -> String {
    let views = data.frames.len();
    let of = |fate: Fate| totals[fate as usize];
    let mean = |count: usize| text::significant(count as f64 / views as f64);
    let returned = of(Fate::Visible) + of(Fate::FalsePositive) + of(Fate::Hidden);
    let mut parts = vec![match of(Fate::FalsePositive) {
        0 => "no false positive".to_owned(),
        count => format!("{} false positives per view", mean(count)),
    }];
    if let Some(samples) = &data.samples {
        let hidden = mean(of(Fate::Hidden));
        parts.push(format!(
            "{hidden} hidden (in front at none of {samples} samples)"
        ));
    }
    parts.push(match of(Fate::Lost) {
        0 => "no visible item lost".to_owned(),
        count => format!("{} visible items lost", mean(count)),
    });
    let count = data.structures.len();
    let structures = match (data.structures.as_slice(), agree) {
        ([one], _) => format!("The structure is {}.", one.name),
        (_, true) => format!("All {count} structures return the same sets."),
        (_, false) => format!("The {count} structures disagree; the sets are the first one's."),
    };
    let (parts, returned) = (parts.join(", "), mean(returned));
    let (views, items) = (text::counted(views, "view"), text::count(data.items));
    let path = &data.path;
    format!(
        "{views} of {path}: {returned} of {items} items returned per view, {parts}. {structures}"
    )
}

/// Digits of packed numbers, safe in JSON and HTML.
const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";

/// Whole numbers as text, five bits per digit, lowest first.
///
/// A sixth bit is set if more digits of the number follow.
#[derive(Default)]
struct Packed(String);

impl Packed {
    fn push(&mut self, mut number: u64) {
        loop {
            let more = u64::from(number > 31) << 5;
            self.0.push(DIGITS[(number & 31 | more) as usize].into());
            number >>= 5;
            if number == 0 {
                return;
            }
        }
    }

    /// 0, -1, 1, -2, .. as 0, 1, 2, 3, ..
    fn push_signed(&mut self, number: i64) {
        self.push((number << 1 ^ number >> 63) as u64);
    }
}

/// Members of a set as packed runs.
///
/// A run is twice the gap before it, plus 1 if it is longer than 1; then its length less 2.
fn runs(set: impl Iterator<Item = bool>) -> String {
    let (mut packed, mut gap, mut run) = (Packed::default(), 0, 0);
    for is_member in set.chain([false]) {
        if is_member {
            run += 1;
            continue;
        }
        if run > 0 {
            packed.push(2 * gap + u64::from(run > 1));
            if run > 1 {
                packed.push(run - 2);
            }
            (gap, run) = (0, 0);
        }
        gap += 1;
    }
    packed.0
}

/// Kinds of [`Fate`].
pub const FATES: usize = 5;

/// Result for an item in a view.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Fate {
    Culled,
    Visible,
    FalsePositive,
    Hidden,
    Lost,
}

/// Everything that the page draws.
#[derive(Default, Serialize)]
pub struct ViewData {
    pub scene: String,
    pub path: String,
    pub items: usize,
    /// Axis that points up, y or z.
    up: &'static str,
    /// Steps per axis that corners are rounded to, outward.
    steps: u32,
    /// Lowest corner of all items, scene-local.
    low: [f64; 3],
    /// Extent of all items.
    extent: [f64; 3],
    /// Scene-local zero in world coordinates.
    origin: [f64; 3],
    /// Ids of the items in the order of the curve: signed differences.
    ids: String,
    /// Lower corner of each item less the one before, signed, and the extents.
    boxes: String,
    pub samples: Option<String>,
    pub frames: Vec<Frame>,
    pub structures: Vec<Counters>,
}

/// A view of the path.
#[derive(Clone, Default, Serialize)]
pub struct Frame {
    /// Index in the path.
    pub camera: usize,
    /// Scene-local to clip coordinates (near depth -1, far depth 1), column by column.
    clip: [f64; 16],
    /// Items by their fates, in the order of the curve.
    visible: String,
    false_positive: String,
    hidden: String,
    lost: String,
}

/// Tests that a structure made, per view.
#[derive(Serialize)]
pub struct Counters {
    pub name: String,
    pub nodes_tested: Vec<u64>,
    pub items_tested: Vec<u64>,
}

impl ViewData {
    /// Data without views, and the items in the order of the curve.
    pub fn of(scene: &Scene, path: &str) -> (ViewData, Vec<ItemId>) {
        // Few items may be far smaller than the scene.
        let steps: u32 = 1 << [20, 16][usize::from(scene.items.len() > 20_000)];
        let bounds = match scene.items.is_empty() {
            true => Default::default(),
            false => [scene.bounds.min.as_dvec3(), scene.bounds.max.as_dvec3()],
        };
        let (low, extent) = (bounds[0], bounds[1] - bounds[0]);
        let scale = extent.map(|e| if e > 0.0 { f64::from(steps) / e } else { 0.0 });
        let corners = |item: usize| {
            let b = &scene.items[item];
            let [min, max] = [b.min, b.max].map(|corner| (corner.as_dvec3() - low) * scale);
            (min.floor().as_i64vec3(), max.ceil().as_i64vec3())
        };
        let code = |item: usize| {
            let (min, max) = corners(item);
            let [x, y, z] = ((min + max) / 2).to_array().map(|c| c as u32);
            (morton_encode_u64(x, y, z), item)
        };
        let mut order: Vec<(u64, usize)> = (0..scene.items.len()).map(code).collect();
        order.sort_unstable();
        let (mut ids, mut boxes) = (Packed::default(), Packed::default());
        let (mut id, mut low_corner) = (0, I64Vec3::ZERO);
        for &(_, item) in &order {
            let row = i64::from(scene.row_of(item as ItemId));
            ids.push_signed(row - id);
            let (min, max) = corners(item);
            for difference in (min - low_corner).to_array() {
                boxes.push_signed(difference);
            }
            for side in (max - min).to_array() {
                boxes.push(side as u64);
            }
            (id, low_corner) = (row, min);
        }
        let data = ViewData {
            scene: scene.name.clone(),
            path: path.to_owned(),
            items: scene.items.len(),
            up: scene.up.name(),
            steps,
            low: low.to_array(),
            extent: extent.to_array(),
            origin: scene.origin.to_array(),
            ids: ids.0,
            boxes: boxes.0,
            ..ViewData::default()
        };
        let order = order.into_iter().map(|(_, item)| item as ItemId);
        (data, order.collect())
    }
}

/// Scene-local to clip coordinates; near depth is -1, far depth 1.
fn clip_matrix(camera: &Camera, origin: DVec3, is_downward: bool) -> DMat4 {
    let Some(matrix) = camera.lens.matrix() else {
        let view = camera.frame.relative_to(origin).world_to_eye();
        return camera.lens.projection(ClipSpace::OpenGl) * view;
    };
    let [x, y, z, w] = matrix.rows().map(DVec4::from);
    let lowest = if matrix.is_from_zero() { 0.0 } else { -1.0 };
    let found = matrix.unprojected();
    let [near, far] = found.as_ref().map_or([lowest, 1.0], |found| found.depths);
    let z = (2.0 * z - (near + far) * w) / (far - near);
    // The page draws y upward, also for Vulkan.
    let y = if is_downward { -y } else { y };
    DMat4::from_cols(x, y, z, w).transpose() * DMat4::from_translation(origin)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Lens, MatrixConvention};
    use crate::scene::UpAxis;

    #[test]
    fn the_view_of_a_vulkan_matrix_is_upright() {
        let frame = crate::camera::look_at(DVec3::X, DVec3::ZERO, DVec3::Z).unwrap();
        let lens = Lens::perspective(60.0, 1.5, 0.5, Some(40.0)).unwrap();
        let above = DVec4::new(0.0, 0.0, 0.1, 1.0);
        // As it is, with y downward (Vulkan), and in a left-handed world.
        for (x, y) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0)] {
            let flip = DMat4::from_scale(DVec3::new(x, y, 1.0));
            let matrix = flip * lens.projection(ClipSpace::D3d) * frame.world_to_eye();
            let [by_rows, by_columns] = [matrix, matrix.transpose()].map(|m| m.to_cols_array_2d());
            for (entries, convention) in [
                (by_columns, MatrixConvention::ColumnD3d),
                (by_rows, MatrixConvention::RowD3d),
            ] {
                let camera = [Camera::of_matrix(entries, convention).unwrap()];
                let downward = path::is_downward(&camera, UpAxis::Z);
                let seen = clip_matrix(&camera[0], DVec3::ZERO, downward) * above;
                assert!(seen.y > 0.0, "{x}, {y}: {seen}");
                let matrix = CameraFacts::of(&camera, UpAxis::Z).matrix.unwrap();
                let right = frame.u() * x;
                assert!(DVec3::from(matrix.up).z > 0.9, "{matrix:?}");
                assert!(DVec3::from(matrix.right).dot(right) > 0.9, "{matrix:?}");
            }
        }
    }

    #[test]
    fn numbers_and_runs_are_packed_as_the_page_reads_them() {
        let mut packed = Packed::default();
        [0, 31, 32, 1023, 1024]
            .into_iter()
            .for_each(|n| packed.push(n));
        [0, -1, 1, -2, i64::MIN]
            .into_iter()
            .for_each(|n| packed.push_signed(n));
        assert_eq!(packed.0, "AfgB_fggBABCD____________P");
        let set = |text: &str| runs(text.bytes().map(|b| b == b'x'));
        assert_eq!(
            [set(""), set("..."), set("x"), set("..x.xxx")],
            ["", "", "A", "EDB"]
        );
    }
}
