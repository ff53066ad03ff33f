//! `cullbench precision`: the error-against-run-time table of a scene and
//! path, and the sweeps over item size and world offset behind it.

use std::io::{self, Write};
use std::path::Path;
use std::time::Duration;

use anyhow::bail;
use serde::Serialize;
use tempfile::NamedTempFile;

use super::args::PrecisionArgs;
use super::processes::Workers;
use super::protocol::{Job, Timing};
use super::run::progress;
use super::run_resume::typed_args;
use super::shared_args::TableFormat;
use super::{Ending, interrupt, load_scene, precision_diagram, print_json, text, unread_is_fine};
use crate::index::Registry;
use crate::measure::{ProcessTimes, Protocol, Status};
use crate::path;
use crate::precision::{
    self, OffsetRow, Point, PointPlan, Precision, PrecisionInput, SizeRow, offset_sweep, size_sweep,
};
use crate::report::write_atomically;
use crate::scene::{self, LoadOptions};
use crate::verify::ErrorCount;

/// Everything that is printed.
#[derive(Serialize)]
struct Outcome {
    #[serde(flatten)]
    precision: Precision,
    seed: u64,
    size_sweep: Vec<SizeRow>,
    offset_sweep: Vec<OffsetRow>,
}

/// Rounds of a point, if one process has them all.
const ROUNDS: [usize; 2] = [5, 15];
/// Cameras of the sweep over offsets.
const OFFSET_CAMERAS: usize = 60;

pub fn precision(registry: &Registry, args: &PrecisionArgs) -> anyhow::Result<Ending> {
    // Before the work, not after it.
    if let Some(folder) = args.svg.as_deref().and_then(Path::parent)
        && !folder.as_os_str().is_empty()
        && !folder.is_dir()
    {
        bail!(
            "{}: expected an existing folder for --svg",
            folder.display()
        );
    }
    let structures = args.kernel.structures(registry, &args.structure)?;
    let defaults = args.lens.defaults()?;
    let scene = load_scene(&args.scene, &args.scene_args, 2 * structures.len())?;
    if scene.items.is_empty() {
        bail!("scene '{}' has no items; expected at least one", scene.name);
    }
    let path = path::load(&args.path, &scene, &defaults)?;
    interrupt::from_now_on_finish();
    let workers = Workers::new(typed_args()?, Duration::MAX, &NamedTempFile::new)?;
    let bar = progress(u64::from(args.spread.processes));
    let job = |next: &str| {
        let job = format!("{}, {}: {next}", args.scene, args.path);
        bar.set_message(text::plain(&job));
    };
    job("every point, checked");
    let protocol = protocol(args, 0);
    let input = PrecisionInput {
        scene: &scene,
        path: &path,
        structures: &structures,
        most_cameras: args.frames as usize,
        protocol: &protocol,
    };
    let Some(prepared) = precision::prepare(&input, &interrupt::asked)? else {
        return Ok(Ending::Interrupted);
    };
    let points = |process| {
        let timing = Timing {
            process,
            lens_scale: path.lens_scale,
        };
        Job::Points(prepared.plan.clone(), timing)
    };
    let step = |process: u32, _: &str| {
        bar.set_position(process.into());
        job("every point, timed");
    };
    let Some(times) = workers.times(args.spread.processes, points, &step)? else {
        return Ok(Ending::Interrupted);
    };
    let precision = prepared.conclude(&times);
    let (mut sizes, mut offsets) = (Vec::new(), Vec::new());
    if args.cubes > 0 {
        job("the sweep over sizes");
        let Some(rows) = size_sweep(args.cubes, args.spread.seed, &interrupt::asked)? else {
            return Ok(Ending::Interrupted);
        };
        sizes = rows;
        job("the sweep over offsets");
        offsets = offset_sweep(OFFSET_CAMERAS, args.spread.seed);
    }
    bar.finish_and_clear();
    if let Some(file) = &args.svg {
        let svg = precision_diagram::draw(&precision)?;
        write_atomically(file, |out| out.write_all(svg.as_bytes()))?;
    }
    let wrong = precision
        .points
        .iter()
        .any(|p| matches!(p.status, Status::Wrong | Status::Panicked));
    let outcome = Outcome {
        precision,
        seed: args.spread.seed,
        size_sweep: sizes,
        offset_sweep: offsets,
    };
    unread_is_fine(match args.format {
        TableFormat::Json => print_json(&outcome),
        TableFormat::Table => show(&outcome),
    })?;
    Ok(if wrong {
        Ending::WrongAnswer
    } else {
        Ending::Ok
    })
}

/// Of one of the processes, all cameras.
fn protocol(args: &PrecisionArgs, process: u32) -> Protocol {
    let effort = args.spread.effort(ROUNDS);
    args.spread.protocol(&effort, process, usize::MAX)
}

/// One process's share of the points.
pub fn time(
    registry: &Registry,
    args: &PrecisionArgs,
    plan: &PointPlan,
    timing: &Timing,
    stop: &dyn Fn() -> bool,
) -> anyhow::Result<Option<ProcessTimes>> {
    let load = LoadOptions {
        skip_bad_items: args.scene_args.skip_bad_items,
        structures: 0,
    };
    let scene = scene::load(&args.scene, &load)?;
    let lens = args.lens.defaults()?;
    let input = PrecisionInput {
        scene: &scene,
        path: &path::load_scaled(&args.path, &scene, &lens, timing.lens_scale)?,
        structures: &args.kernel.structures(registry, &args.structure)?,
        most_cameras: args.frames as usize,
        protocol: &protocol(args, timing.process),
    };
    Ok(precision::time(&input, plan, stop)?)
}

fn show(outcome: &Outcome) -> io::Result<()> {
    let mut out = text::terminal();
    let p = &outcome.precision;
    let visible = p.points.first().map_or(0, |point| point.errors.visible);
    writeln!(
        out,
        "{}: {}; {}: {}, {} visible in all; {}; {} in each",
        text::plain(&p.scene),
        text::counted(p.items, "item"),
        text::plain(&p.path),
        text::counted(p.cameras, "camera"),
        text::count(visible as usize),
        text::over(p.processes, p.twin.as_ref()),
        text::counted(p.rounds, "round")
    )?;
    writeln!(out, "{}", points_table(&p.points))?;
    writeln!(
        out,
        "* on the Pareto front: no other point is as good in every error and as fast. Times that a\n\
         paired test over the processes does not tell apart count as equal. eps is the factor c of\n\
         the conservative epsilon."
    )?;
    for point in p.points.iter().filter(|p| p.reason.is_some()) {
        let reason = point.reason.as_deref().unwrap_or_default();
        writeln!(out, "{}: {}: {reason}", named(point), point.status.name())?;
    }
    writeln!(out, "\nPareto front, fastest first:")?;
    for &i in &p.front {
        let point = &p.points[i];
        writeln!(
            out,
            "  {}: {} at {} % excess, {} ppm missed",
            named(point),
            point.query_ns.map(text::time).unwrap_or_default(),
            point.excess.map(as_percent).unwrap_or_default(),
            point
                .false_negative_ppm
                .map(text::significant)
                .unwrap_or_default(),
        )?;
    }
    writeln!(
        out,
        "\nHow many cameras until the order of the points by time stands:"
    )?;
    let mut table = text::table(&["cameras", "pairs in final order", "CPU time"], &[0, 1, 2]);
    for row in &p.stability {
        table.add_row([
            row.cameras.to_string(),
            text::percent(row.pairs_in_order),
            text::time(row.seconds * 1e9),
        ]);
    }
    writeln!(out, "{table}")?;
    if !outcome.size_sweep.is_empty() {
        writeln!(
            out,
            "\nExcess (false positives / visible, %) by cube edge s / depth D of the frustum, fov 60, 16:9:"
        )?;
        writeln!(out, "{}", sizes_table(&outcome.size_sweep))?;
        writeln!(
            out,
            "\nMissed visible items (ppm) of a world in f32 at an offset, six-plane test, nothing rebased:"
        )?;
        writeln!(out, "{}", offsets_table(&outcome.offset_sweep))?;
    }
    out.flush()
}

fn named(point: &Point) -> String {
    format!(
        "{} {} {} {} eps {}",
        point.structure, point.test, point.arithmetic, point.planes, point.epsilon
    )
}

/// A share in percent without the sign, three decimals.
fn as_percent(share: f64) -> String {
    format!("{:.3}", share * 100.0)
}

/// What is returned too much: items by storage, by planes and by the test.
fn by_source(errors: &ErrorCount) -> String {
    let by_test = errors.false_positives - errors.by_storage - errors.by_planes;
    format!("{}/{}/{by_test}", errors.by_storage, errors.by_planes)
}

fn points_table(points: &[Point]) -> text::Table {
    let mut table = text::table(
        &[
            "",
            "structure",
            "test",
            "numbers",
            "planes",
            "eps",
            "excess %",
            "by storage/planes/test",
            "missed ppm",
            "contacts dropped",
            "worst miss",
            "query [95 % interval]",
            "ns/item",
            "B/item",
            "status",
        ],
        &[5, 6, 7, 8, 9, 10, 11, 12, 13],
    );
    for point in points {
        let interval = [point.query_ns_lower, point.query_ns_upper];
        let time = text::time_within(point.query_ns, interval);
        let judged = point.status != Status::Refused;
        let of = |value: String| if judged { value } else { String::new() };
        table.add_row([
            if point.on_front { "*" } else { "" }.to_owned(),
            point.structure.clone(),
            point.test.to_owned(),
            point.arithmetic.to_owned(),
            point.planes.to_owned(),
            point.epsilon.to_string(),
            point.excess.map(as_percent).unwrap_or_default(),
            of(by_source(&point.errors)),
            point
                .false_negative_ppm
                .map(text::significant)
                .unwrap_or_default(),
            of(point.errors.touch_dropped.to_string()),
            of(text::significant(point.errors.worst_miss)),
            time,
            point.ns_per_item.map(text::significant).unwrap_or_default(),
            point
                .memory_bytes_per_item
                .map(|b| format!("{b:.1}"))
                .unwrap_or_default(),
            point.status.name().to_owned(),
        ]);
    }
    table
}

fn sizes_table(rows: &[SizeRow]) -> text::Table {
    let tests = rows.first().map(|row| row.tests.iter().map(|t| t.test));
    let mut header = vec!["s/D", "cubes", "visible"];
    header.extend(tests.into_iter().flatten());
    let right: Vec<usize> = (0..header.len()).collect();
    let mut table = text::table(&header, &right);
    for row in rows {
        let mut cells = vec![
            row.size_over_depth.to_string(),
            text::count(row.cubes as usize),
            text::count(row.visible as usize),
        ];
        cells.extend(row.tests.iter().map(|t| as_percent(t.excess)));
        table.add_row(cells);
    }
    if let Some(row) = rows.iter().find(|row| row.size_over_depth == 0.3) {
        let mut cells = vec!["ns/box".to_owned(), String::new(), String::new()];
        cells.extend(row.tests.iter().map(|t| text::significant(t.ns_per_box)));
        table.add_row(cells);
    }
    table
}

fn offsets_table(rows: &[OffsetRow]) -> text::Table {
    let mut offsets: Vec<f64> = rows.iter().map(|row| row.offset).collect();
    offsets.dedup();
    let mut header = vec!["planes".to_owned(), "numbers".to_owned(), "eps".to_owned()];
    header.extend(offsets.iter().map(|offset| format!("{offset:e}")));
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    let right: Vec<usize> = (2..header.len()).collect();
    let mut table = text::table(&header, &right);
    let kinds = rows.iter().filter(|row| row.offset == offsets[0]);
    for kind in kinds {
        let mut cells = vec![
            kind.planes.to_owned(),
            kind.arithmetic.to_owned(),
            kind.epsilon.to_string(),
        ];
        let same = |row: &&OffsetRow| {
            (row.planes, row.arithmetic, row.epsilon)
                == (kind.planes, kind.arithmetic, kind.epsilon)
        };
        cells.extend(rows.iter().filter(same).map(|row| {
            let ppm = row.false_negative_ppm.map(text::significant);
            ppm.unwrap_or_else(|| "refused".to_owned())
        }));
        table.add_row(cells);
    }
    table
}
