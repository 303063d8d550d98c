//! SIGINT and SIGTERM: the first asks the render to stop at the next callback, so that what was rendered is written; the
//! second ends the process at once. Exit codes are 128 + the signal's number.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use crate::error::{Error, Result};

/// The signals that have arrived.
pub struct Signals {
    /// Number of the last one; 0 for none.
    last: Arc<AtomicUsize>,
}

impl Signals {
    /// Starts to listen.
    ///
    /// # Errors
    /// [`Error::Io`] when the system refuses a handler.
    pub fn listen() -> Result<Self> {
        let (armed, last) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicUsize::new(0)));
        for signal in [SIGINT, SIGTERM] {
            // In this order: a handler that finds itself armed ends the process, the first signal arms it.
            flag::register_conditional_shutdown(signal, 128 + signal, armed.clone())
                .and_then(|_| flag::register(signal, armed.clone()))
                .and_then(|_| flag::register_usize(signal, last.clone(), signal as usize))
                .map_err(|source| Error::io("signal handler", "install", source))?;
        }
        Ok(Signals { last })
    }

    /// Exit code of the signal that has arrived, if one has.
    pub fn exit_code(&self) -> Option<u8> {
        match self.last.load(Ordering::SeqCst) {
            0 => None,
            signal => Some(128 + signal as u8),
        }
    }
}
