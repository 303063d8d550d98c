//! The test suite: one module per theme. Each test states its oracle and its false-alarm rate.

mod agreement;
mod bsdf;
mod cli;
mod common;
mod conformance;
mod determinism;
mod environments;
mod film;
mod lights;
mod loading;
mod meter;
mod reference;
mod textures;
mod transport;
