//! Headers of OpenEXR files: what decides how an image is decoded and where it lies, read before any decoder sees the
//! file, and held against its length.
//!
//! Source: "OpenEXR File Layout" (openexr.com). The image is the *display window*; texels outside the *data window* are
//! 0, those outside the display window are not shown. Every chunk (a block of scan lines, or a tile) has eight bytes in
//! a table of offsets, so a file cannot have more chunks than it has bytes for.

use super::encoded::MOST_STRIP_BYTES;

/// Bytes of a file in which its headers have to end.
pub(super) const MOST_HEADER_BYTES: u64 = 16 << 20;

/// A rectangle of texels; bounds are inclusive in the file, exclusive here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Window {
    pub(super) left: i64,
    pub(super) top: i64,
    pub(super) right: i64,
    pub(super) bottom: i64,
}

impl Window {
    pub(super) fn width(&self) -> u64 {
        (self.right - self.left).max(0) as u64
    }

    pub(super) fn height(&self) -> u64 {
        (self.bottom - self.top).max(0) as u64
    }
}

/// What the header of the first part says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Header {
    /// Where texels are stored.
    pub(super) data: Window,
    /// The image.
    pub(super) display: Window,
    /// Stored in tiles.
    pub(super) tiled: bool,
    /// Every part has one of the compressions that the crate may be given. Its DWA allocates what a chunk says, of any
    /// size.
    pub(super) plain_compression: bool,
    /// Names of channels of half or float, none subsampled; empty where one is not so.
    pub(super) channels: Vec<String>,
}

impl Header {
    /// Whether there is such a channel.
    pub(super) fn has(&self, name: &str) -> bool {
        self.channels.iter().any(|channel| channel == name)
    }

    /// Whether it has the three of a colour.
    pub(super) fn has_rgb(&self) -> bool {
        ["R", "G", "B"].iter().all(|name| self.has(name))
    }

    /// Whether texels are stored for the image, all of it and nothing else.
    pub(super) fn is_whole(&self) -> bool {
        self.data == self.display
    }
}

/// Reads the headers that a file of `length` bytes begins with.
pub(super) fn header(bytes: &[u8], length: u64) -> Result<Header, String> {
    let mut cursor = Cursor(bytes);
    cursor.take(4)?;
    let version = cursor.number()?;
    let (is_tiled, is_multi_part) = (version & 0x200 != 0, version & 0x1000 != 0);
    let mut first = part(&mut cursor, is_tiled, length)?.ok_or("a file without parts")?;
    while is_multi_part && let Some(other) = part(&mut cursor, false, length)? {
        first.plain_compression &= other.plain_compression;
    }
    Ok(first)
}

/// One header; none at the end of a list of them.
fn part(cursor: &mut Cursor, is_tiled: bool, length: u64) -> Result<Option<Header>, String> {
    let (mut data, mut display, mut compression, mut tile) = (None, None, None, None);
    let mut channels: Vec<(String, u32, bool)> = Vec::new();
    let mut kind = if is_tiled { "tiledimage" } else { "scanlineimage" }.to_owned();
    let (mut is_empty, mut plain_compression) = (true, true);
    loop {
        let name = cursor.text()?;
        if name.is_empty() {
            break;
        }
        is_empty = false;
        let _type = cursor.text()?;
        let size = cursor.number()?;
        let mut value = Cursor(cursor.take(size as usize)?);
        match name.as_str() {
            "dataWindow" => data = Some(value.window()?),
            "displayWindow" => display = Some(value.window()?),
            "compression" => {
                compression = value.take(1)?.first().copied();
                plain_compression &= compression.is_some_and(|compression| compression <= 7);
            }
            "tiles" => tile = Some((value.number()?, value.number()?)),
            "type" => kind = String::from_utf8_lossy(value.0).into_owned(),
            "channels" => loop {
                let name = value.text()?;
                if name.is_empty() {
                    break;
                }
                let (kind, _, x, y) = (value.number()?, value.number()?, value.number()?, value.number()?);
                channels.push((name, kind, x == 1 && y == 1));
            },
            _ => {}
        }
    }
    if is_empty {
        return Ok(None);
    }
    let missing = |name: &str| format!("a header without {name}");
    let data = data.ok_or_else(|| missing("dataWindow"))?;
    let display = display.ok_or_else(|| missing("displayWindow"))?;
    let compression = compression.ok_or_else(|| missing("compression"))?;
    if channels.is_empty() {
        return Err(missing("channels"));
    }
    if kind.starts_with("deep") {
        return Err("deep data".into());
    }
    let tiled = kind == "tiledimage";
    let (across, down) = match (tiled, tile) {
        (true, Some((across, down))) => (u64::from(across), u64::from(down)),
        (true, None) => return Err(missing("tiles")),
        (false, _) => (data.width(), lines(compression)),
    };
    if across == 0 || down == 0 || data.width() == 0 || data.height() == 0 {
        return Err("an image or a tile without texels".into());
    }
    let chunks = data.width().div_ceil(across).saturating_mul(data.height().div_ceil(down));
    if chunks.saturating_mul(8) > length {
        return Err(format!("{chunks} chunks in a file of {length} bytes"));
    }
    // What is decoded at a time.
    let bytes = across.saturating_mul(down.min(data.height())).saturating_mul(4 * channels.len() as u64);
    if bytes > MOST_STRIP_BYTES {
        return Err(format!("chunks of {} MB", bytes >> 20));
    }
    let is_usual = channels.iter().all(|(_, kind, whole)| matches!(kind, 1 | 2) && *whole);
    let channels = if is_usual { channels.into_iter().map(|(name, ..)| name).collect() } else { Vec::new() };
    Ok(Some(Header { data, display, tiled, plain_compression, channels }))
}

/// Scan lines of a chunk.
fn lines(compression: u8) -> u64 {
    match compression {
        0..=2 => 1,
        3 | 5 => 16,
        4 | 6 | 7 | 8 | 10 => 32,
        _ => 256,
    }
}

/// What is left of the bytes.
struct Cursor<'b>(&'b [u8]);

impl<'b> Cursor<'b> {
    fn take(&mut self, count: usize) -> Result<&'b [u8], String> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or("a header that does not end in the file")?;
        self.0 = rest;
        Ok(taken)
    }

    /// Up to the next NUL.
    fn text(&mut self) -> Result<String, String> {
        let length = self.0.iter().take(256).position(|&byte| byte == 0).ok_or("a name that does not end")?;
        let text = String::from_utf8_lossy(self.take(length)?).into_owned();
        self.take(1)?;
        Ok(text)
    }

    fn number(&mut self) -> Result<u32, String> {
        let bytes = self.take(4)?;
        Ok(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
    }

    fn window(&mut self) -> Result<Window, String> {
        let mut edge = || self.number().map(|bits| i64::from(bits as i32));
        let [left, top, right, bottom] = [edge()?, edge()?, edge()?, edge()?];
        Ok(Window { left, top, right: right + 1, bottom: bottom + 1 })
    }
}
