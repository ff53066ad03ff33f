//! Options that all readers of scenes share, up axes and camera places.

use glam::{DVec3, Vec3Swizzles};

named! {
    /// The items of a scene: parts of it.
    #[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
    pub enum ItemKind, ITEM_KINDS {
        #[default] Objects = "objects", "objects, groups and nodes of the file";
        Triangles = "triangles", "single triangles";
        Surfaces = "surfaces", "surfaces of a Quake III map, without its brushes";
        Brushes = "brushes", "brushes of a Quake III map, without its surfaces";
    }
}

/// How to read a scene.
#[derive(Clone, Copy, Default, Debug)]
pub struct LoadOptions {
    /// Leave out rows that are not a finite box, and count them.
    pub skip_bad_items: bool,
    /// Up axis of formats that do not state it.
    pub up: Option<UpAxis>,
    /// Items of a scene with triangles.
    pub items: ItemKind,
    /// Number of structures that will be built over the scene: they need memory too.
    pub structures: u64,
    /// Bytes needed per triangle of a mesh, in addition to the scene.
    pub per_triangle: u64,
}

named! {
    /// Axis that points up; coordinates stay as they were read.
    #[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
    pub enum UpAxis, UP_AXES {
        Y = "y", "y up (Unity, glTF, most engines)";
        #[default] Z = "z", "z up (maps, CAD, Unreal)";
    }
}

impl UpAxis {
    /// Unit vector upward.
    pub fn vector(self) -> DVec3 {
        self.from_z_up(DVec3::Z)
    }

    /// Permutes the axes of a vector of the scene so that z is up.
    ///
    /// A rotation: handedness is kept, and no coordinate is rounded.
    pub fn to_z_up<V: Vec3Swizzles>(self, v: V) -> V {
        match self {
            UpAxis::Y => v.zxy(),
            UpAxis::Z => v,
        }
    }

    /// Inverse of [`UpAxis::to_z_up`].
    pub fn from_z_up<V: Vec3Swizzles>(self, v: V) -> V {
        match self {
            UpAxis::Y => v.yzx(),
            UpAxis::Z => v,
        }
    }
}

/// A position and direction that the scene itself offers to a camera.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CameraPlace {
    /// Position in world coordinates.
    pub eye: DVec3,
    /// Direction of view.
    pub forward: DVec3,
    /// Roll and lens, if the file states them.
    pub view: Option<PlaceView>,
}

/// Roll and lens of a camera place.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PlaceView {
    /// Direction that is up in the image.
    pub up: DVec3,
    /// Full vertical angle of view in degrees; `None` for a parallel view.
    pub fovy_deg: Option<f64>,
    /// Height of a parallel view in world units.
    pub ortho_height: Option<f64>,
    /// Width / height, if stated.
    pub aspect: Option<f64>,
    /// Distance of the near plane.
    pub near: f64,
    /// Distance of the far plane; `None` is infinite.
    pub far: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_turned_and_turned_back() {
        let v = DVec3::new(1.0, 2.0, 3.0);
        for up in UpAxis::ALL {
            assert_eq!(up.to_z_up(up.vector()), DVec3::Z);
            assert_eq!(up.from_z_up(up.to_z_up(v)), v);
            let [x, y] = [DVec3::X, DVec3::Y].map(|axis| up.to_z_up(axis));
            assert_eq!(x.cross(y), up.to_z_up(DVec3::Z));
        }
        assert_eq!(UpAxis::Y.vector(), DVec3::Y);
    }
}
