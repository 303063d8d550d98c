//! The test suite: one module per theme. Each test states its oracle and its false-alarm rate.

mod accuracy;
mod agreement;
mod aov;
mod bench;
mod bsdf;
mod camera;
mod chi2;
mod cli;
mod common;
mod conformance;
mod determinism;
mod environments;
mod film;
mod layers;
mod lights;
mod loading;
mod meter;
mod readme;
mod reference;
mod sampling;
mod selection;
mod spawn;
mod textures;
mod transport;
