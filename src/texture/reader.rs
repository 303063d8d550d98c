//! Images opened through OpenImageIO, with their sizes held against their lengths before anything is decoded.

use std::path::{Path, PathBuf};

use super::encoded::{
    Encoded, Format, MOST_STRIP_BYTES, MOST_TEXELS, MOST_TILED_TEXELS, STRIP, broken, check_size_within, credited,
};
use super::oiio::{self, Reader};
use super::plane::Rows;
use super::problem::Problem;
use crate::error::Error;

/// Opens an image.
pub(super) fn open<'b>(encoded: Encoded<'b>, format: &Format) -> Result<Reader<'b>, Problem> {
    let library = |problem: String| Error::Image { path: "OpenImageIO".into(), problem };
    oiio::ready().map_err(library)?;
    let (path, bytes) = match encoded {
        Encoded::File(path) => (path.to_path_buf(), None),
        Encoded::Bytes(bytes) => (PathBuf::from(format!("image.{}", format.name)), Some(bytes)),
    };
    let length = encoded.len()?;
    Ok(checked(Reader::open(&path, &format.name, bytes), format, length)?)
}

/// Opens a file of which tiles are read.
pub(super) fn open_tiled(path: &Path, format: &Format) -> Result<Reader<'static>, String> {
    // Looked at as a regular file first: a pipe in its place would wait.
    let (_, length) = crate::input::open(path).map_err(|reason| reason.to_string())?;
    checked(Reader::open(path, &format.name, None), format, length)
}

fn checked<'b>(opened: Result<Reader<'b>, String>, format: &Format, length: u64) -> Result<Reader<'b>, String> {
    let reader = opened.map_err(|reason| broken(format, &reason))?;
    let info = reader.info();
    let (width, height) = info.levels[0];
    let most = if info.tile.is_some() { MOST_TILED_TEXELS } else { MOST_TEXELS };
    check_size_within(most, width as u64, height as u64, credited(format, length))?;
    let (across, down) = info.tile.unwrap_or((1, STRIP));
    let columns = (width as u64).next_multiple_of(u64::from(across.max(1)));
    let texels = columns.saturating_mul(u64::from(down));
    // As many channels as there are while they are decoded, four of floats afterwards.
    let bytes = texels.saturating_mul(4 * u64::from(info.channels.max(4)));
    let whole = (width as u64 * height as u64).saturating_mul(4 * u64::from(info.channels.max(4)));
    if info.tile.is_none() && whole > 16 * MOST_TEXELS {
        return Err(format!("expected at most {} MB decoded, found {} MB", MOST_TEXELS >> 16, whole >> 20));
    }
    if bytes > MOST_STRIP_BYTES {
        return Err(format!(
            "expected at most {} MB to be decoded at a time, found tiles of {across} × {down} texels in {} channels",
            MOST_STRIP_BYTES >> 20,
            info.channels
        ));
    }
    Ok(reader)
}

/// One level, strip by strip.
pub(super) fn read_level(reader: &mut Reader, level: usize, format: &Format) -> Result<Rows, String> {
    let (width, height) = reader.info().levels[level];
    let step = reader.info().tile.map_or(STRIP, |(_, rows)| rows) as usize;
    let mut all = if reader.info().eight_bits { Rows::Eight(Vec::new()) } else { Rows::Float(Vec::new()) };
    all.try_reserve(width * height).map_err(|()| format!("no memory for {width} × {height} texels"))?;
    for first in (0..height).step_by(step) {
        let strip = reader.read(level, first..(first + step).min(height)).map_err(|reason| broken(format, &reason))?;
        all.extend(&strip);
    }
    Ok(all)
}
