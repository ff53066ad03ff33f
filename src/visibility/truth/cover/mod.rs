//! The search for certificates: for an item a ray that sees it, or boxes that hide
//! it. Everything that it claims is decided exactly.

mod hides;
mod hunt;
mod outline;
mod outlook;
mod walls;

use glam::DVec3;

use self::hunt::{End, Hunt};
use self::outline::{corners_of, is_flat, outline};
use self::outlook::Outlook;
use super::certificate::{Cell, Except, Hiders, PlanWall, Proof, View};
use super::ray_index::RayIndex;
use super::sight::{Polygon, Sight};
use crate::query::ItemId;
use crate::visibility::{Rays, Solids};

/// Looks for proofs in one view of a scene.
#[derive(Clone, Debug)]
pub struct Prover<'s> {
    look: Outlook<'s>,
    hiders: Hiders,
    items: usize,
    walls: &'s [PlanWall],
}

impl<'s> Prover<'s> {
    /// For the view of these rays, in which every box hides.
    pub fn new(solids: &'s Solids, index: &'s RayIndex, rays: &Rays) -> Prover<'s> {
        Prover::hidden_by(Hiders::Items, solids, index, rays)
    }

    /// The same where only the boxes in the index hide. Behind the items, `solids` has
    /// those that are [`Hiders::Within`].
    pub fn hidden_by(
        hiders: Hiders,
        solids: &'s Solids,
        index: &'s RayIndex,
        rays: &Rays,
    ) -> Prover<'s> {
        let within = match &hiders {
            Hiders::Within(boxes) => boxes.len(),
            Hiders::Items | Hiders::Uncut(_) => 0,
        };
        let items = solids.boxes.len() - within;
        let sight = Sight::new(&View::of(rays));
        let look = Outlook {
            solids,
            index,
            sight,
        };
        Prover {
            look,
            hiders,
            items,
            walls: &[],
        }
    }

    /// The same in a map with these walls, by ascending item, where the eye and all that is
    /// before its near plane are in the map's regions.
    pub fn among(mut self, walls: &'s [PlanWall]) -> Prover<'s> {
        self.walls = walls;
        self
    }

    /// The view that the proofs are about.
    pub fn view(&self) -> &View {
        &self.look.sight.view
    }

    /// What hides.
    pub(super) fn hiders(&self) -> &Hiders {
        &self.hiders
    }

    /// How many items there are.
    pub(super) fn items(&self) -> usize {
        self.items
    }

    /// Whether the item is visible along any ray of the view, with the proof.
    pub fn prove(&self, item: ItemId) -> Proof {
        let boxes = &self.look.solids.boxes[..self.items];
        match walls::before(self.view(), boxes, self.walls, item) {
            Some(walls) => Proof::Walls(walls),
            None => self.prove_by_boxes(item),
        }
    }

    fn prove_by_boxes(&self, item: ItemId) -> Proof {
        let b = self.look.boxed(item);
        let Outlook { sight, .. } = &self.look;
        let view = &sight.view;
        let holds = |p: DVec3| p.cmpge(b.min).all() && p.cmple(b.max).all();
        if !view.parallel && holds(view.eye.into()) {
            return match self.hiders {
                // Of the triangles in it, some may be in front of the eye.
                Hiders::Within(_) => Proof::Undecided,
                Hiders::Items | Hiders::Uncut(_) => Proof::AroundEye,
            };
        }
        let corners = corners_of(b).map(|corner| sight.through(corner));
        let Some(outline) = outline(&corners) else {
            let (outline, except, cell) = (Vec::new(), Except::Lines, Cell::Empty);
            return match is_flat(&corners) {
                true => Proof::Cover {
                    outline,
                    except,
                    cell,
                },
                false => Proof::Undecided,
            };
        };
        let image = Polygon::new(
            outline
                .iter()
                .map(|&k| corners[usize::from(k)].clone())
                .collect(),
        );
        let clipped = sight
            .sides
            .iter()
            .try_fold(image, |image, side| image.cut(side, false));
        for except in [Except::Nothing, Except::Ties, Except::Lines] {
            let mut hunt = Hunt::new(&self.look, item, except);
            match clipped
                .as_ref()
                .map_or(Ok(Cell::Empty), |image| hunt.cell(image, 0))
            {
                Ok(cell) => {
                    return Proof::Cover {
                        outline,
                        except,
                        cell,
                    };
                }
                Err(End::Seen(ray)) => return Proof::witness(&ray),
                Err(End::GaveUp) => {}
            }
        }
        Proof::Undecided
    }
}

#[cfg(test)]
mod tests;
