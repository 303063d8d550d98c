//! Random numbers, addressed rather than consumed: f(pixel, sample, dimension set, seed) → four numbers in [0,1).

pub mod dims;

/// The samplers of `--sampler`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SamplerKind {
    /// Owen-scrambled Sobol points, padded in sets of four dimensions.
    Sobol,
    /// Independent uniform numbers.
    Independent,
}
