//! The stages of the funnel that cameras go through, in their order.

use serde::{Deserialize, Serialize};

use crate::visibility::Guarantee;

named! {
    /// A stage that takes what may be visible and hands on less.
    #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    #[non_exhaustive]
    pub enum StageKind {
        /// Rooms that can be seen into, and so items.
        Region = "region",
        /// Items that the frustum meets.
        Object = "object",
        /// Items that are not hidden behind others.
        Occlusion = "occlusion",
        /// Triangles of what is left that face the eye.
        Triangle = "triangle",
        /// Items that are in front at a sample.
        Fragment = "fragment",
    }
}

/// A way to do a stage.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
#[non_exhaustive]
pub struct BackEnd {
    /// The stage that it does.
    pub stage: StageKind,
    /// What is typed.
    pub name: &'static str,
    /// One line about it.
    pub summary: &'static str,
    /// What it promises.
    #[serde(serialize_with = "by_name")]
    pub guarantee: Guarantee,
    /// Whether it does the object stage as well, in one traversal.
    pub does_object_stage: bool,
}

impl BackEnd {
    /// One that does a single stage, under its name and with its summary.
    pub const fn of(
        stage: StageKind,
        [name, summary]: [&'static str; 2],
        guarantee: Guarantee,
    ) -> BackEnd {
        BackEnd {
            stage,
            name,
            summary,
            guarantee,
            does_object_stage: false,
        }
    }

    /// The row of every stage that does nothing.
    pub fn left_out(stage: StageKind) -> BackEnd {
        let declared = [NONE, "the stage is left out"];
        BackEnd::of(stage, declared, Guarantee::Conservative)
    }
}

/// A guarantee as it is written.
pub fn by_name<S: serde::Serializer>(guarantee: &Guarantee, out: S) -> Result<S::Ok, S::Error> {
    out.serialize_str(guarantee.name())
}

/// The name of doing nothing: a row of every stage.
pub const NONE: &str = "none";

impl StageKind {
    /// The stages that hand on whole items, which is what is drawn.
    pub const OF_ITEMS: [StageKind; 3] =
        [StageKind::Region, StageKind::Object, StageKind::Occlusion];

    /// What is counted at its exit.
    pub fn unit(self) -> &'static str {
        match self {
            StageKind::Triangle => "triangles",
            _ => "items",
        }
    }
}
