//! Pixel filters, sampled by importance: a camera sample is displaced by a point drawn from |h|, and its radiance is
//! weighted by sign(h)·∫|h|/∫h, so that the plain mean of a pixel's samples is the filtered image and no sample is
//! shared between pixels (neighbouring pixels stay independent, which the error estimate needs).
//!
//! Offsets are in pixels from the pixel's centre. All filters are separable and even; each axis is sampled alone. Box
//! and tent are inverted in closed form. The others are inverted through tables built in f64: 512 cells per lobe,
//! equidistant in 1 − √(1 − u), so that cells shrink quadratically towards the tail and towards the zero
//! crossing. Lobes are chosen by probability, not by the sign of the result: the expectation of the weight is 1
//! exactly.
//!
//! Source: Ernst, Stamminger, Greiner 2006 ("Filter importance sampling"); Mitchell and Netravali 1988; Harris 1978.
//! Limit: with negative lobes the per-sample variance of a uniform image is (∫|h|/∫h)⁴ − 1, 0.3107 for
//! Mitchell.

use std::f64::consts::PI;
use std::fmt;
use std::str::FromStr;

pub use crate::plan::options::FilterKind;

/// A point drawn from a filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterSample {
    /// Offset from the pixel's centre, in pixels.
    pub dx: f32,
    /// Offset from the pixel's centre, in pixels (down).
    pub dy: f32,
    /// Signed weight with expectation 1; exactly 1 for filters without negative lobes.
    pub weight: f32,
}

impl FilterKind {
    /// Every filter of the command line, in the order of the help text.
    pub const ALL: [FilterKind; 5] =
        [FilterKind::Box, FilterKind::Tent, FilterKind::Gaussian, FilterKind::BlackmanHarris, FilterKind::Mitchell];

    /// Spelling of the command line.
    pub fn name(self) -> &'static str {
        match self {
            FilterKind::Box => "box",
            FilterKind::Tent => "tent",
            FilterKind::Gaussian => "gaussian",
            FilterKind::BlackmanHarris => "blackman-harris",
            FilterKind::Mitchell => "mitchell",
            FilterKind::Point => "point",
        }
    }

    /// Half of the filter's support, in pixels.
    pub fn radius(self) -> f32 {
        match self {
            FilterKind::Box => 0.5,
            FilterKind::Tent => 1.0,
            FilterKind::Gaussian | FilterKind::BlackmanHarris => 1.5,
            FilterKind::Mitchell => 2.0,
            FilterKind::Point => 0.0,
        }
    }

    /// The filter along one axis at distance `x` ≥ 0 from the centre, not normalised.
    fn value(self, x: f64) -> f64 {
        if x > f64::from(self.radius()) {
            return 0.0;
        }
        match self {
            FilterKind::Box | FilterKind::Point => 1.0,
            FilterKind::Tent => 1.0 - x,
            FilterKind::Gaussian => (-0.5 * (x / GAUSSIAN_SIGMA).powi(2)).exp(),
            FilterKind::BlackmanHarris => {
                // The 4-term window of Harris 1978 with a side lobe of −92 dB, centred: phase 0 at the peak.
                let phase = PI * x / f64::from(self.radius());
                0.35875 + 0.48829 * phase.cos() + 0.14128 * (2.0 * phase).cos() + 0.01168 * (3.0 * phase).cos()
            }
            FilterKind::Mitchell if x < 1.0 => {
                let (b, c) = (1.0 / 3.0, 1.0 / 3.0);
                ((12.0 - 9.0 * b - 6.0 * c) * x.powi(3) + (-18.0 + 12.0 * b + 6.0 * c) * x.powi(2) + (6.0 - 2.0 * b))
                    / 6.0
            }
            FilterKind::Mitchell => {
                let (b, c) = (1.0 / 3.0, 1.0 / 3.0);
                ((-b - 6.0 * c) * x.powi(3)
                    + (6.0 * b + 30.0 * c) * x.powi(2)
                    + (-12.0 * b - 48.0 * c) * x
                    + (8.0 * b + 24.0 * c))
                    / 6.0
            }
        }
    }

    /// Where the filter turns negative; its radius if it never does.
    fn zero_crossing(self) -> f64 {
        let radius = f64::from(self.radius());
        if self != FilterKind::Mitchell {
            return radius;
        }
        // Mitchell's outer piece changes sign once in (1, 2): bisected to the last bit.
        let (mut low, mut high) = (1.0, 1.5);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if self.value(middle) > 0.0 { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }
}

impl fmt::Display for FilterKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for FilterKind {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        FilterKind::ALL
            .into_iter()
            .find(|kind| kind.name() == s)
            .ok_or_else(|| format!("'{s}' is not one of box, tent, gaussian, blackman-harris, mitchell"))
    }
}

/// Standard deviation of [`FilterKind::Gaussian`], pixels.
const GAUSSIAN_SIGMA: f64 = 0.5;

/// Cells of an inversion table. The error of the second moment falls with its square; 512 leaves less than 10⁻⁵.
const CELLS: usize = 512;

/// Steps of the cumulative sums that the tables are built from.
const INTEGRATION_STEPS: usize = 1 << 16;

/// Steps of the table of values from the centre to the radius.
const VALUES: usize = 1024;

/// A filter made ready for sampling.
#[derive(Clone, Debug)]
pub struct FilterTable {
    kind: FilterKind,
    /// Inverse of the cumulative distribution of |x| within the positive lobe.
    positive: Vec<f32>,
    /// The same within the negative lobe; empty without one.
    negative: Vec<f32>,
    /// Probability of the positive lobe along one axis; 1 without a negative one.
    p_positive: f32,
    /// ∫|h|/∫h along one axis; 1 without a negative lobe.
    magnitude: f32,
    /// The filter along one axis over its integral, at equal steps from the centre to its radius; empty for those in
    /// closed form.
    values: Vec<f32>,
}

impl FilterTable {
    /// Builds the tables of `kind` (under a millisecond).
    pub fn new(kind: FilterKind) -> Self {
        let (positive, negative, values) = (vec![], vec![], vec![]);
        let mut table = FilterTable { kind, positive, negative, p_positive: 1.0, magnitude: 1.0, values };
        if matches!(kind, FilterKind::Box | FilterKind::Tent | FilterKind::Point) {
            return table;
        }
        let (crossing, radius) = (kind.zero_crossing(), f64::from(kind.radius()));
        let inner = inverse_cdf(kind, 0.0, crossing);
        let mut integral = 2.0 * inner.integral;
        table.positive = inner.knots;
        if crossing < radius {
            let outer = inverse_cdf(kind, crossing, radius);
            integral -= 2.0 * outer.integral;
            table.negative = outer.knots;
            table.p_positive = (inner.integral / (inner.integral + outer.integral)) as f32;
            // From the rounded probability, so that p·m − (1 − p)·m = 1 holds for what is really sampled.
            table.magnitude = (1.0 / (2.0 * f64::from(table.p_positive) - 1.0)) as f32;
        }
        let value = |step| kind.value(radius * step as f64 / VALUES as f64) / integral;
        table.values = (0..=VALUES).map(|step| value(step) as f32).collect();
        table
    }

    /// Which filter this is.
    pub fn kind(&self) -> FilterKind {
        self.kind
    }

    /// Maps `(u, v)` in [0,1)² to a point of the filter. Monotone in each argument within a lobe, so stratified
    /// numbers stay stratified.
    #[inline(always)]
    pub fn sample(&self, u: f32, v: f32) -> FilterSample {
        match self.kind {
            FilterKind::Box => FilterSample { dx: u - 0.5, dy: v - 0.5, weight: 1.0 },
            FilterKind::Point => FilterSample { dx: 0.0, dy: 0.0, weight: 1.0 },
            FilterKind::Tent => FilterSample { dx: tent(u), dy: tent(v), weight: 1.0 },
            _ => {
                let (x, y) = (self.axis(u), self.axis(v));
                FilterSample { dx: x.offset, dy: y.offset, weight: x.weight * y.weight }
            }
        }
    }

    /// The filter along one axis, `x` pixels from the centre, with an integral of 1: a pixel is the integral of
    /// radiance times the product of both axes. Linear between the values of a table, which misses less than 10⁻⁵ of
    /// the peak.
    #[inline]
    pub fn value(&self, x: f32) -> f32 {
        let (x, radius) = (x.abs(), self.kind.radius());
        match self.kind {
            FilterKind::Box | FilterKind::Point => f32::from(u8::from(x <= radius)),
            FilterKind::Tent => (1.0 - x).max(0.0),
            _ if x >= radius => 0.0,
            _ => {
                let at = x / radius * VALUES as f32;
                let step = (at as usize).min(VALUES - 1);
                let (low, high) = (self.values[step], self.values[step + 1]);
                low + (high - low) * (at - step as f32)
            }
        }
    }

    #[inline(always)]
    fn axis(&self, u: f32) -> AxisSample {
        let side = 2.0 * u - 1.0;
        let a = side.abs();
        let (knots, a, weight) = if a < self.p_positive || self.negative.is_empty() {
            (&self.positive, a / self.p_positive, self.magnitude)
        } else {
            (&self.negative, (a - self.p_positive) / (1.0 - self.p_positive), -self.magnitude)
        };
        let cell = (1.0 - (1.0 - a).max(0.0).sqrt()) * CELLS as f32;
        let index = (cell as usize).min(CELLS - 1);
        let (low, high) = (knots[index], knots[index + 1]);
        AxisSample { offset: (low + (cell - index as f32) * (high - low)).copysign(side), weight }
    }
}

/// A point along one axis.
struct AxisSample {
    offset: f32,
    weight: f32,
}

/// Closed-form inversion of the tent: the density 1 − |x| has the distribution (1 − (1 − |x|)²)/2 on each side.
#[inline(always)]
fn tent(u: f32) -> f32 {
    let side = 2.0 * u - 1.0;
    (1.0 - (1.0 - side.abs()).sqrt()).copysign(side)
}

/// A lobe's inverted distribution and its size.
struct Lobe {
    knots: Vec<f32>,
    /// ∫|h| over the lobe (one side).
    integral: f64,
}

/// Inverts the cumulative distribution of |h| on `[from, to]` at the values 1 − (1 − q)², q = 0, 1/CELLS, … 1.
fn inverse_cdf(kind: FilterKind, from: f64, to: f64) -> Lobe {
    let step = (to - from) / INTEGRATION_STEPS as f64;
    let mut cumulative = Vec::with_capacity(INTEGRATION_STEPS + 1);
    let mut integral = 0.0;
    cumulative.push(0.0);
    for i in 0..INTEGRATION_STEPS {
        // Midpoint rule: the error is below 10⁻¹⁰ of the integral for these smooth pieces.
        integral += kind.value(from + (i as f64 + 0.5) * step).abs() * step;
        cumulative.push(integral);
    }
    let knots = (0..=CELLS)
        .map(|k| {
            let rest = 1.0 - k as f64 / CELLS as f64;
            let target = (1.0 - rest * rest) * integral;
            let above = cumulative.partition_point(|&c| c < target).clamp(1, INTEGRATION_STEPS);
            let (low, high) = (cumulative[above - 1], cumulative[above]);
            let within = if high > low { ((target - low) / (high - low)).clamp(0.0, 1.0) } else { 0.0 };
            (from + ((above - 1) as f64 + within) * step) as f32
        })
        .collect();
    Lobe { knots, integral }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Midpoints of a regular grid over [0,1): deterministic quadrature of the sampler, no false alarms.
    fn grid(n: usize) -> impl Iterator<Item = f32> {
        (0..n).map(move |i| (i as f32 + 0.5) / n as f32)
    }

    /// ∫ x² h / ∫ h by quadrature of the definition.
    fn second_moment(kind: FilterKind) -> f64 {
        let n = 1 << 16;
        let step = f64::from(kind.radius()) / n as f64;
        let (mut top, mut bottom) = (0.0, 0.0);
        for i in 0..n {
            let x = (i as f64 + 0.5) * step;
            top += x * x * kind.value(x);
            bottom += kind.value(x);
        }
        top / bottom
    }

    #[test]
    fn moments_of_samples_match_the_filter() {
        // Oracle: quadrature of the definition. Deterministic; where the weight changes sign the grid misplaces up to
        // one of its 65536 cells on each side, worth 2·1.07·2/65536 = 7·10⁻⁵.
        for kind in FilterKind::ALL {
            let table = FilterTable::new(kind);
            let n = 1 << 16;
            let mut sums = [0.0f64; 3];
            for u in grid(n) {
                let s = table.sample(u, 0.5);
                let (x, w) = (f64::from(s.dx), f64::from(s.weight) / f64::from(table.magnitude));
                assert!(s.dx.abs() <= kind.radius() && s.dy == table.sample(0.5, 0.5).dx, "{kind} {u}: {s:?}");
                for (power, sum) in sums.iter_mut().enumerate() {
                    *sum += w * x.powi(power as i32) / n as f64;
                }
            }
            let expected = second_moment(kind);
            assert!((sums[0] - 1.0).abs() < 1e-4, "{kind}: mean weight {}", sums[0]);
            assert!(sums[1].abs() < 1e-6, "{kind}: mean offset {}", sums[1]);
            assert!((sums[2] - expected).abs() < 1e-4, "{kind}: x² {} for {expected}", sums[2]);
        }
        // Closed forms of two of them.
        assert!((second_moment(FilterKind::Box) - 1.0 / 12.0).abs() < 1e-9);
        assert!((second_moment(FilterKind::Tent) - 1.0 / 6.0).abs() < 1e-9);
    }

    #[test]
    fn values_are_the_density_that_is_drawn() {
        // Oracle: quadrature; the pixels around a point share 1, up to 0.3 % where the filter is not a partition of
        // unity by construction. Deterministic.
        for kind in FilterKind::ALL {
            let table = FilterTable::new(kind);
            let n = 1 << 14;
            let at = |i: usize| (i as f32 + 0.5) / n as f32 * 2.0 * kind.radius() - kind.radius();
            let step = 2.0 * f64::from(kind.radius()) / n as f64;
            let (mut whole, mut second) = (0.0, 0.0);
            for i in 0..n {
                whole += f64::from(table.value(at(i))) * step;
                second += f64::from(table.value(at(i))) * f64::from(at(i)).powi(2) * step;
            }
            assert!((whole - 1.0).abs() < 2e-4, "{kind}: {whole}");
            assert!((second - second_moment(kind)).abs() < 2e-4, "{kind}: {second}");
        }
    }

    #[test]
    fn weights_have_expectation_one_and_the_known_variance() {
        // HARDCASES M01: variance (∫|h|/∫h)⁴ − 1 = 0.3106532 for Mitchell, 0 for the others. Deterministic
        // grid; the lobe boundary falls inside one of 1024 cells of each axis, so the grid itself is exact to
        // 2·10⁻³.
        for kind in FilterKind::ALL {
            let table = FilterTable::new(kind);
            let m = f64::from(table.magnitude);
            let p = f64::from(table.p_positive);
            assert!((m * (2.0 * p - 1.0) - 1.0).abs() < 1e-7, "{kind}");
            let expected = if kind == FilterKind::Mitchell { 0.3106532 } else { 0.0 };
            assert!((m.powi(4) - 1.0 - expected).abs() < 1e-6, "{kind}: {}", m.powi(4) - 1.0);
            let (mut mean, mut square) = (0.0, 0.0);
            let n = 1024;
            for u in grid(n) {
                for v in grid(n) {
                    let w = f64::from(table.sample(u, v).weight);
                    mean += w / (n * n) as f64;
                    square += w * w / (n * n) as f64;
                }
            }
            assert!((mean - 1.0).abs() < 4e-3, "{kind}: {mean}");
            assert!((square - 1.0 - expected).abs() < 1e-5, "{kind}: {square}");
        }
    }

    #[test]
    fn ends_of_the_unit_interval_stay_inside_the_support() {
        let last = 1.0 - f32::EPSILON / 2.0;
        for kind in FilterKind::ALL {
            let table = FilterTable::new(kind);
            for u in [0.0, f32::MIN_POSITIVE, 0.25, 0.5, last] {
                let s = table.sample(u, last);
                assert!(s.dx.is_finite() && s.dx.abs() <= kind.radius() && s.dy <= kind.radius(), "{kind} {u}: {s:?}");
                assert!(s.weight.is_finite());
            }
            assert_eq!(kind.name().parse::<FilterKind>(), Ok(kind));
        }
        assert!("lanczos".parse::<FilterKind>().is_err());
    }
}
