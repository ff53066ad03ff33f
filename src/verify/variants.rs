//! One camera, every kind of volume: what a structure must get right beyond
//! the six planes of a perspective view.

use super::VOLUME_KINDS;
use super::random::sheared;
use crate::camera::{Camera, CameraError, Lens, PlaneOptions, Surroundings};
use crate::geometry::{ConvexVolume, Plane};

/// Volumes of all [`VOLUME_KINDS`] at a camera's place, with their kind.
///
/// Kinds whose planes do not fit f32 are left out; `seed` picks how many planes an
/// unbounded volume keeps.
///
/// # Errors
/// The camera's own planes do not fit f32.
pub fn variants(
    camera: &Camera,
    options: &PlaneOptions,
    around: &Surroundings,
    seed: usize,
) -> Result<Vec<(&'static str, ConvexVolume)>, CameraError> {
    // Both may lie behind the eye of an orthographic lens, of no other; those of a matrix
    // may be one number once they are rounded.
    let (near, far) = match (camera.lens.near(), camera.lens.far()) {
        (near, Some(far)) if near > 0.0 && near < far => (near, far),
        (near, _) if near > 0.0 => (near, near * 1000.0),
        (_, Some(far)) if far > 0.0 => (far / 1000.0, far),
        (near, _) => (1.0, near.abs().max(1000.0)),
    };
    let with = |lens: Lens| Camera { lens, ..*camera }.volume(options, around);
    let straight = camera.volume(options, around)?;
    let planes = straight.planes().to_vec();
    let ortho = Lens::orthographic(0.3 * far, 1.5, -0.1 * far, 0.6 * far);
    let window = [-0.2, 0.9, -0.7, 0.1].map(|edge| edge * near);
    let sheared = sheared(&planes, [0.4, -0.3]);
    let mut turned = *camera;
    turned.frame.yaw(25.0);
    turned.frame.pitch(-10.0);
    let meeting = turned.volume(options, around);
    let meeting = meeting.as_ref().map_or(&planes[..], ConvexVolume::planes);
    let twelve = planes.iter().chain(meeting).copied();
    let many = twelve.clone().cycle().take(31).enumerate().map(|(i, p)| {
        // The same planes again, each a little farther out.
        Plane::new(p.normal, p.d + (i / 12) as f32 * 0.01 * far as f32)
    });
    let away = Plane::new(-planes[0].normal, -planes[0].d - 0.01 * far as f32);
    let mut volumes = vec![
        Some(straight.clone()),
        with(camera.lens.with_far(None).unwrap_or(camera.lens)).ok(),
        ortho.and_then(with).ok(),
        Lens::off_axis(window, near, Some(far)).and_then(with).ok(),
    ];
    let few = planes[..1 + seed % 5].to_vec();
    let (twelve, many) = (twelve.clone().collect(), many.collect());
    for planes in [sheared, few, twelve, many, vec![planes[0], away]] {
        volumes.push(ConvexVolume::from_planes(&planes).ok());
    }
    let kinds = VOLUME_KINDS.into_iter().zip(volumes);
    Ok(kinds.filter_map(|(kind, v)| Some((kind, v?))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::look_at;
    use glam::{DVec3, Vec3};

    #[test]
    fn every_kind_is_what_it_is_called() {
        let frame = look_at(DVec3::ZERO, DVec3::X, DVec3::Z).unwrap();
        let lens = Lens::perspective(60.0, 1.5, 0.1, Some(100.0)).unwrap();
        let camera = Camera { frame, lens };
        let volumes = variants(
            &camera,
            &PlaneOptions::default(),
            &Surroundings::default(),
            2,
        )
        .unwrap();
        let counts: Vec<_> = volumes.iter().map(|(_, v)| v.planes().len()).collect();
        assert_eq!(counts, [6, 5, 6, 6, 6, 3, 12, 31, 2]);
        let ahead = Vec3::new(50.0, 0.0, 0.0);
        let holds: Vec<_> = volumes
            .iter()
            .map(|(_, v)| v.contains_point(ahead))
            .collect();
        assert!(holds[..4].iter().all(|&h| h) && !holds[8], "{holds:?}");
    }

    /// A lens that sees behind the eye, or there alone, has the other kinds too.
    #[test]
    fn planes_behind_the_eye_leave_the_other_kinds_whole() {
        let frame = look_at(DVec3::ZERO, DVec3::X, DVec3::Z).unwrap();
        for [near, far] in [[-10.0, 500.0], [0.0, 1.0], [-900.0, -10.0], [-1.0, 0.0]] {
            let lens = Lens::orthographic(20.0, 1.5, near, far).unwrap();
            let camera = Camera { frame, lens };
            let options = PlaneOptions::default();
            let volumes = variants(&camera, &options, &Surroundings::default(), 1).unwrap();
            assert_eq!(volumes.len(), VOLUME_KINDS.len(), "{near} to {far}");
        }
    }
}
