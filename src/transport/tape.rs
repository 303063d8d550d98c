//! What kernels record while they run. In a render nothing: with [`Silent`] every note compiles to nothing. A replay
//! runs the same functions with [`Story`](super::story::Story).
//!
//! A tape that is on runs with a wave of one path, which lies in lane [`LANE`] of every block.

use super::vertex::{Emission, End, LightSample, Medium, Roulette, Scattering, Surface, Vertex};

/// The lane of the path that is written down.
pub const LANE: usize = 0;

/// Something that was decided, in the order in which kernels decide.
pub enum Event {
    /// A ray was traced: the vertex at its end, with nothing known but what the ray met.
    Vertex(Box<Vertex>),
    /// It met a surface.
    Surface(Surface),
    /// It collided before it met anything.
    Medium(Medium),
    /// Light that the surface or the environment emits.
    Emission(Emission),
    /// Russian roulette.
    Roulette(Roulette),
    /// What the surface turned out to be, the normal of its shading frame, and the GGX alpha of its widest lobe.
    Model(&'static str, [f32; 3], f32),
    /// A light sample, not traced yet.
    Light(LightSample),
    /// A BSDF sample.
    Scattering(Scattering),
    /// Why the path ends here; `None` if it goes on.
    End(Option<End>),
    /// What a shadow ray adds; `None` if it is blocked.
    Shadow(Option<[f32; 3]>),
    /// Radiance of the sample so far, and the scatterings of the paths that entered it last.
    Gathered([f32; 3], u32),
}

/// See the module.
pub trait Tape {
    /// Whether anything is written down.
    const ON: bool;

    /// Writes down an event, which is only made if the tape is on.
    fn note(&mut self, event: impl FnOnce() -> Event);
}

/// Writes nothing down.
pub struct Silent;

impl Tape for Silent {
    const ON: bool = false;

    #[inline(always)]
    fn note(&mut self, _: impl FnOnce() -> Event) {}
}
