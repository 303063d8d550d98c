//! The hard cases: numerical traps with known answers, one test a case, one file a theme. Each case opens a [`Case`],
//! adds a row for each backend or variant that it runs on, and closes it; a row says what was expected, what came out,
//! and how far apart they are. `make hard` prints all rows as one table and writes it to `tests/HARD.md`.
//!
//! Limits: means within 4.9 standard errors (two-sided 10⁻⁶) and able to see a bias of a stated size; deterministic
//! numbers within a stated bound; counts and bits exactly. Seeds are fixed: a verdict never flakes.

mod accumulation;
mod alpha;
mod area_lights;
mod degenerate;
mod environment;
mod filters;
mod frames;
mod fresnel;
mod furnace;
mod glass;
mod grazing;
mod indices;
mod input;
mod invariance;
mod lens;
mod lobes;
mod many_lights;
mod microfacet;
mod mis;
mod modes;
mod normals;
mod poses;
mod random;
mod receiver;
mod reproducible;
pub mod room;
mod roulette;
mod shutter;
mod solid_angle;
mod spawn;
mod spheres;
mod table;
mod transforms;
mod volumes;
mod watertight;
mod ways;
mod white_furnace;

use std::fmt::Display;
use std::path::PathBuf;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use crate::common::Estimate;

/// Set by `make hard`: the folder that takes one JSON file a case.
const REPORT: &str = "PATHSPACE_HARD";

/// One case of the suite, while it runs.
#[must_use = "a case is judged by close()"]
pub struct Case {
    record: Record,
    started: Instant,
}

/// What is written down of a case.
#[derive(Serialize, Deserialize)]
struct Record {
    /// The case's name in the specification, as `G01`.
    id: String,
    name: String,
    stresses: String,
    seconds: f64,
    rows: Vec<Row>,
}

/// One verdict.
#[derive(Serialize, Deserialize)]
struct Row {
    /// Backend and query mode as `embree/packet16`, or the variant; `-` where nothing is traced.
    on: String,
    expected: String,
    got: String,
    /// With its unit: σ, ulp, relative.
    difference: String,
    passed: bool,
}

impl Case {
    /// Starts the clock of case `id`.
    pub fn open(id: &str, name: &str, stresses: &str) -> Self {
        let record =
            Record { id: id.into(), name: name.into(), stresses: stresses.into(), seconds: 0.0, rows: Vec::new() };
        Case { record, started: Instant::now() }
    }

    /// A verdict in the case's own words.
    pub fn row(
        &mut self,
        on: impl Display,
        expected: impl Display,
        got: impl Display,
        difference: impl Display,
        ok: bool,
    ) {
        self.record.rows.push(Row {
            on: on.to_string(),
            expected: expected.to_string(),
            got: got.to_string(),
            difference: difference.to_string(),
            passed: ok,
        });
    }

    /// T7: a count has to be exactly `expected`.
    pub fn count(&mut self, on: impl Display, expected: u64, got: u64) {
        self.row(on, expected, got, got.abs_diff(expected), got == expected);
    }

    /// T5: bits that have to be the same; `differing` is how many values were not.
    pub fn bits(&mut self, on: impl Display, differing: usize) {
        self.row(
            on,
            "same bits",
            if differing == 0 { "same bits" } else { "other bits" },
            format!("{differing} values"),
            differing == 0,
        );
    }

    /// T6: `got` within `bound` of `expected`, relative to it, or absolute where it is 0. A row per number.
    pub fn number(&mut self, on: impl Display, expected: f64, got: f64, bound: f64) {
        let scale = if expected == 0.0 { 1.0 } else { expected.abs() };
        let difference = (got - expected).abs() / scale;
        self.row(on, short(expected), short(got), format!("{difference:.1e} (bound {bound:.1e})"), difference <= bound);
    }

    /// T6 over many numbers: the worst of `pairs` (expected, got, bound on the relative difference) stands for all.
    pub fn numbers(&mut self, on: impl Display, pairs: impl IntoIterator<Item = (f64, f64, f64)>) {
        let excess = |&(e, g, b): &(f64, f64, f64)| {
            let ratio = (g - e).abs() / (if e == 0.0 { 1.0 } else { e.abs() }) / b.max(f64::MIN_POSITIVE);
            if ratio.is_nan() { f64::INFINITY } else { ratio }
        };
        let pairs: Vec<_> = pairs.into_iter().collect();
        let worst = pairs.iter().copied().max_by(|a, b| excess(a).total_cmp(&excess(b))).expect("at least one number");
        self.number(format!("{on}, worst of {}", pairs.len()), worst.0, worst.1, worst.2);
    }

    /// T1: a mean within 4.9 standard errors plus `tau` of `expected`, in each channel, and able to see a relative bias
    /// of `delta`. The worst channel stands for all.
    pub fn mean(&mut self, on: impl Display, expected: [f64; 3], tau: f64, delta: f64, estimate: &Estimate) {
        let z = |c: usize| {
            let excess = ((estimate.mean[c] - expected[c]).abs() - tau).max(0.0);
            if excess == 0.0 { 0.0 } else { excess / estimate.standard_error(c) }
        };
        let worst = (0..3).max_by(|&a, &b| z(a).total_cmp(&z(b))).unwrap_or(0);
        let sees = (0..3).all(|c| 4.9 * estimate.standard_error(c) <= delta * expected[c].abs());
        let got = format!("{} ± {:.1e}", short(estimate.mean[worst]), estimate.standard_error(worst));
        let difference = format!("{:.2} σ{}", z(worst), if sees { "" } else { ", too noisy to judge" });
        self.row(on, short(expected[worst]), got, difference, z(worst) <= 4.9 && sees);
    }

    /// Writes the rows down if `make hard` asks for it, and panics with those that failed.
    pub fn close(mut self) {
        self.record.seconds = self.started.elapsed().as_secs_f64();
        if let Some(folder) = std::env::var_os(REPORT).map(PathBuf::from) {
            let text = serde_json::to_string_pretty(&self.record).expect("rows are plain text");
            std::fs::write(folder.join(format!("{}.json", self.record.id)), text).expect("the report's folder");
        }
        let failed: Vec<_> = self.record.rows.iter().filter(|row| !row.passed).collect();
        assert!(!self.record.rows.is_empty(), "{}: nothing was judged", self.record.id);
        let said =
            |row: &&Row| format!("  {}: expected {}, got {}, {}\n", row.on, row.expected, row.got, row.difference);
        assert!(
            failed.is_empty(),
            "{} {}: {} of {} rows failed\n{}",
            self.record.id,
            self.record.name,
            failed.len(),
            self.record.rows.len(),
            failed.iter().map(said).collect::<String>()
        );
    }
}

/// A number in at most ten significant digits.
fn short(x: f64) -> String {
    if x == 0.0 || (1e-4..1e7).contains(&x.abs()) {
        let text = format!("{x:.10}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        format!("{x:.9e}")
    }
}
