//! Faces that many boxes share, as those of a tiling: few coordinates an axis. Then a
//! point is asked for as an f32 that lies to every stored face as the point itself lies
//! to that face as written, and no answer needs a second look.
//!
//! A face `v` is stored as an f32 less than one step of f32 below it where it bounds a
//! box from below, and above it where from above. The f32 next to a point is less than
//! one step from the point. So it lies to the stored face as the point to `v` does if
//! three steps or more are between the two. A table says for each f32 which face is
//! nearer than that: on the face as written a point becomes the lower one of the stored
//! two, beside it an f32 on the same side of these.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use glam::{DVec3, Vec3};

use super::WorldBox;
use super::side::side;
use crate::geometry::Aabb;

/// Coordinates of one axis: with more the boxes share hardly any.
const MOST: usize = 1 << 14;
/// Bits for a coordinate: about two of them are set, and what is not near a face seldom
/// meets one.
const BITS_EACH: usize = 64;
/// Bits that share an entry of the table.
const BITS_OF_ENTRY: usize = 2;
/// In the table, where more than one face is near.
const SEVERAL: u16 = u16::MAX;

/// The faces of all boxes.
#[derive(Clone, Debug)]
pub(super) struct SharedFaces {
    axes: [Axis; 3],
}

#[derive(Clone, Debug)]
struct Axis {
    /// Ascending; behind them [`Face::NONE`].
    faces: Vec<Face>,
    /// Whether an f32 may be near a face, by [`Axis::bit`].
    near: Vec<u64>,
    /// Which face that is, for every few bits.
    which: Vec<u16>,
}

/// A face as written, and where f32 has it.
#[derive(Clone, Copy, Debug)]
struct Face {
    written: f64,
    /// The least and the greatest f32 that a coordinate becomes: no number, above the
    /// face, below it, on it.
    within: [[f32; 2]; 4],
}

impl Face {
    /// Beside which nothing is moved.
    const NONE: Face = Face {
        written: f64::NAN,
        within: [[f32::NEG_INFINITY, f32::INFINITY]; 4],
    };

    /// A face that is stored as these, ascending.
    fn new(written: f64, [least, greatest]: [f32; 2]) -> Face {
        let [any, ..] = Face::NONE.within;
        let above = [greatest.next_up(), f32::INFINITY];
        let below = [f32::NEG_INFINITY, least.next_down()];
        Face {
            written,
            within: [any, above, below, [least; 2]],
        }
    }

    /// The f32 next to a coordinate, moved to its side of the face. Near a face either
    /// side is as likely, so the sides are looked up: a jump would often be guessed
    /// wrong.
    #[inline(always)]
    fn moved(&self, world: f64, local: f32) -> f32 {
        let side = usize::from(world >= self.written) + 2 * usize::from(world <= self.written);
        let [least, greatest] = self.within[side];
        let local = if greatest < local { greatest } else { local };
        if least > local { least } else { local }
    }
}

/// What a coordinate is stored as: of a lower bound, of an upper bound.
type Stored = [Option<f32>; 2];

impl SharedFaces {
    /// Of boxes as written (without any, the sums of origin and stored ones) and as
    /// stored about an origin; `None` if they share too little, or f32 cannot tell
    /// two faces apart. O(n), and O(1) where little is shared.
    pub fn of(written: Option<&[WorldBox]>, stored: &[Aabb], origin: DVec3) -> Option<SharedFaces> {
        let mut axes: [HashMap<u64, Stored>; 3] = Default::default();
        for (n, stored) in stored.iter().enumerate() {
            let [low, high] = match written {
                Some(written) => [written[n].min, written[n].max],
                None => [stored.min, stored.max].map(|corner| origin + corner.as_dvec3()),
            };
            for (k, faces) in axes.iter_mut().enumerate() {
                let sides = [(low[k], stored.min[k]), (high[k], stored.max[k])];
                for (from, (written, stored)) in sides.into_iter().enumerate() {
                    let are_many = faces.len() >= MOST;
                    // One zero for both.
                    let seen = match faces.entry((written + 0.0).to_bits()) {
                        Entry::Occupied(seen) => seen.into_mut(),
                        Entry::Vacant(_) if are_many => return None,
                        Entry::Vacant(new) => new.insert([None; 2]),
                    };
                    if *seen[from].get_or_insert(stored) != stored {
                        return None;
                    }
                }
            }
        }
        let [x, y, z] = axes;
        let is_stored = written.is_none();
        let axis = |faces, k: usize| Axis::of(faces, origin[k], is_stored);
        Some(SharedFaces {
            axes: [axis(x, 0)?, axis(y, 1)?, axis(z, 2)?],
        })
    }

    /// The point that indexes are to be asked for, of one in the world and the f32
    /// next to it in the scene. Most points are near no face, which one test decides.
    #[inline]
    pub fn moved(&self, world: DVec3, local: Vec3) -> Vec3 {
        let [x, y, z] = &self.axes;
        let bits = [x.bit(local.x), y.bit(local.y), z.bit(local.z)];
        match x.is_near(bits[0]) | y.is_near(bits[1]) | z.is_near(bits[2]) {
            false => local,
            true => self.beside(bits, world, local),
        }
    }

    #[inline(always)]
    fn beside(&self, bits: [usize; 3], world: DVec3, local: Vec3) -> Vec3 {
        let [x, y, z] = &self.axes;
        Vec3::new(
            x.moved(bits[0], world.x, local.x),
            y.moved(bits[1], world.y, local.y),
            z.moved(bits[2], world.z, local.z),
        )
    }
}

impl Axis {
    fn of(faces: HashMap<u64, Stored>, origin: f64, is_stored: bool) -> Option<Axis> {
        let mut faces: Vec<(f64, Stored)> = faces
            .into_iter()
            .map(|(bits, stored)| (f64::from_bits(bits), stored))
            .collect();
        faces.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        // Rounded outward by less than a step, or not at all.
        let is_tight = |&(written, [low, high]): &(f64, Stored)| {
            let lies = |stored: f32| side(written, origin, stored);
            let low_is = low.is_none_or(|low| lies(low) >= 0 && lies(low.next_up()) < 0);
            let high_is = high.is_none_or(|high| lies(high) <= 0 && lies(high.next_down()) > 0);
            let both = [low, high].into_iter().flatten();
            low_is && high_is && (!is_stored || both.into_iter().all(|stored| lies(stored) == 0))
        };
        let ends = |&(_, [low, high]): &(f64, Stored)| {
            let least = low.or(high).unwrap_or(f32::NAN);
            [least, high.or(low).unwrap_or(f32::NAN)]
        };
        let stored: Vec<[f32; 2]> = faces.iter().map(ends).collect();
        let apart = |pair: &[[f32; 2]]| pair[0][1].next_up() < pair[1][0];
        if !faces.iter().all(is_tight) || !stored.windows(2).all(apart) {
            return None;
        }
        let none = faces.len() as u16;
        let bits = (faces.len() * BITS_EACH).next_power_of_two().max(64);
        let of_stored = faces.iter().zip(&stored);
        let of_stored = of_stored.map(|(face, &stored)| Face::new(face.0, stored));
        let mut axis = Axis {
            faces: of_stored.chain([Face::NONE]).collect(),
            near: vec![0; bits / 64],
            which: vec![none; bits / BITS_OF_ENTRY],
        };
        for (at, &[least, greatest]) in (0..).zip(&stored) {
            let mut x = least.next_down().next_down();
            while x <= greatest.next_up().next_up() {
                // The bits of the two zeros are far apart.
                for x in if x == 0.0 { [0.0, -0.0] } else { [x, x] } {
                    let bit = axis.bit(x);
                    axis.near[bit / 64] |= 1 << (bit % 64);
                    let which = &mut axis.which[bit / BITS_OF_ENTRY];
                    *which = match *which {
                        known if known == none || known == at => at,
                        _ => SEVERAL,
                    };
                }
                if x == f32::INFINITY {
                    break;
                }
                x = x.next_up();
            }
        }
        Some(axis)
    }

    /// Eight neighbours share a bit.
    #[inline(always)]
    fn bit(&self, x: f32) -> usize {
        let hash = u64::from(x.to_bits() >> 3).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32;
        hash as usize & (64 * self.near.len() - 1)
    }

    #[inline(always)]
    fn is_near(&self, bit: usize) -> bool {
        self.near[bit / 64] >> (bit % 64) & 1 != 0
    }

    #[inline(always)]
    fn moved(&self, bit: usize, world: f64, local: f32) -> f32 {
        match self.which[bit / BITS_OF_ENTRY] {
            SEVERAL => self.among(world, local),
            at => self.faces[usize::from(at)].moved(world, local),
        }
    }

    /// Beside the two faces that a coordinate lies between.
    #[cold]
    fn among(&self, world: f64, local: f32) -> f32 {
        let faces = &self.faces[..self.faces.len() - 1];
        let at = faces.partition_point(|face| face.written < world);
        let [before, after] =
            [at.wrapping_sub(1), at].map(|at| *faces.get(at).unwrap_or(&Face::NONE));
        after.moved(world, before.moved(world, local))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Scene, SeededRng};

    /// Walls in ascending order, about `zero`.
    fn walls(rng: &mut SeededRng, zero: f64, step: f64, count: usize) -> Vec<f64> {
        let mut at = zero - step * count as f64 / 2.0;
        let mut next = || {
            at += step * [1.0, 0.25, rng.between(0.1, 2.0)][rng.below(3)];
            at
        };
        (0..count).map(|_| next()).collect()
    }

    /// A box between any two walls of each axis.
    fn any_box(rng: &mut SeededRng, walls: &[Vec<f64>; 3]) -> WorldBox {
        let mut ends = [[0.0; 2]; 3];
        for (walls, ends) in walls.iter().zip(&mut ends) {
            let from = rng.below(walls.len() - 1);
            let to = from + 1 + rng.below((walls.len() - from - 1).min(3));
            *ends = [walls[from], walls[to]];
        }
        let corner = |side: usize| DVec3::from(ends.map(|ends| ends[side]));
        WorldBox::new(corner(0), corner(1))
    }

    /// On a wall, some steps of f64 or of f32 beside it, or anywhere.
    fn beside(rng: &mut SeededRng, wall: f64, origin: f64) -> f64 {
        let local = (wall - origin) as f32;
        let step = f64::from(local.abs().next_up()) - f64::from(local.abs());
        match rng.below(4) {
            0 => wall,
            1 => [wall.next_up(), wall.next_down()][rng.below(2)],
            2 => wall + step * rng.between(-4.0, 4.0),
            _ => wall + step * (rng.below(17) as f64 - 8.0) / 2.0,
        }
    }

    /// The judge compares f64 as written with f64 as written.
    #[test]
    fn a_moved_point_is_in_the_stored_boxes_that_hold_it_as_written() {
        let mut rng = SeededRng::new(18);
        let (mut asked, mut differ, mut without) = (0, 0, 0);
        for world in 0..120 {
            let zero = [0.0, 0.3, -7e3, 6.4e6 + 0.1, 1e9 + 0.7, 1e-38][rng.below(6)];
            let step = [1.0, 0.1, 5.75, 1e-40, 3e5][rng.below(5)];
            let axes = [(); 3].map(|()| walls(&mut rng, zero, step, 12));
            let boxes: Vec<_> = (0..40).map(|_| any_box(&mut rng, &axes)).collect();
            let own = DVec3::splat([0.0, zero, zero.round()][rng.below(3)]);
            let Ok(scene) = Scene::about("walls", &boxes, own) else {
                continue;
            };
            for _ in 0..400 {
                let at = |k: usize, rng: &mut SeededRng| {
                    let wall = axes[k][rng.below(12)];
                    beside(rng, wall, own[k])
                };
                let p = DVec3::new(at(0, &mut rng), at(1, &mut rng), at(2, &mut rng));
                let sought = scene.sought(p);
                let Some(moved) = scene.moved(&sought) else {
                    without += 1;
                    continue;
                };
                for (b, stored) in boxes.iter().zip(&scene.items) {
                    let holds = p.cmpge(b.min).all() && p.cmple(b.max).all();
                    assert_eq!(stored.contains_point(moved), holds, "{world}: {p:?} {b:?}");
                    differ += usize::from(stored.contains_point(sought.local) != holds);
                    asked += 1;
                }
            }
        }
        assert!(
            asked > 500_000 && differ > 10_000 && without > 1000,
            "{asked} {differ} {without}"
        );
    }

    #[test]
    fn boxes_that_share_nothing_have_no_table() {
        let mut rng = SeededRng::new(1);
        let mut random = |_| WorldBox::around(rng.point() * 1e3, DVec3::ONE);
        let boxes: Vec<_> = (0..MOST).map(&mut random).collect();
        let scene = Scene::from_boxes("random", &boxes).unwrap();
        assert!(scene.moved(&scene.sought(DVec3::ZERO)).is_none());
        let scene = Scene::from_boxes("few", &boxes[..100]).unwrap();
        assert!(scene.moved(&scene.sought(DVec3::NAN)).unwrap().is_nan());
    }
}
