//! Filtered pictures, which stand beside the beauty and never in its place, with their error as it is *measured*: a
//! half of the samples is filtered and the other, which knows nothing of it, judges (`estimate/filtered.rs`).
//!
//! The guides are the layers `denoise_albedo` and `denoise_normal`, of all samples for the picture and of the same half
//! for the judgement.

use super::channel::{Channel, stored};
use super::estimate::FilteredError;
use super::layer::kind::rgb;
use super::oidn::{Noisy, Oidn};
use super::store::Film;
use crate::error::Result;
use crate::plan::aov::Aov;

/// A filtered picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Denoised {
    /// R, G, B of the window, row-major.
    pub rgb: Vec<[f32; 3]>,
    /// The measured error of filtering half of the samples; `None` until every pixel has samples in both halves.
    pub error: Option<FilteredError>,
}

impl Denoised {
    /// The channels `denoised.R`, `.G`, `.B`.
    pub fn channels(&self) -> impl Iterator<Item = Channel> + '_ {
        let of = |c: usize| self.rgb.iter().map(|rgb| rgb[c]).collect();
        rgb("denoised").into_iter().map(move |(name, c)| Channel { name, is_color: true, values: of(c) })
    }
}

impl Film {
    /// The film's picture, filtered, with the error of that. Guides are used where the film has gathered them.
    ///
    /// # Errors
    /// [`Error::Backend`](crate::Error::Backend) with the library's reason.
    pub fn denoise(&self, oidn: &Oidn) -> Result<Denoised> {
        let beauty: Vec<[f32; 3]> = self.pixels.iter().map(|pixel| three(&pixel.mean())).collect();
        let guides = [Aov::DENOISE_ALBEDO, Aov::DENOISE_NORMAL].map(|aov| self.layer(aov));
        let rgb = self.filter(oidn, &beauty, guides)?;
        let error = self.filtered_error(|half| {
            let mean = |c: usize, pixel: &super::Pixel| pixel.sum[half][c] / pixel.n[half] as f64;
            let color: Vec<[f32; 3]> =
                self.pixels.iter().map(|pixel| three(&[0, 1, 2].map(|c| mean(c, pixel)))).collect();
            let guides = [Aov::DENOISE_ALBEDO, Aov::DENOISE_NORMAL].map(|aov| self.layer_of_half(aov, half));
            self.filter(oidn, &color, guides)
        })?;
        Ok(Denoised { rgb, error })
    }

    fn filter(&self, oidn: &Oidn, color: &[[f32; 3]], guides: [Option<Vec<[f64; 3]>>; 2]) -> Result<Vec<[f32; 3]>> {
        let size = (self.window.width as usize, self.window.height as usize);
        // Filters with negative lobes leave the range that is asked for.
        let within = |image: Vec<[f64; 3]>, least: f64| -> Vec<[f32; 3]> {
            image.iter().map(|values| three(&values.map(|value| value.clamp(least, 1.0)))).collect()
        };
        let guides = match guides {
            [Some(albedo), Some(normal)] => Some([within(albedo, 0.0), within(normal, -1.0)]),
            _ => None,
        };
        let guides = guides.as_ref().map(|[albedo, normal]| [&albedo[..], &normal[..]]);
        let filtered = oidn.filter(&Noisy { size, color, guides })?;
        Ok(filtered.into_iter().map(|rgb| rgb.map(|value| if value.is_finite() { value } else { 0.0 })).collect())
    }
}

/// The first three values as they are stored.
fn three(values: &[f64]) -> [f32; 3] {
    std::array::from_fn(|c| stored(values[c]))
}
