//! Planes of a view made ready for many blocks: by numbers that stay in
//! registers, or, where a view has none to keep, by asking it as ever.

use crate::geometry::{Blade, Blades, BoxBlock, LaneMask, PlaneMask};
use crate::kernel::Isa;

use super::View;

/// Planes of a view, made ready for many blocks that no other plane is open
/// for.
pub trait Planes<I: Isa>: Copy {
    /// [`View::kept_lanes`].
    fn kept(&self, isa: I, block: &BoxBlock) -> LaneMask;

    /// Whether four blocks at once are quicker than each by itself.
    const IN_FOURS: bool;

    /// [`View::kept_of_four`].
    #[inline(always)]
    fn kept_of_four(&self, isa: I, [a, b, c, d]: &[BoxBlock; 4]) -> [LaneMask; 4] {
        [
            self.kept(isa, a),
            self.kept(isa, b),
            self.kept(isa, c),
            self.kept(isa, d),
        ]
    }

    /// Asks for the memory that this reads ahead of it.
    fn prefetch(&self, block: &BoxBlock);
}

impl<I: Isa> Planes<I> for Blade<I> {
    const IN_FOURS: bool = false;

    #[inline(always)]
    fn kept(&self, isa: I, block: &BoxBlock) -> LaneMask {
        self.admitted(isa, block)
    }
    #[inline(always)]
    fn prefetch(&self, block: &BoxBlock) {
        self.prefetch(block);
    }
}

/// Planes of a view for which nothing can be made ready.
pub struct AsEver<'v, V> {
    view: &'v V,
    mask: PlaneMask,
}

impl<V> Clone for AsEver<'_, V> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<V> Copy for AsEver<'_, V> {}

impl<'v, V: View> AsEver<'v, V> {
    /// The plane of that bit.
    #[inline(always)]
    pub fn one(view: &'v V, plane: u32) -> Self {
        let mask = 1 << plane;
        AsEver { view, mask }
    }

    /// All planes of the view.
    #[inline(always)]
    pub fn all(view: &'v V) -> Self {
        let mask = view.mask();
        AsEver { view, mask }
    }
}

impl<I: Isa, V: View> Planes<I> for AsEver<'_, V> {
    const IN_FOURS: bool = true;

    #[inline(always)]
    fn kept_of_four(&self, isa: I, blocks: &[BoxBlock; 4]) -> [LaneMask; 4] {
        self.view.kept_of_four(isa, blocks, self.mask)
    }
    #[inline(always)]
    fn kept(&self, isa: I, block: &BoxBlock) -> LaneMask {
        self.view.kept_lanes(isa, block, self.mask)
    }
    #[inline(always)]
    fn prefetch(&self, block: &BoxBlock) {
        self.view.prefetch(block, self.mask);
    }
}

impl<I: Isa> Planes<I> for Blades<I> {
    const IN_FOURS: bool = false;

    #[inline(always)]
    fn kept(&self, isa: I, block: &BoxBlock) -> LaneMask {
        self.admitted(isa, block)
    }
    #[inline(always)]
    fn prefetch(&self, block: &BoxBlock) {
        block.prefetch();
    }
}

/// What a view without numbers to keep leaves to [`AsEver`].
macro_rules! planes_as_ever {
    () => {
        type OnePlane<'v, I: Isa> = AsEver<'v, Self>;
        type AllPlanes<'v, I: Isa> = AsEver<'v, Self>;

        #[inline(always)]
        fn one_plane<I: Isa>(&self, _: I, plane: u32) -> AsEver<'_, Self> {
            AsEver::one(self, plane)
        }
        #[inline(always)]
        fn all_planes<I: Isa>(&self, _: I) -> Option<AsEver<'_, Self>> {
            Some(AsEver::all(self))
        }
    };
}
pub(super) use planes_as_ever;
