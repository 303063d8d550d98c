//! Decoding without OpenImageIO: PNG, JPEG, WebP and Radiance by the `image` crate, OpenEXR by `exr`.
//!
//! Limits: 16-bit PNG is rounded to 8 bits; EXR needs channels named R, G and B in its first layer and loses its alpha; the
//! largest level of a pyramid alone is read.

use std::borrow::Cow;
use std::io::Cursor;

use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use super::decode::{Encoded, Format, Header, Image, broken, check_size, credited};

/// Working memory a decoder may take beyond 16 bytes a texel.
const DECODER_SLACK_BYTES: u64 = 64 << 20;

/// Marker at the end of a JPEG.
const JPEG_END: [u8; 2] = [0xff, 0xd9];

pub(super) fn inspect(encoded: Encoded, format: &Format) -> Result<Header, String> {
    let bytes = bytes(encoded)?;
    let (texels, texel_bytes) = match known(format)? {
        Known::Exr => (exr_size(&bytes)?, 16),
        Known::Image(kind) => {
            let (width, height) = open(&bytes, kind, format, limits(DECODER_SLACK_BYTES))?.dimensions();
            let texels = check_size(u64::from(width), u64::from(height), credited(format, bytes.len() as u64))?;
            (texels, if kind == ImageFormat::Hdr { 16 } else { 4 })
        }
    };
    Ok(Header { texels, bytes: texels * texel_bytes })
}

pub(super) fn decode(encoded: Encoded, format: &Format) -> Result<Image, String> {
    let bytes = bytes(encoded)?;
    let kind = match known(format)? {
        Known::Exr => return decode_exr(&bytes),
        Known::Image(kind) => kind,
    };
    let (width, height) = open(&bytes, kind, format, limits(DECODER_SLACK_BYTES))?.dimensions();
    let texels = check_size(u64::from(width), u64::from(height), credited(format, bytes.len() as u64))?;
    // The decoder fills up with grey what is cut off.
    if kind == ImageFormat::Jpeg && !bytes.windows(2).rev().any(|pair| pair == JPEG_END) {
        return Err(broken(format, "no end of the image: the file is cut off"));
    }
    let decoder = open(&bytes, kind, format, limits(16 * texels + DECODER_SLACK_BYTES))?;
    let image = DynamicImage::from_decoder(decoder).map_err(|reason| broken(format, &reason.to_string()))?;
    let (width, height) = (width as usize, height as usize);
    if kind == ImageFormat::Hdr {
        let texels: Vec<[f32; 4]> = image.into_rgb32f().pixels().map(|p| [p[0], p[1], p[2], 1.0]).collect();
        return Ok(Image { width, height, texels: texels.into(), integers: false });
    }
    let texels = image.into_rgba8().pixels().map(|pixel| pixel.0).collect();
    Ok(Image { width, height, texels, integers: true })
}

enum Known {
    Exr,
    Image(ImageFormat),
}

fn known(format: &Format) -> Result<Known, String> {
    match format.name.as_str() {
        "png" => Ok(Known::Image(ImageFormat::Png)),
        "jpeg" => Ok(Known::Image(ImageFormat::Jpeg)),
        "webp" => Ok(Known::Image(ImageFormat::WebP)),
        "hdr" => Ok(Known::Image(ImageFormat::Hdr)),
        "openexr" => Ok(Known::Exr),
        _ => Err(format!(
            "expected PNG, JPEG or WebP, OpenEXR or Radiance .hdr, found {}, which needs a build with the feature 'oiio'",
            format.title
        )),
    }
}

fn bytes<'a>(encoded: Encoded<'a>) -> Result<Cow<'a, [u8]>, String> {
    match encoded {
        Encoded::File(path) => std::fs::read(path).map(Cow::Owned).map_err(|reason| reason.to_string()),
        Encoded::Bytes(bytes) => Ok(Cow::Borrowed(bytes)),
    }
}

fn open<'b>(
    bytes: &'b [u8],
    kind: ImageFormat,
    format: &Format,
    limits: Limits,
) -> Result<impl ImageDecoder + use<'b>, String> {
    let mut reader = ImageReader::with_format(Cursor::new(bytes), kind);
    reader.limits(limits);
    reader.into_decoder().map_err(|reason| broken(format, &reason.to_string()))
}

fn limits(bytes: u64) -> Limits {
    let mut limits = Limits::default();
    limits.max_alloc = Some(bytes);
    limits
}

/// Texels of the largest part.
fn exr_size(bytes: &[u8]) -> Result<u64, String> {
    use exr::prelude::*;
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(exr_broken)?;
    let mut most = 0;
    for header in &meta.headers {
        let (width, height) = (header.layer_size.0 as u64, header.layer_size.1 as u64);
        most = most.max(check_size(width, height, bytes.len() as u64)?);
    }
    Ok(most)
}

fn exr_broken(reason: exr::error::Error) -> String {
    format!("expected OpenEXR with channels R, G and B, found {reason}")
}

fn decode_exr(bytes: &[u8]) -> Result<super::decode::Image, String> {
    use exr::prelude::*;
    exr_size(bytes)?;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size: Vec2<usize>, _: &RgbChannels| (size.0, vec![[0.0, 0.0, 0.0, 1.0]; size.area()]),
            |(width, texels): &mut (usize, Vec<[f32; 4]>), at: Vec2<usize>, (r, g, b): (f32, f32, f32)| {
                texels[at.1 * *width + at.0] = [r, g, b, 1.0];
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(exr_broken)?;
    let size = image.layer_data.size;
    Ok(super::decode::Image {
        width: size.0,
        height: size.1,
        texels: image.layer_data.channel_data.pixels.1.into(),
        integers: false,
    })
}
