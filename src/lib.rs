pub mod camera;
pub mod geometry;
pub mod index;
pub mod input;
pub mod path;
pub mod query;
pub mod scene;
pub mod spec;
