//! An estimate of a film's error, with its intervals.

/// Two-sided 95 % point of the normal distribution.
pub(super) const NORMAL_95: f64 = 1.959964;

/// What a limit takes of the uncertainty of the denominators, whose errors are not normal. On the shared scenes 38 to
/// 40 of 40 targets were kept at 1, and 39 or 40 at 3 (`tests/suite/estimate.rs`).
const LIMIT_DENOMINATOR: f64 = 3.0;

/// The film's estimate of its error.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ErrorEstimate {
    /// Estimated relMSE.
    pub relmse: f64,
    /// Standard error of `relmse` from its spread over the pixels, which are independent.
    pub relmse_stderr: f64,
    /// Standard error of ln `relmse` for the choice of the denominators.
    pub denominator_error: f64,
    /// Interval that covers the expectation of `relmse` with 95 %: not symmetric, wide where single events carry it.
    pub interval: [f64; 2],
    /// ε = 0.01·mean(I)², the mean over pixels and channels.
    pub epsilon: f64,
    /// Mean over pixels and channels of the standard error of the pixel, in units of radiance.
    pub stderr_mean: f64,
    /// Mean of the picture per channel, in units of radiance.
    pub mean: [f64; 3],
    /// Its standard error.
    pub mean_stderr: [f64; 3],
    /// Interval that covers the mean of the converged picture with 95 %.
    pub mean_interval: [[f64; 2]; 3],
    /// Share of the pixel with the largest in `relmse`.
    pub largest_share: f64,
    /// Whether the spread over pixels is known well enough for the intervals to keep their word: no pixel carries a
    /// tenth, and kurtosis is below a tenth of the number of pixels.
    pub reliable: bool,
}

impl ErrorEstimate {
    /// 95 % interval of relMSE from the spread over pixels alone, the denominators taken as they are.
    pub fn spread_interval(&self) -> [f64; 2] {
        if self.relmse > 0.0 {
            let factor = (NORMAL_95 * self.relmse_stderr / self.relmse).exp();
            [self.relmse / factor, self.relmse * factor]
        } else {
            [0.0; 2]
        }
    }

    /// Limit that the relMSE of *this* picture stays below with the confidence of `quantiles` standard deviations.
    /// Wider than the interval of the expected relMSE: the picture's own error scatters as the estimate does, and
    /// independently of it. The pixel with the largest share is counted twice, as if one more like it had been missed.
    pub fn picture_limit(&self, quantiles: f64) -> f64 {
        if self.relmse > 0.0 {
            let scatter = std::f64::consts::SQRT_2 * self.relmse_stderr / self.relmse;
            let missed = 1.0 + self.largest_share;
            self.relmse * missed * (quantiles * scatter.hypot(LIMIT_DENOMINATOR * self.denominator_error)).exp()
        } else {
            self.relmse
        }
    }
}
