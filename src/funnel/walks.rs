//! The chains that a study goes through: the one that was chosen, and those that differ
//! from it in one stage.

use super::chain::Chain;
use super::pass::{Pass, Walked};
use super::stage::{NONE, StageKind};
use super::world::World;

/// The chains that are gone through: the chosen one, every back end in its place in
/// it, and the chain without each of its stages.
pub struct Walks {
    /// The chain itself.
    pub chosen: Walked,
    /// Every back end of every stage that hands on items; `none` has no step.
    pub rows: Vec<(StageKind, String, Option<usize>)>,
    /// The chain without a stage.
    pub without: Vec<(StageKind, Walked)>,
}

impl Walks {
    /// Goes through all of them; `None` if stopped.
    pub fn of(
        pass: &mut Pass,
        world: &World,
        chain: &Chain,
        stop: &dyn Fn() -> bool,
    ) -> Option<Walks> {
        let chosen = pass.walk(chain, stop)?;
        let (mut rows, mut without) = (Vec::new(), Vec::new());
        // Where occlusion is culled in a walk of its own, the frustum is part of that.
        let does_both = world.does_object_stage(chain.of(StageKind::Occlusion));
        for stage in StageKind::OF_ITEMS {
            for name in world.names(stage) {
                let step = match name.as_str() {
                    NONE => None,
                    _ => Some(pass.step(stage, &name, chosen.sets[stage as usize], stop)?),
                };
                rows.push((stage, name, step));
            }
            let is_part = does_both && stage == StageKind::Object;
            if chain.of(stage) != NONE && !is_part {
                without.push((stage, pass.walk(&chain.without(stage), stop)?));
            }
        }
        Some(Walks {
            chosen,
            rows,
            without,
        })
    }

    /// The sets before and after a row's stage.
    pub fn sets(&self, pass: &Pass, stage: StageKind, step: Option<usize>) -> [usize; 2] {
        let given = self.chosen.sets[stage as usize];
        [given, step.map_or(given, |step| pass.steps()[step].output)]
    }
}
