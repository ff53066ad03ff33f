//! `cullbench precision`: error against run time of a scene and path, and the
//! sweeps over item size and ill-conditioned cameras behind it. How it is shown is
//! in `precision_tables` and `precision_conclusions`.

use anyhow::bail;

use super::args::PrecisionArgs;
use super::interrupt::Interrupted;
use super::processes::Workers;
use super::protocol::{Job, Timing};
use super::study::Study;
use super::{
    Ending, expect_places, interrupt, load_scene, precision_conclusions, precision_diagram,
    precision_tables, print, stage_sweep, write_text,
};
use crate::index::Registry;
use crate::measure::{ProcessTimes, Protocol, Status};
use crate::path;
use crate::precision::{self, PointPlan, PrecisionInput, SWEEPS, size_sweep, sweep};
use crate::scene;

/// Rounds of a point, if one process has them all.
const ROUNDS: [usize; 2] = [5, 15];
/// Cameras of each value of the other sweeps: one for so many cubes, and no more
/// than this.
const CUBES_PER_CAMERA: usize = 10_000;
const SWEEP_CAMERAS: usize = 200;

pub fn precision(registry: &Registry, args: &PrecisionArgs) -> anyhow::Result<Ending> {
    let inputs = [args.scene.as_ref(), args.path.as_ref()];
    expect_places(&[("--svg", args.svg.as_deref())], &inputs)?;
    if let Some(stage) = args.stage {
        return stage_sweep::sweep(registry, args, stage);
    }
    let structures = args.kernel.structures(registry, &args.structure)?;
    let defaults = args.lens.defaults()?;
    let scene = load_scene(&args.scene, &args.scene_args, 2 * structures.len())?;
    if scene.items.is_empty() {
        bail!("scene '{}' has no items; expected at least one", scene.name);
    }
    let path = path::load(&args.path, &scene, &defaults)?;
    let study = Study::new(format!("{}, {}: ", args.scene, args.path), 0, &args.spread);
    study.begin("every point, checked");
    let protocol = protocol(args, 0);
    let input = PrecisionInput {
        scene: &scene,
        path: &path,
        structures: &structures,
        most_cameras: args.frames as usize,
        protocol: &protocol,
    };
    // There are no files yet: Ctrl-C ends the program.
    let going_on = &|| false;
    let prepared = precision::prepare(&input, going_on)?.ok_or(Interrupted)?;
    let (mut sizes, mut sweeps) = (Vec::new(), Vec::new());
    if args.cubes > 0 {
        study.begin("the sweep over sizes");
        let rows = size_sweep(args.cubes, args.spread.seed, going_on)?;
        sizes = rows.unwrap_or_default();
        let cameras = args
            .cubes
            .div_ceil(CUBES_PER_CAMERA)
            .clamp(2, SWEEP_CAMERAS);
        for (which, name, _) in SWEEPS {
            study.begin(&format!("the sweep over {name}"));
            let rows = sweep(which, cameras, args.spread.seed, going_on);
            sweeps.extend(rows.unwrap_or_default());
        }
    }
    interrupt::from_now_on_finish();
    let workers = Workers::of_study()?;
    let points = |timing| Job::Points(prepared.plan.clone(), timing);
    let times = study.times(&workers, "every point, timed", path.lens_scale, points)?;
    let precision = prepared.conclude(&times);
    let wrong = precision
        .points
        .iter()
        .any(|p| matches!(p.status, Status::Wrong | Status::Panicked));
    let outcome = precision_tables::Outcome {
        precision,
        seed: args.spread.seed,
        size_sweep: sizes,
        sweeps,
    };
    let shown = print(args.format, &outcome, || {
        precision_tables::show(&outcome).and_then(|()| precision_conclusions::show(&outcome))
    });
    if let Some(file) = &args.svg {
        write_text(file, &precision_diagram::draw(&outcome.precision)?)?;
    }
    shown?;
    Ok(Ending::of(!wrong))
}

/// Of one of the processes, all cameras.
fn protocol(args: &PrecisionArgs, process: u32) -> Protocol {
    args.spread.protocol(ROUNDS, process, usize::MAX)
}

/// One process's share of the points.
pub fn time(
    registry: &Registry,
    args: &PrecisionArgs,
    plan: &PointPlan,
    timing: &Timing,
    stop: &dyn Fn() -> bool,
) -> anyhow::Result<Option<ProcessTimes>> {
    let scene = scene::load(&args.scene, &args.scene_args.options(0))?;
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
