//! Certificates for many items at once: samples that the truth knows for what it sees,
//! the search for the rest.

use super::certificate::{Certificates, Proof};
use super::cover::Prover;
use super::ray_index::RayIndex;
use super::sample::{NO_ITEM, SampleTruth};
use super::surface_index::SurfaceIndex;
use crate::query::ItemId;
use crate::threads;
use crate::visibility::{Ray, Rays};

/// Items that a thread takes at a time.
const CHUNK: usize = 16;

/// What a ray ends at: by this a ray that no hider is in front of becomes a witness.
#[derive(Clone, Copy)]
pub enum Ends<'i> {
    /// The boxes of the items, all of them solid.
    Boxes(&'i RayIndex),
    /// The boxes of the items, of which those said to be cut out have holes: no witness
    /// is of one of these, or looks through one.
    CutOuts(&'i RayIndex, &'i [bool]),
    /// The triangles of the items.
    Triangles(&'i SurfaceIndex),
}

impl Ends<'_> {
    /// The items that are seen along the ray.
    fn seen(&self, ray: &Ray) -> Vec<ItemId> {
        match self {
            Ends::Boxes(index) | Ends::CutOuts(index, _) => {
                index.front_of(ray).map_or(Vec::new(), |front| front.items)
            }
            Ends::Triangles(index) => {
                let found = index.front_of(ray);
                [found.front, found.before].concat()
            }
        }
    }

    /// Whether the ray proves that the item is visible.
    fn prove(&self, item: ItemId, ray: &Ray) -> bool {
        let is_whole = match self {
            Ends::CutOuts(_, cut_out) => !cut_out[item as usize],
            Ends::Boxes(_) | Ends::Triangles(_) => true,
        };
        is_whole && self.seen(ray).contains(&item)
    }
}

/// Proofs for the items in question, in their order: witnesses of the samples for
/// those that `truth` sees (of the same boxes, all solid, or triangles), the search for
/// the others. The same on any number of threads.
pub fn certify(
    scene: &str,
    prover: &Prover,
    ends: Ends,
    rays: &Rays,
    truth: &SampleTruth,
    items: &[ItemId],
    threads: usize,
) -> Certificates {
    let seen = first_samples(ends, rays, truth);
    let of = |item: ItemId| {
        let proof = match truth.visible.binary_search(&item) {
            Ok(place) => Proof::witness(&sample(rays, truth, seen[place])),
            Err(_) => prover.prove(item),
        };
        match proof {
            Proof::Witness { origin, direction } => {
                let ray = prover.view().ray(origin, direction);
                match ends.prove(item, &ray) {
                    true => Proof::witness(&ray),
                    false => Proof::Undecided,
                }
            }
            proof => proof,
        }
    };
    let mut proofs = vec![Vec::new(); items.len().div_ceil(CHUNK)];
    threads::share(
        threads,
        proofs.iter_mut().zip(items.chunks(CHUNK)),
        |(proofs, items)| {
            proofs.extend(items.iter().map(|&item| (item, of(item))));
        },
    );
    let boxes = prover.items();
    let view = prover.view().clone();
    let certificates = Certificates::new(scene, boxes, view, proofs.concat());
    let certificates = Certificates {
        hiders: prover.hiders().clone(),
        ..certificates
    };
    certificates.without_unused()
}

fn sample(rays: &Rays, truth: &SampleTruth, place: usize) -> Ray {
    let width = truth.grid.width as usize;
    rays.sample(truth.grid, (place % width) as u32, (place / width) as u32)
}

/// For each visible item a sample that sees it.
fn first_samples(ends: Ends, rays: &Rays, truth: &SampleTruth) -> Vec<usize> {
    let mut seen = vec![usize::MAX; truth.visible.len()];
    let mut left = seen.len();
    let mut note = |item: ItemId, place: usize| {
        if let Ok(at) = truth.visible.binary_search(&item)
            && seen[at] == usize::MAX
        {
            seen[at] = place;
            left -= 1;
        }
        left
    };
    let mut fronts = truth
        .front
        .iter()
        .enumerate()
        .filter(|(_, item)| **item != NO_ITEM);
    if fronts.all(|(place, &item)| note(item, place) > 0) {
        // The rest is only ever the second of a tie, or is seen through.
        for place in 0..truth.front.len() {
            let found = ends.seen(&sample(rays, truth, place));
            if found.iter().any(|&item| note(item, place) == 0) {
                break;
            }
        }
    }
    seen
}
