//! Decoding in Rust: PNG, JPEG, WebP and Radiance by the `image` crate, OpenEXR by `exr`.
//!
//! OpenEXR is decoded by the thread that asks: images are decoded side by side anyway, and a fault of the crate in a
//! thread of its own pool would abort the process.
//!
//! Limits: EXR needs channels of halves or floats named R, G and B, or Y, in its first layer; the largest level of a
//! pyramid alone is read; no DWA compression.

use std::borrow::Cow;
use std::io::{BufRead, BufReader, Cursor, Seek};

use image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use super::encoded::{Encoded, Format, Header as Size, broken, check_size, credited};
use super::exr_header::{Header, MOST_HEADER_BYTES, header};
use super::image::Image;
#[cfg(feature = "oiio")]
use super::problem::Problem;
use crate::input;

/// Working memory a decoder may take beyond 16 bytes a texel.
const DECODER_SLACK_BYTES: u64 = 64 << 20;

/// Length by which the size of a display window is judged at least: what lies outside of the data window takes none.
const EMPTY_BYTES: u64 = 2048;

/// Marker at the end of a JPEG.
const JPEG_END: [u8; 2] = [0xff, 0xd9];

pub(super) fn inspect(encoded: Encoded, format: &Format) -> Result<Size, String> {
    let length = encoded.len().map_err(|problem| problem.to_string())?;
    let (texels, texel_bytes) = match known(format)? {
        Known::Exr => (exr_texels(&exr_header(encoded)?, length)?, 16),
        Known::Image(kind) => {
            let (size, color) = match encoded {
                Encoded::Bytes(bytes) => {
                    described(open(Cursor::new(bytes), kind, format, limits(DECODER_SLACK_BYTES))?)
                }
                Encoded::File(path) => {
                    let (file, _) = input::open(path).map_err(|reason| reason.to_string())?;
                    described(open(BufReader::new(file), kind, format, limits(DECODER_SLACK_BYTES))?)
                }
            };
            let texels = check_size(u64::from(size.0), u64::from(size.1), credited(format, length))?;
            (texels, if kind == ImageFormat::Hdr || has_sixteen_bits(color) { 16 } else { 4 })
        }
    };
    Ok(Size { texels, bytes: texels * texel_bytes })
}

fn described(decoder: impl ImageDecoder) -> ((u32, u32), ColorType) {
    (decoder.dimensions(), decoder.color_type())
}

/// What the header of an OpenEXR file says.
pub(super) fn exr_header(encoded: Encoded) -> Result<Header, String> {
    let length = encoded.len().map_err(|problem| problem.to_string())?;
    match encoded {
        Encoded::Bytes(bytes) => header(bytes, length),
        Encoded::File(path) => {
            let bytes = input::read_at_most(path, MOST_HEADER_BYTES).map_err(|reason| reason.to_string())?;
            header(&bytes, length)
        }
    }
    .map_err(|reason| format!("expected a valid OpenEXR, found {reason}"))
}

pub(super) fn decode(encoded: Encoded, format: &Format) -> Result<Image, String> {
    let bytes = bytes(encoded)?;
    let kind = match known(format)? {
        Known::Exr => return decode_exr(&bytes),
        Known::Image(kind) => kind,
    };
    let (width, height) = open(Cursor::new(&*bytes), kind, format, limits(DECODER_SLACK_BYTES))?.dimensions();
    let texels = check_size(u64::from(width), u64::from(height), credited(format, bytes.len() as u64))?;
    // The decoder fills up with grey what is cut off.
    if kind == ImageFormat::Jpeg && !bytes.windows(2).rev().any(|pair| pair == JPEG_END) {
        return Err(broken(format, "no end of the image: the file is cut off"));
    }
    let decoder = open(Cursor::new(&*bytes), kind, format, limits(16 * texels + DECODER_SLACK_BYTES))?;
    let image = DynamicImage::from_decoder(decoder).map_err(|reason| broken(format, &reason.to_string()))?;
    let (width, height) = (width as usize, height as usize);
    if kind == ImageFormat::Hdr {
        let texels: Vec<[f32; 4]> = image.into_rgb32f().pixels().map(|p| [p[0], p[1], p[2], 1.0]).collect();
        return Ok(Image { width, height, texels: texels.into(), integers: false });
    }
    if has_sixteen_bits(image.color()) {
        let texels: Vec<[f32; 4]> = image.into_rgba16().pixels().map(|p| p.0.map(|c| f32::from(c) / 65535.0)).collect();
        return Ok(Image { width, height, texels: texels.into(), integers: true });
    }
    // At once: collected one by one they would stand in memory three times.
    let texels = image.into_rgba8().as_raw().as_chunks().0.into();
    Ok(Image { width, height, texels, integers: true })
}

fn has_sixteen_bits(color: ColorType) -> bool {
    matches!(color, ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16)
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
            "expected PNG, JPEG or WebP, OpenEXR or Radiance .hdr, found {}, which needs a build with the feature \
             'oiio' (KTX2: 'basisu')",
            format.title
        )),
    }
}

fn bytes<'a>(encoded: Encoded<'a>) -> Result<Cow<'a, [u8]>, String> {
    match encoded {
        Encoded::File(path) => input::read(path).map(Cow::Owned).map_err(|reason| reason.to_string()),
        Encoded::Bytes(bytes) => Ok(Cow::Borrowed(bytes)),
    }
}

fn open<'b, R: BufRead + Seek + 'b>(
    bytes: R,
    kind: ImageFormat,
    format: &Format,
    limits: Limits,
) -> Result<impl ImageDecoder + use<'b, R>, String> {
    let mut reader = ImageReader::with_format(bytes, kind);
    reader.limits(limits);
    reader.into_decoder().map_err(|reason| broken(format, &reason.to_string()))
}

fn limits(bytes: u64) -> Limits {
    let mut limits = Limits::default();
    limits.max_alloc = Some(bytes);
    limits
}

/// Texels of the image, whether they are stored or not.
pub(super) fn exr_texels(header: &Header, length: u64) -> Result<u64, String> {
    check_size(header.data.width(), header.data.height(), length)?;
    check_size(header.display.width(), header.display.height(), length.max(EMPTY_BYTES))
}

fn exr_broken(reason: exr::error::Error) -> String {
    format!("expected OpenEXR with channels R, G and B, or Y, found {reason}")
}

/// Whether [`decode`] reads this format, and this file of Radiance's: those that begin as usual, from the top left.
#[cfg(feature = "oiio")]
pub(super) fn reads(format: &Format, encoded: Encoded) -> Result<bool, Problem> {
    /// Bytes in which the sizes stand.
    const HEADER: usize = 4096;
    if format.name != "hdr" {
        return Ok(known(format).is_ok());
    }
    let first = encoded.first_bytes(HEADER)?;
    Ok(first.starts_with(b"#?RADIANCE\n") && first.windows(4).any(|bytes| bytes == b"\n-Y "))
}

/// Whether [`decode`] reads such an OpenEXR file, all of it.
#[cfg(feature = "oiio")]
pub(super) fn reads_exr(header: &Header) -> bool {
    !header.tiled && header.plain_compression && (header.has_rgb() || header.has("Y"))
}

fn decode_exr(bytes: &[u8]) -> Result<Image, String> {
    use exr::prelude::*;
    /// Columns, and texels, which are made when the size is known.
    type Texels = (usize, Vec<[f32; 4]>);
    fn put((width, all): &mut Texels, at: Vec2<usize>, texel: [f32; 4]) {
        if let Some(place) = all.get_mut(at.1 * *width + at.0) {
            *place = texel;
        }
    }
    let header =
        header(bytes, bytes.len() as u64).map_err(|reason| format!("expected a valid OpenEXR, found {reason}"))?;
    if !header.plain_compression {
        return Err("expected OpenEXR without DWA compression, which needs a build with the feature 'oiio'".into());
    }
    exr_texels(&header, bytes.len() as u64)?;
    // The first part was judged by its size. If it is a later one that has the channels, there is room for as much.
    let judged = Vec2(header.data.width() as usize, header.data.height() as usize);
    let texels = |size: Vec2<usize>| (size.0, vec![[0.0, 0.0, 0.0, 1.0]; if size == judged { size.area() } else { 0 }]);
    let file = Cursor::new(bytes);
    let (size, all) = if header.has_rgb() || !header.has("Y") {
        let read = read()
            .no_deep_data()
            .largest_resolution_level()
            .rgba_channels(
                |size, _: &RgbaChannels| texels(size),
                |all: &mut Texels, at, (r, g, b, a): (f32, f32, f32, f32)| put(all, at, [r, g, b, a]),
            )
            .first_valid_layer()
            .all_attributes()
            .non_parallel();
        let layer = read.from_buffered(file).map_err(exr_broken)?.layer_data;
        (layer.size, layer.channel_data.pixels.1)
    } else {
        let read = read()
            .no_deep_data()
            .largest_resolution_level()
            .specific_channels()
            .required("Y")
            .optional("A", 1.0)
            .collect_pixels(
                |size, _| texels(size),
                |all: &mut Texels, at, (y, a): (f32, f32)| put(all, at, [y, y, y, a]),
            )
            .first_valid_layer()
            .all_attributes()
            .non_parallel();
        let layer = read.from_buffered(file).map_err(exr_broken)?.layer_data;
        (layer.size, layer.channel_data.pixels.1)
    };
    if size != judged {
        return Err(format!(
            "expected OpenEXR whose first part has channels R, G and B, or Y, found another part with them, of {} × {}",
            size.0, size.1
        ));
    }
    Ok(super::image::Image { width: size.0, height: size.1, texels: all.into(), integers: false })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// DWA is not the crate's to decode: it would allocate what a chunk says, here 6e15 bytes, and end the process.
    /// Oracle: both a sound file and a hostile one are refused by name, a later part as well as the first.
    #[test]
    fn dwa_is_refused() {
        let sound = include_bytes!("../../fuzz/seeds/images/dwaa.exr").to_vec();
        let hostile = include_bytes!("../../fuzz/seeds/images/hostile-dwa.exr").to_vec();
        let mut later = include_bytes!("../../fuzz/seeds/images/parts.exr").to_vec();
        let name = b"compression\0compression\0";
        let places: Vec<_> = (0..later.len()).filter(|&at| later[at..].starts_with(name)).collect();
        assert_eq!(places.len(), 2);
        later[places[1] + name.len() + 4] = 8;
        for bytes in [sound, hostile, later] {
            let problem = decode_exr(&bytes).err().unwrap_or_default();
            assert!(problem.contains("DWA"), "{problem}");
        }
    }

    /// Files of two parts, the first without a colour: the second is decoded where it is as large as the first, which
    /// was judged, and refused where it is not. Oracle: the texels that were written.
    #[test]
    fn later_parts_are_no_larger_than_was_judged() {
        let file = |size: (usize, usize)| {
            use exr::prelude::*;
            let part = |part: &str, size: (usize, usize), names: &[&str]| {
                let channel = |name: &&str| AnyChannel::new(*name, FlatSamples::F32(vec![0.5; size.0 * size.1]));
                let channels = AnyChannels::sort(names.iter().map(channel).collect());
                Layer::new(size, LayerAttributes::named(part), Encoding::UNCOMPRESSED, channels)
            };
            let parts = vec![part("depth", (4, 2), &["Z"]), part("color", size, &["R", "G", "B"])];
            let mut bytes = Vec::new();
            let image = Image::from_layers(ImageAttributes::new(IntegerBounds::from_dimensions((4, 2))), parts);
            image.write().to_buffered(Cursor::new(&mut bytes)).expect("valid parts");
            bytes
        };
        let image = decode_exr(&file((4, 2))).expect("a part as large as the first");
        assert_eq!((image.width, image.height, image.texels.constant()), (4, 2, Some([0.5, 0.5, 0.5, 1.0])));
        for other in [(8, 8), (2, 4), (1, 1)] {
            let problem = decode_exr(&file(other)).err().unwrap_or_default();
            assert!(problem.contains("first part"), "{other:?}: {problem}");
        }
    }
}
