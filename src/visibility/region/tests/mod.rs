//! Every row compared with rays that are followed through the regions one by one.

mod doom;
mod doom_surfaces;
mod follow;
mod from_eye;
mod items;
mod quake;
mod sight;
mod stress;
pub(super) mod worlds;

pub use sight::leads_through;
