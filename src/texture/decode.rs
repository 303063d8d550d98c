//! Decoding of image files to texels: through OpenImageIO where it is built in, else PNG, JPEG, WebP, Radiance and OpenEXR by crates.
//!
//! Sizes in headers are checked before anything is allocated: at most 2²⁸ texels (16384²), and never more than the file's
//! own length can possibly expand to. Which format a file has is told by its first bytes, else by the end of its name; no
//! other is tried. Colour profiles and gamma chunks are not applied (glTF 2.0 §3.8.3: ignored), nothing is multiplied by alpha.
//! Texels that are not finite are an error. Limits: no deep data, no volumes; images inside a glTF are PNG, JPEG, WebP, TIFF, EXR or
//! Radiance.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::texels::decode_colors;
use super::{ColorSpace, Plane, Texels, crates};
#[cfg(feature = "oiio")]
use super::{Rows, oiio::Reader};

/// Texels of the largest image that is decoded.
pub const MOST_TEXELS: u64 = 1 << 28;
/// Texels of the largest image in tiles, which need not be in memory at once.
#[cfg(feature = "oiio")]
const MOST_TILED_TEXELS: u64 = 1 << 34;
/// Deflate expands a byte to at most 1032, and a byte holds eight texels of a 1-bit PNG. The other formats expand less
/// (EXR's run lengths by 64, Radiance's by 32 texels a byte, JPEG by 512).
const MOST_TEXELS_PER_BYTE: u64 = 8 * 1032;

/// Who decodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decoder {
    /// OpenImageIO; in builds without it, the crates.
    Default,
    /// The crates, in every build.
    Crates,
}

/// An image before decoding.
#[derive(Clone, Copy, Debug)]
pub enum Encoded<'a> {
    /// A regular file.
    File(&'a Path),
    /// Bytes inside another file.
    Bytes(&'a [u8]),
}

/// A decoded image.
#[derive(Clone, Debug)]
pub struct Image {
    /// Columns, > 0.
    pub width: usize,
    /// Rows, > 0.
    pub height: usize,
    /// Never [`Texels::Udim`].
    pub texels: Texels,
    /// Integers in the file, so that colours are encoded by the sRGB curve.
    pub integers: bool,
}

impl Image {
    /// One texel.
    pub fn constant(texel: [u8; 4]) -> Self {
        Image { width: 1, height: 1, texels: vec![texel].into(), integers: true }
    }

    /// The texels as a texture of this colour space keeps them: colours of 16 bits are decoded here, those of 8 bits when they are
    /// looked up.
    pub fn texels_in(&self, color_space: ColorSpace) -> Texels {
        match &self.texels {
            Texels::Float(plane) if self.integers && color_space == ColorSpace::Srgb => {
                let mut base = plane.base.to_vec();
                decode_colors(&mut base);
                let mut levels = plane.levels().to_vec();
                levels.iter_mut().for_each(|(_, _, texels)| decode_colors(texels));
                Texels::Float(Plane::with_levels(base.into(), levels))
            }
            // Levels that are made belong to one colour space.
            Texels::Eight(plane) => Texels::Eight(Plane::with_levels(plane.base.clone(), plane.levels().to_vec())),
            other => other.clone(),
        }
    }
}

/// What a header promises.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Texels of all levels.
    pub texels: u64,
    /// Bytes of them in memory.
    pub bytes: u64,
}

/// Formats told by their first bytes: OpenImageIO's name, ours, the bytes.
const MAGIC: [(&str, &str, &[u8]); 8] = [
    ("png", "PNG", b"\x89PNG"),
    ("jpeg", "JPEG", b"\xff\xd8\xff"),
    ("openexr", "OpenEXR", b"\x76\x2f\x31\x01"),
    ("hdr", "Radiance .hdr", b"#?"),
    ("tiff", "TIFF", b"II*\0"),
    ("tiff", "TIFF", b"MM\0*"),
    ("tiff", "TIFF", b"II+\0"),
    ("tiff", "TIFF", b"MM\0+"),
];

/// A format by name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Format {
    /// OpenImageIO's name, or the end of the file's name.
    pub(super) name: String,
    /// For messages.
    pub(super) title: String,
    /// Told by the bytes, so that the file at least begins as it should.
    pub(super) certain: bool,
}

impl Encoded<'_> {
    /// Length in bytes.
    #[cfg(feature = "oiio")]
    pub(super) fn len(&self) -> Result<u64, String> {
        match self {
            Encoded::File(path) => std::fs::metadata(path).map(|data| data.len()).map_err(|reason| reason.to_string()),
            Encoded::Bytes(bytes) => Ok(bytes.len() as u64),
        }
    }

    fn first_bytes(&self) -> Result<Vec<u8>, String> {
        match self {
            Encoded::File(path) => {
                let mut first = Vec::new();
                let file = File::open(path).map_err(|reason| reason.to_string())?;
                file.take(16).read_to_end(&mut first).map_err(|reason| reason.to_string())?;
                Ok(first)
            }
            Encoded::Bytes(bytes) => Ok(bytes[..bytes.len().min(16)].to_vec()),
        }
    }

    pub(super) fn format(&self) -> Result<Format, String> {
        let first = self.first_bytes()?;
        let named = |name: &str, title: &str| Format { name: name.into(), title: title.into(), certain: true };
        if let Some((name, title, _)) = MAGIC.iter().find(|(_, _, magic)| first.starts_with(magic)) {
            return Ok(named(name, title));
        }
        if first.starts_with(b"RIFF") && first.get(8..12) == Some(b"WEBP") {
            return Ok(named("webp", "WebP"));
        }
        let extension = match self {
            Encoded::File(path) => path.extension().map(|end| end.to_string_lossy().to_lowercase()),
            Encoded::Bytes(_) => None,
        };
        // What has first bytes of its own and does not begin with them is none of these.
        let without_magic =
            |end: &String| !["png", "jpg", "jpeg", "exr", "hdr", "tif", "tiff", "tx", "webp"].contains(&end.as_str());
        match extension.filter(without_magic) {
            Some(end) if cfg!(feature = "oiio") => Ok(Format { title: format!(".{end}"), name: end, certain: false }),
            _ => {
                let others = if cfg!(feature = "oiio") { ", or another format that OpenImageIO reads" } else { "" };
                let found = first[..first.len().min(8)].escape_ascii().to_string();
                Err(format!(
                    "expected PNG, JPEG or WebP, OpenEXR or Radiance .hdr{others}, found bytes that begin `{found}`"
                ))
            }
        }
    }
}

/// Reads the header alone. The error says what was expected and found.
pub fn inspect(encoded: Encoded, decoder: Decoder) -> Result<Header, String> {
    let format = encoded.format()?;
    #[cfg(feature = "oiio")]
    if decoder == Decoder::Default {
        let reader = open(encoded, &format)?;
        let info = reader.info();
        let texels = info.levels.iter().map(|&(width, height)| width as u64 * height as u64).sum();
        return Ok(Header { texels, bytes: texels * if info.eight_bits { 4 } else { 16 } });
    }
    let _ = decoder;
    crates::inspect(encoded, &format)
}

/// Decodes an image into memory. The error says what was expected and found.
pub fn decode(encoded: Encoded, decoder: Decoder) -> Result<Image, String> {
    let format = encoded.format()?;
    #[cfg(feature = "oiio")]
    if decoder == Decoder::Default {
        return read_all(&mut open(encoded, &format)?, &format);
    }
    let _ = decoder;
    let image = crates::decode(encoded, &format)?;
    check_finite(&image)?;
    Ok(image)
}

/// Opens an image and holds its size against its length.
#[cfg(feature = "oiio")]
pub(super) fn open<'b>(encoded: Encoded<'b>, format: &Format) -> Result<Reader<'b>, String> {
    let (path, bytes) = match encoded {
        Encoded::File(path) => (path.to_path_buf(), None),
        Encoded::Bytes(bytes) => (std::path::PathBuf::from(format!("image.{}", format.name)), Some(bytes)),
    };
    let reader = Reader::open(&path, &format.name, bytes).map_err(|reason| broken(format, &reason))?;
    let (width, height) = reader.info().levels[0];
    let most = if reader.info().tile_rows.is_some() { MOST_TILED_TEXELS } else { MOST_TEXELS };
    check_size_within(most, width as u64, height as u64, credited(format, encoded.len()?))?;
    Ok(reader)
}

/// Rows that are read at once from a file without tiles: the library keeps a second copy of them meanwhile.
#[cfg(feature = "oiio")]
pub(super) const STRIP: u32 = 64;

/// One level, strip by strip.
#[cfg(feature = "oiio")]
pub(super) fn read_level(reader: &mut Reader, level: usize, format: &Format) -> Result<Rows, String> {
    let (width, height) = reader.info().levels[level];
    let step = reader.info().tile_rows.unwrap_or(STRIP) as usize;
    let (mut eight, mut float) = (Vec::new(), Vec::new());
    if reader.info().eight_bits {
        eight.reserve_exact(width * height);
    } else {
        float.reserve_exact(width * height);
    }
    for first in (0..height).step_by(step) {
        match reader.read(level, first..(first + step).min(height)).map_err(|reason| broken(format, &reason))? {
            Rows::Eight(texels) => eight.extend(texels),
            Rows::Float(texels) => match not_finite(&texels, width, first) {
                None => float.extend(texels),
                Some(problem) => return Err(problem),
            },
        }
    }
    Ok(if reader.info().eight_bits { Rows::Eight(eight) } else { Rows::Float(float) })
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

pub(super) fn broken(format: &Format, reason: &str) -> String {
    if format.certain {
        format!("expected a valid {}, found {reason}", format.title)
    } else {
        format!("expected an image that OpenImageIO reads as {}, found {reason}", format.title)
    }
}

/// Texels of an image of this size, if they may be allocated.
pub(super) fn check_size(width: u64, height: u64, file_bytes: u64) -> Result<u64, String> {
    check_size_within(MOST_TEXELS, width, height, file_bytes)
}

/// Length of a file by which its size is judged. A WebP of one colour takes some 30 bytes whatever its size: 16 million texels are
/// believed of any.
pub(super) fn credited(format: &Format, file_bytes: u64) -> u64 {
    const WEBP_BYTES: u64 = 2048;
    if format.name == "webp" { file_bytes.max(WEBP_BYTES) } else { file_bytes }
}

fn check_size_within(most: u64, width: u64, height: u64, file_bytes: u64) -> Result<u64, String> {
    let texels = width.saturating_mul(height);
    if texels == 0 || texels > most || width.max(height) > MOST_TEXELS {
        return Err(format!("expected 1 to {most} texels, found {width} × {height} in the header"));
    }
    if texels > file_bytes.saturating_mul(MOST_TEXELS_PER_BYTE) {
        return Err(format!(
            "expected {width} × {height} texels as the header says, found only {file_bytes} bytes of file"
        ));
    }
    Ok(texels)
}

fn check_finite(image: &Image) -> Result<(), String> {
    match &image.texels {
        Texels::Float(plane) => not_finite(&plane.base, image.width, 0).map_or(Ok(()), Err),
        _ => Ok(()),
    }
}

/// What to say of texels that are not finite. `first_row` is the row of the first of them.
pub(super) fn not_finite(texels: &[[f32; 4]], width: usize, first_row: usize) -> Option<String> {
    let bad = |texel: &[f32; 4]| !texel.iter().all(|channel| channel.is_finite());
    let first = texels.iter().position(bad)?;
    let count = texels.iter().filter(|texel| bad(texel)).count();
    let (x, y) = (first % width, first / width + first_row);
    Some(format!("expected finite texels, found {count} texels with NaN or infinity, the first at ({x}, {y})"))
}
