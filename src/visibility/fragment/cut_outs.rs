//! Cut-outs of a scene as typed: the share of items with holes, and their mask.

use std::fmt::{self, Display, Formatter};

use super::mask::{Holes, MASKS, Mask, Surface};
use crate::query::ItemId;
use crate::scene::SeededRng;
use crate::spec::{Spec, SpecError};

/// A seeded share of the items of a scene, cut out by one mask.
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub struct CutOuts {
    /// Pattern of their opaque parts.
    pub mask: Mask,
    /// Share of the items that may be cut out, in (0, 1].
    pub share: f64,
    /// Edge length of a tile of the mask, world units; above 0.
    pub tile: f64,
    /// Seed of the choice of items.
    pub seed: u64,
}

/// The text as typed.
impl Display for CutOuts {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let CutOuts {
            mask,
            share,
            tile,
            seed,
        } = self;
        write!(f, "{}:share={share},tile={tile},seed={seed}", mask.name())
    }
}

impl CutOuts {
    /// Parses `fence`, `foliage:share=0.5,tile=2,seed=7`.
    ///
    /// # Errors
    /// A mask or a parameter that is not known, a value out of range.
    pub fn parse(text: &str) -> Result<CutOuts, SpecError> {
        let mut spec = Spec::parse(text)?;
        let Some(&(mask, ..)) = MASKS.iter().find(|(_, name, _)| *name == spec.name()) else {
            let names = MASKS.iter().map(|(_, name, _)| *name);
            return Err(SpecError::unknown("mask", spec.name(), names));
        };
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
            seed: spec.whole("seed", 1, u64::MAX)?,
        };
        spec.finish()?;
        Ok(cut_outs)
    }

    /// The cut-outs among `items`, drawn from those that `may_be`.
    ///
    /// They are the same items whatever the mask.
    pub fn holes(&self, items: usize, may_be: impl Fn(ItemId) -> bool) -> Holes {
        let (mut rng, mut holes) = (SeededRng::new(self.seed), Holes::default());
        let CutOuts { mask, tile, .. } = *self;
        for item in 0..items as ItemId {
            if rng.unit() < self.share && may_be(item) {
                holes.set(item, Surface { mask, tile });
            }
        }
        holes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_typed_is_what_is_cut_out() {
        let typed = CutOuts::parse("foliage:share=50%,tile=2,seed=7").unwrap();
        assert_eq!((typed.mask, typed.share), (Mask::Foliage, 0.5));
        let surfaces = typed.holes(1000, |item| item % 2 == 0);
        let cut: Vec<ItemId> = (0..1000).filter(|i| surfaces.of(*i).is_some()).collect();
        assert!(cut.iter().all(|item| item % 2 == 0));
        assert!((200..300).contains(&cut.len()), "{}", cut.len());
        let tile = surfaces.of(cut[0]).map(|surface| surface.tile);
        assert_eq!(tile, Some(2.0));
        let fence = CutOuts::parse("fence").unwrap();
        assert_eq!((fence.share, fence.tile, fence.seed), (0.2, 1.0, 1));
        let whole = CutOuts::parse("fence:share=1").unwrap();
        let all = whole.holes(50, |_| true);
        assert!((0..50).all(|item| all.of(item).is_some()));
        let other = CutOuts { seed: 8, ..typed }.holes(1000, |item| item % 2 == 0);
        assert!((0..1000).any(|item| other.of(item).is_some() != surfaces.of(item).is_some()));
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
