//! The file that texels of images go to which do not fit into memory: one for a scene, in the folder of temporary files
//! (`TMPDIR`), without a name: whatever ends the process, SIGKILL included, the system frees it.
//!
//! Why copies: scan lines can be read in order only. A look-up into a PNG that is not held would decode it from its
//! first row. Texels are written as look-ups want them, so reading them back is all that there is to do.

use std::fs::File;
use std::io;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

use crate::error::Error;

/// The file of one scene, made when it is first needed.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    file: OnceLock<File>,
    making: Mutex<()>,
    length: AtomicU64,
}

impl Scratch {
    /// A place for so many bytes.
    pub(super) fn reserve(&self, bytes: u64) -> u64 {
        self.length.fetch_add(bytes, Ordering::Relaxed)
    }

    /// Writes bytes to a place that was reserved.
    ///
    /// # Errors
    /// [`Error::Io`] with the folder of temporary files: it is full, or takes no file.
    pub(super) fn write(&self, bytes: &[u8], place: u64) -> Result<(), Error> {
        let failed = |source| Error::io(std::env::temp_dir(), "keep copies of textures in", source);
        self.file().and_then(|file| write_at(file, bytes, place)).map_err(failed)
    }

    /// Reads bytes from a place.
    pub(super) fn read(&self, bytes: &mut [u8], place: u64) -> io::Result<()> {
        read_at(self.file()?, bytes, place)
    }

    fn file(&self) -> io::Result<&File> {
        let _making = self.making.lock().unwrap_or_else(PoisonError::into_inner);
        match self.file.get() {
            Some(file) => Ok(file),
            None => {
                let made = tempfile::tempfile()?;
                Ok(self.file.get_or_init(|| made))
            }
        }
    }
}

#[cfg(unix)]
use std::os::unix::fs::FileExt;

#[cfg(unix)]
fn write_at(file: &File, bytes: &[u8], place: u64) -> io::Result<()> {
    file.write_all_at(bytes, place)
}

#[cfg(unix)]
fn read_at(file: &File, bytes: &mut [u8], place: u64) -> io::Result<()> {
    file.read_exact_at(bytes, place)
}

#[cfg(not(unix))]
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

#[cfg(not(unix))]
fn write_at(mut file: &File, bytes: &[u8], place: u64) -> io::Result<()> {
    let _turn = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    io::Seek::seek(&mut file, io::SeekFrom::Start(place))?;
    io::Write::write_all(&mut file, bytes)
}

#[cfg(not(unix))]
fn read_at(mut file: &File, bytes: &mut [u8], place: u64) -> io::Result<()> {
    let _turn = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    io::Seek::seek(&mut file, io::SeekFrom::Start(place))?;
    io::Read::read_exact(&mut file, bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: the bytes written. Deterministic.
    #[test]
    fn bytes_come_back_from_their_place() {
        let scratch = Scratch::default();
        let texts = [&b"first"[..], b"", b"the second"];
        let places = texts.map(|text| scratch.reserve(text.len() as u64));
        assert_eq!(places, [0, 5, 5]);
        for (text, place) in texts.iter().zip(places).rev() {
            scratch.write(text, place).expect("a folder of temporary files");
        }
        for (text, place) in texts.iter().zip(places) {
            let mut read = vec![0; text.len()];
            scratch.read(&mut read, place).expect("written");
            assert_eq!(&read, text);
        }
        assert!(scratch.read(&mut [0; 2], 14).is_err(), "past the end");
    }
}
