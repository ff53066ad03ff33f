//! Ground of a mesh: occluder boxes below the terrain, for what hills hide.
//!
//! An item belongs to the ground if all its triangles face up. Together these items must form a
//! height field over a rectangle: each edge occurs once in each direction, except the edges on the
//! rectangle's sides, which divide the sides without gaps. Seen from above, the triangles then have
//! the rectangle's border as their boundary, and as all have the same orientation, each point of
//! the rectangle lies below one triangle or below an edge that triangles share.
//!
//! A box whose top is nowhere above the terrain hides what is behind it from every ray that starts
//! above the terrain: a ray that enters the box has descended through the height field, over the
//! rectangle all the way, so it has met the front of a triangle.
//!
//! The boxes are not drawn for an eye above all of the ground: there they displace trees in the two
//! layers of the masked buffer (mesh:forest: 110 of 1,684 items removed instead of 190).

use std::collections::HashMap;
use std::time::Instant;

use glam::{DVec3, Vec3};
use serde::Serialize;

use crate::geometry::Aabb;
use crate::scene::{Scene, SurfaceKind, UpAxis, WorldBox};
use crate::visibility::Rays;
use crate::visibility::inner_boxes::{Cells, turn};

/// Cells along each side of the rectangle and along the height.
const CELLS: usize = 64;
/// Most boxes: each costs time in every view.
const MOST_BOXES: usize = 512;
/// Least volume that a box adds, relative to the terrain's bounding box.
const LEAST_GAIN: f64 = 1.0 / 16384.0;

/// Counts of the occluder boxes below the ground of a mesh.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct GroundStats {
    /// Items that are ground.
    pub item_count: usize,
    /// Number of boxes below the ground.
    pub box_count: usize,
    /// Volume of the boxes / volume below the ground; null for flat ground.
    ///
    /// Both volumes are measured from the lowest point of the ground. Flat ground hides nothing.
    pub volume_share: Option<f64>,
    /// Wall time of finding all boxes.
    pub build_ns: f64,
}

/// The ground and the boxes below it, scene-local.
pub struct Ground {
    /// Overlapping boxes that reach below everything else in the scene.
    pub boxes: Vec<Aabb>,
    /// Counts of the boxes.
    pub row: GroundStats,
    up: UpAxis,
    /// Triangles rotated to z up, like the fields below.
    triangles: Vec<[Vec3; 3]>,
    /// Bounds of all triangles.
    bounds: Aabb,
    origin: DVec3,
}

impl Ground {
    /// Finds the ground of a scene; `None` for a scene without ground. O(t log t).
    pub fn of(scene: &Scene) -> Option<Ground> {
        let surfaces = scene.surfaces.as_ref()?;
        let begun = Instant::now();
        let up = scene.up;
        let of_item = |item| surfaces.of(item).map(|t| t.map(|p| up.to_z_up(p) + 0.0));
        let flat = |corners: [Vec3; 3]| corners.map(|p| [p.x, p.y]);
        let items = (0..surfaces.items()).filter(|&item| {
            let mut kinds = surfaces.kinds[surfaces.range(item)].iter();
            kinds.all(|&kind| kind == SurfaceKind::Opaque)
                && !surfaces.of_item[item].is_empty()
                && of_item(item).map(flat).all(|[a, b, c]| turn(a, b, c) > 0)
        });
        let items: Vec<usize> = items.collect();
        let triangles: Vec<[Vec3; 3]> = items.iter().flat_map(|&item| of_item(item)).collect();
        let bounds = height_over(&triangles)?;
        let heights = Heights::of(&triangles, &bounds);
        let filled = heights.filled();
        let share = |cells: u32| f64::from(cells) / (CELLS as f64).powi(3);
        let below = share(filled.iter().map(|row| row.count_ones()).sum());
        let (mut boxes, mut held) = (Vec::new(), 0.0);
        let [least, extent] = [scene.bounds.min, scene.bounds.extent()].map(|v| up.to_z_up(v).z);
        let bottom = least - extent - 1.0;
        let mut cells = Cells::new(CELLS, filled);
        // All boxes start at the lowest slab of cells.
        let found = std::iter::from_fn(|| cells.next_box(0..1)).take(MOST_BOXES);
        for (count, found) in found.take_while(|(count, _)| share(*count) >= LEAST_GAIN) {
            held += share(count);
            let Aabb { min, max } = heights.to_box(found, bottom);
            boxes.push(Aabb::new(up.from_z_up(min), up.from_z_up(max)));
        }
        Some(Ground {
            row: GroundStats {
                item_count: items.len(),
                box_count: boxes.len(),
                volume_share: (held > 0.0).then(|| held / below),
                build_ns: begun.elapsed().as_nanos() as f64,
            },
            boxes,
            up,
            triangles,
            bounds,
            origin: up.to_z_up(scene.origin),
        })
    }

    /// Returns `true` if some of the ground is higher than the eye.
    ///
    /// From above all of the ground, hills hide little, and boxes all over the image displace other
    /// occluders.
    pub fn rises_above(&self, rays: &Rays) -> bool {
        let eye = self.up.to_z_up(rays.camera.frame.eye).z - self.origin.z;
        eye < f64::from(self.bounds.max.z)
    }

    /// Returns `true` if all rays are above the ground at the near plane. O(t).
    pub fn is_below(&self, rays: &Rays) -> bool {
        let near = rays.camera.lens.near();
        let corners = rays.near_corners();
        let corners = corners.map(|p| WorldBox::at(self.up.to_z_up(p) - self.origin));
        let WorldBox { min, max } = WorldBox::union_of(corners);
        // Exceeds the rounding of the corners and of the rays that start there.
        let size = min.abs().max(max.abs()).max(self.origin.abs());
        let slack =
            1e-9 * size.max_element() + 1e-6 * (max - min).max_element() + 1e-8 * near.abs();
        let (low, high) = (min - slack, max + slack);
        let [least, most] = [self.bounds.min, self.bounds.max].map(Vec3::as_dvec3);
        let is_over = low.x >= least.x && high.x <= most.x && low.y >= least.y && high.y <= most.y;
        let mut below = self.triangles.iter().filter(|corners| {
            let Aabb { min, max } = Aabb::of_points(**corners);
            let [least, most] = [min, max].map(Vec3::as_dvec3);
            most.x >= low.x && least.x <= high.x && most.y >= low.y && least.y <= high.y
        });
        is_over && below.all(|t| t.iter().all(|p| f64::from(p.z) < low.z))
    }
}

/// Bounds of triangles that all face up, if they form a height field.
fn height_over(triangles: &[[Vec3; 3]]) -> Option<Aabb> {
    let bounds = Aabb::of_points(triangles.iter().flatten().copied());
    let [low, high] = [bounds.min, bounds.max];
    let bits = |p: Vec3| p.to_array().map(f32::to_bits);
    let mut rim: HashMap<[[u32; 3]; 2], [Vec3; 2]> = HashMap::new();
    for corners in triangles {
        for k in 0..3 {
            let [from, to] = [corners[k], corners[(k + 1) % 3]];
            if rim.remove(&[bits(to), bits(from)]).is_none()
                && rim.insert([bits(from), bits(to)], [from, to]).is_some()
            {
                return None;
            }
        }
    }
    // The border edges must cover each of the four sides from end to end.
    let mut sides: [Vec<[f32; 2]>; 4] = Default::default();
    for [p, q] in rim.into_values() {
        let side = (0..4).find(|&side| {
            let (axis, bound) = (side / 2, if side % 2 == 0 { low } else { high });
            p[axis] == bound[axis] && q[axis] == bound[axis]
        })?;
        let along = 1 - side / 2;
        sides[side].push([p[along].min(q[along]), p[along].max(q[along])]);
    }
    for (side, parts) in sides.iter_mut().enumerate() {
        parts.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let along = 1 - side / 2;
        let joined = |end, part: &[f32; 2]| (part[0] == end).then_some(part[1]);
        let end = parts.iter().try_fold(low[along], joined);
        if end != Some(high[along]) {
            return None;
        }
    }
    Some(bounds)
}

/// Height of the terrain over each cell of a grid on the rectangle.
struct Heights {
    bounds: Aabb,
    /// Exact lowest height over each cell, row by row.
    least: Vec<f32>,
}

impl Heights {
    fn of(triangles: &[[Vec3; 3]], bounds: &Aabb) -> Heights {
        let mut heights = Heights {
            bounds: *bounds,
            least: vec![f32::INFINITY; CELLS * CELLS],
        };
        for &corners in triangles {
            let Aabb { min, max } = Aabb::of_points(corners);
            let [rows, columns] = [1, 0].map(|axis| heights.cells(axis, min[axis], max[axis]));
            for row in rows {
                for column in columns.clone() {
                    let least = &mut heights.least[row * CELLS + column];
                    *least = least.min(min.z);
                }
            }
        }
        heights
    }

    /// Lower bound of a cell on an axis; after the last cell the upper bound itself.
    fn edge(&self, axis: usize, cell: usize) -> f32 {
        let (low, high) = (self.bounds.min[axis], self.bounds.max[axis]);
        match cell {
            CELLS => high,
            _ => low + (high - low) * (cell as f32 / CELLS as f32),
        }
    }

    /// Cells that overlap the closed interval from `low` to `high`.
    fn cells(&self, axis: usize, low: f32, high: f32) -> std::ops::Range<usize> {
        let first = (0..CELLS).find(|cell| self.edge(axis, cell + 1) >= low);
        let last = (0..CELLS).rfind(|cell| self.edge(axis, *cell) <= high);
        first.unwrap_or(0)..last.map_or(CELLS, |last| last + 1)
    }

    /// Cells entirely below the ground: rows by z and y, one bit per cell along x.
    fn filled(&self) -> Vec<u64> {
        let (low, high) = (self.bounds.min.z, self.bounds.max.z);
        let step = (high - low) / CELLS as f32;
        let mut filled = vec![0; CELLS * CELLS];
        for (at, least) in self.least.iter().enumerate() {
            let (row, column) = (at / CELLS, at % CELLS);
            let steps = ((least - low) / step).clamp(0.0, CELLS as f32) as usize;
            for z in 0..steps {
                filled[z * CELLS + row] |= 1 << column;
            }
        }
        filled
    }

    /// Box over a block of cells, from `bottom` up to the lowest height over them.
    fn to_box(&self, [low, high]: [[usize; 3]; 2], bottom: f32) -> Aabb {
        let rows = (low[1]..high[1]).map(|row| &self.least[row * CELLS..]);
        let least = rows.flat_map(|row| &row[low[0]..high[0]]);
        let top = least.copied().fold(f32::INFINITY, f32::min);
        let corner =
            |at: [usize; 3], z: f32| Vec3::new(self.edge(0, at[0]), self.edge(1, at[1]), z);
        Aabb::new(corner(low, bottom), corner(high, top))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Lens, look_at};
    use crate::scene::{SeededRng, Surfaces, load};

    fn terrain() -> Scene {
        load("mesh:terrain:n=8000", &Default::default()).unwrap()
    }

    /// Triangles of the whole terrain.
    fn triangles() -> Vec<[Vec3; 3]> {
        let surfaces = terrain().surfaces.unwrap();
        (0..surfaces.items())
            .flat_map(|item| surfaces.of(item).collect::<Vec<_>>())
            .collect()
    }

    /// Terrain height at a point, by linear search.
    fn height(triangles: &[[Vec3; 3]], x: f64, y: f64) -> f64 {
        let of = |t: &[Vec3; 3]| {
            let [a, b, c] = t.map(Vec3::as_dvec3);
            let [p, q, r] = [[a, b], [b, c], [c, a]]
                .map(|[p, q]| (q.x - p.x) * (y - p.y) - (q.y - p.y) * (x - p.x));
            let is_over = p >= 0.0 && q >= 0.0 && r >= 0.0;
            is_over.then(|| (a.z * q + b.z * r + c.z * p) / (p + q + r))
        };
        triangles.iter().find_map(of).expect("ground everywhere")
    }

    #[test]
    fn boxes_are_below_the_ground_and_fill_it() {
        let (ground, all) = (Ground::of(&terrain()).unwrap(), triangles());
        assert!(ground.boxes.len() > 20 && ground.row.box_count == ground.boxes.len());
        let share = ground.row.volume_share.unwrap();
        assert!(share > 0.8 && share < 1.0, "{share}");
        let (mut rng, mut nearest) = (SeededRng::new(2), f64::INFINITY);
        for b in ground.boxes.iter().cycle().take(3000) {
            let p = b.min.as_dvec3() + rng.point() * b.extent().as_dvec3();
            let above = height(&all, p.x, p.y) - f64::from(b.max.z);
            assert!(above > -1e-4, "{above} {b:?}");
            nearest = nearest.min(above);
        }
        assert!(nearest < 0.5, "{nearest}");
    }

    #[test]
    fn ground_of_another_up_axis_is_the_same_ground() {
        let [z, y] = [UpAxis::Z, UpAxis::Y].map(|up| {
            let mut surfaces = Surfaces::about(up.from_z_up(DVec3::new(5.0, 6.0, 7.0)));
            for [a, b, c] in triangles() {
                let corners = [a, b, c].map(|p| up.from_z_up(p));
                surfaces.push(SurfaceKind::Opaque, false, &corners, &[[0, 1, 2]]);
            }
            let scene = surfaces.into_scene("turned").unwrap();
            let ground = Ground::of(&Scene { up, ..scene }).unwrap();
            let turned = |b: &Aabb| Aabb::new(up.to_z_up(b.min), up.to_z_up(b.max));
            let boxes: Vec<Aabb> = ground.boxes.iter().map(turned).collect();
            let middle = (ground.bounds.min + ground.bounds.max).as_dvec3() / 2.0;
            let sees = [0.4, 0.6, 0.9, 1.1].map(|height| {
                let at = DVec3::new(middle.x, middle.y, f64::from(ground.bounds.max.z) * height);
                let [eye, ahead] = [at, at + DVec3::X].map(|p| up.from_z_up(p + ground.origin));
                let lens = Lens::perspective(60.0, 1.5, 0.1, None).unwrap();
                let frame = look_at(eye, ahead, up.vector()).unwrap();
                let rays = Rays::of(&Camera { frame, lens }).unwrap();
                [ground.rises_above(&rays), ground.is_below(&rays)]
            });
            (boxes, sees)
        });
        assert!(z.1.contains(&[true, true]) && z.1.contains(&[false, true]));
        assert_eq!(z, y);
    }

    #[test]
    fn flat_ground_has_no_boxes() {
        let mut flat = Surfaces::about(DVec3::ZERO);
        let corners = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
        let corners = corners.map(|[x, y]| Vec3::new(x, y, 1.0));
        flat.push(
            SurfaceKind::Opaque,
            false,
            &corners,
            &[[0, 1, 2], [0, 2, 3]],
        );
        let row = Ground::of(&flat.into_scene("flat").unwrap()).unwrap().row;
        assert_eq!(
            (row.item_count, row.box_count, row.volume_share),
            (1, 0, None)
        );
    }

    #[test]
    fn what_is_no_height_over_a_rectangle_is_no_ground() {
        let all = triangles();
        let bounds = height_over(&all).unwrap();
        let of = |change: &dyn Fn(&mut Vec<[Vec3; 3]>)| {
            let mut changed = all.clone();
            change(&mut changed);
            height_over(&changed)
        };
        let middle = all.len() / 2;
        let without = |place: usize| {
            of(&|all| {
                all.remove(place);
            })
        };
        assert_eq!(of(&|all| all.reverse()), Some(bounds));
        assert_eq!(without(middle), None, "a hole");
        assert_eq!(without(0), None, "a corner is missing");
        assert_eq!(of(&|all| all.push(all[middle])), None, "two layers");
        assert_eq!(of(&|all| all[middle].swap(0, 1)), None, "one faces down");
        let raised = |all: &mut Vec<[Vec3; 3]>| all[middle][1].z = all[middle][1].z.next_up();
        assert_eq!(of(&raised), None, "a crack");
        let lower_half = |all: &mut Vec<[Vec3; 3]>| {
            let edge = (bounds.min.y + bounds.max.y) / 2.0;
            all.retain(|t| t.iter().all(|p| p.y <= edge));
        };
        assert!(of(&lower_half).is_some_and(|b| b.max.y < bounds.max.y));
        assert_eq!(height_over(&[]), None);
        // A forest has ground among its trees; spheres have none.
        let named = |name: &str| Ground::of(&load(name, &Default::default()).unwrap());
        let wood = named("mesh:forest:n=20k").unwrap();
        assert!(wood.row.item_count < 20 && wood.row.box_count > 20);
        assert!(named("mesh:spheres:n=20k").is_none());
        assert!(named("city:n=100").is_none());
    }

    #[test]
    fn eyes_in_the_open_are_over_the_ground_with_their_near_plane() {
        let (ground, all) = (Ground::of(&terrain()).unwrap(), triangles());
        let middle = (ground.bounds.min + ground.bounds.max).as_dvec3() / 2.0;
        let z = height(&all, middle.x, middle.y);
        let is_below = |eye: DVec3, near: f64| {
            let frame = look_at(eye, eye + DVec3::X, DVec3::Z).unwrap();
            let lens = Lens::perspective(60.0, 1.5, near, None).unwrap();
            ground.is_below(&Rays::of(&Camera { frame, lens }).unwrap())
        };
        let at = |height: f64| DVec3::new(middle.x, middle.y, z + height);
        assert!(is_below(at(2.0), 0.1));
        let rises = |height: f64| {
            let frame = look_at(at(height), middle, DVec3::X).unwrap();
            let lens = Lens::perspective(60.0, 1.5, 0.1, None).unwrap();
            ground.rises_above(&Rays::of(&Camera { frame, lens }).unwrap())
        };
        let top = f64::from(ground.bounds.max.z) - z;
        assert!(rises(top - 0.1) && !rises(top + 0.1));
        assert!(!is_below(at(-0.1), 0.01), "in the ground");
        assert!(!is_below(at(2.0), 20.0), "the near window reaches into it");
        let beside = DVec3::new(f64::from(ground.bounds.min.x) - 1.0, middle.y, z + 100.0);
        assert!(!is_below(beside, 0.1), "beside the ground");
        assert!(is_below(beside + DVec3::X * 2.0, 0.1));
        let frame = look_at(at(100.0), at(0.0), DVec3::X).unwrap();
        let down = |near: f64| Camera {
            frame,
            lens: Lens::orthographic(8.0, 1.0, near, 300.0).unwrap(),
        };
        assert!(ground.is_below(&Rays::of(&down(0.0)).unwrap()));
        assert!(!ground.is_below(&Rays::of(&down(120.0)).unwrap()));
    }
}
