//! Lights without extent, `KHR_lights_punctual`: point, spot and directional. 1 cd is 1 W/sr, 1 lx is 1 W/m².
//!
//! The spot falls off with the square of the cosine's linear ramp between the inner and the outer angle, as the
//! extension's text has it; a cone whose angles are equal ends at a sharp edge (no least width, which would dim narrow
//! cones). Where the file states a `range`, light ends there by the window that the text recommends. Point lights with
//! a photometric profile (`EXT_lights_ies`) send shares of their intensity by direction; they are chosen by the
//! largest.

use std::f64::consts::PI;

use glam::Vec3;

use super::grow::Emitter;
use super::sample::{LightPoint, LightSample, channel_mean, is_radiance};
use crate::scene::light::{Aimed, PunctualKind, PunctualLight};

/// Largest reach of a spot, rad: short of π/2, where its bound would be 0.
const WIDEST_REACH: f64 = 1.5;

/// A punctual light, checked.
#[derive(Clone, Debug)]
pub struct Light {
    position: Vec3,
    direction: Vec3,
    intensity: Vec3,
    kind: PunctualKind,
    /// Square of the range, m²; infinite where there is none.
    range2: f32,
    /// Of a point light.
    profile: Option<Aimed>,
}

impl Light {
    /// Checks the numbers of a light; the error says which one is wrong.
    pub fn new(light: &PunctualLight) -> Result<Self, String> {
        let &PunctualLight { position, direction, intensity, kind, range_m, ref profile, .. } = light;
        if !is_radiance(intensity) {
            return Err(format!("intensity is {intensity}, expected finite and >= 0"));
        }
        let (placed, aimed, cone) = match kind {
            PunctualKind::Point => (true, false, None),
            PunctualKind::Directional => (false, true, None),
            PunctualKind::Spot { cos_inner, cos_outer } => (true, true, Some((cos_inner, cos_outer))),
        };
        if placed && !position.is_finite() {
            return Err(format!("position is {position}"));
        }
        if aimed && !direction.is_normalized() {
            return Err(format!("direction is {direction}, expected a unit vector"));
        }
        if let Some((cos_inner, cos_outer)) = cone
            && !(-1.0 <= cos_outer && cos_outer <= cos_inner && cos_inner <= 1.0)
        {
            return Err(format!("cosines of the cone are {cos_inner} inside and {cos_outer} outside"));
        }
        if !(range_m > 0.0) {
            return Err(format!("range is {range_m} m, expected one above 0"));
        }
        Ok(Light { position, direction, intensity, kind, range2: range_m * range_m, profile: profile.clone() })
    }

    /// What the choice of a light has to know; `None` for a directional light.
    pub fn emitter(&self, light: u32) -> Option<Emitter> {
        let (axis, spread, reach) = match self.kind {
            PunctualKind::Directional => return None,
            PunctualKind::Point => (Vec3::Z, PI, 0.0),
            PunctualKind::Spot { cos_inner, cos_outer } => {
                // Wide ramps end where the cosine of the angle beyond the spread is still positive.
                let (inner, outer) = (f64::from(cos_inner).acos(), f64::from(cos_outer).acos());
                let spread = inner.max(outer - WIDEST_REACH);
                (self.direction, spread, outer - spread)
            }
        };
        let corners = [self.position; 4];
        Some(Emitter { light, corners, axis, spread, reach, intensity: channel_mean(self.intensity) })
    }

    /// Irradiance of a receiver that faces a directional light, W/m².
    pub fn irradiance(&self) -> f64 {
        channel_mean(self.intensity)
    }

    /// What arrives at `p`; the density is 1, for the one direction there is. `None` outside of a cone.
    #[inline]
    pub fn sample(&self, p: Vec3) -> Option<LightSample> {
        let delta = |wi, target, radiance| LightSample {
            light: 0,
            wi,
            target,
            radiance,
            texture_point: None,
            pdf_sa: 1.0,
            delta: true,
        };
        if self.kind == PunctualKind::Directional {
            return Some(delta(-self.direction, None, self.intensity));
        }
        let to_light = self.position - p;
        let distance2 = to_light.length_squared();
        let wi = to_light / distance2.sqrt();
        let radiance = self.intensity * (self.share(-wi) / distance2 * self.window(distance2));
        // At the light itself there is no direction to it.
        let lit = radiance.max_element() > 0.0 && radiance.is_finite();
        let target = LightPoint { position: self.position, normal: Vec3::ZERO, error: 0.0 };
        lit.then(|| delta(wi, Some(target), radiance))
    }

    /// Where it is; `None` of a directional light.
    #[inline]
    pub fn place(&self) -> Option<Vec3> {
        (self.kind != PunctualKind::Directional).then_some(self.position)
    }

    /// Where a directional light shines.
    pub fn direction(&self) -> Vec3 {
        self.direction
    }

    /// What it sends in the unit direction `dir` before its [`window`](Self::window), W/sr; irradiance across its
    /// direction, W/m², of a directional light.
    pub fn sent(&self, dir: Vec3) -> Vec3 {
        self.intensity * self.share(dir)
    }

    /// What its range leaves at a squared distance of `distance2`; 1 without a range.
    #[inline(always)]
    pub fn window(&self, distance2: f32) -> f32 {
        let share = distance2 / self.range2;
        (1.0 - share * share).max(0.0)
    }

    /// What the cone or the profile leaves in a unit direction; 1 without one.
    #[inline(always)]
    fn share(&self, dir: Vec3) -> f32 {
        match (self.kind, &self.profile) {
            (PunctualKind::Spot { cos_inner, cos_outer }, _) => {
                let ramp = ramp(dir.dot(self.direction), cos_inner, cos_outer);
                ramp * ramp
            }
            (PunctualKind::Point, Some(Aimed { profile, light_from_world })) => profile.at(*light_from_world * dir),
            _ => 1.0,
        }
    }
}

/// 1 inside the inner cone, 0 outside the outer one, linear in the cosine between.
#[inline]
fn ramp(cos: f32, cos_inner: f32, cos_outer: f32) -> f32 {
    if cos >= cos_inner {
        1.0
    } else if cos <= cos_outer {
        0.0
    } else {
        (cos - cos_outer) / (cos_inner - cos_outer)
    }
}
