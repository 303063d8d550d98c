//! How wide a path is, for textures that are averaged over that width: a cone of rays that starts with the camera's
//! pixel and widens with every rough scattering.
//!
//! Source: Akenine-Möller et al., "Texture Level of Detail Strategies for Real-Time Ray Tracing" (Ray Tracing Gems,
//! 2019), §20.6. A rough scattering widens the cone to a 64th of the solid angle that its density spreads over, as
//! though 64 samples shared the lobe. Limit: curvature of mirrors and lenses does not bend the cone; a lens at the
//! camera does not open it.

/// A path's cone at the origin of its ray.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cone {
    /// Width at the ray's origin, metres.
    pub width_m: f32,
    /// Widening per metre.
    pub spread: f32,
}

/// Samples that share a lobe, see above.
const SHARE: f32 = 64.0;

impl Cone {
    /// Width after `distance_m`, metres.
    #[inline(always)]
    pub fn width_at(&self, distance_m: f32) -> f32 {
        self.width_m + self.spread * distance_m
    }

    /// The cone of the next edge: `width_m` wide where the path was scattered with density `pdf_sa`.
    #[inline(always)]
    pub fn scattered(&self, width_m: f32, pdf_sa: f32) -> Cone {
        // A mirror's density is infinite: its cone stays as narrow as it was.
        let lobe = (1.0 / (SHARE * std::f32::consts::PI * pdf_sa.max(f32::MIN_POSITIVE))).sqrt();
        // Half of a sphere's width is as wide as any cone gets.
        Cone { width_m, spread: self.spread.max(2.0 * lobe.min(1.0)) }
    }
}
