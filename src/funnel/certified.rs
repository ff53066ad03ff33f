//! Proofs for what the back ends removed and for what is visible: written to a file,
//! checked by `cullbench check`, and held against what the back ends promise.

use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};

use super::material::Material;
use super::pass::{ALL, Pass};
use super::proven::Proven;
use super::regions::ClaimAudit;
use super::seen::Shown;
use super::walks::Walks;
use super::world::{FunnelInput, World};
use crate::json::{JsonError, from_json};
use crate::query::ItemId;
use crate::visibility::region::ClaimErrors;
use crate::visibility::truth::{Certificates, Class, Proof, SampleTruth};

/// A line of a file of proofs.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
#[non_exhaustive]
pub enum Proofs {
    /// What is visible and what is hidden in a view.
    View(Box<Certificates>),
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
    /// What is no claim's, if it has the field `claim`, and no view's if not.
    pub fn from_json(text: impl AsRef<[u8]>) -> Result<Proofs, JsonError> {
        #[derive(Deserialize)]
        struct Tag {
            claim: Option<IgnoredAny>,
        }
        let text = text.as_ref();
        Ok(match from_json::<Tag>(text)?.claim {
            Some(_) => Proofs::Claim(from_json(text)?),
            None => Proofs::View(Box::new(from_json(text)?)),
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
/// either visible or removed by any back end; hands over the errors of every claim, then
/// one view after the other. `None` if stopped.
pub fn certified(
    input: &FunnelInput,
    world: &World,
    pass: &Pass,
    walks: &Walks,
    stop: &dyn Fn() -> bool,
    each: &mut dyn FnMut(Proofs),
) -> Option<Proven> {
    for ClaimAudit { claim, audit } in world.audits() {
        let regions = world.region_row(claim).map_or(0, |row| row.graph().len());
        let errors = ClaimErrors::of(audit, &input.scene.name, claim, regions);
        each(Proofs::Claim(errors));
    }
    let (material, shown) = (Material::of(input, world), Shown::of(world));
    let mut known = Vec::with_capacity(world.views());
    for view in 0..world.views() {
        if stop() {
            return None;
        }
        let rays = world.rays(view);
        let threads = input.execution.threads;
        let truth = shown.at_samples(rays, input.samples, threads);
        let items = in_question(world, pass, walks, view, &truth);
        let proofs = material.certify(
            &input.scene.name,
            rays,
            world.is_inside(view),
            &truth,
            &items,
            threads,
        );
        let class = |(item, proof): &(ItemId, Proof)| (*item, Class::of(&truth, *item, proof));
        known.push(proofs.proofs.iter().map(class).collect());
        let proofs = proofs.of_camera(&input.path.name, world.camera(view));
        each(Proofs::View(Box::new(proofs)));
    }
    Some(Proven::new(known))
}

/// The items in the frustum that are in front at a sample or that a back end removed, and
/// what is in front of all others wherever it is; ascending. Which items are in the
/// frustum is asked without any structure.
fn in_question(
    world: &World,
    pass: &Pass,
    walks: &Walks,
    view: usize,
    truth: &SampleTruth,
) -> Vec<ItemId> {
    let rows = walks.rows.iter();
    let outputs = rows.map(|(stage, _, step)| walks.sets(pass, *stage, *step)[1]);
    let mut outputs: Vec<usize> = outputs.filter(|&set| set != ALL).collect();
    outputs.sort_unstable();
    outputs.dedup();
    let outputs = outputs.into_iter().map(|set| pass.items(set, view));
    let outputs: Vec<&[ItemId]> = outputs.flatten().collect();
    let is_removed = |id: &ItemId| outputs.iter().any(|set| set.binary_search(id).is_err());
    let boxes = (0..).zip(&world.scene.items);
    let in_view = boxes.filter(|(_, b)| world.volume(view).sees(b));
    let mut items: Vec<ItemId> = in_view.map(|(id, _)| id).filter(is_removed).collect();
    // What was lost is proven visible, which is the point.
    let is_item = |id: &&ItemId| (**id as usize) < world.items();
    items.extend(truth.visible.iter().filter(is_item));
    items.sort_unstable();
    items.dedup();
    items
}
