//! What a query is made of: the ids it answers with, the region or the view it
//! asks about, where answers go (sinks) and what is counted on the way (recorders). No
//! structure and no geometry of its own lives here.

mod many;
mod planes;
mod recorder;
mod region;
mod sink;
mod view;

pub use many::{Located, ManySink};
pub use planes::{AsEver, Planes};
pub use recorder::{NoRecorder, QueryCost, Recorder};
pub use region::{Containment, Region};
pub(crate) use sink::Ranges;
pub use sink::{Count, First, Sink, Tests, runs};
pub use view::{AnyView, View};

/// An item's number: its zero-based place in the scene.
pub type ItemId = u32;
