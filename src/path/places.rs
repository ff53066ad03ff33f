//! The scene's own camera places: things of Doom maps, cameras of glTF.
//!
//! Roll and lens are the file's, where it states them.

use super::{PathError, Pose, Stage};
use crate::scene::{CameraPlace, PlaceView};
use crate::spec::Spec;

pub(super) fn frames(stage: &Stage, _: &mut Spec) -> Result<Vec<Pose>, PathError> {
    if stage.scene.places.is_empty() {
        let reason = format!(
            "scene '{}' has no camera places of its own; expected one with places, such as a Doom map",
            stage.scene.name
        );
        return Err(PathError::unfit("places", reason));
    }
    let places = stage.scene.places.iter();
    Ok(places.map(|place| pose(stage, place)).collect())
}

pub(super) fn pose(stage: &Stage, place: &CameraPlace) -> Pose {
    let turned = |v| stage.up.to_z_up(v);
    let view = place.view.map(|view| PlaceView {
        up: turned(view.up),
        ..view
    });
    Pose {
        view,
        ..Pose::new(turned(place.eye), turned(place.forward))
    }
}
