//! Fragment stage: tests for the remaining item in front at each sample.
//!
//! Counts the samples and fragments of each test.

use std::cell::RefCell;
use std::collections::HashSet;

use glam::DVec3;

use super::error::fits_drawing;
use super::item_stages::ItemStages;
use super::setup::{Setup, Shape};
use super::stage::{BackEnd, NONE, STENCIL, StageKind, Z, default_test};
use super::task::{FunnelKey, KeyedTask};
use super::triangle_stage::TriangleStage;
use super::visible_items::{Errors, VisibleItems, count_items};
use crate::measure::QueryFn;
use crate::query::ItemId;
use crate::scene::{self, WorldBox};
use crate::visibility::fragment::{
    AlphaMasks, Canvas, Drawable, Drawn, FragmentCounts, Screen, Tests,
};
use crate::visibility::truth::{Facet, SolidBox};
use crate::visibility::{Rays, SampleGrid};

/// Samples and fragments of a test, as means per view.
pub type MeanCounts = FragmentCounts<f64>;

impl MeanCounts {
    /// Means of the counts of all views; `None` without views.
    pub(super) fn of(all: &[FragmentCounts]) -> Option<MeanCounts> {
        let views = all.len() as f64;
        let mean = |of: fn(&FragmentCounts) -> u64| all.iter().map(of).sum::<u64>() as f64 / views;
        (!all.is_empty()).then(|| MeanCounts {
            asked_count: mean(|counts| counts.asked_count),
            kept_out_count: mean(|counts| counts.kept_out_count),
            fragment_count: mean(|counts| counts.fragment_count),
            clear_count: mean(|counts| counts.clear_count),
            shaded_count: mean(|counts| counts.shaded_count),
            covered_count: mean(|counts| counts.covered_count),
        })
    }
}

/// Geometry of the items that the chain leaves, to be drawn.
///
/// Boxes as they are; for a mesh or a map the triangles that the triangle stage leaves, plus floors
/// and ceilings.
pub struct FragmentStage<'w> {
    setup: &'w Setup<'w>,
    geometry: Geometry<'w>,
    /// Reason if nothing is drawn.
    pub too_much: Option<String>,
}

/// Geometry of each view, and the reused memory of an image.
enum Geometry<'w> {
    Boxes(Vec<BoxView>, Image<SolidBox>),
    Triangles(&'w scene::Surfaces, Vec<Vec<u32>>, Image<Facet>),
}

/// Memory of an image, allocated at the first view.
struct Image<B: Drawable>(RefCell<Option<(Canvas<B>, Drawn<B>)>>);

impl<B: Drawable> Image<B> {
    /// Draws a view about an origin; returns the items in front at any sample.
    fn redraw(
        &self,
        (rays, grid, origin): (&Rays, SampleGrid, DVec3),
        draw: impl FnOnce(&Canvas<B>, &mut Drawn<B>),
    ) -> (Vec<ItemId>, FragmentCounts) {
        let image = &mut *self.0.borrow_mut();
        let new = || {
            let canvas = Canvas::about(rays, grid, origin);
            (canvas, Drawn::new(grid.samples()))
        };
        let (canvas, drawn) = image.get_or_insert_with(new);
        canvas.set_camera(rays);
        draw(canvas, drawn);
        (drawn.visible(canvas), drawn.counts)
    }
}

impl Geometry<'_> {
    /// Rejects a view that covers too many samples.
    fn fits(&self, setup: &Setup, view: usize) -> Result<(), String> {
        let screen = Screen::of(setup.rays(view), setup.samples);
        match self {
            Geometry::Boxes(views, _) => {
                let boxes = views[view].bodies.iter();
                let rectangles = boxes.filter_map(|body| screen.rectangle(&body.b));
                fits_drawing(setup.samples, rectangles)
            }
            Geometry::Triangles(surfaces, views, _) => {
                let corners = views[view].iter().map(|&t| surfaces.corners(t));
                let rectangles = corners.filter_map(|t| screen.triangle(t, surfaces.origin));
                fits_drawing(setup.samples, rectangles)
            }
        }
    }
}

/// A test, its errors, and the counts of each drawn view.
type TestResult = (BackEnd, Errors, Vec<FragmentCounts>);

impl<'w> FragmentStage<'w> {
    /// Collects the remaining items, with triangles culled by the back end `triangle`.
    pub fn new(
        stages: &ItemStages<'w>,
        (triangles, triangle): (&TriangleStage, &str),
    ) -> FragmentStage<'w> {
        let setup = stages.setup;
        let geometry = match &setup.shape {
            Shape::Boxes(solids) => {
                let of = |view| {
                    let listed = stages.remaining(view);
                    let bodies: Vec<_> = SolidBox::some(&solids.boxes, listed).collect();
                    let pass = PortalPass::of(setup, setup.rays(view), &bodies);
                    BoxView { bodies, pass }
                };
                Geometry::Boxes(setup.views().map(of).collect(), Image(RefCell::new(None)))
            }
            Shape::Triangles(surfaces) => {
                let beyond = surfaces.of_item.get(setup.items()..).unwrap_or_default();
                let triangles = setup.views().map(|view| {
                    let mut triangles = triangles.triangles(triangle, view);
                    triangles.extend(beyond.iter().flat_map(Clone::clone));
                    triangles
                });
                Geometry::Triangles(surfaces, triangles.collect(), Image(RefCell::new(None)))
            }
        };
        FragmentStage {
            too_much: setup.views().find_map(|v| geometry.fits(setup, v).err()),
            geometry,
            setup,
        }
    }

    /// Draws a view with a test; appends the items in front at any sample.
    fn draw(&self, test: &str, view: usize, out: &mut Vec<ItemId>) -> FragmentCounts {
        let (rays, grid) = (self.setup.rays(view), self.setup.samples);
        let (visible, counts) = match &self.geometry {
            Geometry::Boxes(views, image) => {
                let surfaces = self.setup.cut_outs.as_ref().filter(|_| test != Z);
                image.redraw((rays, grid, DVec3::ZERO), |canvas, drawn| {
                    views[view].draw(test, surfaces, canvas, drawn);
                })
            }
            Geometry::Triangles(surfaces, views, image) => {
                image.redraw((rays, grid, surfaces.origin), |canvas, drawn| {
                    drawn.draw_triangles(canvas, surfaces, &views[view]);
                })
            }
        };
        // Floors and ceilings of a map follow its items.
        let items = self.setup.items() as ItemId;
        out.extend(visible.into_iter().filter(|item| *item < items));
        counts
    }

    /// Rows of the stage: `none`, and the tests to be drawn.
    ///
    /// The latter are the compared rows and the default test, the baseline of the others.
    fn tests(&self) -> impl Iterator<Item = BackEnd> {
        let setup = self.setup;
        let compared = setup.rows(StageKind::Fragment);
        let default = default_test(setup.cut_outs.is_some());
        let is_drawn = move |row: &BackEnd| {
            row.name == default || compared.iter().any(|(own, _)| own.name == row.name)
        };
        let rows = setup.back_ends(StageKind::Fragment).into_iter();
        rows.filter(move |row| row.name == NONE || self.too_much.is_none() && is_drawn(row))
    }

    pub fn tasks(&self) -> impl Iterator<Item = KeyedTask<'_>> {
        let drawn = self.tests().filter(|row| row.name != NONE);
        drawn.map(move |row| {
            let ask: QueryFn = Box::new(move |view, out| {
                self.draw(row.name, view, out);
            });
            let key = FunnelKey::Stage(StageKind::Fragment, row.name.to_owned());
            (key, ask)
        })
    }

    /// Applies `none` and each test to the remaining items; counts of drawn views.
    pub fn tested(&self, stages: &ItemStages, truth: &VisibleItems) -> Vec<TestResult> {
        let setup = self.setup;
        let tested = self.tests().map(|back_end| {
            let (mut counts, mut drawn) = (Vec::new(), Vec::new());
            for view in setup.views() {
                let given = stages.remaining(view);
                let mut output = Vec::new();
                match back_end.name {
                    NONE => output.extend_from_slice(given),
                    test => drawn.push(self.draw(test, view, &mut output)),
                }
                counts.push(count_items(given, &output, &truth[view]));
            }
            (back_end, Errors::of(&counts), drawn)
        });
        tested.collect()
    }
}

/// Solid boxes of a view.
struct BoxView {
    bodies: Vec<SolidBox>,
    pass: Option<PortalPass>,
}

/// Rooms around an eye that is in rooms, for the stencil test.
struct PortalPass {
    /// Portals as flat boxes.
    portals: Vec<WorldBox>,
    /// Boxes that meet the rooms.
    near: Vec<SolidBox>,
    beyond: Vec<SolidBox>,
}

impl BoxView {
    /// Redraws the image with a test; `surfaces` may have holes.
    fn draw(&self, test: &str, surfaces: Option<&AlphaMasks>, canvas: &Canvas, drawn: &mut Drawn) {
        drawn.clear();
        let tests = Tests {
            surfaces,
            ..Tests::default()
        };
        match self.pass.as_ref().filter(|_| test == STENCIL) {
            None => drawn.draw(canvas, self.bodies.iter().copied(), &tests),
            Some(pass) => {
                drawn.draw(canvas, pass.near.iter().copied(), &tests);
                // Samples whose ray reaches a portal before everything drawn so far.
                let stencil = drawn.stencil(canvas, &pass.portals);
                drawn.counts.asked_count += stencil.tested;
                let stencil = Some(&stencil);
                let beyond = pass.beyond.iter().copied();
                drawn.draw(canvas, beyond, &Tests { stencil, ..tests });
            }
        }
    }
}

impl PortalPass {
    /// Rooms of the eye; `None` if it is in no room.
    fn of(setup: &Setup, rays: &Rays, bodies: &[SolidBox]) -> Option<PortalPass> {
        let regions = setup.regions.as_ref()?;
        let graph = &regions.graph;
        let mut homes = Vec::new();
        if !graph.homes(rays, &mut homes) {
            return None;
        }
        let exits = homes.iter().flat_map(|&home| &graph.exits[home as usize]);
        let portals = exits.map(|&exit| {
            let corners = graph.openings[exit as usize].corners;
            WorldBox::union_of(corners.map(WorldBox::at))
        });
        let of_rooms = homes.iter().flat_map(|&home| regions.items.of_region(home));
        let of_rooms: HashSet<ItemId> = of_rooms.copied().collect();
        let is_near = |body: &SolidBox| of_rooms.contains(&body.item);
        let (near, beyond) = bodies.iter().copied().partition(is_near);
        Some(PortalPass {
            portals: portals.collect(),
            near,
            beyond,
        })
    }
}
