//! A chain: what each stage is done by. What is compared are the chain that was
//! chosen and those that differ from it in one stage.

use serde::{Deserialize, Serialize};

use super::stage::{NONE, StageKind};

/// A back end for each stage, by name.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
pub struct Chain {
    names: [String; StageKind::ALL.len()],
}

impl Chain {
    /// Nothing is done in any stage.
    pub fn empty() -> Chain {
        Chain {
            names: StageKind::ALL.map(|_| NONE.to_owned()),
        }
    }

    /// What does a stage.
    pub fn of(&self, stage: StageKind) -> &str {
        &self.names[stage as usize]
    }

    /// The same with another back end in one stage.
    pub fn with(&self, stage: StageKind, name: &str) -> Chain {
        let mut chain = self.clone();
        chain.names[stage as usize] = name.to_owned();
        chain
    }

    /// The same without a stage.
    pub fn without(&self, stage: StageKind) -> Chain {
        self.with(stage, NONE)
    }
}
