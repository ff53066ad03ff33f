//! `cullbench scene`: looking at scenes, and writing generated ones and those
//! of other formats as boxes.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use anyhow::bail;
use serde_json::{Value, json};

use super::command_args::{SceneConvertArgs, SceneGenerateArgs, SceneInfoArgs};
use super::scene_facts::{SceneFacts, people};
use super::shared_args::TableFormat;
use super::{Ending, expect_places, interrupt, load_scene, print_json, scene_facts, tell, text};
use crate::measure::SceneInfo;
use crate::path::{self, CameraFacts};
use crate::report::write_atomically;
use crate::scene::{Regions, Scene, UpAxis, write_boxes_csv};

pub fn info(args: &SceneInfoArgs) -> anyhow::Result<Ending> {
    let scene = load_scene(&args.scene, &args.lens.scene_args.options(1))?;
    let defaults = args.lens.defaults()?.of_scene(&scene);
    let path = args.path.as_ref();
    let path = path.map(|path| path::load(path, &scene, &defaults));
    let cameras = path.transpose()?.map_or(Vec::new(), |path| path.cameras);
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
            value["cameras"] = json!({
                "name": path,
                "camera_count": cameras.len(),
                "lens": facts,
                "warnings": path::warnings(&scene, path, &cameras),
            });
        }
        value["region_kind"] = json!(scene.regions.kind());
        value["portal_count"] = json!(portals);
        if let Some(surfaces) = &scene.surfaces {
            value["triangle_count"] = json!(surfaces.triangles.len());
        }
        value["camera_place_count"] = json!(scene.places.len());
        if let (Some(all), Value::Object(own)) =
            (value.as_object_mut(), serde_json::to_value(&figures)?)
        {
            all.extend(own);
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
    let regions = (people(info.region_count), scene.regions.kind());
    rows.push(("regions", format!("{}: {}", regions.0, regions.1)));
    match (&facts, &args.path) {
        (Some(facts), Some(path)) => {
            let views = text::counted(cameras.len(), "camera");
            let lens = scene_facts::lens(facts);
            rows.push(("cameras", text::plain(&format!("{path}: {views}, {lens}"))));
            let matrix = facts.matrix.as_ref().map(scene_facts::matrices);
            rows.extend(matrix.map(|matrix| ("matrices", matrix)));
        }
        _ => {
            let lens = scene_facts::default_lens(&defaults);
            rows.push(("cameras", format!("recorded ones without a lens: {lens}")));
        }
    }
    if let Some(surfaces) = &scene.surfaces {
        rows.push(("triangles", people(surfaces.triangles.len())));
    }
    if portals > 0 {
        rows.push(("portals", text::count(portals)));
    }
    if !scene.places.is_empty() {
        rows.push(("places", text::counted(scene.places.len(), "camera")));
    }
    if info.skipped_items > 0 {
        rows.push(("left out", text::counted(info.skipped_items, "bad item")));
    }
    for labels in &scene.labels {
        let counts = labels.histogram();
        let one = |(label, count): &(&str, usize)| {
            let label = if label.is_empty() { "(none)" } else { label };
            // Beside a count and commas.
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
    let row = |(name, value): (&str, String)| [name.to_owned(), value];
    let rows: Vec<_> = rows.into_iter().map(row).collect();
    write!(io::stdout(), "{}", text::entries(&rows, text::width()))?;
    Ok(Ending::Ok)
}

pub fn generate(args: &SceneGenerateArgs) -> anyhow::Result<Ending> {
    let out = expect_other(args.out.as_deref(), &args.scene)?;
    let scene = load_scene(&args.scene, &args.scene_args.options(0))?;
    write(scene.settled()?, out)
}

pub fn convert(args: &SceneConvertArgs) -> anyhow::Result<Ending> {
    let out = args.output.as_deref().or(args.out.as_deref());
    if args.to.is_none() {
        expect_csv(out)?;
    }
    let out = expect_other(out, &args.scene)?;
    let scene = load_scene(&args.scene, &args.scene_args.options(0))?;
    let (origin, lost) = (scene.origin, left_behind(&scene));
    let kept = scene.settled()?;
    if kept.skipped_items > 0 {
        tell("note: ids of the new file are its own rows, without the bad items");
    }
    if !lost.is_empty() {
        let what = "not written; boxes CSV has boxes and labels only";
        tell(&format!("note: {} {what}", lost.join(", ")));
    }
    if kept.up != UpAxis::default() {
        let up = kept.up.name();
        tell(&format!(
            "note: the file does not state that {up} is up; expected with it: --up {up}"
        ));
    }
    if kept.origin != origin {
        let new = kept.origin;
        tell(&format!(
            "note: the file will be read with the origin {new}, not {origin}"
        ));
    }
    write(kept, out)
}

/// The file to write, which is not the input; none for standard output.
fn expect_other<'f>(out: Option<&'f Path>, scene: &str) -> anyhow::Result<Option<&'f Path>> {
    let out = out.filter(|out| *out != Path::new("-"));
    expect_places(&[("--out", &out.map(Path::to_owned))], &[scene])?;
    Ok(out)
}

/// Refuses another extension; a file without one gets boxes too.
fn expect_csv(out: Option<&Path>) -> anyhow::Result<()> {
    let named = out.and_then(|out| Some((out.display(), out.extension()?)));
    if let Some((out, extension)) = named.filter(|(_, e)| !e.eq_ignore_ascii_case("csv")) {
        let extension = extension.display();
        bail!("{out}: a scene cannot be written as '.{extension}'; expected .csv, or --to csv");
    }
    Ok(())
}

/// Parts of a scene that a boxes file cannot hold.
fn left_behind(scene: &Scene) -> Vec<String> {
    let regions = match scene.regions {
        Regions::Items => 0,
        _ => scene.regions.boxes(&scene.items).len(),
    };
    let triangles = scene.surfaces.as_ref().map_or(0, |s| s.triangles.len());
    let counts = [
        (regions, "region"),
        (scene.places.len(), "camera place"),
        (triangles, "triangle"),
    ];
    let counts = counts.into_iter().filter(|(count, _)| *count > 0);
    let counts = counts.map(|(count, what)| text::counted(count, what));
    let own_tree = (scene.own_tree.iter()).map(|_| "the map's own tree".to_owned());
    counts.chain(own_tree).collect()
}

fn write(scene: Scene, out: Option<&Path>) -> anyhow::Result<Ending> {
    match out {
        Some(path) => {
            interrupt::from_now_on_finish();
            let written =
                write_atomically(path, |out| write_boxes_csv(&scene, UntilInterrupted(out)));
            if interrupt::asked() {
                return Ok(Ending::Interrupted);
            }
            written?;
            let items = text::counted(scene.items.len(), "item");
            tell(&format!("{}: {items}", path.display()));
        }
        None => {
            let mut out = BufWriter::new(io::stdout().lock());
            write_boxes_csv(&scene, &mut out)?;
            out.flush()?;
        }
    }
    Ok(Ending::Ok)
}

/// Output that fails after an interrupt; the half-written file is then removed.
struct UntilInterrupted<W>(W);

impl<W: Write> Write for UntilInterrupted<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if interrupt::asked() {
            return Err(io::Error::other("interrupted"));
        }
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}
