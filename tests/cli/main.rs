//! The contract of the program as a user meets it: every command runs as a
//! process of its own and is judged by its output, its exit code and what it
//! leaves on disk. Expected answers come from code in these files, not from
//! the library; only `readers` calls the library, with damaged input.
#![cfg(feature = "cli")]

mod advise;
mod advise_motion;
mod advise_stages;
mod bad_input;
mod bad_usage;
mod cases;
mod compare;
mod compare_output;
mod converting;
mod cullings;
mod drawing;
mod drift;
mod foreign_text;
mod funnel;
mod funnel_extremes;
mod funnel_fragments;
mod funnel_maps;
mod funnel_options;
mod gates;
mod gltf;
mod inputs;
mod kernels;
mod listing;
mod matrices;
#[cfg(target_os = "linux")]
mod memory;
mod meshes;
mod motion;
mod near_ends;
mod obj;
mod page;
mod pipes;
mod precision;
mod precision_options;
mod process;
mod queries;
mod readers;
mod region_search;
mod reports;
mod resume;
mod run_tables;
mod runs;
mod shards;
#[cfg(unix)]
mod signals;
mod stress;
#[cfg(unix)]
mod suites;
mod terminal;
mod view;

const PROGRAM: &str = env!("CARGO_BIN_EXE_cullbench");
const BOXES: &str = "min_x,min_y,min_z,max_x,max_y,max_z";
const EYE_LOOK: &str = "eye_x,eye_y,eye_z,look_x,look_y,look_z";
const FULL_CAMERA: &str =
    "eye_x,eye_y,eye_z,look_x,look_y,look_z,up_x,up_y,up_z,fovy_deg,aspect,near,far";
