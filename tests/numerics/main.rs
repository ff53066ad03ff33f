//! The numbers: planes of a camera, their margins, the exact oracle, the verified
//! vectors, culling tests and region search, against references of these tests' own.

mod by_hand;
mod camera_planes;
mod culling;
mod epsilon;
mod oracle;
mod region_exact;
mod vectors;
