//! How far a film's estimate of its error is to be trusted: the tail of what the estimate is the mean of, and what no
//! sample has met yet. From the halves that a film keeps anyway, when it is asked for.
//!
//! **Index.** relMSE is the mean over pixels of x = v/(R² + ε), v a quarter of the squared difference of the
//! halves, here as in the upper end of its interval, with the surroundings *without* the pixel for R where
//! something was met once: with it, x has a bound (625 of 25 pixels), and a picture of nothing but fireflies
//! would have no tail. The index k of the largest x ([`pareto`]) says whether that mean can be relied on: below ½
//! its spread over pixels is finite and the intervals hold; from min(1 − 1/lg S, 0.7) on, with S pixels, no
//! number of pixels that one can have makes it reliable (Vehtari et al. 2024, JMLR 25:72); with 1 and above there
//! is nothing that it estimates. Halves of pixels that have had many samples of finite variance are normal, x is
//! then as light as χ² (k about 0), so a tail that stays heavy is one of the light itself.
//!
//! **Unseen.** Good 1953 (Biometrika 40) and Turing: what will come from events that were never met is, in expectation,
//! what came from those met once. An event counts as met once where one half of a pixel shows more than thrice the
//! light of the other, with what that half has more. As a share of the picture's light, with an upper bound of 95 % (of
//! one side) for the scatter of single events. Limits: an event met twice in one half counts as well; one that is
//! smaller than twice what the pixel has otherwise does not, and is no risk.

use rayon::prelude::*;

use super::denominator::{Halves, RELMSE_EPSILON, sampled_mean, sum_columns};
use super::moments::{BRIGHT, relative_variance};
use crate::film::store::Film;
use crate::math::pareto;

/// Index from which the spread of the estimate is not finite.
const HEAVY: f64 = 0.5;

/// Index from which no number of pixels is enough.
const HOPELESS: f64 = 0.7;

/// One-sided 95 % point of the normal distribution.
const NORMAL_95_ONE_SIDED: f64 = 1.644854;

/// What the tail says of estimates and predictions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Intervals hold.
    Tame,
    /// Intervals are too narrow now and then, and predictions lower bounds.
    Heavy,
    /// Neither error nor cost is known from this film.
    Untrusted,
}

impl Verdict {
    /// In a word or some.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::Tame => "tame",
            Verdict::Heavy => "heavy",
            Verdict::Untrusted => "not to be trusted",
        }
    }
}

/// The tail of a film's estimate of its error.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Tail {
    /// Its index.
    pub k: f64,
    /// Standard error of the index.
    pub k_stderr: f64,
    /// Index from which the estimate is not to be trusted, for this number of pixels.
    pub k_limit: f64,
    /// Pixels whose contributions were fitted.
    pub pixels: usize,
    /// Share of the picture's light that came from events met once: as much is expected from those not met yet.
    pub unseen: f64,
    /// Its upper bound.
    pub unseen_at_most: f64,
}

impl Tail {
    /// What it says. Tame is a tail whose index is below ½ with 95 %: a small picture that has missed its largest
    /// events has a light one by chance.
    pub fn verdict(&self) -> Verdict {
        match self.k {
            k if k + NORMAL_95_ONE_SIDED * self.k_stderr < HEAVY => Verdict::Tame,
            k if k < self.k_limit => Verdict::Heavy,
            _ => Verdict::Untrusted,
        }
    }

    /// The same in words.
    pub fn words(&self) -> String {
        match self.verdict() {
            Verdict::Tame => Verdict::Tame.name().into(),
            verdict => format!("{}: k={:.1}", verdict.name(), self.k),
        }
    }
}

impl Film {
    /// The tail of the film's estimate of its error, on the current pool of threads. `None` where it has too few pixels
    /// with both halves, or none that differs from the others.
    pub fn tail(&self) -> Option<Tail> {
        let width = (self.window.width as usize).max(1);
        let own: Vec<[f32; 4]> = self.pixels.par_iter().map(sampled_mean).collect();
        let mean = self.mean();
        let epsilon = RELMSE_EPSILON * ((mean[0] + mean[1] + mean[2]) / 3.0).powi(2);
        let rows = self.pixels.par_chunks_exact(width).enumerate().map_init(
            || vec![[0.0; 4]; width],
            |columns, (y, row)| {
                sum_columns(&own, y, columns);
                let mut sums = [0.0; 3];
                let halves = row.iter().enumerate().filter_map(|(x, pixel)| Some((x, Halves::of(pixel)?)));
                let values: Vec<f32> = halves
                    .map(|(x, halves)| {
                        let [all, once] = light(&halves);
                        sums = [sums[0] + all, sums[1] + once, sums[2] + once * once];
                        relative_variance(&halves, columns, x, &own[y * width + x], epsilon).ends[1] as f32
                    })
                    .collect();
                (values, sums)
            },
        );
        let (mut values, mut sums) = (Vec::new(), [0.0; 3]);
        for (row, of_row) in rows.collect::<Vec<_>>() {
            values.extend(row);
            sums = std::array::from_fn(|i| sums[i] + of_row[i]);
        }
        let count = values.len() as f64;
        let tail = pareto::tail(&mut values)?;
        let [all, once, square] = sums;
        let share = |light: f64| if all > 0.0 { (light / all).min(1.0) } else { 0.0 };
        Some(Tail {
            k: tail.k,
            k_stderr: tail.k_stderr,
            k_limit: (1.0 - count.log10().recip()).min(HOPELESS),
            pixels: tail.largest,
            unseen: share(once),
            unseen_at_most: share(once + NORMAL_95_ONE_SIDED * square.sqrt()),
        })
    }
}

/// Light of a pixel over the channels, and how much of it was met in one half alone.
fn light(halves: &Halves) -> [f64; 2] {
    let sum = |half: [f64; 3], share: f64| (half[0] + half[1] + half[2]).max(0.0) * share;
    let [a, b] = [halves.a, halves.b].map(|half| sum(half, 1.0));
    let all = a * halves.shares[0] + b * halves.shares[1];
    let (more, less, share) = if a > b { (a, b, halves.shares[0]) } else { (b, a, halves.shares[1]) };
    [all, if more > BRIGHT * less { share * (more - less) } else { 0.0 }]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::noise::Pcg;
    use crate::plan::options::Crop;

    /// 64×64 pixels of 16 samples of radiance `sample`.
    fn film(mut sample: impl FnMut() -> f32) -> Film {
        let mut film = Film::new((64, 64), Crop { x: 0, y: 0, width: 64, height: 64 });
        for pixel in &mut film.pixels {
            for s in 0..16 {
                pixel.add(s & 1, [sample(); 3], 1.0, 1.0);
            }
        }
        film
    }

    /// Uniform noise is tame, and no light of it was met once. Oracle: halves of eight uniform samples are nearly
    /// normal; 192 pixels are fitted, so k is below ½ by six standard errors.
    #[test]
    fn mild_noise_is_tame() {
        let mut random = Pcg(1);
        let tail = film(|| 0.5 + random.next()).tail().expect("4096 pixels");
        assert_eq!((tail.verdict(), tail.words().as_str(), tail.pixels), (Verdict::Tame, "tame", 192), "{tail:?}");
        assert_eq!((tail.unseen, tail.unseen_at_most), (0.0, 0.0));
    }

    /// Oracle: the definition. Samples 1 + U^(−k)/100 have squares of index 2k, of which the pixels' contributions have
    /// the tail (the largest of 16 samples carries them): 1.6 for k = 0.8 and light without a variance.
    #[test]
    fn light_without_a_variance_is_not_trusted() {
        let mut random = Pcg(2);
        let tail = film(|| 1.0 + 0.01 * (random.next() + 1e-7).powf(-0.8)).tail().expect("4096 pixels");
        assert_eq!(tail.verdict(), Verdict::Untrusted, "{tail:?}");
        assert!((tail.k - 1.6).abs() < 4.9 * tail.k_stderr + 0.1, "{tail:?}");
        assert!(tail.words().starts_with("not to be trusted: k=1."), "{}", tail.words());
    }

    /// Good and Turing on known events: each pixel has one, of radiance 800 and a chance p a sample, on a ground of 1.
    /// In 16 samples it is missed with (1 − p)¹⁶, and then 800·p of the mean is missing. 4096 pixels meet 16·4096·p =
    /// 131 once or more at p = 0.002; the share is known to 1/√131 = 9 %, limit five of that and the 2 % that are met
    /// twice in one half.
    #[test]
    fn the_unseen_is_what_was_met_once() {
        let (p, bright) = (0.002f64, 800.0f64);
        let mut random = Pcg(3);
        let tail = film(|| if f64::from(random.next()) < p { bright as f32 } else { 1.0 }).tail().expect("4096 pixels");
        let missing = bright * p * (1.0 - p).powi(16) / (1.0 + bright * p);
        assert!((tail.unseen / missing - 1.0).abs() < 0.47, "{tail:?} for {missing}");
        assert!(tail.unseen_at_most > tail.unseen && tail.unseen_at_most < 1.3 * tail.unseen, "{tail:?}");
    }

    /// A picture of fireflies alone: one half in 25 has one, of up to 100, over a ground of 0.01, so that few have the
    /// mean of their surroundings, let alone their own. Oracle: nothing in it is known to a factor of two.
    #[test]
    fn pictures_of_nothing_but_fireflies_are_not_tame() {
        for seed in 5..25 {
            let mut random = Pcg(seed);
            let tail =
                film(|| if random.next() < 0.005 { 800.0 * random.next() } else { 0.01 }).tail().expect("pixels");
            assert_ne!(tail.verdict(), Verdict::Tame, "{tail:?}");
        }
    }

    #[test]
    fn films_that_say_nothing_have_no_tail() {
        assert_eq!(film(|| 1.0).tail(), None);
        assert_eq!(Film::new((64, 64), Crop { x: 0, y: 0, width: 64, height: 64 }).tail(), None);
    }
}
