//! What a ray runs in: a stack of solids, and absorption inside them by Beer and Lambert. Distances in metres.
//!
//! Nested dielectrics after Schmidt and Budge, "Simple Nested Dielectrics in Ray Traced Images" (2002): of all solids
//! around a point, the one of the highest rank is the medium there; a boundary of any other changes nothing. Ranks are
//! the numbers of `scene::geometry::solids`.

use glam::Vec3;

use crate::scene::Material;
use crate::scene::geometry::NO_SOLID;

/// Most solids that a path remembers being in; of more, the outermost are forgotten.
const DEPTH: usize = 6;

/// The solids around a path, and since when.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Media {
    /// In ascending rank, [`NO_SOLID`] behind the last; a solid that overlaps itself may stand here more than once.
    solids: [u32; DEPTH],
    /// How many.
    len: u32,
    /// Where on the present edge the path came into its medium, metres.
    pub since_m: f32,
}

/// The boundary of a solid, and the way across.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Boundary {
    /// Number of the solid.
    pub solid: u32,
    /// Whether the path stands outside.
    pub entering: bool,
}

impl Media {
    /// No solid around.
    pub const NONE: Media = Media { solids: [NO_SOLID; DEPTH], len: 0, since_m: 0.0 };

    /// Of solids in any order.
    pub fn of(solids: &[u32]) -> Media {
        let mut media = Media::NONE;
        solids.iter().for_each(|&solid| media.enter(solid));
        media
    }

    /// The medium: the solid of the highest rank, or [`NO_SOLID`].
    #[inline(always)]
    pub fn top(&self) -> u32 {
        if self.len == 0 { NO_SOLID } else { self.solids[(self.len as usize - 1) % DEPTH] }
    }

    /// How often `solid` is around.
    #[inline(always)]
    fn count(&self, solid: u32) -> usize {
        self.solids.iter().filter(|&&other| other == solid).count()
    }

    /// Whether `solid` is around.
    #[inline(always)]
    pub fn holds(&self, solid: u32) -> bool {
        self.count(solid) > 0
    }

    /// What is around a path that stands before a boundary, where that is not what it has kept: before the inside of a
    /// solid that it never entered (an open body), it is in that solid.
    #[inline(always)]
    fn before(&self, Boundary { solid, entering }: Boundary) -> Media {
        let mut before = *self;
        if !entering && before.count(solid) == 0 {
            before.enter(solid);
        }
        before
    }

    /// The media before and behind boundaries that lie at one place; equal where crossing them changes nothing.
    #[inline(always)]
    pub fn across(&self, boundaries: [Option<Boundary>; 2]) -> [u32; 2] {
        let (mut before, mut behind) = (*self, *self);
        for boundary in boundaries.into_iter().flatten() {
            before = before.before(boundary);
            behind.cross(boundary);
        }
        [before.top(), behind.top()]
    }

    /// Enters or leaves a solid. One that the path is not in cannot be left.
    #[inline(always)]
    pub fn cross(&mut self, Boundary { solid, entering }: Boundary) {
        if entering { self.enter(solid) } else { self.leave(solid) }
    }

    fn enter(&mut self, solid: u32) {
        if self.len as usize == DEPTH {
            self.solids.copy_within(1.., 0);
            self.len -= 1;
        }
        let mut at = self.len as usize;
        while at > 0 && self.solids[at - 1] > solid {
            self.solids[at] = self.solids[at - 1];
            at -= 1;
        }
        self.solids[at] = solid;
        self.len += 1;
    }

    fn leave(&mut self, solid: u32) {
        let len = self.len as usize;
        if let Some(at) = self.solids[..len].iter().position(|&other| other == solid) {
            self.solids.copy_within(at + 1..len, at);
            self.solids[len - 1] = NO_SOLID;
            self.len -= 1;
        }
    }
}

/// Fraction of light left after `distance_m`, which may be infinite, inside a solid of this material.
pub fn transmittance(material: &Material, distance_m: f32) -> Vec3 {
    let exponent = distance_m / material.attenuation_distance_m;
    let c = material.attenuation_color;
    // Rounding makes ways below 0; an infinite way over an infinite distance is none.
    if exponent > 0.0 { Vec3::new(c.x.powf(exponent), c.y.powf(exponent), c.z.powf(exponent)) } else { Vec3::ONE }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Beer and Lambert at the ends of their range, infinite ways and distances among them. Oracle: by hand.
    #[test]
    fn ways_without_end_absorb_by_channel() {
        let of = |attenuation_distance_m: f32| Material {
            attenuation_distance_m,
            attenuation_color: Vec3::new(0.0, 0.5, 1.0),
            ..Material::default()
        };
        let (half, clear) = (of(2.0), of(f32::INFINITY));
        assert_eq!(transmittance(&half, 4.0), Vec3::new(0.0, 0.25, 1.0));
        assert_eq!(transmittance(&half, f32::INFINITY), Vec3::Z);
        for none in [0.0, -1e-6, -0.0] {
            assert_eq!(transmittance(&half, none), Vec3::ONE, "{none}");
        }
        for way in [0.0, 1.0, f32::MAX, f32::INFINITY] {
            assert_eq!(transmittance(&clear, way), Vec3::ONE, "{way}");
        }
    }

    /// Oracle: Schmidt and Budge by hand. 1 is a glass, 2 the wine in it, 3 an ice cube.
    #[test]
    fn the_inner_solid_is_the_medium() {
        let enter = |solid| Boundary { solid, entering: true };
        let leave = |solid| Boundary { solid, entering: false };
        let across = |media: Media, boundary| media.across([Some(boundary), None]);
        let mut media = Media::of(&[1]);
        assert_eq!((media.top(), across(media, leave(1))), (1, [1, NO_SOLID]));
        // Wine that reaches into the glass.
        assert_eq!(across(media, enter(2)), [1, 2]);
        media.cross(enter(2));
        assert_eq!((media.top(), across(media, leave(1))), (2, [2, 2]));
        media.cross(leave(1));
        assert_eq!((media.top(), across(media, leave(2))), (2, [2, NO_SOLID]));
        media.cross(enter(1));
        assert_eq!((media.top(), across(media, leave(2))), (2, [2, 1]));
        // Twice in itself.
        media.cross(enter(2));
        assert_eq!(across(media, leave(2)), [2, 2]);
        media.cross(leave(2));
        media.cross(leave(2));
        assert_eq!(media, Media::of(&[1]));
        // What the path is not in cannot be left.
        media.cross(leave(3));
        assert_eq!((media, across(media, leave(3))), (Media::of(&[1]), [3, 1]));
        // Wine that touches its glass: from one into the other, both ways, whichever is the inner one.
        assert_eq!(media.across([Some(enter(2)), Some(leave(1))]), [1, 2]);
        assert_eq!(Media::of(&[2]).across([Some(enter(1)), Some(leave(2))]), [2, 1]);
        assert_eq!(Media::of(&[7, 1, 6, 2, 5, 3, 4]).top(), 7);
    }
}
