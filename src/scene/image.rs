//! Environment maps from files: whatever [`texture::decode`](crate::texture::decode) reads, as linear RGB. Images of
//! floats are radiance as they stand; those of integers (PNG, JPEG, …) are colours and decoded by the sRGB curve.

use std::f64::consts::PI;
use std::path::Path;

use glam::{DVec3, Vec3};

use super::{Environment, EnvironmentFile, Instance, LoadOptions, Material, MissingTexture, Scene, Warning};
use crate::error::{Error, Result};
use crate::texture::decode::{Encoded, Problem, decode_any, inspect};
use crate::texture::{ColorSpace, SRGB_TO_LINEAR, Texels};

/// How the warning of [`Scene::ensure_light`] ends.
const LIT: &str = "lit by a constant white environment of radiance 1";

/// Radiance of texels that are not finite, where that is no error.
const MAGENTA: Vec3 = Vec3::new(1.0, 0.0, 1.0);

/// Mean irradiance on the scene's surfaces from which emissive textures count as a light, over that of a white
/// environment of radiance 1 (π).
const LEAST_SHARE: f64 = 0.01;

/// Points that receive, and patches that send, in the estimate of that irradiance.
const PATCHES: usize = 256;

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
    /// Emission by a texture of a strength up to 1 counts if what arrives at the scene's surfaces, were nothing in
    /// between, is at least a hundredth of what a white environment of radiance 1 would bring: a lit button is no
    /// light, nor is a label that shines past its object.
    pub fn has_light(&self) -> bool {
        self.environment.is_some() || !self.punctual.is_empty() || self.emission() == Emission::Lights
    }

    /// Lights a scene that states no light by a constant white environment of radiance 1, and warns of it; warns as
    /// well if all its lights are dimmed to 0.
    pub fn ensure_light(&mut self) {
        if self.environment.is_some() || self.punctual.iter().any(|light| light.intensity != Vec3::ZERO) {
            return;
        }
        let emission = self.emission();
        let what = if !self.punctual.is_empty() || emission == Emission::Lights {
            if emission != Emission::None {
                return;
            }
            "every light is dimmed to 0: nothing is lit".to_owned()
        } else {
            self.environment = Some(Environment::constant(Vec3::ONE));
            match emission {
                Emission::Negligible => format!("emissive textures light next to nothing: {LIT}"),
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
        let (senders, sent_w) = self.patches(|i| material(i).map_or(0.0, mean));
        let (receivers, _) = self.patches(|_| 1.0);
        // A point and a disc that faces it: a / (π r² + a), times both cosines (Siegel and Howell, configuration B-5).
        let mut arriving = 0.0;
        for to in &receivers {
            for from in &senders {
                let way = to.position - from.position;
                let distance_m = way.length();
                let leaving = from.normal.dot(way) / distance_m;
                let leaving = if from.double_sided { leaving.abs() } else { leaving.max(0.0) };
                let met = (to.normal.dot(way) / distance_m).abs();
                let radiance = sent_w / (PATCHES as f64 * from.area_m2);
                if distance_m > 0.0 && from.area_m2 > 0.0 {
                    arriving += radiance * leaving * met * from.area_m2 / (PI * distance_m.powi(2) + from.area_m2);
                }
            }
        }
        if arriving >= LEAST_SHARE * receivers.len() as f64 { Emission::Lights } else { Emission::Negligible }
    }

    /// [`PATCHES`] patches of the placed surfaces with equal shares of the integral of `weight` over area, and that
    /// integral; none if it is 0.
    fn patches(&self, weight: impl Fn(&Instance) -> f64) -> (Vec<SurfacePatch>, f64) {
        // Mirrored placements turn the front round.
        let walk = |visit: &mut Visit| {
            for instance in &self.instances {
                let weight = weight(instance);
                if weight > 0.0 {
                    let mesh = &self.meshes[instance.mesh.index()];
                    let mirrored = instance.world_from_object.matrix3.determinant() < 0.0;
                    let corner =
                        |i: u32| instance.world_from_object.transform_point3(mesh.positions[i as usize]).as_dvec3();
                    for &triangle in &mesh.triangles {
                        let [a, mut b, mut c] = triangle.map(corner);
                        if mirrored {
                            (b, c) = (c, b);
                        }
                        visit(instance, [a, b, c], weight, 0.5 * (b - a).cross(c - a).length());
                    }
                }
            }
        };
        let mut total = 0.0;
        walk(&mut |_, _, weight, area_m2| total += weight * area_m2);
        let mut patches = Vec::with_capacity(PATCHES);
        let mut before = 0.0;
        walk(&mut |instance, [a, b, c], weight, area_m2| {
            let after = before + weight * area_m2;
            // Middles of equal shares.
            while patches.len() < PATCHES && (patches.len() as f64 + 0.5) / PATCHES as f64 * total < after {
                let material = self.materials.get(self.material_of(instance).index());
                // Uniform on the triangle, by the additive recurrence of the plastic number (Roberts 2018).
                let (u, v) = ((0.754_877_67 * patches.len() as f64) % 1.0, (0.569_840_29 * patches.len() as f64) % 1.0);
                let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                patches.push(SurfacePatch {
                    position: a + u * (b - a) + v * (c - a),
                    normal: (b - a).cross(c - a).normalize_or_zero(),
                    area_m2: total / (PATCHES as f64 * weight),
                    double_sided: material.is_some_and(|material| material.double_sided),
                });
            }
            before = after;
        });
        (patches, total)
    }
}

/// Is told of a placed triangle: its instance, its corners as the front has them, its weight, its area.
type Visit<'v> = dyn FnMut(&Instance, [DVec3; 3], f64, f64) + 'v;

/// A piece of the placed surfaces.
struct SurfacePatch {
    position: DVec3,
    /// Unit; 0 on a triangle without area.
    normal: DVec3,
    area_m2: f64,
    double_sided: bool,
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
    use glam::Affine3A;

    use super::*;
    use crate::scene::{MaterialId, Mesh, MeshId, TextureId, TextureSlot};

    #[test]
    fn a_scene_without_light_gets_one_and_a_warning() {
        let mut scene = Scene::default();
        assert!(!scene.has_light());
        scene.ensure_light();
        assert!(scene.has_light() && scene.warnings.len() == 1);
        scene.ensure_light();
        assert_eq!(scene.warnings.len(), 1);
    }

    /// A square emissive label of side 1 over a white floor of side 1, `distance_m` away and facing it or not.
    fn label(distance_m: f32, faces_floor: bool) -> Scene {
        let square = |y: f32, up: bool| Mesh {
            positions: [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, z]| Vec3::new(x, y, z)).to_vec(),
            triangles: if up { vec![[0, 2, 1], [0, 3, 2]] } else { vec![[0, 1, 2], [0, 2, 3]] },
            ..Mesh::default()
        };
        let mut scene = Scene::default();
        let mut glowing = Material { emissive: Vec3::ONE, ..Material::default() };
        glowing.emissive_texture = Some(TextureSlot { texture: TextureId(0), uv_set: 0 });
        scene.materials = vec![Material::default(), glowing];
        scene.meshes = vec![square(0.0, true), square(distance_m, !faces_floor)];
        scene.meshes[1].material = MaterialId(1);
        scene.instances = (0..2).map(|i| Instance::new(MeshId(i), Affine3A::IDENTITY)).collect();
        scene
    }

    /// Two unit squares 1 apart: F = 0.1998 (Hottel), so the mean over both is 0.0999; 10 apart F = 0.0031; and a label
    /// that faces away sends nothing here.
    #[test]
    fn emissive_textures_are_lights_where_they_reach_surfaces() {
        assert!(label(1.0, true).has_light());
        assert!(!label(10.0, true).has_light());
        assert!(!label(1.0, false).has_light());
    }
}
