//! Samples of an image: their rays, and the stencil-test.

use glam::DVec3;

use super::order::{Part, Piece};
use super::screen::{Rectangle, Screen};
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::truth::{Body, Crossing, Probe, SolidBox};
use crate::visibility::{Rays, SampleGrid, Solids};

/// Some of the samples of an image.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Stencil {
    marked: Vec<bool>,
    /// Number of samples whose rays were tested to mark it.
    pub tested: u64,
}

impl Stencil {
    /// A stencil without marked samples.
    pub fn new(samples: usize) -> Stencil {
        Stencil {
            marked: vec![false; samples],
            tested: 0,
        }
    }

    /// Marks a sample.
    pub fn mark(&mut self, sample: usize) {
        self.marked[sample] = true;
    }

    /// Tests whether the sample may be drawn on.
    #[inline]
    pub fn holds(&self, sample: usize) -> bool {
        self.marked[sample]
    }

    /// Number of samples that may be drawn on. O(samples).
    pub fn count(&self) -> usize {
        self.marked.iter().filter(|marked| **marked).count()
    }
}

/// An item at a sample.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Fragment<At = Crossing> {
    /// Index of the sample, row by row from the top left.
    pub sample: usize,
    /// The item.
    pub item: ItemId,
    /// Point where the ray meets the item.
    pub at: At,
}

/// Samples that were visited for a piece.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub(super) struct Visited {
    /// Samples whose rays were tested.
    pub tested: u64,
    /// Samples that the stencil kept from a test.
    pub kept_out: u64,
}

/// The samples of an image with their rays.
///
/// 88 bytes per sample for boxes, 128 for triangles.
#[derive(Clone, Debug)]
pub struct Canvas<B: Body = SolidBox> {
    screen: Screen,
    probes: Vec<B::Probe>,
}

impl<B: Body> Canvas<B> {
    /// The rays of a camera through the samples of a grid, for bodies relative to an
    /// origin.
    pub fn about(rays: &Rays, grid: SampleGrid, origin: DVec3) -> Canvas<B> {
        let mut canvas = Canvas {
            screen: Screen::of(rays, grid),
            probes: Vec::with_capacity(grid.samples()),
        };
        canvas.turn_to(rays, origin);
        canvas
    }

    /// Takes the samples of another camera, in the same memory.
    pub fn turn_to(&mut self, rays: &Rays, origin: DVec3) {
        let grid = self.grid();
        self.screen = Screen::of(rays, grid);
        self.probes.clear();
        for row in 0..grid.height {
            let ray = |column| rays.sample(grid, column, row);
            let probes = (0..grid.width).map(|column| B::probe(&ray(column), origin));
            self.probes.extend(probes);
        }
    }

    /// Columns and rows.
    pub fn grid(&self) -> SampleGrid {
        self.screen.grid()
    }

    /// The image, in which boxes and triangles can be placed.
    pub fn screen(&self) -> &Screen {
        &self.screen
    }

    /// The ray of a sample.
    #[inline]
    pub fn probe(&self, sample: usize) -> &B::Probe {
        &self.probes[sample]
    }

    /// Calls `visit` with each sample of a rectangle that the stencil lets through.
    pub(super) fn scan(
        &self,
        rectangle: Option<Rectangle>,
        stencil: Option<&Stencil>,
        mut visit: impl FnMut(usize, &B::Probe),
    ) -> Visited {
        let mut visited = Visited::default();
        let Some(Rectangle { columns, rows }) = rectangle else {
            return visited;
        };
        for row in rows {
            for column in columns.clone() {
                let sample = (row * self.grid().width + column) as usize;
                if stencil.is_some_and(|stencil| !stencil.holds(sample)) {
                    visited.kept_out += 1;
                    continue;
                }
                visited.tested += 1;
                visit(sample, &self.probes[sample]);
            }
        }
        visited
    }
}

impl Canvas {
    /// The rays of a camera through the samples of a grid, for boxes.
    pub fn of(rays: &Rays, grid: SampleGrid) -> Canvas {
        Canvas::about(rays, grid, DVec3::ZERO)
    }

    /// The same samples seen in a mirror that is a plane across an axis: the rays
    /// from where they cross the plane on, reflected. (A ray that is reflected keeps
    /// its depths.) Rays that do not reach the plane meet nothing.
    pub fn mirrored(&self, axis: usize, at: f64) -> Canvas {
        let reflected = |probe: &Probe| {
            let mut ray = *probe.ray();
            let depth = (at - ray.origin[axis]) / ray.direction[axis];
            ray.near = match depth >= 0.0 && depth.is_finite() {
                true => depth.max(ray.near),
                false => f64::INFINITY,
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

    /// Calls `found` with each sample that meets the box.
    pub(super) fn meet(
        &self,
        b: &WorldBox,
        stencil: Option<&Stencil>,
        mut found: impl FnMut(usize, Crossing),
    ) -> Visited {
        self.scan(self.screen.rectangle(b), stencil, |sample, probe| {
            if let Some(at) = probe.enter(b, probe.ray().far) {
                found(sample, at);
            }
        })
    }

    /// Calls `found` with the fragments of a piece.
    ///
    /// For a part of an item, those where the item is entered through that part.
    pub(super) fn fragments(
        &self,
        solids: &Solids,
        piece: &Piece,
        stencil: Option<&Stencil>,
        mut found: impl FnMut(Fragment),
    ) -> Visited {
        let item = piece.item;
        let whole = &solids.boxes[item as usize];
        let Some(Part::Within(part)) = &piece.part else {
            // Leaves are of triangles.
            return self.meet(whole, stencil, |sample, at| {
                found(Fragment { sample, item, at });
            });
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
