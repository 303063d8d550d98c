//! Path tracing of glTF 2.0 scenes to OpenEXR on the CPU.
//!
//! Data flows one way; each module imports only from those above it:
//! [`error`], [`math`], [`machine`] ← [`texture`] ← [`scene`] ← [`backend`] ← [`plan`] ← [`camera`], [`sampler`], [`shading`],
//! [`film`] ← [`wavefront`], [`accuracy`] ← [`render`] ← [`stats`], [`mod@bench`], [`study`], [`verify`] ← `cli`, `main`.
//!
//! Conventions everywhere: right-handed, +Y up, metres, radiance in W·sr⁻¹·m⁻² of linear Rec.709, pdfs in sr⁻¹ unless
//! the name says `area`. Storage and transport in `f32`, sums over samples in `f64`.

pub mod accuracy;
pub mod backend;
pub mod bench;
pub mod camera;
#[doc(hidden)]
pub mod cli;
pub mod error;
pub mod film;
pub mod machine;
pub mod math;
pub mod plan;
pub mod render;
pub mod sampler;
pub mod scene;
pub mod shading;
pub mod stats;
pub mod study;
pub mod texture;
pub mod verify;
pub mod wavefront;

pub use error::{Error, Result};
pub use render::{RenderOptions, Renderer};
pub use scene::Scene;

/// The Rust example of the README, compiled and run as a doctest.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
