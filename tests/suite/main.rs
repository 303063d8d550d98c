//! The test suite: one module per theme. Each test states its oracle and its false-alarm rate.

mod agreement;
mod bsdf;
mod camera;
mod chi2;
mod cli;
mod common;
mod conformance;
mod determinism;
mod environments;
mod estimate;
mod film;
mod layers;
mod lights;
mod loading;
mod meter;
mod readme;
mod reference;
mod sampling;
mod spawn;
mod textures;
mod transport;
