//! What the next digit costs: from the points of a pilot (samples, seconds, estimated relMSE) to the samples and the
//! time that a smaller error takes.
//!
//! Model: T(N) = T_fixed + c·N and relMSE(N) = A·N^−s, N in samples per pixel (HARDCASES §6.4). The slope s is 1
//! for independent samples; for Sobol' points it depends on the scene and is fitted, held near what was measured
//! ([`SlopePrior`]) because a pilot alone says little of it.
//!
//! The points come from one run, the later ones contain the samples of the earlier ones. Of M ≤ N samples the
//! estimates of the two errors, squares of differences of halves, correlate by M/N, and so do their logarithms: in ln N
//! that is a process without memory (Ornstein-Uhlenbeck), so the generalised least squares need no matrix: each point
//! is whitened by its predecessor alone.
//!
//! A pilot whose tail is not tame (`film::estimate`) has not met what will decide, or has met too much of it: of its
//! prediction a lower bound is left, and a sentence ([`Predicted::caution`]). The bound knows nothing of the fit's
//! level, for one firefly in the pilot puts that too high at every look after it: it starts from the lower end of the
//! last look's own interval ([`Point::relmse_at_least`], 97.5 % of one side) and goes down the steepest slope that
//! the fit allows (97.5 %), so it holds with 95 % at least, however the two depend on each other (Bonferroni).
//!
//! Limits: a constant slope; the machine stays as fast as during the pilot; bias has no part in the model.

use crate::film::estimate::Verdict;
use crate::plan::options::SamplerKind;

/// Two-sided 95 % point of the normal distribution.
const NORMAL_95: f64 = 1.959964;

/// Least relative standard error of the time per sample: clocks of machines that also do other things.
const LEAST_RATE_ERROR: f64 = 0.02;

/// Slopes beyond these are noise: light transport has finite variance (1), and edges in a pixel cannot be sampled
/// faster than N^−2.
const SLOPE_BOUNDS: [f64; 2] = [0.9, 2.0];

/// One look at a running render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Samples per pixel by then.
    pub spp: u64,
    /// Seconds of rendering by then, without what is fixed.
    pub seconds: f64,
    /// Estimated relMSE.
    pub relmse: f64,
    /// Its 95 % interval, from the spread over pixels.
    pub relmse_interval: [f64; 2],
    /// Lower end of the 95 % interval that holds where single events carry the error as well.
    pub relmse_at_least: f64,
}

/// What is held of the slope before any point: a normal distribution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlopePrior {
    /// Its mean.
    pub mean: f64,
    /// Its standard deviation.
    pub sd: f64,
}

impl SlopePrior {
    /// Independent samples: exactly 1.
    pub const INDEPENDENT: SlopePrior = SlopePrior { mean: 1.0, sd: 1e-6 };
    /// Sobol' points: 1.02 to 1.14 between 16 and 128 samples per pixel on the shared scenes, pictures of 24×24 and
    /// 64×64.
    pub const SOBOL: SlopePrior = SlopePrior { mean: 1.08, sd: 0.05 };

    /// What is held of `sampler`.
    pub fn of(sampler: SamplerKind) -> Self {
        match sampler {
            SamplerKind::Sobol => Self::SOBOL,
            SamplerKind::Independent => Self::INDEPENDENT,
        }
    }
}

/// A fitted cost model.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Prediction {
    /// Seconds that do not depend on the samples.
    pub fixed_seconds: f64,
    /// Seconds of one sample per pixel, c.
    pub seconds_per_spp: f64,
    /// Relative standard error of c.
    pub rate_error: f64,
    /// s of relMSE = A·N^−s.
    pub slope: f64,
    /// Standard error of s.
    pub slope_error: f64,
    /// Samples per pixel of the last point, at which the level is quoted.
    pub spp: f64,
    /// Fitted relMSE at `spp`.
    pub relmse: f64,
    /// What it is at least, with 97.5 %: the lower end of the last point alone.
    pub relmse_at_least: f64,
    /// Covariance of (ln relmse, s).
    covariance: [[f64; 2]; 2],
}

/// What a target costs. Intervals are of 95 %.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Predicted {
    /// Samples per pixel, not rounded.
    pub spp: f64,
    /// Seconds in all, fixed ones included.
    pub seconds: f64,
    /// Of `spp`.
    pub spp_interval: [f64; 2],
    /// Of `seconds`.
    pub seconds_interval: [f64; 2],
    /// Samples per pixel that it takes at least, with 95 %, whatever the tail.
    pub least_spp: f64,
    /// Seconds of `least_spp`, fixed ones included.
    pub least_seconds: f64,
    /// Whether only the lower ends of the intervals are to be relied on, and how the tail that the pilot showed is.
    pub tail: Verdict,
}

impl Predicted {
    /// As far as a pilot of this tail can know; one that says nothing of its tail is taken as tame. Where it is not,
    /// the lower ends of the intervals are the lower bounds.
    pub fn under(self, tail: Option<Verdict>) -> Self {
        let tail = tail.unwrap_or(self.tail);
        if tail == Verdict::Tame {
            return Predicted { tail, ..self };
        }
        let ([spp, most_spp], [seconds, most_seconds]) = (self.spp_interval, self.seconds_interval);
        let spp_interval = [spp.min(self.least_spp), most_spp];
        let seconds_interval = [seconds.min(self.least_seconds), most_seconds];
        Predicted { tail, spp_interval, seconds_interval, ..self }
    }

    /// What to say beside the lower bound, where it is one.
    pub fn caution(&self) -> Option<&'static str> {
        match self.tail {
            Verdict::Tame => None,
            Verdict::Heavy => Some(
                "few bright samples carry the error: it takes at least that long, and longer where more of them turn \
                 up",
            ),
            Verdict::Untrusted => Some(
                "single bright samples carry the error, and more are to be expected: it takes at least that long, and \
                 nobody can say how much longer",
            ),
        }
    }
}

/// Fits the points of a pilot with Sobol' points, ascending in spp; `fixed_seconds` is load, build and output. `None`
/// until a point has an error and a duration.
pub fn fit(points: &[Point], fixed_seconds: f64) -> Option<Prediction> {
    fit_with(points, fixed_seconds, SlopePrior::SOBOL)
}

/// [`fit`] with another knowledge of the slope.
pub fn fit_with(points: &[Point], fixed_seconds: f64, prior: SlopePrior) -> Option<Prediction> {
    let usable = |p: &&Point| p.spp > 0 && p.relmse > 0.0 && p.relmse.is_finite() && p.seconds > 0.0;
    let points: Vec<&Point> = points.iter().filter(usable).collect();
    let last = points.last()?;
    let origin = (last.spp as f64).ln();
    let rate = rate(&points);

    // Normal equations of y = a − s·x with x = ln N − ln N_last; the prior is one more observation of s.
    let weight = prior.sd.powi(-2);
    let mut matrix = [[0.0, 0.0], [0.0, weight]];
    let mut right = [0.0, weight * prior.mean];
    let mut before: Option<(f64, [f64; 3])> = None;
    for point in &points {
        let x = (point.spp as f64).ln() - origin;
        let sigma = log_error(point);
        let row = [1.0 / sigma, -x / sigma, point.relmse.ln() / sigma];
        // Whitened: what is new in this point against the one before.
        let correlation = before.map_or(0.0, |(x_before, _)| (x_before - x).exp());
        let scale = (1.0 - correlation * correlation).sqrt();
        // A second look at the same samples says nothing.
        if scale < 1e-3 {
            continue;
        }
        let old = before.map_or([0.0; 3], |(_, old)| old);
        let fresh: [f64; 3] = std::array::from_fn(|i| (row[i] - correlation * old[i]) / scale);
        for i in 0..2 {
            for j in 0..2 {
                matrix[i][j] += fresh[i] * fresh[j];
            }
            right[i] += fresh[i] * fresh[2];
        }
        before = Some((x, row));
    }
    let determinant = matrix[0][0] * matrix[1][1] - matrix[0][1] * matrix[1][0];
    let covariance = [
        [matrix[1][1] / determinant, -matrix[0][1] / determinant],
        [-matrix[1][0] / determinant, matrix[0][0] / determinant],
    ];
    let free = covariance[1][0] * right[0] + covariance[1][1] * right[1];
    let slope = free.clamp(SLOPE_BOUNDS[0], SLOPE_BOUNDS[1]);
    // The level that goes with a slope at its bound.
    let level = (right[0] - matrix[0][1] * slope) / matrix[0][0];
    Some(Prediction {
        fixed_seconds,
        seconds_per_spp: rate.0,
        rate_error: rate.1,
        slope,
        slope_error: covariance[1][1].sqrt(),
        spp: last.spp as f64,
        relmse: level.exp(),
        relmse_at_least: last.relmse_at_least,
        covariance,
    })
}

impl Prediction {
    /// What the relative RMSE `e` (√relMSE, > 0) costs: N = N_last·(relMSE_last/e²)^(1/s), with intervals by the
    /// delta method in ln N.
    pub fn for_error(&self, e: f64) -> Predicted {
        let ahead = (self.relmse / (e * e)).ln() / self.slope;
        let [[level, both], [_, slope]] = self.covariance;
        let variance = (level - 2.0 * ahead * both + ahead * ahead * slope).max(0.0) / (self.slope * self.slope);
        let spp = self.spp * ahead.exp();
        let around = |value: f64, sd: f64| [value * (-NORMAL_95 * sd).exp(), value * (NORMAL_95 * sd).exp()];
        let seconds = self.seconds_per_spp * spp;
        let sampling = around(seconds, (variance + self.rate_error * self.rate_error).sqrt());
        let least_spp = self.least_spp(e);
        Predicted {
            spp,
            seconds: self.fixed_seconds + seconds,
            spp_interval: around(spp, variance.sqrt()),
            seconds_interval: sampling.map(|s| self.fixed_seconds + s),
            least_spp,
            least_seconds: self.least_seconds(least_spp),
            tail: Verdict::Tame,
        }
    }

    /// Samples per pixel that the relative RMSE `e` takes at least, with 95 %.
    fn least_spp(&self, e: f64) -> f64 {
        let fall = (self.relmse_at_least / (e * e)).ln();
        // Ahead the steepest slope gets there first, back from a target that may be met already the flattest.
        let slope = self.slope + NORMAL_95.copysign(fall) * self.slope_error;
        self.spp * (fall / slope.clamp(SLOPE_BOUNDS[0], SLOPE_BOUNDS[1])).exp()
    }

    /// Seconds that `spp` samples per pixel take at least, fixed ones included: with 97.5 %, if the machine stays as it
    /// was.
    pub fn least_seconds(&self, spp: f64) -> f64 {
        self.fixed_seconds + self.seconds_per_spp * (-NORMAL_95 * self.rate_error).exp() * spp
    }

    /// Relative RMSE expected after `spp` samples per pixel.
    pub fn error_at(&self, spp: f64) -> f64 {
        (self.relmse * (self.spp / spp).powf(self.slope)).sqrt()
    }
}

/// Standard error of ln relMSE, from the interval; at least 10⁻³, so that a point without an interval stays a
/// number.
fn log_error(point: &Point) -> f64 {
    let [low, high] = point.relmse_interval;
    let width = if low > 0.0 && high >= low { (high / low).ln() } else { 0.0 };
    (width / (2.0 * NORMAL_95)).max(1e-3)
}

/// Seconds per sample and its relative standard error: the mean over the pilot, and the scatter of the stretches
/// between points weighted by their length. The first point stands for the stretch before it only when it is alone: it
/// pays for cold caches and for passes that are too short.
fn rate(points: &[&Point]) -> (f64, f64) {
    let (first, last) = (points[0], points[points.len() - 1]);
    let whole = (last.seconds / last.spp as f64, 0.25);
    let samples = (last.spp - first.spp) as f64;
    let mean = (last.seconds - first.seconds) / samples;
    if !(samples > 0.0 && mean > 0.0) {
        return whole;
    }
    let (mut square, mut weights) = (0.0, 0.0);
    for pair in points.windows(2) {
        let n = (pair[1].spp - pair[0].spp) as f64;
        if n > 0.0 {
            let share = n / samples;
            square += share * share * ((pair[1].seconds - pair[0].seconds) / n / mean - 1.0).powi(2);
            weights += share * share;
        }
    }
    // Σw²(r − r̄)² estimates the variance of the weighted mean, short by the share that the mean takes up.
    let error = (square / (1.0 - weights).max(0.1)).sqrt();
    (mean, if points.len() < 3 { 0.1 } else { error.max(LEAST_RATE_ERROR) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(spp: u64, seconds: f64, relmse: f64, relative: f64) -> Point {
        let factor = (NORMAL_95 * relative).exp();
        let relmse_interval = [relmse / factor, relmse * factor];
        Point { spp, seconds, relmse, relmse_interval, relmse_at_least: relmse_interval[0] }
    }

    /// Oracle: the model itself. Points on a power law are continued exactly, whatever the prior, once they are sharp.
    #[test]
    fn a_power_law_is_continued() {
        let law = |n: f64| 0.5 * n.powf(-1.3);
        let points: Vec<Point> =
            (2..8).map(|k| point(1 << k, 0.5 + 0.01 * f64::from(1 << k), law(f64::from(1 << k)), 1e-3)).collect();
        let prediction = fit(&points, 2.0).expect("points");
        assert!((prediction.slope - 1.3).abs() < 0.01, "{prediction:?}");
        let cost = prediction.for_error(law(4096.0).sqrt());
        assert!((cost.spp / 4096.0 - 1.0).abs() < 0.03, "{cost:?}");
        assert!((cost.seconds - 2.0 - 0.01 * cost.spp).abs() < 1e-6, "{cost:?}");
        assert!((prediction.error_at(4096.0) / law(4096.0).sqrt() - 1.0).abs() < 0.02);
        for (value, [low, high]) in [(cost.spp, cost.spp_interval), (cost.seconds, cost.seconds_interval)] {
            assert!(low < value && value < high, "{cost:?}");
        }
        // The error of now costs what it cost.
        let now = prediction.for_error(law(128.0).sqrt());
        assert!((now.spp / 128.0 - 1.0).abs() < 1e-3, "{now:?}");
    }

    /// Oracle: noisy points say little of the slope, so the prior stands and the interval widens with the distance.
    #[test]
    fn noise_leaves_the_slope_to_the_prior() {
        let points = [point(8, 0.1, 0.2, 0.3), point(16, 0.2, 0.04, 0.3), point(32, 0.4, 0.05, 0.3)];
        let prediction = fit(&points, 0.0).expect("points");
        assert!((prediction.slope - SlopePrior::SOBOL.mean).abs() < 0.06, "{prediction:?}");
        let width = |e: f64| {
            let [low, high] = prediction.for_error(e).spp_interval;
            high / low
        };
        assert!(width(0.01) > width(0.1) && width(0.1) > 1.5, "{} {}", width(0.01), width(0.1));
        let certain = fit_with(&points, 0.0, SlopePrior::INDEPENDENT).expect("points");
        assert!((certain.slope - 1.0).abs() < 1e-6);
    }

    /// Oracle: coverage. Points with the correlations of nested samples (halves as sums of normal numbers over 64
    /// pixels) and slope 1; the interval of the cost holds in 95 % of 400 trials: within 90 and 99 %, which a binomial
    /// of 95 % leaves with a chance of 10⁻⁵.
    #[test]
    fn intervals_cover() {
        let mut state = 1u64;
        let mut uniform = move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        // Irwin-Hall of 12: normal enough.
        let mut normal = move || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        let (pixels, trials, mut held) = (64, 400, 0);
        for _ in 0..trials {
            let mut differences = vec![0.0; pixels];
            let mut points = Vec::new();
            let mut spp = 0u64;
            for step in [8u64, 8, 16, 32] {
                spp += step;
                for d in &mut differences {
                    *d += (step as f64).sqrt() * normal();
                }
                let relmse = differences.iter().map(|d| d * d).sum::<f64>() / pixels as f64 / (spp * spp) as f64;
                points.push(point(spp, spp as f64, relmse, (2.0 / pixels as f64).sqrt()));
            }
            let cost = fit_with(&points, 0.0, SlopePrior::INDEPENDENT).expect("points").for_error(1.0 / 32.0);
            held += u32::from(cost.spp_interval[0] < 1024.0 && 1024.0 < cost.spp_interval[1]);
        }
        assert!((360..=396).contains(&held), "{held} of {trials}");
    }

    /// Numbers stay; what they are worth is told.
    #[test]
    fn tails_that_are_not_tame_leave_lower_bounds() {
        let pilot = fit(&[point(16, 1.0, 0.04, 0.1), point(32, 2.0, 0.02, 0.1)], 0.0).expect("points");
        let cost = pilot.for_error(0.05);
        assert_eq!((cost.under(None), cost.caution()), (cost, None));
        assert_eq!(cost.under(Some(Verdict::Tame)), cost);
        for verdict in [Verdict::Heavy, Verdict::Untrusted] {
            let under = cost.under(Some(verdict));
            assert!(under.caution().is_some_and(|caution| caution.contains("at least that long")), "{under:?}");
            assert_eq!((under.spp, under.spp_interval[1]), (cost.spp, cost.spp_interval[1]));
            let low = [cost.spp_interval[0].min(cost.least_spp), cost.seconds_interval[0].min(cost.least_seconds)];
            assert_eq!([under.spp_interval[0], under.seconds_interval[0]], low);
        }
    }

    /// Oracle: the model by hand. Known exactly but for relMSE, which may be a quarter of what was fitted, a slope of 1
    /// leaves a quarter of the samples; what may be met already takes next to nothing.
    #[test]
    fn lower_bounds_start_from_the_lower_end_of_the_last_look() {
        let points = [point(16, 1.0, 0.04, 0.1), Point { relmse_at_least: 0.005, ..point(32, 2.0, 0.02, 0.1) }];
        let pilot = fit_with(&points, 3.0, SlopePrior::INDEPENDENT).expect("points");
        let cost = pilot.for_error(0.01);
        assert!((cost.least_spp / 1600.0 - 1.0).abs() < 1e-4, "{cost:?}");
        let seconds = 3.0 + 0.0625 * cost.least_spp;
        assert!(cost.least_seconds < seconds && cost.least_seconds > 0.8 * seconds, "{cost:?}");
        // The steepest slope that Sobol' points leave is worth less than the fitted one ahead, and the flattest back.
        let sobol = fit(&points, 3.0).expect("points");
        for e in [0.01f64, 0.2] {
            let fitted = 32.0 * (0.005 / (e * e)).powf(1.0 / sobol.slope);
            assert!(sobol.for_error(e).least_spp < fitted, "{e}: {sobol:?}");
        }
        let nothing = Point { relmse_at_least: 0.0, ..points[1] };
        assert_eq!(fit(&[nothing], 3.0).expect("a point").for_error(0.01).least_spp, 0.0);
    }

    #[test]
    fn pilots_without_anything_to_say_predict_nothing() {
        assert_eq!(fit(&[], 1.0), None);
        assert_eq!(fit(&[point(4, 1.0, 0.0, 0.1)], 1.0), None);
        let single = fit(&[point(4, 1.0, 0.01, 0.1), point(4, 1.0, 0.01, 0.1)], 1.0).expect("one point is a guess");
        let cost = single.for_error(0.05);
        assert!(cost.spp > 4.0 && cost.seconds > 2.0 && cost.seconds_interval[1].is_finite(), "{cost:?}");
    }
}
