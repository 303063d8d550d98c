//! The test suite: one module per theme.

mod environments;
mod lights;
mod meter;
