//! `cullbench scene`: facts about scenes, conversion to boxes, and drawings.
//!
//! Generated scenes and those of other formats are written as boxes. `scene draw` shows a scene
//! from above and the cells of a structure, with a camera in the colours of a query's verdicts.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use anyhow::{Context, bail};
use glam::Vec3;
use serde_json::json;

use super::command_args::{SceneConvertArgs, SceneDrawArgs, SceneGenerateArgs, SceneInfoArgs};
use super::plan::Plan;
use super::scene_facts::{self, SceneFacts, people};
use super::shared_args::TableFormat;
use super::sheet::{Cells, Class};
use super::{Ending, expect_places, interrupt, load_scene, print_json, text, write_text};
use crate::culling::Culling;
use crate::geometry::Aabb;
use crate::index::{Registry, Row, StructureSpec, verdicts};
use crate::input::warn;
use crate::measure::{SceneInfo, Workload, input_of};
use crate::path::{self, CameraFacts};
use crate::query::Containment;
use crate::report::write_atomically;
use crate::scene::{Regions, Scene, UpAxis, write_boxes_csv};

pub fn info(args: &SceneInfoArgs) -> anyhow::Result<Ending> {
    let scene = load_scene(&args.scene, &args.lens.scene_args.options(1))?;
    let defaults = args.lens.defaults()?.of_scene(&scene);
    let load = |path: &String| path::load(path, &scene, &defaults);
    let path = args.path.as_ref().map(load);
    let path = path.transpose()?.unwrap_or_default();
    // With the default culling test; another arithmetic may hold it.
    let refused = Workload::new(&scene, &path, &Culling::default()).err();
    refused.iter().for_each(|error| warn(&error.to_string()));
    let cameras = path.cameras;
    let facts = (!cameras.is_empty()).then(|| CameraFacts::of(&cameras, scene.up));
    let info = SceneInfo::of(&scene);
    let figures = SceneFacts::of(&scene)?;
    let portals = match &scene.regions {
        Regions::Tiling(tiling) => tiling.portals.len(),
        _ => 0,
    };
    if args.format == TableFormat::Json {
        let mut value = serde_json::to_value(&info)?;
        if let (Some(facts), Some(path)) = (&facts, &args.path) {
            let mut warnings = path::warnings(&scene, path, &cameras);
            warnings.extend(refused.map(|error| error.to_string()));
            value["cameras"] = json!({
                "name": path,
                "camera_count": cameras.len(),
                "lens": facts,
                "warnings": warnings,
            });
        }
        value["region_kind"] = json!(scene.regions.kind());
        value["portal_count"] = json!(portals);
        if let Some(surfaces) = &scene.surfaces {
            value["triangle_count"] = json!(surfaces.triangles.len());
        }
        value["camera_place_count"] = json!(scene.places.len());
        let figures = serde_json::to_value(&figures)?;
        for (name, figure) in figures.as_object().into_iter().flatten() {
            value[name] = figure.clone();
        }
        for labels in &scene.labels {
            value["labels"][&labels.column] = labels.histogram().into_iter().collect();
        }
        print_json(&value)?;
        return Ok(Ending::Ok);
    }
    let [low, high, origin] = [figures.bounds_min, figures.bounds_max, info.origin]
        .map(|v| format!("({})", v.map(text::short).join(", ")));
    let bounds = match info.total_count {
        0 => "none".to_owned(),
        _ => format!("{low} to {high}"),
    };
    let mut rows = vec![
        ("scene", text::plain(&info.name)),
        ("items", people(info.total_count)),
        ("bounds", bounds),
        ("origin", origin),
        ("axes", scene_facts::axes(&info)),
    ];
    rows.extend(figures.rows(&scene));
    let (regions, kind) = (people(info.region_count), scene.regions.kind());
    let views = text::counted(cameras.len(), "camera");
    let seen = match facts.as_ref().zip(args.path.as_ref()) {
        Some((facts, path)) => format!("{path}: {views}, {}", scene_facts::lens(facts)),
        None => {
            let lens = scene_facts::default_lens(&defaults);
            format!("recorded ones without a lens: {lens}")
        }
    };
    let matrix = facts.as_ref().and_then(|facts| facts.matrix.as_ref());
    let triangles = scene.surfaces.as_ref().map(|s| s.triangles.len());
    let (portals, bad) = ((portals > 0).then_some(portals), info.skipped_items);
    let more = [
        ("regions", format!("{regions}: {kind}")),
        ("cameras", text::plain(&seen)),
        ("matrices", text::some(matrix, scene_facts::matrices)),
        ("triangles", text::some(triangles, people)),
        ("portals", text::some(portals, text::count)),
        ("places", text::any(scene.places.len(), "camera", |all| all)),
        ("left out", text::any(bad, "bad item", |all| all)),
    ];
    rows.extend(more.into_iter().filter(|(_, text)| !text.is_empty()));
    for labels in &scene.labels {
        let counts = labels.histogram();
        let one = |(label, count): &(&str, usize)| {
            let label = if label.is_empty() { "(none)" } else { label };
            // Next to a count and commas.
            let quote = ["", "'"][usize::from(label.contains([',', ' ']))];
            format!("{quote}{label}{quote} {}", text::count(*count))
        };
        let shown: Vec<String> = counts.iter().take(8).map(one).collect();
        let mut shown = shown.join(", ");
        if counts.len() > 8 {
            shown += &format!(", and {} more", text::count(counts.len() - 8));
        }
        rows.push(("label", text::plain(&format!("{}: {shown}", labels.column))));
    }
    rows.push(("SHA-256", format!("{} (of the boxes)", info.digest)));
    let rows = rows.iter().map(|(name, value)| [*name, value]);
    write!(io::stdout(), "{}", text::entries(rows, text::width()))?;
    Ok(Ending::Ok)
}

pub fn generate(args: &SceneGenerateArgs) -> anyhow::Result<Ending> {
    let out = expect_other(args.out.as_deref(), &args.scene)?;
    let scene = load_scene(&args.scene, &args.scene_args.options(0))?;
    write(scene.settled()?, out)
}

pub fn convert(args: &SceneConvertArgs) -> anyhow::Result<Ending> {
    let out = args.output.as_deref().or(args.out.as_deref());
    // Another extension is refused; a file without one gets boxes too.
    let named = out.filter(|_| args.to.is_none());
    let named = named.and_then(|out| Some((out.display(), out.extension()?)));
    if let Some((out, extension)) = named.filter(|(_, e)| !e.eq_ignore_ascii_case("csv")) {
        let extension = extension.display();
        bail!("{out}: a scene cannot be written as '.{extension}'; expected .csv, or --to csv");
    }
    let out = expect_other(out, &args.scene)?;
    let scene = load_scene(&args.scene, &args.scene_args.options(0))?;
    let (origin, lost) = (scene.origin, left_behind(&scene));
    let kept = scene.settled()?;
    if kept.skipped_items > 0 {
        tell!("note: ids of the new file are its own rows, without the bad items");
    }
    if !lost.is_empty() {
        tell!("note: {lost} not written; boxes CSV has boxes and labels only");
    }
    if kept.up != UpAxis::default() {
        let up = kept.up.name();
        tell!("note: the file does not state that {up} is up; expected with it: --up {up}");
    }
    if kept.origin != origin {
        let new = kept.origin;
        tell!("note: the file will be read with the origin {new}, not {origin}");
    }
    write(kept, out)
}

/// The file to write, which must not be the input; `None` for standard output.
fn expect_other<'f>(out: Option<&'f Path>, scene: &str) -> anyhow::Result<Option<&'f Path>> {
    let out = out.filter(|out| *out != Path::new("-"));
    expect_places(&[("--out", &out.map(Path::to_owned))], &[scene])?;
    Ok(out)
}

/// Parts of a scene that a boxes file cannot hold.
fn left_behind(scene: &Scene) -> String {
    let regions = match scene.regions {
        Regions::Items => 0,
        _ => scene.regions.boxes(&scene.items).len(),
    };
    let triangles = scene.surfaces.as_ref().map_or(0, |s| s.triangles.len());
    text::joined([
        text::any(regions, "region", |all| all),
        text::any(scene.places.len(), "camera place", |all| all),
        text::any(triangles, "triangle", |all| all),
        text::some(scene.own_tree.as_ref(), |_| "the map's own tree".to_owned()),
    ])
}

fn write(scene: Scene, out: Option<&Path>) -> anyhow::Result<Ending> {
    match out {
        Some(path) => {
            interrupt::from_now_on_finish();
            let written =
                write_atomically(path, |out| write_boxes_csv(&scene, UntilInterrupted(out)));
            if written.is_err() {
                interrupt::check()?;
            }
            written?;
            let items = text::counted(scene.items.len(), "item");
            tell!("{}: {items}", path.display());
        }
        None => {
            let mut out = BufWriter::new(io::stdout().lock());
            write_boxes_csv(&scene, &mut out)?;
            out.flush()?;
        }
    }
    Ok(Ending::Ok)
}

/// Output that fails after an interrupt; the partial file is then removed.
struct UntilInterrupted<W>(W);

impl<W: Write> Write for UntilInterrupted<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        interrupt::check().map_err(io::Error::other)?;
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

/// Items of a scene without a camera.
const ITEMS: &[Class] = rows! { Class { colour, words, is_key }
    "#9fb4c4", "items", false;
};

/// Items of a scene with a camera.
const SEEN: &[Class] = rows! { Class { colour, words, is_key }
    "#c8cdd2", "outside of the frustum", false;
    "#009e73", "visible", true;
};

/// Items by their treatment in a structure's query.
const VERDICTS: &[Class] = rows! { Class { colour, words, is_key }
    "#c8cdd2", "outside, rejected with their cell", false;
    "#cc79a7", "outside, tested one by one", false;
    "#009e73", "visible, tested one by one", true;
    "#005c43", "visible, accepted with their cell", true;
};
const REJECTED: usize = 0;
const OUTSIDE: usize = 1;
const VISIBLE: usize = 2;
const ACCEPTED: usize = 3;

/// Cells without a camera.
const CELLS: &[Class] = rows! { Class { colour, words, is_key }
    "#0072b2", "cells", false;
};

/// Cells by the verdict of a query.
const CELL_VERDICTS: &[Class] = rows! { Class { colour, words, is_key }
    "#b0b0b0", "cells not reached", false;
    "#d55e00", "cells rejected, outside", true;
    "#009e73", "cells accepted, inside", true;
    "#0072b2", "cells opened, across a plane", false;
};

pub fn draw(registry: &Registry, args: &SceneDrawArgs) -> anyhow::Result<Ending> {
    let inputs: Vec<&String> = args.camera.iter().chain([&args.scene]).collect();
    expect_places(&[("--out", &Some(args.out.clone()))], &inputs)?;
    let defaults = args.lens.defaults()?;
    let structure = args.structure.as_deref();
    let structure = structure.map(|text| divided(registry, text)).transpose()?;
    let loading = args.lens.scene_args.options(structure.iter().len());
    let scene = load_scene(&args.scene, &loading)?;
    let mut caption = vec![scene.name.clone()];
    if scene.skipped_items > 0 {
        caption.push(text::items(scene.items.len(), scene.skipped_items));
    }
    let (around, mut seen) = (scene.surroundings(), None);
    if let Some(source) = &args.camera {
        let path = path::load(source, &scene, &defaults)?;
        let (frame, last) = (args.frame as usize, path.cameras.len().saturating_sub(1));
        let Some(camera) = path.cameras.get(frame) else {
            let cameras = format!("0 to {last}, the cameras of {}", path.name);
            bail!("--frame is {frame}; expected {cameras}");
        };
        caption.push(format!("camera {frame} of {}", path.name));
        let view = Culling::default().view(camera, &around);
        seen = Some((*camera, view.with_context(|| path.place(frame))?));
    }
    let view = seen.as_ref().map(|(_, view)| view);
    let index = structure.as_ref().map(|spec| {
        caption.push(format!("{}, levels 0 to {}", spec.label, args.depth));
        spec.build(input_of(&scene, &scene.items))
    });
    let index = index.transpose()?;
    let cells = index.as_ref().map_or(Vec::new(), |index| index.cells());
    let verdicts = view.as_ref().map(|view| verdicts(&cells, view.as_any()));
    let (classes, class_of) = match (&view, &index, &verdicts) {
        // By the treatment of each item in the structure's query.
        (Some(view), Some(index), Some(verdicts)) => {
            let (mut class_of, mut visible) = (vec![REJECTED; scene.items.len()], Vec::new());
            index.query(view.as_any(), &mut visible);
            (visible.iter()).for_each(|&item| class_of[item as usize] = ACCEPTED);
            let opened = cells.iter().zip(verdicts);
            let opened = opened.filter(|(_, verdict)| **verdict == Some(Containment::Straddles));
            for &item in opened.flat_map(|(cell, _)| cell.items) {
                let class = &mut class_of[item as usize];
                *class = if *class == ACCEPTED { VISIBLE } else { OUTSIDE };
            }
            (VERDICTS, class_of)
        }
        (Some(view), ..) => {
            let class = |item: &Aabb| usize::from(view.as_any().sees(item));
            (SEEN, scene.items.iter().map(class).collect())
        }
        _ => (ITEMS, vec![0; scene.items.len()]),
    };
    let class_of_cell = |cell: usize| match verdicts.as_ref().and_then(|all| all[cell]) {
        None => 0,
        Some(Containment::Outside) => 1,
        Some(Containment::Inside) => 2,
        Some(Containment::Straddles) => 3,
    };
    let plan = Plan {
        caption: caption.join("; "),
        scene: &scene,
        camera: seen.as_ref().map(|(camera, _)| camera),
        classes,
        class_of: &|item| class_of[item],
        cells: index.is_some().then(|| Cells {
            cells: &cells,
            classes: [CELLS, CELL_VERDICTS][usize::from(view.is_some())],
            class_of: &class_of_cell,
            depth: args.depth,
        }),
    };
    write_text(&args.out, &plan.svg())?;
    let mut told = text::items(scene.items.len(), scene.skipped_items);
    if index.is_some() {
        told += &format!(", {}", text::counted(cells.len(), "cell"));
    }
    if let Some(verdicts) = verdicts.filter(|_| index.is_some()) {
        let tested = verdicts.iter().flatten().count();
        told += &format!(", of which the query tests {}", text::count(tested));
    }
    let deeper = cells.iter().filter(|cell| cell.level > args.depth).count();
    told += &text::any(deeper, "cell", |deeper| {
        format!("; not drawn: {deeper} below level {}", args.depth)
    });
    tell!("{}: {told}", args.out.display());
    Ok(Ending::Ok)
}

/// A structure with cells.
fn divided(registry: &Registry, text: &str) -> anyhow::Result<StructureSpec> {
    let spec = registry.structure(text)?;
    // More boxes than the largest block holds.
    let cube = |i: u8| Aabb::around(Vec3::splat(i.into()), Vec3::splat(0.25));
    let boxes: Vec<Aabb> = (0..64).map(cube).collect();
    let has_cells = |row: &&Row| {
        let spec = registry.structure(row.info.name);
        let index = spec.ok().and_then(|spec| spec.build(&boxes).ok());
        index.is_some_and(|index| !index.cells().is_empty())
    };
    if has_cells(&&spec.row) {
        return Ok(spec);
    }
    let rows = registry.rows().iter().filter(has_cells);
    let names: Vec<_> = rows.map(|row| row.info.name).collect();
    let (name, names) = (spec.info().name, names.join(", "));
    bail!("structure '{name}' has no cells to draw; expected one of {names}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::TreeCell;
    use crate::path::LensDefaults;
    use crate::query::{AnyVolume, ItemId, QueryCost};
    use crate::scene;

    /// Costs of a query according to the cells.
    ///
    /// Nodes tested and rejected, items tested and accepted untested.
    fn shown(cells: &[TreeCell<'_>], volume: AnyVolume<'_>) -> [usize; 4] {
        let (mut cost, mut inside) = ([0; 4], None);
        for (cell, verdict) in cells.iter().zip(verdicts(cells, volume)) {
            inside = inside.filter(|level| *level < cell.level);
            match verdict {
                Some(Containment::Inside) => inside = Some(cell.level),
                Some(Containment::Outside) => cost[1] += 1,
                Some(Containment::Straddles) => cost[2] += cell.items.len(),
                None => {}
            }
            cost[0] += usize::from(verdict.is_some());
            cost[3] += inside.map_or(0, |_| cell.items.len());
        }
        cost
    }

    #[test]
    fn cells_hold_each_item_once_and_show_what_a_query_counts() {
        let scene = scene::load("city:n=3000", &Default::default()).expect("a scene");
        let cameras = path::load("flythrough:frames=6", &scene, &LensDefaults::default());
        let cameras = cameras.expect("a path").cameras;
        let mut drawn = Vec::new();
        for spec in Registry::builtin().structures("all").expect("names") {
            let index = spec.build(&scene.items).expect("a structure");
            let cells = index.cells();
            if cells.is_empty() {
                continue;
            }
            drawn.push(spec.info().name);
            let mut ids: Vec<ItemId> = Vec::new();
            for cell in &cells {
                let within = |id: &ItemId| cell.bounds.contains(&scene.items[*id as usize]);
                assert!(cell.items.iter().all(within), "{}: {cell:?}", spec.label);
                ids.extend(cell.items);
            }
            ids.sort_unstable();
            assert!(ids.iter().copied().eq(0..3000), "{}", spec.label);
            for camera in &cameras {
                let volume = camera.volume(&Default::default(), &scene.surroundings());
                let volume = volume.expect("a frustum");
                let (mut seen, mut cost) = (Vec::new(), QueryCost::default());
                index.query_counted((&volume).into(), &mut seen, &mut cost);
                let nodes = [cost.nodes_tested, cost.subtrees_rejected];
                let items = [cost.items_tested, cost.items_accepted_untested];
                let counted = [nodes, items].concat().into_iter().map(|n| n as usize);
                let shown = shown(&cells, (&volume).into());
                assert_eq!(counted.collect::<Vec<_>>(), shown, "{}", spec.label);
            }
        }
        assert!(drawn.len() >= 8, "{drawn:?}");
    }
}
