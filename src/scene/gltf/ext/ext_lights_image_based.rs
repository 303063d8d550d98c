//! EXT_lights_image_based: a cube of six images around the scene, turned by a quaternion.
//!
//! A path tracer needs no images filtered for rough surfaces: the first level of `specularImages` is the radiance from
//! around, and lights rough and smooth surfaces alike. JPEG images are colours by the sRGB curve; of PNG images with an
//! alpha channel the decoded colour is divided by it (RGBD). Faces are +X, −X, +Y, −Y, +Z, −Z as cube maps have them,
//! flipped left to right: each as it is seen from inside, with +Y up (−Z up where one looks up, +Z where one looks
//! down). The cube is resampled to a map of latitudes and longitudes: every texel is the mean of [`LOOKS`]² nearest
//! texels of the cube.
//!
//! A light that has `irradianceCoefficients` alone is what those were made of, as far as nine coefficients say:
//! irradiance E(n) = Σ E_lm·Y_lm(n) comes from radiance Σ E_lm/A_l·Y_lm with A = π, 2π/3, π/4 (Ramamoorthi and Hanrahan
//! 2001), clamped at 0. Beside images they are not read.

use std::f64::consts::PI;

use glam::{DQuat, DVec3, DVec4, Vec3};
use serde_json::Value;

use super::super::document::Document;
use super::super::image::decode_whole;
use super::super::node::chosen_scene;
use super::extension::{Extension, Place};
use crate::error::Result;
use crate::scene::{Environment, LoadOptions};
use crate::texture::{ColorSpace, SRGB_TO_LINEAR, Texels};

pub(super) const EXTENSION: Extension = Extension { name: NAME, place: Place::Node };

const NAME: &str = "EXT_lights_image_based";

/// Looks at the cube along each side of a texel.
const LOOKS: usize = 4;

/// Columns of a map: four for each texel of a cube's side, but no fewer and no more. Edges of faces are blurred by a
/// texel.
const COLUMNS: (usize, usize) = (256, 8192);

/// Columns of a map of nine coefficients, which has no detail.
const SMOOTH_COLUMNS: usize = 128;

/// The environment that the chosen scene states.
pub(crate) fn read(document: &Document, options: &LoadOptions) -> Result<Option<Environment>> {
    let Some(scene) = chosen_scene(document)? else { return Ok(None) };
    let from = format!("{scene}/extensions/{NAME}/light");
    let Some(value) = document.value(&from) else { return Ok(None) };
    let index = document.index(value, &from)?;
    let lights = format!("/extensions/{NAME}/lights");
    if index >= document.array(&lights)?.len() {
        return Err(document.out_of_range(&lights[1..], index, &from));
    }
    let light = Light { document, pointer: format!("{lights}/{index}") };
    let intensity = light.number("intensity")?.unwrap_or(1.0);
    if intensity < 0.0 {
        document.warn(light.at("intensity"), format!("{intensity} is negative and clamped to 0"));
    }
    let turn = light.rotation()?.inverse();
    let (width, texels) = match light.cube(options)? {
        Some(cube) => {
            let width = (4 * cube.side).clamp(COLUMNS.0, COLUMNS.1);
            (width, mapped(width, |dir| cube.at(turn * dir)))
        }
        None => {
            let coefficients = light.radiance()?;
            let what = "has irradiance coefficients alone: its light is smooth, and mirrors show no image";
            document.warn(&light.pointer, what);
            (SMOOTH_COLUMNS, mapped(SMOOTH_COLUMNS, |dir| smooth(&coefficients, turn * dir)))
        }
    };
    let intensity = intensity.max(0.0) as f32;
    Ok(Some(Environment { width, height: width / 2, texels: texels.into(), rotation_rad: 0.0, intensity }))
}

/// A map whose texels are means of `radiance`.
fn mapped(width: usize, radiance: impl Fn(DVec3) -> Vec3) -> Vec<Vec3> {
    let height = width / 2;
    let mut texels = Vec::with_capacity(width * height);
    let within = |i: usize| (i as f64 + 0.5) / LOOKS as f64;
    for row in 0..height {
        for column in 0..width {
            let (mut sum, mut weight) = (DVec3::ZERO, 0.0);
            for y in 0..LOOKS {
                let (sin, cos) = (PI * (row as f64 + within(y)) / height as f64).sin_cos();
                for x in 0..LOOKS {
                    // u = 0.5 + atan2(d.x, −d.z)/2π.
                    let phi = 2.0 * PI * ((column as f64 + within(x)) / width as f64 - 0.5);
                    sum += radiance(DVec3::new(sin * phi.sin(), cos, -sin * phi.cos())).as_dvec3() * sin;
                    weight += sin;
                }
            }
            texels.push((sum / weight).as_vec3());
        }
    }
    texels
}

/// One of the file's lights.
struct Light<'d> {
    document: &'d Document,
    pointer: String,
}

impl Light<'_> {
    fn at(&self, member: &str) -> String {
        format!("{}/{member}", self.pointer)
    }

    fn number(&self, member: &str) -> Result<Option<f64>> {
        let at = self.at(member);
        let Some(value) = self.document.value(&at) else { return Ok(None) };
        let found = value.as_f64().filter(|number| (*number as f32).is_finite());
        found.map(Some).ok_or_else(|| self.document.error(at, format!("expected a number, found {value}")))
    }

    fn rotation(&self) -> Result<DQuat> {
        if self.document.value(&self.at("rotation")).is_none() {
            return Ok(DQuat::IDENTITY);
        }
        let mut rotation = DVec4::ZERO;
        for axis in 0..4 {
            rotation[axis] = self.number(&format!("rotation/{axis}"))?.unwrap_or(f64::NAN);
        }
        let unit = rotation.try_normalize().map(DQuat::from_vec4);
        unit.ok_or_else(|| self.document.error(self.at("rotation"), "expected a unit quaternion, found another value"))
    }

    /// The first level of the images, if there are any.
    fn cube(&self, options: &LoadOptions) -> Result<Option<Cube>> {
        let levels = self.document.array(&self.at("specularImages"))?;
        let Some(first) = levels.first() else { return Ok(None) };
        let at = self.at("specularImages/0");
        let faces = first.as_array().map_or(&[][..], Vec::as_slice);
        if faces.len() != 6 {
            return Err(self.document.error(at, format!("expected six images, found {}", faces.len())));
        }
        let mut cube = Cube { side: 0, texels: Vec::new() };
        for (face, image) in faces.iter().enumerate() {
            let from = format!("{at}/{face}");
            let index = self.document.index(image, &from)?;
            if index >= self.document.table("images")?.len() {
                return Err(self.document.out_of_range("images", index, &from));
            }
            let image = decode_whole(self.document, index, options, "an image-based light")?;
            let side = if face == 0 { image.width } else { cube.side };
            if image.width != side || image.height != side {
                let problem = format!("expected square images of one size, found {}x{}", image.width, image.height);
                return Err(self.document.error(from, problem));
            }
            cube.side = side;
            cube.texels.extend(radiance_of(&image.texels_in(ColorSpace::Srgb)));
        }
        if let Some(at) = cube.texels.iter().position(|texel| !texel.is_finite() || texel.min_element() < 0.0) {
            let problem = format!("expected radiance, finite and at least 0, found {}", cube.texels[at]);
            return Err(self.document.error(self.at("specularImages/0"), problem));
        }
        Ok(Some(cube))
    }

    /// Coefficients of the radiance that the irradiance comes from.
    fn radiance(&self) -> Result<[DVec3; 9]> {
        let at = self.at("irradianceCoefficients");
        let listed = self.document.array(&at)?;
        let triple = |value: &Value| -> Option<DVec3> {
            let numbers: Vec<f64> = value.as_array()?.iter().map(Value::as_f64).collect::<Option<_>>()?;
            let [r, g, b] = numbers[..] else { return None };
            Some(DVec3::new(r, g, b)).filter(|v| v.is_finite())
        };
        let read: Option<Vec<DVec3>> = listed.iter().map(triple).collect();
        let Some(Ok(mut coefficients)) = read.map(<[DVec3; 9]>::try_from) else {
            let expected = "expected six images in specularImages, or nine coefficients of three numbers each";
            return Err(self.document.error(at, format!("{expected}, found {} values", listed.len())));
        };
        for (i, coefficient) in coefficients.iter_mut().enumerate() {
            *coefficient /= [PI, 2.0 * PI / 3.0, PI / 4.0][[0, 1, 1, 1, 2, 2, 2, 2, 2][i]];
        }
        Ok(coefficients)
    }
}

/// Linear radiance of packed texels.
fn radiance_of(texels: &Texels) -> Vec<Vec3> {
    // What is divided by 0 was too bright to be packed.
    let unpacked = |color: Vec3, alpha: f32| color / alpha.max(1.0 / 255.0);
    match texels {
        Texels::Float(plane) => plane.iter().map(|&[r, g, b, a]| unpacked(Vec3::new(r, g, b), a)).collect(),
        Texels::Eight(plane) => {
            let linear = |c: u8| SRGB_TO_LINEAR[usize::from(c)];
            let texel =
                |&[r, g, b, a]: &[u8; 4]| unpacked(Vec3::new(linear(r), linear(g), linear(b)), f32::from(a) / 255.0);
            plane.iter().map(texel).collect()
        }
        _ => Vec::new(),
    }
}

/// Six square images, one after the other.
struct Cube {
    side: usize,
    texels: Vec<Vec3>,
}

impl Cube {
    /// The texel in a direction.
    fn at(&self, dir: DVec3) -> Vec3 {
        let size = dir.abs();
        // To the right and down in the image, over the distance of the face.
        let (face, distance, right, down) = if size.x >= size.y && size.x >= size.z {
            if dir.x > 0.0 { (0, size.x, dir.z, -dir.y) } else { (1, size.x, -dir.z, -dir.y) }
        } else if size.y >= size.z {
            if dir.y > 0.0 { (2, size.y, -dir.x, dir.z) } else { (3, size.y, -dir.x, -dir.z) }
        } else if dir.z > 0.0 {
            (4, size.z, -dir.x, -dir.y)
        } else {
            (5, size.z, dir.x, -dir.y)
        };
        let place = |along: f64| (((0.5 + 0.5 * along / distance) * self.side as f64) as usize).min(self.side - 1);
        self.texels[(face * self.side + place(down)) * self.side + place(right)]
    }
}

/// What nine coefficients make in a unit direction, at least 0.
fn smooth(coefficients: &[DVec3; 9], dir: DVec3) -> Vec3 {
    let DVec3 { x, y, z } = dir;
    let [one, two] = [(3.0 / (4.0 * PI)).sqrt(), (15.0 / (4.0 * PI)).sqrt()];
    let basis = [
        (1.0 / (4.0 * PI)).sqrt(),
        one * y,
        one * z,
        one * x,
        two * x * y,
        two * y * z,
        0.5 * (5.0 / (4.0 * PI)).sqrt() * (3.0 * z * z - 1.0),
        two * x * z,
        0.5 * two * (x * x - y * y),
    ];
    let sum: DVec3 = coefficients.iter().zip(basis).map(|(&coefficient, basis)| coefficient * basis).sum();
    sum.max(DVec3::ZERO).as_vec3()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: the page above: what one sees from inside, by camera: forward × up is to the right.
    #[test]
    fn faces_are_as_seen_from_inside() {
        let texels = (0..6 * 4).map(|i| Vec3::new((i / 4) as f32, (i % 2) as f32, (i / 2 % 2) as f32)).collect();
        let cube = Cube { side: 2, texels };
        let views = [
            (DVec3::X, DVec3::Y),
            (DVec3::NEG_X, DVec3::Y),
            (DVec3::Y, DVec3::NEG_Z),
            (DVec3::NEG_Y, DVec3::Z),
            (DVec3::Z, DVec3::Y),
            (DVec3::NEG_Z, DVec3::Y),
        ];
        for (face, (forward, up)) in views.into_iter().enumerate() {
            let right = forward.cross(up);
            for (x, y) in [(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)] {
                let seen = cube.at((forward + right * x - up * y).normalize());
                assert_eq!(seen, Vec3::new(face as f32, (x > 0.0) as u8 as f32, (y > 0.0) as u8 as f32));
            }
        }
    }

    /// Oracle: the closed forms of the page: irradiance π everywhere comes from radiance 1; RGBD by division.
    #[test]
    fn packed_and_smooth_radiance_is_unpacked() {
        let eight: Texels = vec![[255u8, 0, 188, 128], [255, 255, 255, 255], [0, 0, 0, 0]].into();
        let unpacked = radiance_of(&eight);
        let expected = Vec3::new(255.0 / 128.0, 0.0, 0.502_886_5 * 255.0 / 128.0);
        assert!((unpacked[0] - expected).length() < 1e-5, "{}", unpacked[0]);
        assert_eq!((unpacked[1], unpacked[2]), (Vec3::ONE, Vec3::ZERO));
        let mut coefficients = [DVec3::ZERO; 9];
        coefficients[0] = DVec3::splat((4.0 * PI).sqrt());
        assert!((smooth(&coefficients, DVec3::X) - Vec3::ONE).length() < 1e-6);
        coefficients[3] = DVec3::splat(-10.0);
        assert_eq!(smooth(&coefficients, DVec3::X), Vec3::ZERO);
    }
}
