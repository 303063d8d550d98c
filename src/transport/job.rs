//! What the loop reads besides the [`World`]: backend, camera, filter, and the source of random numbers.

use super::names::Names;
use super::world::World;
use crate::backend::Backend;
use crate::camera::CameraRays;
use crate::film::filter::FilterTable;
use crate::plan::Aov;
use crate::sampler::SamplerKind;
use crate::shading::medium::Media;

/// A render as its workers see it.
#[derive(Clone, Copy)]
pub struct Job<'a> {
    /// What light transport reads.
    pub world: World<'a>,
    /// Ray queries.
    pub backend: &'a dyn Backend,
    /// Camera rays.
    pub camera: &'a CameraRays,
    /// The same at equal intervals of the shutter; empty where the camera is at rest.
    pub camera_steps: &'a [CameraRays],
    /// The solids around the camera as the shutter opens.
    pub media: Media,
    /// Pixel filter.
    pub filter: &'a FilterTable,
    /// Random numbers.
    pub sampler: SamplerKind,
    /// Seed of every random number.
    pub seed: u64,
    /// Columns of the full image: pixels are numbered row by row.
    pub columns: u32,
    /// Rows of the full image.
    pub rows: u32,
    /// Ids of what is met, for layers of them.
    pub names: &'a Names,
    /// Layers besides the beauty.
    pub layers: &'a [Aov],
    /// Whether kernels may run in AVX-512.
    pub avx512: bool,
}
