//! The rules of omission, one file each. A rule comes to its statistic and
//! threshold and makes both sides of itself ready to be asked; who decides, and
//! how, is `omission`'s.

mod cones;
mod f64_kernel;
mod flat;
mod frame_correction;
mod hidden;
mod needless_planes;
mod no_index;
mod occlusion;
mod plane_masks;
mod rebasing;
mod rebuild;
mod regions;
mod six_planes;
mod sorting;

pub(super) use six_planes::follow as follow_test;

use super::AdviseError;
use super::case::Case;
use super::omission::Draft;

/// A row of the table of rules.
pub(super) struct Rule {
    pub name: &'static str,
    pub prepare: for<'c> fn(&'c Case<'c>) -> Result<Draft<'c>, AdviseError>,
}

pub(super) const RULES: &[Rule] = &[
    Rule {
        name: needless_planes::NAME,
        prepare: needless_planes::prepare,
    },
    Rule {
        name: plane_masks::NAME,
        prepare: plane_masks::prepare,
    },
    Rule {
        name: no_index::NAME,
        prepare: no_index::prepare,
    },
    Rule {
        name: six_planes::NAME,
        prepare: six_planes::prepare,
    },
    Rule {
        name: regions::NAME,
        prepare: regions::prepare,
    },
    Rule {
        name: occlusion::NAME,
        prepare: occlusion::prepare,
    },
    Rule {
        name: occlusion::BUFFER_NAME,
        prepare: occlusion::prepare_buffer,
    },
    Rule {
        name: cones::NAME,
        prepare: cones::prepare,
    },
    Rule {
        name: sorting::NAME,
        prepare: sorting::prepare,
    },
    Rule {
        name: flat::NAME,
        prepare: flat::prepare,
    },
    Rule {
        name: rebasing::NAME,
        prepare: rebasing::prepare,
    },
    Rule {
        name: rebuild::NAME,
        prepare: rebuild::prepare,
    },
    Rule {
        name: f64_kernel::NAME,
        prepare: f64_kernel::prepare,
    },
    Rule {
        name: frame_correction::NAME,
        prepare: frame_correction::prepare,
    },
];
