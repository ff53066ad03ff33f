//! Funnel study: every back end of every stage on the views of a path.
//!
//! All are compared with the truth, then timed side by side in one or more processes.

use anyhow::Result;

use super::error::{LeftOutRow, check_memory};
use super::fragment_stage::{FragmentStage, MeanCounts};
use super::item_stages::{ItemStages, PlanView};
use super::picks::Picks;
use super::report::{CutOutRow, FunnelReport, Gain, StageRow, conclusions};
use super::setup::{FunnelInput, Setup};
use super::stage::{Chain, NONE, StageKind, default_test, left_out_of};
use super::task::{FunnelPlan, KeyedTask};
use super::triangle_stage::TriangleStage;
use super::visible_items::{Errors, VisibleItems, visible};
use crate::input::{InputError, warn};
use crate::measure::{ProcessTimes, Setting, Verdict};
use crate::scene::memory::{available_bytes, fits_into};
use crate::visibility::{MapSelection, SampleGrid};

/// Bytes per sample of a view: rays, depths and ties of two images.
///
/// Measured: 230 for meshes, 290 to 350 for boxes, and 660 without culling.
const BYTES_PER_SAMPLE: u64 = 450;

/// Bytes per solid box that the chain leaves in a view; 1,480 were measured.
///
/// Includes its triangles with all their back ends, and fragments.
const BYTES_PER_REMAINING: f64 = 1600.0;

/// Rejects images that need more memory than is available.
fn fits(grid: SampleGrid, available: Option<u64>) -> Result<(), InputError> {
    let SampleGrid { width, height } = grid;
    let needed = u64::from(width) * u64::from(height) * BYTES_PER_SAMPLE;
    let images = format!("--samples {width}x{height}");
    fits_into(available, [&images, "", "fewer samples"], needed)
}

/// All timed work, on the items that the chain leaves.
struct Study<'w> {
    chain: &'w Chain,
    items: ItemStages<'w>,
    triangles: TriangleStage,
    fragments: FragmentStage<'w>,
    picks: Option<Picks<'w>>,
}

impl<'w> Study<'w> {
    fn new(setup: &'w Setup<'w>, input: &'w FunnelInput) -> Result<Study<'w>> {
        let chain = &input.chain;
        let items = ItemStages::all(setup, chain);
        if setup.shape.boxes().is_some() {
            let left = items.mean_count(chain) * setup.views.len() as f64;
            check_memory(&setup.scene.name, (left * BYTES_PER_REMAINING) as u64)?;
        }
        let triangles = TriangleStage::new(&items);
        let culled = (&triangles, chain.of(StageKind::Triangle));
        let fragments = FragmentStage::new(&items, culled);
        Ok(Study {
            picks: (input.all && input.picks).then(|| Picks::new(setup)),
            chain,
            items,
            triangles,
            fragments,
        })
    }

    /// All timed tasks.
    fn tasks(&self) -> Vec<KeyedTask<'_>> {
        let culled = self.items.tasks().chain(self.triangles.tasks());
        let picks = self.picks.iter().flat_map(Picks::tasks);
        culled.chain(self.fragments.tasks()).chain(picks).collect()
    }

    /// Rows of all stages before the fragment stage.
    fn rows(&self, truth: &VisibleItems) -> Vec<StageRow> {
        let mut rows = Vec::new();
        for stage in [&StageKind::OF_ITEMS[..], &[StageKind::Triangle]].concat() {
            for (back_end, name) in self.items.setup.rows(stage) {
                let counts = match stage {
                    StageKind::Triangle => self.triangles.counts(&name),
                    _ => {
                        let before = self.chain.steps_before(stage);
                        let steps = self.chain.steps_with(stage, &name);
                        self.items.counts(&before, &steps, truth)
                    }
                };
                let errors = Errors::of(&counts);
                rows.push(StageRow::new(back_end, &name, self.chain, errors));
            }
        }
        rows
    }

    /// Compares the chain with itself minus each stage, from the rows of all stages.
    fn gains(&self, rows: &[StageRow]) -> Vec<Gain> {
        let timed = self.items.timed(self.chain);
        let of_items = StageKind::OF_ITEMS.into_iter();
        let of_items = of_items.filter(|&stage| self.chain.of(stage) != NONE);
        let gain = |with: &Chain, stage| {
            let chains = [with.clone(), with.clone().with(stage, NONE)];
            let counts = chains.each_ref().map(|chain| self.items.mean_count(chain));
            let tasks = chains.each_ref().map(|chain| self.items.timed(chain));
            Gain::new(stage, (with.of(stage), stage.unit()), counts, tasks)
        };
        let of_items = of_items.filter_map(|stage| {
            if self.chain.is_separate(stage) {
                return Some(gain(self.chain, stage));
            }
            // The occlusion stage includes the object stage, but removes nothing.
            let is_vain = gain(self.chain, StageKind::Occlusion).removed() == 0.0;
            let alone = self.chain.clone().with(StageKind::Occlusion, NONE);
            is_vain.then(|| gain(&alone, stage))
        });
        let behind = rows.iter().filter(|row| row.is_chosen).filter_map(|row| {
            let stage = row.back_end.stage;
            if StageKind::OF_ITEMS.contains(&stage) {
                return None;
            }
            let with = [&timed[..], &[row.key(self.chain)?]].concat();
            let (unit, counts) = self.counts_after(row, rows);
            let tasks = [with, timed.clone()];
            Some(Gain::new(stage, (row.back_end.name, unit), counts, tasks))
        });
        of_items.chain(behind).collect()
    }

    /// Unit and counts, with and without a stage that follows the item stages.
    ///
    /// Without a fragment test every fragment of the remaining items is shaded.
    fn counts_after(&self, row: &StageRow, rows: &[StageRow]) -> (&'static str, [f64; 2]) {
        let default = default_test(self.items.setup.cut_outs.is_some());
        let every = rows.iter().find(|row| row.back_end.name == default);
        match row.fragments.zip(every.and_then(|row| row.fragments)) {
            Some((own, every)) => ("fragments", [own.shaded_count, every.fragment_count]),
            None => (row.unit, [row.errors.output_count, row.errors.input_count]),
        }
    }
}

/// A study that is compared with the truth, but not timed.
pub struct UntimedFunnel {
    /// Tasks and schedule for all processes.
    pub plan: FunnelPlan,
    report: FunnelReport,
}

/// Compares all back ends with the truth and plans their timing.
///
/// `begin` gets the name of each step before it starts.
///
/// # Errors
/// A camera, a structure, a back end or an image that is rejected.
pub fn prepare(input: &FunnelInput, begin: &dyn Fn(&str)) -> Result<UntimedFunnel> {
    let Setting { scene, path, .. } = input.setting;
    fits(input.samples, available_bytes())?;
    let setup = Setup::new(input, begin)?;
    let mut warnings = crate::path::warnings(scene, &path.name, &path.cameras);
    let rounded = setup.rounded();
    rounded.iter().for_each(|text| warn(text));
    warnings.extend(rounded);
    begin("truth");
    let truth = visible(&setup, input.execution.threads)?;
    begin("every stage, compared with the truth");
    let study = Study::new(&setup, input)?;
    let mut rows = study.rows(&truth);
    for (back_end, errors, counts) in study.fragments.tested(&study.items, &truth) {
        rows.push(StageRow {
            fragments: MeanCounts::of(&counts),
            ..StageRow::new(back_end, back_end.name, &input.chain, errors)
        });
    }
    let mut left_out = Vec::from_iter(left_out_of(scene));
    let too_much = study.fragments.too_much.iter();
    left_out.extend(too_much.map(|reason| LeftOutRow::new("stages", "fragment", reason)));
    let mut picks = Vec::new();
    if let Some(all) = &study.picks {
        begin("picking");
        picks = all.compared();
        left_out.extend_from_slice(&all.left_out);
    } else if input.all {
        let reason = "not asked for: --no-picks";
        left_out.push(LeftOutRow::new("picks", "all", reason));
    }
    let cut_outs = input.cut_outs.zip(setup.cut_outs.as_ref());
    let ground = setup.occluders.ground.as_ref();
    let report = FunnelReport {
        scene: scene.name.clone(),
        path: path.name.clone(),
        items: scene.items.len(),
        skipped_items: scene.skipped_items,
        views: setup.views.len(),
        cameras: path.cameras.len(),
        samples: [input.samples.width, input.samples.height],
        processes: 0,
        level: MapSelection::of(&scene.name, scene, &input.loading)?,
        cut_outs: cut_outs.map(|(typed, made)| CutOutRow {
            typed: *typed,
            item_count: made.of_item.iter().flatten().count(),
        }),
        chain: input.chain.clone(),
        gains: study.gains(&rows),
        stages: rows,
        inner_boxes: setup.occluders.inner.clone(),
        ground: ground.map(|ground| ground.row.clone()),
        solid_blocks: setup.occluders.blocks.clone(),
        picks,
        left_out,
        conclusions: Vec::new(),
        warnings,
        plan_view: PlanView::of(&setup, &study.items, &input.chain, &truth),
    };
    let mut tasks = study.tasks();
    if !input.all {
        tasks.retain(|(key, _)| report.needs(key));
    }
    Ok(UntimedFunnel {
        plan: FunnelPlan::of(tasks, setup.views.len(), input),
        report,
    })
}

/// Times the plan in one process.
///
/// # Errors
/// The errors of [`prepare`].
pub fn time(input: &FunnelInput, plan: &FunnelPlan) -> Result<ProcessTimes> {
    let setup = Setup::new(input, &|_| ())?;
    let study = Study::new(&setup, input)?;
    Ok(plan.time(study.tasks(), input))
}

impl UntimedFunnel {
    /// Builds the report from the times of all processes.
    pub fn conclude(self, processes: &[ProcessTimes]) -> FunnelReport {
        let times = self.plan.times(processes);
        let mut report = self.report;
        report.processes = processes.len();
        let chain = &report.chain;
        for row in &mut report.stages {
            row.set(chain, &times);
        }
        for row in &mut report.picks {
            row.set(times.ns(row.key()));
        }
        report.gains.iter_mut().for_each(|gain| gain.set(&times));
        report.conclusions = conclusions(&report);
        report
    }
}

/// Reason of the first task without a time, if any.
pub fn failure(processes: &[ProcessTimes]) -> Option<&Verdict> {
    let results = processes.iter().flat_map(|process| &process.ln_ns);
    results.filter_map(|result| result.as_ref().err()).next()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_that_do_not_fit_are_refused_in_a_line() {
        let large = SampleGrid::new(16_384, 8_192);
        let refused = fits(large, Some(8_000_000_000)).unwrap_err().to_string();
        assert_eq!(
            refused,
            "--samples 16384x8192: needs about 60.4 GB, 8.0 GB are free; expected fewer samples"
        );
        assert!(fits(large, Some(61_000_000_000)).is_ok() && fits(large, None).is_ok());
        assert!(fits(SampleGrid::new(320, 180), Some(1)).is_err());
    }
}
