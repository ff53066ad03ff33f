//! Cut-outs: surfaces with holes, as textures with an alpha-test have them. A mask
//! is a pure function of a place on a face; it needs no texture.

use glam::DVec3;

use crate::query::ItemId;
use crate::scene::WorldBox;
use crate::visibility::truth::{Crossing, Probe};

named! {
    /// Pattern of the opaque parts of a surface.
    #[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
    #[non_exhaustive]
    pub enum Mask, MASKS {
        Fence = "fence", "four pickets in ten of a tile, and two rails";
        Foliage = "foliage", "six in ten of the cells of a grid of 8 x 8, at random";
    }
}

impl Mask {
    /// Tests whether the surface is opaque at a place, in tiles: the pattern of a fence
    /// repeats with each, that of foliage never.
    pub fn opaque(self, u: f64, v: f64) -> bool {
        match self {
            Mask::Fence => {
                let (u, v) = (u - u.floor(), v - v.floor());
                let picket = u * 5.0 - (u * 5.0).floor() < 0.4;
                picket || (0.2..0.3).contains(&v) || (0.7..0.8).contains(&v)
            }
            Mask::Foliage => {
                let cell = |x: f64| (x * 8.0).floor() as i64 as u64;
                // SplitMix64 (Steele, Lea, Flood 2014) of the cell.
                let mut z = cell(u).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ cell(v).rotate_left(32);
                z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
                z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
                (z ^ z >> 31) % 10 < 6
            }
        }
    }
}

/// A mask and the size of its tiles.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Surface {
    /// Its opaque parts.
    pub mask: Mask,
    /// Edge length of a tile, world units; above 0.
    pub tile: f64,
}

/// The cut-outs among the items of a scene; all other items are solid.
#[derive(Clone, Default, Debug)]
pub struct Holes {
    /// Surface of each item; the items beyond its end are solid.
    of_item: Vec<Option<Surface>>,
}

impl Holes {
    /// Cuts an item out.
    pub fn set(&mut self, item: ItemId, surface: Surface) {
        let item = item as usize;
        if self.of_item.len() <= item {
            self.of_item.resize(item + 1, None);
        }
        self.of_item[item] = Some(surface);
    }

    /// The cut-outs among some of the items, renumbered in this order.
    pub fn some(&self, items: &[ItemId]) -> Holes {
        let of_item = items.iter().map(|&item| self.of(item).copied());
        Holes {
            of_item: of_item.collect(),
        }
    }

    /// Number of cut-outs.
    pub fn count(&self) -> usize {
        self.of_item.iter().flatten().count()
    }

    /// The surface of an item, `None` if it is solid.
    #[inline]
    pub fn of(&self, item: ItemId) -> Option<&Surface> {
        self.of_item.get(item as usize)?.as_ref()
    }

    /// Tests whether an item is opaque where a ray enters it. The place on the face is
    /// that of the rounded depth, counted from the box's lower corner along the
    /// two axes of the face, in the order x, y, z.
    pub fn opaque(&self, item: ItemId, b: &WorldBox, probe: &Probe, at: &Crossing) -> bool {
        let Some(surface) = self.of(item) else {
            return true;
        };
        let place = (probe.ray().at(at.depth) - b.min) / surface.tile;
        let [u, v] = match face_axis(b, probe, at) {
            0 => [place.y, place.z],
            1 => [place.x, place.z],
            _ => [place.x, place.y],
        };
        surface.mask.opaque(u, v)
    }
}

/// The axis that the entered face is perpendicular to: its plane is the one that is
/// crossed, and of two such the one nearer to where the ray is.
fn face_axis(b: &WorldBox, probe: &Probe, at: &Crossing) -> usize {
    let ray = probe.ray();
    let place = ray.at(at.depth);
    let side = |axis: usize| match ray.direction[axis] > 0.0 {
        true => b.min[axis],
        false => b.max[axis],
    };
    let off = DVec3::from([0, 1, 2].map(|axis| (place[axis] - side(axis)).abs()));
    let crossed = (0..3).filter(|&axis| ray.direction[axis] != 0.0 && side(axis) == at.plane);
    crossed
        .min_by(|&a, &b| off[a].total_cmp(&off[b]))
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_are_opaque_where_they_say() {
        let share = |mask: Mask| {
            let at = |i: u32| (f64::from(i) + 0.5) / 400.0 * 6.0;
            let places = (0..160_000).map(|i| (at(i % 400), at(i / 400)));
            let opaque = places.filter(|&(u, v)| mask.opaque(u, v)).count();
            opaque as f64 / 160_000.0
        };
        // Pickets, and the rails between them.
        assert!((share(Mask::Fence) - (0.4 + 0.6 * 0.2)).abs() < 0.01);
        assert!((share(Mask::Foliage) - 0.6).abs() < 0.03);
        assert!(Mask::Fence.opaque(0.01, 0.5) && !Mask::Fence.opaque(0.1, 0.5));
        assert_eq!(
            Mask::Fence.opaque(-0.99, 0.5),
            Mask::Fence.opaque(0.01, 0.5)
        );
    }

    #[test]
    fn places_on_a_face_are_counted_from_the_lower_corner() {
        use crate::visibility::Ray;
        let b = WorldBox::new(DVec3::new(4.0, -1.0, -1.0), DVec3::new(6.0, 3.0, 3.0));
        let probe = Probe::new(Ray {
            origin: DVec3::ZERO,
            direction: DVec3::new(1.0, 0.25, 0.0),
            near: 0.0,
            far: f64::INFINITY,
        });
        let at = probe.enter(&b, f64::INFINITY).unwrap();
        assert_eq!(face_axis(&b, &probe, &at), 0);
        let mut surfaces = Holes::default();
        let mut opaque = |tile: f64| {
            let mask = Mask::Fence;
            surfaces.set(3, Surface { mask, tile });
            surfaces.opaque(3, &b, &probe, &at)
        };
        // It enters at y = 1, z = 0: (2, 1) from the corner.
        assert_eq!(opaque(2.0), Mask::Fence.opaque(1.0, 0.5));
        assert_eq!(opaque(18.0), Mask::Fence.opaque(2.0 / 18.0, 1.0 / 18.0));
        assert!(opaque(2.0) && !opaque(18.0));
        assert!(surfaces.of(0).is_none());
    }
}
