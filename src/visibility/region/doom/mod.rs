//! Doom maps: sectors as regions, two-sided linedefs as openings.
//!
//! Solid are one-sided linedefs and those between sectors whose heights leave no
//! opening. What the game can move (a sector that a linedef's action moves) is taken
//! to be open, whatever its heights. Floors and ceilings hide for the eye.
//!
//! This is the world of the game. Where items are taken as solid boxes, rays over and
//! under them pass, as floors and ceilings are no items: what such a ray meets beyond a
//! ceiling is not promised here.
//!
//! The same map as triangles, floors and ceilings among them, is
//! [`DoomMap::surfaces`]; what these enclose from outside, in boxes, is
//! [`DoomMap::solid_boxes`].

mod ground;
mod map;
mod plan;
mod solid;
mod surfaces;

pub use map::DoomMap;
