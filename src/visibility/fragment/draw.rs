//! Draws a list of pieces with the tests switched on that are asked for, and counts
//! what each of them lets through.

use super::canvas::{Canvas, Fragment};
use super::depth::DepthBuffer;
use super::mask::Surfaces;
use super::order::Piece;
use super::stencil::Stencil;
use crate::query::ItemId;
use crate::visibility::Solids;
use crate::visibility::truth::NO_ITEM;

/// Which fragment tests there are beside the z-test.
#[derive(Clone, Copy, Default, Debug)]
pub struct Tests<'a> {
    /// The alpha-test, by the surfaces of the items.
    pub surfaces: Option<&'a Surfaces>,
    /// The stencil-test.
    pub stencil: Option<&'a Stencil>,
}

impl Tests<'_> {
    /// Whether the alpha-test keeps a fragment.
    pub(super) fn keep(&self, canvas: &Canvas, solids: &Solids, fragment: &Fragment) -> bool {
        self.surfaces.is_none_or(|surfaces| {
            let b = &solids.boxes[fragment.item as usize];
            let probe = canvas.probe(fragment.sample);
            surfaces.opaque(fragment.item, b, probe, &fragment.at)
        })
    }
}

/// What was counted while a list was drawn.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
#[non_exhaustive]
pub struct Tally {
    /// Pieces that came to lie in the image.
    pub drawn: u64,
    /// Samples whose rays were asked.
    pub asked: u64,
    /// Samples that the stencil kept from being asked.
    pub kept_out: u64,
    /// Fragments: samples that met a piece.
    pub fragments: u64,
    /// Of these, dropped by the alpha-test.
    pub clear: u64,
    /// Of the rest, those that passed the z-test when they came: with early z, the
    /// fragments that are shaded.
    pub passed: u64,
    /// Samples that something opaque covers.
    pub covered: u64,
}

/// A drawn image.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Drawn {
    /// What was counted.
    pub tally: Tally,
    /// With the z-test: the exact front of each sample.
    pub depth: DepthBuffer,
    /// Without it: the item of each sample that was drawn last, [`NO_ITEM`] for
    /// none.
    pub last: Vec<ItemId>,
}

/// Draws the pieces in this order. Θ(samples of the screen rectangles).
pub fn draw<'a>(
    canvas: &Canvas,
    solids: &Solids,
    pieces: impl IntoIterator<Item = &'a Piece>,
    tests: &Tests<'_>,
) -> Drawn {
    let mut drawn = Drawn::new(canvas.grid().samples());
    drawn.draw(canvas, solids, pieces, tests);
    drawn
}

impl Drawn {
    /// An image of so many samples in which nothing is drawn yet.
    pub fn new(samples: usize) -> Drawn {
        Drawn {
            tally: Tally::default(),
            depth: DepthBuffer::new(samples),
            last: vec![NO_ITEM; samples],
        }
    }

    /// Forgets what was drawn.
    pub fn clear(&mut self) {
        self.tally = Tally::default();
        self.depth.clear();
        self.last.fill(NO_ITEM);
    }

    /// Draws more on the same image.
    pub fn draw<'a>(
        &mut self,
        canvas: &Canvas,
        solids: &Solids,
        pieces: impl IntoIterator<Item = &'a Piece>,
        tests: &Tests<'_>,
    ) {
        let Drawn { tally, depth, last } = self;
        for piece in pieces {
            let asked = canvas.fragments(solids, piece, tests.stencil, |fragment| {
                tally.fragments += 1;
                if !tests.keep(canvas, solids, &fragment) {
                    tally.clear += 1;
                    return;
                }
                last[fragment.sample] = fragment.item;
                tally.passed += u64::from(depth.test(canvas, &fragment));
            });
            tally.drawn += u64::from(asked.samples + asked.kept_out > 0);
            tally.asked += asked.samples;
            tally.kept_out += asked.kept_out;
        }
        tally.covered = depth.covered();
    }
}
