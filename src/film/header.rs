//! OpenEXR headers in a fixed order. The `exr` crate keeps attributes in a hash map and writes them in an order that
//! differs from run to run; [`SortedHeader`] stands between it and the file and sorts them by name, so that equal
//! pictures are equal files. Offsets in the file stay what they are, because the header keeps its length.
//!
//! Layout (OpenEXR file layout, single part): magic and version, 8 bytes; attributes, each `name \0 type \0 size: i32
//! value`; one zero byte.

use std::io::{Result, Seek, SeekFrom, Write};

/// Bytes before the attributes.
const START: usize = 8;

/// A writer that holds the header back until it is complete.
pub(super) struct SortedHeader<W: Write> {
    out: W,
    /// What has come so far; `None` once the header is written.
    header: Option<Vec<u8>>,
}

impl<W: Write> SortedHeader<W> {
    /// Writes a file of one part to `out`, from its first byte on.
    pub fn new(out: W) -> Self {
        SortedHeader { out, header: Some(Vec::new()) }
    }

    /// Writes what was held back, sorted if it is a whole header.
    fn release(&mut self) -> Result<()> {
        match self.header.take() {
            Some(bytes) => self.out.write_all(&sorted(&bytes).unwrap_or(bytes)),
            None => Ok(()),
        }
    }
}

impl<W: Write> Write for SortedHeader<W> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        let Some(header) = &mut self.header else { return self.out.write(bytes) };
        header.extend_from_slice(bytes);
        if attributes(header).is_some() {
            self.release()?;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<()> {
        self.release()?;
        self.out.flush()
    }
}

impl<W: Write + Seek> Seek for SortedHeader<W> {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        self.release()?;
        self.out.seek(to)
    }
}

/// The attributes of a header, and what comes behind them from the zero byte on; `None` while it is not complete.
fn attributes(bytes: &[u8]) -> Option<(Vec<&[u8]>, &[u8])> {
    let mut rest = bytes.get(START..)?;
    let mut attributes = Vec::new();
    while *rest.first()? != 0 {
        let name = rest.iter().position(|&byte| byte == 0)?;
        let kind = rest[name + 1..].iter().position(|&byte| byte == 0)?;
        let value = name + kind + 2 + size_of::<i32>();
        let size = rest.get(value - size_of::<i32>()..value)?;
        let size = i32::from_le_bytes(size.try_into().expect("four bytes"));
        let end = value + usize::try_from(size).ok()?;
        attributes.push(rest.get(..end)?);
        rest = &rest[end..];
    }
    Some((attributes, rest))
}

/// The same bytes with the attributes in the order of their names.
fn sorted(bytes: &[u8]) -> Option<Vec<u8>> {
    let (mut attributes, rest) = attributes(bytes)?;
    attributes.sort_unstable();
    Some([&[&bytes[..START]][..], &attributes, &[rest]].concat().concat())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    /// Oracle: written by hand. Byte by byte or at once, the attributes come out sorted and the rest where it was.
    #[test]
    fn attributes_are_sorted_and_nothing_else_moves() {
        let attribute = |name: &str, value: &[u8]| {
            [name.as_bytes(), b"\0type\0", &(value.len() as i32).to_le_bytes(), value].concat()
        };
        let (a, b) = (attribute("a", b"\0x\0"), attribute("b", b""));
        let file = |first: &[u8], second: &[u8]| [b"magic+v0", first, second, b"\0pixels\0"].concat();
        for step in [1, 3, 100] {
            let mut out = SortedHeader::new(Cursor::new(Vec::new()));
            for part in file(&b, &a).chunks(step) {
                out.write_all(part).expect("memory");
            }
            out.seek(SeekFrom::Start(1)).expect("memory");
            out.write_all(b"A").expect("memory");
            let mut expected = file(&a, &b);
            expected[1] = b'A';
            assert_eq!(out.out.into_inner(), expected, "{step}");
        }
        // What is no header is written as it came.
        let mut out = SortedHeader::new(Vec::new());
        out.write_all(b"short").expect("memory");
        out.flush().expect("memory");
        assert_eq!(out.out, b"short");
    }
}
