//! Instruction set, sink and recorder of a query as one value.

use std::ops::ControlFlow;

use super::{ItemId, Recorder, Sink};
use crate::kernel::Isa;

/// The instruction set, the sink and the recorder of a query.
pub trait Context {
    /// The instruction set.
    type Isa: Isa;
    /// The destination of answers.
    type Sink: Sink;
    /// The counters.
    type Recorder: Recorder;

    /// The instruction set.
    fn isa(&self) -> Self::Isa;

    /// The sink and the recorder, for code that needs both at once.
    fn parts(&mut self) -> (&mut Self::Sink, &mut Self::Recorder);

    /// The sink.
    #[inline(always)]
    fn sink(&mut self) -> &mut Self::Sink {
        self.parts().0
    }

    /// The recorder.
    #[inline(always)]
    fn recorder(&mut self) -> &mut Self::Recorder {
        self.parts().1
    }

    /// Passes ids to the sink; `Break` if it ends the query.
    #[inline(always)]
    fn accept(&mut self, ids: &[ItemId]) -> ControlFlow<()> {
        self.sink().accept(ids)
    }
}

/// A [`Context`] made of its three parts.
///
/// ```
/// use cullbench::geometry::Aabb;
/// use cullbench::index::{Bvh, Input, RegionIndex};
/// use cullbench::kernel::Plain;
/// use cullbench::query::{Count, QueryContext, QueryCost};
/// use glam::Vec3;
///
/// let items = [Aabb::new(Vec3::ZERO, Vec3::ONE); 3];
/// let bvh = Bvh::build(&Input::new(&items), &Default::default())?;
/// let (mut count, mut cost) = (Count::default(), QueryCost::default());
/// let mut context = QueryContext::new(Plain, &mut count, &mut cost);
/// // The volume may be a point, a box or a frustum.
/// let _ = bvh.query(&Vec3::ONE, &mut context);
/// assert_eq!(count.0, 3);
/// assert!(cost.comparisons() > 0);
/// # Ok::<(), cullbench::index::BuildError>(())
/// ```
#[derive(Debug)]
pub struct QueryContext<'q, I, S, R> {
    isa: I,
    sink: &'q mut S,
    recorder: &'q mut R,
}

impl<'q, I: Isa, S: Sink, R: Recorder> QueryContext<'q, I, S, R> {
    /// A context of its parts.
    #[inline(always)]
    pub fn new(isa: I, sink: &'q mut S, recorder: &'q mut R) -> Self {
        QueryContext {
            isa,
            sink,
            recorder,
        }
    }
}

impl<I: Isa, S: Sink, R: Recorder> Context for QueryContext<'_, I, S, R> {
    type Isa = I;
    type Sink = S;
    type Recorder = R;

    #[inline(always)]
    fn isa(&self) -> I {
        self.isa
    }

    #[inline(always)]
    fn parts(&mut self) -> (&mut S, &mut R) {
        (self.sink, self.recorder)
    }
}
