//! The wavefront: batches of paths advance one edge at a time.

/// What a render traced and met. Sums over workers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
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
}

/// Where a non-finite sample was met.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NonFinite {
    /// Pixel in the full image.
    pub pixel: (u32, u32),
    /// Sample index of the pixel.
    pub sample: u64,
}
