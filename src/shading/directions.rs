//! Where paths go from a surface besides what its BSDF samples: a distribution of directions that is known beforehand,
//! mixed with that of the BSDF. The first of three numbers chooses between both (one-sample, Veach 1997 §9.2.4), and
//! the density is that of the mixture, whichever of them the direction came from.
//!
//! A distribution has cells. A share below 1 goes to it in each; the rest is left to the BSDF, so that a bad
//! distribution multiplies variance by 1/(1 − share) at most.

use glam::Vec3;

/// A distribution of directions, place by place.
pub trait Directions {
    /// The cell of a point (metres) of a surface whose unit geometric normal on the viewer's side is `n`.
    fn cell(&self, p: Vec3, n: Vec3) -> u32;

    /// Share of the directions there that come from it, in [0, 1).
    fn share(&self, cell: u32) -> f32;

    /// Unit direction of the world for two numbers in [0,1).
    fn draw(&self, cell: u32, u: [f32; 2]) -> Vec3;

    /// Density of [`draw`](Self::draw), sr⁻¹; integrates to 1 over the sphere.
    fn pdf_sa(&self, cell: u32, wi: Vec3) -> f32;
}

/// Density of the mixture, sr⁻¹; infinite for a delta lobe of the BSDF.
#[inline(always)]
pub fn mixed(share: f32, pdf_sa: f32, bsdf_pdf_sa: f32) -> f32 {
    share * pdf_sa + (1.0 - share) * bsdf_pdf_sa
}

/// Who draws the direction, by the first number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drawn {
    /// The distribution.
    Here,
    /// The BSDF, with this number in the place of the first.
    Bsdf(f32),
}

/// Splits the number `u` in [0,1).
#[inline(always)]
pub fn split(share: f32, u: f32) -> Drawn {
    /// Largest number below 1.
    const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;
    if u < share { Drawn::Here } else { Drawn::Bsdf(((u - share) / (1.0 - share)).min(BELOW_ONE)) }
}
