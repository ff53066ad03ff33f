//! `cullbench view`: one page with a scene in 3-D along a path.
//!
//! Items have the colours of their verdicts in each view.

use std::io::{self, Write};

use anyhow::{Context, ensure};
use glam::{DMat4, DVec3, DVec4, I64Vec3, Vec3};
use obvhs::ploc::morton::morton_encode_u64;
use serde_json::{Value, json};

use super::command_args::ViewArgs;
use super::document::{Block, elements, page};
use super::funnel_table::count;
use super::query::{Row, ask_all, frustum};
use super::study::progress;
use super::text::{self, html};
use super::{Ending, expect_places, load_scene, program, scene_facts, unread_is_fine, write_text};
use crate::camera::{Camera, ClipSpace};
use crate::culling::CameraView;
use crate::funnel::{RayTargets, Shape};
use crate::geometry::Aabb;
use crate::index::{Registry, TreeCell, verdicts};
use crate::input::{note, tell_warnings, warnings};
use crate::measure::{SceneInfo, Workload, input_of};
use crate::oracle::Verdict;
use crate::path::{self, CameraFacts};
use crate::query::ItemId;
use crate::report::grouped;
use crate::scene::{Scene, Surfaces};
use crate::verify::Truth;
use crate::visibility::Rays;

/// Most items for a browser to draw.
const MOST_ITEMS: usize = 2_000_000;
/// Most triangles; beyond, the boxes of the items are drawn.
const MOST_TRIANGLES: usize = 300_000;

pub fn view(registry: &Registry, args: &ViewArgs) -> anyhow::Result<Ending> {
    let out = Some(args.out.clone());
    expect_places(&[("--out", &out)], &[&args.scene, &args.path])?;
    let structures = args.culling.kernel.structures(registry, &args.structure)?;
    let defaults = args.culling.lens.defaults()?;
    let culling = args.culling.culling(&args.test)?;
    let scene = load_scene(&args.scene, &args.culling.lens.scene_args.options(1))?;
    let items = scene.items.len();
    let (name, found, most) = (&scene.name, text::count(items), text::count(MOST_ITEMS));
    ensure!(
        items <= MOST_ITEMS,
        "{name}: {found} items; expected at most {most} to draw"
    );
    let cameras = path::load(&args.path, &scene, &defaults)?;
    let (all, most) = (cameras.cameras.len(), args.frames);
    let cameras = cameras.at_most(most);
    let workload = Workload::new(&scene, &cameras, &culling)?;
    tell_warnings();
    culling.unproven().iter().for_each(|doubt| note(doubt));
    let surfaces = scene.surfaces.as_ref();
    let triangles = surfaces.map_or(0, |all| all.triangles.len());
    let drawn = surfaces.filter(|_| triangles <= MOST_TRIANGLES);
    let grid = Grid::of(&scene, drawn.map_or(0, |_| triangles));
    let order = grid.order(&scene.items);
    let (mut answers, mut costs) = (Vec::<Box<[ItemId]>>::new(), Vec::new());
    let (ask, boxes, views) = (frustum(&workload), &workload.items, workload.views.len());
    let bar = progress((views * (structures.len() + 1)) as u64, " views");
    let mut each = |rows: Vec<Row>| {
        bar.inc(rows.len() as u64);
        for row in rows {
            let tested = [row.cost.nodes_tested, row.cost.items_tested];
            costs.push((row.structure, tested));
            if answers.len() == row.question {
                answers.extend(row.ids);
            }
        }
        Ok(())
    };
    let questions = ("camera", views);
    let agree = ask_all(&structures, &scene, boxes, questions, true, ask, &mut each)?;
    let costs = grouped(costs.into_iter());
    // Nodes of the first structure that has any.
    let nodes = structures.iter().find_map(|spec| {
        let index = spec.build(input_of(&scene, boxes)).ok()?;
        let cells = index.cells();
        cells.first()?;
        Some((&spec.label, grid.nodes(&cells, &workload.views)))
    });
    let threads = args.culling.kernel.execution()?.threads;
    let ends = args
        .samples
        .map(|grid| (RayTargets::of(&Shape::of(&scene), None), grid));
    let downward = path::is_downward(&path::decomposed(&cameras.cameras), scene.up);
    let (mut totals, mut frames) = ([0; KINDS], Vec::new());
    for (view, answer) in answers.iter().enumerate() {
        let camera = &cameras.cameras[view];
        let front = ends.as_ref().map(|(ends, grid)| {
            let rays = Rays::of(camera)?;
            let truth = ends.visible(&rays, *grid, threads);
            Ok(truth.map_err(anyhow::Error::msg)?.visible)
        });
        let front: anyhow::Result<_> = front.transpose();
        let front = front.with_context(|| cameras.place(view))?;
        let truth = Truth::of_scene(camera, &scene);
        let fates = fates(items, answer, truth.as_ref(), front.as_deref());
        fates.iter().for_each(|fate| totals[*fate as usize] += 1);
        let kinds: Vec<u8> = order.iter().map(|&id| fates[id as usize] as u8).collect();
        frames.push(json!({
            "camera": if all > most { view * all / most } else { view },
            "clip": clip_matrix(camera, scene.origin, downward).to_cols_array(),
            "fates": runs(&kinds),
        }));
        bar.inc(1);
    }
    bar.finish_and_clear();
    let samples = args
        .samples
        .map(|grid| format!("{}x{}", grid.width, grid.height));
    let count = costs.len();
    let structures = match (costs.as_slice(), agree) {
        ([(one, _)], _) => format!("The structure is {one}."),
        (_, true) => format!("All {count} structures return the same sets."),
        (_, false) => format!("The {count} structures disagree; the sets are the first one's."),
    };
    let means = totals.map(|count: usize| count as f64 / views as f64);
    let found = conclusion(means, samples.as_deref());
    let (path, seen) = (&cameras.name, text::counted(views, "view"));
    let told = format!("{seen} of {path}: {found}. {structures}");
    let facts = CameraFacts::of(&cameras.cameras, scene.up);
    let axes = scene_facts::axes(&SceneInfo::of(&scene));
    let lens = scene_facts::lens(&facts);
    let matrix = text::some(facts.matrix.as_ref(), |matrix| {
        format!("; matrices: {}", scene_facts::matrices(matrix))
    });
    let test = culling.test.name();
    let items = text::items(scene.items.len(), scene.skipped_items);
    let about = format!("Scene: {items}, {axes}. Lens: {lens}{matrix}. Test: {test}.");
    let mut ids = Packed::default();
    (order.iter()).for_each(|&item| ids.push(scene.row_of(item).into()));
    let data = json!({
        "scene": scene.name,
        "path": path,
        "items": scene.items.len(),
        "up": scene.up.name(),
        "steps": grid.steps,
        "low": grid.low.to_array(),
        "extent": grid.extent.to_array(),
        "origin": scene.origin.to_array(),
        "ids": ids.0,
        "boxes": grid.boxes(order.iter().map(|&item| &scene.items[item as usize])),
        "triangles": triangles,
        "most_triangles": MOST_TRIANGLES,
        "mesh": drawn.map(|all| grid.mesh(all, &order)),
        "nodes": nodes,
        "samples": samples,
        "frames": frames,
        "structures": costs,
    });
    let json = data.to_string().replace('<', "\\u003c");
    let title = format!("{} view {}", program::name(), scene.name);
    let body = format!(
        "<main class=\"view\"><h1>{}, {}</h1>\n<p>{}</p>\n{}{}<p>{}</p>\n</main>\n\
         <script type=\"application/json\" id=\"data\">{json}</script>\n",
        html(&title),
        html(path),
        html(&told),
        elements("", &Vec::from_iter(Block::warnings(warnings()))),
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
    // Floors and ceilings of a map follow its items.
    let set = |ids: &[ItemId]| {
        let mut set = vec![false; items];
        let own = ids.iter().map(|&id| id as usize).filter(|&id| id < items);
        own.for_each(|id| set[id] = true);
        set
    };
    let (returned, in_front) = (set(answer), front.map(set));
    let fate = |item: usize| {
        let is_hidden = in_front.as_ref().is_some_and(|front| !front[item]);
        match (returned[item], truth.map(|truth| truth.verdicts[item])) {
            (true, Some(Verdict::Out)) => Fate::FalsePositive,
            (true, _) if is_hidden => Fate::Hidden,
            (true, _) => Fate::Visible,
            (false, Some(Verdict::In)) => Fate::Lost,
            (false, _) => Fate::Culled,
        }
    };
    (0..items).map(fate).collect()
}

/// The result in words.
fn conclusion(means: [f64; KINDS], samples: Option<&str>) -> String {
    let of = |fate: Fate| means[fate as usize];
    let items = text::counted(means.iter().sum::<f64>().round() as usize, "item");
    let told = |fate: Fate, none: &str, some: &str| match of(fate) {
        0.0 => none.to_owned(),
        mean => format!("{} {some}", text::significant(mean)),
    };
    let (none, some) = ("no false positive", "false positives per view");
    let extra = told(Fate::FalsePositive, none, some);
    let hidden = text::some(samples, |samples| {
        let hidden = text::significant(of(Fate::Hidden));
        format!("{hidden} hidden (in front at none of {samples} samples)")
    });
    let lost = told(Fate::Lost, "no visible item lost", "visible items lost");
    // Those between culled and lost.
    let returned = count(means[1..4].iter().sum());
    let returned = format!("{returned} of {items} returned per view");
    text::joined([returned, extra, hidden, lost])
}

/// Result for an item in a view, one of [`KINDS`].
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Fate {
    Culled,
    Visible,
    FalsePositive,
    Hidden,
    Lost,
}

/// Scene-local to clip coordinates; near depth is -1, far depth 1.
fn clip_matrix(camera: &Camera, origin: DVec3, is_downward: bool) -> DMat4 {
    let Some(matrix) = camera.lens.matrix() else {
        let view = camera.frame.relative_to(origin).world_to_eye();
        return camera.lens.projection(ClipSpace::OpenGl) * view;
    };
    let [x, y, z, w] = matrix.rows().map(DVec4::from);
    let [near, far] = matrix.depths();
    let z = (2.0 * z - (near + far) * w) / (far - near);
    // The page draws y upward, also for Vulkan.
    let y = if is_downward { -y } else { y };
    DMat4::from_cols(x, y, z, w).transpose() * DMat4::from_translation(origin)
}

/// Most nodes drawn per view.
const MOST_NODES: usize = 256;

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
    fn push_signed(&mut self, numbers: I64Vec3) {
        for number in numbers.to_array() {
            self.push((number << 1 ^ number >> 63) as u64);
        }
    }
}

/// Most kinds of an item or node in a view.
const KINDS: usize = 5;

/// Run-length encoding of kinds: (length - 1) * [`KINDS`] + kind.
fn runs(kinds: &[u8]) -> String {
    let mut packed = Packed::default();
    for run in kinds.chunk_by(u8::eq) {
        packed.push(((run.len() - 1) * KINDS + usize::from(run[0])) as u64);
    }
    packed.0
}

/// Grid of drawn positions: steps from the lowest corner of all items.
struct Grid {
    /// Steps per axis to which corners are rounded, outward.
    steps: u32,
    /// Lowest corner of all items, scene-local.
    low: DVec3,
    /// Extent of all items.
    extent: DVec3,
}

impl Grid {
    /// The grid of a scene with this number of triangles.
    fn of(scene: &Scene, triangles: usize) -> Grid {
        let bounds = scene.world_bounds();
        // Few items may be far smaller than the scene.
        let steps = 1 << [20, 16][usize::from(scene.items.len() + triangles > 20_000)];
        let (low, extent) = (bounds.min - scene.origin, bounds.max - bounds.min);
        Grid { steps, low, extent }
    }

    /// Position of a point in steps; nodes may reach beyond the items.
    fn at(&self, point: Vec3) -> DVec3 {
        let steps = f64::from(self.steps);
        let scale = self.extent.map(|e| if e > 0.0 { steps / e } else { 0.0 });
        ((point.as_dvec3() - self.low) * scale).clamp(DVec3::ZERO, DVec3::splat(steps))
    }

    fn corners(&self, b: &Aabb) -> [I64Vec3; 2] {
        let [min, max] = [b.min, b.max].map(|corner| self.at(corner));
        [min.floor().as_i64vec3(), max.ceil().as_i64vec3()]
    }

    /// The items in the order of a curve.
    fn order(&self, items: &[Aabb]) -> Vec<ItemId> {
        let code = |(item, b): (usize, &Aabb)| {
            let [min, max] = self.corners(b);
            let [x, y, z] = ((min + max) / 2).to_array().map(|c| c as u32);
            (morton_encode_u64(x, y, z), item as ItemId)
        };
        let mut order: Vec<_> = items.iter().enumerate().map(code).collect();
        order.sort_unstable();
        order.into_iter().map(|(_, item)| item).collect()
    }

    /// Lower corner of each box minus the previous one, signed, and the extents.
    fn boxes<'b>(&self, boxes: impl Iterator<Item = &'b Aabb>) -> String {
        let (mut packed, mut before) = (Packed::default(), I64Vec3::ZERO);
        for b in boxes {
            let [min, max] = self.corners(b);
            packed.push_signed(min - before);
            let sides = (max - min).to_array();
            sides.into_iter().for_each(|side| packed.push(side as u64));
            before = min;
        }
        packed.0
    }

    /// Triangles of the items in their order.
    ///
    /// Three texts: triangles per item; for each corner 0 if its point is new, else how many new
    /// points ago it came, from 1; each point minus the previous one, signed.
    fn mesh(&self, all: &Surfaces, order: &[ItemId]) -> [String; 3] {
        let [mut counts, mut corners, mut points] = <[Packed; 3]>::default();
        // Index of each point, from 1, in order of occurrence.
        let mut numbers = vec![0; all.points.len()];
        let (mut count, mut before) = (0, I64Vec3::ZERO);
        for &item in order {
            let own = &all.triangles[all.range(item as usize)];
            counts.push(own.len() as u64);
            for &point in own.as_flattened() {
                let number = &mut numbers[point as usize];
                if *number > 0 {
                    corners.push(count + 1 - *number);
                    continue;
                }
                count += 1;
                *number = count;
                corners.push(0);
                let at = self.at(all.points[point as usize]).round().as_i64vec3();
                points.push_signed(at - before);
                before = at;
            }
        }
        [counts.0, corners.0, points.0]
    }

    /// Nodes that queries visit: their boxes, and for each view the kinds of all.
    ///
    /// Rejected (1), opened or accepted; per view the [`MOST_NODES`] of the upper levels.
    fn nodes(&self, cells: &[TreeCell<'_>], views: &[CameraView]) -> Value {
        let kinds = views.iter().map(|view| {
            let found = cells.iter().zip(verdicts(cells, view.as_any())).enumerate();
            let visited = found.filter_map(|(cell, (own, verdict))| {
                let kind = 1 + verdict? as u8;
                Some((own.level, cell, kind))
            });
            let mut visited: Vec<(u32, usize, u8)> = visited.collect();
            visited.sort_unstable();
            let mut kinds = vec![0; cells.len()];
            let drawn = visited.into_iter().take(MOST_NODES);
            drawn.for_each(|(_, cell, kind)| kinds[cell] = kind);
            kinds
        });
        let kinds: Vec<Vec<u8>> = kinds.collect();
        let is_drawn = |cell: &usize| kinds.iter().any(|kinds| kinds[*cell] > 0);
        let drawn = (0..cells.len()).filter(is_drawn);
        let boxes = self.boxes(drawn.map(|cell| &cells[cell].bounds));
        let kinds: Vec<String> = kinds.iter().map(|kinds| runs(kinds)).collect();
        json!({ "boxes": boxes, "kinds": kinds })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Lens, MatrixConvention};
    use crate::scene::UpAxis;

    #[test]
    fn whole_means_are_counts() {
        let told = |culled, visible| conclusion([culled, visible, 0.0, 0.0, 0.0], None);
        assert!(told(0.0, 1.0).starts_with("1 of 1 item returned per view"));
        assert!(told(1.5, 0.5).starts_with("0.500 of 2 items returned per view"));
    }

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
                let downward = path::is_downward(&path::decomposed(&camera), UpAxis::Z);
                let seen = clip_matrix(&camera[0], DVec3::ZERO, downward) * above;
                assert!(seen.y > 0.0, "{x}, {y}: {seen}");
                let matrix = CameraFacts::of(&camera, UpAxis::Z).matrix.unwrap();
                let right = frame.u() * x;
                assert!(DVec3::from(matrix.up).z > 0.9, "{matrix:?}");
                assert!(DVec3::from(matrix.right).dot(right) > 0.9, "{matrix:?}");
            }
        }
    }

    /// Past straight down, and upside down in OpenGL, in a left-handed world.
    #[test]
    fn a_mirrored_view_is_turned_over_only_where_y_may_point_down() {
        let lens = Lens::perspective(60.0, 1.5, 0.5, Some(40.0)).unwrap();
        let (over, mirror) = (DVec3::new(0.02, 0.0, 1.0), DVec3::new(-1.0, 1.0, 1.0));
        for (eye, up, clip, convention) in [
            (over, DVec3::X, ClipSpace::D3d, MatrixConvention::ColumnD3d),
            (
                DVec3::X,
                -DVec3::Z,
                ClipSpace::OpenGl,
                MatrixConvention::ColumnGl,
            ),
        ] {
            let frame = crate::camera::look_at(eye, DVec3::ZERO, up).unwrap();
            let matrix = DMat4::from_scale(mirror) * lens.projection(clip) * frame.world_to_eye();
            let entries = matrix.transpose().to_cols_array_2d();
            let camera = [Camera::of_matrix(entries, convention).unwrap()];
            let found = CameraFacts::of(&camera, UpAxis::Z).matrix.unwrap();
            assert!(DVec3::from(found.up).dot(up) > 0.9, "{found:?}");
        }
    }

    #[test]
    fn numbers_and_runs_are_packed_as_the_page_reads_them() {
        let mut packed = Packed::default();
        [0, 31, 32, 1023, 1024]
            .into_iter()
            .for_each(|n| packed.push(n));
        packed.push_signed(I64Vec3::new(0, -1, 1));
        packed.push_signed(I64Vec3::new(-2, i64::MIN, 0));
        assert_eq!(packed.0, "AfgB_fggBABCD____________PA");
        let of = |text: &str| runs(&text.bytes().map(|b| b - b'0').collect::<Vec<_>>());
        assert_eq!([of(""), of("4"), of("0001222")], ["", "E", "KBM"]);
    }
}
