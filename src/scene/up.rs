//! Up axis of a scene.

use glam::{DVec3, Vec3Swizzles};

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

    /// Exchanges the axes of a vector of the scene so that z is up.
    ///
    /// A turn: right-handed stays right-handed, and no coordinate is rounded.
    pub fn to_z_up<V: Vec3Swizzles>(self, v: V) -> V {
        match self {
            UpAxis::Y => v.zxy(),
            UpAxis::Z => v,
        }
    }

    /// Inverse of [`UpAxis::to_z_up`].
    pub fn from_z_up(self, v: DVec3) -> DVec3 {
        match self {
            UpAxis::Y => v.yzx(),
            UpAxis::Z => v,
        }
    }
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
