//! Steps that say nothing while they run: a line on stderr once one takes longer than a second, and each ten from then
//! on.

use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use super::report::{Verbosity, stderr_line};

/// After how long a step says that it runs.
const FIRST: Duration = Duration::from_secs(1);

/// How often it repeats that.
const AGAIN: Duration = Duration::from_secs(10);

/// A step that runs, until it is dropped.
pub struct Waiting {
    ended: Arc<(Mutex<bool>, Condvar)>,
    thread: Option<JoinHandle<()>>,
}

impl Waiting {
    /// The step `what` begins.
    pub fn begin(verbosity: Verbosity, what: &'static str) -> Self {
        let ended = Arc::<(Mutex<bool>, Condvar)>::default();
        let seen = ended.clone();
        let tell = move || {
            let (start, mut next) = (Instant::now(), FIRST);
            let mut done = seen.0.lock().unwrap_or_else(PoisonError::into_inner);
            while !*done {
                let left = next.saturating_sub(start.elapsed());
                done = seen.1.wait_timeout(done, left).unwrap_or_else(PoisonError::into_inner).0;
                if !*done && start.elapsed() >= next {
                    stderr_line(format_args!("{what} … {} s", start.elapsed().as_secs()));
                    next += if next == FIRST { AGAIN - FIRST } else { AGAIN };
                }
            }
        };
        // Without a thread nothing is told; the step itself does not need it.
        let thread =
            (verbosity >= Verbosity::Normal).then(|| thread::Builder::new().stack_size(1 << 18).spawn(tell).ok());
        Waiting { ended, thread: thread.flatten() }
    }
}

impl Drop for Waiting {
    fn drop(&mut self) {
        *self.ended.0.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.ended.1.notify_all();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
