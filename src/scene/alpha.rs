//! Alpha: where a surface is there at all. Alpha is the base colour's fourth channel: factor × texture × vertex colour.
//!
//! Source: glTF 2.0 §3.9.4. MASK: the surface is there where alpha ≥ cutoff. BLEND: it covers the fraction alpha of what
//! lies behind, so a ray meets it with probability alpha and else goes straight on. Coverage is not transmission: what is
//! met scatters as the whole surface would.

use super::{Material, Texture};

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

impl Material {
    /// The alpha mode as far as it matters: opaque where no alpha that factor, texture and vertex colours can make lets a
    /// ray pass.
    pub fn effective_alpha(&self, textures: &[Texture]) -> AlphaMode {
        let texture = self.base_color_texture.and_then(|slot| textures.get(slot.texture.index()));
        let varies = self.vertex_colors || texture.is_some_and(|texture| texture.texels.may_have_alpha());
        let covered = self.alpha_mode.coverage(self.base_alpha) >= 1.0;
        if covered && (!varies || self.alpha_mode.coverage(0.0) >= 1.0) { AlphaMode::Opaque } else { self.alpha_mode }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: glTF 2.0 §3.9.4 by hand.
    #[test]
    fn modes_that_let_nothing_pass_are_opaque() {
        let material = |alpha_mode, base_alpha| Material { alpha_mode, base_alpha, ..Material::default() };
        let mask = |cutoff| AlphaMode::Mask { cutoff };
        for (mode, alpha, expected) in [
            (AlphaMode::Opaque, 0.2, AlphaMode::Opaque),
            (AlphaMode::Blend, 1.0, AlphaMode::Opaque),
            (AlphaMode::Blend, 0.999, AlphaMode::Blend),
            (mask(0.5), 0.5, AlphaMode::Opaque),
            (mask(0.5), 0.4, mask(0.5)),
            (mask(0.0), 0.0, AlphaMode::Opaque),
            (mask(1.5), 1.0, mask(1.5)),
        ] {
            assert_eq!(material(mode, alpha).effective_alpha(&[]), expected, "{mode:?} {alpha}");
        }
        let colored = Material { vertex_colors: true, ..material(AlphaMode::Blend, 1.0) };
        assert_eq!(colored.effective_alpha(&[]), AlphaMode::Blend);
        assert_eq!(AlphaMode::Blend.coverage(0.3), 0.3);
        assert_eq!(mask(0.5).coverage(0.49), 0.0);
    }
}
