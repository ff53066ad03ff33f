//! The samples of an image, ready to be drawn on: it finds the fragments of a box.

use glam::DVec3;

use super::order::{Part, Piece};
use super::screen::Screen;
use super::stencil::Stencil;
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::truth::{Crossing, Probe, TriangleProbe};
use crate::visibility::{Ray, Rays, SampleGrid, Solids};

/// An item at a sample.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Fragment<At = Crossing> {
    /// Row by row from the top left.
    pub sample: usize,
    /// The item.
    pub item: ItemId,
    /// Where the ray meets it.
    pub at: At,
}

/// What it took to find the fragments of a piece.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub(super) struct Asked {
    /// Samples whose rays were asked.
    pub samples: u64,
    /// Samples that the stencil kept out.
    pub kept_out: u64,
}

/// The samples of an image with their rays, for boxes (88 bytes a sample) or for triangles
/// (128).
#[derive(Clone, Debug)]
pub struct Canvas<P = Probe> {
    screen: Screen,
    probes: Vec<P>,
}

impl<P> Canvas<P> {
    fn by(rays: &Rays, grid: SampleGrid, probe: impl Fn(Ray) -> P) -> Canvas<P> {
        let mut canvas = Canvas {
            screen: Screen::of(rays, grid),
            probes: Vec::with_capacity(grid.samples()),
        };
        canvas.fill(rays, probe);
        canvas
    }

    fn fill(&mut self, rays: &Rays, probe: impl Fn(Ray) -> P) {
        let grid = self.grid();
        self.screen = Screen::of(rays, grid);
        self.probes.clear();
        for row in 0..grid.height {
            for column in 0..grid.width {
                self.probes.push(probe(rays.sample(grid, column, row)));
            }
        }
    }

    /// Columns and rows.
    pub fn grid(&self) -> SampleGrid {
        self.screen.grid()
    }

    /// Where boxes and triangles come to lie in the image.
    pub fn screen(&self) -> &Screen {
        &self.screen
    }

    /// The ray of a sample.
    #[inline]
    pub fn probe(&self, sample: usize) -> &P {
        &self.probes[sample]
    }
}

impl Canvas<TriangleProbe> {
    /// The rays of a camera through the samples of a grid, for triangles about an origin.
    pub fn for_triangles(rays: &Rays, grid: SampleGrid, origin: DVec3) -> Self {
        Canvas::by(rays, grid, |ray| TriangleProbe::new(ray, origin))
    }

    /// Takes the samples of another camera, in the same memory.
    pub fn turn_to(&mut self, rays: &Rays, origin: DVec3) {
        self.fill(rays, |ray| TriangleProbe::new(ray, origin));
    }
}

impl Canvas {
    /// The rays of a camera through the samples of a grid, for boxes.
    pub fn of(rays: &Rays, grid: SampleGrid) -> Canvas {
        Canvas::by(rays, grid, Probe::new)
    }

    /// Takes the samples of another camera, in the same memory.
    pub fn turn_to(&mut self, rays: &Rays) {
        self.fill(rays, Probe::new);
    }

    /// The same samples seen in a mirror that is a plane across an axis: the rays
    /// from where they cross the plane on, reflected. (A ray that is reflected keeps
    /// its depths.) Rays that do not reach the plane meet nothing.
    pub fn mirrored(&self, axis: usize, at: f64) -> Canvas {
        let reflected = |probe: &Probe| {
            let mut ray = *probe.ray();
            let depth = (at - ray.origin[axis]) / ray.direction[axis];
            let reached = depth >= 0.0 && depth.is_finite();
            ray.near = if reached {
                depth.max(ray.near)
            } else {
                f64::INFINITY
            };
            ray.origin[axis] = 2.0 * at - ray.origin[axis];
            ray.direction[axis] = -ray.direction[axis];
            Probe::new(ray)
        };
        Canvas {
            screen: self.screen.mirrored(axis, at),
            probes: self.probes.iter().map(reflected).collect(),
        }
    }

    /// Hands over each sample that meets the box, with where.
    pub(super) fn meet(
        &self,
        b: &WorldBox,
        stencil: Option<&Stencil>,
        mut found: impl FnMut(usize, Crossing),
    ) -> Asked {
        let mut asked = Asked::default();
        let Some(rectangle) = self.screen.rectangle(b) else {
            return asked;
        };
        for row in rectangle.rows {
            for column in rectangle.columns.clone() {
                let sample = (row * self.grid().width + column) as usize;
                if stencil.is_some_and(|stencil| !stencil.holds(sample)) {
                    asked.kept_out += 1;
                    continue;
                }
                asked.samples += 1;
                let probe = &self.probes[sample];
                if let Some(at) = probe.enter(b, probe.ray().far) {
                    found(sample, at);
                }
            }
        }
        asked
    }

    /// Hands over the fragments of a piece: of a part of an item, those where the
    /// item is entered through that part.
    pub(super) fn fragments(
        &self,
        solids: &Solids,
        piece: &Piece,
        stencil: Option<&Stencil>,
        mut found: impl FnMut(Fragment),
    ) -> Asked {
        let item = piece.item;
        let whole = &solids.boxes[item as usize];
        let part = match &piece.part {
            Some(Part::Within(part)) => part,
            // Leaves are of triangles.
            Some(Part::InLeaf(_)) | None => {
                return self.meet(whole, stencil, |sample, at| {
                    found(Fragment { sample, item, at });
                });
            }
        };
        self.meet(part, stencil, |sample, of_part| {
            let probe = &self.probes[sample];
            let entered = probe.enter(whole, probe.ray().far);
            if let Some(at) = entered.filter(|at| probe.compare(at, &of_part).is_eq()) {
                found(Fragment { sample, item, at });
            }
        })
    }
}
