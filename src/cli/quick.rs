//! `--quick`, the first look: what `pathspace SCENE` alone does. Defaults that please instead of those of measurement,
//! each only where nothing was given; the picture is that of the same options written out.

use std::time::Duration;

use super::args::{RenderArgs, SettingsArgs};
use crate::render::RenderOptions;

/// Pixels of the picture.
const PIXELS: f64 = 480_000.0;

/// Rendering time; with load and files a picture takes about 10 s.
const TIME: Duration = Duration::from_secs(8);

/// Relative error that needs no more time.
const ERROR: f64 = 0.01;

/// Options of a first look: `options` with another size and limits where none were given.
pub fn options(args: &RenderArgs, options: RenderOptions) -> RenderOptions {
    let options = sized(&args.settings, options);
    let limited = args.spp.is_some() || args.time.is_some() || args.error.is_some();
    if limited { options } else { options.time(TIME).error(ERROR) }
}

/// `options` of a size for a first look, where none was given.
pub fn sized(settings: &SettingsArgs, options: RenderOptions) -> RenderOptions {
    let (width, height) = match settings.is_sized() {
        true => (options.width, options.height),
        false => size(f64::from(options.width) / f64::from(options.height)),
    };
    options.size(width, height)
}

/// Columns and rows of [`PIXELS`] at an aspect; even, as encoders of films like it.
fn size(aspect: f64) -> (u32, u32) {
    let even = |side: f64| (0.5 * side).round().clamp(1.0, 4096.0) as u32 * 2;
    (even((PIXELS * aspect).sqrt()), even((PIXELS / aspect).sqrt()))
}

#[cfg(test)]
mod tests {
    use super::size;

    #[test]
    fn sizes_keep_the_aspect_and_the_number_of_pixels() {
        assert_eq!((size(4.0 / 3.0), size(1.0)), ((800, 600), (692, 692)));
        assert_eq!(size(1e9), (8192, 2));
    }
}
