//! Light transport as pure functions of numbers: they never see queues, tiles, options, clocks or RNG state.

pub mod bsdf;
pub mod cone;
pub mod directions;
pub mod dispersion;
pub mod guide;
pub mod interaction;
pub mod light;
pub mod medium;
pub mod mis;
pub mod roulette;
pub mod scattering;
pub mod surface;
