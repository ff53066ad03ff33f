//! What a structure that is nothing but a tree (in a field `tree`) leaves to it
//! of [`super::RegionIndex`]. A macro, because a trait's default cannot know the
//! field.

/// All of [`super::RegionIndex`] but declaration and build.
macro_rules! answered_by_tree {
    () => {
        fn memory(&self) -> $crate::index::MemoryUsage {
            self.tree.memory()
        }

        #[inline(always)]
        fn query<Q: $crate::query::QueryVolume, C: $crate::query::Context>(
            &self,
            volume: &Q,
            cx: &mut C,
        ) -> std::ops::ControlFlow<()> {
            self.tree.query(volume, cx)
        }

        #[inline(always)]
        fn query_many<I: $crate::kernel::Isa, S: $crate::query::ManySink>(
            &self,
            isa: I,
            points: &[glam::Vec3],
            sink: &mut S,
        ) -> std::ops::ControlFlow<()> {
            $crate::index::batch::query_many(isa, &self.tree, points, sink)
        }

        fn refit(&mut self, items: &[Aabb], moved: &[$crate::query::ItemId]) -> bool {
            self.tree.refit(items, moved, |_, _| ())
        }

        fn tree_order(&self) -> Option<&[$crate::query::ItemId]> {
            Some(self.tree.ids())
        }
    };
}
pub(super) use answered_by_tree;
