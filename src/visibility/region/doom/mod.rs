//! Doom maps: sectors as regions, two-sided linedefs as openings.
//!
//! One-sided linedefs are solid, and so are those between sectors whose heights leave no
//! opening. Sectors that a linedef's action moves count as open, at any height. Floors and
//! ceilings hide for the eye.
//!
//! This is the world of the game. If items are treated as solid boxes, rays pass over and
//! under them, as floors and ceilings are not items; there is no guarantee for items that
//! such a ray meets beyond a ceiling.
//!
//! The same map as triangles, floors and ceilings among them, is
//! [`DoomMap::surfaces`]; what these enclose from outside, in boxes, is
//! [`DoomMap::solid_boxes`].

mod map;
mod solid;

pub use map::DoomMap;

mod surfaces;
