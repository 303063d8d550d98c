//! What people read: warnings, steps and the summary, all on stderr, one fact a line, no colour. A closed stderr is not
//! an error.

use std::fmt::Display;
use std::io::Write;

use crate::machine::Processor;
use crate::plain::plain;
use crate::scene::Warning;
use crate::stats::denoise::DenoiseStats;
use crate::stats::{Stats, TailStats};

/// Share of the energy from which a bias is printed without `-v`: it would show in a comparison of means.
const BIAS_TOLD: f64 = 1e-3;

/// What to do about instruction sets that this binary was not compiled for.
pub const TARGET_CPU: &str = "this binary was compiled for less; build with RUSTFLAGS='-C target-cpu=x86-64-v3'";

/// How much is printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verbosity {
    /// Errors only.
    Quiet,
    /// Warnings, progress, summary.
    Normal,
    /// Also the plan, the backend and the times of each step.
    Verbose,
}

impl Verbosity {
    /// From `-q` and `-v`.
    pub fn of(quiet: bool, verbose: bool) -> Self {
        match (quiet, verbose) {
            (true, _) => Verbosity::Quiet,
            (_, true) => Verbosity::Verbose,
            _ => Verbosity::Normal,
        }
    }

    /// Prints a line, unless quiet.
    pub fn note(self, line: impl Display) {
        if self >= Verbosity::Normal {
            stderr_line(line);
        }
    }

    /// Prints a line when verbose.
    pub fn detail(self, line: impl Display) {
        if self >= Verbosity::Verbose {
            stderr_line(line);
        }
    }

    /// Prints warnings, unless quiet.
    pub fn warnings(self, warnings: &[Warning]) {
        for warning in warnings {
            self.note(format_args!("pathspace: warning: {}: {}", warning.place, warning.what));
        }
    }

    /// Prints what each known bias removed: always from [`BIAS_TOLD`] on, else when verbose.
    fn biases(self, stats: &Stats) {
        for bias in &stats.bias {
            let percent =
                |share: Option<f64>| share.map_or("unknown".into(), |share| format!("{:.2e} %", 100.0 * share));
            let (removed, most) = (percent(bias.energy_removed), percent(bias.energy_removed_at_most));
            let line = format!("bias {}: energy removed {removed}, at most {most}", bias.what);
            if bias.energy_removed.is_some_and(|share| share >= BIAS_TOLD) {
                self.note(line)
            } else {
                self.detail(line)
            }
        }
    }

    /// Prints how a render went, of that `part` of the samples or of all: a line for people, and the rest when verbose.
    pub fn summary(self, stats: &Stats, written: &[String], part: Option<(u64, u64)>) {
        let s = &stats.seconds;
        if !written.is_empty() {
            self.note(closing(stats, written, part));
        }
        self.detail(format_args!(
            "render {:.2} s, {} paths, {:.1} Mrays/s; stopped by {}",
            s.render,
            count(stats.paths),
            stats.mrays_per_s,
            stats.stop
        ));
        if let Some(error) = &stats.error {
            let percent = |relmse: f64| 100.0 * relmse.sqrt();
            self.detail(format_args!(
                "estimated relative RMSE {:.2} % (95 %: {:.2} to {:.2} %), relMSE {:.3e}",
                percent(error.relmse),
                percent(error.interval[0]),
                percent(error.interval[1]),
                error.relmse
            ));
            if let Some(target) = error.target {
                self.detail(format_args!(
                    "asked for {:.2} %; this picture is within {:.2} % with {:.0} % confidence",
                    100.0 * target,
                    100.0 * error.limit,
                    100.0 * error.limit_confidence
                ));
            }
            if !error.reliable {
                self.detail(format_args!(
                    "interval unreliable: few pixels carry the error, one of them {:.0} %; render more samples or \
                     pixels",
                    100.0 * error.largest_share
                ));
            }
            let half = |c: usize| (error.mean_interval[c][1] - error.mean_interval[c][0]) / 2.0;
            let [r, g, b] = std::array::from_fn(|c| format!("{:.4e} ± {:.1e}", error.mean[c], half(c)));
            self.detail(format_args!("mean radiance (95 %): {r}, {g}, {b} W/(sr·m²)"));
        }
        if let Some(tail) = &stats.tail {
            self.detail(format_args!(
                "tail {} ({} is beyond trust, from {} pixels); light of events not met yet {:.2} %, at most {:.2} %",
                tail.verdict,
                format_args!("k={:.2}", tail.k_limit),
                tail.pixels,
                100.0 * tail.unseen_share,
                100.0 * tail.unseen_at_most
            ));
        }
        if let Some(p) = &stats.prediction {
            if let Some(caution) = p.caution {
                let [low, _] = p.seconds_interval;
                self.detail(format_args!("predicted after {:.1} s: at least {low:.1} s; {caution}", p.after_s));
            }
            self.detail(format_args!(
                "predicted after {:.1} s: {:.1} s (95 %: {:.1} to {:.1} s), {:.0} spp; taken {:.1} s, {} spp",
                p.after_s, p.seconds, p.seconds_interval[0], p.seconds_interval[1], p.spp, p.taken_s, p.taken_spp
            ));
        }
        let b = &stats.backend;
        self.detail(format_args!(
            "backend {} {} ({}), rays {}, hierarchy {}; {} camera, {} bounce, {} shadow rays",
            b.name,
            b.version,
            b.isa,
            b.rays,
            bytes(b.bvh_bytes),
            count(stats.rays.camera),
            count(stats.rays.bounce),
            count(stats.rays.shadow)
        ));
        let unused = Processor::detect().unused();
        if !unused.is_empty() {
            self.detail(format_args!("shading {}: {} unused, {TARGET_CPU}", stats.isa, unused.join(", ")));
        }
        self.detail(format_args!(
            "load {:.2} s, build {:.2} s, write {:.2} s, total {:.2} s, peak memory {}",
            s.load,
            s.build,
            s.write,
            s.total,
            stats.peak_rss_bytes.map_or("unknown".into(), bytes)
        ));
        self.biases(stats);
        if stats.invalid_rays > 0 {
            self.note(format_args!(
                "pathspace: warning: {} rays were not finite and count as misses",
                stats.invalid_rays
            ));
        }
        if let Some(first) = stats.nonfinite_first.first() {
            let ([x, y], sample) = (first.pixel, first.sample);
            let bounce = first.bounce.map_or(String::new(), |bounce| format!(" bounce {bounce}"));
            self.note(format_args!(
                "pathspace: warning: {} samples were not finite and count as 0, the first at pixel {x},{y} sample \
                 {sample}{bounce}; --pixel {x},{y} --sample {sample} shows its path",
                stats.nonfinite
            ));
        }
    }
}

/// The line for people: files, size, noise, samples, seconds, and what less noise would cost.
fn closing(stats: &Stats, written: &[String], part: Option<(u64, u64)>) -> String {
    let ([w, h], seconds) = (stats.resolution, stats.seconds.render);
    if let Some((start, end)) = part {
        let (files, time) = (written.join(", "), duration(seconds));
        return format!("wrote {files} ({w}x{h}, samples {start}..{end}): {time}; `pathspace merge` joins the parts");
    }
    let mut line = format!("wrote {} ({w}x{h}, {} spp): ", written.join(", "), spp(stats));
    let Some(error) = stats.error.as_ref().filter(|error| error.relmse > 0.0) else {
        line += &format!("{} of rendering", duration(seconds));
        return line;
    };
    let noise = 100.0 * error.relmse.sqrt();
    line += &format!("noise {noise:.1} %, {}", duration(seconds));
    if let Some(told) = stats.denoised.as_ref().and_then(DenoiseStats::told) {
        line += &format!("; denoised {told}");
    }
    // Noise falls with the square root of the samples.
    let half = format!("--error {:.*}%", usize::from(noise < 20.0) + usize::from(noise < 2.0), 0.5 * noise);
    // Where few bright samples carry the noise, more of them may come.
    let tame = stats.tail.as_ref().is_none_or(TailStats::is_tame);
    let about = if tame { "about" } else { "at least" };
    line + &format!("; half of it takes {about} {} ({half})", duration(4.0 * seconds))
}

/// Seconds as people say them: "0.4 s", "12 s", "3 min", "2.5 h".
pub fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 9.95 => format!("{s:.1} s"),
        s if s < 99.5 => format!("{s:.0} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

/// Prints one line to stderr.
pub fn stderr_line(line: impl Display) {
    // Nothing can be reported when stderr is gone.
    let _ = writeln!(std::io::stderr().lock(), "{}", plain(&line.to_string()));
}

/// A count with three digits and a decimal prefix, without a space behind it: "12.3 M", "999".
pub fn count(n: u64) -> String {
    let scales = [(1e12, "T"), (1e9, "G"), (1e6, "M"), (1e3, "k")];
    match scales.into_iter().find(|(scale, _)| n as f64 >= *scale) {
        Some((scale, prefix)) => {
            let value = n as f64 / scale;
            format!("{value:.0$} {prefix}", digits(value))
        }
        None => n.to_string(),
    }
}

/// A number of bytes: "12.3 MB", "999 B".
pub fn bytes(n: u64) -> String {
    let space = if n < 1000 { " " } else { "" };
    format!("{}{space}B", count(n))
}

/// Decimals that make three digits of a number in [1, 1000).
fn digits(value: f64) -> usize {
    if value < 10.0 {
        2
    } else if value < 100.0 {
        1
    } else {
        0
    }
}

fn spp(stats: &Stats) -> String {
    if stats.spp.min == stats.spp.max {
        stats.spp.min.to_string()
    } else {
        format!("{} to {}", stats.spp.min, stats.spp.max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_have_three_digits() {
        assert_eq!(
            [0, 999, 1000, 12_345, 123_456, 1_234_567].map(count),
            ["0", "999", "1.00 k", "12.3 k", "123 k", "1.23 M"]
        );
        assert_eq!([999, 12_345].map(bytes), ["999 B", "12.3 kB"]);
    }

    #[test]
    fn durations_are_said_briefly() {
        assert_eq!([0.42, 12.3, 180.0, 9000.0].map(duration), ["0.4 s", "12 s", "3 min", "2.5 h"]);
    }

    #[test]
    fn flags_map_to_verbosity() {
        assert_eq!(Verbosity::of(true, false), Verbosity::Quiet);
        assert_eq!(Verbosity::of(false, true), Verbosity::Verbose);
        assert_eq!(Verbosity::of(false, false), Verbosity::Normal);
    }
}
