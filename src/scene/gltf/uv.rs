//! Channels of texture coordinates: which of the file's sets a texture reads, and how it transforms them.
//!
//! Source: glTF 2.0 §3.9.2 (`texCoord`) and KHR_texture_transform (`ext`). The map is affine, so it is applied to the
//! vertices once, in f64, and interpolation between them stays what it was: transforms cost nothing later.

use glam::{DMat2, DVec2, Vec2};

/// One channel: a set of the file and its transform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct UvChannel {
    /// n of `TEXCOORD_n`.
    pub(super) set: u32,
    pub(super) linear: DMat2,
    pub(super) offset: DVec2,
}

impl UvChannel {
    /// The set as in the file.
    pub(super) const fn plain(set: u32) -> UvChannel {
        UvChannel { set, linear: DMat2::IDENTITY, offset: DVec2::ZERO }
    }

    /// Coordinates of the set to those of the channel. Results beyond f32 become 0.
    pub(super) fn apply(&self, uv: Vec2) -> Vec2 {
        if *self == UvChannel::plain(self.set) {
            return uv;
        }
        let moved = (self.linear * uv.as_dvec2() + self.offset).as_vec2();
        if moved.is_finite() { moved } else { Vec2::ZERO }
    }

    /// Whether tangents along the set's u and v are along the channel's as well: it is neither turned nor mirrored.
    pub(super) fn keeps_tangents(&self) -> bool {
        let DMat2 { x_axis, y_axis } = self.linear;
        x_axis.y == 0.0 && y_axis.x == 0.0 && x_axis.x > 0.0 && y_axis.y > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: the extension's example, "the lower left quadrant of the image, rotated clockwise 90°". No randomness.
    #[test]
    fn a_turned_quadrant_is_where_the_extension_puts_it() {
        let channel = UvChannel {
            set: 0,
            linear: DMat2::from_angle(-std::f64::consts::FRAC_PI_2) * DMat2::from_diagonal(DVec2::splat(0.5)),
            offset: DVec2::new(0.0, 1.0),
        };
        // The image's top left corner shows what is at the bottom left: clockwise by a quarter.
        for (uv, expected) in [([0.0, 0.0], [0.0, 1.0]), ([1.0, 0.0], [0.0, 0.5]), ([0.0, 1.0], [0.5, 1.0])] {
            assert!((channel.apply(uv.into()) - Vec2::from(expected)).length() < 1e-7, "{uv:?}");
        }
        assert!(!channel.keeps_tangents() && UvChannel::plain(3).keeps_tangents());
    }
}
