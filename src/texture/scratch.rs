//! Tiled copies of images that do not fit into memory and are not stored in tiles: decoded once, written into a folder of the
//! process's own, deleted with the scene.
//!
//! Why a copy: scan lines can be read in order only. A look-up into a PNG that is not held decodes it from its first row. Images
//! inside a glTF are treated in the same way, so that their encoded bytes need not stay in memory.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};

use super::decode::Image;
use super::oiio::write_tiled;
use super::{ColorSpace, Rows, Texels, pyramid};

/// A folder below the system's for temporary files (`TMPDIR`).
#[derive(Debug)]
pub(super) struct Scratch {
    folder: PathBuf,
}

impl Scratch {
    pub(super) fn new() -> Result<Self, String> {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let folder = std::env::temp_dir().join(format!("pathspace-{}-{number}", std::process::id()));
        // Not `create_dir_all`: a folder that is there already is somebody else's.
        std::fs::create_dir(&folder).map_err(|reason| format!("cannot make {}: {reason}", folder.display()))?;
        Ok(Scratch { folder })
    }

    /// Writes an image and its pyramid; where to. Levels are averaged in linear values of `color_space`.
    pub(super) fn write(&self, number: usize, image: &Image, color_space: ColorSpace) -> Result<PathBuf, String> {
        let path = self.folder.join(format!("{number}-{color_space:?}.tif"));
        let (width, height) = (image.width, image.height);
        let mut levels = vec![(width, height, match &image.texels {
            Texels::Eight(plane) => Rows::Eight(plane.base.to_vec()),
            Texels::Float(plane) => Rows::Float(plane.base.to_vec()),
            _ => return Err("expected an image in memory".into()),
        })];
        let decoded = image.integers && color_space == ColorSpace::Srgb;
        while let Some((width, height, rows)) = levels.last().filter(|(width, height, _)| width.max(height) > &1) {
            levels.push(pyramid::halved(*width, *height, rows, color_space, decoded));
        }
        let levels: Vec<_> = levels.iter().map(|(width, height, rows)| (*width, *height, rows)).collect();
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
