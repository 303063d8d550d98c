//! What a light sample is, and what all kinds of light make of a colour.

use glam::Vec3;

/// A point on a light, drawn for a receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Number of the light; 0 until it is chosen among others.
    pub light: u32,
    /// Unit direction from the receiver to the light.
    pub wi: Vec3,
    /// Where the light is hit; `None` for lights at infinity.
    pub target: Option<LightPoint>,
    /// Radiance arriving along −wi. For delta lights: W/m² per unit of |cos| (intensity/d², or irradiance).
    pub radiance: Vec3,
    /// Where an emission texture, and whether the emitter is there, has to be looked up and multiplied into `radiance`;
    /// `None` where that is complete.
    pub texture_point: Option<TexturePoint>,
    /// Density of the choice of light and direction together, sr⁻¹. For delta lights the selection probability
    /// alone.
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

/// A point on a triangle whose emission comes from a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TexturePoint {
    /// Index into [`Geometry::triangles`](crate::scene::geometry::Geometry::triangles).
    pub triangle: u32,
    /// Weights of the second and third corner.
    pub barycentric: [f32; 2],
}

/// What a colour counts where one number is needed.
pub(super) fn channel_mean(color: Vec3) -> f64 {
    (f64::from(color.x) + f64::from(color.y) + f64::from(color.z)) / 3.0
}

/// Whether every channel is a finite number ≥ 0.
pub(super) fn is_radiance(color: Vec3) -> bool {
    color.is_finite() && color.cmpge(Vec3::ZERO).all()
}
