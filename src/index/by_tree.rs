//! What structures leave to others word by word: to the tree that they keep, or
//! to the instruction set that every processor has. Macros, because a trait's
//! default cannot know the field.

/// What a structure that is nothing but a tree (in a field `tree`) leaves to it
/// of [`super::RegionIndex`].
macro_rules! searched_by_tree {
    () => {
        fn memory(&self) -> $crate::index::MemoryUsage {
            self.tree.memory()
        }

        #[inline(always)]
        fn locate<S: $crate::query::Sink, R: $crate::query::Recorder>(
            &self,
            p: glam::Vec3,
            sink: &mut S,
            recorder: &mut R,
        ) -> std::ops::ControlFlow<()> {
            self.tree
                .query($crate::kernel::BASELINE, &p, sink, recorder)
        }

        #[inline(always)]
        fn locate_many<S: $crate::query::ManySink>(
            &self,
            points: &[glam::Vec3],
            sink: &mut S,
        ) -> std::ops::ControlFlow<()> {
            $crate::index::batch::locate_many(&self.tree, points, sink)
        }

        fn refit(&mut self, items: &[Aabb], moved: &[$crate::query::ItemId]) -> bool {
            self.tree.refit(items, moved, |_, _| ())
        }
    };
}
pub(super) use searched_by_tree;

/// [`super::FrustumQuery::visible`] for a structure that has
/// [`super::FrustumQuery::visible_by`].
macro_rules! visible_on_baseline {
    () => {
        #[inline(always)]
        fn visible<V: $crate::query::View, S: $crate::query::Sink, R: $crate::query::Recorder>(
            &self,
            view: &V,
            sink: &mut S,
            recorder: &mut R,
        ) -> std::ops::ControlFlow<()> {
            self.visible_by($crate::kernel::BASELINE, view, sink, recorder)
        }
    };
}
pub(super) use visible_on_baseline;

/// [`super::FrustumQuery`] and [`super::TreeOrder`] for a structure that has a
/// field `tree`.
macro_rules! seen_by_tree {
    ($structure:ty) => {
        impl $crate::index::FrustumQuery for $structure {
            $crate::index::by_tree::visible_on_baseline!();

            #[inline(always)]
            fn visible_by<
                I: $crate::kernel::Isa,
                V: $crate::query::View,
                S: $crate::query::Sink,
                R: $crate::query::Recorder,
            >(
                &self,
                isa: I,
                view: &V,
                sink: &mut S,
                recorder: &mut R,
            ) -> std::ops::ControlFlow<()> {
                self.tree.see(isa, view, sink, recorder)
            }

            fn tree_order(&self) -> Option<&[$crate::query::ItemId]> {
                Some(self.tree.ids())
            }
        }

        impl $crate::index::TreeOrder for $structure {
            fn ids(&self) -> &[$crate::query::ItemId] {
                self.tree.ids()
            }
        }
    };
}
pub(super) use seen_by_tree;
