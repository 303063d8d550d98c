//! The film: what a render has gathered per pixel ([`store`]), layer by layer ([`layer`]); the estimate of its error
//! ([`estimate`]); and the files it is written to.

#[doc(hidden)]
pub mod atomic;
pub(crate) mod blocks;
pub mod channel;
pub mod cryptomatte;
pub mod denoise;
#[doc(hidden)]
pub mod estimate;
pub mod exr;
#[doc(hidden)]
pub mod filter;
mod header;
pub mod ids;
pub mod layer;
pub mod look;
#[cfg(test)]
mod noise;
#[allow(unsafe_code)] // Fence 4 of 5: Open Image Denoise, loaded at run time.
pub mod oidn;
pub(crate) mod pairwise;
pub mod pass_names;
pub mod png;
pub mod primaries;
pub(crate) mod saved;
#[doc(hidden)]
pub mod shares;
#[doc(hidden)]
pub mod splats;
pub mod store;
pub mod tone;

pub use self::layer::beauty::Pixel;
pub use self::store::{Film, SppRange};
