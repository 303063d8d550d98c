//! Tiled image files that look-ups read where they are. A file is opened when a tile of it is first missed, and closed
//! again when too many are open: half of the descriptors that the process may still have, 256 at most.

use std::ops::Range;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

use super::encoded::Format;
use super::oiio::{Info, Reader};
use super::plane::Rows;
use super::reader::open_tiled;
use crate::room;

/// Files that are open at a time, at most.
const MOST_OPEN: usize = 256;

/// A file.
pub(super) struct FileTiles {
    path: PathBuf,
    format: Format,
    /// As it was at load.
    info: Info,
    reader: Mutex<Option<Reader<'static>>>,
    /// When it was last read.
    used: AtomicU64,
}

impl std::fmt::Debug for FileTiles {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_tuple("FileTiles").field(&self.path).finish()
    }
}

impl FileTiles {
    fn reader(&self) -> MutexGuard<'_, Option<Reader<'static>>> {
        self.reader.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Opens the file if it still is what it was.
    fn open(&self) -> Result<Reader<'static>, String> {
        let reader = open_tiled(&self.path, &self.format)?;
        if *reader.info() == self.info { Ok(reader) } else { Err("it is not the file that was loaded".into()) }
    }
}

/// The files of a scene.
#[derive(Debug)]
pub(super) struct Files {
    all: Mutex<Vec<Arc<FileTiles>>>,
    most_open: usize,
    clock: AtomicU64,
}

impl Files {
    pub(super) fn new() -> Self {
        Files { all: Mutex::default(), most_open: most_open(), clock: AtomicU64::new(0) }
    }

    /// Adds a file.
    pub(super) fn add(&self, path: PathBuf, format: Format, info: Info) -> Arc<FileTiles> {
        let file = Arc::new(FileTiles { path, format, info, reader: Mutex::default(), used: AtomicU64::new(0) });
        self.all().push(file.clone());
        file
    }

    fn all(&self) -> MutexGuard<'_, Vec<Arc<FileTiles>>> {
        self.all.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Reads an area of a level, one of its tiles, into texels of its size.
    ///
    /// # Errors
    /// What is wrong with the file by now.
    pub(super) fn read(
        &self,
        file: &FileTiles,
        level: usize,
        [columns, rows]: [Range<usize>; 2],
        texels: &mut Rows,
    ) -> Result<(), String> {
        let mut reader = file.reader();
        file.used.store(self.clock.fetch_add(1, Ordering::Relaxed), Ordering::Relaxed);
        if reader.is_none() {
            self.close_some(self.most_open - 1);
            let opened = file.open().or_else(|_| {
                // Descriptors may be short for other reasons.
                self.close_some(0);
                file.open()
            });
            *reader = Some(opened?);
        }
        let read = reader.as_mut().map_or(Ok(()), |reader| reader.read_into(level, columns, rows, texels));
        if read.is_err() {
            *reader = None;
        }
        read
    }

    /// Closes files that nobody reads until only so many are open, those first that were read longest ago.
    fn close_some(&self, most: usize) {
        let all = self.all();
        let mut open: Vec<_> = all
            .iter()
            .filter_map(|file| match file.reader.try_lock() {
                Ok(reader) => reader.is_some().then(|| (file.used.load(Ordering::Relaxed), reader)),
                Err(TryLockError::Poisoned(reader)) => Some((0, reader.into_inner())),
                Err(TryLockError::WouldBlock) => None,
            })
            .collect();
        open.sort_by_key(|(used, _)| *used);
        let surplus = open.len().saturating_sub(most);
        open.iter_mut().take(surplus).for_each(|(_, reader)| **reader = None);
    }
}

/// How many files may be open: half of what is left of the process's descriptors.
fn most_open() -> usize {
    room::descriptors().map_or(MOST_OPEN, |left| (left as usize / 2).clamp(1, MOST_OPEN))
}
