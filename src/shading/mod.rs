//! Light transport as pure functions of numbers: they never see queues, tiles, options, clocks or RNG state.

pub mod bsdf;
pub mod interaction;
pub mod light;
pub mod mis;
pub mod roulette;
pub mod surface;
