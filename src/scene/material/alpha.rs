//! Alpha: where a surface is there at all. Alpha is the base colour's fourth channel: factor × texture × vertex
//! colour.
//!
//! Source: glTF 2.0 §3.9.4. MASK: the surface is there where alpha ≥ cutoff. BLEND: it covers the fraction alpha of
//! what lies behind, so a ray meets it with probability alpha and else goes straight on. Coverage is not transmission:
//! what is met scatters as the whole surface would.

/// glTF `alphaMode`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// There everywhere, whatever alpha is.
    #[default]
    Opaque,
    /// There where alpha reaches the cutoff (any finite number; above 1 the surface is nowhere).
    Mask {
        /// `alphaCutoff`.
        cutoff: f32,
    },
    /// There with probability alpha.
    Blend,
}

impl AlphaMode {
    /// Probability that a ray meets a surface of this mode where its alpha is `alpha`; 0 or 1 under a mask.
    #[inline(always)]
    pub fn coverage(self, alpha: f32) -> f32 {
        match self {
            AlphaMode::Opaque => 1.0,
            AlphaMode::Mask { cutoff } => f32::from(alpha >= cutoff),
            AlphaMode::Blend => alpha,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: glTF 2.0 §3.9.4 by hand.
    #[test]
    fn coverage_follows_the_mode() {
        let mask = |cutoff| AlphaMode::Mask { cutoff };
        assert_eq!(AlphaMode::Opaque.coverage(0.3), 1.0);
        assert_eq!(AlphaMode::Blend.coverage(0.3), 0.3);
        assert_eq!(mask(0.5).coverage(0.5), 1.0);
        assert_eq!(mask(0.5).coverage(0.49), 0.0);
    }
}
