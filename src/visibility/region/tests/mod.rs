//! Every row against rays that are followed through the regions one by one.

mod doom_surfaces;
mod exact_doom;
mod exact_rooms;
mod free_space;
mod from_eye;
mod items;
mod stress;
pub(super) mod worlds;
