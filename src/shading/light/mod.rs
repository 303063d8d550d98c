//! Light sources as the estimator sees them: choose one, draw a point, know the density of any direction.

use glam::Vec3;

/// A point on a light, drawn for a receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Unit direction from the receiver to the light.
    pub wi: Vec3,
    /// Where the light is hit; `None` for lights at infinity.
    pub target: Option<LightPoint>,
    /// Radiance arriving along −wi. For delta lights: W/m² per unit of |cos| (intensity/d², or irradiance).
    pub radiance: Vec3,
    /// Density of the choice of light and direction together, sr⁻¹. For delta lights the selection probability alone.
    pub pdf_sa: f32,
    /// Whether BSDF sampling can never find this light (punctual): no MIS then.
    pub delta: bool,
}

/// A sampled point at a finite distance, with what a shadow ray needs to stop short of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightPoint {
    /// World position.
    pub position: Vec3,
    /// Unit geometric normal of the emitter on the side of the receiver; zero for a punctual light.
    pub normal: Vec3,
    /// Error bound of `position`, metres (see `math::float`).
    pub error: f32,
}
