//! `cullbench precision --stage`: error against run time of one stage of the funnel.

use std::io::{self, Write};

use anyhow::bail;

use super::args::PrecisionArgs;
use super::interrupt::Interrupted;
use super::processes::Workers;
use super::protocol::{Job, Timing};
use super::study::Study;
use super::table::Table;
use super::{Ending, funnel_table, interrupt, load_scene_by, print, text};
use crate::funnel::{
    self, Chain, FunnelInput, FunnelPlan, NONE, StageKind, StageSweep, SweepPoint,
};
use crate::index::{Registry, StructureSpec};
use crate::measure::{ProcessTimes, Protocol};
use crate::path::{self, CameraPath};
use crate::scene::{self, LoadOptions, Scene};
use crate::suite::DEFAULT_PATH;
use crate::visibility::occlusion::OccluderChoice;
use crate::visibility::{Guarantee, SampleGrid};

/// Rounds of a point, if one process has them all.
const ROUNDS: [usize; 2] = [3, 9];
/// The samples of a view, beside its random rays.
const SAMPLES: SampleGrid = SampleGrid::new(320, 180);
/// Where the stages behind the frustum have something to do.
const STREET: &str = "street:frames=32";

/// Everything that a process needs to know.
struct Setting {
    structures: Vec<StructureSpec>,
    scene: Scene,
    path: CameraPath,
    chain: Chain,
}

impl Setting {
    fn of(
        registry: &Registry,
        args: &PrecisionArgs,
        scene: Scene,
        lens_scale: Option<f64>,
    ) -> anyhow::Result<Setting> {
        let mut structures = args.kernel.structures(registry, &args.structure)?;
        structures.truncate(1);
        let typed = match args.path.as_str() {
            DEFAULT_PATH => STREET,
            typed => typed,
        };
        let path = path::load_scaled(typed, &scene, &args.lens.defaults()?, lens_scale)?;
        let object = structures.first().map_or(NONE, |spec| &spec.label);
        let chain = Chain::for_scene(&scene, false).with(StageKind::Object, object);
        Ok(Setting {
            structures,
            scene,
            path,
            chain,
        })
    }

    fn input<'s>(
        &'s self,
        args: &PrecisionArgs,
        protocol: &'s Protocol,
    ) -> anyhow::Result<FunnelInput<'s>> {
        Ok(FunnelInput {
            scene: &self.scene,
            path: &self.path,
            most_views: args.frames as usize,
            samples: SAMPLES,
            cut_outs: None,
            mirror: None,
            chain: &self.chain,
            structures: &self.structures,
            protocol,
            claim: None,
            occluders: OccluderChoice::All,
            inner_boxes: None,
            execution: args.kernel.execution()?,
        })
    }
}

pub fn sweep(
    registry: &Registry,
    args: &PrecisionArgs,
    stage: StageKind,
) -> anyhow::Result<Ending> {
    if args.svg.is_some() {
        bail!("--svg draws the frustum's diagram; expected --svg or --stage, not both");
    }
    let load = LoadOptions {
        per_triangle: funnel::BYTES_PER_TRIANGLE,
        ..args.scene_args.options(3)
    };
    let scene = load_scene_by(&args.scene, &load)?;
    if scene.items.is_empty() {
        bail!("scene '{}' has no items; expected at least one", scene.name);
    }
    if funnel::back_ends(stage, &scene, false)
        .iter()
        .all(|row| row.name == NONE)
    {
        // Every scene has something for the others.
        let (name, stage) = (&scene.name, stage.name());
        let why = funnel::left_out_of(&scene);
        let why = why.map_or(String::new(), |row| format!(": {}", row.reason));
        bail!(
            "scene '{name}' has nothing for the {stage} stage{why}; expected a scene with rooms or \
             sectors"
        );
    }
    let setting = Setting::of(registry, args, scene, None)?;
    let about = format!("{}, {} stage: ", args.scene, stage.name());
    let study = Study::new(about, 0, &args.spread);
    study.begin("every point, judged");
    let protocol = protocol(args, 0);
    let input = setting.input(args, &protocol)?;
    // There are no files yet: Ctrl-C ends the program.
    let prepared = funnel::prepare_sweep(&input, stage, &|| false)?.ok_or(Interrupted)?;
    interrupt::from_now_on_finish();
    let workers = Workers::of_study()?;
    let job = |timing| Job::Sweep(prepared.plan.clone(), timing);
    let lens_scale = setting.path.lens_scale;
    let times = study.times(&workers, "every point, timed", lens_scale, job)?;
    let sweep = prepared.conclude(&times);
    print(args.format, &sweep, || show(&sweep, &mut text::terminal()))?;
    let is_broken = |point: &SweepPoint| {
        point.back_end.guarantee != Guarantee::Unproven && point.errors.false_negative_count > 0.0
    };
    Ok(Ending::of(!sweep.points.iter().any(is_broken)))
}

fn protocol(args: &PrecisionArgs, process: u32) -> Protocol {
    args.spread.protocol(ROUNDS, process, usize::MAX)
}

/// One process's share of the times.
pub fn time(
    registry: &Registry,
    args: &PrecisionArgs,
    plan: &FunnelPlan,
    timing: &Timing,
    stop: &dyn Fn() -> bool,
) -> anyhow::Result<Option<ProcessTimes>> {
    let Some(stage) = args.stage else {
        bail!("a sweep without a stage");
    };
    let scene = scene::load(&args.scene, &args.scene_args.options(0))?;
    let setting = Setting::of(registry, args, scene, timing.lens_scale)?;
    let protocol = protocol(args, timing.process);
    let input = setting.input(args, &protocol)?;
    Ok(funnel::time_sweep(&input, stage, plan, stop)?)
}

fn show(sweep: &StageSweep, out: &mut impl Write) -> io::Result<()> {
    writeln!(
        out,
        "{}, {}: {} stage, error against run time\n{} with {} random rays each beside {} x {} \
         samples; {}.",
        sweep.scene,
        sweep.path,
        sweep.stage.name(),
        text::counted(sweep.views, "view"),
        sweep.rays_per_view,
        SAMPLES.width,
        SAMPLES.height,
        funnel_table::spread(sweep.processes)
    )?;
    let mut table = Table::of(
        "by | >buffer | >out | >FP / visible | >FN / visible | >FN / view | >time / view \
         | >front",
    );
    table.rows.extend(sweep.points.iter().map(|point| {
        let (errors, times) = (&point.errors, &point.times);
        vec![
            format!(
                "{}{}",
                point.back_end.name,
                funnel_table::doubt(point.back_end.guarantee)
            ),
            point
                .buffer
                .map(|[w, h]| format!("{w}x{h}"))
                .unwrap_or_default(),
            text::significant(errors.output_count),
            text::rate(errors.excess, 1.0),
            text::rate(errors.missing, 1.0),
            text::significant(errors.false_negative_count),
            text::time_within(times.stage_ns, [times.stage_ns_lower, times.stage_ns_upper]),
            if point.on_front { "*" } else { "" }.to_owned(),
        ]
    }));
    writeln!(out, "{table}")?;
    let safe = sweep
        .points
        .iter()
        .filter(|p| p.back_end.guarantee != Guarantee::Unproven);
    let lossy = sweep
        .points
        .iter()
        .filter(|p| p.errors.false_negative_count > 0.0)
        .count();
    writeln!(
        out,
        "{lossy} of {} points lost something visible; {} of them promise that they do not. Than a * \
         nothing is as good in time and both errors and shown to be better in one.",
        sweep.points.len(),
        safe.filter(|point| point.errors.false_negative_count > 0.0)
            .count()
    )
}
