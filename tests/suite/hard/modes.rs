//! Where traced cases run: every backend and query mode of this build. And pictures whose pixels are known, with their
//! noise.

use pathspace::backend::{BackendKind, QueryMode};
use pathspace::plan::options::RenderOptions;
use pathspace::scene::Scene;
use pathspace_stat::{chi2_limit, ks_uniform, normal_tail, z_limit};

use super::Case;
use crate::common::{Estimate, render};
use crate::conformance;

/// One way to trace rays.
#[derive(Clone)]
pub struct Mode {
    /// As `embree/packet16`; backends that know one way only go by their own name; `auto` is what a render takes by
    /// itself: `flat` for scenes of few faces, else the first of the others.
    pub name: String,
    backend: Option<BackendKind>,
    rays: Option<QueryMode>,
}

impl Mode {
    /// All of this build, but for those of `PATHSPACE_SKIP_BACKENDS`.
    pub fn all() -> Vec<Mode> {
        let asked = |kind: &&BackendKind| !conformance::is_skipped(**kind);
        let of = |&backend: &BackendKind| {
            let modes = match backend {
                BackendKind::Embree => QueryMode::ALL.map(Some).to_vec(),
                _ => vec![None],
            };
            let name = move |rays: Option<QueryMode>| match rays {
                Some(rays) => format!("{}/{rays}", backend.name()),
                None => backend.name().into(),
            };
            modes.into_iter().map(move |rays| Mode { name: name(rays), backend: Some(backend), rays })
        };
        let auto = Mode { name: "auto".into(), backend: None, rays: None };
        BackendKind::available().iter().filter(asked).flat_map(of).chain([auto]).collect()
    }

    /// Whether this is what most scenes are rendered with by default: it gets the full number of samples.
    pub fn is_main(&self) -> bool {
        self.backend == Some(BackendKind::available()[0]) && self.rays.is_none_or(|rays| rays == QueryMode::Packet16)
    }

    /// Whether every ray meets every triangle: for small scenes only.
    pub fn is_brute(&self) -> bool {
        self.backend == Some(BackendKind::Brute)
    }

    /// `full` on the main mode, `reduced` on the others.
    pub fn count<T>(&self, full: T, reduced: T) -> T {
        if self.is_main() { full } else { reduced }
    }

    /// `options` on this backend and in this mode.
    pub fn options(&self, options: RenderOptions) -> RenderOptions {
        options.backend(self.backend).rays(self.rays)
    }
}

/// A pixel: what came out, what was expected, and the standard error that is known of it.
pub type Known = (f64, f64, f64);

impl Case {
    /// What conserves energy: no channel's mean above `limit` by more than 4.9 standard errors and a rounding of 10⁻⁵,
    /// none below 0 and none that is no number.
    pub fn at_most(&mut self, on: impl std::fmt::Display, limit: f64, estimate: &Estimate) {
        let excess = |c: usize| estimate.mean[c] - limit - 4.9 * estimate.standard_error(c) - 1e-5;
        let worst = (0..3).max_by(|&a, &b| excess(a).total_cmp(&excess(b))).unwrap_or(0);
        let ok = estimate.mean.iter().all(|mean| (0.0..f64::INFINITY).contains(mean)) && excess(worst) <= 0.0;
        let (mean, error) = (estimate.mean[worst], estimate.standard_error(worst));
        self.row(on, format!("0 to {limit}"), format!("{mean:.6} ± {error:.1e}"), format!("{:.1e}", mean - limit), ok);
    }

    /// A small picture of `scene` in every mode: its mean within 4.9 standard errors and `tau` of `expected`.
    pub fn pictures(&mut self, scene: &Scene, options: &RenderOptions, expected: [f64; 3], tau: f64, delta: f64) {
        for mode in Mode::all() {
            let film = render(scene, mode.options(options.clone())).film;
            self.mean(mode.name, expected, tau, delta, &Estimate::of_pixels(&film));
        }
    }

    /// T2: many means at once. The largest |z| below its Bonferroni limit (family 1e-4), the sum of z² below the upper
    /// 1e-6 point of chi-square, and the p-values uniform (Kolmogorov–Smirnov, above 1e-6).
    pub fn picture(&mut self, on: impl std::fmt::Display, pixels: impl IntoIterator<Item = Known>) {
        let z: Vec<f64> = pixels.into_iter().map(|(got, expected, error)| (got - expected) / error).collect();
        let largest = z.iter().fold(0.0, |a: f64, z| if z.abs() <= a { a } else { z.abs() });
        let sum: f64 = z.iter().map(|z| z * z).sum();
        let p = ks_uniform(&z.iter().map(|&z| normal_tail(z)).collect::<Vec<_>>());
        let (z_most, sum_most) = (z_limit(z.len(), 1e-4), chi2_limit(z.len(), 1e-6));
        self.row(
            format!("{on}, {} pixels", z.len()),
            format!("|z| < {z_most:.2}, Σz² < {sum_most:.0}, p > 1e-6"),
            format!("{largest:.2}, {sum:.0}, {p:.1e}"),
            format!("{largest:.2} σ"),
            largest < z_most && sum < sum_most && p > 1e-6,
        );
    }
}
