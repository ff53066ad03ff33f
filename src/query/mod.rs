//! Parts of a query: its volume, the ids of its answer, and its context.
//!
//! A context has a sink, a recorder and an instruction set.

mod context;
mod dispatched;
mod many;
mod predicate;
mod recorder;
mod sink;
mod volume;

pub use crate::geometry::Planes;
pub(crate) use crate::geometry::Sorted;
pub use context::{Context, QueryContext};
pub(crate) use dispatched::Dispatched;
pub use many::Located;
pub(crate) use predicate::{Bits, plane_test};
pub use predicate::{Containment, Predicate};
pub use recorder::{NoRecorder, QueryCost, Recorder};
pub(crate) use sink::runs;
pub use sink::{Count, Ranges, Sink, Tests};
pub(crate) use volume::each_volume;
pub use volume::{AnyVolume, QueryVolume};

/// An item's number: its zero-based index in the scene.
pub type ItemId = u32;

/// Every value once, ascending.
pub(crate) fn distinct<T: Ord>(mut values: Vec<T>) -> Vec<T> {
    values.sort_unstable();
    values.dedup();
    values
}
