//! The samples of an image, ready to be drawn on: it finds the fragments of a box.

use super::order::{Part, Piece};
use super::screen::Screen;
use super::stencil::Stencil;
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::truth::{Crossing, Probe};
use crate::visibility::{Rays, SampleGrid, Solids};

/// An item at a sample.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Fragment {
    /// Row by row from the top left.
    pub sample: usize,
    /// The item.
    pub item: ItemId,
    /// Where the ray enters it.
    pub at: Crossing,
}

/// What it took to find the fragments of a piece.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub(super) struct Asked {
    /// Samples whose rays were asked.
    pub samples: u64,
    /// Samples that the stencil kept out.
    pub kept_out: u64,
}

/// The samples of an image with their rays. 96 bytes per sample.
#[derive(Clone, Debug)]
pub struct Canvas {
    screen: Screen,
    probes: Vec<Probe>,
}

impl Canvas {
    /// The rays of a camera through the samples of a grid.
    pub fn of(rays: &Rays, grid: SampleGrid) -> Canvas {
        let rows = 0..grid.height;
        let samples = rows.flat_map(|row| (0..grid.width).map(move |column| (column, row)));
        let probe = |(column, row)| Probe::new(rays.sample(grid, column, row));
        Canvas {
            screen: Screen::of(rays, grid),
            probes: samples.map(probe).collect(),
        }
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

    /// Columns and rows.
    pub fn grid(&self) -> SampleGrid {
        self.screen.grid()
    }

    /// Where boxes come to lie in the image.
    pub fn screen(&self) -> &Screen {
        &self.screen
    }

    /// The ray of a sample.
    #[inline]
    pub fn probe(&self, sample: usize) -> &Probe {
        &self.probes[sample]
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
