//! Image files before decoding: which format they have, and whether the size that their header promises may be
//! believed.
//!
//! Sizes in headers are checked before anything is allocated: at most 2²⁸ texels (16384²), and never more than the
//! file's own length can possibly expand to. A file's format follows from its bytes, whatever its name says, and is one
//! of a short list whose readers are fuzzed. [`Decoder::Any`] adds the formats that OpenImageIO tells by the end of a
//! name: some of those readers crash on hostile files.

use std::io::{Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

use super::problem::Problem;
use crate::input;

/// Texels of the largest image that is decoded.
pub const MOST_TEXELS: u64 = 1 << 28;
/// Texels of the largest image in tiles, which need not be in memory at once.
#[cfg(feature = "oiio")]
pub(super) const MOST_TILED_TEXELS: u64 = 1 << 34;
/// Deflate expands a byte to at most 1032, and a byte holds eight texels of a 1-bit PNG. The other formats expand less
/// (EXR's run lengths by 64, Radiance's by 32 texels a byte, JPEG by 512).
const MOST_TEXELS_PER_BYTE: u64 = 8 * 1032;

/// Bytes of the texels that are decoded at a time: a row of tiles, or a strip of scan lines. A file of a few hundred
/// bytes can name tiles as large as its image.
pub(super) const MOST_STRIP_BYTES: u64 = 1 << 30;

/// Rows that are read at once from a file without tiles: the library keeps a second copy of them meanwhile.
#[cfg(feature = "oiio")]
pub(super) const STRIP: u32 = 64;

/// An image before decoding.
#[derive(Clone, Copy, Debug)]
pub enum Encoded<'a> {
    /// A regular file.
    File(&'a Path),
    /// Bytes inside another file.
    Bytes(&'a [u8]),
}

/// What a header promises.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Texels of all levels.
    pub texels: u64,
    /// Bytes of them in memory.
    pub bytes: u64,
}

/// Who decodes, and what.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decoder {
    /// OpenImageIO; in builds without it, the crates.
    Default,
    /// The crates, in every build.
    Crates,
    /// As `Default`; besides the formats of the list, any that OpenImageIO reads. Hostile files can crash or hang the
    /// process, and some formats read other files.
    Any,
}

/// Bytes that are looked at first: a TGA header.
const HEADER: usize = 18;

/// What is expected, for messages.
const EXPECTED: &str = "PNG, JPEG or WebP, OpenEXR or Radiance .hdr";

/// Formats told by their first bytes: OpenImageIO's name, ours, the bytes.
const MAGIC: [(&str, &str, &[u8]); 11] = [
    ("png", "PNG", b"\x89PNG"),
    ("jpeg", "JPEG", b"\xff\xd8\xff"),
    ("openexr", "OpenEXR", b"\x76\x2f\x31\x01"),
    ("hdr", "Radiance .hdr", b"#?"),
    ("tiff", "TIFF", b"II*\0"),
    ("tiff", "TIFF", b"MM\0*"),
    ("tiff", "TIFF", b"II+\0"),
    ("tiff", "TIFF", b"MM\0+"),
    ("dpx", "DPX", b"SDPX"),
    ("dpx", "DPX", b"XPDS"),
    ("ktx2", "KTX2", KTX2),
];

/// How a KTX2 file begins.
pub(super) const KTX2: &[u8] = b"\xabKTX 20\xbb\r\n\x1a\n";

/// Where a DPX header says how many bytes of the user's follow it.
const DPX_USER_LENGTH: Range<usize> = 32..36;

/// How a TGA file of version 2 ends. Version 1 has no mark.
const TGA_END: &[u8] = b"TRUEVISION-XFILE.\0";

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

#[cfg(feature = "oiio")]
impl Format {
    /// Whether files of this format may be stored in tiles.
    pub(super) fn has_tiles(&self) -> bool {
        !self.certain || self.name == "tiff" || self.name == "openexr"
    }
}

impl Encoded<'_> {
    /// Length in bytes.
    pub(super) fn len(&self) -> Result<u64, Problem> {
        match self {
            Encoded::File(path) => {
                std::fs::metadata(path).map(|data| data.len()).map_err(|reason| Problem::reading(path, reason))
            }
            Encoded::Bytes(bytes) => Ok(bytes.len() as u64),
        }
    }

    /// The first bytes, or all.
    pub(super) fn first_bytes(&self, count: usize) -> Result<Vec<u8>, Problem> {
        match self {
            Encoded::File(path) => {
                input::read_at_most(path, count as u64).map_err(|reason| Problem::reading(path, reason))
            }
            Encoded::Bytes(bytes) => Ok(bytes[..bytes.len().min(count)].to_vec()),
        }
    }

    fn last_bytes(&self, count: usize) -> Result<Vec<u8>, Problem> {
        let read = |path: &Path| {
            let (mut file, length) = input::open(path)?;
            let mut last = Vec::new();
            file.seek(SeekFrom::Start(length.saturating_sub(count as u64)))?;
            file.take(count as u64).read_to_end(&mut last)?;
            Ok(last)
        };
        match self {
            Encoded::File(path) => read(path).map_err(|reason| Problem::reading(path, reason)),
            Encoded::Bytes(bytes) => Ok(bytes[bytes.len().saturating_sub(count)..].to_vec()),
        }
    }

    /// Whether the user's bytes that a DPX header names are there. OpenImageIO 2.4 allocates as many as it says before
    /// it reads them, and ends the process where their number takes 32 bits. (SMPTE 268M: the word behind the lengths
    /// of the two headers; all bits set is none.)
    fn check_dpx(&self, format: &Format) -> Result<(), Problem> {
        let first = self.first_bytes(DPX_USER_LENGTH.end)?;
        let Some(Ok(word)) = first.get(DPX_USER_LENGTH).map(<[u8; 4]>::try_from) else { return Ok(()) };
        let named = if first.starts_with(b"XPDS") { u32::from_le_bytes(word) } else { u32::from_be_bytes(word) };
        let length = self.len()?;
        if named != u32::MAX && u64::from(named) > length {
            let reason = format!("{named} bytes of user data in a file of {length} bytes");
            return Err(broken(format, &reason).into());
        }
        Ok(())
    }

    /// End of the file's name, lower case.
    fn extension(&self) -> Option<String> {
        match self {
            Encoded::File(path) => path.extension().map(|end| end.to_string_lossy().to_lowercase()),
            Encoded::Bytes(_) => None,
        }
    }

    pub(super) fn format(&self, decoder: Decoder) -> Result<Format, Problem> {
        let first = self.first_bytes(HEADER)?;
        let named = |name: &str, title: &str| Format { name: name.into(), title: title.into(), certain: true };
        if let Some((name, title, _)) = MAGIC.iter().find(|(_, _, magic)| first.starts_with(magic)) {
            let format = named(name, title);
            if *name == "dpx" {
                self.check_dpx(&format)?;
            }
            return Ok(format);
        }
        if first.starts_with(b"RIFF") && first.get(8..12) == Some(b"WEBP") {
            return Ok(named("webp", "WebP"));
        }
        let extension = self.extension();
        let may_be_tga = is_tga_header(&first);
        if may_be_tga && (extension.as_deref() == Some("tga") || self.last_bytes(TGA_END.len())? == TGA_END) {
            return Ok(named("targa", "TGA"));
        }
        // A format with known first bytes is ruled out when the file does not begin with them.
        let without_magic = |end: &String| !KNOWN_ENDS.contains(&end.as_str());
        match extension.filter(without_magic) {
            Some(end) if cfg!(feature = "oiio") && decoder == Decoder::Any => {
                Ok(Format { title: format!(".{end}"), name: end, certain: false })
            }
            _ => {
                let others = match decoder {
                    Decoder::Any => ", TIFF, TGA or DPX, or a format that OpenImageIO knows by the end of the name",
                    Decoder::Default if cfg!(feature = "oiio") => {
                        ", TIFF, TGA or DPX (others with --image-formats all)"
                    }
                    _ => "",
                };
                let found = first[..first.len().min(8)].escape_ascii().to_string();
                Err(format!("expected {EXPECTED}{others}, found bytes that begin `{found}`").into())
            }
        }
    }
}

/// Ends of names of formats that are told by their bytes.
const KNOWN_ENDS: [&str; 11] = ["png", "jpg", "jpeg", "exr", "hdr", "tif", "tiff", "tx", "webp", "tga", "dpx"];

/// Whether the first bytes may be those of a TGA file that is read: its kinds of images, and their depths. Not those of
/// colour maps (kinds 1 and 9): OpenImageIO 2.4 looks colours up beyond the end of the map where a file has such
/// numbers.
fn is_tga_header(first: &[u8]) -> bool {
    let [_, map, kind, .., width_low, width_high, height_low, height_high, depth, flags] = first else { return false };
    let [width, height] = [[*width_low, *width_high], [*height_low, *height_high]].map(u16::from_le_bytes);
    first.len() == HEADER
        && *map == 0
        && [2, 3, 10, 11].contains(kind)
        && [8, 15, 16, 24, 32].contains(depth)
        && width > 0
        && height > 0
        && flags & 0xC0 == 0
}

/// What to say of an image that its decoder refuses.
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

/// Length of a file by which its size is judged. A WebP of one colour takes some 30 bytes whatever its size: 16 million
/// texels are believed of any.
pub(super) fn credited(format: &Format, file_bytes: u64) -> u64 {
    const WEBP_BYTES: u64 = 2048;
    if format.name == "webp" { file_bytes.max(WEBP_BYTES) } else { file_bytes }
}

/// As [`check_size`], with at most `most` texels.
pub(super) fn check_size_within(most: u64, width: u64, height: u64, file_bytes: u64) -> Result<u64, String> {
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

/// What to say of texels that are not finite. `first_row` is the row of the first of them.
pub(super) fn not_finite(texels: &[[f32; 4]], width: usize, first_row: usize) -> Option<String> {
    let bad = |texel: &[f32; 4]| !texel.iter().all(|channel| channel.is_finite());
    let first = texels.iter().position(bad)?;
    let count = texels.iter().filter(|texel| bad(texel)).count();
    let (x, y) = (first % width, first / width + first_row);
    Some(format!("expected finite texels, found {count} texels with NaN or infinity, the first at ({x}, {y})"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A DPX header may not name more bytes than the file has. Oracle: the seed of the image target is refused, in
    /// both orders of bytes; those that name none are read on.
    #[test]
    fn user_data_of_dpx_is_there() {
        let seed = include_bytes!("../../fuzz/seeds/images/hostile-user-data.dpx");
        let refusal = |bytes: &[u8]| match Encoded::Bytes(bytes).format(Decoder::Default) {
            Ok(format) => format.name,
            Err(Problem::Image(line)) => line,
            Err(other) => panic!("{other:?}"),
        };
        assert!(refusal(seed).contains("2566914048 bytes of user data"), "{}", refusal(seed));
        for (magic, bytes) in [(b"SDPX", [0x7f, 0, 0, 0]), (b"XPDS", [0, 0, 0, 0x7f])] {
            let mut file = seed.to_vec();
            file[..4].copy_from_slice(magic);
            file[DPX_USER_LENGTH].copy_from_slice(&bytes);
            assert!(refusal(&file).contains("2130706432 bytes of user data"), "{}", refusal(&file));
            for none in [[0; 4], [0xff; 4]] {
                file[DPX_USER_LENGTH].copy_from_slice(&none);
                assert_eq!(refusal(&file), "dpx");
            }
            file.truncate(30);
            assert_eq!(refusal(&file), "dpx");
        }
    }

    /// A TGA is read without a colour map alone. Oracle: the files' own headers.
    #[test]
    fn colour_maps_of_tga_are_refused() {
        let format = |file: &[u8]| {
            let file = [file, TGA_END].concat();
            Encoded::Bytes(&file).format(Decoder::Default).ok().map(|format| format.name)
        };
        let plain = include_bytes!("../../fuzz/seeds/images/alpha.tga");
        let mapped = include_bytes!("../../fuzz/seeds/images/palette.tga");
        assert_eq!(format(plain).as_deref(), Some("targa"));
        for (map, kind) in [(1, 1), (1, 9), (0, 1), (0, 9), (1, 2)] {
            let mut file = mapped.to_vec();
            (file[1], file[2]) = (map, kind);
            assert_eq!(format(&file), None, "{map}, {kind}");
        }
    }
}
