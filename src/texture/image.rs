//! A decoded image, before it is known as what it is read.

use std::ops::Range;

use super::color::{ColorSpace, decode_colors};
use super::encoded::not_finite;
use super::plane::{Plane, Rows};
use super::pyramid::{self, EightBits, Floats};
use super::texels::Texels;

/// A decoded image.
#[derive(Clone, Debug)]
pub struct Image {
    /// Columns, > 0.
    pub width: usize,
    /// Rows, > 0.
    pub height: usize,
    /// Never [`Texels::Udim`].
    pub texels: Texels,
    /// Integers in the file, so that colours are encoded by the sRGB curve.
    pub integers: bool,
}

impl Image {
    /// One texel.
    pub fn constant(texel: [u8; 4]) -> Self {
        Image { width: 1, height: 1, texels: vec![texel].into(), integers: true }
    }

    /// What is wrong with texels that are infinite or NaN, if there are any.
    pub(crate) fn check_finite(&self) -> Result<(), String> {
        let Texels::Float(plane) = &self.texels else { return Ok(()) };
        let levels = plane.levels().iter().map(|(width, _, texels)| (*width, texels.as_slice()));
        let mut all = std::iter::once((self.width, &*plane.base)).chain(levels);
        all.find_map(|(width, texels)| not_finite(texels, width, 0)).map_or(Ok(()), Err)
    }

    /// The texels as a texture of this colour space keeps them: colours of 16 bits are decoded here, those of 8 bits
    /// when they are looked up. Levels of the file that end early are gone on with.
    pub fn texels_in(&self, color_space: ColorSpace) -> Texels {
        let size = (self.width, self.height);
        match &self.texels {
            Texels::Float(plane) => {
                let (mut base, mut levels) = (plane.base.clone(), plane.levels().to_vec());
                if self.integers && color_space == ColorSpace::Srgb {
                    let mut decoded = base.to_vec();
                    decode_colors(&mut decoded);
                    base = decoded.into();
                    levels.iter_mut().for_each(|(_, _, texels)| decode_colors(texels));
                }
                if !levels.is_empty() {
                    levels = pyramid::complete(size, &base, levels, Floats);
                }
                Texels::Float(Plane::with_levels(base, levels))
            }
            // Levels that are made belong to one colour space.
            Texels::Eight(plane) => {
                let mut levels = plane.levels().to_vec();
                if !levels.is_empty() {
                    levels = pyramid::complete(size, &plane.base, levels, EightBits(color_space));
                }
                Texels::Eight(Plane::with_levels(plane.base.clone(), levels))
            }
            other => other.clone(),
        }
    }

    /// Shows the image and all levels below it, as a texture of this colour space reads them, to `each`: columns, rows,
    /// and a function that copies texels.
    pub(super) fn levels_in<E>(
        &self,
        color_space: ColorSpace,
        mut each: impl FnMut(usize, usize, &dyn Fn(Range<usize>) -> Rows) -> Result<(), E>,
    ) -> Result<(), E> {
        let size = (self.width, self.height);
        match self.texels_in(color_space) {
            Texels::Eight(plane) => {
                let levels = pyramid::complete(size, &plane.base, plane.levels().to_vec(), EightBits(color_space));
                each(size.0, size.1, &|texels| Rows::Eight(plane.base[texels].to_vec()))?;
                for (width, height, all) in levels {
                    each(width, height, &|texels| Rows::Eight(all[texels].to_vec()))?;
                }
            }
            Texels::Float(plane) => {
                let levels = pyramid::complete(size, &plane.base, plane.levels().to_vec(), Floats);
                each(size.0, size.1, &|texels| Rows::Float(plane.base[texels].to_vec()))?;
                for (width, height, all) in levels {
                    each(width, height, &|texels| Rows::Float(all[texels].to_vec()))?;
                }
            }
            _ => {}
        }
        Ok(())
    }
}
