//! The fragment stage on what the chain leaves: the tests that decide at each sample,
//! what they keep of the items, and how many samples and fragments that takes.

use serde::Serialize;

use super::fragment_rows::{STENCIL, Z};
use super::judged::Judged;
use super::pass::Pass;
use super::stage::{BackEnd, NONE, StageKind};
use super::truth::Truth;
use super::world::World;
use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::fragment::{Canvas, Drawn, Piece, Stencil, Surfaces, Tally, Tests, draw};
use crate::visibility::region::RegionGraph;
use crate::visibility::{Rays, Solids};

/// What a test took, means per view.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
#[non_exhaustive]
pub struct FragmentCounts {
    /// Samples whose rays were asked, those that mark a stencil among them.
    pub asked_count: f64,
    /// Samples that the stencil kept from being asked.
    pub kept_out_count: f64,
    /// Samples that met an item.
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
}

/// Every test on a set of items of each view; `None` if stopped.
pub fn tested(
    world: &World,
    pass: &Pass,
    set: usize,
    truth: &Truth,
    stop: &dyn Fn() -> bool,
) -> Option<Vec<Tested>> {
    let back_ends = world.back_ends(StageKind::Fragment);
    let mut judged = vec![Vec::new(); back_ends.len()];
    let mut tallies = vec![Vec::new(); back_ends.len()];
    for view in 0..world.views() {
        if stop() {
            return None;
        }
        let given = pass.items(set, view);
        let items = world.listed(given);
        let solids = world.solids.as_ref();
        let left = solids.map(|solids| Left::of(world, solids, view, &items));
        for (place, back_end) in back_ends.iter().enumerate() {
            let output = match (&left, back_end.name) {
                (_, NONE) => items.to_vec(),
                (Some(left), name) => {
                    let drawn = left.drawn(name);
                    tallies[place].push(drawn.tally);
                    let visible = drawn.depth.visible(&left.canvas).into_iter();
                    visible.map(|place| items[place as usize]).collect()
                }
                // What walls and triangles hide is known from their truth alone.
                (None, _) => {
                    let visible = truth.of_view(view).iter().map(|(item, _)| *item);
                    let given = visible.filter(|item| items.binary_search(item).is_ok());
                    given.collect::<Vec<ItemId>>()
                }
            };
            judged[place].push(world.judge(view, [given, Some(&output)], truth));
        }
    }
    let rows = back_ends.into_iter().zip(judged).zip(tallies);
    let tested = rows.map(|((back_end, judged), tallies)| Tested {
        back_end,
        judged,
        counts: FragmentCounts::of(&tallies),
    });
    Some(tested.collect())
}

/// What is left of a view, numbered anew.
struct Left {
    canvas: Canvas,
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

impl Left {
    fn of(world: &World, solids: &Solids, view: usize, items: &[ItemId]) -> Left {
        let rays = world.rays(view);
        let room = Room::of(world, rays).map(|room| {
            let pieces = (0..items.len() as ItemId).map(Piece::whole);
            let is_near = |p: &Piece| room.items.binary_search(&items[p.item as usize]).is_ok();
            let (near, beyond) = pieces.partition(is_near);
            (room, [near, beyond])
        });
        Left {
            canvas: Canvas::of(rays, world.samples),
            solids: solids.some(items),
            cut_outs: world.cut_outs.as_ref().map(|surfaces| surfaces.some(items)),
            room,
        }
    }

    /// The image by a test.
    fn drawn(&self, test: &str) -> Drawn {
        let Left { canvas, solids, .. } = self;
        let tests = Tests {
            surfaces: self.cut_outs.as_ref().filter(|_| test != Z),
            stencil: None,
        };
        match self.room.as_ref().filter(|_| test == STENCIL) {
            None => {
                let pieces = (0..solids.boxes.len() as ItemId).map(Piece::whole);
                draw(canvas, solids, &pieces.collect::<Vec<_>>(), &tests)
            }
            Some((room, [near, beyond])) => {
                let mut drawn = draw(canvas, solids, near, &tests);
                let stencil = room.stencil(canvas, &drawn);
                drawn.tally.asked += stencil.asked();
                let stencil = Some(&stencil);
                drawn.draw(canvas, solids, beyond, &Tests { stencil, ..tests });
                drawn
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
            .flat_map(|&home| regions.items_of_graph().of_region(home));
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
