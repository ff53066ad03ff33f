//! The fragment stage on what the chain leaves: the tests that decide at each sample,
//! what they keep of the items, and how many samples and fragments that takes.

use std::cell::RefCell;

use serde::Serialize;

use super::faces::Faces;
use super::fragment_rows::{STENCIL, Z};
use super::judged::Judged;
use super::left_out::{Reason, fits_drawing};
use super::pass::Pass;
use super::stage::{BackEnd, NONE, StageKind};
use super::triangle_rows;
use super::truth::Truth;
use super::world::World;
use crate::query::ItemId;
use crate::scene::{self, WorldBox};
use crate::visibility::fragment::{
    Canvas, Drawn, DrawnTriangles, Piece, Screen, Stencil, Surfaces, Tally, Tests,
};
use crate::visibility::region::RegionGraph;
use crate::visibility::truth::TriangleProbe;
use crate::visibility::{Rays, Solids};

/// What a test took, means per view.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
#[non_exhaustive]
pub struct FragmentCounts {
    /// Samples whose rays were asked, those that mark a stencil among them.
    pub asked_count: f64,
    /// Samples that the stencil kept from being asked.
    pub kept_out_count: f64,
    /// Samples that met an item: of meshes and maps a triangle, as each is drawn by itself.
    pub fragment_count: f64,
    /// Of these, dropped by the alpha-test.
    pub clear_count: f64,
    /// Of the rest, those that passed the z-test when they came.
    pub shaded_count: f64,
    /// Samples that something opaque covers.
    pub covered_count: f64,
}

impl FragmentCounts {
    /// All of them, in the order of the fields.
    pub fn in_order(&self) -> [f64; 6] {
        [
            self.asked_count,
            self.kept_out_count,
            self.fragment_count,
            self.clear_count,
            self.shaded_count,
            self.covered_count,
        ]
    }

    /// `None` of no view.
    pub(super) fn of(tallies: &[Tally]) -> Option<FragmentCounts> {
        let views = tallies.len() as f64;
        let mean = |of: fn(&Tally) -> u64| tallies.iter().map(of).sum::<u64>() as f64 / views;
        (!tallies.is_empty()).then(|| FragmentCounts {
            asked_count: mean(|tally| tally.asked),
            kept_out_count: mean(|tally| tally.kept_out),
            fragment_count: mean(|tally| tally.fragments),
            clear_count: mean(|tally| tally.clear),
            shaded_count: mean(|tally| tally.passed),
            covered_count: mean(|tally| tally.covered),
        })
    }
}

/// A test on every view.
pub struct Tested {
    /// The test.
    pub back_end: BackEnd,
    /// By view.
    pub judged: Vec<Judged>,
    /// `None` where nothing is drawn.
    pub counts: Option<FragmentCounts>,
    /// By view the samples that something covers; none where nothing is drawn.
    pub covered: Vec<u64>,
}

/// What a chain leaves of every view, ready to be drawn: boxes as they are; of a mesh or a
/// map the triangles that the triangle stage leaves, and the floors and ceilings.
pub struct Fragments<'w> {
    world: &'w World<'w>,
    /// Empty where too much would be drawn.
    tests: Vec<&'static str>,
    left: Left<'w>,
    /// Why there is no test.
    pub too_much: Option<Reason>,
}

/// By view what is drawn; and an image, whose memory is kept from view to view.
enum Left<'w> {
    Boxes(Vec<Boxes>, RefCell<Option<(Canvas, Drawn)>>),
    Triangles(&'w scene::Surfaces, Vec<Vec<u32>>, TriangleImage),
}

impl Left<'_> {
    /// Refuses a view of which too much would be drawn.
    fn fits(&self, world: &World, view: usize) -> Result<(), Reason> {
        let screen = Screen::of(world.rays(view), world.samples);
        match self {
            Left::Boxes(views, _) => {
                let boxes = views[view].solids.boxes.iter();
                fits_drawing(world.samples, boxes.filter_map(|b| screen.rectangle(b)))
            }
            Left::Triangles(surfaces, views, _) => {
                let corners = views[view].iter().map(|&t| surfaces.corners(t));
                let placed = corners.filter_map(|t| screen.triangle(t, surfaces.origin));
                fits_drawing(world.samples, placed)
            }
        }
    }
}

type TriangleImage = RefCell<Option<(Canvas<TriangleProbe>, DrawnTriangles)>>;

impl<'w> Fragments<'w> {
    /// Of a set of items of each view, whose triangles `faces` has, and what is left of
    /// these by a back end of the triangle stage.
    pub fn of(
        world: &'w World<'w>,
        pass: &Pass,
        set: usize,
        faces: &Faces,
        triangle: &str,
    ) -> Fragments<'w> {
        let place = triangle_rows::back_ends().position(|row| row.name == triangle);
        let tests = world.back_ends(StageKind::Fragment).into_iter();
        let tests = tests.map(|row| row.name).filter(|name| *name != NONE);
        let views = 0..world.views();
        let left = match (&world.solids, &world.surfaces) {
            (Some(solids), _) => {
                let boxes = views.map(|view| {
                    let items = world.listed(pass.items(set, view));
                    Boxes::of(world, solids, view, &items)
                });
                Left::Boxes(boxes.collect(), RefCell::new(None))
            }
            (None, Some(surfaces)) => {
                let beyond = surfaces.of_item.get(world.items()..).unwrap_or_default();
                let triangles = views.map(|view| {
                    let mut triangles = faces.triangles(place, view);
                    triangles.extend(beyond.iter().flat_map(Clone::clone));
                    triangles
                });
                Left::Triangles(surfaces, triangles.collect(), RefCell::new(None))
            }
            (None, None) => unreachable!("triangles of what is no solid box"),
        };
        let too_much = (0..world.views()).find_map(|view| left.fits(world, view).err());
        Fragments {
            tests: match too_much {
                None => tests.collect(),
                Some(_) => Vec::new(),
            },
            left,
            world,
            too_much,
        }
    }

    /// How many tests there are.
    pub fn count(&self) -> usize {
        self.tests.len()
    }

    /// Draws a view by a test; hands over what is in front at any sample.
    pub fn draw(&self, test: usize, view: usize, out: &mut Vec<ItemId>) -> Tally {
        let (rays, grid) = (self.world.rays(view), self.world.samples);
        match &self.left {
            Left::Boxes(views, image) => {
                let new = || (Canvas::of(rays, grid), Drawn::new(grid.samples()));
                let image = &mut *image.borrow_mut();
                let (canvas, drawn) = image.get_or_insert_with(new);
                canvas.turn_to(rays);
                let left = &views[view];
                left.draw(self.tests[test], canvas, drawn);
                let visible = drawn.depth.visible(canvas).into_iter();
                out.extend(visible.map(|place| left.items[place as usize]));
                drawn.tally
            }
            Left::Triangles(surfaces, views, image) => {
                let origin = surfaces.origin;
                let new = || {
                    let canvas = Canvas::for_triangles(rays, grid, origin);
                    (canvas, DrawnTriangles::new(grid.samples()))
                };
                let image = &mut *image.borrow_mut();
                let (canvas, drawn) = image.get_or_insert_with(new);
                canvas.turn_to(rays, origin);
                drawn.draw(canvas, surfaces, &views[view]);
                // Behind a map's items come its floors and ceilings.
                let items = self.world.items() as ItemId;
                let visible = drawn.visible(canvas).into_iter();
                out.extend(visible.filter(|item| *item < items));
                drawn.tally
            }
        }
    }

    /// Every test, held against the truth; of no test what it was given. `None` if stopped.
    pub fn tested(
        &self,
        pass: &Pass,
        set: usize,
        truth: &Truth,
        stop: &dyn Fn() -> bool,
    ) -> Option<Vec<Tested>> {
        let world = self.world;
        let tested = world.back_ends(StageKind::Fragment).into_iter();
        let is_there = |row: &BackEnd| row.name == NONE || self.tests.contains(&row.name);
        let tested = tested.filter(is_there).map(|back_end| {
            let test = self.tests.iter().position(|name| *name == back_end.name);
            let (mut judged, mut tallies) = (Vec::new(), Vec::new());
            for view in 0..world.views() {
                if stop() {
                    return None;
                }
                let given = pass.items(set, view);
                let mut output = Vec::new();
                match test {
                    Some(test) => tallies.push(self.draw(test, view, &mut output)),
                    None => output.extend_from_slice(&world.listed(given)),
                }
                judged.push(world.judge(view, [given, Some(&output)], truth));
            }
            Some(Tested {
                back_end,
                judged,
                counts: FragmentCounts::of(&tallies),
                covered: tallies.iter().map(|tally| tally.covered).collect(),
            })
        });
        tested.collect()
    }
}

/// What is left of a view of solid boxes, numbered anew.
struct Boxes {
    items: Vec<ItemId>,
    solids: Solids,
    cut_outs: Option<Surfaces>,
    /// Where the eye is in rooms: with the items that meet them, and those beyond.
    room: Option<(Room, [Vec<Piece>; 2])>,
}

/// The rooms that the eye is in.
struct Room {
    /// Their portals, flat.
    portals: Vec<WorldBox>,
    /// The items that meet them, ascending.
    items: Vec<ItemId>,
}

impl Boxes {
    fn of(world: &World, solids: &Solids, view: usize, items: &[ItemId]) -> Boxes {
        let room = Room::of(world, world.rays(view)).map(|room| {
            let pieces = (0..items.len() as ItemId).map(Piece::whole);
            let is_near = |p: &Piece| room.items.binary_search(&items[p.item as usize]).is_ok();
            let (near, beyond) = pieces.partition(is_near);
            (room, [near, beyond])
        });
        Boxes {
            items: items.to_vec(),
            solids: solids.some(items),
            cut_outs: world.cut_outs.as_ref().map(|surfaces| surfaces.some(items)),
            room,
        }
    }

    /// Draws the image anew by a test.
    fn draw(&self, test: &str, canvas: &Canvas, drawn: &mut Drawn) {
        let solids = &self.solids;
        drawn.clear();
        let tests = Tests {
            surfaces: self.cut_outs.as_ref().filter(|_| test != Z),
            stencil: None,
        };
        match self.room.as_ref().filter(|_| test == STENCIL) {
            None => {
                let pieces = (0..solids.boxes.len() as ItemId).map(Piece::whole);
                drawn.draw(canvas, solids, &pieces.collect::<Vec<_>>(), &tests);
            }
            Some((room, [near, beyond])) => {
                drawn.draw(canvas, solids, near, &tests);
                let stencil = room.stencil(canvas, drawn);
                drawn.tally.asked += stencil.asked();
                let stencil = Some(&stencil);
                drawn.draw(canvas, solids, beyond, &Tests { stencil, ..tests });
            }
        }
    }
}

impl Room {
    /// `None` for an eye that is in no room.
    fn of(world: &World, rays: &Rays) -> Option<Room> {
        let regions = world.regions.as_ref()?;
        let graph: &RegionGraph = regions.graph();
        let mut homes = Vec::new();
        if !graph.homes(rays, &mut homes) {
            return None;
        }
        let exits = homes.iter().flat_map(|&home| graph.exits(home));
        let portals = exits.map(|&exit| {
            let corners = graph.openings()[exit as usize].corners;
            WorldBox::union_of(corners.map(|corner| WorldBox::new(corner, corner)))
        });
        let portals = portals.collect();
        let items = homes
            .iter()
            .flat_map(|&home| regions.items().of_region(home));
        let mut items: Vec<ItemId> = items.copied().collect();
        items.sort_unstable();
        items.dedup();
        Some(Room { portals, items })
    }

    /// The samples that see a portal before what is drawn already.
    fn stencil(&self, canvas: &Canvas, drawn: &Drawn) -> Stencil {
        let mut stencil = Stencil::of(vec![false; canvas.grid().samples()]);
        for portal in &self.portals {
            stencil.add(&Stencil::of_rectangle(canvas, portal, &drawn.depth));
        }
        stencil
    }
}
