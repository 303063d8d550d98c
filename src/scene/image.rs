//! Decoding of image files: PNG, JPEG and WebP to 8-bit RGBA, OpenEXR and Radiance to linear RGB environments.
//!
//! Sizes in headers are checked before anything is allocated: at most 2²⁸ texels (16384²), and never more than the file's
//! own length can possibly expand to. Colour profiles and gamma chunks are not applied (glTF 2.0 §3.8.3: ignored).
//! Limits: 16-bit PNG is rounded to 8 bits; EXR needs channels named R, G and B in its first layer, no deep data.

use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

use glam::Vec3;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use super::{Environment, Scene, Warning};
use crate::error::{Error, Result};

/// Texels of the largest image that is decoded.
const MOST_TEXELS: u64 = 1 << 28;
/// Deflate expands a byte to at most 1032, and a byte holds eight texels of a 1-bit PNG. The other formats expand less
/// (EXR's run lengths by 64, Radiance's by 32 texels a byte, JPEG by 512).
const MOST_TEXELS_PER_BYTE: u64 = 8 * 1032;
/// Working memory a decoder may take beyond 16 bytes a texel.
const DECODER_SLACK_BYTES: u64 = 64 << 20;

/// 8-bit RGBA, row-major from the top.
pub(super) struct Rgba8 {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) texels: Arc<[[u8; 4]]>,
}

/// Decodes a PNG, JPEG or WebP; which of them is told by the first bytes. The error says what was expected and found.
pub(super) fn decode_rgba8(bytes: &[u8]) -> Result<Rgba8, String> {
    let image = decode(bytes, texture_format(bytes)?)?.into_rgba8();
    let (width, height) = (image.width() as usize, image.height() as usize);
    let texels = image.as_raw().chunks_exact(4).map(|texel| [texel[0], texel[1], texel[2], texel[3]]).collect();
    Ok(Rgba8 { width, height, texels })
}

/// Texels of a PNG, JPEG or WebP by its header, if they may be allocated.
pub(super) fn texel_count(bytes: &[u8]) -> Result<u64, String> {
    let limits = limits(DECODER_SLACK_BYTES);
    let (width, height) = open(bytes, texture_format(bytes)?, limits)?.dimensions();
    check_size(u64::from(width), u64::from(height), credited(bytes))
}

/// Length of the file by which its size is judged. A WebP of one colour takes some 30 bytes whatever its size: 16 million
/// texels are believed of any.
fn credited(bytes: &[u8]) -> usize {
    const WEBP_BYTES: usize = 2048;
    match image::guess_format(bytes) {
        Ok(ImageFormat::WebP) => bytes.len().max(WEBP_BYTES),
        _ => bytes.len(),
    }
}

fn texture_format(bytes: &[u8]) -> Result<ImageFormat, String> {
    match image::guess_format(bytes) {
        Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::WebP)) => Ok(format),
        _ => Err(format!(
            "expected PNG, JPEG or WebP, found bytes that begin `{}`",
            bytes[..bytes.len().min(8)].escape_ascii()
        )),
    }
}

fn decode(bytes: &[u8], format: ImageFormat) -> Result<DynamicImage, String> {
    let (width, height) = open(bytes, format, limits(DECODER_SLACK_BYTES))?.dimensions();
    let texels = check_size(u64::from(width), u64::from(height), credited(bytes))?;
    let decoder = open(bytes, format, limits(16 * texels + DECODER_SLACK_BYTES))?;
    DynamicImage::from_decoder(decoder).map_err(|reason| broken(format, &reason))
}

fn open(bytes: &[u8], format: ImageFormat, limits: Limits) -> Result<impl ImageDecoder + '_, String> {
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits);
    reader.into_decoder().map_err(|reason| broken(format, &reason))
}

fn limits(bytes: u64) -> Limits {
    let mut limits = Limits::default();
    limits.max_alloc = Some(bytes);
    limits
}

fn broken(format: ImageFormat, reason: &image::ImageError) -> String {
    let name = match format {
        ImageFormat::Png => "PNG",
        ImageFormat::Jpeg => "JPEG",
        ImageFormat::WebP => "WebP",
        _ => "Radiance .hdr",
    };
    format!("expected a valid {name}, found {reason}")
}

/// Texels of an image of this size, if they may be allocated.
fn check_size(width: u64, height: u64, file_bytes: usize) -> Result<u64, String> {
    let texels = width.saturating_mul(height);
    if texels == 0 || texels > MOST_TEXELS {
        return Err(format!("expected 1 to {MOST_TEXELS} texels, found {width} × {height} in the header"));
    }
    if texels > (file_bytes as u64).saturating_mul(MOST_TEXELS_PER_BYTE) {
        return Err(format!(
            "expected {width} × {height} texels as the header says, found only {file_bytes} bytes of file"
        ));
    }
    Ok(texels)
}

/// Reads an equirectangular environment: OpenEXR or Radiance `.hdr`, told by the first bytes. Infinite or NaN radiance is an
/// error; negative radiance is clamped to 0 ([`Scene::load_environment`] reports how much of it there was).
pub fn load_environment(path: impl AsRef<Path>, rotation_rad: f32, intensity: f32) -> Result<Environment> {
    read_environment(path.as_ref(), rotation_rad, intensity).map(|(environment, _)| environment)
}

impl Scene {
    /// Lights the scene by the environment map in a file, as [`load_environment`] does; clamped texels become a warning.
    pub fn load_environment(&mut self, path: impl AsRef<Path>, rotation_rad: f32, intensity: f32) -> Result<()> {
        let (environment, clamped) = read_environment(path.as_ref(), rotation_rad, intensity)?;
        if clamped > 0 {
            let place = path.as_ref().display().to_string();
            self.warnings
                .push(Warning { place, what: format!("{clamped} texels with negative radiance are clamped to 0") });
        }
        self.environment = Some(environment);
        Ok(())
    }
}

fn read_environment(path: &Path, rotation_rad: f32, intensity: f32) -> Result<(Environment, usize)> {
    let bytes = std::fs::read(path).map_err(|source| Error::io(path, "read", source))?;
    let problem = |problem: String| Error::Image { path: path.into(), problem };
    let (width, height, mut texels) = if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        decode_exr(&bytes).map_err(problem)?
    } else if bytes.starts_with(b"#?") {
        let image = decode(&bytes, ImageFormat::Hdr).map_err(problem)?.into_rgb32f();
        let texels = image.pixels().map(|pixel| Vec3::from(pixel.0)).collect();
        (image.width() as usize, image.height() as usize, texels)
    } else {
        let found = bytes[..bytes.len().min(8)].escape_ascii().to_string();
        return Err(problem(format!("expected OpenEXR or Radiance .hdr, found bytes that begin `{found}`")));
    };
    if let Some(first) = texels.iter().position(|texel| !texel.is_finite()) {
        let count = texels.iter().filter(|texel| !texel.is_finite()).count();
        let (x, y) = (first % width, first / width);
        return Err(problem(format!(
            "expected finite radiance, found {count} texels with NaN or infinity, the first at ({x}, {y})"
        )));
    }
    let negative = texels.iter().filter(|texel| texel.min_element() < 0.0).count();
    texels.iter_mut().for_each(|texel| *texel = texel.max(Vec3::ZERO));
    Ok((Environment { width, height, texels: texels.into(), rotation_rad, intensity }, negative))
}

fn decode_exr(bytes: &[u8]) -> Result<(usize, usize, Vec<Vec3>), String> {
    use exr::prelude::*;
    let broken = |reason: exr::error::Error| format!("expected OpenEXR with channels R, G and B, found {reason}");
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(broken)?;
    for header in &meta.headers {
        check_size(header.layer_size.0 as u64, header.layer_size.1 as u64, bytes.len())?;
    }
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size: Vec2<usize>, _: &RgbChannels| (size.0, vec![Vec3::ZERO; size.area()]),
            |(width, texels): &mut (usize, Vec<Vec3>), at: Vec2<usize>, (r, g, b): (f32, f32, f32)| {
                texels[at.1 * *width + at.0] = Vec3::new(r, g, b);
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(broken)?;
    let size = image.layer_data.size;
    Ok((size.0, size.1, image.layer_data.channel_data.pixels.1))
}
