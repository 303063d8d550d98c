//! What a study found: numbers with intervals, as the record behind `report.json`, `report.csv`, the table and the
//! page. Keys are a contract: add, never rename. Errors are relative RMSE or relMSE; times are seconds; an
//! interval is of 95 %, and `null` where there are too few runs for one.

use serde::Serialize;

use super::classes::Classes;
use super::effects::EffectRow;
use super::findings::{Run, Series, Study};
use super::reference::Reference;
use super::runs::{self, Interval, Line};
use super::settings::Role;
use crate::accuracy::predict::Predicted;
use crate::film::exr::through_half;
use crate::film::layer::bounces::LENGTHS;

/// A metric that rests on one pixel for more than this share says little (HARDCASES §6.2).
const UNRELIABLE_SHARE: f64 = 0.1;

/// A time that is known no better than this, as the ratio of the ends of its interval, is not quoted.
const VAGUE: f64 = 50.0;

/// Everything, in the order of the page.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Version of these keys.
    pub schema: u32,
    /// What was studied, and on what.
    pub setup: Setup,
    /// What everything was compared with.
    pub reference: Option<ReferenceRecord>,
    /// The price list.
    pub prices: Vec<PriceRecord>,
    /// Slope of ln relMSE against ln spp that the price list stands on, and its standard error.
    pub pilot_slope: Option<[f64; 2]>,
    /// Default, techniques, knobs.
    pub settings: Vec<Row>,
    /// Path lengths; `None` before the first round.
    pub lengths: Option<Lengths>,
    /// Where the noise comes from; `None` where that was not asked for.
    pub classes: Option<Classes>,
    /// Prices of effects; `None` where they were not asked for.
    pub effects: Option<Vec<EffectRow>>,
    /// Whether a signal ended it early.
    pub interrupted: bool,
    /// What a reader must know to read the numbers.
    pub notes: Vec<String>,
}

/// What was studied, and on what. The command line knows most of it.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Setup {
    /// Version of the program.
    pub version: String,
    /// Scene file.
    pub scene: String,
    /// Columns and rows.
    pub resolution: [u32; 2],
    /// Columns and rows that `render` would choose.
    pub render_resolution: [u32; 2],
    /// Worker threads.
    pub threads: usize,
    /// Name of the processor.
    pub cpu: String,
    /// Ray backend of the default setting: name, version, instruction set, modes.
    pub backend: String,
    /// Options of the default setting that differ from those of `render`.
    pub options: String,
    /// Load per processor of the machine over the last minute, at the end; `null` where it does not say.
    pub load: Option<f64>,
    /// Wall time asked for.
    pub budget_s: f64,
    /// Wall time taken.
    pub seconds: f64,
    /// Load and build.
    pub fixed_s: f64,
    /// Wall time of one estimate of the error by the film; `null` where the pilot has none.
    pub estimate_s: Option<f64>,
    /// Seeds: of the pilot, of the first run, of the first run of the reference.
    pub seeds: [u64; 3],
    /// Price of a core for an hour, if one was given.
    pub price_per_core_hour: Option<f64>,
}

/// The reference.
#[derive(Clone, Debug, Serialize)]
pub struct ReferenceRecord {
    /// File, or "own".
    pub what: String,
    /// Independent runs; 1 for a file.
    pub runs: usize,
    /// Samples per pixel of each; 0 for a file.
    pub spp: u64,
    /// relMSE of the reference itself, which is subtracted; `None` where it is not known.
    pub own_relmse: Option<Interval>,
    /// ε of relMSE.
    pub epsilon: f64,
}

/// A line of the price list.
#[derive(Clone, Debug, Serialize)]
pub struct PriceRecord {
    /// Relative RMSE.
    pub error: f64,
    /// Samples per pixel, predicted.
    pub spp: Interval,
    /// Wall time in all, predicted.
    pub seconds: Interval,
    /// What a run took and reached.
    pub measured: Option<MeasuredRecord>,
    /// Why only the lower ends of the intervals are to be relied on; `null` where both are.
    pub caution: Option<&'static str>,
}

/// A measured line of the price list.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct MeasuredRecord {
    /// Samples per pixel.
    pub spp: u64,
    /// Wall time in all.
    pub seconds: f64,
    /// Relative RMSE against the reference; `None` where the reference's own error is of the same size.
    pub error: Option<f64>,
    /// Relative RMSE as the film itself estimates it.
    pub estimated: Option<Interval>,
    /// Energy of the processor while it rendered, joules; `None` where that cannot be read.
    pub joules: Option<f64>,
    /// Price of the threads for that time; `None` where no price was given.
    pub money: Option<f64>,
}

/// A setting.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// How it differs from the default.
    pub name: String,
    /// What it is.
    pub role: Role,
    /// Samples per pixel of the runs that the numbers below come from.
    pub spp: u64,
    /// How many.
    pub runs: usize,
    /// relMSE against the reference, its own subtracted.
    pub relmse: Option<Interval>,
    /// Slope of ln relMSE against ln spp: value and standard error. Techniques only.
    pub slope: Option<[f64; 2]>,
    /// Processor seconds of a sample of every pixel.
    pub cpu_s_per_spp: Option<Interval>,
    /// Wall seconds of a sample of every pixel.
    pub wall_s_per_spp: Option<Interval>,
    /// Processor time over that of the default, runs of one round against each other.
    pub time_ratio: Option<Interval>,
    /// 1/(relMSE · processor time) over that of the default, at equal samples.
    pub efficiency: Option<Interval>,
    /// Whether the interval of `efficiency` contains 1.
    pub no_measurable_difference: bool,
    /// Wall time to a relative RMSE of 1 %; `None` where it is never reached or not known.
    pub seconds_to_1_percent: Option<Interval>,
    /// Mean of the picture minus that of the default (for the default: of the reference), over the reference's.
    pub mean_error: Option<Interval>,
    /// relMSE of the expected picture against that of the default (for the default: the reference), without noise.
    pub bias_squared: Option<Interval>,
    /// Relative error that 50, 95 and 99.9 % of the pixels stay below, mean over the runs.
    pub percentiles: [f64; 3],
    /// HDR-FLIP against the reference: mean and its spread over runs. Of the displayed picture, not an error bar.
    pub flip: Option<Interval>,
    /// Whether one pixel carries more than a tenth of relMSE in some run: intervals are then too narrow.
    pub unreliable: bool,
    /// Camera, bounce and shadow rays of a run, mean.
    pub rays: [f64; 3],
    /// Paths ended by the depth limit in a run, mean.
    pub capped_paths: f64,
    /// Samples that were not finite, all runs.
    pub nonfinite: u64,
    /// Points of the plot: samples per pixel, wall seconds of rendering (median), relMSE.
    pub curve: Vec<CurvePoint>,
}

/// A number of samples of a technique.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct CurvePoint {
    /// Samples per pixel.
    pub spp: u64,
    /// Wall seconds of rendering.
    pub seconds: f64,
    /// relMSE.
    pub relmse: Interval,
}

/// What each length of path carries.
#[derive(Clone, Debug, Serialize)]
pub struct Lengths {
    /// Share of the mean radiance of paths of 1, 2, … edges; the last entry is all longer ones.
    pub share: Vec<Interval>,
    /// Relative mean error of a depth limit of 1, 2, … edges: what it leaves out, negative.
    pub truncation: Vec<Interval>,
    /// Estimated relative mean error of the default's own depth limit, by a geometric tail.
    pub default_truncation: f64,
}

impl Report {
    /// From what was measured, without notes. `reference` names a given one.
    pub(super) fn of_figures(study: &Study, setup: Setup, reference: Option<String>) -> Self {
        let record = study.reference.as_ref().map(|r| ReferenceRecord {
            what: reference.unwrap_or_else(|| "own".into()),
            runs: r.run_means.len(),
            spp: study.reference_spp,
            own_relmse: r.own_relmse,
            epsilon: r.epsilon,
        });
        Report {
            schema: 1,
            reference: record,
            prices: prices(study, setup.price_per_core_hour.map(|price| price * setup.threads as f64 / 3600.0)),
            pilot_slope: study.prediction.map(|p| [-p.slope, p.slope_error]),
            settings: study.reference.as_ref().map_or(Vec::new(), |r| rows(study, r)),
            lengths: lengths(study),
            classes: study.classes.clone(),
            effects: study.series.is_empty().then(|| study.effects.clone()),
            interrupted: study.interrupted,
            notes: Vec::new(),
            setup,
        }
    }
}

fn interval_of(value: f64, [low, high]: [f64; 2]) -> Interval {
    Interval { value, low, high }
}

/// The price list; `per_s` is the price of all threads for a second.
fn prices(study: &Study, per_s: Option<f64>) -> Vec<PriceRecord> {
    let own = study.reference.as_ref().and_then(|r| r.own_relmse);
    let record = |price: &super::findings::Price| {
        let Predicted { spp, seconds, spp_interval, seconds_interval, .. } = price.predicted;
        let measured = price.measured.map(|m| MeasuredRecord {
            spp: m.spp,
            seconds: m.seconds,
            // Subtracting two thirds of what was measured leaves mostly noise.
            error: m.relmse.filter(|r| own.is_none_or(|own| *r > 0.5 * own.value)).map(f64::sqrt),
            estimated: m.estimated.map(|(relmse, interval)| interval_of(relmse, interval).map(f64::sqrt)),
            joules: m.joules,
            money: per_s.map(|per_s| per_s * m.seconds),
        });
        let (spp, seconds) = (interval_of(spp, spp_interval), interval_of(seconds, seconds_interval));
        PriceRecord { error: price.error, spp, seconds, measured, caution: price.predicted.caution() }
    };
    study.prices.iter().map(record).collect()
}

fn rows(study: &Study, reference: &Reference) -> Vec<Row> {
    let Some(default) = study.series.first() else { return Vec::new() };
    let mut rows: Vec<Row> = study
        .series
        .iter()
        .filter(|series| !series.pictures.is_empty())
        .map(|series| row(study, reference, default, series))
        .collect();
    if let Some(half) = half_row(study, reference, default, rows.first()) {
        rows.push(half);
    }
    rows
}

fn row(study: &Study, reference: &Reference, default: &Series, series: &Series) -> Row {
    let top: Vec<&Run> = series.runs.iter().filter(|run| run.spp == study.top_spp).collect();
    let own: Vec<&Run> = default.runs.iter().filter(|run| run.spp == study.top_spp).collect();
    let is_default = series.setting.role == Role::Default;
    let n = top.len() as f64;
    let of = |f: &dyn Fn(&Run) -> f64| runs::mean(&top.iter().map(|run| f(run)).collect::<Vec<f64>>());
    let average = |f: &dyn Fn(&Run) -> f64| top.iter().map(|run| f(run)).sum::<f64>() / n;
    let spp = study.top_spp as f64;

    let curve = curve(series);
    let fit = (series.setting.role != Role::Knob).then(|| slope(series)).flatten();
    let wall_s_per_spp = of(&|run| run.cost.wall_s / spp);
    let efficiency = (!is_default).then(|| per_round(&own, &top, true)).flatten();
    let (mean_error, bias_squared) =
        if is_default { against_reference(reference, default) } else { against_default(reference, default, series) };
    let bias = bias_squared.filter(|bias| bias.low > 0.0);
    let reaches = bias.is_none_or(|bias| bias.low < 1e-4);
    let to_target = fit.filter(|_| reaches).and_then(|line| line.solve_falling((1e-4f64).ln()));
    Row {
        name: series.setting.name.clone(),
        role: series.setting.role,
        spp: study.top_spp,
        runs: top.len(),
        relmse: of(&|run| run.difference.relmse),
        slope: fit.map(|line| [line.slope, line.slope_error]),
        cpu_s_per_spp: of(&|run| run.cost.cpu_s / spp),
        seconds_to_1_percent: to_target
            .zip(wall_s_per_spp)
            .map(|(log_spp, wall)| log_spp.map(|x| study.fixed_s + x.exp() * wall.value))
            .filter(|s| s.high < VAGUE * s.low),
        wall_s_per_spp,
        time_ratio: (!is_default).then(|| per_round(&top, &own, false)).flatten(),
        no_measurable_difference: efficiency.is_some_and(|e| e.contains(1.0)),
        efficiency,
        mean_error,
        bias_squared,
        percentiles: [0, 1, 2].map(|i| average(&|run| run.difference.percentiles[i])),
        flip: of(&|run| run.flip.unwrap_or(f64::NAN)),
        unreliable: top.iter().any(|run| run.difference.largest_share > UNRELIABLE_SHARE),
        rays: [0, 1, 2].map(|i| average(&|run| run.rays[i] as f64)),
        capped_paths: average(&|run| run.capped_paths as f64),
        nonfinite: series.runs.iter().map(|run| run.nonfinite).sum(),
        curve,
    }
}

/// Ratio of summed cost, or of error times cost, of the runs of each round; interval over rounds.
fn per_round(above: &[&Run], below: &[&Run], with_error: bool) -> Option<Interval> {
    let sum = |list: &[&Run], round: usize| -> Option<f64> {
        let runs: Vec<_> = list.iter().filter(|run| run.index / 2 == round).collect();
        let cost: f64 = runs.iter().map(|run| run.cost.cpu_s).sum();
        let error: f64 = runs.iter().map(|run| run.difference.relmse).sum();
        (runs.len() == 2).then_some(if with_error { error * cost } else { cost })
    };
    let rounds = above.len().min(below.len()) / 2;
    let ratios: Vec<f64> = (0..rounds).filter_map(|round| Some(sum(above, round)? / sum(below, round)?)).collect();
    runs::geometric_mean(&ratios)
}

/// The line of ln relMSE over ln spp through single runs, whose seeds all differ.
fn slope(series: &Series) -> Option<Line> {
    let point = |run: &Run| ((run.spp as f64).ln(), run.difference.relmse.ln());
    runs::line(&series.runs.iter().map(point).filter(|p| p.1.is_finite()).collect::<Vec<_>>())
}

fn curve(series: &Series) -> Vec<CurvePoint> {
    let mut spps: Vec<u64> = series.runs.iter().map(|run| run.spp).collect();
    spps.sort_unstable();
    spps.dedup();
    let point = |spp: u64| {
        let of =
            |f: &dyn Fn(&Run) -> f64| -> Vec<f64> { series.runs.iter().filter(|run| run.spp == spp).map(f).collect() };
        let relmse = runs::mean(&of(&|run| run.difference.relmse))?;
        // The middle one: other work on the machine stretches single runs.
        let mut seconds = of(&|run| run.cost.wall_s);
        seconds.sort_unstable_by(f64::total_cmp);
        Some(CurvePoint { spp, seconds: seconds[seconds.len() / 2], relmse })
    };
    spps.into_iter().filter_map(point).collect()
}

/// Bias of the default against the reference: by Welch for the mean, by products of runs for the square.
fn against_reference(reference: &Reference, default: &Series) -> (Option<Interval>, Option<Interval>) {
    let means: Vec<f64> = default.pictures.iter().map(|p| mean_of(p) / reference.mean).collect();
    let own: Vec<f64> = reference.run_means.iter().map(|m| m / reference.mean).collect();
    let mean = match (runs::mean(&means), runs::mean(&own)) {
        (Some(ours), Some(theirs)) if own.len() > 1 => Some(Interval::around(
            ours.value - theirs.value,
            (ours.high - ours.value).hypot(theirs.high - theirs.value),
        )),
        (ours, _) => ours.map(|m| m.map(|v| v - 1.0)),
    };
    let difference = |picture: &Vec<f32>| -> Vec<f32> {
        picture.iter().zip(&reference.values).map(|(v, r)| (f64::from(*v) - r) as f32).collect()
    };
    let differences: Vec<Vec<f32>> = default.pictures.iter().map(difference).collect();
    let square = runs::bias_squared(&differences, &reference.weights);
    (mean, square.map(|s| s.map(|v| v - reference.own())))
}

/// Bias against the default, from runs of equal seeds.
fn against_default(reference: &Reference, default: &Series, series: &Series) -> (Option<Interval>, Option<Interval>) {
    let pairs = series.pictures.iter().zip(&default.pictures);
    let differences: Vec<Vec<f32>> = pairs.map(|(y, x)| y.iter().zip(x).map(|(y, x)| y - x).collect()).collect();
    of_differences(reference, &differences)
}

fn of_differences(reference: &Reference, differences: &[Vec<f32>]) -> (Option<Interval>, Option<Interval>) {
    let means: Vec<f64> = differences.iter().map(|d| mean_of(d) / reference.mean).collect();
    (runs::mean(&means), runs::bias_squared(differences, &reference.weights))
}

/// The default's pictures as a file of 16 bits would hold them. Rendering is the same, so only the bias is measured.
fn half_row(study: &Study, reference: &Reference, default: &Series, like: Option<&Row>) -> Option<Row> {
    let rounded = |v: &f32| through_half(f64::from(*v)) as f32;
    let halves: Vec<Vec<f32>> = default.pictures.iter().map(|p| p.iter().map(rounded).collect()).collect();
    let pairs = halves.iter().zip(&default.pictures);
    let differences: Vec<Vec<f32>> = pairs.map(|(y, x)| y.iter().zip(x).map(|(y, x)| y - x).collect()).collect();
    let (mean_error, bias_squared) = of_differences(reference, &differences);
    let relmse: Vec<f64> = halves.iter().map(|p| reference.difference(p).relmse).collect();
    like.map(|like| Row {
        name: "--half".into(),
        role: Role::Knob,
        spp: study.top_spp,
        relmse: runs::mean(&relmse),
        slope: None,
        time_ratio: None,
        efficiency: None,
        no_measurable_difference: false,
        seconds_to_1_percent: None,
        mean_error,
        bias_squared,
        flip: None,
        curve: Vec::new(),
        ..like.clone()
    })
}

fn mean_of(values: &[f32]) -> f64 {
    values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len().max(1) as f64
}

fn lengths(study: &Study) -> Option<Lengths> {
    let totals: Vec<f64> = study.lengths.iter().map(|l| l.iter().sum()).collect();
    let over_runs = |f: &dyn Fn(&[f64; LENGTHS]) -> f64| {
        let values: Vec<f64> = study.lengths.iter().zip(&totals).map(|(l, total)| f(l) / total).collect();
        runs::mean(&values)
    };
    let share: Option<Vec<Interval>> = (1..LENGTHS).map(|edge| over_runs(&|l| l[edge])).collect();
    // The last entry holds all longer paths, so what a limit of one edge less leaves out is still known.
    let left_out = |depth: usize| over_runs(&|l| -l[depth + 1..].iter().sum::<f64>());
    let truncation: Option<Vec<Interval>> = (1..LENGTHS - 1).map(left_out).collect();
    let (share, truncation) = (share?, truncation?);
    // Beyond the last entry each length is taken to carry the same share of the one before.
    let [before, last] = [truncation[LENGTHS - 4].value, truncation[LENGTHS - 3].value];
    let ratio = if before < 0.0 { (last / before).clamp(0.0, 1.0) } else { 0.0 };
    let depth = study.series.first()?.setting.options.max_depth as usize;
    let default_truncation = match depth {
        0 => -1.0,
        d if d < LENGTHS - 1 => truncation[d - 1].value,
        d => last * ratio.powi((d - (LENGTHS - 2)) as i32),
    };
    Some(Lengths { share, truncation, default_truncation })
}
