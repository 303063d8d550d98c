//! Light sources as the estimator sees them: choose one, draw a point, know the density of any direction.
//!
//! Lights are numbered: emissive triangles and parallelograms of the world mesh first, in their order there, then
//! punctual lights, then the environment. Emission is one-sided, along `n_g`; what emits from both sides is two lights,
//! of which the back has the number after the front's. Densities are in sr⁻¹ and include the
//! choice of the light. Colours count by the mean of their channels where one number is needed, because errors are
//! measured per channel. Refuses: radiance that is negative or not finite. What is black is never chosen.

use glam::Vec3;

use crate::error::{Error, Result};
use crate::math::table::TableError;
use crate::scene::Scene;
use crate::scene::geometry::Geometry;

pub mod aim;
pub mod area;
pub mod emit;
pub mod environment;
pub mod grow;
pub mod punctual;
mod sample;
pub mod select;
pub mod tree;

pub use sample::{LightPoint, LightSample, TexturePoint};

use area::{AreaLight, Emission, Members};
use environment::{EnvironmentLight, Seen};
use select::{ByReceiver, Distant, Selected, Selection, Selector};

/// An emissive triangle as a ray met it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmitterHit {
    /// `Triangle::light` of the triangle.
    pub light: u32,
    /// Length of the ray, metres.
    pub distance_m: f32,
    /// Cosine between `n_g` and the way back along the ray; not above 0 behind the emitter.
    pub cos_light: f32,
    /// Area of the light: [`Lights::area_m2`].
    pub area_m2: f32,
}

/// How many lights of each kind there are, for the plan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LightCounts {
    /// Emissive triangles; two that make up a parallelogram count once, and one that emits from both sides twice.
    pub triangles: usize,
    /// Punctual lights.
    pub punctual: usize,
    /// 1 if there is an environment that is not black.
    pub environment: usize,
}

/// All lights of a scene.
#[derive(Clone, Debug)]
pub struct Lights {
    areas: Vec<AreaLight>,
    /// What each of `areas` is made of.
    members: Vec<Members>,
    /// One entry a material.
    emissions: Vec<Emission>,
    punctual: Vec<punctual::Light>,
    environment: Option<EnvironmentLight>,
    selector: Selector,
}

impl Lights {
    /// Finds the lights of a scene and weighs them by their power. The world mesh must hold every emissive triangle.
    pub fn build(scene: &Scene, geometry: &Geometry) -> Result<Lights> {
        let invalid =
            |pointer: String, problem: String| Error::InvalidScene { file: scene.file.clone(), pointer, problem };
        let emissions = (scene.materials.iter().enumerate())
            .map(|(index, material)| {
                Emission::new(material, &scene.textures).ok_or_else(|| {
                    let found =
                        format!("emission of {:?} is {}, expected finite and >= 0", material.name, material.emissive);
                    invalid(format!("/materials/{index}"), found)
                })
            })
            .collect::<Result<Vec<_>>>()?;

        let (areas, members): (Vec<_>, Vec<_>) = area::find(geometry, &emissions).into_iter().unzip();
        let punctual = (scene.punctual.iter())
            .map(|light| {
                punctual::Light::new(light).map_err(|problem| {
                    invalid("/extensions/KHR_lights_punctual".into(), format!("light {:?}: {problem}", light.name))
                })
            })
            .collect::<Result<Vec<_>>>()?;
        let environment = scene.environment.as_ref().map(EnvironmentLight::new).transpose()?.flatten();

        // What is black is left out; the rest is weighed by intensity (finite distances) or irradiance (infinity).
        let mut near = Vec::new();
        let mut distant = Vec::new();
        let total = areas.len() + punctual.len() + usize::from(environment.is_some());
        let too_bright = |intensity: f64| format!("an intensity of {intensity} W/sr, expected finite and >= 0");
        for (number, light) in areas.iter().enumerate() {
            let emitter = light.emitter(number as u32, &emissions);
            if !emitter.intensity.is_finite() {
                let pointer = format!("/materials/{}", light.material);
                return Err(invalid(pointer, format!("an emissive triangle has {}", too_bright(emitter.intensity))));
            }
            near.extend((emitter.intensity > 0.0).then_some(emitter));
        }
        for (number, light) in (areas.len() as u32..).zip(&punctual) {
            match light.emitter(number) {
                Some(emitter) => near.extend((emitter.intensity > 0.0).then_some(emitter)),
                None => distant.push(Distant { light: number, irradiance: light.irradiance() }),
            }
        }
        if let Some(light) = &environment {
            distant.push(Distant { light: total as u32 - 1, irradiance: light.irradiance() });
        }
        distant.retain(|light| light.irradiance > 0.0);
        let selector = Selector::new(near, &distant, total)
            .map_err(|error: TableError| invalid("/".into(), format!("lights: {error}")))?;
        Ok(Lights { areas, members, emissions, punctual, environment, selector })
    }

    /// Writes the number of its light into each emissive triangle. `geometry` is the one that `build` saw.
    pub fn assign(&self, geometry: &mut Geometry) {
        for triangle in &mut geometry.triangles {
            triangle.light = u32::MAX;
        }
        for (number, members) in self.members.iter().enumerate().filter(|(_, members)| !members.back) {
            for triangle in [Some(members.first), members.second].into_iter().flatten() {
                geometry.triangles[triangle as usize].light = number as u32;
            }
        }
    }

    /// Turns the environment about +Y; as much light comes from it, so that nothing is weighed anew.
    pub fn turn_environment(&mut self, rotation_rad: f32) {
        if let Some(light) = &mut self.environment {
            light.turn(rotation_rad);
        }
    }

    /// How many lights of each kind there are.
    pub fn counts(&self) -> LightCounts {
        LightCounts {
            triangles: self.areas.len(),
            punctual: self.punctual.len(),
            environment: usize::from(self.environment.is_some()),
        }
    }

    /// Whether no light can be sampled: there is none, or all are black.
    pub fn is_dark(&self) -> bool {
        self.selection() == Selection::Dark
    }

    /// How a light is chosen. Only [`Selection::Receiver`] depends on the receiver.
    pub fn selection(&self) -> Selection {
        self.selector.selection()
    }

    /// Probability with which [`sample`](Self::sample) chooses the light of that number for a receiver; 0 if there
    /// is no such light.
    #[inline]
    pub fn p_select(&self, light: u32, p: Vec3, n: Vec3) -> f32 {
        self.selector.p_select(light, p, n)
    }

    /// Draws a light by `u[0]` and a point on it by `u[1]`, `u[2]`, for a receiver at `p` with unit normal `n`, or n =
    /// 0 where light from both sides counts. `None` where the chosen light cannot send anything there.
    #[inline]
    pub fn sample(&self, p: Vec3, n: Vec3, u: [f32; 3]) -> Option<LightSample> {
        let chosen = self.selector.select(p, n, refined(u))?;
        self.sample_chosen(&chosen, p, [u[1], u[2]])
    }

    /// The second half of [`sample`](Self::sample): a point on a light that was chosen.
    #[inline]
    pub fn sample_chosen(&self, chosen: &Selected, p: Vec3, uv: [f32; 2]) -> Option<LightSample> {
        let number = chosen.light as usize;
        let mut sample = if let Some(light) = self.areas.get(number) {
            light.sample(&self.emissions[light.material as usize], p, uv)
        } else if let Some(light) = self.punctual.get(number - self.areas.len()) {
            light.sample(p)
        } else {
            self.environment.as_ref().map(|light| light.sample(uv))
        }?;
        sample.light = chosen.light;
        sample.pdf_sa *= chosen.p_select;
        (sample.pdf_sa > 0.0 && sample.pdf_sa < f32::INFINITY).then_some(sample)
    }

    /// Density with which [`sample`](Self::sample) would have drawn the direction of a ray from `p` that met the
    /// emissive triangle of `hit`; 0 behind it.
    #[inline]
    pub fn pdf_triangle(&self, p: Vec3, n: Vec3, hit: &EmitterHit) -> f32 {
        if hit.cos_light > 0.0 {
            let pdf_sa = area::pdf_sa(hit.distance_m * hit.distance_m, hit.cos_light, hit.area_m2);
            self.selector.p_select(hit.light, p, n) * pdf_sa
        } else {
            0.0
        }
    }

    /// The one light of the scene, if it is a triangle or a parallelogram without texture, with its radiance: such a
    /// scene chooses nothing.
    pub fn only_area(&self) -> Option<(&AreaLight, Vec3)> {
        let light = self.areas.first().filter(|_| self.selection() == Selection::Single)?;
        let emission = &self.emissions[light.material as usize];
        (self.selector.p_select(0, Vec3::ZERO, Vec3::ZERO) == 1.0 && !emission.is_textured())
            .then(|| (light, emission.radiance()))
    }

    /// How lights are chosen where the receiver counts: the first half of [`sample`](Self::sample) for many receivers
    /// at once.
    #[inline(always)]
    pub fn by_receiver(&self) -> Option<&ByReceiver> {
        self.selector.by_receiver()
    }

    /// Emissive triangles and parallelograms, by number of the light.
    #[inline(always)]
    pub fn areas(&self) -> &[AreaLight] {
        &self.areas
    }

    /// The triangle of the world mesh that a light is, or the first of two; `None` for other kinds of light.
    pub fn triangle(&self, light: u32) -> Option<u32> {
        self.members.get(light as usize).map(|members| members.first)
    }

    /// What a material emits.
    #[inline(always)]
    pub fn emission(&self, material: u32) -> &Emission {
        &self.emissions[material as usize]
    }

    /// Area of an emissive triangle or of the parallelogram it belongs to, m²; what [`EmitterHit`] wants.
    #[inline(always)]
    pub fn area_m2(&self, light: u32) -> f32 {
        self.areas[light as usize].area_m2
    }

    /// Radiance of the environment from the unit direction `dir`; 0 without one.
    #[inline]
    pub fn environment_radiance(&self, dir: Vec3) -> Vec3 {
        self.environment.as_ref().map_or(Vec3::ZERO, |light| light.radiance(dir))
    }

    /// Number of the environment, where there is one.
    #[inline(always)]
    pub fn environment_number(&self) -> u32 {
        (self.areas.len() + self.punctual.len()) as u32
    }

    /// The environment, if there is one that is not black.
    #[inline(always)]
    pub fn environment(&self) -> Option<&EnvironmentLight> {
        self.environment.as_ref()
    }

    /// The environment, if it is the only light: such a scene chooses nothing.
    #[inline(always)]
    pub fn only_environment(&self) -> Option<&EnvironmentLight> {
        self.environment.as_ref().filter(|_| self.selection() == Selection::Single)
    }

    /// Probability with which [`sample`](Self::sample) chooses the environment for a receiver.
    #[inline(always)]
    pub fn p_environment(&self, p: Vec3, n: Vec3) -> f32 {
        self.selector.p_select((self.areas.len() + self.punctual.len()) as u32, p, n)
    }

    /// What a ray from `p` in the unit direction `dir` finds when it leaves the scene, with the density of the
    /// direction under [`sample`](Self::sample) for that receiver; black without an environment.
    #[inline]
    pub fn environment_seen(&self, dir: Vec3, p: Vec3, n: Vec3) -> Seen {
        self.environment.as_ref().map_or(Seen { radiance: Vec3::ZERO, pdf_sa: 0.0 }, |light| {
            let Seen { radiance, pdf_sa } = light.seen(dir);
            Seen { radiance, pdf_sa: self.p_environment(p, n) * pdf_sa }
        })
    }

    /// Density with which [`sample`](Self::sample) would have drawn `dir` from the environment.
    #[inline]
    pub fn pdf_environment(&self, dir: Vec3, p: Vec3, n: Vec3) -> f32 {
        self.environment.as_ref().map_or(0.0, |light| self.p_environment(p, n) * light.pdf_sa(dir))
    }
}

/// `u[0]` with the bits below its lattice of 2^-24 drawn from the other two numbers: among millions of lights most
/// probabilities lie below one step.
#[inline(always)]
pub fn refined([u, v, w]: [f32; 3]) -> f64 {
    let lattice = |x: f32| (x * (1 << 24) as f32) as i32 as u32;
    let mixed = (lattice(v).wrapping_mul(0x9E37_79B1) ^ lattice(w)).wrapping_mul(0x85EB_CA6B);
    const SCALE: f64 = 1.0 / (1u64 << 48) as f64;
    f64::from(u) + f64::from((mixed >> 8) as i32) * SCALE
}
