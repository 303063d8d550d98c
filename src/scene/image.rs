//! Environment maps from files: whatever [`texture::decode`](crate::texture::decode) reads, as linear RGB. Images of
//! floats are radiance as they stand; those of integers (PNG, JPEG, …) are colours and decoded by the sRGB curve.

use std::path::Path;

use glam::Vec3;

use super::{Environment, EnvironmentFile, Instance, LoadOptions, Material, MissingTexture, Scene, Warning};
use crate::error::{Error, Result};
use crate::texture::decode::{Encoded, Problem, decode_any, inspect};
use crate::texture::{ColorSpace, SRGB_TO_LINEAR, Texels};

/// How the warning of [`Scene::ensure_light`] ends.
const LIT: &str = "lit by a constant white environment of radiance 1";

/// Radiance of texels that are not finite, where that is no error.
const MAGENTA: Vec3 = Vec3::new(1.0, 0.0, 1.0);

/// What emissive textures have to send to count as a light, of what the scene's surfaces would send at radiance 1.
const LEAST_SHARE: f64 = 0.01;

/// Reads an equirectangular environment: OpenEXR, Radiance `.hdr`, or another image. Infinite or NaN radiance is
/// an error; negative radiance is clamped to 0 ([`Scene::load_environment`] reports how much of it there was).
pub fn load_environment(path: impl AsRef<Path>, rotation_rad: f32, intensity: f32) -> Result<Environment> {
    let file = EnvironmentFile { path: path.as_ref().into(), rotation_rad, intensity };
    read_environment(&file, &LoadOptions::default()).map(|(environment, _)| environment)
}

impl Scene {
    /// Lights the scene by the environment map in a file, as [`load_environment`] does; clamped texels become a
    /// warning. [`ensure_light`](Self::ensure_light)'s light and warning go.
    pub fn load_environment(&mut self, path: impl AsRef<Path>, rotation_rad: f32, intensity: f32) -> Result<()> {
        let file = EnvironmentFile { path: path.as_ref().into(), rotation_rad, intensity };
        self.light_by(&file, &LoadOptions::default())
    }

    /// As [`load_environment`](Self::load_environment), decoded as the options say. Where missing textures are shown in
    /// magenta, so are texels that are not finite.
    pub(super) fn light_by(&mut self, file: &EnvironmentFile, options: &LoadOptions) -> Result<()> {
        let (environment, changed) = read_environment(file, options)?;
        let place = file.path.display().to_string();
        let mut warn = |count: usize, what: &str| {
            if count > 0 {
                self.warnings.push(Warning { place: place.clone(), what: format!("{count} texels {what}") });
            }
        };
        warn(changed.negative, "with negative radiance are clamped to 0");
        warn(changed.not_finite, "with NaN or infinity; shown in magenta");
        self.warnings.retain(|warning| !warning.what.ends_with(LIT));
        self.environment = Some(environment);
        Ok(())
    }

    /// Whether the scene states its light: an environment, a punctual light, or an emissive surface that is placed.
    /// Emission by a texture of a strength up to 1 counts from a hundredth of what the same scene would send if all its
    /// surfaces had radiance 1: a lit button is no light.
    pub fn has_light(&self) -> bool {
        self.environment.is_some() || !self.punctual.is_empty() || self.emission() == Emission::Lights
    }

    /// Lights a scene that states no light by a constant white environment of radiance 1, and warns of it; warns as
    /// well if all its lights are dimmed to 0.
    pub fn ensure_light(&mut self) {
        let emission = self.emission();
        let what = if self.has_light() {
            let dimmed = self.punctual.iter().all(|light| light.intensity == Vec3::ZERO);
            if self.environment.is_some() || emission != Emission::None || !dimmed {
                return;
            }
            "every light is dimmed to 0: nothing is lit".to_owned()
        } else {
            self.environment = Some(Environment::constant(Vec3::ONE));
            match emission {
                Emission::Negligible => format!("emissive textures send next to nothing: {LIT}"),
                _ => format!("no light of any kind: {LIT}"),
            }
        };
        self.warnings.push(Warning { place: self.file.display().to_string(), what });
    }

    /// What the placed surfaces send.
    fn emission(&self) -> Emission {
        let material = |instance: &Instance| self.materials.get(self.material_of(instance).index());
        let emitters = || self.instances.iter().filter(|i| material(i).is_some_and(Material::is_emissive));
        let is_lamp =
            |material: &Material| material.emissive_texture.is_none() || material.emissive.max_element() > 1.0;
        if emitters().next().is_none() {
            return Emission::None;
        }
        if emitters().filter_map(material).any(is_lamp) {
            return Emission::Lights;
        }
        let mean = |material: &Material| {
            let texture = material.emissive_texture.and_then(|slot| self.textures.get(slot.texture.index()));
            let radiance = texture.map_or(material.emissive, |texture| material.emissive * texture.mean());
            f64::from(radiance.element_sum() / 3.0)
        };
        let sent: f64 = emitters().map(|i| material(i).map_or(0.0, mean) * self.area_m2(i)).sum();
        let area_m2: f64 = self.instances.iter().map(|i| self.area_m2(i)).sum();
        if sent >= LEAST_SHARE * area_m2 { Emission::Lights } else { Emission::Negligible }
    }

    /// Area of a placed mesh.
    fn area_m2(&self, instance: &Instance) -> f64 {
        let mesh = &self.meshes[instance.mesh.index()];
        let corner = |i: u32| instance.world_from_object.transform_point3(mesh.positions[i as usize]).as_dvec3();
        let area = |&[a, b, c]: &[u32; 3]| 0.5 * (corner(b) - corner(a)).cross(corner(c) - corner(a)).length();
        mesh.triangles.iter().map(area).sum()
    }
}

/// What surfaces send.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Emission {
    /// Nothing.
    None,
    /// Too little to see by.
    Negligible,
    /// Light.
    Lights,
}

/// Texels of an environment that are not as in the file.
#[derive(Clone, Copy, Default)]
struct Changed {
    negative: usize,
    not_finite: usize,
}

fn read_environment(file: &EnvironmentFile, options: &LoadOptions) -> Result<(Environment, Changed)> {
    let path = file.path.as_path();
    let io = |source| Error::io(path, "read", source);
    if !std::fs::metadata(path).map_err(io)?.is_file() {
        return Err(io(std::io::Error::other("not a regular file")));
    }
    let problem = |problem: String| Error::Image { path: path.into(), problem };
    let budget = options.texture_budget;
    let found = |found| match found {
        Problem::Image(found) => problem(found),
        Problem::Machine(error) => error,
    };
    let size = inspect(Encoded::File(path), budget.decoder).map_err(found)?;
    if size.bytes > budget.bytes {
        let (found, most) = (size.bytes >> 20, budget.bytes >> 20);
        return Err(problem(format!(
            "expected an image that fits into --texture-memory ({most} MB), found {found} MB"
        )));
    }
    let image = decode_any(Encoded::File(path), budget.decoder).map_err(found)?;
    if options.missing_texture == MissingTexture::Error {
        image.check_finite().map_err(problem)?;
    }
    let mut texels: Vec<Vec3> = match image.texels_in(ColorSpace::Srgb) {
        Texels::Float(plane) => plane.iter().map(|&[r, g, b, _]| Vec3::new(r, g, b)).collect(),
        Texels::Eight(plane) => {
            plane.iter().map(|&[r, g, b, _]| Vec3::from([r, g, b].map(|c| SRGB_TO_LINEAR[usize::from(c)]))).collect()
        }
        _ => return Err(problem("expected an image in memory".into())),
    };
    let mut changed = Changed::default();
    for texel in &mut texels {
        if !texel.is_finite() {
            changed.not_finite += 1;
            *texel = MAGENTA;
        } else if texel.min_element() < 0.0 {
            changed.negative += 1;
            *texel = texel.max(Vec3::ZERO);
        }
    }
    let (width, height) = (image.width, image.height);
    let (rotation_rad, intensity) = (file.rotation_rad, file.intensity);
    Ok((Environment { width, height, texels: texels.into(), rotation_rad, intensity }, changed))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_without_light_gets_one_and_a_warning() {
        let mut scene = Scene::default();
        assert!(!scene.has_light());
        scene.ensure_light();
        assert!(scene.has_light() && scene.warnings.len() == 1);
        scene.ensure_light();
        assert_eq!(scene.warnings.len(), 1);
    }
}
