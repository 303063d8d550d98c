//! Where light paths begin: a light by what it sends towards the casters, a point on it, and a direction in the cones
//! of the [`Aim`]; of lights at infinity a direction, and a line through one of its disks.
//!
//! What a start carries is power over density: W·m⁻²·sr⁻¹ · m² · sr, so that its mean over all starts is the power that
//! goes towards the casters. MIS weights ask for the *bracket*, the part of the density of a light path that belongs to
//! the light: the density of the start over the cosine at an area light, the product of both densities of lights at
//! infinity, and the density of the direction over the squared distance of a point (see
//! `transport/light_paths/ratio.rs`).

use glam::Vec3;

use super::aim::Aim;
use super::environment::EnvironmentLight;
use super::sample::TexturePoint;
use super::{Lights, area::AreaLight};
use crate::math::table::AliasTable;
use crate::scene::geometry::Geometry;

/// Starts of parallel rays lie so many radii of the scene before the centre of what they aim at.
const BEFORE: f32 = 2.5;

/// The starts of the light paths of a scene.
#[derive(Clone, Debug)]
pub struct Emitters {
    aim: Aim,
    choice: AliasTable,
    /// How far before the disks parallel rays begin, metres.
    before_m: f32,
    /// Power that goes towards the casters, about, W: mean of the channels.
    power_w: f64,
}

/// The start of a light path.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    /// Number of its light.
    pub light: u32,
    /// Where it starts.
    pub org: Vec3,
    /// Unit normal of the emitter there; 0 of lights without one.
    pub normal: Vec3,
    /// Bound of the error of `org` along the normal, metres.
    pub error: f32,
    /// Unit direction.
    pub dir: Vec3,
    /// Power over density.
    pub power: Vec3,
    /// Where an emission texture has to be looked up and multiplied into `power`.
    pub texture_point: Option<TexturePoint>,
}

impl Emitters {
    /// Of all lights that send something towards `aim`; `None` where none does.
    pub fn new(lights: &Lights, aim: Aim, geometry: &Geometry) -> Option<Self> {
        let mut weights = Vec::with_capacity(lights.areas.len() + lights.punctual.len() + 1);
        for (number, light) in (0u32..).zip(&lights.areas) {
            let emitter = light.emitter(number, &lights.emissions);
            let faces = |corner: &Vec3| {
                let above = |ball: &super::aim::Ball| light.normal().dot(ball.center - *corner) + ball.radius > 0.0;
                aim.balls().iter().any(above)
            };
            let center = emitter.corners.iter().sum::<Vec3>() / 4.0;
            let lit = emitter.corners.iter().any(faces);
            weights.push(if lit { emitter.intensity * f64::from(aim.cones_sr(center)) } else { 0.0 });
        }
        for light in &lights.punctual {
            weights.push(match light.emitter(0) {
                Some(emitter) => emitter.intensity * f64::from(aim.cones_sr(emitter.corners[0])),
                None => light.irradiance() * f64::from(aim.disks_m2()),
            });
        }
        if let Some(environment) = &lights.environment {
            // All that comes from around, which is twice what a receiver counts.
            weights.push(2.0 * environment.irradiance() * f64::from(aim.disks_m2()));
        }
        let power_w = weights.iter().sum();
        let choice = AliasTable::new(&weights).ok()?;
        Some(Emitters { aim, choice, before_m: BEFORE * geometry.bounding_radius(), power_w })
    }

    /// Power that goes towards the casters, about, W.
    pub fn power_w(&self) -> f64 {
        self.power_w
    }

    /// A start by four numbers (light, point, ball) and two (direction); `None` where the light sends nothing there.
    pub fn start(&self, lights: &Lights, u: [f32; 4], v: [f32; 2]) -> Option<Start> {
        let chosen = self.choice.sample(u[0]);
        let (number, p) = (chosen.index as usize, chosen.p);
        let areas = lights.areas.len();
        let start = if let Some(light) = lights.areas.get(number) {
            self.at_area(lights, light, u, v)
        } else if let Some(light) = lights.punctual.get(number - areas) {
            match light.place() {
                Some(org) => {
                    let dir = self.aim.direction(org, u[3], v);
                    let power = light.sent(dir) / self.aim.pdf_sa(org, dir);
                    Some(Start { org, dir, power, ..Start::NOWHERE })
                }
                None => Some(self.parallel(light.sent(Vec3::ZERO), light.direction(), u[3], v)),
            }
        } else {
            let sample = lights.environment.as_ref()?.sample([u[1], u[2]]);
            Some(self.parallel(sample.radiance / sample.pdf_sa, -sample.wi, u[3], v))
        };
        let start = start?;
        let power = start.power / p;
        let carries = power.is_finite() && power.max_element() > 0.0;
        carries.then_some(Start { light: chosen.index, power, ..start })
    }

    fn at_area(&self, lights: &Lights, light: &AreaLight, u: [f32; 4], v: [f32; 2]) -> Option<Start> {
        let point = light.uniform([u[1], u[2]]);
        let dir = self.aim.direction(point.position, u[3], v);
        let cos = dir.dot(point.normal);
        let emission = lights.emission(light.material());
        let density = self.aim.pdf_sa(point.position, dir) / light.area_m2;
        (cos > 0.0).then(|| Start {
            org: point.position,
            normal: point.normal,
            error: point.error,
            dir,
            power: emission.radiance() * (cos / density),
            texture_point: emission.is_textured().then(|| light.texture_point(point.barycentric)),
            ..Start::NOWHERE
        })
    }

    /// A start in the direction `dir` of parallel rays of irradiance `arriving`.
    fn parallel(&self, arriving: Vec3, dir: Vec3, choice: f32, v: [f32; 2]) -> Start {
        let through = self.aim.line(dir, choice, v);
        let power = arriving / self.aim.pdf_across(through, dir);
        Start { org: through - dir * self.before_m, dir, power, ..Start::NOWHERE }
    }

    /// Bracket of an area light for a light path that starts at `p` on it in direction `dir`, under the cosine
    /// `cos_light` to its normal; 0 where none does.
    #[inline]
    pub fn bracket_of_area(&self, light: u32, area_m2: f32, (p, dir): (Vec3, Vec3), cos_light: f32) -> f32 {
        let density = self.choice.p(light) * self.aim.pdf_sa(p, dir);
        if cos_light > 0.0 { density / (area_m2 * cos_light) } else { 0.0 }
    }

    /// Bracket of the environment for parallel rays in direction `dir` through `p`; `pdf_sa` is the density with which
    /// light samples draw the direction once the environment is chosen.
    #[inline]
    pub fn bracket_of_environment(&self, lights: &Lights, p: Vec3, dir: Vec3, pdf_sa: f32) -> f32 {
        self.choice.p(lights.environment_number()) * pdf_sa * self.aim.pdf_across(p, dir)
    }

    /// Bracket of a punctual light for a light path that arrives at `p` in direction `dir`; times squared metres if the
    /// light is at infinity.
    #[inline]
    pub fn bracket_of_punctual(&self, lights: &Lights, light: u32, p: Vec3, dir: Vec3) -> f32 {
        let Some(punctual) = lights.punctual.get(light as usize - lights.areas.len()) else { return 0.0 };
        let density = match punctual.place() {
            Some(org) => self.aim.pdf_sa(org, dir) / org.distance_squared(p),
            None => self.aim.pdf_across(p, dir),
        };
        self.choice.p(light) * density
    }

    /// Bracket of any light for a light path that starts on it at `org` (a light at a finite distance) in direction
    /// `dir` and arrives at `p`: what the functions above say one by one.
    pub fn bracket(&self, lights: &Lights, light: u32, (org, p): (Vec3, Vec3), dir: Vec3) -> f32 {
        match lights.areas.get(light as usize) {
            Some(area) => self.bracket_of_area(light, area.area_m2, (org, dir), area.normal().dot(dir)),
            None if (light as usize) < lights.areas.len() + lights.punctual.len() => {
                self.bracket_of_punctual(lights, light, p, dir)
            }
            None => {
                let pdf_sa = lights.environment.as_ref().map_or(0.0, |light: &EnvironmentLight| light.pdf_sa(-dir));
                self.bracket_of_environment(lights, p, dir, pdf_sa)
            }
        }
    }
}

impl Start {
    const NOWHERE: Start = Start {
        light: 0,
        org: Vec3::ZERO,
        normal: Vec3::ZERO,
        error: 0.0,
        dir: Vec3::Z,
        power: Vec3::ZERO,
        texture_point: None,
    };
}

impl Lights {
    /// Density with which light samples at the receiver `p` with normal `n` (0 where light from both sides counts) draw
    /// what a light path sends there: of the direction, sr⁻¹, or of the light alone where it is punctual. `org` is
    /// where the path starts on a light at a finite distance, `dir` is its direction.
    pub fn pdf_of_start(&self, light: u32, (p, n): (Vec3, Vec3), org: Vec3, dir: Vec3) -> f32 {
        match self.areas.get(light as usize) {
            Some(area) => {
                let cos_light = area.normal().dot(dir);
                let hit = super::EmitterHit { light, distance_m: org.distance(p), cos_light, area_m2: area.area_m2 };
                self.pdf_triangle(p, n, &hit)
            }
            None if (light as usize) < self.areas.len() + self.punctual.len() => self.p_select(light, p, n),
            None => self.pdf_environment(-dir, p, n),
        }
    }

    /// Whether rays cannot meet a light: it is punctual.
    pub fn is_punctual(&self, light: u32) -> bool {
        let areas = self.areas.len();
        (areas..areas + self.punctual.len()).contains(&(light as usize))
    }

    /// What the range of a punctual light leaves at a squared distance of `distance2`; 1 of other lights.
    pub fn window(&self, light: u32, distance2: f32) -> f32 {
        let punctual = (light as usize).checked_sub(self.areas.len()).and_then(|number| self.punctual.get(number));
        punctual.map_or(1.0, |light| light.window(distance2))
    }

    /// Where a light is, about: the place for which the media around it are looked up; `None` at infinity.
    pub fn place(&self, light: u32) -> Option<Vec3> {
        let number = light as usize;
        match self.areas.get(number) {
            Some(area) => Some(area.uniform([0.25, 0.5]).position),
            None => self.punctual.get(number - self.areas.len())?.place(),
        }
    }

    /// How many lights there are.
    pub fn len(&self) -> usize {
        self.areas.len() + self.punctual.len() + usize::from(self.environment.is_some())
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}
