//! Decoding of image files to texels: PNG, JPEG, WebP, KTX2, Radiance and OpenEXR in Rust; through OpenImageIO,
//! where it is built in, TIFF, TGA and DPX, and OpenEXR in tiles or of other channels and compressions.
//!
//! Colour profiles and gamma chunks are not applied (glTF 2.0 §3.8.3: ignored), nothing is multiplied by alpha. Texels
//! that are not finite are an error. The image of an OpenEXR file is its display window, 0 where it stores no texels.
//! Limits: no deep data, no volumes; images inside a glTF are those that are told by their first bytes.

use std::panic::{AssertUnwindSafe, catch_unwind};

use super::crates;
pub use super::encoded::{Decoder, Encoded, Header, MOST_TEXELS};
use super::encoded::{Format, broken};
use super::exr_header;
pub use super::image::Image;
#[cfg(feature = "basisu")]
use super::ktx2;
#[cfg(feature = "oiio")]
use super::oiio::Reader;
#[cfg(feature = "oiio")]
use super::plane::{Plane, Rows};
pub use super::problem::Problem;
#[cfg(feature = "oiio")]
use super::reader::{open, read_level};
use super::texels::Texels;

/// Reads the header alone. The error says what was expected and found.
pub fn inspect(encoded: Encoded, decoder: Decoder) -> Result<Header, Problem> {
    let file = Known::of(encoded, decoder)?;
    #[cfg(feature = "basisu")]
    if file.format.name == "ktx2" {
        return Ok(refused_if_it_fails(&file.format, || ktx2::inspect(encoded))?);
    }
    #[cfg(feature = "oiio")]
    if !file.in_rust {
        let reader = open(encoded, &file.format)?;
        let info = reader.info();
        let levels: u64 = info.levels.iter().map(|&(width, height)| width as u64 * height as u64).sum();
        let texels = match &file.exr {
            Some(header) => levels.max(crates::exr_texels(header, encoded.len()?)?),
            None => levels,
        };
        return Ok(Header { texels, bytes: texels * if info.eight_bits { 4 } else { 16 } });
    }
    Ok(refused_if_it_fails(&file.format, || crates::inspect(encoded, &file.format))?)
}

/// Decodes an image into memory. The error says what was expected and found.
pub fn decode(encoded: Encoded, decoder: Decoder) -> Result<Image, Problem> {
    let image = decode_any(encoded, decoder)?;
    image.check_finite()?;
    Ok(image)
}

/// As [`decode`]; texels may be infinite or NaN.
pub(crate) fn decode_any(encoded: Encoded, decoder: Decoder) -> Result<Image, Problem> {
    let file = Known::of(encoded, decoder)?;
    let image = decode_stored(encoded, &file)?;
    match &file.exr {
        Some(header) if !header.is_whole() => Ok(framed(&image, header)?),
        _ => Ok(image),
    }
}

/// Decodes what the file stores.
fn decode_stored(encoded: Encoded, file: &Known) -> Result<Image, Problem> {
    #[cfg(feature = "basisu")]
    if file.format.name == "ktx2" {
        return Ok(refused_if_it_fails(&file.format, || ktx2::decode(encoded))?);
    }
    #[cfg(feature = "oiio")]
    if !file.in_rust {
        return Ok(read_all(&mut open(encoded, &file.format)?, &file.format)?);
    }
    Ok(refused_if_it_fails(&file.format, || crates::decode(encoded, &file.format))?)
}

/// A decoder that panics has met a file that it should have refused: that is what the file's error says.
fn refused_if_it_fails<T>(format: &Format, decode: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(decode)).unwrap_or_else(|_| Err(broken(format, "bytes at which its decoder fails")))
}

/// What decides how a file is decoded.
struct Known {
    format: Format,
    /// Of OpenEXR files.
    exr: Option<exr_header::Header>,
    #[cfg(feature = "oiio")]
    in_rust: bool,
}

impl Known {
    fn of(encoded: Encoded, decoder: Decoder) -> Result<Known, Problem> {
        let format = encoded.format(decoder)?;
        let exr = (format.name == "openexr").then(|| crates::exr_header(encoded)).transpose()?;
        #[cfg(feature = "oiio")]
        let in_rust = decoder == Decoder::Crates
            || match &exr {
                Some(header) => crates::reads_exr(header),
                None => crates::reads(&format, encoded)?,
            };
        Ok(Known {
            format,
            exr,
            #[cfg(feature = "oiio")]
            in_rust,
        })
    }
}

/// Whether look-ups may read tiles where a file stores them: they are the image.
#[cfg(feature = "oiio")]
pub(super) fn stores_the_image(encoded: Encoded, format: &Format) -> Result<bool, Problem> {
    let exr = (format.name == "openexr").then(|| crates::exr_header(encoded)).transpose()?;
    Ok(format.has_tiles() && exr.is_none_or(|header| header.is_whole()))
}

/// The display window, of an image that has the texels of the data window.
fn framed(stored: &Image, header: &exr_header::Header) -> Result<Image, String> {
    let (data, display) = (header.data, header.display);
    if (stored.width as u64, stored.height as u64) != (data.width(), data.height()) {
        return Err("expected the layer of the first part, found another with another window".into());
    }
    let (width, height) = (display.width() as usize, display.height() as usize);
    let outside = [0.0, 0.0, 0.0, if header.has("A") { 0.0 } else { 1.0 }];
    let mut texels = vec![outside; width * height];
    let (left, right) = (data.left.max(display.left), data.right.min(display.right));
    if let (Texels::Float(plane), true) = (&stored.texels, left < right) {
        for y in data.top.max(display.top)..data.bottom.min(display.bottom) {
            let from = (y - data.top) as usize * stored.width;
            let row = &plane.base[from + (left - data.left) as usize..from + (right - data.left) as usize];
            let to = (y - display.top) as usize * width + (left - display.left) as usize;
            texels[to..to + row.len()].copy_from_slice(row);
        }
    }
    Ok(Image { width, height, texels: texels.into(), integers: stored.integers })
}

#[cfg(feature = "oiio")]
fn read_all(reader: &mut Reader, format: &Format) -> Result<Image, String> {
    let sizes = reader.info().levels.clone();
    let (mut eight, mut float) = (Vec::new(), Vec::new());
    let base = read_level(reader, 0, format)?;
    for (level, &(width, height)) in sizes.iter().enumerate().skip(1) {
        match read_level(reader, level, format)? {
            Rows::Eight(texels) => eight.push((width, height, texels)),
            Rows::Float(texels) => float.push((width, height, texels)),
        }
    }
    let texels = match base {
        Rows::Eight(base) => Texels::Eight(Plane::with_levels(base.into(), eight)),
        Rows::Float(base) => Texels::Float(Plane::with_levels(base.into(), float)),
    };
    Ok(Image { width: sizes[0].0, height: sizes[0].1, texels, integers: reader.info().integers })
}
