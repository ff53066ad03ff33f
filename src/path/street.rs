//! Views from eye height above the ground, outside all items.
//!
//! The nearest items hide most of such a view.

use std::mem;

use glam::DVec3;

use super::{Pose, Stage, unfit};
use crate::geometry::Aabb;
use crate::input::Result;
use crate::scene::{Regions, SeededRng, on_sphere};
use crate::spec::Spec;

/// Candidate positions drawn for each eye.
///
/// The eye takes the one that rises least above the foot of what it stands on: in a city the street
/// instead of a roof, in a forest the ground instead of a treetop.
const DRAWN: usize = 8;
/// Most times that candidates are drawn again for an eye that is not on the ground.
const MORE: usize = 4;
/// Clearance of an eye on all sides, world units.
const CLEARANCE: f64 = 0.3;
/// Spans of items that columns hold at once; at least one per item.
const MOST_SPANS: usize = 1 << 20;

/// A candidate position, and the items above and below it.
#[derive(Default)]
struct Column {
    x: f64,
    y: f64,
    /// Floor and ceiling of its room, or of the scene.
    low: f64,
    high: f64,
    /// The items that it passes through; empty once the ground is known.
    spans: Vec<Span>,
    ground: f64,
    /// The lowest of the items.
    first: Option<Span>,
}

/// An item in a column.
struct Span {
    item: usize,
    bottom: f64,
    top: f64,
    /// True if its triangles all face up.
    is_ground: bool,
}

pub(super) fn frames(stage: &Stage, spec: &mut Spec) -> Result<Vec<Pose>> {
    let height = spec.number_between("height", 1.7, 0.0, 1e6)?;
    let mut rng = stage.rng();
    let places = &stage.scene.places;
    let is_map = matches!(stage.scene.regions, Regions::Bsp(_) | Regions::Leaves(_));
    if is_map && !places.is_empty() {
        if let Some((_, height)) = spec.given().find(|given| given.0 == "height") {
            let scene = &stage.scene.name;
            let reason =
                format_args!("height={height}; expected none, as the places of '{scene}' have one");
            return Err(unfit("street", reason));
        }
        // Places chosen by a map's author need no search.
        let poses = (0..stage.count).map(|_| {
            let eye = stage.scene.up.to_z_up(places[rng.below(places.len())].eye);
            Pose::new(eye, level(&mut rng))
        });
        return Ok(poses.collect());
    }
    let mut stands = lowest(stage, height, stage.count, &mut rng);
    let directions: Vec<DVec3> = (0..stage.count).map(|_| level(&mut rng)).collect();
    for _ in 0..MORE {
        // All candidates of an eye may have been under trees.
        let high = stands.iter_mut().filter(|stand| stand.is_on_top);
        let high: Vec<&mut StandingPoint> = high.collect();
        let others = lowest(stage, height, high.len(), &mut rng);
        for (stand, other) in high.into_iter().zip(others) {
            if other.rise < stand.rise || !other.is_on_top {
                *stand = other;
            }
        }
    }
    let poses = stands.iter().zip(directions);
    let poses = poses.map(|(stand, ahead)| Pose::new(stand.eye, ahead));
    Ok(poses.collect())
}

/// A position that an eye may take.
#[derive(Clone, Copy)]
struct StandingPoint {
    eye: DVec3,
    /// Height above the foot of the lowest item there, or above the floor.
    rise: f64,
    /// True if it stands above the lowest item, on another one.
    is_on_top: bool,
}

/// For each of `count` eyes the lowest of its candidates.
fn lowest(stage: &Stage, height: f64, count: usize, rng: &mut SeededRng) -> Vec<StandingPoint> {
    let mut columns: Vec<Column> = (0..count).flat_map(|_| candidates(stage, rng)).collect();
    fill(stage, &mut columns, height + CLEARANCE);
    // If nearly all candidates have an item below them, the others are beyond the scene's edge.
    let bare = columns.iter().filter(|column| column.first.is_none());
    let has_ground = bare.count() * 10 < columns.len();
    let stands = columns.chunks(DRAWN).filter_map(|columns| {
        let stands = columns.iter().map(|column| {
            let (ground, first) = (column.ground, column.first.as_ref());
            let is_off_mesh = !first.is_some_and(|span| span.is_ground);
            let is_beyond = has_ground && first.is_none();
            let stand = StandingPoint {
                eye: DVec3::new(column.x, column.y, ground + height),
                rise: ground - first.map_or(column.low, |span| span.bottom),
                is_on_top: ground > first.map_or(column.low, |span| span.top),
            };
            ((is_off_mesh, is_beyond), stand)
        });
        let best = stands.min_by(|(a, s), (b, t)| a.cmp(b).then(s.rise.total_cmp(&t.rise)));
        best.map(|(_, stand)| stand)
    });
    stands.collect()
}

/// A horizontal direction, all equally likely.
fn level(rng: &mut SeededRng) -> DVec3 {
    on_sphere(0.0, std::f64::consts::TAU * rng.unit())
}

/// The candidates of one eye: in one room, if there are rooms.
fn candidates(stage: &Stage, rng: &mut SeededRng) -> Vec<Column> {
    let (min, max) = match &stage.scene.regions {
        Regions::Tiling(tiling) if !tiling.boxes.is_empty() => {
            stage.in_world(&tiling.boxes[rng.below(tiling.boxes.len())])
        }
        _ => (stage.bounds.min, stage.bounds.max),
    };
    let place = |_| Column {
        x: rng.between(min.x, max.x),
        y: rng.between(min.y, max.y),
        low: min.z,
        high: max.z,
        ..Column::default()
    };
    (0..DRAWN).map(place).collect()
}

/// Finds the ground of all columns.
///
/// If they pass through too many items, half of them at a time. O((n + columns) log columns) for
/// small boxes.
fn fill(stage: &Stage, columns: &mut [Column], room: f64) {
    if !pierce(stage, columns) {
        columns.iter_mut().for_each(|c| c.spans = Vec::new());
        let (some, others) = columns.split_at_mut(columns.len() / 2);
        fill(stage, some, room);
        return fill(stage, others, room);
    }
    for column in columns {
        column.ground = column.level(room);
        column.first = mem::take(&mut column.spans).into_iter().next();
    }
}

/// Finds the items of all columns: by their boxes, or those of a mesh's triangles.
///
/// False if several columns have too many.
fn pierce(stage: &Stage, columns: &mut [Column]) -> bool {
    let most = match columns.len() {
        0..=1 => usize::MAX,
        _ => MOST_SPANS.max(stage.scene.items.len()),
    };
    let mut held = 0;
    let mut by_x: Vec<u32> = (0..columns.len() as u32).collect();
    by_x.sort_by(|&a, &b| columns[a as usize].x.total_cmp(&columns[b as usize].x));
    let xs: Vec<f64> = by_x.iter().map(|&c| columns[c as usize].x).collect();
    let mut add = |item: usize, is_ground: bool, b: &Aabb| {
        let (min, max) = stage.in_world(b);
        let from = xs.partition_point(|&x| x < min.x - CLEARANCE);
        let to = xs.partition_point(|&x| x <= max.x + CLEARANCE);
        for &c in by_x.get(from..to).unwrap_or_default() {
            let column = &mut columns[c as usize];
            let beside = column.y < min.y - CLEARANCE || column.y > max.y + CLEARANCE;
            if !beside && min.z <= column.high && max.z >= column.low {
                held -= column.spans.len();
                column.add(Span {
                    item,
                    bottom: min.z,
                    top: max.z,
                    is_ground,
                });
                held += column.spans.len();
            }
        }
        held <= most
    };
    let Some(mesh) = &stage.scene.surfaces else {
        let mut items = stage.scene.items.iter().enumerate();
        return items.all(|(item, b)| add(item, false, b));
    };
    let triangles = |item| mesh.of(item).map(move |corners| (item, corners));
    let mut triangles = (0..mesh.items()).flat_map(triangles);
    triangles.all(|(item, [p, q, r])| {
        let [u, v] = [q - p, r - p].map(|edge| stage.scene.up.to_z_up(edge).truncate().as_dvec2());
        add(item, u.perp_dot(v) > 0.0, &Aabb::of_points([p, q, r]))
    })
}

impl Column {
    /// Adds a part of an item; the parts of one item come in succession.
    fn add(&mut self, part: Span) {
        match self.spans.last_mut() {
            Some(span) if span.item == part.item => {
                span.bottom = span.bottom.min(part.bottom);
                span.top = span.top.max(part.top);
                span.is_ground &= part.is_ground;
            }
            _ => {
                if self.spans.len() == self.spans.capacity() {
                    self.merge();
                    self.spans.reserve(self.spans.len().max(1));
                }
                self.spans.push(part);
            }
        }
    }

    /// Sorts the spans and joins those that overlap above the lowest item.
    fn merge(&mut self) {
        self.spans.sort_by(|a, b| a.bottom.total_cmp(&b.bottom));
        let lowest = self.spans.first().map(|span| span.item);
        self.spans.dedup_by(|span, below| {
            let is_within = Some(below.item) != lowest && span.bottom <= below.top;
            if is_within {
                below.top = below.top.max(span.top);
            }
            is_within
        });
    }

    /// The lowest level with `room` above it.
    ///
    /// On the lowest item, on what stands on that, or on the floor if there is no item.
    fn level(&mut self, room: f64) -> f64 {
        self.merge();
        let mut ground = self.low;
        for (i, span) in self.spans.iter().enumerate() {
            // Room below the lowest item is underground.
            if i > 0 && span.bottom - ground >= room {
                break;
            }
            ground = ground.max(span.top);
        }
        ground
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::{Column, MOST_SPANS, Span, Stage, candidates, fill, pierce};
    use crate::path::{self, LensDefaults};
    use crate::scene::{self, Scene, SeededRng, WorldBox};

    fn column(spans: impl IntoIterator<Item = [f64; 2]>) -> Column {
        let mut column = Column {
            low: 1.0,
            high: 100.0,
            ..Column::default()
        };
        for (item, [bottom, top]) in spans.into_iter().enumerate() {
            column.add(Span {
                item,
                bottom,
                top,
                is_ground: item == 0,
            });
        }
        column
    }

    #[test]
    fn spans_that_overlap_are_kept_as_one() {
        let mut rng = SeededRng::new(1);
        for _ in 0..300 {
            let (range, thickness) = (rng.between(1.0, 100.0), rng.between(0.0, 5.0));
            let mut spans: Vec<[f64; 2]> = Vec::new();
            for _ in 0..rng.below(80) + 1 {
                let bottom = rng.between(0.0, range).floor();
                spans.push([bottom, bottom + rng.between(0.0, thickness)]);
            }
            let mut merged = column(spans.iter().copied());
            // The lowest level, on the first item or higher, with room below everything higher.
            let first = (0..spans.len()).min_by(|&i, &j| spans[i][0].total_cmp(&spans[j][0]));
            let [foot, top] = spans.swap_remove(first.unwrap());
            let is_free = |level: &f64| {
                let mut others = spans.iter();
                others.all(|[bottom, top]| bottom - level >= 2.0 || top <= level)
            };
            let tops = spans.iter().map(|span| span[1]).chain([top, 1.0]);
            let levels = tops.filter(|level| *level >= top.max(1.0)).filter(is_free);
            let wanted = levels.min_by(f64::total_cmp).unwrap();
            assert_eq!(merged.level(2.0), wanted);
            let lowest = merged.spans.first().map_or(merged.low, |span| span.bottom);
            assert_eq!(lowest, foot);
            assert_eq!(merged.spans[0].top, top);
        }
        let many = column((0..10_000).map(|item| [5.0, 6.0 + f64::from(item % 7)]));
        assert!(many.spans.capacity() <= 16, "{}", many.spans.capacity());
    }

    #[test]
    fn columns_of_many_items_are_filled_some_at_a_time() {
        let slab = |n: u32| {
            let low = DVec3::Z * f64::from(n % 1500 * 3);
            WorldBox::new(low, low + DVec3::ONE)
        };
        let slabs: Vec<WorldBox> = (0..1500).map(|n| slab(n * 7)).collect();
        let scene = Scene::from_boxes("tower", &slabs).unwrap();
        let stage = Stage {
            scene: &scene,
            bounds: scene.world_bounds(),
            count: 128,
            seed: 1,
        };
        let mut rng = stage.rng();
        let mut columns: Vec<Column> = (0..128)
            .flat_map(|_| candidates(&stage, &mut rng))
            .collect();
        // Together they would hold half as much again.
        assert!(!pierce(&stage, &mut columns));
        let held: usize = columns.iter().map(|column| column.spans.len()).sum();
        assert!((MOST_SPANS..=MOST_SPANS + 1024).contains(&held), "{held}");
        columns.iter_mut().for_each(|column| column.spans.clear());
        fill(&stage, &mut columns, 2.0);
        assert!(columns.iter().all(|column| column.ground == 1.0));
        let is_held = |column: &Column| column.spans.capacity() > 0;
        assert!(!columns.iter().any(is_held));
    }

    #[test]
    fn eyes_stand_free_and_look_level() {
        for (name, on_the_floor) in [
            ("city:n=3000", 15),
            ("rooms:n=3000", 12),
            ("forest:n=3000", 0),
        ] {
            let scene = scene::load(name, &Default::default()).unwrap();
            let path = path::load("street:frames=16", &scene, &LensDefaults::default()).unwrap();
            let mut low = 0;
            for camera in &path.cameras {
                let eye = camera.frame.eye;
                assert_eq!(camera.frame.forward().z, 0.0);
                assert_eq!(camera.lens.near(), 0.1);
                for b in &scene.items {
                    let (min, max) = b.in_world(scene.origin);
                    let near = eye.clamp(min, max);
                    assert!(near.distance(eye) > 0.2, "{name}: {eye} in {min} {max}");
                }
                let above = (eye.z - scene.world_bounds().min.z) % 3.0;
                low += u32::from(above < 2.0);
            }
            assert!(low >= on_the_floor, "{name}: {low} of 16 on the ground");
        }
    }

    #[test]
    fn in_a_forest_eyes_stand_on_the_ground() {
        let scene = scene::load("forest:n=20000", &Default::default()).unwrap();
        let path = path::load("street:frames=64", &scene, &LensDefaults::default()).unwrap();
        // Above the bottom of the ground tile below.
        let rise = |eye: DVec3| {
            let boxes = scene.items.iter().map(|b| b.in_world(scene.origin));
            let below =
                boxes.filter(|(min, max)| eye.clamp(*min, *max).truncate() == eye.truncate());
            let foot = below.map(|(min, _)| min.z).fold(f64::INFINITY, f64::min);
            eye.z - 1.7 - foot
        };
        let eyes = path.cameras.iter().map(|camera| camera.frame.eye);
        // Those on steep tiles.
        let high = eyes.filter(|eye| rise(*eye) > 8.0).count();
        assert!(high <= 6, "{high} of 64 above the ground");
        // Trees at the edge of the terrain overhang it; no eye is there.
        let mut eyes = path.cameras.iter().map(|camera| camera.frame.eye);
        let is_over = |eye: DVec3| {
            let boxes = scene.items.iter().map(|b| b.in_world(scene.origin));
            let mut below = boxes.filter(|(min, _)| min.z < eye.z);
            below.any(|(min, max)| eye.clamp(min, max).truncate() == eye.truncate())
        };
        assert!(eyes.all(is_over));
    }

    #[test]
    fn on_a_mesh_eyes_stand_on_its_triangles() {
        for name in ["mesh:terrain:n=20000", "mesh:forest:n=20000"] {
            let scene = scene::load(name, &Default::default()).unwrap();
            let path = path::load("street:frames=32", &scene, &LensDefaults::default()).unwrap();
            let mesh = scene.surfaces.as_ref().unwrap();
            let triangles = (0..mesh.items()).flat_map(|item| mesh.of(item));
            let triangles: Vec<_> = triangles.map(|t| t.map(|p| p.as_dvec3())).collect();
            let mut over = 0;
            for camera in &path.cameras {
                let eye = camera.frame.eye;
                // Heights, at the eye, of the planes of triangles above or below it.
                let heights = triangles.iter().filter_map(|[a, b, c]| {
                    let side =
                        |p: &DVec3, q: &DVec3| (q - p).truncate().perp_dot((eye - p).truncate());
                    let sides = [side(a, b), side(b, c), side(c, a)];
                    let is_within =
                        sides.iter().all(|s| *s > 0.0) || sides.iter().all(|s| *s < 0.0);
                    let normal = (b - a).cross(c - a);
                    is_within.then(|| eye.z + normal.dot(a - eye) / normal.z)
                });
                // Near the edge there may be none.
                let Some(below) = heights.filter(|z| *z <= eye.z).reduce(f64::max) else {
                    continue;
                };
                let rise = eye.z - below;
                assert!((1.7 - 1e-4..2.8).contains(&rise), "{name}: {rise}");
                over += 1;
            }
            assert!(over >= 30, "{name}: {over} of 32 above the ground");
        }
    }
}
