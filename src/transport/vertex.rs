//! One path as a story: what [`replay`](super::replay) writes down of each vertex. Plain numbers for people and
//! programs; positions in metres of the world as the file has it, directions as unit vectors of the world, densities in
//! sr⁻¹, radiance in W·sr⁻¹·m⁻².

use serde::{Serialize, Serializer};

/// A number that keeps its bits in JSON, where NaN and the infinities have no spelling: they become "NaN", "inf",
/// "-inf".
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Number(pub f32);

impl Serialize for Number {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.0.is_finite() { serializer.serialize_f32(self.0) } else { serializer.collect_str(&self.0) }
    }
}

/// Three of them.
pub type Triple = [Number; 3];

/// Three numbers as [`Triple`].
pub fn triple(values: impl Into<[f32; 3]>) -> Triple {
    values.into().map(Number)
}

/// One vertex of a path: where its ray went, and everything that was decided there.
#[derive(Clone, Debug, Serialize)]
pub struct Vertex {
    /// Edges of the path up to here: 1 for what the camera sees.
    pub edge: u32,
    /// Origin of the ray, metres.
    pub origin_m: [f64; 3],
    /// Its unit direction.
    pub direction: Triple,
    /// Throughput f/p that arrives here.
    pub throughput: Triple,
    /// What the ray met.
    pub met: Met,
    /// What emission or environment gave; `None` where there is none.
    pub emission: Option<Emission>,
    /// Russian roulette; `None` where the path did not come to it.
    pub roulette: Option<Roulette>,
    /// The light sample; `None` where none was drawn.
    pub light: Option<LightSample>,
    /// The BSDF sample; `None` where none was drawn or the draw was refused.
    pub scattering: Option<Scattering>,
    /// Why the path ended here; `None` if it went on.
    pub end: Option<End>,
    /// What the sample has gathered up to and with this vertex.
    pub gathered: Triple,
}

/// What a ray met.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Met {
    /// A triangle.
    Surface(Surface),
    /// A particle of a medium.
    Medium(Medium),
    /// Nothing: it left the scene.
    Infinity,
}

/// Where a path is scattered in a medium.
#[derive(Clone, Debug, Serialize)]
pub struct Medium {
    /// Length of the ray, metres.
    pub distance_m: Number,
    /// Where.
    pub position_m: [f64; 3],
    /// Name of the solid's material, or "fog".
    pub medium: String,
}

/// A surface point.
#[derive(Clone, Debug, Serialize)]
pub struct Surface {
    /// Length of the ray, metres.
    pub distance_m: Number,
    /// Where.
    pub position_m: [f64; 3],
    /// Bound of the error of the position along the normal, metres.
    pub error_m: Number,
    /// Unit normal of the triangle, on its authored front side.
    pub normal_geometric: Triple,
    /// Unit normal that is shaded with, after interpolation and normal map; on the side of the viewer where opaque.
    pub normal_shading: Triple,
    /// Whether the ray came from the front side.
    pub front: bool,
    /// Name of the material.
    pub material: String,
    /// What it is here: "lambert", "glossy", "dielectric", "thin", "black", "unlit"; `None` where that was not asked.
    pub kind: Option<&'static str>,
    /// GGX alpha of its widest lobe here: 0 if none has a density, 1 if one is no microfacet lobe.
    pub widest_alpha: Option<Number>,
    /// Mesh of the flattened geometry; 0 is the world's.
    pub mesh: u32,
    /// Triangle within it.
    pub triangle: u32,
    /// Placement, for meshes that are not in the world directly.
    pub instance: Option<u32>,
    /// Fraction of the light that the way here left, where a solid absorbed.
    pub transmittance: Option<Triple>,
}

/// Light that a surface or the environment emits.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Emission {
    /// Its radiance.
    pub radiance: Triple,
    /// Density with which the last BSDF sample chose this direction; "inf" after a mirror and for camera rays.
    pub bsdf_pdf_sa: Number,
    /// Density with which light sampling would have chosen it; 0 where it does not take part.
    pub light_pdf_sa: Number,
    /// MIS weight.
    pub mis_weight: Number,
    /// Throughput · radiance · weight: what was added.
    pub contribution: Triple,
}

/// Russian roulette.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Roulette {
    /// Probability of going on.
    pub survival: Number,
    /// The random number; the path survives if it is below.
    pub number: Number,
    /// Whether it did.
    pub survived: bool,
}

/// A light sample.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct LightSample {
    /// Unit direction to the light.
    pub wi: Triple,
    /// Distance to the point on the light, metres; `None` at infinity.
    pub distance_m: Option<Number>,
    /// Radiance that would arrive (intensity/d² or irradiance of punctual lights).
    pub radiance: Triple,
    /// Density of the choice of light and direction together; for punctual lights the probability of the choice.
    pub light_pdf_sa: Number,
    /// Density with which BSDF sampling would have chosen the direction; 0 for punctual lights.
    pub bsdf_pdf_sa: Number,
    /// f·|cos θ| of the surface.
    pub f_cos: Triple,
    /// MIS weight.
    pub mis_weight: Number,
    /// What it adds if nothing is in between but surfaces that are there in part; what those let through is counted.
    pub contribution: Triple,
    /// What became of it.
    pub outcome: Shadow,
}

/// What became of a light sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Shadow {
    /// The way was free: the contribution was added.
    Visible,
    /// Something is in between.
    Blocked,
    /// No ray was traced: the light lies behind the surface, or carries nothing.
    NotTraced,
}

/// A BSDF sample.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Scattering {
    /// The lobe that was drawn from.
    pub lobe: &'static str,
    /// Its GGX alpha: 0 for a mirror or smooth glass, 1 where it is no microfacet lobe.
    pub alpha: Number,
    /// Unit direction of the next edge.
    pub wi: Triple,
    /// Density of the choice; "inf" for a mirror or smooth glass.
    pub pdf_sa: Number,
    /// f·|cos θ|/pdf.
    pub weight: Triple,
    /// Relative index of refraction from this side to the other; 1 for reflection.
    pub eta: Number,
}

/// Why a path ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum End {
    /// It left the scene.
    LeftScene,
    /// Its ray had a component that is not finite or out of range, and was not traced.
    InvalidRay,
    /// An unlit surface shows its colour and scatters nothing.
    Unlit,
    /// The depth limit.
    DepthLimit,
    /// Russian roulette.
    Roulette,
    /// The surface scatters nothing: it is black, or its normal map turns it away from the viewer.
    Absorbed,
    /// The BSDF sample was refused: the facet reflects into the surface, or the direction is on the wrong side of a
    /// normal.
    Refused,
    /// The throughput became 0.
    NothingCarried,
}

impl End {
    /// For people.
    pub fn name(self) -> &'static str {
        match self {
            End::LeftScene => "left the scene",
            End::InvalidRay => "its ray was not finite and not traced",
            End::Unlit => "unlit surface",
            End::DepthLimit => "depth limit",
            End::Roulette => "roulette",
            End::Absorbed => "absorbed",
            End::Refused => "direction refused",
            End::NothingCarried => "nothing left to carry",
        }
    }
}
