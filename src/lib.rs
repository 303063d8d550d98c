//! Path tracing of glTF 2.0 scenes to OpenEXR on the CPU.
//!
//! A [`Scene`] is loaded, or made in code by a [`SceneBuilder`](scene::builder::SceneBuilder). A [`Renderer`] is a
//! scene made ready under [`RenderOptions`]; it returns a [`Render`](render::Render): the [`Film`](film::Film), counts,
//! and why it stopped. [`stats`] and [`accuracy`] say how long it took and how good it is.
//!
//! ```
//! use pathspace::{Aov, RenderOptions, Renderer, Scene};
//!
//! # let folder = tempfile::tempdir().expect("a temporary folder");
//! # let output = folder.path().join("cornell.exr");
//! let scene = Scene::load("scenes/cornell-box/scene.gltf")?;
//! for warning in &scene.warnings {
//!     eprintln!("{}: {}", warning.place, warning.what);
//! }
//! let options = RenderOptions::for_scene(&scene).size(32, 32).spp(4).aovs([Aov::ALBEDO, Aov::STDERR]);
//! let renderer = Renderer::new(&scene, options)?;
//! let render = renderer.render()?;
//! // Camera matrices, seed, sample range, backend, plan and the extra channels are in the file.
//! render.film.write_exr(&output, &renderer.exr_options(&render))?;
//! # assert!(output.is_file());
//! # Ok::<(), pathspace::Error>(())
//! ```
//!
//! Features: `embree` and `oiio` trace rays and read images by the C and C++ libraries that Debian ships, `draco`,
//! `meshopt` and `basisu` read compressed files, `cli` is the command `pathspace`; all are on by default, and none
//! is needed. Programs should be compiled with `-C target-cpu=x86-64-v3` or better: see [`machine::Processor::unused`].
//!
//! Conventions everywhere: right-handed, +Y up, metres, radiance in W·sr⁻¹·m⁻² of linear Rec.709, pdfs in
//! sr⁻¹ unless the name says `area`. Storage and transport in `f32`, sums over samples in `f64`.
//!
//! Modules hidden from this documentation are public to the tests and benches of this package alone and may change at
//! any time.

pub mod accuracy;
#[doc(hidden)]
pub mod backend;
#[doc(hidden)]
pub mod bench;
#[doc(hidden)]
pub mod camera;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;
pub mod error;
pub mod film;
#[doc(hidden)]
pub mod input;
pub mod machine;
#[doc(hidden)]
pub mod math;
#[doc(hidden)]
pub mod plain;
#[doc(hidden)]
pub mod plan;
#[doc(hidden)]
pub mod plot;
pub mod render;
#[doc(hidden)]
pub mod room;
#[doc(hidden)]
pub mod sampler;
pub mod scene;
mod setters;
#[doc(hidden)]
pub mod shading;
pub mod stats;
#[doc(hidden)]
pub mod study;
#[doc(hidden)]
pub mod texture;
#[doc(hidden)]
pub mod transport;
pub mod verify;

pub use backend::{BackendInfo, BackendKind, QueryMode};
pub use error::{Error, Result};
/// Vectors and matrices of this crate's interface.
pub use glam;
pub use plan::aov::Aov;
pub use plan::options::{Backfaces, Heuristic, LightPaths, SamplerKind, Strategy, Techniques};
pub use render::{RenderOptions, Renderer};
pub use scene::Scene;

/// The Rust examples of the documents, compiled and run as doctests.
#[cfg(doctest)]
mod documents {
    #[doc = include_str!("../README.md")]
    struct Readme;
    #[doc = include_str!("../GUIDE.md")]
    struct Guide;
}
