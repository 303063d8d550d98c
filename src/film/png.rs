//! 8-bit sRGB previews without a look: exposure in stops, clip to [0, 1]. The curves and backdrops are in `look.rs`.

use std::path::Path;

use super::look::{Look, Preview};
use super::store::Film;
use crate::error::Result;

pub use super::look::srgb_byte;

/// R, G, B bytes, row-major, as a PNG file in memory.
pub fn encode_rgb(bytes: &[u8], width: u32, height: u32) -> Vec<u8> {
    Preview { width, height, alpha: false, bytes: bytes.to_vec() }.png()
}

impl Film {
    /// Writes a preview with every value multiplied by 2^`exposure_ev`, all or nothing; `.png` whatever the name is.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io) naming `path`.
    pub fn write_png(&self, path: impl AsRef<Path>, exposure_ev: f32) -> Result<()> {
        let preview = Look::default().exposure_ev(exposure_ev).preview(self)?;
        super::atomic::write_atomically(path.as_ref(), |writer| std::io::Write::write_all(writer, &preview.png()))
    }
}
