//! The film: what a render has gathered per pixel ([`store`]), layer by layer ([`layer`]); the estimate of its error
//! ([`estimate`]); and the files it is written to.

#[doc(hidden)]
pub mod atomic;
pub(crate) mod blocks;
pub mod channel;
#[doc(hidden)]
pub mod estimate;
pub mod exr;
#[doc(hidden)]
pub mod filter;
mod header;
pub mod layer;
pub mod look;
#[cfg(test)]
mod noise;
pub(crate) mod pairwise;
pub mod png;
pub(crate) mod saved;
pub mod store;
pub mod tone;

pub use self::layer::beauty::Pixel;
pub use self::store::{Film, SppRange};
