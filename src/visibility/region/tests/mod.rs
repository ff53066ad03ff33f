//! Every row against rays that are followed through the regions one by one.

mod from_eye;
mod worlds;
