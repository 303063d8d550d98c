//! Tiled copies of images that do not fit into memory and are not stored in tiles: decoded once, written into a folder of the
//! process's own, deleted with the scene.
//!
//! Why a copy: scan lines can be read in order only. A look-up into a PNG that is not held decodes it from its first row. Images
//! inside a glTF are treated in the same way, so that their encoded bytes need not stay in memory.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};

use super::oiio::write_tiled;
use super::{ColorSpace, Rows, pyramid};

/// A folder below the system's for temporary files (`TMPDIR`).
#[derive(Debug)]
pub(super) struct Scratch {
    folder: PathBuf,
}

impl Scratch {
    pub(super) fn new() -> Result<Self, String> {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        loop {
            let number = NEXT.fetch_add(1, Ordering::Relaxed);
            let folder = std::env::temp_dir().join(format!("pathspace-{}-{number}", std::process::id()));
            // Not `create_dir_all`: a folder that is there already is somebody else's, such as a killed process of the same
            // number (containers count from 1 each time).
            match std::fs::create_dir(&folder) {
                Ok(()) => return Ok(Scratch { folder }),
                Err(reason) if reason.kind() == std::io::ErrorKind::AlreadyExists => {}
                Err(reason) => return Err(format!("cannot make {}: {reason}", folder.display())),
            }
        }
    }

    /// Writes an image and its pyramid; where to. Levels are averaged in linear values of `color_space`; `integers` says that
    /// colours are encoded in the file.
    pub(super) fn write(
        &self,
        number: usize,
        image: &(usize, usize, Rows),
        color_space: ColorSpace,
        integers: bool,
    ) -> Result<PathBuf, String> {
        let path = self.folder.join(format!("{number}-{color_space:?}.tif"));
        let (width, height, rows) = image;
        let encoded = integers && color_space == ColorSpace::Srgb;
        let coarser: Vec<(usize, usize, Rows)> = match rows {
            Rows::Eight(texels) => {
                let next = |(w, h), texels: &[[u8; 4]]| pyramid::halved_eight(w, h, texels, color_space);
                let levels = pyramid::levels((*width, *height), texels, next).into_iter();
                levels.map(|(w, h, texels)| (w, h, Rows::Eight(texels))).collect()
            }
            Rows::Float(texels) => {
                let next = |(w, h), texels: &[[f32; 4]]| pyramid::halved_float(w, h, texels, encoded);
                let levels = pyramid::levels((*width, *height), texels, next).into_iter();
                levels.map(|(w, h, texels)| (w, h, Rows::Float(texels))).collect()
            }
        };
        let levels: Vec<_> =
            std::iter::once(image).chain(&coarser).map(|(width, height, rows)| (*width, *height, rows)).collect();
        write_tiled(&path, &levels).map_err(|reason| format!("cannot write {}: {reason}", path.display()))?;
        Ok(path)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // A folder that cannot be removed is no reason to fail.
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}
