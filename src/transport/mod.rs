//! Light transport: waves of paths, advanced one edge at a time by kernels over columns of sixteen lanes.
//!
//! [`path`] is the loop, and each verb in it is a file: [`raygen`], [`pass_through`], [`classify`], [`shade`] (which
//! samples lights by [`connect`]), [`accumulate`]. [`world`] is what physics reads, [`job`] what the loop reads
//! besides, [`wave`] what a worker advances. [`material`] alone reads textures.

pub mod accumulate;
pub mod alpha;
pub mod choose;
pub mod classify;
pub mod coincident;
pub mod connect;
pub mod counters;
mod departure;
pub mod directions;
pub mod emission;
pub mod estimator;
pub mod first_hit;
mod followed;
pub mod job;
pub mod kernel;
pub mod kind;
pub mod light_paths;
mod lobes;
pub mod log;
pub mod material;
mod media;
mod motion;
pub mod names;
mod origin;
pub mod parts;
pub mod pass_through;
pub mod passing;
pub mod path;
pub mod points;
pub mod raygen;
pub mod replay;
pub mod shade;
pub mod shutter;
pub mod spectrum;
pub mod start;
pub mod story;
pub mod tape;
pub mod truncation;
pub mod vertex;
pub mod vertices;
mod volume;
pub mod wave;
pub mod world;
