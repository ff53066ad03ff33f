//! Spatial indexes for visibility, compared.
//!
//! The question: which index finds what a camera sees, and where the camera is, how fast,
//! and is the answer right?
//!
//! cullbench puts interchangeable structures behind one trait, builds scenes and moves
//! cameras through them, checks every answer, and measures. A structure by itself:
//!
//! ```
//! use cullbench::prelude::*;
//!
//! let city = scene::load("city:n=2000,seed=7", &Default::default())?;
//! let orbit = path::load("orbit:frames=8", &city, &Default::default())?;
//! let bvh = Bvh::build(&Input::new(&city.items), &Default::default())?;
//! let frustum = orbit.cameras[0].volume(&PlaneOptions::default(), &city.surroundings())?;
//!
//! // Three forms of one query: a new list, a function per item, a list with the cost.
//! let ids = bvh.visible(&frustum);
//! let mut count = 0;
//! bvh.each_visible(&frustum, |_| count += 1);
//! let (again, cost) = bvh.counted(&frustum);
//! assert!(ids == again && ids.len() == count && cost.nodes_tested > 0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Structures side by side, with every answer checked:
//!
//! ```
//! use cullbench::prelude::*;
//!
//! let report = Experiment::new("city:n=500")
//!     .path("orbit:frames=8")
//!     .structures(Registry::builtin().structures("linear,bvh,octree")?)
//!     .run()?;
//! assert!(report.cells.iter().all(|cell| cell.status == Status::Ok));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Modules, each of which may use those before it:
//!
//! - [`kernel`]: instruction sets, chosen at run time
//! - [`geometry`]: boxes, planes, convex volumes, and THE plane test
//! - [`query`]: query volumes ([`query::QueryVolume`]), sinks ([`query::Sink`]) and
//!   counters ([`query::Recorder`])
//! - [`camera`]: eye, u, v, n; lenses; matrices; the planes of the view
//! - [`culling`]: culling tests and arithmetics: from a camera to a view
//! - [`oracle`]: the exact verdict about a box and a volume or camera
//! - [`index`]: the contract [`index::RegionIndex`], queries ([`index::FrustumQuery`]),
//!   the structures, and the [`index::Registry`] that yours joins
//! - [`scene`]: generated and real worlds, and the regions in them; [`path`]: camera paths;
//!   [`motion`]: items that move between frames
//! - [`verify`]: the reference answer, and how others differ from it
//! - [`measure`]: count, verify, time
//! - [`report`]: the files that other tools read
//!
//! Features: `cli` (default) is the `cullbench` program (`cli::main_with`), with
//! `visibility` (the stages before and after the object stage) and `stress`; its commands
//! `funnel`, `advise`, `precision` and `drift` have no library interface. `peers` adds
//! structures of other crates.
//!
//! Conventions: cameras are right-handed; z is up in a scene unless its file or its options
//! say y; bounds are closed, so touching counts as visible; plane normals point inward;
//! angles are degrees; items are numbered by their index in the scene.

// docs.rs shows for each item which feature it needs.
#![cfg_attr(docsrs, feature(doc_cfg))]
#![deny(missing_docs)]
// The program uses more of the modules than a library build: dead code is only reported with `cli`.
#![cfg_attr(not(feature = "cli"), allow(unused))]
// Denied instead of forbidden if there are vectors: one folder may use it, and declares so. With
// plain arrays there is none.
#![deny(unsafe_code)]
#![cfg_attr(
    any(not(target_arch = "x86_64"), miri, plain_vectors),
    forbid(unsafe_code)
)]

/// The vectors of this interface, in the version that it uses.
pub use glam;

#[macro_use]
mod named;

#[cfg(feature = "cli")]
mod advise;
mod arithmetic;
pub mod camera;
#[cfg(feature = "cli")]
pub mod cli;
pub mod culling;
#[cfg(feature = "cli")]
mod drift;
#[cfg(feature = "cli")]
mod funnel;
pub mod geometry;
pub mod index;
mod input;
mod json;
pub mod kernel;
pub mod measure;
pub mod motion;
pub mod oracle;
pub mod path;
#[cfg(feature = "cli")]
mod precision;
pub mod query;
pub mod report;
pub mod scene;
mod shown;
mod spec;
mod statistics;
#[cfg(feature = "cli")]
pub mod stress;
#[cfg(feature = "cli")]
mod suite;
mod threads;
pub mod verify;
#[cfg(feature = "cli")]
pub mod visibility;

/// Names for queries and experiments.
///
/// Your own structure needs more names, from [`index`] and [`query`]: see
/// `examples/enter_your_crate.rs`.
pub mod prelude {
    pub use crate::camera::{Camera, Lens, PlaneOptions, look_at};
    pub use crate::geometry::{Aabb, ConvexVolume, Plane};
    pub use crate::index::{
        Bsp, Bvh, FrustumQuery, Input, Linear, Octree, Quadtree, RegionIndex, Registry, Wide,
    };
    pub use crate::measure::Status;
    pub use crate::path::{self, CameraPath};
    pub use crate::query::ItemId;
    pub use crate::report::{Experiment, Report};
    pub use crate::scene::{self, Scene};
}
