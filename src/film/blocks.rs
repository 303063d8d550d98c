//! The film of a running render, in blocks of samples: sums of f64 depend on the order of additions, and parts of a
//! picture that are rendered apart must add up to its bits.
//!
//! Samples are added in pairs (`pairwise.rs`): a block of 2^k samples, the first of them at a multiple of 2^k, is the
//! sum of its two halves. A pixel of n samples holds the blocks that the binary digits of n name, each in a film of
//! the list, the largest in the first; two of the same size become one at once. So a part that is such a block, from
//! whatever machine, goes into the tree where a render of all samples has it. The picture is the sum of the blocks
//! from the largest to the smallest.
//!
//! Limit: one film for each block, so up to the logarithm of the number of passes; one at powers of two.

use std::borrow::Cow;

use super::layer::beauty::Pixel;
use super::store::{Film, Patch, Plane};

/// The blocks of every pixel; films of one size.
#[derive(Clone, Debug)]
pub(crate) struct Blocks {
    /// Never empty; all have the same pixels and layers.
    films: Vec<Film>,
}

impl Blocks {
    /// The blocks in `films`, of which there is one at least: each pixel's are ordered by size and in the first ones.
    pub fn of(films: Vec<Film>) -> Self {
        debug_assert!(!films.is_empty(), "a film for the first block");
        Blocks { films }
    }

    /// The films, the one with the largest blocks first.
    pub fn films(&self) -> &[Film] {
        &self.films
    }

    /// Films that are held at once in a render to `spp` samples per pixel whose passes end at powers of two up to
    /// `pass`, then at its multiples: those of the blocks, and their sum where there is more than one.
    pub fn most(spp: u64, pass: u64) -> u64 {
        let passes = spp / pass;
        let at_once = u64::from((passes + 1).ilog2()).max(u64::from(spp.count_ones())).max(1);
        at_once + u64::from(at_once > 1)
    }

    /// Samples of a pixel of the full image, which lies inside the window.
    pub fn samples(&self, pixel: (u32, u32)) -> u64 {
        let at = self.films[0].place(pixel);
        self.films.iter().map(|film| film.pixels[at].samples()).sum()
    }

    /// A patch of no pixels with the layers of these films.
    pub fn patch(&self) -> Patch {
        let planes = self.films[0].planes.iter().map(|plane| plane.like(0)).collect();
        Patch { pixels: Vec::new(), planes }
    }

    /// Adds the next block of each of `pixels`, which are those of the full image and lie inside the window.
    pub fn push(&mut self, pixels: &[(u32, u32)], patch: &Patch) {
        // The one block of passes that double the samples; pixels have equally many.
        let [first, next] = [self.samples(pixels[0]), patch.pixels[0].samples()];
        if let [film] = &mut self.films[..]
            && (first == 0 || first == next)
        {
            debug_assert!(film.is_uniform(pixels), "pixels of a tile have equally many samples");
            for (from, (&pixel, next)) in pixels.iter().zip(&patch.pixels).enumerate() {
                film.merge_pixel(film.place(pixel), next, &patch.planes, from);
            }
            return;
        }
        for (from, &pixel) in pixels.iter().enumerate() {
            let at = self.films[0].place(pixel);
            self.push_pixel(at, &patch.pixels[from], &patch.planes, from);
        }
    }

    /// Adds the next block of every pixel of `part`, whose window lies inside this one and whose layers are these.
    pub fn push_film(&mut self, part: &Film) {
        for (from, pixel) in part.pixels.iter().enumerate().filter(|(_, pixel)| pixel.samples() > 0) {
            let at = self.films[0].place(part.pixel_of(from));
            self.push_pixel(at, pixel, &part.planes, from);
        }
    }

    /// Adds pixel `from` of `planes` as the next block of the pixel at `at`.
    fn push_pixel(&mut self, at: usize, pixel: &Pixel, planes: &[Plane], from: usize) {
        let held = |film: &Film| film.pixels[at].samples();
        let depth = self.films.iter().position(|film| held(film) == 0).unwrap_or(self.films.len());
        if depth == 0 || held(&self.films[depth - 1]) != pixel.samples() {
            if depth == self.films.len() {
                self.films.push(self.films[0].blank());
            }
            self.films[depth].merge_pixel(at, pixel, planes, from);
            return;
        }
        self.films[depth - 1].merge_pixel(at, pixel, planes, from);
        for smaller in (1..depth).rev() {
            let (larger, rest) = self.films.split_at_mut(smaller);
            let (larger, smaller) = (&mut larger[smaller - 1], &mut rest[0]);
            if held(larger) != held(smaller) {
                break;
            }
            larger.merge_pixel(at, &smaller.pixels[at], &smaller.planes, at);
            smaller.clear_pixel(at);
        }
    }

    /// The picture.
    pub fn total(&self) -> Cow<'_, Film> {
        match &self.films[..] {
            [film] => Cow::Borrowed(film),
            films => Cow::Owned(total(films)),
        }
    }

    /// The picture, and its blocks where there is more than one.
    pub fn finish(mut self) -> (Film, Vec<Film>) {
        while self.films.len() > 1 && self.films.last().is_some_and(|film| film.spp().max == 0) {
            self.films.pop();
        }
        match self.films.len() {
            1 => (self.films.remove(0), Vec::new()),
            _ => (total(&self.films), self.films),
        }
    }
}

/// The sum of `films`, from the first to the last.
pub(crate) fn total(films: &[Film]) -> Film {
    let (first, rest) = films.split_first().expect("a film at least");
    let mut total = first.clone();
    for film in rest {
        total.merge(film).expect("films of one size and with the same layers");
    }
    total
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::noise::Pcg;
    use crate::film::pairwise;
    use crate::plan::aov::Aov;
    use crate::plan::options::Crop;

    const WINDOW: Crop = Crop { x: 0, y: 0, width: 1, height: 1 };

    /// A film of samples `from..to`, whose order of addition shows, in pairs.
    fn part(from: u64, to: u64) -> Film {
        let mut film = Film::with_layers((1, 1), WINDOW, &[Aov::ALBEDO]);
        let value = |sample: u64| {
            let mut random = Pcg(sample + 9);
            let value = f64::from(random.next()) * 3f64.powi((sample % 37) as i32);
            [value; 4]
        };
        for half in 0..2 {
            let of_half: Vec<u64> = (from..to).filter(|sample| sample & 1 == half).collect();
            film.pixels[0].sum[half as usize] = pairwise::sum(of_half.len(), |i| value(of_half[i]));
            film.pixels[0].n[half as usize] = of_half.len() as u64;
        }
        let sum = pairwise::sum((to - from) as usize, |i| value(from + i as u64));
        film.planes[0].values.copy_from_slice(&sum[..3]);
        film
    }

    fn joined(cuts: &[u64]) -> Film {
        let mut blocks = Blocks::of(vec![part(0, 0)]);
        for ends in cuts.windows(2) {
            blocks.push_film(&part(ends[0], ends[1]));
        }
        blocks.finish().0
    }

    /// Oracle: the block of all samples. Deterministic.
    #[test]
    fn parts_have_the_bits_of_the_whole() {
        let whole = part(0, 64);
        for cuts in [&[0, 64][..], &[0, 32, 64], &[0, 32, 48, 64], &[0, 16, 32, 48, 56, 60, 62, 63, 64]] {
            assert_eq!(joined(cuts), whole, "{cuts:?}");
        }
        assert_eq!(joined(&(0..=64).collect::<Vec<_>>()), whole);
        // Whatever the parts, also where the number of samples is no power of two.
        let (fine, coarse) = (joined(&(0..=112).collect::<Vec<_>>()), joined(&[0, 64, 96, 112]));
        assert_eq!(fine, coarse);
        assert_eq!(fine, joined(&[0, 16, 32, 48, 64, 80, 96, 112]));
        assert_eq!(fine.spp().max, 112);
    }

    /// Oracle: the definition.
    #[test]
    fn films_are_as_many_as_there_are_blocks() {
        let mut most = 0;
        let mut blocks = Blocks::of(vec![part(0, 0)]);
        for pass in 0..16 {
            blocks.push_film(&part(64 * pass, 64 * (pass + 1)));
            let used = blocks.films.iter().filter(|film| film.spp().max > 0).count() as u64;
            assert_eq!(used, u64::from((pass + 1).count_ones()));
            most = most.max(used);
            let spp = 64 * (pass + 1);
            assert_eq!(Blocks::most(spp, 64), most + u64::from(most > 1), "{spp}");
        }
        assert_eq!([Blocks::most(1, 64), Blocks::most(64, 64), Blocks::most(21, 64)], [1, 1, 4]);
        let (film, rest) = blocks.finish();
        assert!(rest.is_empty() && film.spp().max == 1024);
    }
}
