//! Stages of the funnel in their order, their back ends, and chains of these.

use serde::{Deserialize, Serialize};

use crate::visibility::Guarantee;

named! {
    /// A stage that takes candidates and returns fewer of them.
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
        /// Triangles of the remaining items that face the eye.
        Triangle = "triangle",
        /// Items that are in front at a sample.
        Fragment = "fragment",
    }
}

impl StageKind {
    /// The stages that return whole items, which are then drawn.
    pub const OF_ITEMS: [StageKind; 3] =
        [StageKind::Region, StageKind::Object, StageKind::Occlusion];

    /// Unit of the counts at the exit of the stage.
    pub fn unit(self) -> &'static str {
        match self {
            StageKind::Triangle => "triangles",
            _ => "items",
        }
    }
}

/// Name of the row of every stage that removes nothing.
pub const NONE: &str = "none";

/// A way to do a stage.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct BackEnd {
    /// The stage that it does.
    pub stage: StageKind,
    /// Name on the command line.
    pub name: &'static str,
    /// One line about it.
    pub summary: &'static str,
    /// Declared guarantee of its answers.
    pub guarantee: Guarantee,
    /// `true` if it does the object stage as well, in one traversal.
    pub does_object_stage: bool,
}

impl BackEnd {
    /// A back end of a single stage.
    pub const fn new(
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
}

/// A stage of whole items and the name of its back end.
pub type Step = (StageKind, String);

/// A back end for each stage, by name.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
pub struct Chain {
    names: [String; StageKind::ALL.len()],
}

impl Chain {
    /// The chain that leaves out every stage.
    pub fn empty() -> Chain {
        Chain {
            names: StageKind::ALL.map(|_| NONE.to_owned()),
        }
    }

    /// Name of the back end of a stage.
    pub fn of(&self, stage: StageKind) -> &str {
        &self.names[stage as usize]
    }

    /// The same chain with another back end in one stage.
    pub fn with(mut self, stage: StageKind, name: &str) -> Chain {
        name.clone_into(&mut self.names[stage as usize]);
        self
    }

    /// The stages of whole items before `end` that the chain does not leave out.
    pub fn steps_before(&self, end: StageKind) -> Vec<Step> {
        let stages = StageKind::OF_ITEMS.into_iter().filter(|stage| *stage < end);
        let steps = stages.map(|stage| (stage, self.of(stage).to_owned()));
        steps.filter(|(_, name)| name != NONE).collect()
    }

    /// The stages of whole items up to one that another back end does.
    pub fn steps_with(&self, stage: StageKind, name: &str) -> Vec<Step> {
        let mut steps = self.steps_before(stage);
        if name != NONE {
            steps.push((stage, name.to_owned()));
        }
        steps
    }

    /// Returns `true` if a stage is timed by itself.
    ///
    /// The object stage is not where the occlusion stage does both.
    pub fn is_separate(&self, stage: StageKind) -> bool {
        stage != StageKind::Object || self.of(StageKind::Occlusion) == NONE
    }

    /// All stages of whole items that the chain does not leave out.
    pub fn steps(&self) -> Vec<Step> {
        self.steps_before(StageKind::Triangle)
    }
}
