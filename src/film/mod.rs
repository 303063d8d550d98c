//! The film: per pixel, f64 sums of radiance and coverage in two halves of independent scrambles.
//!
//! Means are exact to the last bits of f64 for any number of samples (HARDCASES M08); negative values, which filters
//! with negative lobes make at edges, are kept. Values that are not finite never enter: the caller counts them and adds
//! zero instead.

pub mod aov;
pub mod atomic;
pub mod estimate;
pub mod exr;
pub mod filter;
pub mod lengths;
pub mod png;

use crate::plan::options::Crop;

/// Sums of one pixel. Half `h` holds the samples whose index has parity `h`; the halves use independent scrambles of
/// the sampler, so a quarter of the squared difference of their means is an unbiased estimate of the variance of the
/// pixel (HARDCASES §6.2).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// Sums of R, G, B radiance and of coverage, both times the filter's signed weight, by half.
    pub sum: [[f64; 4]; 2],
    /// Number of samples by half.
    pub n: [u64; 2],
}

/// A picture being made: the pixels of the crop window, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    /// Full image: columns, rows.
    pub resolution: (u32, u32),
    /// The window that holds pixels.
    pub window: Crop,
    /// `window.width × window.height` pixels.
    pub pixels: Vec<Pixel>,
}

/// Samples per pixel over a film.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SppRange {
    /// Of the pixel with the fewest.
    pub min: u64,
    /// Mean.
    pub mean: f64,
    /// Of the pixel with the most.
    pub max: u64,
}

impl Pixel {
    /// Adds one sample to half `half` (0 or 1): radiance and coverage, both weighted by the filter.
    #[inline(always)]
    pub fn add(&mut self, half: usize, rgb: [f32; 3], weight: f32, coverage: f32) {
        debug_assert!(
            rgb.iter().all(|c| c.is_finite()) && weight.is_finite() && coverage.is_finite(),
            "a sample that is not finite reached the film: {rgb:?} × {weight}, coverage {coverage}"
        );
        let weight = f64::from(weight);
        let sum = &mut self.sum[half];
        for (sum, value) in sum.iter_mut().zip([rgb[0], rgb[1], rgb[2], coverage]) {
            *sum += weight * f64::from(value);
        }
        self.n[half] += 1;
    }

    /// Adds the samples of another film's pixel. The order in which parts are merged is the order of the sums: keep it
    /// fixed where bits matter.
    pub fn merge(&mut self, other: &Pixel) {
        for half in 0..2 {
            for c in 0..4 {
                self.sum[half][c] += other.sum[half][c];
            }
            self.n[half] += other.n[half];
        }
    }

    /// Number of samples.
    pub fn samples(&self) -> u64 {
        self.n[0] + self.n[1]
    }

    /// Mean of R, G, B and coverage over all samples; 0 without samples.
    pub fn mean(&self) -> [f64; 4] {
        let n = self.samples().max(1) as f64;
        std::array::from_fn(|c| (self.sum[0][c] + self.sum[1][c]) / n)
    }

    /// Unbiased estimate of the variance of [`mean`](Self::mean) per colour channel, from one difference of halves:
    /// (A − B)²·n₀n₁/n², which is (A − B)²/4 for equal halves. `None` until both halves have samples.
    pub fn variance(&self) -> Option<[f64; 3]> {
        let [n0, n1] = self.n.map(|n| n as f64);
        if n0 == 0.0 || n1 == 0.0 {
            return None;
        }
        let share = (n0 / (n0 + n1)) * (n1 / (n0 + n1));
        Some(std::array::from_fn(|c| (self.sum[0][c] / n0 - self.sum[1][c] / n1).powi(2) * share))
    }
}

impl Film {
    /// An empty film.
    pub fn new(resolution: (u32, u32), window: Crop) -> Self {
        Film { resolution, window, pixels: vec![Pixel::default(); window.width as usize * window.height as usize] }
    }

    /// Pixel at `(x, y)` of the window.
    pub fn pixel(&self, x: u32, y: u32) -> &Pixel {
        &self.pixels[y as usize * self.window.width as usize + x as usize]
    }

    /// Adds the pixels of `tile`, row-major; the tile is in pixels of the full image and lies inside the window.
    pub fn merge_tile(&mut self, tile: Crop, pixels: &[Pixel]) {
        debug_assert_eq!(pixels.len(), tile.width as usize * tile.height as usize, "pixels of tile {tile:?}");
        let left = (tile.x - self.window.x) as usize;
        let top = (tile.y - self.window.y) as usize;
        for (row, source) in pixels.chunks_exact(tile.width as usize).enumerate() {
            let start = (top + row) * self.window.width as usize + left;
            for (pixel, other) in self.pixels[start..start + source.len()].iter_mut().zip(source) {
                pixel.merge(other);
            }
        }
    }

    /// Samples per pixel.
    pub fn spp(&self) -> SppRange {
        let mut range = SppRange { min: u64::MAX, mean: 0.0, max: 0 };
        let mut total = 0u64;
        for pixel in &self.pixels {
            let n = pixel.samples();
            range.min = range.min.min(n);
            range.max = range.max.max(n);
            total += n;
        }
        if self.pixels.is_empty() {
            return SppRange::default();
        }
        SppRange { mean: total as f64 / self.pixels.len() as f64, ..range }
    }

    /// Mean over the window of R, G, B and coverage.
    pub fn mean(&self) -> [f64; 4] {
        let mut sum = [0.0; 4];
        for pixel in &self.pixels {
            for (sum, value) in sum.iter_mut().zip(pixel.mean()) {
                *sum += value;
            }
        }
        sum.map(|s| s / self.pixels.len().max(1) as f64)
    }

    /// 64-bit fingerprint of size, counts and the bits of all sums. Equal films have equal hashes; one changed bit
    /// changes it. Not cryptographic.
    pub fn hash(&self) -> u64 {
        let window = [self.window.x, self.window.y, self.window.width, self.window.height];
        let mut hash = mix(u64::from(self.resolution.0), u64::from(self.resolution.1));
        for value in window {
            hash = mix(hash, u64::from(value));
        }
        for pixel in &self.pixels {
            for half in 0..2 {
                for sum in pixel.sum[half] {
                    hash = mix(hash, sum.to_bits());
                }
                hash = mix(hash, pixel.n[half]);
            }
        }
        hash
    }
}

/// One step of the film's hash: a bijection of `value` for each state (Stafford's variant 13 of the SplitMix finaliser).
fn mix(state: u64, value: u64) -> u64 {
    let mut z = (state.rotate_left(5) ^ value).wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::estimate::tests::Pcg;

    #[test]
    fn variance_is_unbiased_for_equal_and_unequal_halves() {
        // Oracle: a uniform variable has variance 1/12, its mean over n samples 1/(12 n). 20000 pixels, one degree of
        // freedom each: s.e. of the mean estimate is √(2/20000) = 1 %; the limit of 5 s.e. alarms falsely 6·10⁻⁷.
        for (n0, n1) in [(4, 4), (7, 1), (5, 4)] {
            let mut random = Pcg(42);
            let trials = 20_000;
            let mut sum = 0.0;
            for _ in 0..trials {
                let mut pixel = Pixel::default();
                for i in 0..n0 + n1 {
                    pixel.add(usize::from(i >= n0), [random.next(); 3], 1.0, 1.0);
                }
                sum += pixel.variance().expect("both halves have samples")[1];
            }
            let expected = 1.0 / 12.0 / f64::from(n0 + n1);
            assert!((sum / f64::from(trials) / expected - 1.0).abs() < 0.05, "{n0} {n1}: {sum}");
        }
        assert_eq!(Pixel { n: [3, 0], ..Default::default() }.variance(), None);
    }

    #[test]
    fn tiles_merge_into_their_place_and_change_the_hash() {
        let mut film = Film::new((16, 9), Crop { x: 4, y: 2, width: 5, height: 4 });
        let empty = film.hash();
        let mut tile = vec![Pixel::default(); 4];
        for (i, pixel) in tile.iter_mut().enumerate() {
            pixel.add(0, [i as f32, 1.0, 1.0], 1.0, 0.5);
        }
        film.merge_tile(Crop { x: 7, y: 4, width: 2, height: 2 }, &tile);
        film.merge_tile(Crop { x: 7, y: 4, width: 2, height: 2 }, &tile);
        assert_eq!(film.pixel(4, 3).sum[0], [6.0, 2.0, 2.0, 1.0]);
        assert_eq!(film.pixel(3, 2).n, [2, 0]);
        assert_eq!(film.spp(), SppRange { min: 0, mean: 0.4, max: 2 });
        // One bit of one sum shows in the hash, and so does the place of the window.
        let hash = film.hash();
        assert_ne!(hash, empty);
        let mut other = film.clone();
        other.pixels[13].sum[0][2] = f64::from_bits(other.pixels[13].sum[0][2].to_bits() ^ 1);
        assert_ne!(other.hash(), hash);
        other = film.clone();
        other.window.x = 5;
        assert_ne!(other.hash(), hash);
    }
}
