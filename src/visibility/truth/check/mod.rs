//! The second opinion on certificates: whether each proof is one, by exact arithmetic
//! and without any code of the search. It is meant to be read.
//!
//! All that is compared here are depths along lines, which are fractions. A line goes
//! through `place / unit` in `direction`; it crosses the plane x_k = c at
//! t = (c * unit - place_k) / (unit * direction_k). With gap = c * unit - place_k,
//! t(a) < t(b) is gap(a) * direction(b) < gap(b) * direction(a), turned round once
//! for each direction that is below zero. All lines of a view share the eye or the
//! direction, so this form is linear in the three numbers of a line: what it says of
//! the corners of a cell it says of every line through it.

mod facts;
mod ground;
mod inside;
mod judge;
mod line;
mod part;
mod plan;
mod rough;
mod triangle;
mod witness;

pub use self::facts::Facts;
use self::facts::Named;
use self::judge::Judge;
use self::line::{exact, holds};
use self::part::{Side, has_no_area, image};
use self::plan::Covers;
pub(super) use self::plan::covers;
use self::witness::witness;
use super::certificate::{Certificates, Except, Hiders, Proof, View};
use crate::query::ItemId;
use crate::scene::WorldBox;

/// What a set of certificates proves.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
#[non_exhaustive]
pub struct Counts {
    /// Items proven visible.
    pub visible: usize,
    /// Items proven hidden.
    pub hidden: usize,
    /// Items proven to be in front only where one of a lower number is as near.
    pub tied: usize,
    /// Items proven to be in front along lines of the image at most, or so tied.
    pub along_lines: usize,
    /// Items of which nothing is claimed.
    pub undecided: usize,
    /// Parts of images that were found to lie behind a box.
    pub cells: usize,
}

/// The first proof that is none.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("the certificate of item {item} does not hold: {reason}")]
pub struct Rejected {
    /// Whose it is; of the view as a whole, 0.
    pub item: ItemId,
    /// What is wrong with it.
    pub reason: &'static str,
}

/// Verifies every proof, for the items as they were written.
///
/// It takes the view as it is: that it is the camera's is for the caller to compare
/// ([`View::of`]). O(boxes) a witness; a few microseconds a corner of a cell.
///
/// # Errors
/// The first certificate that does not hold.
pub fn check(certificates: &Certificates, facts: &Facts) -> Result<Counts, Rejected> {
    let (view, boxes) = (&certificates.view, facts.boxes);
    let of_view = |reason| Rejected { item: 0, reason };
    sound(view, certificates.boxes, boxes).map_err(of_view)?;
    let named = Named::new(view, &certificates.hiders, facts).map_err(of_view)?;
    let are_boxes = !matches!(certificates.hiders, Hiders::Within(_));
    let mut counts = Counts::default();
    for (item, proof) in &certificates.proofs {
        let reject = |reason| Rejected {
            item: *item,
            reason,
        };
        let own = boxes
            .get(*item as usize)
            .ok_or(reject("there is no such item"))?;
        match proof {
            Proof::Undecided => counts.undecided += 1,
            Proof::Witness { origin, direction } => {
                witness(view, *origin, *direction, *item, facts).map_err(reject)?;
                counts.visible += 1;
            }
            Proof::AroundEye => {
                let around = !view.parallel && view.near > 0.0 && holds(own, view.eye);
                around.then_some(()).ok_or(reject("the eye is not in it"))?;
                let solid = are_boxes.then_some(());
                solid.ok_or(reject("the eye is in a box around triangles"))?;
                counts.hidden += 1;
            }
            Proof::Walls(walls) => {
                match covers(view, facts, *item, walls).map_err(reject)? {
                    Covers::Everywhere => counts.hidden += 1,
                    Covers::ButAlongLines => counts.along_lines += 1,
                }
                counts.cells += walls.len();
            }
            Proof::Cover {
                outline, except, ..
            } if outline.is_empty() => {
                let flat = *except == Except::Lines && has_no_area(view, own);
                flat.then_some(()).ok_or(reject("its image has an area"))?;
                counts.along_lines += 1;
            }
            Proof::Cover {
                outline,
                except,
                cell,
            } => {
                let image = image(view, own, outline).map_err(reject)?;
                let sides = view.sides.map(|side| Side {
                    line: exact(side),
                    open: false,
                });
                let seen = sides
                    .iter()
                    .try_fold(image, |image, side| image.cut(view, side));
                let judge = Judge {
                    view,
                    named: &named,
                    own,
                    item: *item,
                    except: *except,
                };
                counts.cells += judge.cell(seen.as_ref(), cell).map_err(reject)?;
                match except {
                    Except::Nothing => counts.hidden += 1,
                    Except::Ties => counts.tied += 1,
                    Except::Lines => counts.along_lines += 1,
                }
            }
        }
    }
    Ok(counts)
}

/// Whether the view and the boxes can be spoken about at all.
fn sound(view: &View, count: usize, boxes: &[WorldBox]) -> Result<(), &'static str> {
    let View {
        eye,
        forward,
        sides,
        near,
        far,
        hides_from,
        ..
    } = view;
    let numbers = eye
        .iter()
        .chain(forward)
        .chain(sides.as_flattened())
        .chain([near, hides_from]);
    let far = far.unwrap_or(f64::INFINITY);
    let finite = |b: &WorldBox| b.min.is_finite() && b.max.is_finite() && b.min.cmple(b.max).all();
    match () {
        () if count != boxes.len() => Err("they are of another number of boxes"),
        () if !numbers.copied().all(f64::is_finite) => Err("a number of the view is not finite"),
        () if !(near <= hides_from && *near < far) => Err("the view's depths are not in order"),
        () if !view.parallel && *near <= 0.0 => Err("an eye's near plane is behind it"),
        () if *forward == [0.0; 3] => Err("the view has no direction"),
        () if !boxes.iter().all(finite) => Err("a box is not one"),
        () => Ok(()),
    }
}

#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_ground;
#[cfg(test)]
mod tests_plan;
#[cfg(test)]
mod tests_triangles;
