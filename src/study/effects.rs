//! What an effect costs and what its absence would: numbers with intervals from pairs of runs, one with it and one
//! without it, of equal seeds and samples.
//!
//! *Share of the time*: 1 − (t·relMSE without)/(t·relMSE with), t the processor time of the run and relMSE the film's
//! own estimate: processor time to equal error, each picture measured against itself. Ratios of pairs, geometric mean.
//! Below 0 the picture is dearer without the effect. Rays are counted, so that machines compare.
//!
//! *Error*: relMSE of the expected picture without it against the one with it, by products of different pairs
//! ([`bias_squared`](runs::bias_squared)), so that noise is no part of it: an effect that does nothing has exactly 0.
//! *FLIP* (of the displayed picture) is no square: of the means of half the pairs, the picture without the effect is
//! held against that with it of the *other* half, and so is the picture with it; the difference of the two is 0 in
//! expectation where the effect does nothing. Its interval is that of a jackknife over pairs of pairs. Limit: noise
//! hides small differences from FLIP, so it comes out low at few samples.
//!
//! *Where*: the sixteenth of the picture with the largest share of that error, by the same products pixel by pixel.

use serde::Serialize;

use super::clock::Cost;
use super::reference::Reference;
use super::runs::{self, Interval};
use crate::accuracy::flip;
use crate::scene::LeftOut;

/// Fewest pairs from which anything is said.
pub const LEAST_PAIRS: usize = 4;

/// Relative RMSE at which seconds are quoted.
const QUOTED_ERROR: f64 = 0.01;

/// One run.
#[derive(Clone, Debug)]
pub struct Side {
    /// What it took.
    pub cost: Cost,
    /// relMSE as its film estimates it; `None` where it cannot.
    pub relmse: Option<f64>,
    /// Rays of all classes over camera samples.
    pub rays_per_path: f64,
    /// R, G, B of each pixel.
    pub picture: Vec<f32>,
}

/// What a row is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Kind {
    /// Something of the scene or the camera.
    Effect,
    /// A way of finding light: the picture is right without it.
    Technique,
    /// The lamps of a group, or of a name.
    Lamps,
    /// Paths beyond a length.
    Length,
    /// An option that takes the place of the present one.
    Choice,
}

impl Kind {
    /// By its name in the table.
    pub fn of(name: &str) -> Self {
        match name.split_once(':') {
            Some((LeftOut::TECHNIQUE, _)) => Kind::Technique,
            Some(("light-group" | "lamp", _)) => Kind::Lamps,
            Some(("depth", _)) => Kind::Length,
            _ if name.starts_with("--") => Kind::Choice,
            _ => Kind::Effect,
        }
    }
}

/// A part of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Place {
    /// Left column, top row, columns and rows, pixels of the picture that is studied.
    pub crop: [usize; 4],
    /// Share of the squared error that lies there.
    pub share: f64,
}

/// An effect of the scene. Keys are a contract: add, never rename.
#[derive(Clone, Debug, Serialize)]
pub struct EffectRow {
    /// What it is.
    pub kind: Kind,
    /// Its name, as `--without` takes it.
    pub name: String,
    /// With what calls for it.
    pub found: String,
    /// Why nothing was measured; `null` where something was.
    pub not_measured: Option<String>,
    /// Samples per pixel of each run.
    pub spp: u64,
    /// Pairs of runs.
    pub pairs: usize,
    /// Share of the processor time to equal error that it takes.
    pub time_share: Option<Interval>,
    /// Processor time without it over that with it, at equal samples.
    pub time_ratio: Option<Interval>,
    /// Rays of a path with it and without it.
    pub rays_per_path: [f64; 2],
    /// Processor seconds that leaving it out saves on the way to a relative RMSE of 1 % (by a slope of 1).
    pub seconds_saved: Option<f64>,
    /// Relative RMSE of the picture without it.
    pub error: Option<Interval>,
    /// Its square, which may come out negative where there is none.
    pub error_squared: Option<Interval>,
    /// Where most of the error lies; `null` where none was seen.
    pub place: Option<Place>,
    /// HDR-FLIP of the picture without it, beyond that of noise.
    pub flip: Option<Interval>,
    /// Mean of the picture without it minus that with it, over the latter.
    pub mean_change: Option<Interval>,
    /// `error` over `seconds_saved`; `null` where nothing is saved.
    pub error_per_second: Option<f64>,
}

/// The picture with an effect and without it.
#[derive(Clone, Debug)]
pub struct Shown {
    /// Name of the effect.
    pub name: String,
    /// Its relative RMSE, by which the largest are shown.
    pub error: f64,
    /// R, G, B of each pixel, with it and without it.
    pub pictures: [Vec<f32>; 2],
}

impl EffectRow {
    /// One of which nothing is known, and why.
    pub fn unmeasured(effect: &LeftOut, why: String) -> Self {
        EffectRow {
            kind: Kind::of(&effect.name),
            name: effect.name.clone(),
            found: effect.found.clone(),
            not_measured: Some(why),
            spp: 0,
            pairs: 0,
            time_share: None,
            time_ratio: None,
            rays_per_path: [0.0; 2],
            seconds_saved: None,
            error: None,
            error_squared: None,
            place: None,
            flip: None,
            mean_change: None,
            error_per_second: None,
        }
    }

    /// From pairs of runs, with the effect and without it, of `spp` samples per pixel and `width` columns.
    pub fn of(effect: &LeftOut, spp: u64, width: usize, pairs: &[[Side; 2]]) -> (Self, Shown) {
        let ratios = |f: &dyn Fn(&Side) -> Option<f64>| -> Option<Interval> {
            let ratios: Option<Vec<f64>> = pairs.iter().map(|[with, without]| Some(f(without)? / f(with)?)).collect();
            runs::geometric_mean(&ratios?)
        };
        let time = |side: &Side| Some(side.cost.cpu_s * side.relmse?);
        let time_share = ratios(&time).map(|r| Interval { value: 1.0 - r.value, low: 1.0 - r.high, high: 1.0 - r.low });
        let n = pairs.len() as f64;
        let with: Option<f64> = pairs.iter().map(|[with, _]| time(with)).sum();
        let seconds_with = with.map(|sum| sum / n / (QUOTED_ERROR * QUOTED_ERROR));
        let seconds_saved = seconds_with.zip(time_share).map(|(seconds, share)| seconds * share.value);

        let pictures: [Vec<Vec<f32>>; 2] =
            [0, 1].map(|side| pairs.iter().map(|pair| pair[side].picture.clone()).collect());
        let reference = Reference::of_runs(&pictures[0]);
        let differences: Vec<Vec<f32>> =
            pairs.iter().map(|[x, y]| y.picture.iter().zip(&x.picture).map(|(y, x)| y - x).collect()).collect();
        let error_squared = runs::bias_squared(&differences, &reference.weights);
        let error = error_squared.map(|squared| squared.map(|e| e.max(0.0).sqrt()));
        let change = |d: &Vec<f32>| d.iter().map(|v| f64::from(*v)).sum::<f64>() / d.len() as f64 / reference.mean;
        let changes: Vec<f64> = differences.iter().map(change).collect();
        let saves = seconds_saved.filter(|saved| *saved > 0.0);
        let row = EffectRow {
            not_measured: None,
            spp,
            pairs: pairs.len(),
            time_share,
            time_ratio: ratios(&|side| Some(side.cost.cpu_s)),
            rays_per_path: [0, 1].map(|side| pairs.iter().map(|pair| pair[side].rays_per_path).sum::<f64>() / n),
            seconds_saved,
            error,
            error_squared,
            place: error_squared.filter(|e| e.low > 0.0).and_then(|_| place(&differences, &reference.weights, width)),
            flip: excess_flip(&pictures, width),
            mean_change: (reference.mean != 0.0).then(|| runs::mean(&changes)).flatten(),
            error_per_second: error.zip(saves).map(|(error, saved)| error.value / saved),
            ..EffectRow::unmeasured(effect, String::new())
        };
        let all: Vec<usize> = (0..pairs.len()).collect();
        let shown = Shown {
            name: effect.name.clone(),
            error: error.map_or(0.0, |error| error.value),
            pictures: [0, 1].map(|side| flat(&mean_of(&pictures[side], &all))),
        };
        (row, shown)
    }
}

/// Cheapest to leave out first: by error for a second saved; then what saves nothing, then what was not measured.
pub fn sort(rows: &mut [EffectRow]) {
    let key = |row: &EffectRow| {
        let group = if row.not_measured.is_some() { 2 } else { u8::from(row.error_per_second.is_none()) };
        (group, row.error_per_second.unwrap_or(0.0), -row.seconds_saved.unwrap_or(0.0))
    };
    rows.sort_by(|a, b| {
        let (a, b) = (key(a), key(b));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.total_cmp(&b.2))
    });
}

/// Parts of the picture, along a side, of which the one with the largest error is told.
const PARTS: usize = 4;

/// The part with the largest error. `None` where the error of the whole is not above 0.
fn place(differences: &[Vec<f32>], weights: &[f64], width: usize) -> Option<Place> {
    let height = weights.len() / 3 / width;
    let ends = |side: usize| -> Vec<usize> { (0..=PARTS).map(|part| part * side / PARTS).collect() };
    let (columns, rows) = (ends(width), ends(height));
    let square = |value: usize| {
        let (sum, squares) =
            differences.iter().map(|d| f64::from(d[value])).fold((0.0, 0.0), |(s, q), d| (s + d, q + d * d));
        weights[value] * (sum * sum - squares)
    };
    let of_rows = |y: &[usize]| -> Vec<([usize; 4], f64)> {
        let of = |x: &[usize]| {
            let values = (y[0]..y[1]).flat_map(|row| 3 * (row * width + x[0])..3 * (row * width + x[1]));
            ([x[0], y[0], x[1] - x[0], y[1] - y[0]], values.map(square).sum::<f64>())
        };
        columns.windows(2).map(of).collect()
    };
    let parts: Vec<_> = rows.windows(2).flat_map(of_rows).collect();
    let whole: f64 = parts.iter().map(|part| part.1).sum();
    let (crop, most) = parts.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    (whole > 0.0).then(|| Place { crop, share: most / whole })
}

/// FLIP beyond that of noise, see the page. `None` below [`LEAST_PAIRS`].
fn excess_flip([with, without]: &[Vec<Vec<f32>>; 2], width: usize) -> Option<Interval> {
    let couples = with.len() / 2;
    if with.len() < LEAST_PAIRS {
        return None;
    }
    let excess = |left_out: Option<usize>| {
        let half = |odd: usize| -> Vec<usize> {
            (0..couples).filter(|couple| Some(*couple) != left_out).map(|couple| 2 * couple + odd).collect()
        };
        let [a, b] = [half(0), half(1)];
        let one = |own: &[usize], other: &[usize]| {
            let truth = mean_of(with, other);
            let against = |pictures: &[Vec<f32>]| flip::hdr_flip(&mean_of(pictures, own), &truth, width);
            against(without) - against(with)
        };
        0.5 * (one(&a, &b) + one(&b, &a))
    };
    let value = excess(None);
    let parts: Vec<f64> = (0..couples).map(|couple| excess(Some(couple))).collect();
    let n = couples as f64;
    let centre = parts.iter().sum::<f64>() / n;
    let variance = (n - 1.0) / n * parts.iter().map(|part| (part - centre).powi(2)).sum::<f64>();
    Some(Interval::around(value, runs::t95(couples - 1) * variance.sqrt()))
}

/// Mean of the pictures of these indices.
fn mean_of(pictures: &[Vec<f32>], which: &[usize]) -> Vec<[f32; 3]> {
    let share = 1.0 / which.len() as f64;
    let value = |i: usize| (which.iter().map(|&k| f64::from(pictures[k][i])).sum::<f64>() * share) as f32;
    (0..pictures[0].len() / 3).map(|p| [value(3 * p), value(3 * p + 1), value(3 * p + 2)]).collect()
}

fn flat(pixels: &[[f32; 3]]) -> Vec<f32> {
    pixels.iter().flatten().copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The upper bits of Knuth's linear generator: uniform in [0, 1).
    struct Noise(u64);

    impl Noise {
        fn next(&mut self) -> f32 {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (self.0 >> 40) as f32 / (1u64 << 24) as f32
        }
    }

    fn effect(name: &str) -> LeftOut {
        LeftOut { name: name.into(), found: format!("{name} (test)") }
    }

    /// A run of a grey picture of mean `level` under uniform noise of width `noise`.
    fn side(random: &mut Noise, level: f32, noise: f32, (cpu_s, relmse): (f64, f64)) -> Side {
        let picture = (0..3 * 24 * 24).map(|_| level + noise * (random.next() - 0.5)).collect();
        Side { cost: Cost { wall_s: cpu_s, cpu_s }, relmse: Some(relmse), rays_per_path: 2.0, picture }
    }

    /// Oracle: pictures and costs of known ratio. Without the effect 0.9 of the light in half the time at equal relMSE:
    /// share ½, error 0.1/√1.01, mean −0.1. The noise (0.2/√12 = 6 % a value, 1728 values, 8 pairs) leaves an error of
    /// the mean of 0.0005 and of the root mean square of less; limits ten of those.
    #[test]
    fn known_effects_have_their_size() {
        let mut random = Noise(5);
        let mut pair = || [(1.0, 1.0), (0.9, 0.5)].map(|(level, t)| side(&mut random, level, 0.2, (t, 0.01)));
        let pairs: Vec<_> = (0..8).map(|_| pair()).collect();
        let (row, shown) = EffectRow::of(&effect("known"), 16, 24, &pairs);
        let error = row.error.expect("eight pairs");
        assert!((error.value - 0.1 / 1.01f64.sqrt()).abs() < 0.005 && error.low < error.value, "{row:?}");
        assert_eq!(row.time_share.map(|share| share.value), Some(0.5));
        assert!((row.mean_change.expect("pairs").value + 0.1).abs() < 0.005, "{row:?}");
        // To 1 %: 100 s with the effect, half of that without it.
        assert!((row.seconds_saved.expect("costs") - 50.0).abs() < 1e-9, "{row:?}");
        assert!((row.error_per_second.expect("saves") * 50.0 / error.value - 1.0).abs() < 1e-9);
        assert!(row.flip.expect("pairs").low > 0.0, "{row:?}");
        // The error is the same everywhere: no sixteenth has much more than that.
        let place = row.place.expect("an error was seen");
        assert!((1.0 / 16.0..0.1).contains(&place.share) && place.crop[2..] == [6, 6], "{place:?}");
        assert_eq!(shown.pictures.map(|p| p.len()), [1728; 2]);
    }

    /// An effect that does nothing: with the same random numbers exactly 0, with others 0 within the interval, in 19 of
    /// 20 at least as often as a binomial of 85 % fails with 10⁻⁴ (jackknives of four are a little narrow).
    #[test]
    fn nothing_is_found_where_nothing_is() {
        let mut random = Noise(6);
        let same: Vec<_> = (0..4).map(|_| side(&mut random, 1.0, 0.2, (1.0, 0.01))).collect();
        let same: Vec<_> = same.into_iter().map(|run| [run.clone(), run]).collect();
        let (row, _) = EffectRow::of(&effect("same"), 16, 24, &same);
        for found in [row.error, row.error_squared, row.flip, row.mean_change, row.time_share] {
            assert_eq!(found.map(|i| [i.low, i.value, i.high].map(f64::abs)), Some([0.0; 3]), "{row:?}");
        }
        let mut held = [0; 2];
        for _ in 0..40 {
            let mut pair = || [(); 2].map(|()| side(&mut random, 1.0, 0.2, (1.0, 0.01)));
            let pairs: Vec<_> = (0..8).map(|_| pair()).collect();
            let (row, _) = EffectRow::of(&effect("noise"), 16, 24, &pairs);
            held[0] += u32::from(row.error_squared.expect("pairs").contains(0.0));
            held[1] += u32::from(row.flip.expect("pairs").contains(0.0));
        }
        assert!(held.iter().all(|held| *held >= 25), "{held:?} of 40");
    }

    #[test]
    fn the_cheapest_to_leave_out_is_first() {
        let row = |name: &str, error_per_second, saved, not_measured: Option<&str>| EffectRow {
            error_per_second,
            seconds_saved: saved,
            not_measured: not_measured.map(String::from),
            ..EffectRow::unmeasured(&effect(name), String::new())
        };
        let mut rows = [
            row("late", None, None, Some("no time")),
            row("dear", Some(2.0), Some(1.0), None),
            row("useless", None, Some(-1.0), None),
            row("free", Some(0.0), Some(1.0), None),
            row("freer", Some(0.0), Some(2.0), None),
        ];
        sort(&mut rows);
        let names: Vec<&str> = rows.iter().map(|row| row.name.as_str()).collect();
        assert_eq!(names, ["freer", "free", "dear", "useless", "late"]);
    }
}
