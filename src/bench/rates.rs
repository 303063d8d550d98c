//! Rates of every backend and query mode by class of rays, each validated before it is timed.
//!
//! A mode whose hits differ from the backend's first mode in more than [`MOST_DIFFERENT`] of the rays is an error, not
//! a number. A mode that runs as another one (the pure-Rust backends always trace ray by ray) is timed once.

use std::time::{Duration, Instant};

use rayon::ThreadPool;
use serde::Serialize;

use super::agree::Agreement;
use super::record::{Batch, RayClass, Recording, count};
use super::replay::{self, Outcome};
use crate::backend::{self, Backend, BackendKind, BackendOptions, QueryMode};
use crate::error::{Error, Result};
use crate::scene::geometry::Geometry;

/// Fraction of rays that may differ between two modes of one backend. Rays at edges and grazing angles round
/// differently (3·10⁻⁵ of them on the scenes that come along); a broken mode differs in whole percents.
pub const MOST_DIFFERENT: f64 = 1e-3;

/// Rays of each class that are timed, if the scene has them.
const RAYS: u64 = 1 << 17;

/// Ray–triangle tests that one replay by `brute` may take, and the largest scene that it is asked for.
const BRUTE_TESTS: u64 = 1 << 27;
const BRUTE_TRIANGLES: u64 = 4096;

/// Least time and number of replays behind one rate.
const LEAST_TIME: Duration = Duration::from_millis(60);
const LEAST_REPLAYS: usize = 3;

/// One rate.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rate {
    /// Class of rays.
    pub class: &'static str,
    /// Query mode that was asked for.
    pub mode: &'static str,
    /// Query mode that ran.
    pub mode_effective: &'static str,
    /// Threads that traced.
    pub threads: usize,
    /// 10⁶ rays per second, median over replays.
    pub mrays_per_s: f64,
    /// Half the range of the middle half of the replays over the median.
    pub spread: f64,
}

/// What the modes of one backend were held to before they were timed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Validation {
    /// Query mode that was asked for.
    pub mode: &'static str,
    /// Against which mode of the same backend.
    pub reference: &'static str,
    /// The counts.
    #[serde(flatten)]
    pub agreement: Agreement,
}

/// One backend.
#[derive(Clone, Debug, Serialize)]
pub struct BackendRates {
    /// "embree", "obvhs", "brute".
    pub name: &'static str,
    /// Version of the library.
    pub version: String,
    /// Time to build the hierarchy with all threads, seconds; median over the modes, each of which builds it anew.
    pub build_s: f64,
    /// Bytes of the hierarchy.
    pub bvh_bytes: u64,
    /// The rates.
    pub rays: Vec<Rate>,
    /// Instruction set that ran.
    pub isa: String,
    /// Modes against each other.
    pub validation: Vec<Validation>,
    /// What the rays met in the first mode, for comparisons between backends.
    #[serde(skip)]
    pub(super) outcomes: Vec<Outcome>,
}

/// What is needed to measure a backend.
pub struct Setup<'a> {
    /// What is traced.
    pub geometry: &'a Geometry,
    /// With what.
    pub recording: &'a Recording,
    /// One thread, and all threads if those are more.
    pub pools: &'a [ThreadPool],
    /// What the render's backend was asked for; the query modes are replaced.
    pub options: &'a BackendOptions,
}

/// Why `kind` is not measured on `geometry`, if it is not.
pub fn refusal(kind: BackendKind, geometry: &Geometry) -> Option<String> {
    let triangles: u64 = geometry.triangles.len() as u64;
    (matches!(kind, BackendKind::Brute | BackendKind::Flat) && triangles > BRUTE_TRIANGLES)
        .then(|| format!("{triangles} triangles; every ray against every triangle is timed up to {BRUTE_TRIANGLES}"))
}

/// The waves that `kind` is timed and judged with: fewer for `brute`, which takes its time.
pub fn waves<'r>(kind: BackendKind, geometry: &Geometry, recording: &'r Recording) -> Vec<&'r [Batch]> {
    let affordable = match kind {
        BackendKind::Brute => BRUTE_TESTS / geometry.triangles.len().max(1) as u64 / 3,
        _ => RAYS,
    };
    let mut waves = recording.sample(affordable.min(RAYS));
    if kind == BackendKind::Brute {
        // A class with few rays must not drag millions of another along.
        while waves.len() > 1 && count(&waves).iter().sum::<u64>() > 6 * affordable {
            waves = waves.into_iter().step_by(2).collect();
        }
    }
    waves
}

/// Builds, validates and times every mode of `kind`.
///
/// # Errors
/// [`Error::Backend`] when it cannot be built, or when two of its modes do not agree.
pub fn measure(kind: BackendKind, setup: &Setup) -> Result<BackendRates> {
    let waves = waves(kind, setup.geometry, setup.recording);
    let classes = count(&waves);
    let mut result: Option<BackendRates> = None;
    let (mut builds, mut done) = (Vec::new(), Vec::new());
    for mode in QueryMode::ALL {
        // What a mode runs as is known without the scene.
        let options = |threads| BackendOptions {
            isa: setup.options.isa.clone().filter(|isa| kind.pins(isa)),
            robust: setup.options.robust,
            build_threads: threads,
            ..BackendOptions::with_mode(mode)
        };
        let effective = backend::select::build(kind, &Geometry::default(), &options(1))?.info().rays_incoherent;
        if done.contains(&effective) {
            continue;
        }
        done.push(effective);

        let all = setup.pools.last().map_or(1, |pool| pool.current_num_threads());
        let start = Instant::now();
        let backend = backend::select::build(kind, setup.geometry, &options(all))?;
        builds.push(start.elapsed().as_secs_f64());
        let outcomes = replay::outcomes(backend.as_ref(), &waves);
        let result = result.get_or_insert_with(|| BackendRates {
            name: kind.name(),
            version: backend.info().version.clone(),
            build_s: 0.0,
            bvh_bytes: backend.info().bvh_bytes,
            rays: Vec::new(),
            isa: backend.info().isa.clone(),
            validation: Vec::new(),
            outcomes: outcomes.clone(),
        });
        if let Some(first) = result.rays.first() {
            let agreement = Agreement::of(&waves, &outcomes, &result.outcomes);
            if agreement.fraction() > MOST_DIFFERENT {
                let problem = format!(
                    "query mode {mode} is not timed: {} of {} rays hit, and {} lie, elsewhere than with {}",
                    agreement.hit_differs, agreement.rays, agreement.distance_differs, first.mode
                );
                return Err(Error::Backend { backend: kind.name(), problem });
            }
            result.validation.push(Validation { mode: mode.name(), reference: first.mode, agreement });
        }
        for class in RayClass::ALL.into_iter().filter(|class| classes[*class as usize] > 0) {
            for pool in setup.pools {
                let (mrays_per_s, spread) = rate(backend.as_ref(), &waves, class, pool);
                let threads = pool.current_num_threads();
                let mode = mode.name();
                result.rays.push(Rate {
                    class: class.name(),
                    mode,
                    mode_effective: effective,
                    threads,
                    mrays_per_s,
                    spread,
                });
            }
        }
    }
    let mut result = result.expect("there is at least one mode");
    result.build_s = median(&mut builds);
    Ok(result)
}

/// Median rate and its spread, after one replay that warms the caches.
fn rate(backend: &dyn Backend, waves: &[&[Batch]], class: RayClass, pool: &ThreadPool) -> (f64, f64) {
    replay::replay(backend, waves, Some(class), pool);
    let start = Instant::now();
    let mut rates = Vec::new();
    while rates.len() < LEAST_REPLAYS || start.elapsed() < LEAST_TIME {
        rates.push(replay::replay(backend, waves, Some(class), pool).mrays_per_s(class, pool.current_num_threads()));
    }
    let middle = median(&mut rates);
    // Sorted by now.
    let quarter = rates.len() / 4;
    (middle, 0.5 * (rates[rates.len() - 1 - quarter] - rates[quarter]) / middle)
}

/// The median; sorts. NaN for an empty list.
pub fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    match values.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => values[n / 2],
        n => 0.5 * (values[n / 2 - 1] + values[n / 2]),
    }
}

#[cfg(test)]
mod tests {
    use super::median;

    #[test]
    fn medians_of_odd_and_even_lists() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&mut [4.0, 1.0, 2.0, 3.0]), 2.5);
        assert!(median(&mut []).is_nan());
    }
}
