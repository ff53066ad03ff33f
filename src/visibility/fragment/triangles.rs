//! Triangles drawn with the z-test, each by itself.
//!
//! Opaque ones come first; what hides nothing is then held against what is in front. A
//! fragment is a triangle at a sample whose ray meets it: of a one-sided one from its
//! front.

use super::canvas::{Canvas, Fragment};
use super::depth::DepthBuffer;
use super::draw::Tally;
use crate::query::ItemId;
use crate::scene::{SurfaceKind, Surfaces};
use crate::visibility::truth::TriangleProbe;

/// A drawn image of triangles.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DrawnTriangles {
    /// What was counted.
    pub tally: Tally,
    /// The exact front of each sample, of what is opaque.
    pub depth: DepthBuffer<TriangleProbe>,
    /// The items that hide nothing and are met before that or with it, ascending.
    pub before: Vec<ItemId>,
}

impl DrawnTriangles {
    /// An image of so many samples in which nothing is drawn yet.
    pub fn new(samples: usize) -> DrawnTriangles {
        DrawnTriangles {
            tally: Tally::default(),
            depth: DepthBuffer::new(samples),
            before: Vec::new(),
        }
    }

    /// Forgets what was drawn, and draws some triangles. Θ(samples of the screen rectangles).
    pub fn draw(&mut self, canvas: &Canvas<TriangleProbe>, surfaces: &Surfaces, triangles: &[u32]) {
        self.tally = Tally::default();
        self.depth.clear();
        self.before.clear();
        for opaque in [true, false] {
            for &triangle in triangles {
                let item = surfaces.item_of(triangle);
                if (surfaces.kinds[item] == SurfaceKind::Opaque) == opaque {
                    self.add(canvas, surfaces, triangle, item, opaque);
                }
            }
        }
        self.tally.covered = self.depth.covered();
        self.before.sort_unstable();
        self.before.dedup();
    }

    fn add(
        &mut self,
        canvas: &Canvas<TriangleProbe>,
        surfaces: &Surfaces,
        triangle: u32,
        item: usize,
        opaque: bool,
    ) {
        let corners = surfaces.corners(triangle);
        let Some(rectangle) = canvas.screen().triangle(corners, surfaces.origin) else {
            return;
        };
        let tally = &mut self.tally;
        tally.drawn += 1;
        tally.asked += rectangle.samples();
        let (item, two_sided) = (item as ItemId, surfaces.two_sided[item]);
        for row in rectangle.rows {
            for column in rectangle.columns.clone() {
                let sample = (row * canvas.grid().width + column) as usize;
                let probe = canvas.probe(sample);
                let Some(at) = probe.meet(corners, two_sided, probe.ray().far) else {
                    continue;
                };
                tally.fragments += 1;
                let passes = match opaque {
                    true => self.depth.test(canvas, &Fragment { sample, item, at }),
                    false => {
                        let front = self.depth.front(sample);
                        front.is_none_or(|(front, _)| probe.compare(&at, &front).is_le())
                    }
                };
                tally.passed += u64::from(passes);
                if passes && !opaque && self.before.last() != Some(&item) {
                    self.before.push(item);
                }
            }
        }
    }

    /// The exact visible set of the samples, ascending: all that is in front anywhere, every
    /// item of a tie, and what is seen before it.
    pub fn visible(&self, canvas: &Canvas<TriangleProbe>) -> Vec<ItemId> {
        let mut visible = self.depth.visible(canvas);
        visible.extend_from_slice(&self.before);
        visible.sort_unstable();
        visible.dedup();
        visible
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{self, SeededRng};
    use crate::visibility::fragment::tests::cameras;
    use crate::visibility::truth::{SampleTruth, SurfaceIndex, judge};
    use crate::visibility::{Rays, SampleGrid, Solids, surfaces_of};

    /// What is drawn of all triangles is what rays see; how many items.
    fn drawn_as_seen(
        surfaces: &Surfaces,
        index: &SurfaceIndex,
        rays: &Rays,
        grid: SampleGrid,
    ) -> usize {
        let truth = SampleTruth::of(index, rays, grid, 1);
        let canvas = Canvas::for_triangles(rays, grid, surfaces.origin);
        let mut triangles: Vec<u32> = (0..surfaces.triangles.len() as u32).collect();
        let mut drawn = DrawnTriangles::new(grid.samples());
        for turn in 0..2 {
            drawn.draw(&canvas, surfaces, &triangles);
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
