//! Environment maps from files: whatever [`texture::decode`](crate::texture::decode) reads, as linear RGB. Images of floats are
//! radiance as they stand; those of integers (PNG, JPEG, …) are colours and decoded by the sRGB curve.

use std::path::Path;

use glam::Vec3;

use super::{Environment, Scene, Warning};
use crate::error::{Error, Result};
use crate::texture::decode::{Decoder, Encoded, decode};
use crate::texture::{ColorSpace, SRGB_TO_LINEAR, Texels};

/// Reads an equirectangular environment: OpenEXR, Radiance `.hdr`, or another image. Infinite or NaN radiance is
/// an error; negative radiance is clamped to 0 ([`Scene::load_environment`] reports how much of it there was).
pub fn load_environment(path: impl AsRef<Path>, rotation_rad: f32, intensity: f32) -> Result<Environment> {
    read_environment(path.as_ref(), rotation_rad, intensity).map(|(environment, _)| environment)
}

impl Scene {
    /// Lights the scene by the environment map in a file, as [`load_environment`] does; clamped texels become a warning.
    pub fn load_environment(&mut self, path: impl AsRef<Path>, rotation_rad: f32, intensity: f32) -> Result<()> {
        let (environment, clamped) = read_environment(path.as_ref(), rotation_rad, intensity)?;
        if clamped > 0 {
            let place = path.as_ref().display().to_string();
            self.warnings
                .push(Warning { place, what: format!("{clamped} texels with negative radiance are clamped to 0") });
        }
        self.environment = Some(environment);
        Ok(())
    }
}

fn read_environment(path: &Path, rotation_rad: f32, intensity: f32) -> Result<(Environment, usize)> {
    let io = |source| Error::io(path, "read", source);
    if !std::fs::metadata(path).map_err(io)?.is_file() {
        return Err(io(std::io::Error::other("not a regular file")));
    }
    let problem = |problem: String| Error::Image { path: path.into(), problem };
    let image = decode(Encoded::File(path), Decoder::Default).map_err(problem)?;
    let radiance: Vec<Vec3> = match image.texels_in(ColorSpace::Srgb) {
        Texels::Float(plane) => plane.iter().map(|&[r, g, b, _]| Vec3::new(r, g, b)).collect(),
        Texels::Eight(plane) => {
            plane.iter().map(|&[r, g, b, _]| Vec3::from([r, g, b].map(|c| SRGB_TO_LINEAR[usize::from(c)]))).collect()
        }
        _ => return Err(problem("expected an image in memory".into())),
    };
    let negative = radiance.iter().filter(|texel| texel.min_element() < 0.0).count();
    let texels: Vec<Vec3> = radiance.into_iter().map(|texel| texel.max(Vec3::ZERO)).collect();
    let (width, height) = (image.width, image.height);
    Ok((Environment { width, height, texels: texels.into(), rotation_rad, intensity }, negative))
}
