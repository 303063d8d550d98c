//! Where the noise of a picture comes from: its variance by class of path and by number of edges.
//!
//! Single camera samples are replayed, which costs renders nothing: of pixels spread over the picture the very samples
//! that pictures of [`SPP`] samples per pixel under [`SEEDS`] seeds have, so that stratification has its part. A
//! pixel's value is a sum over classes, X = Σ Xₖ, and its variance over seeds the sum of Cov(Xₖ, X): a class's share of
//! the noise is Σ w·Cov(Xₖ, X)/Σ w·Var(X), with the weights w = 1/(R² + ε) of relMSE. Shares add up to 1; one may be
//! negative where classes make up for each other. "Alone" is Var(Xₖ) in place of the covariance.
//!
//! Intervals are of 95 % over pixels (normal; a share as a ratio of sums). Limits: where few paths carry a class they
//! are too narrow, which `worst` shows, the part of Σ w·x² over single paths in the worst 0.1 % of all; and what the
//! pixels that are looked at miss, they cannot tell: `relmse_of_all` can.

use rayon::prelude::*;
use serde::Serialize;

use super::class::{self, Class};
use super::reference::Reference;
use super::renderers::{Halt, Renderers};
use super::runs::{Interval, t95};
use super::tails::{self, Tail};
use crate::error::{Error, Result};
use crate::film::Film;
use crate::film::layer::bounces::LENGTHS;
use crate::machine;
use crate::render::{DEFAULT_SPP, LightPaths, RenderOptions, Renderer};
use crate::sampler;

/// Samples per pixel of the pictures whose noise is looked at: those of a render that says nothing else.
pub const SPP: u64 = DEFAULT_SPP;

/// Pictures with seeds of their own.
pub const SEEDS: u64 = 4;

/// Share of the paths, or of the pixels, that count as the worst.
const WORST: f64 = 1e-3;

/// Pixels between two looks at signals.
const CHUNK: usize = 64;

/// Classes, then numbers of edges from 1 on, the last of which holds all longer paths, then everything.
const KEYS: usize = Class::ALL.len() + LENGTHS;
const EVERYTHING: usize = KEYS - 1;

/// What the classes of paths have to do with the noise. Keys are a contract, as those of the report.
#[derive(Clone, Debug, Serialize)]
pub struct Classes {
    /// Paths looked at.
    pub paths: u64,
    /// Pixels that they belong to.
    pub pixels: usize,
    /// Pictures.
    pub seeds: u64,
    /// Samples per pixel of each.
    pub spp: u64,
    /// relMSE of a picture, by those pixels.
    pub relmse: Interval,
    /// relMSE of a picture, by all pixels.
    pub relmse_of_all: f64,
    /// Share of it in the worst 0.1 % of a picture's pixels, mean over the pictures.
    pub worst_pixels: f64,
    /// Share of the squares in the worst 0.1 % of the paths.
    pub worst_paths: f64,
    /// Largest difference of a pixel's sum over classes and the picture's pixel, relative to the mean of both and of
    /// the picture: rounding.
    pub rounding: f64,
    /// By class.
    pub classes: Vec<Part>,
    /// By number of edges: 1, 2, …; the last is all longer paths.
    pub edges: Vec<Part>,
}

/// Some of the paths.
#[derive(Clone, Debug, Serialize)]
pub struct Part {
    /// Which.
    pub name: String,
    /// In words, or as an expression.
    pub what: String,
    /// Share of the picture's mean.
    pub mean: f64,
    /// Share of its relMSE.
    pub noise: Interval,
    /// relMSE of their own picture over that of the whole.
    pub alone: f64,
    /// Share of their squares in the worst 0.1 % of all paths.
    pub worst: f64,
    /// Share of the camera samples to which they add something.
    pub paths: f64,
}

/// What the samples of one pixel under one seed gave.
struct Gathered {
    /// The pixel's value by key.
    values: [[f64; 3]; KEYS],
    /// Σ w·x² of each path that adds to a key.
    squares: Vec<(usize, f32)>,
}

/// First seed of the pictures: 2³⁴ above those of the runs.
fn first_seed(base: u64) -> u64 {
    base.wrapping_add(1 << 34)
}

/// Looks at about `paths` paths of pictures under `base`.
pub(super) fn measure(
    renderers: &mut Renderers,
    base: &RenderOptions,
    reference: &Reference,
    paths: u64,
) -> Result<Classes, Halt> {
    // Classes are those of camera paths: what light paths add belongs to no sample.
    let base = &base.clone().light_paths(LightPaths::Off);
    let first = renderers.renderer(base)?;
    let (window, threads) = (first.plan().window, first.plan().threads);
    let (width, all) = (window.width as usize, window.width as usize * window.height as usize);
    let places = places(all, paths.div_ceil(SEEDS * SPP) as usize, base.seed);
    let pool =
        machine::pool(threads, "classes").map_err(|e| Error::Option { option: "--threads", problem: e.to_string() })?;

    let (mut by_seed, mut films) = (Vec::new(), Vec::new());
    let mut tails: Vec<Tail> = (0..KEYS).map(|_| Tail::default()).collect();
    for picture in 0..SEEDS {
        let what = format!("classes of paths: picture {} of {SEEDS}, {} pixels", picture + 1, places.len());
        let (render, _) = renderers.render(base, first_seed(base.seed).wrapping_add(picture), SPP, &what)?;
        let mut pixels: Vec<[[f64; 3]; KEYS]> = Vec::with_capacity(places.len());
        for chunk in places.chunks(CHUNK) {
            let renderer = renderers.renderer(base)?;
            let gather = |&place: &usize| {
                let pixel = (window.x + (place % width) as u32, window.y + (place / width) as u32);
                gather(renderer, pixel, &reference.weights[3 * place..][..3])
            };
            for gathered in pool.install(|| chunk.par_iter().map(gather).collect::<Result<Vec<_>>>())? {
                gathered.squares.iter().for_each(|&(key, square)| tails[key].add(square));
                pixels.push(gathered.values);
            }
            if renderers.look(&what).is_break() {
                return Err(Halt::Interrupted);
            }
        }
        by_seed.push(pixels);
        films.push(render.film);
    }
    Ok(Sums { reference, places: &places, by_seed: &by_seed, films: &films, tails: &tails }.classes())
}

/// `wanted` of `all` pixels, by number: one at random out of each of as many equal stretches.
fn places(all: usize, wanted: usize, seed: u64) -> Vec<usize> {
    let count = wanted.clamp(1, all);
    let place = |k: usize| {
        let (begin, end) = (k * all / count, (k + 1) * all / count);
        let [low, _] = sampler::pixel_seed(first_seed(seed), k as u64, 0, 0);
        begin + (low as usize) % (end - begin)
    };
    (0..count).map(place).collect()
}

/// Replays the samples of a pixel; `weights` are those of its channels in relMSE.
fn gather(renderer: &Renderer, pixel: (u32, u32), weights: &[f64]) -> Result<Gathered> {
    let mut gathered = Gathered { values: [[0.0; 3]; KEYS], squares: Vec::new() };
    let first = renderer.plan().sample_start;
    for sample in first..first + SPP {
        let replay = renderer.replay(pixel, sample)?;
        // The film counts a sample that is not finite as 0.
        if replay.nonfinite_bounce.is_some() {
            continue;
        }
        let weight = f64::from(replay.filter_weight.0);
        let mut of_sample = [[0.0; 3]; KEYS];
        class::contributions(&replay, |contribution| {
            let edges = Class::ALL.len() + (contribution.edges as usize).min(LENGTHS - 1) - 1;
            for key in [contribution.class as usize, edges, EVERYTHING] {
                for (sum, value) in of_sample[key].iter_mut().zip(contribution.radiance) {
                    *sum += weight * f64::from(value);
                }
            }
        });
        for (key, value) in of_sample.iter().enumerate().filter(|(_, value)| **value != [0.0; 3]) {
            (0..3).for_each(|c| gathered.values[key][c] += value[c] / SPP as f64);
            let square: f64 = (0..3).map(|c| weights[c] * value[c] * value[c]).sum();
            gathered.squares.push((key, square as f32));
        }
    }
    Ok(gathered)
}

/// Everything that was added up.
struct Sums<'s> {
    reference: &'s Reference,
    places: &'s [usize],
    by_seed: &'s [Vec<[[f64; 3]; KEYS]>],
    films: &'s [Film],
    tails: &'s [Tail],
}

impl Sums<'_> {
    fn classes(&self) -> Classes {
        let (pixels, all) = (self.places.len(), self.films[0].pixels.len());
        let paths = pixels as u64 * SEEDS * SPP;
        let total = self.products(|_| EVERYTHING);
        let sum: f64 = total.iter().sum();
        // Weights are those of a mean over all pixels.
        let scale = all as f64;
        let mean_of = |key: usize| {
            let values = self.by_seed.iter().flatten().map(|keys| keys[key].iter().sum::<f64>());
            values.sum::<f64>()
        };
        let mean = mean_of(EVERYTHING);
        let worst = (WORST * paths as f64).ceil() as u64;
        let part = |key: usize, (name, what): (String, String)| {
            let shared = self.products(|end| if end == 0 { key } else { EVERYTHING });
            let own: f64 = self.products(|_| key).iter().sum();
            Part {
                name,
                what,
                mean: tails::share(mean_of(key), mean),
                noise: ratio(&shared, &total),
                alone: tails::share(own, sum),
                worst: self.tails[key].share_of_worst(worst),
                paths: self.tails[key].count() as f64 / paths as f64,
            }
        };
        let by_class = Class::ALL.into_iter().map(|class| {
            let (name, what) = class.told();
            part(class as usize, (name.into(), what.into()))
        });
        let by_edges = (1..LENGTHS).map(|edges| {
            let longer = if edges == LENGTHS - 1 { "+" } else { "" };
            let what = format!("{edges} edges{}", if longer.is_empty() { "" } else { " or more" });
            part(Class::ALL.len() + edges - 1, (format!("{edges}{longer}"), what))
        });
        let (relmse_of_all, worst_pixels) = self.of_pictures();
        Classes {
            paths,
            pixels,
            seeds: SEEDS,
            spp: SPP,
            relmse: mean_over_pixels(&total).map(|v| v * scale),
            relmse_of_all,
            worst_pixels,
            worst_paths: self.tails[EVERYTHING].share_of_worst(worst),
            rounding: self.rounding(),
            classes: by_class.collect(),
            edges: by_edges.collect(),
        }
    }

    /// Σ w·Cov of the values under two keys over the seeds, a number for each pixel.
    fn products(&self, key: impl Fn(usize) -> usize) -> Vec<f64> {
        let keys = [key(0), key(1)];
        let n = self.by_seed.len() as f64;
        let of_channel = |number: usize, c: usize| {
            let [a, b] = keys.map(|key| self.by_seed.iter().map(move |pixels| pixels[number][key][c]));
            let [mean_a, mean_b] = [a.clone().sum::<f64>() / n, b.clone().sum::<f64>() / n];
            a.zip(b).map(|(a, b)| (a - mean_a) * (b - mean_b)).sum::<f64>() / (n - 1.0)
        };
        let of_pixel = |(number, &place): (usize, &usize)| {
            (0..3).map(|c| self.reference.weights[3 * place + c] * of_channel(number, c)).sum()
        };
        self.places.iter().enumerate().map(of_pixel).collect()
    }

    /// relMSE of the pictures by all pixels, and the share of the worst of them.
    fn of_pictures(&self) -> (f64, f64) {
        let n = self.films.len() as f64;
        let values: Vec<Vec<[f64; 4]>> =
            self.films.iter().map(|film| film.pixels.iter().map(|pixel| pixel.mean()).collect()).collect();
        let square = |picture: &[[f64; 4]], p: usize| -> f64 {
            let channel = |c: usize| {
                let mean = values.iter().map(|picture| picture[p][c]).sum::<f64>() / n;
                self.reference.weights[3 * p + c] * (picture[p][c] - mean).powi(2) * n / (n - 1.0)
            };
            (0..3).map(channel).sum()
        };
        let of_picture = |picture: &Vec<[f64; 4]>| {
            let mut squares: Vec<f64> = (0..picture.len()).map(|p| square(picture, p)).collect();
            squares.sort_unstable_by(|a, b| b.total_cmp(a));
            let worst = (WORST * squares.len() as f64).ceil() as usize;
            let sum: f64 = squares.iter().sum();
            (sum, tails::share(squares[..worst].iter().sum(), sum))
        };
        let (sums, shares): (Vec<f64>, Vec<f64>) = values.iter().map(of_picture).unzip();
        (sums.iter().sum::<f64>() / n, shares.iter().sum::<f64>() / n)
    }

    /// See [`Classes::rounding`].
    fn rounding(&self) -> f64 {
        let of_film = |(pixels, film): (&Vec<[[f64; 3]; KEYS]>, &Film)| {
            let mean = film.mean();
            let off = |(keys, &place): (&[[f64; 3]; KEYS], &usize)| {
                let pixel = film.pixels[place].mean();
                let of_channel = |c: usize| {
                    let sum: f64 = keys[..Class::ALL.len()].iter().map(|value| value[c]).sum();
                    tails::share((sum - pixel[c]).abs(), 0.5 * (sum.abs() + pixel[c].abs()) + mean[c].abs())
                };
                (0..3).map(of_channel).fold(0.0, f64::max)
            };
            pixels.iter().zip(self.places).map(off).fold(0.0, f64::max)
        };
        self.by_seed.iter().zip(self.films).map(of_film).fold(0.0, f64::max)
    }
}

/// Mean of independent numbers.
fn mean_over_pixels(values: &[f64]) -> Interval {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    if values.len() < 2 {
        return Interval::around(mean, f64::INFINITY);
    }
    let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    Interval::around(mean, t95(values.len() - 1) * (squares / (n * (n - 1.0))).sqrt())
}

/// Σ part/Σ whole, with the interval of a ratio of sums over independent pixels.
fn ratio(part: &[f64], whole: &[f64]) -> Interval {
    let sum: f64 = whole.iter().sum();
    if !(sum > 0.0) {
        return Interval::around(0.0, 0.0);
    }
    let share = part.iter().sum::<f64>() / sum;
    if whole.len() < 2 {
        return Interval::around(share, f64::INFINITY);
    }
    let n = whole.len() as f64;
    let squares: f64 = part.iter().zip(whole).map(|(part, whole)| (part - share * whole).powi(2)).sum();
    Interval::around(share, t95(whole.len() - 1) * (n / (n - 1.0) * squares).sqrt() / sum)
}
