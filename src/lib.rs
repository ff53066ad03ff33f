//! Which spatial index finds what a camera sees, and where the camera is: how
//! fast, and is the answer right?
//!
//! cullbench puts interchangeable structures behind one trait pair, builds
//! scenes and drives cameras through them, checks every answer, and measures.
//! The story of the crate in the order of its modules:
//!
//! - [`kernel`]: instruction sets, chosen at run time
//! - [`threads`]: how many may work at once, and how they share work out
//! - [`arithmetic`]: directed rounding, exact sums and products
//! - [`geometry`]: boxes, planes, convex volumes, and THE plane test
//! - [`query`]: what is asked ([`query::QueryVolume`]), where answers go
//!   ([`query::Sink`]) and what is counted ([`query::Recorder`])
//! - [`camera`]: eye, u, v, n; lenses; matrices; the planes of the view
//! - [`culling`]: culling tests and arithmetics: from a camera to a view
//! - [`oracle`]: the exact verdict about a box and a volume or camera
//! - [`index`]: the contract [`index::RegionIndex`], what follows from it
//!   ([`index::FrustumQuery`]), the structures, and the [`index::Registry`] that
//!   yours joins
//! - [`scene`]: generated and real worlds, and the regions in them
//! - [`path`]: ways through a scene
//! - [`visibility`]: what hides what: the stages after and before the object stage
//! - [`verify`]: the reference answer and how others differ from it
//! - [`stress`]: test vectors and extremes with their declared outcome
//! - [`measure`]: count, verify, time; [`statistics`] makes figures of it
//! - [`precision`]: error against run time, and the sweeps behind it
//! - [`drift`]: how methods of turning and chasing drift from the truth
//! - [`funnel`]: what each stage from region to fragment removes, and at what cost
//! - [`report`]: the files that other tools read; [`suite`]: what to run
//! - [`spec`] and [`input`]: what users type and the files they bring
//! - `cli` (feature `cli`): the command line over any registry
//!
//! ```
//! use cullbench::camera::PlaneOptions;
//! use cullbench::index::StructureSpec;
//! use cullbench::{path, scene};
//!
//! let city = scene::load("city:n=2000,seed=7", &Default::default())?;
//! let orbit = path::load("orbit:frames=8", &city, &Default::default())?;
//! let linear = StructureSpec::parse("linear")?.build(&city.items)?;
//! let bvh = StructureSpec::parse("bvh:leaf=4")?.build(&city.items)?;
//!
//! for camera in &orbit.cameras {
//!     let volume = camera.volume(&PlaneOptions::default(), &city.surroundings())?;
//!     let (mut slow, mut fast) = (Vec::new(), Vec::new());
//!     linear.visible(&volume, &mut slow);
//!     bvh.visible(&volume, &mut fast);
//!     fast.sort_unstable();
//!     assert_eq!(slow, fast, "every structure returns the very same set");
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Features: `cli` (default) is the `cullbench` program and `cli::main_with`, with
//! everything from clap downwards; without it the structures, scenes, oracle and
//! measurements are left. `peers` adds structures of other crates behind the same
//! traits.
//!
//! Conventions: everything is right-handed; z is up in scenes; bounds are
//! closed, so touching counts as visible; plane normals point inward; angles
//! are degrees; items are numbered by their place in the scene.

// docs.rs says of each item which feature it needs.
#![cfg_attr(docsrs, feature(doc_cfg))]
#![deny(missing_docs)]
// Denied, not forbidden, where there are vectors: one folder may, and says so
// itself. With plain arrays there is none.
#![deny(unsafe_code)]
#![cfg_attr(
    any(not(target_arch = "x86_64"), miri, plain_vectors),
    forbid(unsafe_code)
)]

#[macro_use]
mod named;

#[cfg(feature = "cli")]
pub mod advise;
pub mod arithmetic;
pub mod camera;
#[cfg(feature = "cli")]
pub mod cli;
pub mod culling;
#[cfg(feature = "cli")]
pub mod drift;
#[cfg(feature = "cli")]
pub mod funnel;
pub mod geometry;
pub mod index;
pub mod input;
pub mod json;
pub mod kernel;
pub mod measure;
pub mod oracle;
pub mod path;
#[cfg(feature = "cli")]
pub mod precision;
pub mod query;
pub mod report;
pub mod scene;
pub mod shown;
pub mod spec;
pub mod statistics;
#[cfg(feature = "cli")]
pub mod stress;
pub mod suite;
pub mod threads;
pub mod verify;
#[cfg(feature = "cli")]
pub mod visibility;
