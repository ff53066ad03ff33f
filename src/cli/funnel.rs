//! `cullbench funnel`: every stage from region to fragment, with its gain.
//!
//! All back ends of each stage on the views of a path. `funnel_table` displays the report.

use std::cell::Cell;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use serde_json::Value;

use super::command_args::FunnelArgs;
use super::document::{Block, show};
use super::figure::{Axis, Figure, LINE};
use super::page::to_page;
use super::plan::Plan;
use super::processes::Timing;
use super::query::cell;
use super::shared_args::TableFormat;
use super::sheet::Class;
use super::study::{ROUNDS, Study, load, note_solid};
use super::{
    Ending, expect_folder, expect_places, funnel_table, print, text, write_if, write_text,
};
use crate::funnel::{
    self, Chain, FunnelInput, FunnelReport, ItemOutcome, NONE, PickRow, StageKind, StageRow,
};
use crate::index::{Registry, StructureSpec};
use crate::measure::{ProcessTimes, Setting};
use crate::scene::Scene;
use crate::spec::SpecError;
use crate::visibility::{Guarantee, SampleGrid};

pub fn funnel(registry: &Registry, args: &FunnelArgs) -> Result<Ending> {
    expect_folder("--csv", args.csv.as_deref())?;
    let folder = args.csv.as_ref().filter(|folder| folder.is_dir());
    let tables = TABLES.lines().map(|line| Some(table_file(folder?, line)));
    let tables: Vec<_> = tables.collect();
    let mut outputs = vec![("--svg", &args.svg), ("--html", &args.html)];
    outputs.extend(tables.iter().map(|file| ("--csv", file)));
    let inputs = [Path::new(&args.study.scene), args.study.path.as_ref()];
    expect_places(&outputs, &inputs)?;
    let setting = load(registry, &args.study, ROUNDS, None, HELD)?;
    let input = input(args, &setting)?;
    let about = format!("{}, {}: ", args.study.scene, args.study.path);
    let study = Study::new(about, 1, &args.study.spread)?;
    if args.no_picks && !input.all {
        tell!("note: --no-picks has no effect; expected --all with it");
    }
    let SampleGrid { width, height } = input.samples;
    let items = text::counted(setting.scene.items.len(), "item");
    let views = input.most_views.min(setting.path.cameras.len());
    let views = text::counted(views, "view");
    let work = format!("{items}, {views} of {width}x{height} samples");
    let is_begun = Cell::new(false);
    let begin = |step: &str| {
        // Refusals come before the first step.
        if !is_begun.replace(true) {
            study.announce(&work, "less than a minute");
        }
        study.begin(step);
    };
    let prepared = funnel::prepare(&input, &begin)?;
    study.bar.inc(1);
    let path = &setting.path;
    let times = study.times("every stage, timed", path.lens_scale, &prepared.plan)?;
    if let Some(verdict) = funnel::failure(&times) {
        let reason = verdict.reason.as_deref().unwrap_or("no reason");
        bail!("a stage failed when it was timed: {reason}");
    }
    let report = prepared.conclude(&times);
    note_solid(&setting.scene, args.format);
    let table = || show(&funnel_table::blocks(&report, args.all));
    let shown = print(args.format, &report, table);
    if let Some(folder) = &args.csv {
        write(&report, folder)?;
    }
    write_if(&args.svg, || draw(&report, &setting.scene))?;
    write_if(&args.html, || page(&report, &setting.scene))?;
    shown?;
    Ok(Ending::of(keep_their_word(&report.stages, &report.picks)))
}

/// Returns true if no visible item is lost and no exact stage is wrong.
///
/// After an unproven stage of the chain, items become visible that lost ones hid.
fn keep_their_word(stages: &[StageRow], picks: &[PickRow]) -> bool {
    use Guarantee::{Exact, SampleExact, Unproven};
    let is_unproven = |row: &&StageRow| row.back_end.guarantee == Unproven;
    let chosen = stages.iter().filter(|row| row.is_chosen);
    let unproven = chosen.filter(is_unproven);
    let first = unproven.map(|row| row.back_end.stage).min();
    let mut judged = stages.iter().filter(|row| !is_unproven(row));
    let keeps_too_much = |row: &StageRow| {
        matches!(row.back_end.guarantee, Exact | SampleExact)
            && row.errors.false_positive_count > 0.0
            && first.is_none_or(|first| row.back_end.stage <= first)
    };
    let mut picks = picks.iter();
    judged.all(|row| row.errors.false_negative_count == 0.0 && !keeps_too_much(row))
        && picks.all(|row| row.guarantee != Exact || row.wrong_count == 0)
}

/// The named back ends, and the defaults that suit the scene.
fn chain(args: &FunnelArgs, scene: &Scene, structures: &[StructureSpec]) -> Result<Chain> {
    let typed = [
        (StageKind::Region, &args.region),
        (StageKind::Occlusion, &args.occlusion),
        (StageKind::Triangle, &args.triangle),
        (StageKind::Fragment, &args.fragment),
    ];
    let mut chain = Chain::for_scene(scene, structures, args.cut_out.is_some());
    for (stage, name) in typed {
        let Some(name) = name else { continue };
        let known = funnel::back_ends(stage, scene, args.cut_out.is_some());
        if !known.iter().any(|row| row.name == name) {
            let stage = stage.name();
            if let [_] = known[..] {
                let why = funnel::left_out_of(scene);
                let why = text::some(why, |row| format!(": {}", row.reason));
                let nothing = format!("scene '{}' has nothing for that stage{why}", scene.name);
                bail!("--{stage} is '{name}'; expected none: {nothing}");
            }
            if let Some([_, need]) = funnel::NEEDS.iter().find(|[own, _]| own == name) {
                bail!("--{stage} is '{name}'; expected {need}");
            }
            let names = known.iter().map(|row| row.name);
            let what = format!("back end of the {stage} stage");
            return Err(SpecError::unknown(&what, name, names).into());
        }
        chain = chain.with(stage, name);
    }
    Ok(chain)
}

/// Room for structures, one per named one and one more, and bytes per triangle.
const HELD: [u64; 3] = [1, 2, funnel::BYTES_PER_TRIANGLE];

fn input<'s>(args: &'s FunnelArgs, setting: &'s Setting) -> Result<FunnelInput<'s>> {
    let (study, views) = (&args.study, (args.frames as usize, args.samples));
    let chain = chain(args, &setting.scene, &setting.structures)?;
    let is_table = args.format == TableFormat::Table && args.html.is_none() && args.csv.is_none();
    Ok(FunnelInput {
        cut_outs: args.cut_out.as_ref(),
        inner_boxes: args.inner_boxes.map(|most| most as usize),
        all: args.all || !is_table,
        picks: !args.no_picks,
        loading: study.lens.scene_args.options(0),
        ..FunnelInput::new(setting, chain, views, study.kernel.execution()?)
    })
}

/// Times every stage in one process.
pub fn time(registry: &Registry, args: &FunnelArgs, timing: &Timing) -> Result<ProcessTimes> {
    let setting = load(registry, &args.study, ROUNDS, Some(timing), HELD)?;
    funnel::time(&input(args, &setting)?, &timing.plan()?)
}

/// Tables of the report, each a list of rows or a single row, with their fields.
///
/// `/` separates a field from its subfield. The columns are the same for every report.
const TABLES: &str = include_str!("assets/funnel_tables.txt");

/// Writes all tables, with full precision.
pub fn write(report: &FunnelReport, folder: &Path) -> Result<()> {
    fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let tables = serde_json::to_value(report)?;
    for (table, fields) in TABLES.lines().filter_map(|line| line.split_once(": ")) {
        let rows = match &tables[table] {
            Value::Array(rows) => &rows[..],
            Value::Null => &[],
            row => std::slice::from_ref(row),
        };
        let mut out = csv::Writer::from_writer(Vec::new());
        // `excess/lower` becomes `excess_lower`; a value has no suffix.
        let column = |path: &str| path.trim_end_matches("/value").replace('/', "_");
        let columns = fields.split_whitespace().map(column);
        let about = ["scene", "path"].map(str::to_owned).into_iter();
        out.write_record(about.chain(columns))?;
        for row in rows {
            let own = [&report.scene, &report.path].map(|name| text::lines(name));
            let fields = fields.split_whitespace();
            let cells = fields.map(|path| row.pointer(&format!("/{path}")));
            let cells = cells.map(|value| text::some(value, cell));
            out.write_record(own.into_iter().chain(cells))?;
        }
        let text = String::from_utf8(out.into_inner()?)?;
        write_text(&table_file(folder, table), &text)?;
    }
    Ok(())
}

/// The file of a table, by its name or its line of [`TABLES`].
fn table_file(folder: &Path, table: &str) -> PathBuf {
    let name = table.split(':').next().unwrap_or_default();
    folder.join(format!("{name}.csv"))
}

/// Bars of what remains after each stage of the chain, in the picture's colours.
fn passed(report: &FunnelReport) -> Figure {
    let chosen = report.stages.iter().filter(|row| row.is_chosen);
    let chosen = chosen.filter(|row| row.back_end.name != NONE);
    let given = chosen.clone().map(|row| row.errors.input_count);
    // Zero has no place on the axis.
    let axis = Axis::log("", given.chain([0.1]), 1.0, &funnel_table::count);
    let bottom = 2.0 * LINE * chosen.clone().count() as f64;
    let mut parts = axis.across(None, bottom);
    for (n, row) in chosen.enumerate() {
        let (y, stage, errors) = (2.0 * LINE * n as f64, row.back_end.stage, &row.errors);
        let counts = [errors.input_count, errors.output_count, errors.truth_count];
        let [all, left, _] = counts.map(funnel_table::count);
        let (name, unit, at) = (stage.name(), row.unit, y + 12.0);
        parts += &format!("<text y=\"{at}\">{name}: {left} of {all} {unit}</text>\n");
        // The picture has no triangles, and facing the eye is not the same as being seen.
        let classes = [[0, 3, 4], [1, 3, 4], [2, 3, 4], [6, 7, 7], [3, 3, 4]][stage as usize];
        let colours = classes.map(|class| FATE_CLASSES[class].colour);
        for (count, colour) in counts.into_iter().zip(colours) {
            let (y, width) = (y + LINE, axis.percent(count));
            parts += &format!(
                "<rect class=\"bar\" y=\"{y}\" width=\"{width:.2}%\" height=\"10\" fill=\"{colour}\"/>"
            );
        }
    }
    let (scene, path) = (&report.scene, &report.path);
    let note = "logarithmic, in the colours of the key below the picture";
    Figure {
        caption: format!("{scene}, {path}: what each stage leaves per view; {note}"),
        margins: [4.0, 24.0],
        height: bottom + 1.5 * LINE,
        parts,
        legend: (String::new(), 0.0),
    }
}

/// Tables, figures and the picture as one page.
fn page(report: &FunnelReport, scene: &Scene) -> String {
    // In addition to the picture's own, which narrow pages make small.
    let key = FATE_CLASSES.iter().map(|Class { colour, words, .. }| {
        format!("<span><i style=\"background:{colour}\"></i>{words}</span> ")
    });
    let key = format!("<figcaption>{}</figcaption>", key.collect::<String>());
    let mut blocks = vec![Block::Picture(draw(report, scene) + &key)];
    blocks.extend(funnel_table::blocks(report, true));
    blocks.truncate(blocks.len() - report.conclusions.len());
    let told = report.conclusions.iter().filter(|told| !told.is_empty());
    let title = format!("funnel {}, {}", report.scene, report.path);
    to_page(&title, told.map(Block::line), [passed(report)], blocks)
}

/// Classes of items by the stage that removed them, and of triangles.
const FATE_CLASSES: &[Class] = rows! { Class { colour, words, is_key }
    "#e4e4e4", "region: not seen from the eye's region", false;
    "#c0c8d0", "object: outside of the frustum", false;
    "#ecb566", "occlusion: behind others", false;
    "#56b4e9", "drawn, and not visible", true;
    "#009e73", "visible", true;
    "#d50000", "visible, and removed", true;
    "#dcc8ea", "triangles that face away", false;
    "#8a63b0", "triangles that face the eye", false;
};

/// The picture as SVG.
pub fn draw(report: &FunnelReport, scene: &Scene) -> String {
    let view = &report.plan_view;
    let class_of = |item: usize| match view.outcomes.get(item) {
        None => 0,
        Some(ItemOutcome::Removed(stage)) => *stage as usize,
        Some(ItemOutcome::Kept) => 3,
        Some(ItemOutcome::Visible) => 4,
        Some(ItemOutcome::Lost) => 5,
    };
    let (name, path) = (&report.scene, &report.path);
    let bad = Some(scene.skipped_items).filter(|bad| *bad > 0);
    let items = text::some(bad, |bad| text::items(scene.items.len(), bad));
    Plan {
        caption: text::joined([
            &format!("{name}, {path}: the view that sees most, from above"),
            &items,
        ]),
        scene,
        camera: view.camera.as_ref(),
        classes: &FATE_CLASSES[..6],
        class_of: &class_of,
        cells: None,
    }
    .svg()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::funnel::{BackEnd, Errors};

    fn row(stage: StageKind, guarantee: Guarantee, false_negative_count: f64) -> StageRow {
        StageRow {
            back_end: BackEnd {
                stage,
                name: "a row",
                summary: "",
                guarantee,
                does_object_stage: false,
            },
            structure: None,
            is_chosen: true,
            unit: stage.unit(),
            errors: Errors {
                false_negative_count,
                ..Errors::of(&[])
            },
            time: None,
            ns_per_removed: None,
            ns_per_decided: None,
            fragments: None,
        }
    }

    #[test]
    fn a_broken_promise_counts_behind_an_unproven_stage_too() {
        use Guarantee::{Conservative, Unproven};
        let region = |guarantee, lost| row(StageKind::Region, guarantee, lost);
        let occlusion = |guarantee, lost| row(StageKind::Occlusion, guarantee, lost);
        let keeps = |rows: [StageRow; 2]| keep_their_word(&rows, &[]);
        assert!(keeps([region(Conservative, 0.0), occlusion(Unproven, 2.0)]));
        assert!(!keeps([
            region(Conservative, 0.0),
            occlusion(Conservative, 2.0)
        ]));
        assert!(!keeps([
            region(Conservative, 1.0),
            occlusion(Unproven, 2.0)
        ]));
        assert!(keeps([region(Unproven, 1.0), occlusion(Conservative, 0.0)]));
        assert!(!keeps([
            region(Unproven, 1.0),
            occlusion(Conservative, 1.0)
        ]));
        // Items hidden by lost ones become visible.
        for (is_chosen, keeps_its_word) in [(true, true), (false, false)] {
            let other = StageRow {
                is_chosen,
                ..region(Unproven, 1.0)
            };
            let mut exact = row(StageKind::Fragment, Guarantee::SampleExact, 0.0);
            exact.errors.false_positive_count = 1.0;
            assert_eq!(keeps([other, exact]), keeps_its_word);
        }
    }

    #[test]
    fn what_is_declared_exact_has_nothing_wrong() {
        use Guarantee::{Conservative, Exact, SampleExact, Unproven};
        let keeps_more = |guarantee| {
            let mut kept = row(StageKind::Triangle, guarantee, 0.0);
            kept.errors.false_positive_count = 0.5;
            keep_their_word(&[kept], &[])
        };
        assert!(keeps_more(Conservative) && !keeps_more(Exact) && !keeps_more(SampleExact));
        let pick = |guarantee, wrong_count| {
            let pick = PickRow {
                question: serde_json::from_value("first item".into()).unwrap(),
                name: "a back end".to_owned(),
                summary: "",
                guarantee,
                ray_count: 9,
                wrong_count,
                time: None,
                ns_per_ray: None,
            };
            keep_their_word(&[], &[pick])
        };
        assert!(pick(Unproven, 1) && pick(Exact, 0) && !pick(Exact, 1));
    }
}
