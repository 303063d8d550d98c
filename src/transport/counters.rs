//! What a render traced and met, summed over workers in any order.

use super::truncation::Truncated;

/// How many non-finite samples are kept by place.
pub const NONFINITE_LISTED: usize = 16;

/// Counts of one worker or of all.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Counters {
    /// Camera paths begun.
    pub paths: u64,
    /// Camera rays.
    pub rays_camera: u64,
    /// Rays after a scattering.
    pub rays_bounce: u64,
    /// Shadow rays.
    pub rays_shadow: u64,
    /// Rays that were refused because a component was NaN, infinite or out of range.
    pub invalid_rays: u64,
    /// Samples whose radiance was not finite; they enter the film as 0.
    pub nonfinite: u64,
    /// The first of them.
    pub nonfinite_first: Vec<NonFinite>,
    /// Paths ended by the depth limit.
    pub capped_paths: u64,
    /// What those could still have carried.
    pub truncated: Truncated,
    /// Look-ups of textures.
    pub texture_lookups: u64,
}

impl Counters {
    /// Rays of all classes.
    pub fn rays(&self) -> u64 {
        self.rays_camera + self.rays_bounce + self.rays_shadow
    }

    /// The count of rays at the end of edge `edge`.
    #[inline(always)]
    pub(super) fn rays_of(&mut self, edge: u32) -> &mut u64 {
        if edge == 1 { &mut self.rays_camera } else { &mut self.rays_bounce }
    }

    /// Adds another worker's counts. The list of non-finite samples is kept in order of pixel and sample, so that it
    /// does not depend on which worker came first.
    pub fn merge(&mut self, other: &Counters) {
        self.paths += other.paths;
        self.rays_camera += other.rays_camera;
        self.rays_bounce += other.rays_bounce;
        self.rays_shadow += other.rays_shadow;
        self.invalid_rays += other.invalid_rays;
        self.nonfinite += other.nonfinite;
        self.capped_paths += other.capped_paths;
        self.truncated.merge(&other.truncated);
        self.texture_lookups += other.texture_lookups;
        other.nonfinite_first.iter().for_each(|&met| self.list(met));
    }

    /// Keeps the first non-finite samples in order of sample, row and column: the same ones whatever the order in which
    /// they are met.
    pub(super) fn list(&mut self, met: NonFinite) {
        let listed = &mut self.nonfinite_first;
        let at = listed.partition_point(|other| other.place() < met.place());
        listed.insert(at, met);
        listed.truncate(NONFINITE_LISTED);
    }
}

/// Where a non-finite sample was met.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NonFinite {
    /// Pixel in the full image.
    pub pixel: (u32, u32),
    /// Sample index of the pixel.
    pub sample: u64,
    /// Scatterings of the path whose contribution it was (0: light seen directly). Found by a replay at the end of the
    /// render; `None` until then.
    pub bounce: Option<u32>,
}

impl NonFinite {
    /// The order in which samples are listed: independent of tiles and passes.
    fn place(&self) -> (u64, u32, u32) {
        (self.sample, self.pixel.1, self.pixel.0)
    }
}
