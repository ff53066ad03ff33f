//! Proofs for what the chain removed and for what is visible: written to a file, and
//! checked by `cullbench check`.

use super::error::FunnelError;
use super::pass::{ALL, Pass};
use super::regions::ClaimAudit;
use super::stage::{NONE, StageKind};
use super::world::{FunnelInput, World};
use crate::query::ItemId;
use crate::scene::ItemShape;
use crate::visibility::region::ClaimErrors;
use crate::visibility::truth::{Certificates, Prover, RayIndex, SampleTruth, certify};

/// What is wrong with each claim of what is seen from where, with what shows it.
///
/// # Errors
/// As [`prepare`](super::prepare).
pub fn claim_errors(input: &FunnelInput) -> Result<Vec<ClaimErrors>, FunnelError> {
    let world = World::new(input)?;
    let audits = world.audits().iter().map(|ClaimAudit { claim, audit }| {
        let regions = world.region_row(claim).map_or(0, |row| row.graph().len());
        ClaimErrors::of(audit, &input.scene.name, claim, regions)
    });
    Ok(audits.collect())
}

/// Looks for a proof of every item of each view that the frustum meets and that is
/// either visible or removed by the chain; hands over one view after the other. False
/// if stopped. Of a map, whose items are no solids, there are none.
///
/// # Errors
/// As [`prepare`](super::prepare).
pub fn certificates(
    input: &FunnelInput,
    stop: &dyn Fn() -> bool,
    mut each: impl FnMut(Certificates),
) -> Result<bool, FunnelError> {
    let no_solids = || FunnelError::NoSolids {
        scene: input.scene.name.clone(),
        shape: input.scene.item_shape(),
    };
    if input.scene.item_shape() == ItemShape::Mesh {
        return Err(no_solids());
    }
    let world = World::new(input)?;
    let Some(solids) = world.solids() else {
        return match world.audits() {
            [] => Err(no_solids()),
            _ => Ok(true),
        };
    };
    let index = RayIndex::build(solids);
    let mut pass = Pass::new(&world);
    let Some(walked) = pass.walk(input.chain, stop) else {
        return Ok(false);
    };
    let object = input.chain.of(StageKind::Object);
    let in_view = match object {
        NONE => ALL,
        name => match pass.step(StageKind::Object, name, ALL, stop) {
            Some(step) => pass.steps()[step].output,
            None => return Ok(false),
        },
    };
    for view in 0..world.views() {
        if stop() {
            return Ok(false);
        }
        let rays = world.rays(view);
        let threads = input.execution.threads;
        let truth = SampleTruth::of(solids, &index, rays, input.samples, threads);
        let left = world.listed(pass.items(walked.left(), view));
        let all = world.listed(pass.items(in_view, view));
        let is_asked = |id: &ItemId| truth.sees(*id) || left.binary_search(id).is_err();
        let mut items: Vec<ItemId> = all.iter().copied().filter(is_asked).collect();
        // What an unproven chain lost is proven visible, which is the point.
        items.extend(
            truth
                .visible
                .iter()
                .filter(|id| all.binary_search(id).is_err()),
        );
        items.sort_unstable();
        let prover = Prover::new(solids, &index, rays);
        let scene = &input.scene.name;
        let proofs = certify(scene, &prover, rays, &truth, &items, threads);
        each(proofs.of_camera(&input.path.name, world.camera(view)));
    }
    Ok(true)
}
