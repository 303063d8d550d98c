//! The size of a study's picture, and a given picture as its reference.

use std::path::Path;

use super::reference::Reference;
use crate::error::{Error, Result};
use crate::film::exr::Picture;
use crate::plan::options::{FilterKind, RenderOptions};

/// Pixels of a study without a given size: enough that relMSE of a run scatters by a few percent only, and few enough
/// for a hundred runs in a minute.
const DEFAULT_PIXELS: f64 = 4900.0;

/// The options at a size for a study: the reference's if there is one, else about `DEFAULT_PIXELS` of the picture's
/// shape.
pub fn sized(options: RenderOptions, reference: Option<&Picture>) -> RenderOptions {
    if let Some(picture) = reference {
        return options.size(picture.display.0 as u32, picture.display.1 as u32);
    }
    let (w, h) = (f64::from(options.width), f64::from(options.height));
    let scale = (DEFAULT_PIXELS / (w * h)).sqrt().min(1.0);
    let side = |length: f64| (length * scale).round().max(1.0) as u32;
    options.size(side(w), side(h))
}

impl Reference {
    /// A given reference at the size of the picture: as it is, or averaged over whole blocks, which is exact for the
    /// box filter.
    ///
    /// # Errors
    /// [`Error::Option`] naming `--reference` and `path`, the picture's file.
    pub fn of_picture(path: &Path, picture: &Picture, base: &RenderOptions) -> Result<Reference> {
        let refuse = |problem: String| Err(Error::Option { option: "--reference", problem });
        let (w, h) = (base.width as usize, base.height as usize);
        let found = format!("{}: {}x{}", path.display(), picture.width, picture.height);
        if base.crop.is_some() || (picture.width, picture.height) != picture.display {
            return refuse(format!("{found}; a study against a reference takes whole pictures, without --crop"));
        }
        let block = picture.width / w.max(1);
        if block == 0 || (block * w, block * h) != (picture.width, picture.height) {
            return refuse(format!("{found}; expected {w}x{h} or a whole multiple of it"));
        }
        if block > 1 && base.filter != FilterKind::Box {
            return refuse(format!("{found}; reducing it to {w}x{h} is exact for --filter box only"));
        }
        if picture.rgb.iter().flatten().any(|v| !v.is_finite()) {
            return refuse(format!("{}: expected finite values", path.display()));
        }
        let mut values = vec![0.0; 3 * w * h];
        let share = 1.0 / (block * block) as f64;
        for (i, pixel) in picture.rgb.iter().enumerate() {
            let place = i / picture.width / block * w + i % picture.width / block;
            for c in 0..3 {
                values[3 * place + c] += share * f64::from(pixel[c]);
            }
        }
        Ok(Reference::of_values(values, None))
    }
}
