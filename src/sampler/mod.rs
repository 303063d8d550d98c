//! Random numbers, addressed rather than consumed: f(pixel, sample, dimension set, seed) → four numbers in [0,1).
//!
//! A film pixel keeps two halves of independent scrambles: sample s belongs to half s mod 2 and is that half's point s
//! div 2 ([`address()`]). The half, the pixel and the index bits above 2³² go into a 64-bit seed ([`pixel_seed`]);
//! the low 32 bits of the index and the number of the set ([`dims`]) go to a [`Scheme`]. Nothing repeats within 2⁶³
//! samples a pixel and 2³² sets; each run of 2³² points of a half is a fresh scramble.

mod address;
pub mod dims;
pub mod independent;
mod kind;
mod scheme;
pub mod sobol;

pub use crate::plan::options::SamplerKind;
pub use address::{Address, address, pixel_seed};
pub use independent::IndependentScheme;
pub use kind::WithScheme;
pub use scheme::{Scheme, unit_float};
pub use sobol::SobolScheme;
