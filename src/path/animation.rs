//! The camera that the animation of a scene's file moves, at even times.

use super::{PathError, Pose, Stage, places};
use crate::spec::Spec;

pub(super) fn frames(stage: &Stage, _: &mut Spec) -> Result<Vec<Pose>, PathError> {
    let unfit = |reason: String| PathError::unfit("animation", reason);
    let Some(animation) = &stage.scene.animation else {
        let name = &stage.scene.name;
        return Err(unfit(format!(
            "scene '{name}' has no animated camera; expected a glTF file with one"
        )));
    };
    let [first, last] = animation.seconds;
    let step = (last - first) / stage.count.saturating_sub(1).max(1) as f64;
    let times = (0..stage.count).map(|frame| first + step * frame as f64);
    let pose = |time: f64| match animation.at(time) {
        Some(place) => Ok(places::pose(stage, &place)),
        None => Err(unfit(format!(
            "no direction of view at {time} s; expected a rotation that is not zero"
        ))),
    };
    times.map(pose).collect()
}
