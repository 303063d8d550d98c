//! Term by term: the solver's means over the picture and its quarters against the path tracer's.
//!
//! The path tracer's standard error comes from two independent runs: a quarter of the squared difference of a pixel's
//! two values is the variance of their mean, and pixels are independent. The solver's interval is relative, one for all
//! regions and channels of a length: the largest of |fine − coarse|/2 and |fine − middle|. The first is the error
//! of the finest if it is of first order in the patch's side. Where shadow edges happen to lie on the patches adds
//! errors that are as good as random; then the second is at least as large in the mean, and the largest over regions
//! does not vanish by chance. It is never less than that of a shorter length, because an error made at one scattering
//! is carried on. A comparison agrees within 4.9 standard errors (10⁻⁶ two-sided) plus that interval; a check makes
//! up to 240, so it alarms falsely with 2.4·10⁻⁴. Not judged are terms below [`FAINT`] of the picture and terms
//! that few paths make up ([`RARE`]), whose standard error means nothing (HARDCASES §6.2). A term that the path tracer
//! never found is judged where the solver's value amounts to at least [`CERTAIN`] paths, each as bright as the
//! brightest emission.

use super::gather::Radiances;
use super::options::VerifyOptions;
use super::patches::SOLUTIONS;
use crate::film::layer::bounces::LENGTHS;

/// Standard errors within which a term agrees.
pub const SIGMAS: f64 = 4.9;

/// Share of the picture's radiance below which a term is not judged.
pub const FAINT: f64 = 1e-6;

/// Share of a term that the deviation of a single pixel may have if the term is judged.
pub const RARE: f64 = 0.1;

/// Expected number of paths of which not a single one is found with a probability below 10⁻⁶.
pub const CERTAIN: f64 = 14.0;

/// Part of the picture that a mean is taken over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Region {
    /// Everything.
    Whole,
    /// 0: top left, 1: top right, 2: bottom left, 3: bottom right.
    Quarter(u8),
}

impl Region {
    /// Every region.
    pub const ALL: [Region; 5] =
        [Region::Whole, Region::Quarter(0), Region::Quarter(1), Region::Quarter(2), Region::Quarter(3)];

    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Region::Whole => "whole",
            Region::Quarter(0) => "top left",
            Region::Quarter(1) => "top right",
            Region::Quarter(2) => "bottom left",
            Region::Quarter(_) => "bottom right",
        }
    }

    /// Its pixels in a picture of this size, row-major.
    fn pixels(self, (width, height): (u32, u32)) -> impl Iterator<Item = usize> {
        let holds = move |x: u32, y: u32| match self {
            Region::Whole => true,
            Region::Quarter(q) => q == u8::from(x >= width / 2) + 2 * u8::from(y >= height / 2),
        };
        (0..height)
            .flat_map(move |y| (0..width).map(move |x| (x, y)))
            .enumerate()
            .filter(move |(_, (x, y))| holds(*x, *y))
            .map(|(i, _)| i)
    }
}

/// The path tracer's two runs.
#[derive(Clone, Debug)]
pub struct Estimates {
    /// Per pixel and number of edges: mean of both runs, and half their difference.
    pixels: Vec<[[Estimate; 3]; LENGTHS]>,
    /// Samples of each pixel, over both runs.
    samples: u64,
    /// Largest emission by channel.
    brightest: [f64; 3],
}

#[derive(Clone, Copy, Debug, Default)]
struct Estimate {
    mean: f64,
    half_difference: f64,
}

impl Estimates {
    /// From the two runs' means per pixel and number of edges, of `samples` for each pixel together, and the largest
    /// emission of the scene.
    pub fn new(runs: &[Vec<[[f64; 3]; LENGTHS]>; 2], samples: u64, brightest: [f64; 3]) -> Self {
        let [first, second] = runs;
        debug_assert_eq!(first.len(), second.len(), "pixels of the two runs");
        let pair = |(a, b): (&[[f64; 3]; LENGTHS], &[[f64; 3]; LENGTHS])| {
            std::array::from_fn(|edges| {
                std::array::from_fn(|c| {
                    let (a, b) = (a[edges][c], b[edges][c]);
                    Estimate { mean: 0.5 * (a + b), half_difference: 0.5 * (a - b) }
                })
            })
        };
        Estimates { pixels: first.iter().zip(second).map(pair).collect(), samples, brightest }
    }
}

/// One length in one region.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Comparison {
    /// Number of edges; the last number of [`LENGTHS`] is the tail.
    pub edges: usize,
    /// Where.
    pub region: Region,
    /// By channel.
    pub channels: [Term; 3],
}

/// One mean, both ways. All in W·sr⁻¹·m⁻².
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Term {
    /// By the finer solution.
    pub solver: f64,
    /// Bound of its discretisation error.
    pub discretisation: f64,
    /// By the path tracer.
    pub path_tracer: f64,
    /// Standard error of that.
    pub standard_error: f64,
    /// Whether that means anything: enough paths make up the term.
    pub judged: bool,
}

/// Relative rounding of a path's f32 products and of its two camera rays' points; terms that are exact otherwise
/// (emission, furnaces) agree to this.
const ROUNDING: f64 = 1.0 / (1u32 << 18) as f64;

impl Term {
    /// Path tracer less solver.
    pub fn difference(&self) -> f64 {
        self.path_tracer - self.solver
    }

    /// The difference in units of both uncertainties together; 0 where there is none.
    pub fn sigmas(&self) -> f64 {
        let unit = self.standard_error.hypot(self.discretisation).hypot(ROUNDING * self.solver);
        if unit > 0.0 {
            self.difference() / unit
        } else if self.difference() == 0.0 {
            0.0
        } else {
            f64::INFINITY
        }
    }

    /// Whether both are the same within their intervals, as far as that can be judged.
    pub fn agrees(&self) -> bool {
        !self.judged || self.difference().abs() <= self.limit()
    }

    /// The most by which the two may differ.
    pub fn limit(&self) -> f64 {
        SIGMAS * self.standard_error + self.discretisation + ROUNDING * self.solver
    }
}

impl Comparison {
    /// Whether all channels agree.
    pub fn agrees(&self) -> bool {
        self.channels.iter().all(Term::agrees)
    }

    /// The channel that agrees least, of those that are judged if there is one.
    pub fn worst(&self) -> &Term {
        let excess = |term: &Term| if term.limit() > 0.0 { term.difference().abs() / term.limit() } else { 0.0 };
        let order = |a: &&Term, b: &&Term| a.judged.cmp(&b.judged).then(excess(a).total_cmp(&excess(b)));
        self.channels.iter().max_by(order).expect("three channels")
    }
}

/// Compares every number of edges up to the depth limit in every region, the whole picture first, by ascending length.
/// `solutions` are the solver's, the coarsest first.
pub fn judge(solutions: &[&[Radiances]; SOLUTIONS], estimates: &Estimates, options: &VerifyOptions) -> Vec<Comparison> {
    let regions = Region::ALL.map(|region| region.pixels(options.resolution).collect::<Vec<usize>>());
    let last = (LENGTHS - 1).min(options.max_depth as usize);
    let [coarse, middle, fine] = solutions;
    let mean = |of: &[Radiances], pixels: &[usize], edges: usize, c: usize| {
        pixels.iter().map(|&p| of[p][edges][c]).sum::<f64>() / pixels.len().max(1) as f64
    };
    let picture: [f64; 3] = std::array::from_fn(|c| (1..=last).map(|edges| mean(fine, &regions[0], edges, c)).sum());

    // Relative discretisation error by length.
    let mut relative = [0.0f64; LENGTHS];
    for edges in 1..=last {
        relative[edges] = relative[edges - 1];
        for (pixels, c) in regions.iter().flat_map(|pixels| (0..3).map(move |c| (pixels, c))) {
            let value = mean(fine, pixels, edges, c);
            if value > FAINT * picture[c] {
                let step = (value - mean(coarse, pixels, edges, c)).abs();
                let half_step = (value - mean(middle, pixels, edges, c)).abs();
                relative[edges] = relative[edges].max((0.5 * step).max(half_step) / value);
            }
        }
    }

    let compare = |region: usize, edges: usize| {
        let pixels = &regions[region];
        let n = pixels.len().max(1) as f64;
        let channels = std::array::from_fn(|c| {
            let solver = mean(fine, pixels, edges, c);
            let at = |p: &usize| estimates.pixels[*p][edges][c];
            let variance = pixels.iter().map(|p| at(p).half_difference.powi(2)).sum::<f64>() / (n * n);
            let largest = pixels.iter().map(|p| at(p).half_difference.abs()).fold(0.0, f64::max);
            let path_tracer = pixels.iter().map(|p| at(p).mean).sum::<f64>() / n;
            Term {
                solver,
                discretisation: relative[edges] * solver,
                path_tracer,
                standard_error: variance.sqrt(),
                judged: solver.max(path_tracer) > FAINT * picture[c]
                    && if path_tracer > 0.0 {
                        largest <= RARE * n * path_tracer
                    } else {
                        solver * n * estimates.samples as f64 > CERTAIN * estimates.brightest[c]
                    },
            }
        });
        Comparison { edges, region: Region::ALL[region], channels }
    };
    (0..regions.len())
        .flat_map(|region| (1..=last).map(move |edges| (region, edges)))
        .map(|(r, e)| compare(r, e))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options() -> VerifyOptions {
        VerifyOptions { resolution: (16, 16), ..VerifyOptions::default() }
    }

    /// Terms 2^-edges; solutions that converge to them from below: 3 %, 2 % and 1 % short in every region.
    fn solutions() -> [Vec<Radiances>; SOLUTIONS] {
        let radiances = |short: f64| {
            let mut all = [[0.0; 3]; LENGTHS + 1];
            for (edges, term) in all.iter_mut().enumerate().take(LENGTHS).skip(1) {
                *term = [(1.0 - short) * 0.5f64.powi(edges as i32); 3];
            }
            vec![all; 256]
        };
        [0.03, 0.02, 0.01].map(radiances)
    }

    /// Two runs around `factor`·2^-(edges + shift), each pixel 10 % off to either side in turn.
    fn estimates(factor: f64, shift: i32) -> Estimates {
        let run = |sign: f64| {
            let pixel = |p: usize| {
                let off = 1.0 + 0.1 * sign * if p.is_multiple_of(2) { 1.0 } else { -1.0 };
                std::array::from_fn(|edges| [off * factor * 0.5f64.powi(edges as i32 + shift); 3])
            };
            (0..256).map(pixel).collect::<Vec<_>>()
        };
        Estimates::new(&[run(1.0), run(-1.0)], 4, [1.0; 3])
    }

    fn agreeing(estimates: &Estimates) -> usize {
        let [a, b, c] = solutions();
        let comparisons = judge(&[&a, &b, &c], estimates, &options());
        assert_eq!(comparisons.len(), 5 * 16);
        comparisons.iter().filter(|c| c.agrees()).count()
    }

    /// Oracle: by hand. Noise of 10 % a pixel leaves 0.1/16 of the whole, 0.1/8 of a quarter; the discretisation is 1 %
    /// of 0.99, as |fine − coarse|/2 and |fine − middle| say.
    #[test]
    fn agreement_is_within_noise_and_discretisation() {
        let [a, b, c] = solutions();
        let first = judge(&[&a, &b, &c], &estimates(1.0, 0), &options())[0].channels[1];
        assert!((first.standard_error - 0.5 * 0.1 / 16.0).abs() < 1e-12, "{first:?}");
        assert!((first.discretisation - 0.005).abs() < 1e-12 && first.judged, "{first:?}");
        assert!((first.path_tracer - 0.5).abs() < 1e-12 && (first.difference() - 0.005).abs() < 1e-12, "{first:?}");
        assert_eq!(agreeing(&estimates(1.0, 0)), 80);
    }

    /// What must be seen: a twelfth too bright everywhere, and lengths counted one off although the sum stays about
    /// right.
    #[test]
    fn wrong_terms_are_seen() {
        assert_eq!(agreeing(&estimates(1.0 / 0.92, 0)), 0);
        assert_eq!(agreeing(&estimates(1.0, 1)), 0);
        assert_eq!(agreeing(&estimates(1.0, -1)), 0);
    }

    /// A term that one pixel makes up has no standard error worth the name.
    #[test]
    fn rare_terms_are_not_judged() {
        let mut rare = estimates(1.0, 0);
        rare.pixels[7][3][0].half_difference = 10.0;
        let [a, b, c] = solutions();
        let comparisons = judge(&[&a, &b, &c], &rare, &options());
        let judged: Vec<usize> = comparisons.iter().filter(|c| !c.channels[0].judged).map(|c| c.edges).collect();
        // The pixel lies in the whole and in the top left quarter.
        assert_eq!(judged, [3, 3]);
    }

    /// Nothing found: of 256 pixels with 4 samples and emission 1, lengths up to 6 amount to 16 paths and more,
    /// quarters up to 4.
    #[test]
    fn what_is_never_found_is_missed_where_it_should_have_been() {
        let [a, b, c] = solutions();
        let comparisons = judge(&[&a, &b, &c], &estimates(0.0, 0), &options());
        let missed = |region| comparisons.iter().filter(|c| c.region == region && !c.agrees()).count();
        assert_eq!((missed(Region::Whole), missed(Region::Quarter(3))), (6, 4));
    }
}
