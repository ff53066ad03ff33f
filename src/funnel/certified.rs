//! Proofs for what the chain removed and for what is visible: written to a file, and
//! checked by `cullbench check`.

use serde::Serialize;

use super::error::FunnelError;
use super::pass::{ALL, Pass};
use super::regions::ClaimAudit;
use super::stage::{NONE, StageKind};
use super::world::{FunnelInput, World};
use crate::query::ItemId;
use crate::scene::ItemShape;
use crate::visibility::region::ClaimErrors;
use crate::visibility::truth::{Certificates, Prover, RayIndex, SampleTruth, certify};

/// A line of a file of proofs.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
#[non_exhaustive]
pub enum Proofs {
    /// What is visible and what is hidden in a view.
    View(Certificates),
    /// What is wrong with a claim of what is seen from where.
    Claim(ClaimErrors),
}

impl Proofs {
    /// As text; [`Proofs::from_json`] reads back the very same numbers.
    ///
    /// # Panics
    /// Never: all of it is JSON.
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).expect("proofs are JSON")
    }

    /// Reads a line.
    ///
    /// # Errors
    /// What is no view's: most lines are of views.
    pub fn from_json(text: &str) -> serde_json::Result<Proofs> {
        let view = Certificates::from_json(text).map(Proofs::View);
        view.or_else(|error| {
            let claim = serde_json::from_str(text).map(Proofs::Claim);
            claim.map_err(|_| error)
        })
    }

    /// The scene that it is about, as it is typed.
    pub fn scene(&self) -> &str {
        match self {
            Proofs::View(certificates) => &certificates.scene,
            Proofs::Claim(errors) => &errors.scene,
        }
    }
}

/// Looks for a proof of every item of each view that the frustum meets and that is
/// either visible or removed by the chain; hands over the errors of every claim, then one
/// view after the other. Of a map, whose items are no solids, there are no views. False if
/// stopped.
///
/// # Errors
/// As [`prepare`](super::prepare).
pub fn certificates(
    input: &FunnelInput,
    stop: &dyn Fn() -> bool,
    mut each: impl FnMut(Proofs),
) -> Result<bool, FunnelError> {
    let no_solids = || FunnelError::NoSolids {
        scene: input.scene.name.clone(),
        shape: input.scene.item_shape(),
    };
    if input.scene.item_shape() == ItemShape::Mesh {
        return Err(no_solids());
    }
    let world = World::new(input)?;
    for ClaimAudit { claim, audit } in world.audits() {
        let regions = world.region_row(claim).map_or(0, |row| row.graph().len());
        let errors = ClaimErrors::of(audit, &input.scene.name, claim, regions);
        each(Proofs::Claim(errors));
    }
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
        let proofs = proofs.of_camera(&input.path.name, world.camera(view));
        each(Proofs::View(proofs));
    }
    Ok(true)
}
