//! Laws of motion: the bounds of an item as a function of its number of moves.
//!
//! Pure functions of seed, item and number of moves: nothing accumulates, and a replay needs no
//! other state.

use std::f64::consts::TAU;
use std::path::Path;

use glam::{DVec3, Vec3};

use crate::geometry::Aabb;
use crate::input::is_readable;
use crate::query::ItemId;
use crate::scene::{COUNT, CityGrid, Scene, UpAxis, mix64, on_sphere};
use crate::spec::Spec;

/// Bounds of a removed item: an empty box with finite bounds.
pub const REMOVED: Aabb = Aabb::new(Vec3::ONE, Vec3::NEG_ONE);

/// Bounds of an item after a number of moves; `None` for an item that cannot move.
pub(super) type Law = fn(&World, ItemId, u32) -> Option<Aabb>;

/// The scene's properties that laws read, in its own coordinates.
#[derive(Debug)]
pub(super) struct World {
    start: Vec<Aabb>,
    low: DVec3,
    high: DVec3,
    /// Mean of the items' longest edges; never zero.
    mean: f64,
    up: UpAxis,
    origin: DVec3,
    /// Streets of a scene that was generated as a city.
    city: Option<CityGrid>,
    step: f64,
    seed: u64,
}

/// Direction of the street at a position, z up and in world coordinates.
fn street(grid: &CityGrid, place: DVec3) -> Option<DVec3> {
    let pitch = grid.block + grid.street;
    let is_across = |k: usize| (place[k] - grid.corner).rem_euclid(pitch) >= grid.block;
    match [is_across(0), is_across(1)] {
        [_, true] => Some(DVec3::X),
        [is_y, false] => is_y.then_some(DVec3::Y),
    }
}

/// Streets of a scene that was generated as a city, in world coordinates.
fn city_grid(scene: &Scene) -> Option<CityGrid> {
    let mut spec = Spec::parse(&scene.name).ok()?;
    // A file may have that name.
    let is_city = spec.name() == "city" && !is_readable(Path::new(&scene.name));
    // The scene may be a part of the city.
    let n = spec.whole("n", COUNT, 0..=u64::MAX).ok()?;
    let mut grid = CityGrid::of(&mut spec, n as usize).ok()?;
    grid.corner += spec.number("offset", 0.0).ok()?;
    is_city.then_some(grid)
}

impl World {
    pub(super) fn new(scene: &Scene, step: f64, seed: u64) -> World {
        let (low, high) = (scene.bounds.min.as_dvec3(), scene.bounds.max.as_dvec3());
        let edges = scene.items.iter().map(|b| edges(b).max_element());
        let mean = edges.sum::<f64>() / scene.items.len().max(1) as f64;
        let sizes = [mean, (high - low).length() / 1000.0, 1.0];
        World {
            start: scene.items.clone(),
            low,
            high,
            mean: sizes.into_iter().find(|size| *size > 0.0).unwrap_or(1.0),
            up: scene.up,
            origin: scene.origin,
            city: city_grid(scene),
            step,
            seed,
        }
    }

    /// Random number `n` of an item, uniform in 0..1.
    fn unit(&self, id: ItemId, n: u64) -> f64 {
        let key = mix64(self.seed ^ mix64(u64::from(id) ^ (n << 32)));
        (key >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Random direction of an item, uniform on the sphere.
    fn direction(&self, id: ItemId) -> DVec3 {
        let z = 2.0 * self.unit(id, 1) - 1.0;
        self.up.from_z_up(on_sphere(z, TAU * self.unit(id, 2)))
    }

    /// Step length of an item, proportional to its size.
    fn step(&self, b: &Aabb) -> f64 {
        let own = edges(b).max_element();
        self.step * if own > 0.0 { own } else { self.mean }
    }

    /// A box translated, scaled about its centre, and reflected at the scene's bounds.
    fn placed(&self, b: &Aabb, offset: DVec3, scale: f64) -> Aabb {
        let (min, max) = (b.min.as_dvec3(), b.max.as_dvec3());
        let (centre, half) = ((min + max) / 2.0, (max - min) / 2.0 * scale);
        let (low, high) = (self.low + half, self.high - half);
        let axis = |k: usize| reflected(centre[k] + offset[k], low[k], high[k]);
        let centre = DVec3::from([0, 1, 2].map(axis));
        let (min, max) = (centre - half, centre + half);
        Aabb::new(min.max(self.low).as_vec3(), max.min(self.high).as_vec3())
    }

    /// The box at a random position, a different one for each `n`.
    pub(super) fn anywhere(&self, id: ItemId, n: u32) -> Aabb {
        let b = &self.start[id as usize];
        let (min, max) = (b.min.as_dvec3(), b.max.as_dvec3());
        let room = (self.high - self.low) - (max - min);
        let at = [0, 1, 2].map(|k| self.unit(id, 16 + 3 * u64::from(n) + k));
        let corner = self.low + self.up.from_z_up(DVec3::from(at)) * room;
        self.placed(b, corner - min, 1.0)
    }
}

/// Edges of a box; zero where they are no longer than outward rounding makes them.
fn edges(b: &Aabb) -> DVec3 {
    let (min, max) = (b.min.as_dvec3(), b.max.as_dvec3());
    let (size, rounding) = (
        max - min,
        min.abs().max(max.abs()) * f64::from(f32::EPSILON) * 2.0,
    );
    DVec3::select(size.cmpgt(rounding), size, DVec3::ZERO)
}

/// A coordinate reflected between two mirrors; the middle if there is no room.
fn reflected(x: f64, low: f64, high: f64) -> f64 {
    if low >= high {
        return low / 2.0 + high / 2.0;
    }
    low + to_and_fro(x - low, high - low)
}

/// A triangle wave of this height, rising from zero.
fn to_and_fro(x: f64, height: f64) -> f64 {
    let turn = x.rem_euclid(2.0 * height);
    turn.min(2.0 * height - turn)
}

/// In the item's own direction, at another size.
pub(super) fn straight(world: &World, id: ItemId, moves: u32, scale: f64) -> Option<Aabb> {
    let b = &world.start[id as usize];
    let offset = world.direction(id) * world.step(b) * f64::from(moves);
    Some(world.placed(b, offset, scale))
}

pub(super) fn traffic(world: &World, id: ItemId, moves: u32) -> Option<Aabb> {
    let b = &world.start[id as usize];
    let place = (b.min.as_dvec3() + b.max.as_dvec3()) / 2.0;
    let along = street(world.city.as_ref()?, world.up.to_z_up(place + world.origin))?;
    let way = if world.unit(id, 3) < 0.5 { 1.0 } else { -1.0 };
    let offset = world.up.from_z_up(along) * way * world.step(b) * f64::from(moves);
    Some(world.placed(b, offset, 1.0))
}

pub(super) fn swarm(world: &World, id: ItemId, moves: u32) -> Option<Aabb> {
    const TURN: f64 = TAU / 64.0;
    let b = &world.start[id as usize];
    let extent = (world.high - world.low).max(DVec3::splat(f64::MIN_POSITIVE));
    let at = world.up.to_z_up((b.min.as_dvec3() - world.low) / extent);
    let phase = TAU * (at.x + at.y);
    let radius = world.step * world.mean / TURN;
    let on_circle = |angle: f64| DVec3::new(libm::cos(angle), libm::sin(angle), 0.0) * radius;
    let offset = on_circle(phase + TURN * f64::from(moves)) - on_circle(phase);
    Some(world.placed(b, world.up.from_z_up(offset), 1.0))
}

pub(super) fn doors(world: &World, id: ItemId, moves: u32) -> Option<Aabb> {
    let b = &world.start[id as usize];
    let size = world.up.to_z_up(edges(b));
    let (axis, width) = match size.x >= size.y {
        true => (DVec3::X, size.x),
        false => (DVec3::Y, size.y),
    };
    let width = if width > 0.0 { width } else { world.mean };
    let open = to_and_fro(world.step * f64::from(moves), 1.0);
    Some(world.placed(b, world.up.from_z_up(axis * width * open), 1.0))
}

pub(super) fn growth(world: &World, id: ItemId, moves: u32) -> Option<Aabb> {
    let scale = 1.0 + to_and_fro(world.step * f64::from(moves), 1.0);
    Some(world.placed(&world.start[id as usize], DVec3::ZERO, scale))
}

/// Half of the movers start with an odd number.
pub(super) fn spawn(world: &World, id: ItemId, moves: u32) -> Option<Aabb> {
    let turn = moves + u32::from(world.unit(id, 4) < 0.5);
    Some(match turn.is_multiple_of(2) {
        true => world.anywhere(id, moves),
        false => REMOVED,
    })
}

pub(super) fn bepu(world: &World, id: ItemId, moves: u32) -> Option<Aabb> {
    let speed = 10.0 * world.step * world.unit(id, 5).powi(10);
    let offset = world.direction(id) * speed * f64::from(moves);
    Some(world.placed(&world.start[id as usize], offset, 1.0))
}
