//! SIGINT, SIGTERM and SIGHUP: while a render runs, the first asks it to stop at the next callback, so that what was
//! rendered is written, and the second ends the process at once. Before, while there is nothing to write, the first
//! does. Exit codes are 128 + the signal's number. SIGHUP that is ignored (`nohup`) stays so. SIGUSR1 asks for the
//! picture so far and ends nothing.
//!
//! SIGTERM and SIGHUP often come twice: Slurm, systemd and a closing terminal tell every process, and a shell among
//! them passes its own on. Within a second of the first they are that one.
//!
//! SIGXCPU, the soft limit of processor time (setrlimit(2)), ends a render as they do. It comes again each second, so
//! that it never counts as a second signal. SIGXFSZ, the limit of a file's size, is caught: the write fails instead.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1, SIGXCPU, SIGXFSZ};
use signal_hook::flag;

use super::report::stderr_line;
use crate::error::{Error, Result};

/// Exit code: the limit of processor time has come.
const EXIT_OUT_OF_TIME: u8 = 128 + SIGXCPU as u8;

/// How long SIGTERM and SIGHUP are repetitions, from when the first is seen.
const REPEATED: Duration = Duration::from_secs(1);

/// The signals that have arrived.
pub struct Signals {
    /// Number of the last one; 0 for none.
    last: Arc<AtomicUsize>,
    /// Whether the next one ends the process.
    armed: Arc<AtomicBool>,
    /// Whether it is going to, when [`REPEATED`] has passed.
    arming: AtomicBool,
    /// Whether the picture so far was asked for.
    request: Arc<AtomicBool>,
    /// Whether the limit of processor time ends the process.
    loading: Arc<AtomicBool>,
    /// Whether it has come.
    out_of_time: Arc<AtomicBool>,
}

impl Signals {
    /// Starts to listen: signals end the process until [`defer`](Self::defer).
    ///
    /// # Errors
    /// [`Error::Io`] when the system refuses a handler.
    pub fn listen() -> Result<Self> {
        let (armed, last) = (Arc::new(AtomicBool::new(true)), Arc::new(AtomicUsize::new(0)));
        let heard = [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|&signal| signal != SIGHUP || !is_ignored(signal));
        for signal in heard {
            // In this order: a handler that finds itself armed ends the process, the first SIGINT arms it.
            flag::register_conditional_shutdown(signal, 128 + signal, armed.clone())
                .and_then(|id| if signal == SIGINT { flag::register(signal, armed.clone()) } else { Ok(id) })
                .and_then(|_| flag::register_usize(signal, last.clone(), signal as usize))
                .map_err(refused)?;
        }
        let request = Arc::new(AtomicBool::new(false));
        flag::register(SIGUSR1, request.clone()).map_err(refused)?;
        let (loading, out_of_time) = (Arc::new(AtomicBool::new(true)), Arc::new(AtomicBool::new(false)));
        if !is_ignored(SIGXCPU) {
            flag::register_conditional_shutdown(SIGXCPU, EXIT_OUT_OF_TIME.into(), loading.clone())
                .and_then(|_| flag::register(SIGXCPU, out_of_time.clone()))
                .map_err(refused)?;
        }
        Ok(Signals { last, armed, arming: false.into(), request, loading, out_of_time })
    }

    /// From now on there is something to write: the next signal is only noted.
    pub fn defer(&self) {
        self.armed.store(false, Ordering::SeqCst);
        self.loading.store(false, Ordering::SeqCst);
    }

    /// Whether the picture so far has been asked for since this was asked last.
    pub fn take_request(&self) -> bool {
        self.request.swap(false, Ordering::SeqCst)
    }

    /// Exit code of the signal that has arrived, if one has.
    pub fn exit_code(&self) -> Option<u8> {
        match self.last.load(Ordering::SeqCst) {
            0 => self.out_of_time.load(Ordering::SeqCst).then_some(EXIT_OUT_OF_TIME),
            signal => {
                if !self.arming.swap(true, Ordering::SeqCst) {
                    self.arm();
                }
                Some(128 + signal as u8)
            }
        }
    }

    /// Lets the next signal end the process once [`REPEATED`] has passed; at once where no thread can wait for that.
    fn arm(&self) {
        let armed = self.armed.clone();
        let wait = move || {
            thread::sleep(REPEATED);
            armed.store(true, Ordering::SeqCst);
        };
        if thread::Builder::new().name("signals".into()).spawn(wait).is_err() {
            self.armed.store(true, Ordering::SeqCst);
        }
    }
}

/// Lets a write beyond the limit of a file's size fail with an error instead of ending the process.
///
/// # Errors
/// [`Error::Io`] when the system refuses a handler.
pub fn survive_file_limits() -> Result<()> {
    // A handler, unlike an ignored signal, is not passed on to other programs.
    flag::register(SIGXFSZ, Arc::default()).map(drop).map_err(refused)
}

/// Says why a command ends, where that is a limit and not somebody's signal.
pub fn explain(exit: u8) {
    if exit == EXIT_OUT_OF_TIME {
        stderr_line("pathspace: error: ended by the limit of processor time (ulimit -t)");
    }
}

fn refused(source: std::io::Error) -> Error {
    Error::io("signal handler", "install", source)
}

/// Whether this process was started with a signal ignored. Source: `SigIgn` of `/proc/PID/status` (proc(5)).
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}
