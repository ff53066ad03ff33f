//! `cullbench query` and `cullbench locate`: a row per camera, point or box.
//!
//! One per structure, too. Structures answer one after another: a large scene does not fit in
//! memory several times.

use std::collections::BTreeMap;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use serde_json::{Map, Value, json};

use super::args::{LocateArgs, QueryArgs};
use super::shared_args::RowFormat;
use super::{Ending, load_scene, unread_is_fine};
use crate::geometry::Aabb;
use crate::index::{BuildError, DynIndex, Registry, StructureSpec, caught};
use crate::input::{is_readable, note, read_file, tell_warnings};
use crate::measure::{Answer, Workload, input_of};
use crate::motion::Motion;
use crate::path::{self, read_points_csv};
use crate::query::{ItemId, QueryCost};
use crate::scene::{Scene, SearchBox, SearchPoint, available_bytes, read_search_boxes_csv};
use crate::threads::share;

/// Value of `--points` for the camera places of the scene.
const PLACES: &str = "places";

pub fn query(registry: &Registry, args: &QueryArgs) -> anyhow::Result<Ending> {
    let structures = args.culling.kernel.structures(registry, &args.structure)?;
    let defaults = args.culling.lens.defaults()?;
    let culling = args.culling.culling(&args.test)?;
    let mut scene = load_scene(&args.scene, &args.culling.lens.scene_args.options(1))?;
    let cameras = path::load(&args.cameras, &scene, &defaults)?;
    let mut motion = None;
    if let Some(source) = &args.motion {
        let own = Motion::load(source, &scene)?.seen_by(&cameras, 1);
        let (frames, name) = (own.frames, &own.name);
        let wanted = args.frame.map_or(frames, |frame| frame as usize);
        anyhow::ensure!(
            wanted <= frames,
            "--frame is {wanted}; expected at most {frames}, the frames of '{name}'"
        );
        let mut replay = own.replay();
        for _ in 0..wanted {
            replay.advance(&mut scene.items);
        }
        motion = Some(own);
    }
    let workload = Workload::moving(&scene, &cameras, &culling, motion, 1)?;
    tell_warnings();
    culling.unproven().iter().for_each(|doubt| note(doubt));
    let ask = frustum(&workload);
    let columns: [Column<Row>; 9] = [
        ("camera", &|row| json!(row.question)),
        ("structure", &|row| json!(row.structure)),
        ("test", &|_| json!(culling.test.name())),
        ("total_count", &|_| json!(scene.items.len())),
        ("visible_count", &|row| json!(row.answer.count)),
        ("visible_id_sum", &|row| json!(row.id_sum)),
        ("nodes_tested", &|row| json!(row.cost.nodes_tested)),
        ("items_tested", &|row| json!(row.cost.items_tested)),
        ("visible_ids", &|row| json!(shown(&scene, row))),
    ];
    let columns = &columns[..if args.ids { 9 } else { 8 }];
    let (items, questions) = (&workload.items, ("camera", workload.views.len()));
    let agree = write(args.format, columns, |each| {
        ask_all(&structures, &scene, items, questions, args.ids, ask, each)
    })?;
    Ok(Ending::of(agree))
}

/// The ids of an answer in the numbering of files.
fn shown(scene: &Scene, row: &Row) -> Option<Vec<ItemId>> {
    let ids = row.ids.as_deref()?;
    Some(ids.iter().map(|&id| scene.row_of(id)).collect())
}

/// Counts a query with a camera's view; returns the ids of the uncounted query.
pub fn frustum(
    workload: &Workload,
) -> impl Fn(&dyn DynIndex, usize, &mut Vec<ItemId>, &mut QueryCost) + Sync {
    |index, camera, out, cost| {
        let view = workload.views[camera].as_any();
        index.query_counted(view, out, cost);
        out.clear();
        index.query(view, out);
    }
}

pub fn locate(registry: &Registry, args: &LocateArgs) -> anyhow::Result<Ending> {
    let structures = args.kernel.structures(registry, &args.structure)?;
    let scene = load_scene(&args.scene, &args.scene_args.options(1))?;
    let (what, items) = match args.points {
        Some(_) => ("point", scene.regions.boxes(&scene.items)),
        None => ("box", &scene.items[..]),
    };
    let columns: [Column<Row>; 6] = [
        (what, &|row| json!(row.question)),
        ("structure", &|row| json!(row.structure)),
        ("region_count", &|row| json!(row.answer.count)),
        ("region_id_sum", &|row| json!(row.id_sum)),
        ("region_ids", &|row| json!(shown(&scene, row))),
        ("nodes_tested", &|row| json!(row.cost.nodes_tested)),
    ];
    let (file, other) = (args.points.as_ref(), args.boxes.as_ref());
    let points = file.map_or(Ok(Vec::new()), |file| points(&scene, file))?;
    let boxes = other.map_or(Ok(Vec::new()), |file| boxes(&scene, file))?;
    let ask = |index: &dyn DynIndex, n: usize, out: &mut Vec<_>, cost: &mut _| {
        if let Some(p) = points.get(n) {
            scene.search(p, out, |p, out| index.query_counted(p.into(), out, cost));
            out.clear();
            scene.search(p, out, |p, out| index.locate(p, out));
        } else {
            index.query_counted((&boxes[n].volume).into(), out, cost);
            out.clear();
            index.visible(&boxes[n].volume, out);
            scene.refine_overlapping(&boxes[n], out);
        }
    };
    let questions = (what, points.len() + boxes.len());
    let agree = write(args.format, &columns, |each| {
        ask_all(&structures, &scene, items, questions, true, ask, each)
    })?;
    Ok(Ending::of(agree))
}

fn points(scene: &Scene, file: &Path) -> anyhow::Result<Vec<SearchPoint>> {
    if file == Path::new(PLACES) && !is_readable(file) {
        anyhow::ensure!(
            !scene.places.is_empty(),
            "--points {PLACES}: scene '{}' has no camera places; expected a points CSV, or a scene \
             with places, such as a map",
            scene.name
        );
        let eyes = scene.places.iter().map(|at| scene.search_point(at.eye));
        return Ok(eyes.collect());
    }
    let points = read_points_csv(&read_file(file)?[..], &file.display().to_string())?.into_iter();
    Ok(points.map(|p| scene.search_point(p)).collect())
}

fn boxes(scene: &Scene, file: &Path) -> anyhow::Result<Vec<SearchBox>> {
    let boxes = read_search_boxes_csv(&read_file(file)?[..], &file.display().to_string())?;
    Ok(boxes.into_iter().map(|b| scene.search_box(b)).collect())
}

/// One structure's answer to one query.
pub struct Row {
    pub question: usize,
    pub structure: String,
    /// Items, ascending.
    pub ids: Option<Box<[ItemId]>>,
    pub answer: Answer,
    /// Sum of the ids in the numbering of files.
    pub id_sum: u64,
    pub cost: QueryCost,
    /// An id in the answer that belongs to no item.
    stray: Option<ItemId>,
}

impl Row {
    fn told(&self) -> String {
        let ids = super::text::counted(self.answer.count as usize, "id");
        format!("{} finds {ids} with sum {}", self.structure, self.id_sum)
    }

    fn bytes(&self) -> usize {
        let ids = self.ids.as_deref().map_or(0, size_of_val);
        size_of::<Row>() + self.structure.len() + ids
    }
}

/// Panic of a structure at its build or a query: a wrong answer, no bad input.
#[derive(Debug, thiserror::Error)]
#[error("structure '{0}': panicked: {1}; expected an answer")]
pub struct Panicked(String, String);

/// Bytes of answers in memory: enough that a structure is rarely built again.
const HELD: usize = 64 << 20;

/// Answers every query by every structure.
///
/// False if two structures disagree, or an id belongs to no item. Nothing is compared with the
/// reference scan, which takes far longer.
///
/// `each` receives the answers in the order of queries, then of structures, in blocks of [`HELD`]
/// bytes, or an eighth of the free memory. Ids (ascending) are kept only with `keep_ids`. Every
/// disagreement is a line on standard error.
pub fn ask_all(
    structures: &[StructureSpec],
    scene: &Scene,
    boxes: &[Aabb],
    (what, questions): (&str, usize),
    keep_ids: bool,
    ask: impl Fn(&dyn DynIndex, usize, &mut Vec<ItemId>, &mut QueryCost) + Sync,
    each: &mut dyn FnMut(Vec<Row>) -> io::Result<()>,
) -> anyhow::Result<bool> {
    let block = (HELD / size_of_val(boxes).max(1)).clamp(1, 1024);
    let (mut from, mut agree) = (0, true);
    let room = available_bytes().map_or(HELD, |free| HELD.min(free as usize / 8));
    // A single structure is built once; of several, memory may hold only one.
    let mut only: Option<Box<dyn DynIndex>> = None;
    while from < questions {
        let mut answers: Vec<Vec<Row>> = Vec::new();
        for spec in structures {
            let failed = |why: String| anyhow::anyhow!("structure '{}': {why}", spec.label);
            let panicked = |message| Panicked(spec.label.clone(), message);
            let build = || spec.build(input_of(scene, boxes));
            let index = match only.take().map_or_else(build, Ok) {
                Ok(index) => index,
                // One of many: the others' answers are still useful.
                Err(error @ (BuildError::Refused { .. } | BuildError::OutOfMemory { .. }))
                    if structures.len() > 1 =>
                {
                    if from == 0 {
                        tell!("left out: {error}");
                    }
                    continue;
                }
                Err(BuildError::Panicked { message }) => return Err(panicked(message).into()),
                Err(error) => return Err(failed(error.to_string())),
            };
            // The first structure determines for how many queries the answers fit.
            let (mut held, first) = (0, answers.is_empty());
            let end = [from + answers.len(), questions][usize::from(first)];
            let mut next = from;
            while next < end && (!first || held < room) {
                let count = (end - next).min(block * spec.execution.threads.max(1));
                if first {
                    answers.extend((0..count).map(|_| Vec::with_capacity(structures.len())));
                }
                let asked = caught(|| {
                    let rows = answers[next - from..][..count].iter_mut().enumerate();
                    share(spec.execution.threads, rows, |(n, row)| {
                        let (mut out, mut cost) = (Vec::new(), QueryCost::default());
                        let question = next + n;
                        ask(index.as_ref(), question, &mut out, &mut cost);
                        if keep_ids {
                            out.sort_unstable();
                        }
                        row.push(Row {
                            question,
                            structure: spec.label.clone(),
                            answer: Answer::of(&out),
                            id_sum: out.iter().map(|&id| u64::from(scene.row_of(id))).sum(),
                            ids: keep_ids.then(|| out.as_slice().into()),
                            cost,
                            stray: out.iter().copied().find(|&id| id as usize >= boxes.len()),
                        });
                    });
                });
                asked.map_err(panicked)?;
                let rows = answers[next - from..].iter().filter_map(|row| row.last());
                held += rows.map(Row::bytes).sum::<usize>() * structures.len();
                next += count;
            }
            if structures.len() == 1 {
                only = Some(index);
            }
        }
        if answers.is_empty() {
            break;
        }
        from += answers.len();
        let rows: Vec<Row> = answers.into_iter().flatten().collect();
        agree &= all_agree(&rows, what);
        each(rows)?;
    }
    Ok(agree)
}

/// Reports ids that belong to no item, and queries with different answers.
///
/// True if there is nothing to report.
fn all_agree(rows: &[Row], what: &str) -> bool {
    let mut first: BTreeMap<usize, &Row> = BTreeMap::new();
    let mut agree = true;
    for row in rows {
        let base = first.entry(row.question).or_insert(row);
        if let Some(id) = row.stray {
            agree = false;
            let about = format!("{what} {}: {}", row.question, row.structure);
            tell!("error: {about} finds id {id}, which is no item's");
        }
        if base.answer != row.answer {
            agree = false;
            let is_alike = (base.answer.count, base.id_sum) == (row.answer.count, row.id_sum);
            tell!(
                "error: {what} {}: {}, {}{}",
                row.question,
                base.told(),
                row.told(),
                ["", ", but other ids"][usize::from(is_alike)]
            );
        }
    }
    agree
}

/// Header and cell of a column.
pub type Column<'a, Row> = (&'a str, &'a dyn Fn(&Row) -> Value);

/// Writes the answers that `ask` passes to its argument as CSV or JSON.
///
/// A reader that stops early changes neither queries nor answers.
pub fn write(
    format: RowFormat,
    columns: &[Column<'_, Row>],
    ask: impl FnOnce(&mut dyn FnMut(Vec<Row>) -> io::Result<()>) -> anyhow::Result<bool>,
) -> anyhow::Result<bool> {
    let mut out = BufWriter::new(io::stdout().lock());
    let mut before = "[";
    // The header comes with the first rows: an error before them is the only output.
    let mut head = Some(columns.iter().map(|column| column.0));
    let mut put = |rows: &[Row]| -> io::Result<()> {
        if format == RowFormat::Csv {
            let mut csv = csv::Writer::from_writer(&mut out);
            head.take().map_or(Ok(()), |head| csv.write_record(head))?;
            for row in rows {
                csv.write_record(columns.iter().map(|(_, value)| cell(&value(row))))?;
            }
            return csv.flush();
        }
        for row in rows {
            let values = columns.iter();
            let values = values.map(|(name, value)| ((*name).to_owned(), value(row)));
            let object = serde_json::to_string_pretty(&Map::from_iter(values))?;
            write!(out, "{before}\n  {}", object.replace('\n', "\n  "))?;
            before = ",";
        }
        Ok(())
    };
    let agree = ask(&mut |rows| unread_is_fine(put(&rows)));
    if agree.is_err() {
        // The output is incomplete: what is still buffered is not shown.
        drop(out.into_parts());
        return agree;
    }
    let ended = put(&[]).and_then(|()| match (format, before) {
        (RowFormat::Csv, _) => Ok(()),
        (_, "[") => out.write_all(b"[]\n"),
        _ => out.write_all(b"\n]\n"),
    });
    unread_is_fine(ended.and_then(|()| out.flush()))?;
    agree
}

/// A value in CSV: ids separated by spaces, empty for null.
pub fn cell(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::String(text) => super::text::lines(text),
        Value::Array(ids) => ids.iter().map(cell).collect::<Vec<_>>().join(" "),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::{self, LinearScalar, RegionIndex};

    const PANICS: index::Row = index::Row {
        info: LinearScalar::INFO.named("panics"),
        build: |_, _, _| panic!("deep in a peer's code"),
        params: |_| Ok(Value::Null),
    };
    const REFUSES: index::Row = index::Row {
        info: LinearScalar::INFO.named("refuses"),
        build: |_, _, _| {
            Err(BuildError::Refused {
                structure: "refuses",
                reason: "too many alike".to_owned(),
            })
        },
        params: |_| Ok(Value::Null),
    };

    fn of(row: index::Row) -> StructureSpec {
        StructureSpec {
            label: row.info.name.to_owned(),
            row,
            params: Value::Null,
            execution: Default::default(),
            policy: Default::default(),
        }
    }

    fn asked(structures: &[StructureSpec], panics: bool) -> Result<Vec<Row>, String> {
        let scene = crate::scene::load("uniform:n=10", &Default::default()).expect("uniform");
        let ask = |_: &dyn DynIndex, _, out: &mut Vec<ItemId>, _: &mut QueryCost| {
            assert!(!panics, "deep in a peer's query");
            out.push(7);
        };
        let mut all = Vec::new();
        let mut each = |rows: Vec<Row>| {
            all.extend(rows);
            Ok(())
        };
        let what = ("camera", 2);
        let items = &scene.items;
        let agree = ask_all(structures, &scene, items, what, true, ask, &mut each);
        agree.map(|_| all).map_err(|error| error.to_string())
    }

    #[test]
    fn answers_too_large_to_be_held_come_in_order_and_in_pieces() {
        let scene = crate::scene::load("uniform:n=10k", &Default::default()).expect("uniform");
        let two = [of(REFUSES), StructureSpec::parse("linear").expect("linear")];
        // Two thousand answers exceed the buffer.
        let many: Vec<ItemId> = (0..HELD as ItemId / 8000).collect();
        for structures in [&two[1..], &two[..]] {
            let ask = |_: &dyn DynIndex, _, out: &mut Vec<ItemId>, _: &mut QueryCost| {
                out.extend(&many);
            };
            let mut seen = Vec::new();
            let mut each = |rows: Vec<Row>| {
                seen.push(rows.iter().map(|row| row.question).collect::<Vec<_>>());
                Ok(())
            };
            let items = &scene.items;
            let what = ("camera", 3000);
            let agree = ask_all(structures, &scene, items, what, true, ask, &mut each);
            assert!(agree.expect("linear answers"));
            assert!(seen.len() > 1);
            assert!(seen.concat().into_iter().eq(0..3000));
        }
    }

    #[test]
    fn other_ids_of_the_same_sum_are_noticed() {
        let row = |ids: &[ItemId]| Row {
            question: 0,
            structure: "any".to_owned(),
            ids: None,
            answer: Answer::of(ids),
            id_sum: ids.iter().map(|&id| u64::from(id)).sum(),
            cost: QueryCost::default(),
            stray: None,
        };
        assert!(all_agree(&[row(&[1, 4]), row(&[4, 1])], "camera"));
        assert!(!all_agree(&[row(&[1, 4]), row(&[2, 3])], "camera"));
        let stray = Row {
            stray: Some(4),
            ..row(&[1, 4])
        };
        assert!(!all_agree(&[stray], "camera"));
    }

    #[test]
    fn a_panic_is_one_line_and_a_refusal_leaves_the_others() {
        let linear = StructureSpec::parse("linear").expect("linear");
        let error = asked(&[linear.clone(), of(PANICS)], false).err();
        let wanted = "structure 'panics': panicked: deep in a peer's code; expected an answer";
        assert_eq!(error.as_deref(), Some(wanted));
        let error = asked(std::slice::from_ref(&linear), true).err();
        let wanted = "structure 'linear': panicked: deep in a peer's query; expected an answer";
        assert_eq!(error.as_deref(), Some(wanted));
        let answers = asked(&[of(REFUSES), linear], false).expect("linear answers");
        assert!(answers.len() == 2 && answers.iter().all(|a| a.structure == "linear"));
        let error = asked(&[of(REFUSES)], false).err().unwrap_or_default();
        assert!(error.contains("too many alike"), "{error}");
    }
}
