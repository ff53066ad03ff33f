//! Picking, the selection under the cursor: the first item that a ray meets, the
//! nearest few, and everything through a cursor's frustum. One file a back end;
//! what a ray meets is said where [`Solids`](super::Solids) are.

mod contract;
mod cursor;
mod exactly;
pub mod linear;
pub mod obvhs;
mod rounded;
pub mod wide_ray;

#[cfg(feature = "peers")]
pub mod bvh;
#[cfg(feature = "embree")]
pub mod embree;
#[cfg(feature = "peers")]
pub mod parry3d;
#[cfg(feature = "peers")]
pub mod rstar;

#[cfg(test)]
mod tests;

pub use contract::{About, BackEnd, Hit, NotBuilt, Pick};
pub use cursor::{CursorRectangle, through_cursor};
pub use linear::Linear;
pub use obvhs::{Obvhs, ObvhsWide};
pub use wide_ray::WideRay;

/// All back ends, the reference first.
pub const BACK_ENDS: &[BackEnd] = &[
    BackEnd {
        about: linear::ABOUT,
        build: linear::build,
    },
    BackEnd {
        about: wide_ray::ABOUT,
        build: wide_ray::build,
    },
    BackEnd {
        about: obvhs::ABOUT,
        build: obvhs::build,
    },
    BackEnd {
        about: obvhs::ABOUT_WIDE,
        build: obvhs::build_wide,
    },
    #[cfg(feature = "peers")]
    BackEnd {
        about: parry3d::ABOUT,
        build: parry3d::build,
    },
    #[cfg(feature = "peers")]
    BackEnd {
        about: bvh::ABOUT,
        build: bvh::build,
    },
    #[cfg(feature = "peers")]
    BackEnd {
        about: rstar::ABOUT,
        build: rstar::build,
    },
    #[cfg(feature = "embree")]
    BackEnd {
        about: embree::ABOUT,
        build: embree::build,
    },
];
