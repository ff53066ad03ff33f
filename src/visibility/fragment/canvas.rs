//! Samples of an image: their rays, the stencil-test and the z-test.

use glam::DVec3;

use super::order::{Part, Piece};
use super::screen::{Rectangle, Screen};
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::truth::{Along, Body, Crossing, NO_ITEM, Probe, SolidBox};
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

/// The front item of each sample so far; of a tie the lowest id.
#[derive(Clone, Debug)]
pub struct DepthBuffer<B: Body = SolidBox> {
    front: Vec<Option<(B::At, ItemId)>>,
    /// Fragments that were as near as the one in front, and lost by their id.
    ties: Vec<Fragment<B::At>>,
}

impl<B: Body> DepthBuffer<B> {
    /// A buffer in which nothing is drawn yet.
    pub fn new(samples: usize) -> DepthBuffer<B> {
        DepthBuffer {
            front: vec![None; samples],
            ties: Vec::new(),
        }
    }

    /// Forgets what was drawn.
    pub fn clear(&mut self) {
        self.front.fill(None);
        self.ties.clear();
    }

    /// Draws the fragment, if it passes: its sample is empty, or holds an item that is
    /// deeper, or as deep with a higher id. Returns whether it passed.
    #[inline]
    pub fn test(&mut self, canvas: &Canvas<B>, fragment: &Fragment<B::At>) -> bool {
        let Fragment { sample, item, at } = *fragment;
        let front = &mut self.front[sample];
        if let Some((other, other_item)) = *front {
            let order = canvas.probe(sample).order(&at, &other);
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
    pub fn covered(&self) -> u64 {
        self.front.iter().filter(|front| front.is_some()).count() as u64
    }

    /// The exact visible set of the samples, ascending: all that is in front
    /// anywhere, every item of a tie.
    pub fn visible(&self, canvas: &Canvas<B>) -> Vec<ItemId> {
        let in_front = |tie: &&Fragment<B::At>| {
            let front = self.front[tie.sample];
            let order = |front: (B::At, _)| canvas.probe(tie.sample).order(&tie.at, &front.0);
            front.is_some_and(|front| order(front).is_eq())
        };
        let ties = self.ties.iter().filter(in_front).map(|tie| tie.item);
        let mut visible: Vec<ItemId> = self.front.iter().flatten().map(|front| front.1).collect();
        visible.extend(ties);
        visible.sort_unstable();
        visible.dedup();
        visible
    }
}

impl DepthBuffer {
    /// Marks the samples at which a rectangle is no farther than the depth buffer.
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
