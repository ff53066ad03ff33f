//! One object type for all structures, and the table they are listed in.
//! Dispatch happens once per query, never per node: behind each method stands
//! a traversal compiled for that structure, view, recorder and instruction set.

use std::ops::Range;

use glam::Vec3;
use serde_json::{Map, Value};

#[cfg(feature = "peers")]
use super::peers;
use super::{
    Bsp, BuildError, Bvh, FrustumQuery, Linear, LinearScalar, MemoryUsage, Octree, Quadtree,
    RegionIndex, Wide, caught,
};
use crate::geometry::{Aabb, ConvexVolume, PlaneTree};
use crate::kernel::{Isa, Kernel, Work};
use crate::query::{
    AnyView, ItemId, Located, ManySink, NoRecorder, QueryCost, Ranges, Recorder, View,
};
use crate::spec::{Spec, SpecError};

/// A built structure of any kind. Answers are appended to `out`.
pub trait DynIndex: Send + Sync {
    fn memory(&self) -> MemoryUsage;
    /// What a view of any kind sees. The timed path: nothing is counted.
    fn see(&self, view: AnyView<'_>, out: &mut Vec<ItemId>);
    /// What several views see, of any kinds and in any mixture: `out[i]` gets
    /// what [`DynIndex::see`] appends for `views[i]`, perhaps in another order.
    /// One query after the other, because that is the quickest, but for views
    /// that are nearly the same on the wide tree (docs/MULTI_VIEW.md).
    ///
    /// # Panics
    /// If there is not one list a view.
    fn see_many(&self, views: &[AnyView<'_>], out: &mut [Vec<ItemId>]) {
        assert_eq!(views.len(), out.len(), "one list a view");
        for (view, out) in views.iter().zip(out) {
            self.see(*view, out);
        }
    }
    /// The same query with its cost added up.
    fn see_counted(&self, view: AnyView<'_>, out: &mut Vec<ItemId>, cost: &mut QueryCost);
    /// What a convex volume sees: [`DynIndex::see`] with the usual view.
    fn visible(&self, volume: &ConvexVolume, out: &mut Vec<ItemId>) {
        self.see(volume.into(), out);
    }
    /// The same query with its cost added up.
    fn visible_counted(&self, volume: &ConvexVolume, out: &mut Vec<ItemId>, cost: &mut QueryCost) {
        self.see_counted(volume.into(), out, cost);
    }
    /// The timed path: nothing is counted.
    fn locate(&self, p: Vec3, out: &mut Vec<ItemId>);
    /// The same search with its cost added up.
    fn locate_counted(&self, p: Vec3, out: &mut Vec<ItemId>, cost: &mut QueryCost);
    /// Searches for many points at once; `out` is cleared first. The timed
    /// path.
    fn locate_many(&self, points: &[Vec3], out: &mut Located) {
        out.clear();
        let mut ids = Vec::new();
        for (&p, point) in points.iter().zip(0..) {
            ids.clear();
            self.locate(p, &mut ids);
            // The collector never breaks off.
            let _ = out.accept(point, &ids);
        }
    }
    /// See [`RegionIndex::refit`].
    fn refit(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool;
}

impl<T: FrustumQuery> DynIndex for T {
    fn memory(&self) -> MemoryUsage {
        RegionIndex::memory(self)
    }

    fn see(&self, view: AnyView<'_>, out: &mut Vec<ItemId>) {
        see(self, view, out, &mut NoRecorder);
    }

    fn see_many(&self, views: &[AnyView<'_>], out: &mut [Vec<ItemId>]) {
        assert_eq!(views.len(), out.len(), "one list a view");
        self.visible_many(views, out);
    }

    fn see_counted(&self, view: AnyView<'_>, out: &mut Vec<ItemId>, cost: &mut QueryCost) {
        see(self, view, out, cost);
    }

    fn locate(&self, p: Vec3, out: &mut Vec<ItemId>) {
        locate(self, p, out, &mut NoRecorder);
    }

    fn locate_counted(&self, p: Vec3, out: &mut Vec<ItemId>, cost: &mut QueryCost) {
        locate(self, p, out, cost);
    }

    fn locate_many(&self, points: &[Vec3], out: &mut Located) {
        out.clear();
        Kernel::chosen().run(LocateMany {
            index: self,
            points,
            out,
        });
    }

    fn refit(&mut self, items: &[Aabb], moved: &[ItemId]) -> bool {
        RegionIndex::refit(self, items, moved)
    }
}

/// A frustum query as the chosen kernel does it.
struct See<'a, T, V, R> {
    index: &'a T,
    view: &'a V,
    out: &'a mut Vec<ItemId>,
    recorder: &'a mut R,
}

impl<T: FrustumQuery, V: View, R: Recorder> Work for See<'_, T, V, R> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        // A Vec never breaks off.
        let _ = self
            .index
            .visible_by(isa, self.view, self.out, self.recorder);
    }
}

/// A frustum query for ranges as the chosen kernel does it.
struct SeeRanges<'a, T, V> {
    index: &'a T,
    view: &'a V,
    out: &'a mut Vec<Range<u32>>,
}

impl<T: FrustumQuery, V: View> Work for SeeRanges<'_, T, V> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let mut sink = Ranges::onto(self.out);
        // This sink never breaks off.
        let _ = self
            .index
            .visible_by(isa, self.view, &mut sink, &mut NoRecorder);
    }
}

/// [`TreeOrder::visible_ranges`](super::TreeOrder::visible_ranges).
pub(super) fn see_ranges<T: FrustumQuery, V: View>(index: &T, view: &V, out: &mut Vec<Range<u32>>) {
    Kernel::chosen().run(SeeRanges { index, view, out });
}

/// A region search as the chosen kernel does it.
struct Locate<'a, T, R> {
    index: &'a T,
    p: Vec3,
    out: &'a mut Vec<ItemId>,
    recorder: &'a mut R,
}

impl<T: RegionIndex, R: Recorder> Work for Locate<'_, T, R> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        // A Vec never breaks off.
        let _ = self.index.locate_by(isa, self.p, self.out, self.recorder);
    }
}

/// A batch of region searches as the chosen kernel does it.
struct LocateMany<'a, T> {
    index: &'a T,
    points: &'a [Vec3],
    out: &'a mut Located,
}

impl<T: RegionIndex> Work for LocateMany<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        // The collector never breaks off.
        let _ = self.index.locate_many_by(isa, self.points, self.out);
    }
}

/// The one place that tells views and kernels apart: a traversal of its own
/// for each.
pub(super) fn see<T: FrustumQuery, R: Recorder>(
    index: &T,
    view: AnyView<'_>,
    out: &mut Vec<ItemId>,
    recorder: &mut R,
) {
    macro_rules! ask {
        ($view:expr) => {
            Kernel::chosen().run(See {
                index,
                view: $view,
                out,
                recorder,
            })
        };
    }
    match view {
        AnyView::Volume(view) => ask!(view),
        AnyView::Spheres(view) => ask!(view),
        AnyView::Wide(view) => ask!(view),
        AnyView::Relative(view) => ask!(view),
    }
}

fn locate<T: RegionIndex, R: Recorder>(
    index: &T,
    p: Vec3,
    out: &mut Vec<ItemId>,
    recorder: &mut R,
) {
    Kernel::chosen().run(Locate {
        index,
        p,
        out,
        recorder,
    });
}

type Build = fn(&[Aabb], Option<&PlaneTree>, &Value) -> Result<Box<dyn DynIndex>, BuildError>;

/// A row of the table of structures.
pub struct Backend {
    pub name: &'static str,
    pub summary: &'static str,
    /// Builds from parameters as JSON; missing ones take their defaults.
    pub build: Build,
    /// All parameters of a request, defaults filled in.
    pub params: fn(&Value) -> Result<Value, BuildError>,
}

impl Backend {
    const fn of<T: FrustumQuery + 'static>() -> Backend {
        fn typed<T: RegionIndex>(params: &Value) -> Result<T::Params, BuildError> {
            serde_json::from_value(params.clone()).map_err(|error| BuildError::Params {
                structure: T::NAME,
                reason: match culprit::<T>(params) {
                    Some(pair) => format!("{pair}: {error}"),
                    None => error.to_string(),
                },
            })
        }
        /// The one pair that cannot be read; serde's message lacks its name.
        fn culprit<T: RegionIndex>(params: &Value) -> Option<String> {
            let bad = params.as_object()?.iter().find(|(key, value)| {
                let alone = Map::from_iter([((*key).clone(), (*value).clone())]);
                serde_json::from_value::<T::Params>(Value::Object(alone)).is_err()
            });
            bad.map(|(key, value)| format!("{key}={value}"))
        }
        Backend {
            name: T::NAME,
            summary: T::SUMMARY,
            build: |items, own_tree, params| {
                Ok(Box::new(T::build(items, own_tree, &typed::<T>(params)?)?))
            },
            params: |params| {
                let filled = typed::<T>(params)?;
                Ok(serde_json::to_value(filled).unwrap_or_default())
            },
        }
    }

    pub fn named(name: &str) -> Option<&'static Backend> {
        BACKENDS.iter().find(|b| b.name == name)
    }
}

/// All structures, in the order of the help.
pub static BACKENDS: &[Backend] = &[
    Backend::of::<LinearScalar>(),
    Backend::of::<Linear>(),
    Backend::of::<Bsp>(),
    Backend::of::<Octree>(),
    Backend::of::<Quadtree>(),
    Backend::of::<Bvh>(),
    Backend::of::<Wide>(),
    #[cfg(feature = "peers")]
    Backend::of::<peers::PeerObvhs>(),
    #[cfg(feature = "peers")]
    Backend::of::<peers::PeerObvhsTuned>(),
    #[cfg(feature = "peers")]
    Backend::of::<peers::PeerObvhsAabb>(),
    #[cfg(feature = "peers")]
    Backend::of::<peers::PeerParry3d>(),
    #[cfg(feature = "peers")]
    Backend::of::<peers::PeerParry3dAccept>(),
    #[cfg(feature = "peers")]
    Backend::of::<peers::PeerParry3dPloc>(),
    #[cfg(feature = "peers")]
    Backend::of::<peers::PeerRstar>(),
    #[cfg(feature = "peers")]
    Backend::of::<peers::PeerRstarAccept>(),
    #[cfg(feature = "peers")]
    Backend::of::<peers::PeerBvh>(),
    #[cfg(feature = "peers")]
    Backend::of::<peers::PeerBvhFlat>(),
    #[cfg(feature = "peers")]
    Backend::of::<peers::PeerBvhArena>(),
    #[cfg(feature = "peers")]
    Backend::of::<peers::PeerKiddo>(),
    #[cfg(feature = "peers")]
    Backend::of::<peers::PeerUniformGrid>(),
    #[cfg(feature = "peers")]
    Backend::of::<peers::PeerBevyStyle>(),
];

/// Whether a build with the feature `peers` has, or may have, such a row.
fn left_out(name: &str) -> bool {
    !cfg!(feature = "peers") && (name.starts_with("peer-") || name == "uniform-grid")
}

/// A structure as asked for: a backend with its parameters.
#[derive(Clone)]
pub struct StructureSpec {
    /// As typed: `bvh` or `bvh:leaf=4`.
    pub label: String,
    pub backend: &'static Backend,
    /// Complete, defaults filled in.
    pub params: Value,
}

impl StructureSpec {
    /// # Errors
    /// An unknown structure (with the nearest name), an unknown or bad
    /// parameter, or one out of range.
    pub fn parse(text: &str) -> Result<StructureSpec, SpecError> {
        let spec = Spec::parse(text)?;
        let Some(backend) = Backend::named(spec.name()) else {
            if left_out(spec.name()) {
                return Err(SpecError::new(format_args!(
                    "structure '{}' is not in this build; expected one made with `cargo build \
                     --features peers`",
                    spec.name()
                )));
            }
            let known = BACKENDS.iter().map(|b| b.name);
            return Err(SpecError::unknown("structure", spec.name(), known));
        };
        let given: Map<String, Value> = spec
            .given()
            .map(|(key, value)| {
                // Numbers and booleans as such, anything else as text.
                let parsed = serde_json::from_str(value);
                (
                    key.to_owned(),
                    parsed.unwrap_or_else(|_| Value::from(value)),
                )
            })
            .collect();
        let params = (backend.params)(&Value::Object(given)).map_err(SpecError::new)?;
        // Ranges are the build's to check: let it see no items.
        (backend.build)(&[], Some(&PlaneTree::default()), &params).map_err(SpecError::new)?;
        Ok(StructureSpec {
            label: text.to_owned(),
            backend,
            params,
        })
    }

    /// Builds over boxes that bring no partition of their own.
    ///
    /// # Errors
    /// As [`StructureSpec::build_with`].
    pub fn build(&self, items: &[Aabb]) -> Result<Box<dyn DynIndex>, BuildError> {
        self.build_with(items, None)
    }

    /// # Errors
    /// As [`RegionIndex::build`]; a panic of the structure's code.
    pub fn build_with(
        &self,
        items: &[Aabb],
        own_tree: Option<&PlaneTree>,
    ) -> Result<Box<dyn DynIndex>, BuildError> {
        let build = || (self.backend.build)(items, own_tree, &self.params);
        caught(build).unwrap_or_else(|message| Err(BuildError::Panicked { message }))
    }

    /// Brings an index up to date after items have moved: by refitting where
    /// the structure can, else by building it anew. True for a refit.
    ///
    /// # Errors
    /// A moved item with a NaN or infinite bound; the index is unchanged.
    pub fn update(
        &self,
        index: &mut Box<dyn DynIndex>,
        items: &[Aabb],
        own_tree: Option<&PlaneTree>,
        moved: &[ItemId],
    ) -> Result<bool, BuildError> {
        if let Some(&id) = moved.iter().find(|&&id| !items[id as usize].is_finite()) {
            let item = id as usize;
            return Err(BuildError::NonFiniteItem {
                item,
                bounds: items[item],
            });
        }
        if index.refit(items, moved) {
            return Ok(true);
        }
        *index = self.build_with(items, own_tree)?;
        Ok(false)
    }
}

/// The structures of a comma-separated list, or of `all`.
///
/// # Errors
/// As [`StructureSpec::parse`]; an empty list, a structure named twice.
pub fn structures(list: &str) -> Result<Vec<StructureSpec>, SpecError> {
    let mut chosen: Vec<StructureSpec> = Vec::new();
    for text in Spec::split_list(list) {
        let more = match text.as_str() {
            "all" => BACKENDS
                .iter()
                .map(|b| StructureSpec::parse(b.name))
                .collect::<Result<_, _>>()?,
            _ => vec![StructureSpec::parse(&text)?],
        };
        for spec in more {
            if chosen.iter().any(|c| c.label == spec.label) {
                return Err(SpecError::new(format_args!(
                    "structure '{}' is named twice",
                    spec.label
                )));
            }
            chosen.push(spec);
        }
    }
    if chosen.is_empty() {
        return Err(SpecError::new(
            "no structure is named; expected 'all' or a list such as linear,bvh",
        ));
    }
    Ok(chosen)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn structures_are_found_with_their_parameters() {
        let all = structures("all").unwrap();
        assert_eq!(all.len(), BACKENDS.len());
        let two = structures("bvh:leaf=4,preset=medium,linear").unwrap();
        assert_eq!(two[0].params["leaf"], 4);
        assert_eq!(two[0].params["preset"], "medium");
        assert_eq!(two[1].label, "linear");
    }

    #[test]
    fn mistakes_are_named() {
        for (text, wanted) in [
            ("bhv", "did you mean 'bvh'"),
            ("bvh:leav=4", "unknown field `leav`"),
            ("bvh:leaf=many", "leaf"),
            ("bvh:leaf=0", "leaf=0; expected 1 to 255"),
            ("bvh:preset=best", "unknown variant `best`"),
            ("bvh,bvh", "named twice"),
            ("", "no structure"),
            ("linear:leaf=3", "unknown field `leaf`"),
        ] {
            let error = structures(text)
                .err()
                .map(|e| e.to_string())
                .unwrap_or_default();
            assert!(error.contains(wanted), "{text}: {error}");
        }
    }

    #[test]
    fn items_that_cannot_be_indexed_are_named() {
        let sound = Aabb::around(Vec3::ZERO, Vec3::ONE);
        let nan = Aabb::new(Vec3::splat(f32::NAN), Vec3::ONE);
        for backend in BACKENDS {
            let spec = StructureSpec::parse(backend.name).unwrap();
            let error = spec.build(&[sound, nan]).err();
            assert!(matches!(
                error,
                Some(BuildError::NonFiniteItem { item: 1, .. })
            ));
        }
    }
}
