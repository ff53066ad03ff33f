//! Several cameras made of one: two eyes, the cascades of a shadow map, the
//! faces of a cube map, and all that one frame may ask at a time. What they
//! see, and whether they are asked together, is decided elsewhere.

use glam::DVec3;

use super::{Camera, CameraError, Frame, Lens};

/// The views that belong to one camera of a path.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum ViewSet {
    /// The camera itself.
    Single,
    /// Two eyes so far apart (world units), side by side, axes parallel.
    Stereo { distance: f64 },
    /// The depth cut into so many pieces that meet at their planes.
    Cascades { count: usize },
    /// Six views of 90 degrees along the axes.
    Cube,
    /// The camera, four cascades and six faces.
    Frame,
}

/// Cascades of [`ViewSet::Frame`].
const CASCADES: usize = 4;

impl ViewSet {
    /// The cameras, in a fixed order.
    ///
    /// # Errors
    /// No finite far plane where there are cascades; near not above 0 where
    /// there are faces; an eye that is not finite.
    pub fn cameras(&self, camera: &Camera) -> Result<Vec<Camera>, CameraError> {
        match *self {
            ViewSet::Single => Ok(vec![*camera]),
            ViewSet::Stereo { distance } => Ok(stereo(camera, distance)?.to_vec()),
            ViewSet::Cascades { count } => cascades(camera, count),
            ViewSet::Cube => Ok(cube(camera)?.to_vec()),
            ViewSet::Frame => {
                let mut all = vec![*camera];
                all.extend(cascades(camera, CASCADES)?);
                all.extend(cube(camera)?);
                Ok(all)
            }
        }
    }
}

/// The left and the right eye.
fn stereo(camera: &Camera, distance: f64) -> Result<[Camera; 2], CameraError> {
    super::finite("the distance of the eyes", distance)?;
    if let Lens::Matrix(_) = camera.lens {
        return Err(CameraError::MatrixFixed { what: "an eye" });
    }
    Ok([-0.5, 0.5].map(|side| Camera {
        frame: Frame {
            eye: camera.frame.eye + camera.frame.u() * (side * distance),
            ..camera.frame
        },
        ..*camera
    }))
}

/// Cut at the mean of the even and the geometric series of depths: the
/// practical split scheme with lambda = 1/2 (Zhang, Sun, Xu and Lun 2006,
/// "Parallel-split shadow maps for large-scale virtual environments", eq. 7).
/// Even alone where near is not above 0.
fn cascades(camera: &Camera, count: usize) -> Result<Vec<Camera>, CameraError> {
    let (near, far) = (
        camera.lens.near(),
        camera.lens.far().unwrap_or(f64::INFINITY),
    );
    super::finite("far", far)?;
    let cut = |i: usize| {
        if i == 0 {
            return near;
        }
        if i == count {
            return far;
        }
        let share = i as f64 / count as f64;
        let even = near + (far - near) * share;
        if near > 0.0 {
            (near * libm::pow(far / near, share) + even) / 2.0
        } else {
            even
        }
    };
    let piece = |i| {
        Ok(Camera {
            lens: camera.lens.with_depth(cut(i), Some(cut(i + 1)))?,
            ..*camera
        })
    };
    (0..count).map(piece).collect()
}

/// The faces towards +x, -x, +y, -y, +z, -z, from the camera's eye, near and
/// far.
fn cube(camera: &Camera) -> Result<[Camera; 6], CameraError> {
    let lens = Lens::perspective(90.0, 1.0, camera.lens.near(), camera.lens.far())?;
    let face = |forward: DVec3| {
        let up = if forward.z == 0.0 { DVec3::Z } else { DVec3::Y };
        Frame::looking_along(camera.frame.eye, forward, up).map(|frame| Camera { frame, lens })
    };
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    Ok([
        face(x)?,
        face(-x)?,
        face(y)?,
        face(-y)?,
        face(z)?,
        face(-z)?,
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{PlaneOptions, Surroundings, look_at};
    use crate::geometry::{Aabb, ConvexVolume};
    use glam::Vec3;

    fn camera() -> Camera {
        let frame = look_at(
            DVec3::new(1.0, 2.0, 3.0),
            DVec3::new(-4.0, 9.0, 1.0),
            DVec3::Z,
        );
        let lens = Lens::perspective(60.0, 1.5, 0.5, Some(40.0));
        Camera {
            frame: frame.unwrap(),
            lens: lens.unwrap(),
        }
    }

    fn volumes(set: ViewSet) -> Vec<ConvexVolume> {
        let cameras = set.cameras(&camera()).unwrap();
        let volume = |c: &Camera| {
            c.volume(&PlaneOptions::default(), &Surroundings::default())
                .unwrap()
        };
        cameras.iter().map(volume).collect()
    }

    fn points() -> impl Iterator<Item = Aabb> {
        (0..27_000u32).map(|i| {
            let at = Vec3::new((i % 30) as f32, (i / 30 % 30) as f32, (i / 900) as f32);
            let at = at * 3.1 - Vec3::splat(44.0);
            Aabb::new(at, at)
        })
    }

    fn sees(set: &[ConvexVolume], b: &Aabb) -> usize {
        set.iter().filter(|volume| volume.sees(b)).count()
    }

    #[test]
    fn cascades_cover_the_camera_and_nothing_else() {
        let (whole, pieces) = (
            volumes(ViewSet::Single),
            volumes(ViewSet::Cascades { count: 4 }),
        );
        let mut seen = [0; 4];
        for b in points() {
            let of_whole = sees(&whole, &b);
            assert_eq!(of_whole, sees(&pieces, &b).min(1), "{b:?}");
            for (seen, piece) in seen.iter_mut().zip(&pieces) {
                *seen += sees(std::slice::from_ref(piece), &b);
            }
        }
        // No piece is empty but, perhaps, the smallest.
        assert!(seen[1..].iter().all(|&count| count > 0), "{seen:?}");
    }

    #[test]
    fn the_six_faces_cover_the_cube_about_the_eye() {
        let faces = volumes(ViewSet::Cube);
        let eye = camera().frame.eye.as_vec3();
        let mut covered = 0;
        for b in points() {
            let distance = (b.min - eye).abs().max_element();
            let within = distance > 0.51 && distance < 39.9;
            if within {
                assert!(sees(&faces, &b) >= 1, "{b:?}");
                covered += 1;
            }
            if distance > 40.1 {
                assert_eq!(sees(&faces, &b), 0, "{b:?}");
            }
        }
        assert!(covered > 10_000);
    }

    #[test]
    fn the_eyes_stand_apart_along_u_and_the_frame_has_eleven_views() {
        let set = ViewSet::Stereo { distance: 3.0 };
        let eyes = set.cameras(&camera()).unwrap();
        let apart = eyes[1].frame.eye - eyes[0].frame.eye;
        assert!((apart - camera().frame.u() * 3.0).length() < 1e-12);
        assert_eq!(ViewSet::Frame.cameras(&camera()).unwrap().len(), 11);
    }

    #[test]
    fn views_that_cannot_be_are_typed_errors() {
        let endless = Camera {
            lens: Lens::perspective(60.0, 1.0, 1.0, None).unwrap(),
            ..camera()
        };
        let error = ViewSet::Cascades { count: 2 }.cameras(&endless);
        assert!(matches!(
            error,
            Err(CameraError::NotFinite { name: "far", .. })
        ));
        let flat = Camera {
            lens: Lens::orthographic(2.0, 1.0, -1.0, 1.0).unwrap(),
            ..camera()
        };
        assert!(matches!(
            ViewSet::Cube.cameras(&flat),
            Err(CameraError::Near { .. })
        ));
        assert_eq!(
            ViewSet::Cascades { count: 3 }.cameras(&flat).unwrap().len(),
            3
        );
        let far_apart = ViewSet::Stereo { distance: f64::NAN };
        assert!(far_apart.cameras(&flat).is_err());
    }
}
