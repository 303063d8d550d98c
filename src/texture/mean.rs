//! What looking once at every texel tells: means, ranges, and whether all are one.

use glam::Vec3;

use super::color::{ColorSpace, SRGB_TO_LINEAR};

/// The texel that all are, if they are.
pub(super) fn one_for_all<'t, T: Copy + PartialEq + 't>(texels: impl IntoIterator<Item = &'t T>) -> Option<T> {
    let mut texels = texels.into_iter();
    let &first = texels.next()?;
    texels.all(|texel| *texel == first).then_some(first)
}

/// How often each value of 8 bits occurs in R, G and B.
#[derive(Clone, Debug)]
pub(super) struct Histogram([[u64; 256]; 3]);

impl Default for Histogram {
    fn default() -> Self {
        Histogram([[0; 256]; 3])
    }
}

impl Histogram {
    pub(super) fn of<'t>(texels: impl IntoIterator<Item = &'t [u8; 4]>) -> Self {
        let mut counts = Histogram::default();
        counts.add(texels);
        counts
    }

    pub(super) fn add<'t>(&mut self, texels: impl IntoIterator<Item = &'t [u8; 4]>) {
        for texel in texels {
            for (channel, counts) in self.0.iter_mut().enumerate() {
                counts[usize::from(texel[channel])] += 1;
            }
        }
    }

    pub(super) fn mean(&self, color_space: ColorSpace) -> Vec3 {
        let texels = self.0[0].iter().sum::<u64>().max(1) as f64;
        let means = self.0.map(|counts| {
            let linear = |value: usize| match color_space {
                ColorSpace::Linear => value as f64 / 255.0,
                ColorSpace::Srgb => f64::from(SRGB_TO_LINEAR[value]),
            };
            let sum: f64 = counts.iter().enumerate().map(|(value, &count)| count as f64 * linear(value)).sum();
            // One texel of the darkest step in 2^31 of them is still above 0 in f32.
            (sum / texels) as f32
        });
        Vec3::from_array(means)
    }
}

/// Sums of float texels that are linear already.
#[derive(Clone, Debug, Default)]
pub(super) struct Sums {
    sum: [f64; 3],
    texels: u64,
}

impl Sums {
    pub(super) fn add<'t>(&mut self, texels: impl IntoIterator<Item = &'t [f32; 4]>) {
        for texel in texels {
            for c in 0..3 {
                self.sum[c] += f64::from(texel[c].max(0.0));
            }
            self.texels += 1;
        }
    }

    pub(super) fn mean(&self) -> Vec3 {
        Vec3::from_array(self.sum.map(|sum| (sum / self.texels.max(1) as f64) as f32))
    }
}

/// Least and largest value of each channel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extremes {
    least: [f32; 4],
    most: [f32; 4],
}

impl Default for Extremes {
    /// Of no texel.
    fn default() -> Self {
        Extremes { least: [f32::INFINITY; 4], most: [f32::NEG_INFINITY; 4] }
    }
}

impl Extremes {
    /// Of texels of 8 bits, over 255.
    pub(super) fn of_bytes<'t>(texels: impl IntoIterator<Item = &'t [u8; 4]>) -> Self {
        let (mut least, mut most) = ([u8::MAX; 4], [0; 4]);
        for texel in texels {
            for c in 0..4 {
                (least[c], most[c]) = (least[c].min(texel[c]), most[c].max(texel[c]));
            }
        }
        let value = |byte| f32::from(byte) / 255.0;
        Extremes { least: least.map(value), most: most.map(value) }
    }

    /// Of floats.
    pub(super) fn of_floats<'t>(texels: impl IntoIterator<Item = &'t [f32; 4]>) -> Self {
        texels.into_iter().fold(Extremes::default(), |range, &texel| range.and(Extremes { least: texel, most: texel }))
    }

    /// Of these texels and others.
    pub(super) fn and(self, other: Self) -> Self {
        Extremes {
            least: std::array::from_fn(|c| self.least[c].min(other.least[c])),
            most: std::array::from_fn(|c| self.most[c].max(other.most[c])),
        }
    }

    /// Least and largest value of a channel.
    pub(super) fn channel(&self, channel: usize) -> [f32; 2] {
        [self.least[channel], self.most[channel]]
    }
}
