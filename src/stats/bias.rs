//! The measured part of the ledger of biases. The plan's entries come first, the depth limit with what it removed; then
//! what only a render can tell: samples that were not finite, rays that were refused.
//!
//! The depth limit. W is the mean over camera samples of what capped paths still carried (`transport::truncation`). If
//! the light that reaches their last vertices is in the mean as bright as what reaches the camera, the picture lacks W
//! times its true energy: with I the measured mean, W·I/(1 − W) by channel. In a furnace that is exact (HARDCASES
//! P03). The bound takes the largest radiance there can be instead of the mean (`plan::bias`), and the 95 % point of
//! the number of capped paths instead of the number, so that a render that met none still says how many it could have
//! missed.

use crate::film::Film;
use crate::film::exr::through_half;
use crate::plan::RenderPlan;
use crate::plan::bias::Bias;
use crate::render::Render;
use crate::stats::denoise::DenoiseStats;

/// One-sided 95 % point of the normal distribution.
const NORMAL_95_ONE_SIDED: f64 = 1.644854;

/// The ledger of a finished render.
pub fn ledger(plan: &RenderPlan, render: &Render) -> Vec<Bias> {
    let counters = &render.counters;
    let mut ledger = plan.bias.clone();
    if let Some(depth) = ledger.first_mut() {
        measure_depth(depth, plan, render);
    }
    if counters.nonfinite > 0 {
        let what = format!("{} of {} samples were not finite and count as 0", counters.nonfinite, counters.paths);
        ledger.push(Bias::unmeasured(what));
    }
    if counters.invalid_rays > 0 {
        let what = format!("{} of {} rays were not finite and count as misses", counters.invalid_rays, counters.rays());
        ledger.push(Bias::unmeasured(what));
    }
    ledger
}

/// What storing `film` in 16 bits removes, exact: the picture's sum before and after. Negative where rounding adds.
pub fn half(film: &Film) -> Bias {
    let sum = |of: &dyn Fn(f64) -> f64| film.pixels.iter().flat_map(|p| p.mean()[..3].to_vec()).map(of).sum::<f64>();
    let (before, after) = (sum(&|v| v), sum(&through_half));
    let removed = Some(1.0 - after / before).filter(|share| share.is_finite());
    Bias { energy_removed: removed, energy_removed_at_most: removed, ..Bias::unmeasured("half: stored in 16 bits") }
}

/// What a filter did to the layer that it made, measured; the beauty is not touched.
pub fn denoised(stats: &DenoiseStats) -> Bias {
    let measured = stats.told().map_or("error not measured".into(), |told| format!("relative RMSE {told}"));
    let what = format!("denoise, layer 'denoised' alone: {}, {measured}", stats.filter);
    Bias {
        energy_removed: stats.energy_removed,
        energy_removed_at_most: stats.energy_removed,
        ..Bias::unmeasured(what)
    }
}

fn measure_depth(depth: &mut Bias, plan: &RenderPlan, render: &Render) {
    let counters = &render.counters;
    if counters.paths == 0 {
        return;
    }
    let n = counters.paths as f64;
    let carried = counters.truncated.carried().map(|sum| sum / n);
    let mean = render.film.mean();
    let image: [f64; 3] = std::array::from_fn(|c| mean[c].max(0.0));
    depth.energy_removed = share_removed(image, std::array::from_fn(|c| carried[c] * image[c] / (1.0 - carried[c])));

    // As many paths as could have been met, each carrying as much as those that were; without any, all a path can.
    let met = counters.truncated.paths as f64;
    let most = poisson_upper(met).min(n);
    let most_carried = |c: usize| if met > 0.0 { carried[c] * most / met } else { most / n };
    depth.energy_removed_at_most = plan
        .radiance_bound
        .and_then(|largest| share_removed(image, std::array::from_fn(|c| most_carried(c) * largest[c])));
}

/// `removed` as a share of what there would be with it; `None` where that is nothing, or not a number.
fn share_removed(image: [f64; 3], removed: [f64; 3]) -> Option<f64> {
    let (image, removed): (f64, f64) = (image.iter().sum(), removed.iter().sum());
    let share = removed / (image + removed);
    (share.is_finite() && (0.0..=1.0).contains(&share)).then_some(share)
}

/// 95 % upper bound of the mean of a Poisson variable that came out as `count` (Wilson–Hilferty; 2.97 for 0, exact
/// 3.00).
fn poisson_upper(count: f64) -> f64 {
    let next = count + 1.0;
    next * (1.0 - 1.0 / (9.0 * next) + NORMAL_95_ONE_SIDED / (3.0 * next.sqrt())).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: exact 95 % bounds, half the χ² quantile of 2n + 2 degrees.
    #[test]
    fn poisson_bounds_are_those_of_the_tables() {
        for (count, exact) in [(0.0, 2.9957), (1.0, 4.7439), (10.0, 16.962), (100.0, 118.08)] {
            assert!((poisson_upper(count) / exact - 1.0).abs() < 0.01, "{count}: {}", poisson_upper(count));
        }
    }

    #[test]
    fn shares_of_nothing_are_not_known() {
        assert_eq!(share_removed([0.0; 3], [0.0; 3]), None);
        assert_eq!(share_removed([1.0; 3], [1.0; 3]), Some(0.5));
        assert_eq!(share_removed([1.0; 3], [f64::INFINITY; 3]), None);
    }
}
