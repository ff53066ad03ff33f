//! `cullbench view`: one page with a scene in 3-D along a path.
//!
//! Items have the colours of their verdicts in each view.

use std::io::{self, Write};
use std::path::Path;

use anyhow::{Context, ensure};

use super::compare_structures::{Row, ask_all};
use super::document::page;
use super::query::frustum;
use super::study::progress;
use super::text::html;
use super::view_args::ViewArgs;
use super::view_data::{FATES, Fate, Frame, ViewData};
use super::{Ending, expect_places, inputs, load_scene, tell, text, unread_is_fine, write_text};
use crate::funnel::{RaysEnd, Shape};
use crate::index::Registry;
use crate::input::tell_warnings;
use crate::measure::{SceneInfo, Workload};
use crate::oracle::Verdict;
use crate::path::{self, CameraFacts};
use crate::query::ItemId;
use crate::verify::Truth;
use crate::visibility::Rays;

/// Most items that a browser is given to draw.
const MOST_ITEMS: usize = 2_000_000;

pub fn view(registry: &Registry, args: &ViewArgs) -> anyhow::Result<Ending> {
    let inputs = [&args.scene, &args.path].map(|input| Path::new(input.as_str()));
    expect_places(&[("--out", Some(&args.out))], &inputs)?;
    let structures = args.kernel.structures(registry, &args.structure)?;
    let (defaults, culling) = (args.lens.defaults()?, args.culling.culling(&args.test)?);
    let scene = load_scene(&args.scene, &args.scene_args, 1)?;
    let items = scene.items.len();
    ensure!(
        items <= MOST_ITEMS,
        "{}: {} items; expected at most {} to draw",
        scene.name,
        text::count(items),
        text::count(MOST_ITEMS)
    );
    let cameras = path::load(&args.path, &scene, &defaults)?;
    let (all, most) = (cameras.cameras.len(), args.frames);
    let cameras = cameras.at_most(most);
    let workload = Workload::new(&scene, &cameras, &culling)?;
    tell_warnings();
    if let Some(doubt) = culling.unproven() {
        tell(&format!("note: {doubt}"));
    }
    let (mut data, order) = ViewData::of(&scene, &cameras.name);
    let mut answers: Vec<Box<[ItemId]>> = Vec::new();
    let (ask, boxes, views) = (frustum(&workload), &workload.items, workload.views.len());
    let bar = progress((views * (structures.len() + 1)) as u64, " views");
    let mut each = |rows: Vec<Row>| {
        bar.inc(rows.len() as u64);
        for row in rows {
            data.count(&row);
            if answers.len() == row.question {
                answers.extend(row.ids);
            }
        }
        Ok(())
    };
    let agree = ask_all(
        &structures,
        &scene,
        boxes,
        ("camera", views),
        true,
        ask,
        &mut each,
    )?;
    let threads = args.kernel.most_threads();
    let surfaces = args
        .samples
        .map(|grid| (RaysEnd::at(&Shape::of(&scene), None), grid));
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
        order
            .iter()
            .for_each(|&id| totals[fates[id as usize] as usize] += 1);
        let fates: Vec<Fate> = order.iter().map(|&id| fates[id as usize]).collect();
        let index = if all > most { view * all / most } else { view };
        bar.inc(1);
        data.frames
            .push(Frame::of(index, camera, scene.origin, &fates));
    }
    bar.finish_and_clear();
    data.samples = args
        .samples
        .map(|grid| format!("{}x{}", grid.width, grid.height));
    let told = conclusion(&data, totals, agree);
    let facts = CameraFacts::of(&cameras.cameras);
    let (axes, lens) = (inputs::axes(&SceneInfo::of(&scene)), inputs::lens(&facts));
    let matrix = text::some(facts.matrix.as_ref(), |matrix| {
        format!("; matrices: {}", inputs::matrices(matrix))
    });
    let about = format!(
        "Scene: {axes}. Lens: {lens}{matrix}. Test: {}.",
        culling.test.name()
    );
    let json = serde_json::to_string(&data)?.replace('<', "\\u003c");
    let body = format!(
        "<main class=\"view\"><h1>cullbench view {}, {}</h1>\n<p>{}</p>\n{}<p>{}</p>\n</main>\n\
         <script type=\"application/json\" id=\"data\">{json}</script>\n",
        html(&data.scene),
        html(&data.path),
        html(&told),
        include_str!("assets/view.html"),
        html(&about),
    );
    let title = format!("cullbench view {}", data.scene);
    let text = page(
        &title,
        include_str!("assets/view.css"),
        &body,
        concat!(
            include_str!("assets/view_data.js"),
            include_str!("assets/view_gl.js"),
            include_str!("assets/view.js")
        ),
    );
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
    let mut fates = vec![Fate::Culled; items];
    let mut in_front = vec![front.is_none(); items];
    // Floors and ceilings of a map come behind its items.
    let front = front.unwrap_or_default().iter().map(|&id| id as usize);
    front
        .filter(|&id| id < items)
        .for_each(|id| in_front[id] = true);
    answer
        .iter()
        .for_each(|&id| fates[id as usize] = Fate::Visible);
    let verdicts = truth.map(Truth::verdicts).unwrap_or_default();
    for (fate, verdict) in fates.iter_mut().zip(verdicts) {
        *fate = match (*fate, verdict) {
            (Fate::Visible, Verdict::Out) => Fate::FalsePositive,
            (Fate::Culled, Verdict::In) => Fate::Lost,
            (fate, _) => fate,
        };
    }
    for (fate, _) in fates
        .iter_mut()
        .zip(in_front)
        .filter(|(_, is_front)| !is_front)
    {
        if *fate == Fate::Visible {
            *fate = Fate::Hidden;
        }
    }
    fates
}

/// The result in sentences.
fn conclusion(data: &ViewData, totals: [usize; FATES], agree: bool) -> String {
    let views = data.frames.len();
    let of = |fate: Fate| totals[fate as usize];
    let mean = |count: usize| match count as f64 / views as f64 {
        few if few < 100.0 => text::significant(few),
        many => text::count(many.round() as usize),
    };
    let returned = of(Fate::Visible) + of(Fate::FalsePositive) + of(Fate::Hidden);
    let mut parts = vec![match of(Fate::FalsePositive) {
        0 => "no false positive".to_owned(),
        count => format!("{} of them false positives", mean(count)),
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
    let structures = match (data.structures.as_slice(), agree) {
        ([one], _) => format!("The structure is {}.", one.name),
        (all, true) => format!("All {} structures return the same sets.", all.len()),
        (all, false) => {
            let count = all.len();
            format!("The {count} structures disagree; the sets are the first one's.")
        }
    };
    format!(
        "{} of {}: {} of {} returned per view, {}. {structures}",
        text::counted(views, "view"),
        data.path,
        mean(returned),
        text::counted(data.items, "item"),
        parts.join(", "),
    )
}
