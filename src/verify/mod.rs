//! The operator check: a deterministic solver of diffuse light transport, against which the path tracer must hold
//! length by length.
//!
//! The theory is L = Σ (KG)ᵏ Le: term k is the light of paths with k scatterings. The solver divides the surfaces
//! into patches ([`patches`]), computes the form factors between them ([`form_factor`], [`operator`]) and iterates L
//! ← KG·L; the path tracer keeps one image per length. Both sides of the comparison are the same quantity: the mean
//! over pixels of the radiance along the one ray through each pixel's centre. The last scattering, at the point that
//! the camera sees, is gathered exactly from all patches ([`gather`]), so that no patch is ever seen directly. They
//! share the scene and the backend's ray queries; no sampling, no shading code.
//!
//! Intervals ([`compare`]): the path tracer's own standard error, and the solver's discretisation error, taken from the
//! differences between solutions on patches of 1, 3/2 and 3 times the side. Source: Goral et al. 1984; HARDCASES §4.3.
//! Limits: flat, untextured Lambert surfaces, emissive triangles as the only light. Everything else is refused by name.

pub mod check;
#[doc(hidden)]
pub mod compare;
#[doc(hidden)]
pub mod form_factor;
#[doc(hidden)]
pub mod gather;
#[doc(hidden)]
pub mod operator;
mod options;
#[doc(hidden)]
pub mod patches;

pub use check::{Solution, Verification, solve, verify};
pub use options::VerifyOptions;
pub use patches::SOLUTIONS;
