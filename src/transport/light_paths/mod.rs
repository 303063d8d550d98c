//! Light paths to the camera: the paths that camera paths find by luck, light that a mirror, glass or smooth metal
//! throws onto something that is seen.
//!
//! A third technique beside BSDF and light samples (Veach 1997 §10, with t = 1; particle tracing as Dutré et al. 1993).
//! It covers the paths x₀ (lens), x₁ … x_k (light) with k ≥ 3 whose last scattering x_(k−1) is on a *caster* and whose
//! x₁ is not a delta: light paths are aimed at the casters ([`Aim`](crate::shading::light::aim::Aim)), end where they
//! first meet anything else, and are connected with the lens at every later vertex that is not a delta. Elsewhere their
//! density is 0, and so is their part in the weights.
//!
//! [`ratio`] is the density of light paths over that of camera paths, carried along camera paths; [`trace`] traces
//! light paths and carries the inverse; [`weights`] are the heuristics over three densities. What light paths find goes
//! to pixels in whole numbers (`film/splats.rs`).
//!
//! Not covered, by both sides alike: scattering at normal maps other than at x₁, and where an interpolated normal faces
//! away from one of the directions.

pub mod lit;
pub mod ratio;
pub mod start;
pub mod trace;
pub mod weights;
