//! The film: one store for the beauty and every other layer, with one merge, one hash and one file (`saved.rs`).
//!
//! The beauty is an array of [`Pixel`]s; another layer that keeps something is a [`Plane`] of f64 values beside it, as
//! many a pixel as the layer says, or of lists of ids. Sums count the same samples as the beauty does, so that a pixel
//! has one count.

use super::channel::{Channel, stored};
use super::cryptomatte;
use super::ids::Ids;
use super::layer::beauty::Pixel;
use super::layer::bounces::PathLengths;
use super::layer::kind::{Layer, Shape, Values};
use super::layer::{self, LAYERS};
use crate::error::{Error, Result};
use crate::math::hash::mix;
use crate::plan::aov::{Aov, Gathers};
use crate::plan::options::Crop;

/// A picture being made: the pixels of the crop window, row-major.
///
/// ```
/// use pathspace::film::Film;
/// use pathspace::render::Crop;
///
/// let mut film = Film::new((4, 3), Crop { x: 0, y: 0, width: 4, height: 3 });
/// // Two samples of one pixel, one in each half: radiance, filter weight, coverage.
/// film.pixels[0].add(0, [1.0, 0.5, 0.0], 1.0, 1.0);
/// film.pixels[0].add(1, [3.0, 0.5, 0.0], 1.0, 1.0);
/// assert_eq!(film.pixel(0, 0).mean(), [2.0, 0.5, 0.0, 1.0]);
/// assert_eq!((film.spp().min, film.spp().max), (0, 2));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    /// Full image: columns, rows.
    pub resolution: (u32, u32),
    /// The window that holds pixels.
    pub window: Crop,
    /// Index of every pixel's first sample.
    pub first_sample: u64,
    /// The beauty: `window.width × window.height` pixels.
    pub pixels: Vec<Pixel>,
    /// What the other layers keep.
    pub(super) planes: Vec<Plane>,
}

/// What one layer keeps: some values for each of a number of pixels, pixel by pixel, or a list of ids for each.
#[derive(Clone, Debug)]
pub struct Plane {
    /// Whose values they are.
    pub layer: &'static Layer,
    /// Names of the light groups, where the values are by these.
    pub(super) groups: Vec<String>,
    /// [`width`](Self::width) values a pixel.
    pub values: Vec<f64>,
    /// A list a pixel where the layer is of ids; else empty.
    pub ids: Vec<Ids>,
}

/// A block of samples of some pixels, on its way into a film.
#[derive(Clone, Debug)]
pub struct Patch {
    /// The beauty.
    pub pixels: Vec<Pixel>,
    /// The other layers, in the order of the film.
    pub planes: Vec<Plane>,
}

/// Samples per pixel over a film.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct SppRange {
    /// Of the pixel with the fewest.
    pub min: u64,
    /// Mean.
    pub mean: f64,
    /// Of the pixel with the most.
    pub max: u64,
}

impl Plane {
    /// A plane of `pixels` pixels without samples; `groups` are the light groups of the film.
    pub(super) fn new(layer: &'static Layer, groups: &[String], pixels: usize) -> Self {
        let groups = if matches!(layer.values, Values::Groups) { groups.to_vec() } else { Vec::new() };
        let lists = if layer.is_of_ids() { pixels } else { 0 };
        let mut plane = Plane { layer, groups, values: Vec::new(), ids: vec![Ids::default(); lists] };
        let one: Vec<f64> = (0..plane.width()).map(|value| layer.initial(value)).collect();
        plane.values = one.repeat(pixels);
        plane
    }

    /// A plane of the same layer.
    pub(super) fn like(&self, pixels: usize) -> Self {
        Plane::new(self.layer, &self.groups, pixels)
    }

    /// Values a pixel.
    pub fn width(&self) -> usize {
        self.layer.width(self.groups.len())
    }

    /// What two planes share whose values may be added.
    fn kind(&self) -> (Aov, &[String]) {
        (self.layer.aov, &self.groups)
    }

    /// The values of pixel `p`.
    pub fn pixel(&self, p: usize) -> &[f64] {
        let width = self.width();
        &self.values[p * width..][..width]
    }

    /// The same, to be changed.
    pub fn pixel_mut(&mut self, p: usize) -> &mut [f64] {
        let width = self.width();
        &mut self.values[p * width..][..width]
    }

    /// Adds what pixel `from` of another plane has to pixel `p`, which has `samples` so far.
    fn merge(&mut self, p: usize, samples: u64, other: &Plane, from: usize) {
        if let Some(ids) = self.ids.get_mut(p) {
            ids.merge(&other.ids[from]);
        }
        let once = matches!(self.layer.values, Values::Once { .. });
        for (value, &other) in self.pixel_mut(p).iter_mut().zip(other.pixel(from)) {
            match once {
                false => *value += other,
                true if samples == 0 => *value = other,
                true => {}
            }
        }
    }
}

impl Patch {
    /// For `pixels` pixels, whose values are yet to be written.
    pub fn resize(&mut self, pixels: usize) {
        self.pixels.resize(pixels, Pixel::default());
        for plane in &mut self.planes {
            plane.values.resize(pixels * plane.width(), 0.0);
            plane.ids.resize(if plane.layer.is_of_ids() { pixels } else { 0 }, Ids::default());
        }
    }

    /// Gives the layers besides the beauty the values that a pixel without samples has.
    pub fn clear_planes(&mut self) {
        for plane in &mut self.planes {
            let (layer, width) = (plane.layer, plane.width());
            plane.ids.iter_mut().for_each(Ids::clear);
            for pixel in plane.values.chunks_exact_mut(width.max(1)) {
                pixel.iter_mut().enumerate().for_each(|(value, kept)| *kept = layer.initial(value));
            }
        }
    }
}

impl PartialEq for Plane {
    fn eq(&self, other: &Self) -> bool {
        self.kind() == other.kind() && self.values == other.values && self.ids == other.ids
    }
}

impl Film {
    /// An empty film that keeps the beauty alone.
    pub fn new(resolution: (u32, u32), window: Crop) -> Self {
        Film::with_layers(resolution, window, &[])
    }

    /// An empty film that keeps the beauty and what `aovs` need.
    pub fn with_layers(resolution: (u32, u32), window: Crop, aovs: &[Aov]) -> Self {
        Film::with_groups(resolution, window, aovs, &[])
    }

    /// The same with light groups of these names, which [`Aov::LIGHT_GROUPS`] is by.
    pub fn with_groups(resolution: (u32, u32), window: Crop, aovs: &[Aov], groups: &[String]) -> Self {
        let pixels = window.width as usize * window.height as usize;
        let kept = LAYERS.iter().copied().filter(|layer| layer.is_kept(groups.len()) && aovs.contains(&layer.aov));
        let planes = kept.map(|layer| Plane::new(layer, groups, pixels)).collect();
        Film { resolution, window, first_sample: 0, pixels: vec![Pixel::default(); pixels], planes }
    }

    /// Pixel at `(x, y)` of the window.
    pub fn pixel(&self, x: u32, y: u32) -> &Pixel {
        &self.pixels[y as usize * self.window.width as usize + x as usize]
    }

    /// What the layers besides the beauty keep, in the order of [`LAYERS`].
    pub fn planes(&self) -> &[Plane] {
        &self.planes
    }

    /// The same, to be changed.
    pub fn planes_mut(&mut self) -> &mut [Plane] {
        &mut self.planes
    }

    /// Whether `pixels` of the full image, which lie inside the window, have equally many samples.
    pub(crate) fn is_uniform(&self, pixels: &[(u32, u32)]) -> bool {
        let mut counts = pixels.iter().map(|&p| self.pixels[self.place(p)].samples());
        let first = counts.next();
        counts.all(|n| Some(n) == first)
    }

    /// Where a pixel of the full image lies in [`pixels`](Self::pixels).
    pub(super) fn place(&self, (x, y): (u32, u32)) -> usize {
        (y - self.window.y) as usize * self.window.width as usize + (x - self.window.x) as usize
    }

    /// The pixel of the full image that lies at `at` in [`pixels`](Self::pixels).
    pub(super) fn pixel_of(&self, at: usize) -> (u32, u32) {
        let (column, row) = (at % self.window.width as usize, at / self.window.width as usize);
        (self.window.x + column as u32, self.window.y + row as u32)
    }

    /// Whether `other` has the same pixels, first sample and layers.
    pub(crate) fn is_like(&self, other: &Film) -> bool {
        let place = |film: &Film| (film.resolution, film.window, film.first_sample);
        place(self) == place(other) && self.is_like_in_layers(other)
    }

    /// Whether `other` has the same layers.
    pub(crate) fn is_like_in_layers(&self, other: &Film) -> bool {
        self.planes.iter().map(Plane::kind).eq(other.planes.iter().map(Plane::kind))
    }

    /// A film of other pixels of the picture, without samples.
    pub(crate) fn resized(&self, window: Crop) -> Film {
        let pixels = window.width as usize * window.height as usize;
        let planes = self.planes.iter().map(|plane| plane.like(pixels)).collect();
        Film { window, pixels: vec![Pixel::default(); pixels], planes, ..*self }
    }

    /// A film like this one without samples.
    pub(super) fn blank(&self) -> Film {
        self.resized(self.window)
    }

    /// Adds a pixel with pixel `from` of `planes` to the pixel at `at`.
    pub(super) fn merge_pixel(&mut self, at: usize, pixel: &Pixel, planes: &[Plane], from: usize) {
        let samples = self.pixels[at].samples();
        for (plane, source) in self.planes.iter_mut().zip(planes) {
            plane.merge(at, samples, source, from);
        }
        self.pixels[at].merge(pixel);
    }

    /// Takes all samples off the pixel at `at`.
    pub(super) fn clear_pixel(&mut self, at: usize) {
        self.pixels[at] = Pixel::default();
        for plane in &mut self.planes {
            let layer = plane.layer;
            if let Some(ids) = plane.ids.get_mut(at) {
                ids.clear();
            }
            plane.pixel_mut(at).iter_mut().enumerate().for_each(|(value, kept)| *kept = layer.initial(value));
        }
    }

    /// Adds the samples of `part`, a film of the same picture whose window lies inside this one's: other samples of
    /// the same pixels, or other pixels. The order of the parts is the order of the sums: keep it fixed where bits
    /// matter. That no sample comes twice is up to the caller.
    ///
    /// # Errors
    /// [`Error::Option`] where resolutions, windows or layers do not fit.
    pub fn merge(&mut self, part: &Film) -> Result<()> {
        let refused = |option, problem: &str| Err(Error::Option { option, problem: problem.into() });
        let (outer, inner) = (self.window, part.window);
        let fits = |start, size, from, all| start >= from && start + size <= from + all;
        if self.resolution != part.resolution {
            return refused("--width", "the part belongs to a picture of another size");
        }
        if !fits(inner.x, inner.width, outer.x, outer.width) || !fits(inner.y, inner.height, outer.y, outer.height) {
            return refused("--crop", "the part does not lie inside the picture's window");
        }
        if !self.is_like_in_layers(part) {
            return refused("--aov", "the part has other layers");
        }
        self.first_sample = self.first_sample.min(part.first_sample);
        for (from, pixel) in part.pixels.iter().enumerate() {
            let at = self.place(part.pixel_of(from));
            self.merge_pixel(at, pixel, &part.planes, from);
        }
        Ok(())
    }

    /// The values of a layer, three a pixel: means, or what was met once. `None` where the film has not kept it, for
    /// `bounces` and `lightgroups`, which have [more](Self::path_lengths), and for lists of [ids](Self::ids).
    pub fn layer(&self, aov: Aov) -> Option<Vec<[f64; 3]>> {
        let layer = layer::find(aov);
        let three = [0, 3].contains(&layer.width(0)) || matches!(layer.values, Values::Halves(3));
        let (kept, pixels) = (three && aov != Aov::LIGHT_GROUPS, 0..self.pixels.len());
        let values = self.values(layer).filter(|_| kept)?;
        Some(pixels.map(|p| std::array::from_fn(|value| values(p, value))).collect())
    }

    /// The means of a layer over one half of the samples alone, three a pixel; `None` where the film has not kept it,
    /// and for layers that are not kept by halves.
    pub fn layer_of_half(&self, aov: Aov, half: usize) -> Option<Vec<[f64; 3]>> {
        let plane = self.planes.iter().find(|plane| plane.layer.aov == aov)?;
        let Values::Halves(3) = plane.layer.values else { return None };
        let mean = |(p, pixel): (usize, &Pixel)| {
            let sums = &plane.pixel(p)[3 * half..];
            std::array::from_fn(|c| sums[c] / pixel.n[half].max(1) as f64)
        };
        Some(self.pixels.iter().enumerate().map(mean).collect())
    }

    /// The ids that a layer has of each pixel. `None` where the film has not kept it, and for layers of values.
    pub fn ids(&self, aov: Aov) -> Option<&[Ids]> {
        let plane = self.planes.iter().find(|plane| plane.layer.aov == aov && plane.layer.is_of_ids())?;
        Some(&plane.ids)
    }

    /// Names of the light groups that the film has kept, `default` first.
    pub fn light_groups(&self) -> &[String] {
        self.planes.iter().find(|plane| plane.layer.aov == Aov::LIGHT_GROUPS).map_or(&[], |plane| &plane.groups)
    }

    /// Mean radiance of the lights of a group, per pixel; `None` where the film has not kept it.
    pub fn light_group(&self, name: &str) -> Option<Vec<[f64; 3]>> {
        let number = self.light_groups().iter().position(|group| group == name)?;
        let values = self.values(layer::find(Aov::LIGHT_GROUPS))?;
        let of = |p| std::array::from_fn(|c| values(p, 3 * number + c));
        Some((0..self.pixels.len()).map(of).collect())
    }

    /// The images by path length, if they were kept.
    pub fn path_lengths(&self) -> Option<PathLengths<'_>> {
        let plane = self.planes.iter().find(|plane| plane.layer.aov == Aov::BOUNCES)?;
        Some(PathLengths { pixels: &self.pixels, sums: &plane.values })
    }

    /// The channels of `aovs`, for paths of at most `max_depth` edges; none for layers that the film has not kept.
    pub fn channels(&self, aovs: &[Aov], max_depth: u32) -> Vec<Channel> {
        self.channels_in(aovs, max_depth, |_| true)
    }

    /// Names of [`channels`](Self::channels), whether they were kept or not.
    pub fn channel_names(&self, aovs: &[Aov], max_depth: u32) -> Vec<String> {
        let shape = Shape { max_depth, groups: self.light_groups() };
        let names = aovs.iter().flat_map(|&aov| (layer::find(aov).channels)(&shape));
        names.map(|(name, _)| name).collect()
    }

    /// The [`channels`](Self::channels) of those names that `wanted` picks.
    pub fn channels_in(&self, aovs: &[Aov], max_depth: u32, wanted: impl Fn(&str) -> bool) -> Vec<Channel> {
        let mut channels = Vec::new();
        let shape = Shape { max_depth, groups: self.light_groups() };
        for layer in aovs.iter().map(|&aov| layer::find(aov)) {
            if let Some(lists) = self.ids(layer.aov) {
                let all: Vec<_> = lists.iter().map(cryptomatte::values).collect();
                let of = |value: usize| all.iter().map(|values| values[value]).collect();
                let named = (layer.channels)(&shape).into_iter().filter(|(name, _)| wanted(name));
                channels.extend(named.map(|(name, value)| Channel { name, is_color: false, values: of(value) }));
                continue;
            }
            let Some(values) = self.values(layer) else { continue };
            for (name, value) in (layer.channels)(&shape).into_iter().filter(|(name, _)| wanted(name)) {
                let values = (0..self.pixels.len()).map(|p| stored(values(p, value))).collect();
                channels.push(Channel { is_color: layer.is_color(&name), name, values });
            }
        }
        channels
    }

    /// What `layer` shows of a pixel, value by value.
    fn values(&self, layer: &'static Layer) -> Option<impl Fn(usize, usize) -> f64> {
        let plane = self.planes.iter().find(|plane| plane.layer.aov == layer.aov);
        if layer.is_of_ids() || plane.is_none() && layer.aov.gathers() != Gathers::Nothing {
            return None;
        }
        let kept = move |p: usize, value: usize| plane.map_or(0.0, |plane| plane.pixel(p)[value]);
        Some(move |p: usize, value: usize| match layer.values {
            Values::Beauty(of_pixel) => of_pixel(&self.pixels[p])[value],
            Values::Mean(_) | Values::Groups => kept(p, value) / self.pixels[p].samples().max(1) as f64,
            Values::Halves(width) => (kept(p, value) + kept(p, width + value)) / self.pixels[p].samples().max(1) as f64,
            Values::Once { .. } | Values::Ids(_) => kept(p, value),
        })
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

    /// Mean of R, G, B and coverage over the pixels that have samples; 0 without any.
    pub fn mean(&self) -> [f64; 4] {
        let (mut sum, mut sampled) = ([0.0; 4], 0usize);
        for pixel in self.pixels.iter().filter(|pixel| pixel.samples() > 0) {
            for (sum, value) in sum.iter_mut().zip(pixel.mean()) {
                *sum += value;
            }
            sampled += 1;
        }
        sum.map(|s| s / sampled.max(1) as f64)
    }

    /// 64-bit fingerprint of size, counts and the bits of the beauty's sums, `film_hash` of the statistics. Equal films
    /// have equal hashes; one changed bit changes it. Not cryptographic. Other layers have no part in it: what is asked
    /// for besides changes no bit of the picture ([`digest`](Self::digest) covers them).
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

    /// [`hash`](Self::hash) of everything the film keeps: all layers by name, and the first sample.
    pub fn digest(&self) -> u64 {
        let mut digest = mix(self.hash(), self.first_sample);
        for plane in &self.planes {
            for text in std::iter::once(plane.layer.aov.name()).chain(plane.groups.iter().map(String::as_str)) {
                digest = text.bytes().fold(digest, |digest, byte| mix(digest, u64::from(byte)));
            }
            digest = plane.values.iter().fold(digest, |digest, value| mix(digest, value.to_bits()));
            for counts in plane.ids.iter().map(Ids::counts) {
                digest = mix(digest, counts.len() as u64);
                let entries = counts.iter().flat_map(|count| [count.id.into(), count.samples as u64]);
                digest = entries.fold(digest, mix);
            }
        }
        digest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A part of 2 × 2 pixels in a film of 5 × 4, with a layer of each kind.
    fn parts() -> (Film, Film) {
        let aovs = [Aov::BOUNCES, Aov::ALBEDO, Aov::DEPTH, Aov::SPP];
        let film = Film::with_layers((16, 9), Crop { x: 4, y: 2, width: 5, height: 4 }, &aovs);
        let mut part = Film::with_layers((16, 9), Crop { x: 7, y: 4, width: 2, height: 2 }, &aovs);
        for (i, pixel) in part.pixels.iter_mut().enumerate() {
            pixel.add(0, [i as f32, 1.0, 1.0], 1.0, 0.5);
            for plane in &mut part.planes {
                plane.pixel_mut(i)[0] = i as f64;
            }
        }
        (film, part)
    }

    #[test]
    fn parts_merge_into_their_place_and_change_the_hash() {
        let (mut film, part) = parts();
        let empty = film.hash();
        film.merge(&part).expect("a part");
        film.merge(&part).expect("a part");
        assert_eq!(film.pixel(4, 3).sum[0], [6.0, 2.0, 2.0, 1.0]);
        assert_eq!(film.pixel(3, 2).n, [2, 0]);
        assert_eq!(film.spp(), SppRange { min: 0, mean: 0.4, max: 2 });
        // Sums add up, what is met once stays; pixels without samples keep what they begin with.
        let last = film.pixels.len() - 1;
        assert_eq!(film.layer(Aov::ALBEDO).expect("kept")[last], [3.0, 0.0, 0.0]);
        assert_eq!(film.layer(Aov::DEPTH).expect("kept")[last][0], 3.0);
        assert_eq!(film.layer(Aov::DEPTH).expect("kept")[0][0], f64::from(f32::MAX));
        assert_eq!(film.path_lengths().expect("kept").image(0)[last], [3.0, 0.0, 0.0]);
        assert_eq!((film.layer(Aov::NORMAL), film.layer(Aov::BOUNCES)), (None, None));
        // One bit of one sum shows in the hash, and so does the place of the window.
        let hash = film.hash();
        assert_ne!(hash, empty);
        let mut other = film.clone();
        other.pixels[13].sum[0][2] = f64::from_bits(other.pixels[13].sum[0][2].to_bits() ^ 1);
        assert_ne!(other.hash(), hash);
        other = film.clone();
        other.window.x = 5;
        assert_ne!(other.hash(), hash);
        // The digest covers every layer, the hash the beauty alone.
        let mut other = film.clone();
        other.planes[1].values[7] = 1.0;
        assert_eq!(other.hash(), hash);
        assert_ne!(other.digest(), film.digest());
        // The mean is that of the pixels that have samples.
        assert_eq!(film.mean(), [1.5, 1.0, 1.0, 0.5]);
    }

    #[test]
    fn parts_that_do_not_fit_are_refused() {
        let (mut film, part) = parts();
        let with = |change: &dyn Fn(&mut Film)| {
            let mut part = part.clone();
            change(&mut part);
            part
        };
        assert!(film.merge(&with(&|part| part.resolution.0 = 17)).is_err());
        assert!(film.merge(&with(&|part| part.window.x = 8)).is_err());
        assert!(film.merge(&with(&|part| drop(part.planes.pop()))).is_err());
        assert_eq!(film.spp().max, 0);
    }
}
