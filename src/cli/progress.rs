//! Progress of a render: a bar on a terminal, a plain line each 10 % (at most one a second, unless asked for), JSON
//! objects on stdout, or nothing.
//!
//! While a render runs, `spp` counts the samples that every pixel has, so it lags by the pass at hand, and 100 % is not
//! said: that line is made from the finished film. A render that was broken off never says 100 %.
//!
//! `--progress ndjson` writes one object a line, at most four a second:
//! `{"type":"progress","t":12.3,"spp":64,"pct":25.0, "err":0.021,"target":0.01,"eta":40.1,"mrays":31.2}` (t and eta in
//! seconds; err and target are relative RMSE, `null` when unknown or not asked for; mrays in 10⁶ rays a second), with
//! an error target also `"predicted":{"seconds":52.4,"interval": [45.0,61.0],"spp":96}` of the whole render once the
//! looks so far tell (and in it `"at_least":true` where the tail leaves the lower ends alone), then exactly one
//! `completed` or `failed`; of a sequence, one `completed` for each frame that is rendered, and all lines of frames say
//! which (`"frame":7`). It was asked for, so it goes to stdout. `--progress openjd` writes `openjd_progress: PERCENT`
//! (of all frames) and `openjd_status: TEXT` there each second, and `openjd_fail: TEXT` where the command failed.

use std::io::{self, IsTerminal, Write};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle, TermLike};
use serde::Serialize;

use super::args::ProgressKind;
use super::report::{Verbosity, stderr_line};
use crate::error::Error;
use crate::plain::one_line;
use crate::render::{Progress, Render, StopReason};
use crate::stats::Stats;

/// Shortest time between two reports to Open Job Description.
const OPENJD_INTERVAL: Duration = Duration::from_secs(1);

/// Shortest time between two objects of ndjson.
const NDJSON_INTERVAL: Duration = Duration::from_millis(250);

/// Shortest time between two plain lines that nobody asked for, and before the first.
const PLAIN_INTERVAL: Duration = Duration::from_secs(1);

/// Most that a running render claims to have done: limits are checked between passes only.
const RUNNING_FRACTION: f64 = 0.999;

/// Resolution of the bar.
const BAR_STEPS: u64 = 1000;

/// Shows how far a render is.
pub struct ProgressView {
    display: Display,
    /// Error target, if there is one.
    target: Option<f64>,
    part: Option<PartOf>,
}

/// Which frame of a sequence is rendered.
#[derive(Clone, Copy, Debug)]
pub struct PartOf {
    /// Its number.
    pub frame: u32,
    /// How many are done before it.
    pub done: usize,
    /// How many there are.
    pub frames: usize,
}

enum Display {
    Bar(ProgressBar),
    /// `brief`: at most a line a second, and none of a render that is done within one.
    Plain {
        next_percent: u32,
        brief: bool,
        last: Duration,
    },
    Ndjson {
        last: Option<Duration>,
    },
    /// As [`Display::Ndjson`], in the words of Open Job Description.
    Openjd {
        last: Option<Duration>,
    },
    None,
}

/// A line of ndjson while rendering.
#[derive(Serialize)]
struct ProgressLine {
    r#type: &'static str,
    t: f64,
    spp: u64,
    pct: f64,
    err: Option<f64>,
    target: Option<f64>,
    eta: Option<f64>,
    mrays: f64,
    /// The frame of a sequence.
    #[serde(skip_serializing_if = "Option::is_none")]
    frame: Option<u32>,
    /// Of the whole render, where there is an error target: seconds, their 95 % interval, samples per pixel.
    #[serde(skip_serializing_if = "Option::is_none")]
    predicted: Option<PredictedLine>,
}

/// `predicted` of a line.
#[derive(Serialize)]
struct PredictedLine {
    seconds: f64,
    interval: [f64; 2],
    spp: f64,
    /// Only the lower end is to be relied on: the tail is not tame.
    #[serde(skip_serializing_if = "is_false")]
    at_least: bool,
}

fn is_false(flag: &bool) -> bool {
    !flag
}

/// The last line of ndjson.
#[derive(Serialize)]
#[serde(tag = "type", rename_all = "lowercase")]
enum FinalLine<'a> {
    Completed {
        t: f64,
        spp: f64,
        stop: &'static str,
        err: Option<f64>,
        target: Option<f64>,
        exit: u8,
        #[serde(skip_serializing_if = "Option::is_none")]
        frame: Option<u32>,
    },
    Failed {
        error: &'a str,
        exit: u8,
    },
}

impl ProgressView {
    /// A view of the kind asked for, of a render or of a frame. Quiet renders show progress only where it was asked for
    /// by name.
    pub fn new(kind: ProgressKind, verbosity: Verbosity, target: Option<f64>, part: Option<PartOf>) -> Self {
        let terminal = io::stderr().is_terminal() && std::env::var_os("TERM").is_none_or(|term| term != "dumb");
        let display = match kind {
            ProgressKind::Auto if verbosity == Verbosity::Quiet => Display::None,
            ProgressKind::Auto if terminal => Display::Bar(bar(ProgressDrawTarget::stderr())),
            ProgressKind::Tty if terminal => Display::Bar(bar(ProgressDrawTarget::stderr())),
            ProgressKind::Tty => Display::Bar(bar(ProgressDrawTarget::term_like(Box::new(AssumedTerminal)))),
            ProgressKind::Auto => Display::Plain { next_percent: 10, brief: true, last: Duration::ZERO },
            ProgressKind::Plain => Display::Plain { next_percent: 10, brief: false, last: Duration::ZERO },
            ProgressKind::Ndjson => Display::Ndjson { last: None },
            ProgressKind::Openjd => Display::Openjd { last: None },
            ProgressKind::None => Display::None,
        };
        ProgressView { display, target, part }
    }

    /// Shows the state `p` of a running render.
    pub fn update(&mut self, p: &Progress) {
        let due = match &self.display {
            // The line after 90 % is that of the finished render.
            Display::Plain { .. } => p.fraction < 1.0,
            Display::Ndjson { last } => last.is_none_or(|last| p.elapsed >= last + NDJSON_INTERVAL),
            Display::Openjd { last } => last.is_none_or(|last| p.elapsed >= last + OPENJD_INTERVAL),
            _ => true,
        };
        if due {
            self.show(&Progress { fraction: p.fraction.min(RUNNING_FRACTION), ..*p });
        }
    }

    /// The samples are done: shows the end, unless the render was broken off, and takes the bar off the terminal.
    pub fn finish(&mut self, render: &Render) {
        match &self.display {
            Display::Bar(bar) => bar.finish_and_clear(),
            Display::None => {}
            _ if render.stop == StopReason::Callback => {}
            _ => self.show(&Progress {
                elapsed: render.render_time,
                spp: render.film.spp().min,
                fraction: 1.0,
                relmse: render.film.error_estimate().map(|estimate| estimate.relmse),
                predicted: None,
                rays: render.counters.rays(),
            }),
        }
    }

    fn show(&mut self, p: &Progress) {
        let t = p.elapsed.as_secs_f64();
        let eta = (p.fraction > 0.0).then(|| t * (1.0 - p.fraction) / p.fraction);
        let mrays = if t > 0.0 { p.rays as f64 * 1e-6 / t } else { 0.0 };
        let err = p.relmse.map(f64::sqrt);
        let facts = || {
            let error = err.map_or(String::new(), |err| format!(", error {:.2} %", 100.0 * err));
            let predicted = p.predicted.filter(|_| p.fraction < 1.0).map_or(String::new(), |p| {
                let [low, high] = p.seconds_interval.map(clock);
                match p.caution() {
                    Some(_) => format!(", at least {low} expected"),
                    None => format!(", {} expected ({low} to {high})", clock(p.seconds)),
                }
            });
            format!("{} spp{error}{predicted}, {mrays:.1} Mrays/s", p.spp)
        };
        match &mut self.display {
            Display::Bar(bar) => {
                bar.set_message(format!("{}, {} left", facts(), eta.map_or("?".into(), clock)));
                bar.set_position((p.fraction * BAR_STEPS as f64) as u64);
            }
            Display::Plain { brief: true, last, .. } if p.elapsed < *last + PLAIN_INTERVAL => {}
            Display::Plain { next_percent, last, .. } => {
                if let Some(percent) = due_percent(next_percent, p.fraction) {
                    *last = p.elapsed;
                    stderr_line(format_args!("{percent:3} %  {}  {}", clock(t), facts()));
                }
            }
            Display::Ndjson { last } => {
                *last = Some(p.elapsed);
                let pct = (1000.0 * p.fraction).round() / 10.0;
                let predicted = p.predicted.map(|p| PredictedLine {
                    seconds: p.seconds,
                    interval: p.seconds_interval,
                    spp: p.spp,
                    at_least: p.caution().is_some(),
                });
                let (spp, target, frame) = (p.spp, self.target, self.part.map(|part| part.frame));
                ndjson(&ProgressLine { r#type: "progress", t, spp, pct, err, target, eta, mrays, frame, predicted });
            }
            Display::Openjd { last } => {
                *last = Some(p.elapsed);
                let share = self.part.map_or(p.fraction, |part| (part.done as f64 + p.fraction) / part.frames as f64);
                stdout_lines(&format!("openjd_progress: {:.1}\nopenjd_status: {}\n", 100.0 * share, facts()));
            }
            Display::None => {}
        }
    }

    /// The render ended and its files are written.
    pub fn completed(&self, stats: &Stats, exit: u8) {
        if let Display::Ndjson { .. } = self.display {
            let err = stats.error.map(|error| error.relmse.sqrt());
            let (t, spp, target) = (stats.seconds.total, stats.spp.mean, self.target);
            let frame = self.part.map(|part| part.frame);
            ndjson(&FinalLine::Completed { t, spp, stop: stats.stop, err, target, exit, frame });
        }
    }
}

/// The last line of ndjson when the command failed, at whatever step.
pub fn failed(kind: ProgressKind, error: &Error) {
    if kind == ProgressKind::Openjd {
        stdout_lines(&format!("openjd_fail: {}\n", one_line(&error.to_string())));
    }
    if kind == ProgressKind::Ndjson {
        ndjson(&FinalLine::Failed { error: &error.to_string(), exit: error.exit_code() });
    }
}

/// The percentage to print, if `fraction` has come to the next step of 10 %; moves the step on.
fn due_percent(next_percent: &mut u32, fraction: f64) -> Option<u32> {
    let percent = (100.0 * fraction) as u32;
    let due = percent >= *next_percent;
    if due {
        *next_percent = percent / 10 * 10 + 10;
    }
    due.then_some(percent)
}

fn stdout_lines(lines: &str) {
    let mut out = io::stdout().lock();
    // A reader that has gone away does not stop the render.
    let _ = out.write_all(lines.as_bytes()).and_then(|()| out.flush());
}

fn ndjson(line: &impl Serialize) {
    let text = serde_json::to_string(line).expect("records of numbers and strings are valid JSON");
    stdout_lines(&format!("{text}\n"));
}

fn bar(target: ProgressDrawTarget) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:24} {percent:>3} %  {msg}").expect("the template is well-formed");
    ProgressBar::with_draw_target(Some(BAR_STEPS), target).with_style(style)
}

/// Seconds as people read them: "42 s", "3:05", "2:03:09".
fn clock(seconds: f64) -> String {
    let s = seconds.round() as u64;
    match s {
        0..60 => format!("{s} s"),
        60..3600 => format!("{}:{:02}", s / 60, s % 60),
        _ => format!("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60),
    }
}

/// stderr treated as a terminal of 100 columns that understands the ANSI control sequences, for `--progress tty` where
/// the system sees no terminal.
#[derive(Debug)]
struct AssumedTerminal;

impl AssumedTerminal {
    fn control(&self, n: usize, letter: char) -> io::Result<()> {
        if n == 0 { Ok(()) } else { write!(io::stderr(), "\x1b[{n}{letter}") }
    }
}

impl TermLike for AssumedTerminal {
    fn width(&self) -> u16 {
        100
    }
    fn move_cursor_up(&self, n: usize) -> io::Result<()> {
        self.control(n, 'A')
    }
    fn move_cursor_down(&self, n: usize) -> io::Result<()> {
        self.control(n, 'B')
    }
    fn move_cursor_right(&self, n: usize) -> io::Result<()> {
        self.control(n, 'C')
    }
    fn move_cursor_left(&self, n: usize) -> io::Result<()> {
        self.control(n, 'D')
    }
    fn write_line(&self, s: &str) -> io::Result<()> {
        writeln!(io::stderr(), "{s}")
    }
    fn write_str(&self, s: &str) -> io::Result<()> {
        write!(io::stderr(), "{s}")
    }
    fn clear_line(&self) -> io::Result<()> {
        write!(io::stderr(), "\r\x1b[2K")
    }
    fn flush(&self) -> io::Result<()> {
        io::stderr().flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_read_as_people_write_them() {
        assert_eq!([0.4, 59.0, 185.0, 7389.0].map(clock), ["0 s", "59 s", "3:05", "2:03:09"]);
    }

    #[test]
    fn each_step_of_ten_percent_is_due_once() {
        let mut next = 10;
        let fractions = [0.0, 0.09, 0.1, 0.19, 0.15, 0.42, 0.49, 0.5, 0.93, 0.99, 1.0, 1.0];
        let due: Vec<u32> = fractions.iter().filter_map(|f| due_percent(&mut next, *f)).collect();
        assert_eq!(due, [10, 42, 50, 93, 100]);
    }

    #[test]
    fn ndjson_lines_have_the_contracted_keys() {
        let line = ProgressLine {
            r#type: "progress",
            t: 12.3,
            spp: 64,
            pct: 25.0,
            err: Some(0.021),
            target: Some(0.01),
            eta: Some(40.1),
            mrays: 31.2,
            frame: None,
            predicted: None,
        };
        let expected =
            r#"{"type":"progress","t":12.3,"spp":64,"pct":25.0,"err":0.021,"target":0.01,"eta":40.1,"mrays":31.2}"#;
        assert_eq!(serde_json::to_string(&line).expect("JSON"), expected);
        let failed = serde_json::to_string(&FinalLine::Failed { error: "a", exit: 4 }).expect("JSON");
        assert_eq!(failed, r#"{"type":"failed","error":"a","exit":4}"#);
    }
}
