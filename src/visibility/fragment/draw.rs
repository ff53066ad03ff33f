//! Drawing with fragment tests: lists of pieces of boxes, or triangles.
//!
//! Counts the fragments that each test lets through.

use super::canvas::{Canvas, Fragment, Stencil, Visited};
use super::cut_outs::Holes;
use super::order::Piece;
use crate::query::ItemId;
use crate::scene::{SurfaceKind, Surfaces, WorldBox};
use crate::visibility::Solids;
use crate::visibility::truth::{Along, Body, Facet, NO_ITEM, SolidBox};

/// The fragment tests beside the z-test.
#[derive(Clone, Copy, Default, Debug)]
pub struct Tests<'a> {
    /// The alpha-test, by the surfaces of the items.
    pub surfaces: Option<&'a Holes>,
    /// The stencil-test.
    pub stencil: Option<&'a Stencil>,
}

impl Tests<'_> {
    /// Tests whether the alpha-test keeps a fragment.
    pub(super) fn keep(&self, canvas: &Canvas, solids: &Solids, fragment: &Fragment) -> bool {
        self.surfaces.is_none_or(|surfaces| {
            let b = &solids.boxes[fragment.item as usize];
            let probe = canvas.probe(fragment.sample);
            surfaces.opaque(fragment.item, b, probe, &fragment.at)
        })
    }
}

/// Counts of a drawn list.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
#[non_exhaustive]
pub struct Tally {
    /// Pieces or triangles that came to lie in the image.
    pub drawn: u64,
    /// Samples whose rays were tested.
    pub asked: u64,
    /// Samples that the stencil kept from a test.
    pub kept_out: u64,
    /// Fragments: samples that met a piece.
    pub fragments: u64,
    /// Fragments that the alpha-test dropped.
    pub clear: u64,
    /// Other fragments that passed the z-test when they came: with early z, the shaded
    /// ones.
    pub passed: u64,
    /// Samples that something opaque covers.
    pub covered: u64,
}

impl Tally {
    fn visited(&mut self, visited: Visited) {
        self.drawn += u64::from(visited.tested + visited.kept_out > 0);
        self.asked += visited.tested;
        self.kept_out += visited.kept_out;
    }
}

/// A drawn image, of boxes or of triangles.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Drawn<B: Body = SolidBox> {
    /// Counts of all that was drawn.
    pub tally: Tally,
    /// The exact front of each sample, of opaque items; of a tie the lowest id.
    front: Vec<Option<(B::At, ItemId)>>,
    /// Fragments that were as near as the one in front, and lost by their id.
    ties: Vec<Fragment<B::At>>,
    /// Items of triangles that hide nothing and are met before the front or with it.
    before: Vec<ItemId>,
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

impl<B: Body> Drawn<B> {
    /// An empty image of this many samples.
    pub fn new(samples: usize) -> Drawn<B> {
        Drawn {
            tally: Tally::default(),
            front: vec![None; samples],
            ties: Vec::new(),
            before: Vec::new(),
        }
    }

    /// Empties the image.
    pub fn clear(&mut self) {
        self.tally = Tally::default();
        self.front.fill(None);
        self.ties.clear();
        self.before.clear();
    }

    /// Draws the fragment, if it passes: its sample is empty, or holds an item that is
    /// deeper, or as deep with a higher id. Returns whether it passed.
    #[inline]
    fn test(&mut self, canvas: &Canvas<B>, fragment: &Fragment<B::At>) -> bool {
        let Fragment { sample, item, at } = *fragment;
        let front = &mut self.front[sample];
        if let Some((other, other_item)) = *front {
            let order = canvas.probe(sample).compare(&at, &other);
            if order.is_gt() {
                return false;
            }
            if order.is_eq() {
                // The same item may come in several pieces.
                if item == other_item {
                    return false;
                }
                let lost = item.max(other_item);
                let tie = Fragment {
                    item: lost,
                    ..*fragment
                };
                self.ties.push(tie);
                if lost == item {
                    return false;
                }
            }
        }
        *front = Some((at, item));
        true
    }

    /// The front item of a sample, and where its ray meets it.
    #[inline]
    pub fn front(&self, sample: usize) -> Option<(B::At, ItemId)> {
        self.front[sample]
    }

    /// The id buffer: the item in front at each sample, [`NO_ITEM`] for none.
    pub fn ids(&self) -> Vec<ItemId> {
        let id = |front: &Option<(B::At, ItemId)>| front.map_or(NO_ITEM, |front| front.1);
        self.front.iter().map(id).collect()
    }

    /// Number of samples that have been drawn on.
    fn covered(&self) -> u64 {
        self.front.iter().filter(|front| front.is_some()).count() as u64
    }

    /// The exact visible set of the samples, ascending.
    ///
    /// All items that are in front anywhere, every item of a tie, and the items before them
    /// that hide nothing.
    pub fn visible(&self, canvas: &Canvas<B>) -> Vec<ItemId> {
        let in_front = |tie: &&Fragment<B::At>| {
            let front = self.front[tie.sample];
            let order = |front: (B::At, _)| canvas.probe(tie.sample).compare(&tie.at, &front.0);
            front.is_some_and(|front| order(front).is_eq())
        };
        let ties = self.ties.iter().filter(in_front).map(|tie| tie.item);
        let mut visible: Vec<ItemId> = self.front.iter().flatten().map(|front| front.1).collect();
        visible.extend(ties);
        visible.extend_from_slice(&self.before);
        visible.sort_unstable();
        visible.dedup();
        visible
    }
}

impl Drawn {
    /// Draws more on the same image.
    pub fn draw<'a>(
        &mut self,
        canvas: &Canvas,
        solids: &Solids,
        pieces: impl IntoIterator<Item = &'a Piece>,
        tests: &Tests<'_>,
    ) {
        for piece in pieces {
            let visited = canvas.fragments(solids, piece, tests.stencil, |fragment| {
                self.tally.fragments += 1;
                if tests.keep(canvas, solids, &fragment) {
                    self.tally.passed += u64::from(self.test(canvas, &fragment));
                } else {
                    self.tally.clear += 1;
                }
            });
            self.tally.visited(visited);
        }
        self.tally.covered = self.covered();
    }

    /// Marks the samples at which a rectangle is no farther than what was drawn.
    ///
    /// A rectangle is a box without thickness along one axis.
    pub fn stencil(&self, canvas: &Canvas, rectangles: &[WorldBox]) -> Stencil {
        let mut stencil = Stencil::new(canvas.grid().samples());
        for rectangle in rectangles {
            let visited = canvas.meet(rectangle, None, |sample, at| {
                let before = |(front, _): (_, _)| canvas.probe(sample).compare(&at, &front).is_le();
                if self.front(sample).is_none_or(before) {
                    stencil.mark(sample);
                }
            });
            stencil.tested += visited.tested;
        }
        stencil
    }
}

impl Drawn<Facet> {
    /// Empties the image and draws triangles, each by itself.
    ///
    /// The opaque ones first, with the z-test; then those that hide nothing, against the front.
    /// A fragment is a triangle at a sample whose ray meets it: a one-sided one from its front.
    /// Θ(samples of the screen rectangles).
    pub fn draw_triangles(
        &mut self,
        canvas: &Canvas<Facet>,
        surfaces: &Surfaces,
        triangles: &[u32],
    ) {
        self.clear();
        for opaque in [true, false] {
            for &triangle in triangles {
                let item = surfaces.item_of(triangle);
                if (surfaces.kinds[item] == SurfaceKind::Opaque) == opaque {
                    self.add(canvas, surfaces, triangle, item);
                }
            }
        }
        self.tally.covered = self.covered();
    }

    fn add(&mut self, canvas: &Canvas<Facet>, surfaces: &Surfaces, triangle: u32, item: usize) {
        let facet = Facet::of(surfaces, item, surfaces.corners(triangle));
        let Facet { item, hides, .. } = facet;
        let rectangle = canvas.screen().triangle(facet.corners, surfaces.origin);
        let visited = canvas.scan(rectangle, None, |sample, probe| {
            let Some(at) = facet.meet(probe, probe.ray().far) else {
                return;
            };
            self.tally.fragments += 1;
            let is_before = |(front, _): (_, _)| probe.compare(&at, &front).is_le();
            let passes = match hides {
                true => self.test(canvas, &Fragment { sample, item, at }),
                false => self.front(sample).is_none_or(is_before),
            };
            self.tally.passed += u64::from(passes);
            if passes && !hides && self.before.last() != Some(&item) {
                self.before.push(item);
            }
        });
        self.tally.visited(visited);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{self, SeededRng};
    use crate::visibility::fragment::tests::cameras;
    use crate::visibility::truth::{SampleTruth, SurfaceIndex, judge};
    use crate::visibility::{Rays, SampleGrid, Solids, surfaces_of};

    /// Number of items that rays see, all of which are drawn.
    fn drawn_as_seen(
        surfaces: &Surfaces,
        index: &SurfaceIndex,
        rays: &Rays,
        grid: SampleGrid,
    ) -> usize {
        let truth = SampleTruth::of(index, rays, grid, 1);
        let canvas = Canvas::about(rays, grid, surfaces.origin);
        let mut triangles: Vec<u32> = (0..surfaces.triangles.len() as u32).collect();
        let mut drawn = Drawn::new(grid.samples());
        for turn in 0..2 {
            drawn.draw_triangles(&canvas, surfaces, &triangles);
            assert_eq!(drawn.ids(), truth.front, "{turn} {surfaces:?}");
            assert_eq!(drawn.visible(&canvas), truth.visible, "{turn} {surfaces:?}");
            assert!(drawn.tally.passed >= drawn.tally.covered);
            triangles.reverse();
        }
        truth.visible.len()
    }

    #[test]
    fn worlds_full_of_ties_are_drawn_as_they_are_seen() {
        let (mut rng, mut seen) = (SeededRng::new(19), 0);
        for _ in 0..400 {
            let surfaces = judge::triangles(&mut rng);
            let mut camera = judge::camera(&mut rng);
            camera.frame.eye += surfaces.origin;
            let rays = Rays::of(&camera).unwrap();
            let index = SurfaceIndex::build(&surfaces);
            seen += drawn_as_seen(&surfaces, &index, &rays, SampleGrid::new(8, 6));
        }
        assert!(seen > 800, "the premise: {seen}");
    }

    #[test]
    fn meshes_and_maps_are_drawn_as_they_are_seen() {
        for name in [
            "mesh:forest:n=4000",
            "mesh:spheres:n=40000,offset=1e6",
            "freedm-map12",
        ] {
            let scene = scene::load(name, &Default::default()).unwrap();
            let surfaces = surfaces_of(&scene).unwrap();
            let index = SurfaceIndex::build(&surfaces);
            let mut seen = 0;
            for camera in &cameras(&Solids::of(&scene), 4) {
                let rays = Rays::of(camera).unwrap();
                seen += drawn_as_seen(&surfaces, &index, &rays, SampleGrid::new(64, 40));
            }
            assert!(seen > 20, "{name}: {seen}");
        }
    }
}
