//! What light paths add to pixels: sums in whole numbers, so that any order of additions, on any thread, machine or
//! part of a split, gives the same bits.
//!
//! A sum counts units of a power of two that the renderer derives from scene and options alone. Each half of a pixel
//! has its own: light paths of even sample indices add to the first, of odd ones to the second, as camera samples do
//! (`sampler`). Values that are not finite, or too large for 50 bits, are left out and counted, and so are sums that 63
//! bits do not hold.

use std::sync::atomic::{AtomicI64, AtomicU64, Ordering::Relaxed};

use super::shares::Shares;
use super::store::Film;
use crate::math::hash::mix;
use crate::plan::options::Crop;

/// Sums of a pixel for the beauty, and for each sum of R, G, B that a layer has besides.
const SUMS: usize = 6;

/// Bytes of a pixel, with what layers have besides.
pub const fn bytes(shares: u64) -> u64 {
    (SUMS * size_of::<i64>()) as u64 * (1 + shares)
}

/// Largest value of one addition, units.
const LARGEST: f64 = (1i64 << 50) as f64;

/// No light path of a next sample index.
const NOTHING: (u64, u64) = (0, 1);

/// Sums of light paths over the pixels of a window.
#[derive(Debug)]
pub struct Splats {
    /// Full image: columns, rows.
    resolution: (u32, u32),
    window: Crop,
    /// The unit is 2 to this power.
    exponent: i32,
    /// Units of 1.
    scale: f64,
    /// Sample indices all of whose light paths are in it, from the film's first one on.
    samples: u64,
    /// Light paths of the next sample index that are in it, and how many it has.
    begun: (u64, u64),
    /// Layers that are parts of the beauty.
    shares: Shares,
    /// Three channels a half, two halves for the beauty and each of the shares, of a pixel, row by row.
    sums: Vec<AtomicI64>,
    /// Values that were left out.
    lost: AtomicU64,
}

/// Stands for as many sample indices as each pixel has samples: of parts with gaps between them.
pub(crate) const AS_PIXELS: u64 = u64::MAX;

impl Clone for Splats {
    fn clone(&self) -> Self {
        let sums = self.sums.iter().map(|sum| AtomicI64::new(sum.load(Relaxed))).collect();
        Splats { sums, shares: self.shares.clone(), lost: AtomicU64::new(self.lost()), ..*self }
    }
}

impl PartialEq for Splats {
    fn eq(&self, other: &Self) -> bool {
        let about =
            |splats: &Splats| (splats.resolution, splats.window, splats.exponent, splats.traced(), splats.lost());
        about(self) == about(other) && self.shares == other.shares && self.sums().eq(other.sums())
    }
}

impl Splats {
    /// No sums yet, and the beauty alone. The unit is 2 to the power `exponent`.
    pub fn new(resolution: (u32, u32), window: Crop, exponent: i32) -> Self {
        Splats::with_shares(resolution, window, exponent, Shares::default())
    }

    /// The same with layers that are parts of the beauty.
    pub fn with_shares(resolution: (u32, u32), window: Crop, exponent: i32, shares: Shares) -> Self {
        let count = SUMS * (1 + shares.count()) * window.width as usize * window.height as usize;
        let sums = std::iter::repeat_with(AtomicI64::default).take(count).collect();
        Splats {
            resolution,
            window,
            exponent,
            scale: (-f64::from(exponent)).exp2(),
            samples: 0,
            begun: NOTHING,
            shares,
            sums,
            lost: AtomicU64::new(0),
        }
    }

    /// The same without sums.
    pub fn blank(&self) -> Self {
        self.of_window(self.window)
    }

    /// The same for another window, without sums.
    pub fn of_window(&self, window: Crop) -> Self {
        Splats::with_shares(self.resolution, window, self.exponent, self.shares.clone())
    }

    /// Layers that are parts of the beauty.
    pub fn shares(&self) -> &Shares {
        &self.shares
    }

    /// Sample indices all of whose light paths are in it.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// The same, the light paths of the next one that are in it besides, and how many that one has.
    pub(crate) fn traced(&self) -> (u64, (u64, u64)) {
        (self.samples, self.begun)
    }

    /// Whether it has the light paths of `samples` sample indices, and no others.
    pub(crate) fn has_just(&self, samples: u64) -> bool {
        [samples, AS_PIXELS].contains(&self.samples) && self.begun.0 == 0
    }

    /// Values that were left out because they were not finite or too large, and times that a sum overflowed.
    pub fn lost(&self) -> u64 {
        self.lost.load(Relaxed)
    }

    /// The window that has sums.
    pub fn window(&self) -> Crop {
        self.window
    }

    /// The unit is 2 to this power.
    pub fn exponent(&self) -> i32 {
        self.exponent
    }

    pub(crate) fn sums(&self) -> impl Iterator<Item = i64> {
        self.sums.iter().map(|sum| sum.load(Relaxed))
    }

    /// Sums a pixel.
    fn width(&self) -> usize {
        SUMS * (1 + self.shares.count())
    }

    /// How many sums there are.
    pub(crate) fn len(&self) -> usize {
        self.sums.len()
    }

    /// Of saved numbers; `None` where they are more or fewer than `empty` has.
    pub(crate) fn restored(
        empty: Splats,
        (samples, begun): (u64, (u64, u64)),
        lost: u64,
        sums: Vec<i64>,
    ) -> Option<Self> {
        let fits = sums.len() == empty.sums.len() && begun.0 < begun.1;
        let sums = sums.into_iter().map(AtomicI64::new).collect();
        fits.then_some(Splats { samples, begun, sums, lost: AtomicU64::new(lost), ..empty })
    }

    /// Adds a value to half `half` of the beauty of a pixel of the full image; does nothing outside of the window.
    #[inline]
    pub fn add(&self, pixel: (i32, i32), half: usize, rgb: [f64; 3]) {
        self.add_at(pixel, half, 0, rgb);
    }

    /// The same for a share of the beauty, by the number that [`Shares::each`] gives it.
    pub fn add_share(&self, pixel: (i32, i32), half: usize, number: usize, rgb: [f64; 3]) {
        self.add_at(pixel, half, 1 + number, rgb);
    }

    #[inline]
    fn add_at(&self, (x, y): (i32, i32), half: usize, place: usize, rgb: [f64; 3]) {
        let (x, y) = (i64::from(x) - i64::from(self.window.x), i64::from(y) - i64::from(self.window.y));
        let (width, height) = (i64::from(self.window.width), i64::from(self.window.height));
        if !((0..width).contains(&x) && (0..height).contains(&y)) {
            return;
        }
        let first = (y * width + x) as usize * self.width() + place * SUMS + half * 3;
        let units = rgb.map(|value| (value * self.scale).round());
        if !units.iter().all(|value| value.abs() <= LARGEST) {
            self.lost.fetch_add(1, Relaxed);
            return;
        }
        for (sum, value) in self.sums[first..first + 3].iter().zip(units) {
            if value != 0.0 {
                let units = value as i64;
                // Wrapped sums are the same in any order, but none of any use.
                if sum.fetch_add(units, Relaxed).checked_add(units).is_none() {
                    self.lost.fetch_add(1, Relaxed);
                }
            }
        }
    }

    /// Adds the sums of `part`, whose window lies inside this one.
    ///
    /// # Panics
    /// Where units or sizes differ.
    pub fn merge(&mut self, part: &Splats) {
        assert_eq!((self.exponent, self.resolution), (part.exponent, part.resolution), "splats of one render");
        let (dx, dy) = (part.window.x - self.window.x, part.window.y - self.window.y);
        assert_eq!(self.shares, part.shares, "splats of the same layers");
        let per_pixel = self.width();
        for (from, value) in part.sums().enumerate() {
            let (pixel, rest) = (from / per_pixel, from % per_pixel);
            let (x, y) = (pixel % part.window.width as usize, pixel / part.window.width as usize);
            let at = (y + dy as usize) * self.window.width as usize + x + dx as usize;
            let sum = self.sums[at * per_pixel + rest].get_mut();
            let (joined, overflows) = sum.overflowing_add(value);
            *sum = joined;
            *self.lost.get_mut() += u64::from(overflows);
        }
        *self.lost.get_mut() += part.lost();
    }

    /// Says how many sample indices are in it.
    pub(crate) fn set_samples(&mut self, samples: u64) {
        (self.samples, self.begun) = (samples, NOTHING);
    }

    /// Says how many light paths are in it, `per_sample` for each sample index.
    pub(crate) fn set_traced(&mut self, paths: u64, per_sample: u64) {
        self.set_samples(paths / per_sample);
        let begun = paths % per_sample;
        if begun > 0 {
            self.begun = (begun, per_sample);
        }
    }

    /// Adds what light paths have found to the layers of `film`, which has this window. A pixel gets the mean of its
    /// half's light paths for each of its camera samples, whether there are more or fewer of them: their weights are
    /// those of both techniques' full numbers, and each technique's mean is unbiased with any number.
    pub fn add_to(&self, film: &mut Film) {
        let (first, (begun, of)) = (film.first_sample, self.begun);
        let begun_half = (first ^ self.samples) & 1;
        let traced = [0, 1].map(|half| {
            let whole = self.samples.saturating_add(1 - ((first ^ half) & 1)) / 2;
            whole as f64 + if half == begun_half { begun as f64 / of as f64 } else { 0.0 }
        });
        let (width, of) = (self.width(), |sums: &[AtomicI64], place: usize| -> [[f64; 3]; 2] {
            let value = |half: usize, c: usize| sums[place * SUMS + half * 3 + c].load(Relaxed) as f64 / self.scale;
            [0, 1].map(|half| [0, 1, 2].map(|c| value(half, c)))
        });
        for (p, sums) in self.sums.chunks_exact(width).enumerate() {
            let n = film.pixels[p].n;
            let shares = [0, 1].map(|half| match traced[half] {
                _ if self.samples == AS_PIXELS => 1.0,
                traced if traced > 0.0 => n[half] as f64 / traced,
                _ => 0.0,
            });
            for (half, value) in of(sums, 0).into_iter().enumerate() {
                for c in 0..3 {
                    film.pixels[p].sum[half][c] += value[c] * shares[half];
                }
            }
            if self.shares.count() == 0 {
                continue;
            }
            for plane in film.planes_mut() {
                let Some((first, count)) = self.shares.place(plane.layer.aov.gathers()) else { continue };
                for (number, kept) in plane.pixel_mut(p).as_chunks_mut::<3>().0.iter_mut().take(count).enumerate() {
                    let halves = of(sums, 1 + first + number);
                    for c in 0..3 {
                        kept[c] += halves[0][c] * shares[0] + halves[1][c] * shares[1];
                    }
                }
            }
        }
    }

    /// A fingerprint of everything in it.
    pub fn digest(&self) -> u64 {
        let about = [self.exponent as u64, self.samples, self.lost()];
        let begun = [self.begun.0, self.begun.1].into_iter().filter(|_| self.begun.0 > 0);
        about.into_iter().chain(begun).chain(self.sums().map(|sum| sum as u64)).fold(0x5B1A75, mix)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WINDOW: Crop = Crop { x: 2, y: 1, width: 3, height: 2 };

    /// Oracle: sums by hand. Deterministic.
    #[test]
    fn sums_are_those_of_any_order_and_split() {
        let values: Vec<_> =
            (0..200).map(|i| ((2 + i % 3, 1 + i / 3 % 2), i as usize & 1, f64::from(i).sin())).collect();
        let whole = Splats::new((8, 8), WINDOW, -20);
        for &(pixel, half, value) in &values {
            whole.add(pixel, half, [value, 2.0 * value, -value]);
        }
        let mut joined = whole.blank();
        for part in values.rchunks(37) {
            let splats = whole.blank();
            part.iter().for_each(|&(pixel, half, value)| splats.add(pixel, half, [value, 2.0 * value, -value]));
            joined.merge(&splats);
        }
        assert_eq!(whole, joined);
        assert_eq!(whole.digest(), joined.digest());

        let mut film = Film::new((8, 8), WINDOW);
        for pixel in &mut film.pixels {
            pixel.n = [4, 2];
        }
        joined.set_samples(8);
        joined.add_to(&mut film);
        let of = |half: usize| values.iter().filter(|v| v.0 == (3, 2) && v.1 == half).map(|v| v.2).sum::<f64>();
        let pixel = film.pixel(1, 1);
        assert!((pixel.sum[0][1] - 2.0 * of(0)).abs() < 1e-4, "all samples");
        assert!((pixel.sum[1][0] - 0.5 * of(1)).abs() < 1e-4, "half of them");
        // 5¾ sample indices from an odd one on: 2¾ of the first half, 3 of the second.
        joined.set_traced(23, 4);
        let mut film = Film { first_sample: 3, ..Film::new((8, 8), WINDOW) };
        film.pixels.iter_mut().for_each(|pixel| pixel.n = [2, 1]);
        joined.add_to(&mut film);
        let pixel = film.pixel(1, 1);
        assert!((pixel.sum[0][0] - of(0) * 2.0 / 2.75).abs() < 1e-4);
        assert!((pixel.sum[1][0] - of(1) / 3.0).abs() < 1e-4);
        assert!(!joined.has_just(5) && whole.has_just(0));
    }

    /// What lies outside is nobody's; what is no number is counted.
    #[test]
    fn what_does_not_fit_is_left_out() {
        let splats = Splats::new((8, 8), WINDOW, 0);
        for pixel in [(1, 1), (5, 1), (2, 0), (2, 3), (-1, -1)] {
            splats.add(pixel, 0, [1.0; 3]);
        }
        assert!(splats.sums().all(|sum| sum == 0) && splats.lost() == 0);
        splats.add((2, 1), 0, [f64::NAN, 0.0, 0.0]);
        splats.add((2, 1), 0, [0.0, 1e300, 0.0]);
        assert!(splats.sums().all(|sum| sum == 0) && splats.lost() == 2);
    }
}
