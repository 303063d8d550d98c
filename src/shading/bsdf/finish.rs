//! How the surface of a microfacet lobe is finished: as rough along every direction, or with a grain
//! (`KHR_materials_anisotropy`) and under a thin film (`KHR_materials_iridescence`).
//!
//! A grain runs along local x, so lobes that have one get their directions in its frame ([`Grain`]). Along the grain
//! the GGX alpha grows from α to α + (1 − α)·strength², across it α stays (section "Implementation" of the
//! extension).

use glam::{Vec2, Vec3};

use super::film::Film;
use super::microfacet::{ALPHA_DELTA, Ggx};

/// What lobes ask of the finish of their surface.
pub trait Finish: Copy {
    /// The larger GGX alpha: of a mirror if below [`ALPHA_DELTA`].
    fn alpha(self) -> f32;

    /// The same with alphas not below `least`.
    #[must_use]
    fn at_least(self, least: f32) -> Self;

    /// The distribution of normals.
    fn ggx(self) -> Ggx;

    /// Reflectance with what the film makes of `plain`, for light under `cos` in air; `f0` is that at the normal.
    fn reflectance(self, plain: Vec3, cos: f32, f0: Vec3) -> Vec3;
}

/// A GGX alpha alone.
impl Finish for f32 {
    #[inline(always)]
    fn alpha(self) -> f32 {
        self
    }

    #[inline(always)]
    fn at_least(self, least: f32) -> f32 {
        self.max(least)
    }

    #[inline(always)]
    fn ggx(self) -> Ggx {
        Ggx::isotropic(self)
    }

    #[inline(always)]
    fn reflectance(self, plain: Vec3, _: f32, _: Vec3) -> Vec3 {
        plain
    }
}

/// A grain and a film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fine {
    /// GGX alpha along and across the grain.
    pub alpha: Vec2,
    /// What lies on the surface.
    pub film: Film,
}

impl Fine {
    /// Of a surface of GGX `alpha` with a grain of `strength` from 0 to 1.
    #[inline(always)]
    pub fn new(alpha: f32, strength: f32, film: Film) -> Self {
        Fine { alpha: Vec2::new(alpha + (1.0 - alpha) * strength * strength, alpha), film }
    }

    /// The GGX alpha that the azimuth of `w`, in the frame of the grain, shows.
    #[inline(always)]
    pub fn alpha_towards(self, w: Vec3) -> f32 {
        let sin2 = w.x * w.x + w.y * w.y;
        let (x, y) = (self.alpha.x * w.x, self.alpha.y * w.y);
        if sin2 > 0.0 { ((x * x + y * y) / sin2).sqrt() } else { self.mean_alpha() }
    }

    /// That of no azimuth.
    #[inline(always)]
    pub fn mean_alpha(self) -> f32 {
        (self.alpha.x * self.alpha.y).sqrt()
    }
}

impl Finish for Fine {
    #[inline(always)]
    fn alpha(self) -> f32 {
        self.alpha.max_element()
    }

    #[inline(always)]
    fn at_least(self, least: f32) -> Self {
        Fine { alpha: self.alpha.max(Vec2::splat(least)), ..self }
    }

    #[inline(always)]
    fn ggx(self) -> Ggx {
        // Across a grain, nothing is finer than a rough lobe can be.
        Ggx::anisotropic(self.alpha.x.max(ALPHA_DELTA), self.alpha.y.max(ALPHA_DELTA))
    }

    #[inline(always)]
    fn reflectance(self, plain: Vec3, cos: f32, f0: Vec3) -> Vec3 {
        self.film.over(plain, || self.film.reflectance(cos, f0))
    }
}

/// Where a grain runs in the shading frame: a turn about the normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grain {
    cos: f32,
    sin: f32,
}

impl Grain {
    /// Along the frame's own x.
    pub const X: Grain = Grain { cos: 1.0, sin: 0.0 };

    /// Along a direction, as far as it lies in the surface; along x where it does not.
    #[inline(always)]
    pub fn along(direction: Vec3) -> Self {
        let length = direction.x.hypot(direction.y);
        if length > 1e-6 { Grain { cos: direction.x / length, sin: direction.y / length } } else { Grain::X }
    }

    /// From the shading frame.
    #[inline(always)]
    pub fn to_local(self, w: Vec3) -> Vec3 {
        Vec3::new(self.cos * w.x + self.sin * w.y, self.cos * w.y - self.sin * w.x, w.z)
    }

    /// To the shading frame.
    #[inline(always)]
    pub fn to_frame(self, w: Vec3) -> Vec3 {
        Vec3::new(self.cos * w.x - self.sin * w.y, self.cos * w.y + self.sin * w.x, w.z)
    }
}
