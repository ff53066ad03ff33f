//! Drawing with fragment tests: lists of pieces of boxes, or triangles.
//!
//! Counts the fragments that each test lets through.

use super::canvas::{Canvas, DepthBuffer, Fragment, Stencil, Visited};
use super::cut_outs::Holes;
use super::order::Piece;
use crate::query::ItemId;
use crate::scene::{SurfaceKind, Surfaces};
use crate::visibility::Solids;
use crate::visibility::truth::{Body, Facet, SolidBox};

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
    /// The exact front of each sample, of opaque items.
    pub depth: DepthBuffer<B>,
    /// Items of triangles that hide nothing and are met before the front or with it,
    /// ascending.
    pub before: Vec<ItemId>,
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
            depth: DepthBuffer::new(samples),
            before: Vec::new(),
        }
    }

    /// Empties the image.
    pub fn clear(&mut self) {
        self.tally = Tally::default();
        self.depth.clear();
        self.before.clear();
    }

    /// The exact visible set of the samples, ascending.
    ///
    /// All items that are in front anywhere, every item of a tie, and the items before them
    /// that hide nothing.
    pub fn visible(&self, canvas: &Canvas<B>) -> Vec<ItemId> {
        let mut visible = self.depth.visible(canvas);
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
        let Drawn { tally, depth, .. } = self;
        for piece in pieces {
            let visited = canvas.fragments(solids, piece, tests.stencil, |fragment| {
                tally.fragments += 1;
                if tests.keep(canvas, solids, &fragment) {
                    tally.passed += u64::from(depth.test(canvas, &fragment));
                } else {
                    tally.clear += 1;
                }
            });
            tally.visited(visited);
        }
        tally.covered = depth.covered();
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
        self.tally.covered = self.depth.covered();
        self.before.sort_unstable();
        self.before.dedup();
    }

    fn add(&mut self, canvas: &Canvas<Facet>, surfaces: &Surfaces, triangle: u32, item: usize) {
        let Drawn {
            tally,
            depth,
            before,
        } = self;
        let facet = Facet {
            corners: surfaces.corners(triangle),
            item: item as ItemId,
            two_sided: surfaces.two_sided[item],
            hides: surfaces.kinds[item] == SurfaceKind::Opaque,
        };
        let Facet { item, hides, .. } = facet;
        let rectangle = canvas.screen().triangle(facet.corners, surfaces.origin);
        let visited = canvas.scan(rectangle, None, |sample, probe| {
            let Some(at) = facet.meet(probe, probe.ray().far) else {
                return;
            };
            tally.fragments += 1;
            let is_before = |(front, _): (_, _)| probe.compare(&at, &front).is_le();
            let passes = match hides {
                true => depth.test(canvas, &Fragment { sample, item, at }),
                false => depth.front(sample).is_none_or(is_before),
            };
            tally.passed += u64::from(passes);
            if passes && !hides && before.last() != Some(&item) {
                before.push(item);
            }
        });
        tally.visited(visited);
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
            assert_eq!(drawn.depth.ids(), truth.front, "{turn} {surfaces:?}");
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
