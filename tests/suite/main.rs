//! The suite: one module per theme.

mod camera;
mod layers;
mod sampling;
mod spawn;
