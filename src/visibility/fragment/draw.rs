//! Rasterization with fragment tests: boxes or triangles in list order.
//!
//! Counts the fragments that pass each test.

use serde::Serialize;

use super::canvas::{Canvas, Rectangle, Stencil};
use super::cut_outs::AlphaMasks;
use crate::query::{ItemId, distinct};
use crate::scene::{Surfaces, WorldBox};
use crate::visibility::RayProbe;
use crate::visibility::truth::{Body, BoxHit, Facet, Probe, SolidBox, TriangleHit, TriangleProbe};

/// Fragment tests in addition to the z-test.
#[derive(Clone, Copy, Default, Debug)]
pub struct Tests<'a> {
    /// Alpha test, by the surfaces of the items.
    pub surfaces: Option<&'a AlphaMasks>,
    /// Stencil test.
    pub stencil: Option<&'a Stencil>,
}

/// A body that is drawn sample by sample.
pub trait Drawable: Body {
    /// Screen rectangle with every sample whose ray meets the body.
    fn rectangle(&self, canvas: &Canvas<Self>) -> Option<Rectangle>;

    /// Tests whether the body is opaque where a ray meets it.
    fn is_opaque(&self, masks: &AlphaMasks, probe: &Self::Probe, at: &Self::Hit) -> bool;
}

impl Drawable for SolidBox {
    fn rectangle(&self, canvas: &Canvas) -> Option<Rectangle> {
        canvas.screen.rectangle(&self.b)
    }

    fn is_opaque(&self, masks: &AlphaMasks, probe: &Probe, at: &BoxHit) -> bool {
        masks.opaque(self.item, &self.b, probe, at)
    }
}

impl Drawable for Facet {
    fn rectangle(&self, canvas: &Canvas<Facet>) -> Option<Rectangle> {
        canvas.screen.triangle(self.corners, canvas.origin)
    }

    fn is_opaque(&self, _: &AlphaMasks, _: &TriangleProbe, _: &TriangleHit) -> bool {
        true
    }
}

/// Counts of a drawn list; `f64` for means per view.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug, Serialize)]
pub struct FragmentCounts<N = u64> {
    /// Samples whose rays are tested, including those that mark a stencil.
    pub asked_count: N,
    /// Samples that the stencil rejects.
    pub kept_out_count: N,
    /// Fragments: samples whose ray meets an item (for meshes and maps, a triangle).
    pub fragment_count: N,
    /// Fragments that the alpha test discards.
    pub clear_count: N,
    /// Other fragments that pass the z-test when drawn: shaded with early z.
    pub shaded_count: N,
    /// Samples covered by something opaque.
    pub covered_count: N,
}

/// A body at a sample whose ray meets it.
#[derive(Clone, Copy, Debug)]
struct Fragment<Hit> {
    sample: usize,
    item: ItemId,
    at: Hit,
}

/// A drawn image, of boxes or of triangles.
#[derive(Clone, Debug)]
pub struct Drawn<B: Body = SolidBox> {
    /// Counts of all that was drawn.
    pub counts: FragmentCounts,
    /// Nearest opaque item of each sample, exact; the lowest id of a tie.
    pub(super) front: Vec<Option<(B::Hit, ItemId)>>,
    /// Fragments at the depth of the one in front whose id is higher.
    ties: Vec<Fragment<B::Hit>>,
    /// Items of triangles that hide nothing and lie before the front or at its depth.
    before: Vec<ItemId>,
}

impl<B: Drawable> Drawn<B> {
    /// An empty image of `samples` samples.
    pub fn new(samples: usize) -> Drawn<B> {
        Drawn {
            counts: FragmentCounts::default(),
            front: vec![None; samples],
            ties: Vec::new(),
            before: Vec::new(),
        }
    }

    /// Empties the image.
    pub fn clear(&mut self) {
        self.counts = FragmentCounts::default();
        self.front.fill(None);
        self.ties.clear();
        self.before.clear();
    }

    /// Draws bodies on top of the image, one by one.
    ///
    /// Bodies that hide nothing must come last. A fragment is a body at a sample whose ray meets
    /// it. Θ(samples of the screen rectangles).
    pub fn draw(
        &mut self,
        canvas: &Canvas<B>,
        bodies: impl IntoIterator<Item = B>,
        tests: &Tests<'_>,
    ) {
        for body in bodies {
            let item = body.item();
            let area = body.rectangle(canvas);
            let [tested, kept_out] = canvas.scan(area, tests.stencil, |sample, probe| {
                let Some(at) = body.hit(probe, f64::INFINITY) else {
                    return;
                };
                self.counts.fragment_count += 1;
                let mut masks = tests.surfaces.iter();
                if !masks.all(|masks| body.is_opaque(masks, probe, &at)) {
                    self.counts.clear_count += 1;
                    return;
                }
                let passes = match body.hides() {
                    true => self.test(probe, Fragment { sample, item, at }),
                    false => self.has_nothing_before(&at, sample, probe),
                };
                self.counts.shaded_count += u64::from(passes);
                if passes && !body.hides() && self.before.last() != Some(&item) {
                    self.before.push(item);
                }
            });
            self.counts.asked_count += tested;
            self.counts.kept_out_count += kept_out;
        }
        self.counts.covered_count = self.front.iter().flatten().count() as u64;
    }

    /// Returns `true` if nothing drawn at a sample is nearer than a point.
    #[inline]
    fn has_nothing_before(&self, at: &B::Hit, sample: usize, probe: &B::Probe) -> bool {
        self.front[sample].is_none_or(|(front, _)| probe.compare(at, &front).is_le())
    }

    /// Applies the z-test; writes the fragment and returns true if it passes.
    ///
    /// It passes if the sample is empty, or holds a deeper item, or an equally deep item of higher
    /// id.
    #[inline]
    fn test(&mut self, probe: &B::Probe, fragment: Fragment<B::Hit>) -> bool {
        let Fragment { sample, item, at } = fragment;
        let front = &mut self.front[sample];
        if let Some((other, other_item)) = *front {
            let order = probe.compare(&at, &other);
            if order.is_gt() {
                return false;
            }
            if order.is_eq() {
                // Two triangles of one item.
                if item == other_item {
                    return false;
                }
                let lost = item.max(other_item);
                self.ties.push(Fragment {
                    item: lost,
                    ..fragment
                });
                if lost == item {
                    return false;
                }
            }
        }
        *front = Some((at, item));
        true
    }

    /// Exact visible set of the samples, ascending.
    ///
    /// Contains the items in front at any sample, every item of a tie, and the items before them
    /// that hide nothing.
    pub fn visible(&self, canvas: &Canvas<B>) -> Vec<ItemId> {
        let in_front = |tie: &&Fragment<B::Hit>| {
            let front = self.front[tie.sample];
            let order = |front: (B::Hit, _)| canvas.probes[tie.sample].compare(&tie.at, &front.0);
            front.is_some_and(|front| order(front).is_eq())
        };
        let ties = self.ties.iter().filter(in_front).map(|tie| tie.item);
        let mut visible: Vec<ItemId> = self.front.iter().flatten().map(|front| front.1).collect();
        visible.extend(ties);
        visible.extend_from_slice(&self.before);
        distinct(visible)
    }
}

impl Drawn {
    /// Marks the samples where a rectangle is no farther than the drawn surface.
    ///
    /// A rectangle is a box of zero thickness along one axis.
    pub fn stencil(&self, canvas: &Canvas, rectangles: &[WorldBox]) -> Stencil {
        let mut marked = vec![false; canvas.screen.grid.samples()];
        let mut tested = 0;
        for rectangle in rectangles {
            let area = canvas.screen.rectangle(rectangle);
            let [asked, _] = canvas.scan(area, None, |sample, probe| {
                let entered = probe.enter(rectangle, f64::INFINITY);
                let is_seen = |at| self.has_nothing_before(&at, sample, probe);
                marked[sample] |= entered.is_some_and(is_seen);
            });
            tested += asked;
        }
        Stencil { marked, tested }
    }
}

impl Drawn<Facet> {
    /// Empties the image and draws triangles.
    ///
    /// Opaque triangles come first, then those that hide nothing.
    pub fn draw_triangles(
        &mut self,
        canvas: &Canvas<Facet>,
        surfaces: &Surfaces,
        triangles: &[u32],
    ) {
        let facet = |&triangle: &u32| Facet::of(surfaces, surfaces.item_of(triangle), triangle);
        self.clear();
        for opaque in [true, false] {
            let facets = triangles.iter().map(facet);
            let facets = facets.filter(|facet| facet.hides == opaque);
            self.draw(canvas, facets, &Tests::default());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{self, SeededRng};
    use crate::visibility::fragment::tests::cameras;
    use crate::visibility::truth::{NO_ITEM, SampleTruth, SurfaceIndex, fronts, judge};
    use crate::visibility::{Rays, SampleGrid, Solids, surfaces_of};

    impl<B: Body> Drawn<B> {
        /// The item in front at each sample, [`NO_ITEM`] for none.
        pub fn ids(&self) -> Vec<ItemId> {
            let id = |front: &Option<(B::Hit, ItemId)>| front.map_or(NO_ITEM, |front| front.1);
            self.front.iter().map(id).collect()
        }
    }

    /// Number of items that rays see, all of which are drawn.
    fn drawn_as_seen(
        surfaces: &Surfaces,
        index: &SurfaceIndex,
        rays: &Rays,
        grid: SampleGrid,
    ) -> usize {
        let truth = SampleTruth::of(index, rays, grid, 1);
        let fronts = fronts(index, &|_, _, _| true, rays, grid);
        let canvas = Canvas::about(rays, grid, surfaces.origin);
        let mut triangles: Vec<u32> = (0..surfaces.triangles.len() as u32).collect();
        let mut drawn = Drawn::new(grid.samples());
        for turn in 0..2 {
            drawn.draw_triangles(&canvas, surfaces, &triangles);
            assert_eq!(drawn.ids(), fronts, "{turn} {surfaces:?}");
            assert_eq!(drawn.visible(&canvas), truth.visible, "{turn} {surfaces:?}");
            assert!(drawn.counts.shaded_count >= drawn.counts.covered_count);
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
