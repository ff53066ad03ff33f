//! Cut-outs: surfaces with holes, like alpha-tested textures.
//!
//! A mask is a pure function of a position on a face and needs no texture.

use serde::Serialize;

use crate::query::ItemId;
use crate::scene::{SeededRng, WorldBox, mix64};
use crate::spec::values::choice;
use crate::spec::{Spec, SpecError};
use crate::visibility::truth::{BoxHit, Probe};

named! {
    /// Pattern of the opaque parts of a surface.
    #[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize)]
    #[serde(rename_all = "lowercase")]
    pub enum Mask, MASKS {
        Fence = "fence", "four pickets in ten of a tile, and two rails";
        Foliage = "foliage", "six in ten of the cells of a grid of 8 x 8, at random";
    }
}

impl Mask {
    /// Tests whether the surface is opaque at (`u`, `v`), in tiles.
    ///
    /// The fence pattern repeats in every tile; the foliage pattern does not repeat.
    pub fn opaque(self, u: f64, v: f64) -> bool {
        match self {
            Mask::Fence => {
                let (u, v) = (u - u.floor(), v - v.floor());
                let picket = u * 5.0 - (u * 5.0).floor() < 0.4;
                picket || (0.2..0.3).contains(&v) || (0.7..0.8).contains(&v)
            }
            Mask::Foliage => {
                let cell = |x: f64| (x * 8.0).floor() as i64 as u64;
                // First constant of the hash.
                const STEP: u64 = 0x9E37_79B9_7F4A_7C15;
                let key = cell(u).wrapping_mul(STEP) ^ cell(v).rotate_left(32);
                mix64(key.wrapping_sub(STEP)) % 10 < 6
            }
        }
    }
}

/// A mask and the size of its tiles.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct TiledMask {
    /// Pattern of its opaque parts.
    pub mask: Mask,
    /// Edge length of a tile, world units; above 0.
    pub tile: f64,
}

/// The cut-outs among the items of a scene; all other items are solid.
#[derive(Clone, Default, Debug)]
pub struct AlphaMasks {
    /// Surface of each item; the items beyond its end are solid.
    pub of_item: Vec<Option<TiledMask>>,
}

impl AlphaMasks {
    /// Tests whether an item is opaque where a ray enters its box.
    ///
    /// The position on the face is computed at the rounded depth, relative to the box's lower
    /// corner, along the face's two axes in the order x, y, z.
    pub fn opaque(&self, item: ItemId, b: &WorldBox, probe: &Probe, at: &BoxHit) -> bool {
        let Some(Some(tiled)) = self.of_item.get(item as usize) else {
            return true;
        };
        let tiles = (probe.ray.at(at.depth) - b.min) / tiled.tile;
        let [u, v] = match at.axis {
            0 => [tiles.y, tiles.z],
            1 => [tiles.x, tiles.z],
            _ => [tiles.x, tiles.y],
        };
        tiled.mask.opaque(u, v)
    }
}

/// A seeded share of the items of a scene, cut out by one mask.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct CutOuts {
    /// Pattern of the opaque parts.
    pub mask: Mask,
    /// Share of the items that may be cut out, in (0, 1].
    pub share: f64,
    /// Edge length of a tile of the mask, world units; above 0.
    pub tile: f64,
    /// Seed of the choice of items.
    pub seed: u64,
}

impl CutOuts {
    /// Parses `fence`, `foliage:share=0.5,tile=2,seed=7`.
    ///
    /// # Errors
    /// An unknown mask or parameter, or a value out of range.
    pub fn parse(text: &str) -> Result<CutOuts, SpecError> {
        let mut spec = Spec::parse(text)?;
        let mask = choice("mask", &MASKS)(spec.name())?;
        let share = spec.number("share", 0.2)?;
        if !(share > 0.0 && share <= 1.0) {
            let typed = spec.text("share").unwrap_or_default();
            let message =
                format!("in '{text}': share={typed}; expected a number above 0 and at most 1");
            return Err(SpecError::new(message));
        }
        let cut_outs = CutOuts {
            mask,
            share,
            tile: spec.number_between("tile", 1.0, 0.0, f64::INFINITY)?,
            seed: spec.whole("seed", 1, 0..=u64::MAX)?,
        };
        spec.finish()?;
        Ok(cut_outs)
    }

    /// Chooses cut-outs at random among the `items` that satisfy `may_be`.
    ///
    /// The choice does not depend on the mask.
    pub fn masks(&self, items: usize, may_be: impl Fn(ItemId) -> bool) -> AlphaMasks {
        let mut rng = SeededRng::new(self.seed);
        let CutOuts { mask, tile, .. } = *self;
        let mut is_cut = |item| rng.unit() < self.share && may_be(item);
        let tiled = |item| is_cut(item).then_some(TiledMask { mask, tile });
        let of_item = (0..items as ItemId).map(tiled).collect();
        AlphaMasks { of_item }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

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
        assert_eq!(at.axis, 0);
        let mut surfaces = AlphaMasks {
            of_item: vec![None; 4],
        };
        let mut opaque = |tile: f64| {
            let mask = Mask::Fence;
            surfaces.of_item[3] = Some(TiledMask { mask, tile });
            surfaces.opaque(3, &b, &probe, &at)
        };
        // The ray enters at y = 1, z = 0: (2, 1) from the corner.
        assert_eq!(opaque(2.0), Mask::Fence.opaque(1.0, 0.5));
        assert_eq!(opaque(18.0), Mask::Fence.opaque(2.0 / 18.0, 1.0 / 18.0));
        assert!(opaque(2.0) && !opaque(18.0));
        assert!(surfaces.of_item[0].is_none());
    }

    #[test]
    fn what_is_typed_is_what_is_cut_out() {
        let typed = CutOuts::parse("foliage:share=50%,tile=2,seed=7").unwrap();
        assert_eq!((typed.mask, typed.share), (Mask::Foliage, 0.5));
        let surfaces = typed.masks(1000, |item| item % 2 == 0);
        let cut: Vec<ItemId> = (0..1000)
            .filter(|i| surfaces.of_item[*i as usize].is_some())
            .collect();
        assert!(cut.iter().all(|item| item % 2 == 0));
        assert!((200..300).contains(&cut.len()), "{}", cut.len());
        let tile = surfaces.of_item[cut[0] as usize].map(|mask| mask.tile);
        assert_eq!(tile, Some(2.0));
        let fence = CutOuts::parse("fence").unwrap();
        assert_eq!((fence.share, fence.tile, fence.seed), (0.2, 1.0, 1));
        let whole = CutOuts::parse("fence:share=1").unwrap();
        let all = whole.masks(50, |_| true);
        assert!((0..50).all(|item| all.of_item[item].is_some()));
        let other = CutOuts { seed: 8, ..typed }.masks(1000, |item| item % 2 == 0);
        assert!(
            (0..1000).any(|item| other.of_item[item].is_some() != surfaces.of_item[item].is_some())
        );
    }

    #[test]
    fn what_cannot_be_is_told() {
        for (text, wanted) in [
            ("fense", "did you mean 'fence'"),
            ("solid", "unknown mask 'solid'"),
            ("fence:share=0", "share=0; expected"),
            ("fence:share=1.1", "share=1.1; expected"),
            ("fence:tile=0", "tile is '0'; expected"),
            ("fence:seed=-1", "seed is '-1'; expected"),
            ("fence:tyle=1", "did you mean 'tile'"),
        ] {
            let error = CutOuts::parse(text).unwrap_err().to_string();
            assert!(error.contains(wanted), "{text}: {error}");
        }
    }
}
