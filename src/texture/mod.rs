//! Textures: decoding (`decode`), where texels are kept (`texels`), and look-ups in linear values (`lookup`, `lanes`).

mod cache;
mod color;
mod crates;
pub mod decode;
mod encoded;
mod exr_header;
#[cfg(feature = "oiio")]
mod files;
mod image;
#[cfg(feature = "basisu")]
mod ktx2;
mod lanes;
pub mod load;
mod lookup;
mod mean;
#[cfg(feature = "oiio")]
#[allow(unsafe_code)] // Fence 2 of 5: the shim over OpenImageIO.
pub mod oiio;
mod plane;
mod problem;
mod pyramid;
#[cfg(feature = "oiio")]
mod reader;
mod scratch;
mod stats;
pub mod stored;
mod taps;
mod texels;
pub mod udim;
mod weave;

pub use color::{ColorSpace, SRGB_TO_LINEAR};
pub use lanes::lookup_lanes;
pub use lookup::{lookup, lookup_filtered};
pub use plane::{Plane, Rows};
pub use stats::{TextureFault, TextureStats, take_lookups};
pub use taps::Wrap;
pub use texels::{Texels, Texture};
pub use weave::weave;
