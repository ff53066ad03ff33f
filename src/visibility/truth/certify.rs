//! Certificates for many items at once: samples that the truth knows for what it sees,
//! the search for the rest.

use super::certificate::{Certificates, Proof};
use super::cover::Prover;
use super::sample::{NO_ITEM, SampleTruth};
use crate::query::ItemId;
use crate::threads;
use crate::visibility::{Ray, Rays};

/// Items that a thread takes at a time.
const CHUNK: usize = 16;

/// Proofs for the items in question, in their order: witnesses of the samples for
/// those that the truth sees, the search for the others. The same on any number of
/// threads.
pub fn certify(
    scene: &str,
    prover: &Prover,
    rays: &Rays,
    truth: &SampleTruth,
    items: &[ItemId],
    threads: usize,
) -> Certificates {
    let seen = first_samples(prover, rays, truth);
    let of = |item: ItemId| match truth.visible.binary_search(&item) {
        Ok(place) => Proof::witness(&sample(rays, truth, seen[place])),
        Err(_) => prover.prove(item),
    };
    let mut proofs = vec![Vec::new(); items.len().div_ceil(CHUNK)];
    threads::share(
        threads,
        proofs.iter_mut().zip(items.chunks(CHUNK)),
        |(proofs, items)| {
            proofs.extend(items.iter().map(|&item| (item, of(item))));
        },
    );
    let boxes = prover.index().len();
    Certificates::new(scene, boxes, prover.view().clone(), proofs.concat())
}

fn sample(rays: &Rays, truth: &SampleTruth, place: usize) -> Ray {
    let width = truth.grid.width as usize;
    rays.sample(truth.grid, (place % width) as u32, (place / width) as u32)
}

/// For each visible item a sample that sees it.
fn first_samples(prover: &Prover, rays: &Rays, truth: &SampleTruth) -> Vec<usize> {
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
        // The rest is only ever the second of a tie.
        for (place, _) in truth
            .front
            .iter()
            .enumerate()
            .filter(|(_, item)| **item != NO_ITEM)
        {
            let front = prover.index().front_of(&sample(rays, truth, place));
            if front.is_some_and(|front| front.items.iter().any(|&item| note(item, place) == 0)) {
                break;
            }
        }
    }
    seen
}
