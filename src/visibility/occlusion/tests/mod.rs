//! The stage against rays, one by one and in f64.

mod by_rays;
mod worlds;
